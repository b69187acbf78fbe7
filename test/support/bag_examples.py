# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A small run, made by hand, for whoever needs a bag of the conventions at once; copies of bags with changes."""

from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np

from msg_conventions.topics import topic_entry
from scenario_gen.bags.storage.bag import open_bag, read_messages
from scenario_gen.bags.storage.messages import BagMessage, BagTopic
from scenario_gen.bags.storage.writer import atomic_bag
from scenario_gen.output.review.evaluation import BagEvaluation
from scenario_gen.types import Encounter, Note, NoteKind, Vehicle
from scenario_gen.types.fit import Fit, FittedVehicle, Route, Segmentation
from scenario_gen.types.generation import GenerationResult
from scenario_gen.types.road import Road
from scenario_gen.types.scenario import BoundaryStates, Cause, Scenario, ScenarioSet


def bag_topics(bag: Path) -> tuple[BagTopic, ...]:
    """Return the topics of a bag by name."""
    with open_bag(bag) as opened:
        return opened.topics()


def copied(bag: Path, target: Path, change: Callable[[BagMessage], bytes | None]) -> Path:
    """Copy a bag; `change` gives the bytes of each message, or None to leave it out."""
    with atomic_bag(target) as writer:
        for message in read_messages(bag):
            if (data := change(message)) is not None:
                writer.add_topic(message.topic, message.type, topic_entry(message.topic)[1])
                writer.write(message.topic, data, message.stamp_ns)
    return target


def skipped(evaluation: BagEvaluation) -> dict[str, int]:
    """Return the number of scenarios by each check that was skipped."""
    return {
        note.values["check"]: note.values["count"]
        for note in evaluation.notes
        if note.kind is NoteKind.NOT_CHECKED
    }


def unaccounted(evaluation: BagEvaluation) -> int:
    """Return the number of scenarios without an entry."""
    counts = [
        note.values["count"] for note in evaluation.notes if note.kind is NoteKind.UNACCOUNTED
    ]
    return sum(counts)


def hand_made_run() -> GenerationResult:
    """Two vehicles pass each other on a straight road."""
    n, t, k = 2, 61, np.array([20, 45])
    time = np.arange(t) * 0.1
    x = np.stack([5.0 * time, 40.0 - 6.0 * time])
    position = np.stack([x, np.array([[-2.0], [2.0]]) * np.ones_like(x)], axis=-1)
    heading = np.array([[0.0], [np.pi]]) * np.ones_like(x)
    speed = np.array([[5.0], [6.0]]) * np.ones_like(x)
    vehicles = (Vehicle("1"), Vehicle("bus 2", 12.0, 2.5))
    encounter = Encounter.sampled(
        vehicles, 0.1, position, heading, speed, "made by hand", 1_600_000_000_000_000_000
    )
    labels = np.searchsorted(k, np.arange(t), side="right")
    segmentation = Segmentation(labels, k, np.isin(np.arange(t), k) * 0.9, ("a", "b", "c"))
    index = np.array([0, *k, t - 1])
    anchors = np.concatenate([position, heading[..., None]], axis=-1)[:, index]
    fitted = tuple(
        FittedVehicle(a, np.zeros(4), np.zeros(3, dtype=bool), 1.0, "straight") for a in anchors
    )
    states = np.concatenate([anchors, speed[:, index, None]], axis=-1)
    asked = BoundaryStates(states[:, 0], states[:, -1])
    fit = Fit(vehicles, fitted, index, asked, (Note.of(NoteKind.SCALED, scale=0.9),))
    routes = tuple(
        Route(
            np.column_stack([p[::2], h[::2]]),
            np.array([0, 10, 22, 30]),
            np.abs(p[::2, 0] - p[0, 0]),
        )
        for p, h in zip(position[:, : t + 1], heading, strict=True)
    )
    road = Road(
        "straight",
        np.ones((50, 300), dtype=bool),
        0.2,
        np.array([-10.0, -5.0]),
        anchors[:, 0],
        anchors[:, -1],
    )
    scenarios = tuple(
        Scenario(
            vehicles, time, position + 0.01 * i, heading, speed, np.zeros((n, t)), seed=7, index=i
        )
        for i in range(5)
    )
    result = ScenarioSet(5, scenarios, 8, Counter({Cause.OVERLAP: 3}))
    return GenerationResult(encounter, segmentation, road, fit, routes, result, seed=7)
