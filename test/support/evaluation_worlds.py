# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Small worlds with known answers: a crossing of two cars, and samples around it."""

from collections import Counter
from dataclasses import replace
from functools import cache

import numpy as np

from scenario_gen.method.evaluation import evaluate_scenarios, EvaluationConfig
from scenario_gen.types import Encounter, Note, NoteKind, Vehicle, with_witness
from scenario_gen.types.fit import Fit, FittedVehicle, Route, Segmentation
from scenario_gen.types.generation import GenerationResult
from scenario_gen.types.road import Road
from scenario_gen.types.scenario import BoundaryStates, Cause, EgoSlot, Scenario, ScenarioSet

CARS = (Vehicle("west", 4.0, 2.0), Vehicle("south", 4.0, 2.0))


def crossing(dt=0.1, steps=121, lag=2.0):
    """Car 0 drives east at 10 m/s through the origin at t = 5 s; car 1 north, `lag` seconds later, slowing a little."""
    time = np.arange(steps) * dt
    east = 10.0 * (time - 5.0)
    pace = 9.0 + 2.0 * np.cos(2.0 * np.pi * time / time[-1])
    north = np.concatenate([[0.0], np.cumsum(0.5 * (pace[1:] + pace[:-1]) * dt)])
    north -= np.interp(5.0 + lag, time, north)
    zero = np.zeros_like(time)
    position = np.stack([np.stack([east, zero], -1), np.stack([zero, north], -1)])
    heading = np.stack([zero, zero + np.pi / 2])
    return Encounter.sampled(
        CARS, dt, position, heading, np.stack([zero + 10.0, pace]), "crossing"
    )


def replayed(encounter, index=0, shift=(0.0, 0.0), pace=1.0):
    """The encounter as a scenario: shifted, and its speeds scaled about their mean by `pace`."""
    mean = encounter.speed.mean(axis=1, keepdims=True)
    speed = mean + pace * (encounter.speed - mean)
    dt = encounter.dt
    step = 0.5 * (speed[:, 1:] + speed[:, :-1]) * dt
    along = np.concatenate([np.zeros((len(speed), 1)), np.cumsum(step, axis=1)], axis=1)
    way = np.stack([np.cos(encounter.heading), np.sin(encounter.heading)], axis=-1)
    position = encounter.position[:, :1] + along[..., None] * way + np.asarray(shift)
    return Scenario(
        encounter.vehicles,
        encounter.time,
        position,
        encounter.heading,
        speed,
        np.gradient(speed, dt, axis=1),
        index=index,
    )


def samples(encounter, count, seed=3, spread=0.5, pace=1.0):
    """`count` scenarios around the encounter, shifted at random."""
    rng = np.random.default_rng(seed)
    return [
        replayed(encounter, i, rng.normal(0.0, spread, 2), pace + rng.normal(0.0, 0.1))
        for i in range(count)
    ]


def cross_road():
    """A cross of two 10 m wide roads, 140 m long, in cells of 0.5 m."""
    centre = (np.arange(280) + 0.5) * 0.5 - 70.0
    drivable = (np.abs(centre)[:, None] < 5.0) | (np.abs(centre)[None, :] < 5.0)
    entries = np.array([[-70.0, 0.0, 0.0], [0.0, -70.0, np.pi / 2]])
    exits = np.array([[70.0, 0.0, 0.0], [0.0, 70.0, np.pi / 2]])
    return Road("cross", drivable, 0.5, np.array([-70.0, -70.0]), entries, exits)


@cache
def report_case(count=12, name="crossing"):
    """A whole case of the report, around the crossing."""
    cars = (
        CARS[0],
        replace(CARS[1], id="south" if name == "crossing" else "A_VEHICLE_WITH_A_LONG_NAME"),
    )
    encounter = replace(crossing(), name=name, vehicles=cars)
    steps = encounter.speed.shape[1]
    labels = np.repeat([0, 1, 0], [40, 40, steps - 80])
    time = np.arange(steps)
    probability = np.exp(-((time - 40) ** 2) / 8.0) + 0.7 * np.exp(-((time - 80) ** 2) / 20.0)
    told = ("west drives on, south brakes", "west drives on, south drives slowly", "both drive on")
    segmentation = Segmentation(labels, np.array([40, 80]), probability, told)
    index = np.array([0, 40, 80, steps - 1])
    fitted, routes = [], []
    for n in range(2):
        poses = np.column_stack([encounter.position[n], encounter.heading[n]])
        moved, stands = np.array([0.0, 0.12, 0.0, 0.0]), np.zeros(3, dtype=bool)
        fitted.append(FittedVehicle(poses[index], moved, stands, 1.0, "straight"))
        length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T))])
        routes.append(Route(poses, index, length))
    ends = [
        np.column_stack([encounter.position[:, k], encounter.heading[:, k], encounter.speed[:, k]])
        for k in (0, -1)
    ]
    notes = (Note.of(NoteKind.ANCHOR_MOVED, vehicle="south", anchor="end", distance=0.12),)
    fit = Fit(encounter.vehicles, tuple(fitted), index, BoundaryStates(*ends), notes)
    oracle = replayed(encounter)
    near = ScenarioSet(
        count,
        tuple(samples(encounter, count)),
        count + 5,
        Counter({Cause.OVERLAP: 3, Cause.LATERAL_ACCELERATION: 2}),
        (Note.of(NoteKind.STRETCHED, percent=3.0),),
    )
    rows = {"with changepoints": near, "replay": [oracle]}
    evaluation = evaluate_scenarios(
        encounter,
        rows,
        changepoints=len(segmentation.changepoints),
        road="cross",
        config=EvaluationConfig(resamples=50),
    )
    return GenerationResult(
        encounter,
        segmentation,
        cross_road(),
        fit,
        routes,
        near,
        0,
        evaluation,
        oracle,
    )


def ego_case(count=4):
    """The case of the report without its first vehicle, whose witness is given instead."""
    case = report_case(count)

    left = tuple(with_witness(scenario, 0) for scenario in case.generated.scenarios)
    slot = EgoSlot(case.encounter.vehicles[0], np.zeros(4), np.ones(4))
    made = replace(case.generated, scenarios=left, ego=slot)
    rows = {"with changepoints": left, "replay": [case.replay]}
    evaluation = evaluate_scenarios(
        case.encounter,
        rows,
        changepoints=len(case.segmentation.changepoints),
        config=EvaluationConfig(resamples=50),
    )
    return replace(case, generated=made, figures=evaluation)
