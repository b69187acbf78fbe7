# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How encounters of a kind differ, and what sampling makes of it."""

from dataclasses import replace
import json

import numpy as np
import pytest
from scipy.spatial.distance import mahalanobis
import shapely
from support.motions import as_scenario
from support.oracle import footprints
from support.reaction_scenes import answering, lane_encounter, wander
from support.textbook_motions import labelled

from scenario_gen import generate, PipelineConfig
from scenario_gen.method.evaluation.law import (
    FEATURES,
    features_of,
    JOINT_FEATURES,
    Law,
    measures_in,
    SHIPPED,
    VEHICLE_FEATURES,
)
from scenario_gen.method.evaluation.measures import distance_and_ttc
from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.situation import find_conflicts
from scenario_gen.types import Cause, NoteKind

POPULATION = PipelineConfig(sampling=SamplingConfig())
NAMES = FEATURES + JOINT_FEATURES
KIND = "crossing, rolls"


@pytest.fixture(scope="module")
def encounters():
    return [labelled(KIND, seed).encounter for seed in range(24)]


@pytest.fixture(scope="module")
def sets(encounters):
    """Of the first encounter: with drivers who differ, and with one driver."""
    return [
        generate(encounters, "corridor", config, count=40, seed=5)
        for config in (POPULATION, PipelineConfig(sampling=SamplingConfig(drivers=0.0)))
    ]


def test_few_encounters_hardly_move_the_law():
    shipped = json.loads(SHIPPED.read_text())["kinds"]["following"]["mean"]
    rng = np.random.default_rng(4)
    centre, spread = np.array(shipped) + 3.0, np.linspace(0.5, 2.0, len(NAMES))
    seen = centre + spread * rng.standard_normal((4000, len(NAMES)))
    none, few, many = (Law.of("following", list(seen[:n])) for n in (0, 1, 4000))
    np.testing.assert_allclose(none.mean, shipped)
    assert np.abs(few.mean - shipped).max() < np.abs(few.mean - seen[0]).max()
    np.testing.assert_allclose(many.mean, centre, atol=0.1)
    distances = np.array([many.distance(row) for row in seen])
    assert abs(np.square(distances).mean() - 1.0) < 0.05


def test_distances_are_those_of_pooled_law():
    """Two prior encounters for the mean and ten for the covariance; correlations lose 30 %."""
    shipped = json.loads(SHIPPED.read_text())["kinds"]["crossing"]
    rng = np.random.default_rng(6)
    seen = np.array(shipped["mean"]) + rng.normal(size=(7, len(NAMES))) @ rng.normal(
        size=2 * (len(NAMES),)
    )
    mean = np.average([shipped["mean"], *seen], axis=0, weights=[2, *np.ones(7)])
    pooled = np.average(
        [shipped["covariance"], *([np.outer(one, one) for one in seen - mean])],
        axis=0,
        weights=[10, *np.ones(7)],
    )
    sigma = np.sqrt(np.diag(pooled))
    correlation = 0.7 * pooled / np.outer(sigma, sigma)
    np.fill_diagonal(correlation, 1.0)
    inverse = np.linalg.inv(np.outer(sigma, sigma) * correlation)
    law = Law.of("crossing", list(seen))
    for row in seen:
        expected = mahalanobis(row, mean, inverse) / np.sqrt(len(NAMES))
        assert law.distance(row) == pytest.approx(expected)


def test_joint_features_know_who_answers():
    rng = np.random.default_rng(3)
    leader, stranger = wander(rng, 200), wander(rng, 200)

    def joint(follower):
        joint = features_of(lane_encounter(leader, follower), "", 0).joint
        return dict(zip(JOINT_FEATURES, joint, strict=True))

    answers, ignores = joint(answering(leader, 0.5, 1.0)), joint(stranger)
    assert answers["correlation of speeds"] > 0.5 > ignores["correlation of speeds"]
    braking = np.gradient(leader, 0.1)[np.gradient(leader, 0.1) < -0.4].mean()
    name = "answer of the second"
    assert answers[name] < 0.4 * braking < ignores[name]


@pytest.mark.parametrize("kind", [KIND, "follows"])
@pytest.mark.parametrize("seed", range(4))
def test_features_are_those_of_loops(kind, seed):
    """Each by its words, from the samples, one vehicle and one instant after the other."""
    one = labelled(kind, seed).encounter
    late = max(0, len(one.time) - 140)
    one = one.between(late, len(one.time) - 1)
    (conflict,) = find_conflicts(one)
    found = features_of(one, "", 0)
    values = dict(zip(NAMES, found.every, strict=True))
    first, second = conflict.first, conflict.second
    dt, place, speed = one.dt, one.position, one.speed
    cars = zip(place, one.heading, one.vehicles, strict=True)
    boxes = [footprints(xy, yaw, car.length, car.width) for xy, yaw, car in cars]
    gap = np.array([shapely.distance(a, b) for a, b in zip(*boxes, strict=True)])
    way = np.diff(place, axis=0)[0] @ [1.0, 1.0j]
    rate = np.diff(speed * np.exp(1j * one.heading), axis=0)[0]
    closing = -(rate * way.conj()).real / np.abs(way)
    assert values["distance"] == pytest.approx(min(gap.min(), 30.0), abs=1e-6)
    if conflict.following:
        headways = [g / v for g, v in zip(gap, speed[second], strict=True) if v > 0.5]
        assert values["gap"] == pytest.approx(min(np.median(headways), 10.0))
    else:
        closing = closing[[round(conflict.entry_first / dt)]]
        assert values["gap"] == pytest.approx(conflict.entry_second - conflict.exit_first)
        assert values["arrival gap"] == pytest.approx(conflict.entry_second - conflict.entry_first)
    least = distance_and_ttc(one, first, second)[1].min()
    assert values["time to collision"] == pytest.approx(min(least, 10.0))
    assert values["closing speed"] == pytest.approx(closing.max())
    assert values["approach"] == pytest.approx(min(conflict.entry_second, 20.0))
    entries = ((first, conflict.entry_first, "first"), (second, conflict.entry_second, "second"))
    for n, entry, name in entries:
        own = speed[n].tolist()
        at = min(round(entry / dt), len(own) - 1)
        changes = [b - a for a, b in zip(own, own[10:], strict=False)]
        assert [values[f"{one} of the {name}"] for one in VEHICLE_FEATURES] == pytest.approx(
            [
                own[0],
                min(own[: at + 1]),
                own[at],
                max(-min(changes), 0.0),
                max(*changes, 0.0),
                dt * sum(v < 0.5 for v in own),
            ]
        )
    clears = conflict.exit_first if np.isfinite(conflict.exit_first) else conflict.entry_first
    left = int(np.searchsorted(one.time, clears))
    enters = int(np.searchsorted(one.time, conflict.entry_second))
    way = dt * sum(speed[second][left:enters]) - dt * sum(speed[second][enters:left])
    assert values["way of the second at the clearing"] == pytest.approx(np.clip(way, -30.0, 30.0))
    braking = np.gradient(speed[first], dt) < -0.4
    near = np.abs(one.time - conflict.entry_first) <= 1.0
    answer = np.gradient(speed[second], dt)[braking | near].mean()
    assert values["answer of the second"] == pytest.approx(answer)


def test_unusual_driving_is_rarer(encounters):
    own, fast = encounters[0], replace(encounters[0], speed=3.0 * encounters[0].speed)
    rarity = measures_in(1.0, own).rarity
    alike = measures_in(1.0, own, [replace(fast, name=f"fast {n}") for n in range(9)]).rarity
    assert rarity(as_scenario(own, 3.0)) > 1.5 * rarity(as_scenario(own))
    assert alike(as_scenario(own, 3.0)) < 0.7 * rarity(as_scenario(own, 3.0))
    assert measures_in(0.0, own).rarity is None


def test_encounters_are_told_apart_by_motion(encounters):
    scenario = as_scenario(encounters[1])
    others, copies = [replace(one, name="log") for one in encounters[1:]], 5 * [encounters[0]]
    named, alike, copied = (
        measures_in(1.0, encounters[0], given).rarity(scenario)
        for given in (encounters[1:], others, copies)
    )
    assert alike == pytest.approx(named)
    assert copied == pytest.approx(measures_in(1.0, encounters[0]).rarity(scenario))


def test_scenarios_state_their_rarity(sets):
    population, one_driver = (made.generated for made in sets)
    rarities = np.array([scenario.facts.rarity for scenario in population])
    assert len(population) == 40 and population.refused[Cause.UNUSUAL] > 0
    (note,) = (note for note in population.adaptations if note.kind is NoteKind.UNUSUAL)
    assert 1.0 < rarities.max() <= note.values["rarity"] + 1e-9
    assert not one_driver.refused[Cause.UNUSUAL] and one_driver[0].facts.rarity is None
