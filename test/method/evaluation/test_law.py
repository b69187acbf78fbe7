# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How encounters of a kind differ, and what sampling makes of it."""

from dataclasses import replace
import json

import numpy as np
import pytest
from scipy.spatial.distance import mahalanobis
from support.reaction_scenes import answering, lane_encounter, wander
from support.textbook_motions import labelled

from scenario_gen import generate, PipelineConfig
from scenario_gen.cli.folder import FolderRequest, generate_all
from scenario_gen.method.evaluation.law import (
    FEATURES,
    features_of,
    JOINT_FEATURES,
    Law,
    measures_in,
    SHIPPED,
)
from scenario_gen.method.sampling import (
    checker_of,
    NaturalScenarios,
    Plan,
    SamplingConfig,
)
from scenario_gen.types import (
    Cause,
    NoteKind,
    Request,
    Scenario,
)

POPULATION = PipelineConfig(sampling=SamplingConfig())
NAMES = FEATURES + JOINT_FEATURES
APPROACH = FEATURES.index("approach")
KIND = "crossing, rolls"


def as_scenario(encounter, pace=1.0):
    """The encounter driven `pace` times as fast."""
    return Scenario(
        encounter.vehicles,
        encounter.time,
        encounter.position,
        encounter.heading,
        encounter.speed * pace,
        0.0 * encounter.speed,
    )


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


def test_the_shipped_law_is_one_of_these_features_names_its_source_and_has_no_rows():
    document = json.loads(SHIPPED.read_text())
    assert "public domain" in document["source"] and tuple(document["features"]) == NAMES
    for law in document["kinds"].values():
        assert (
            set(law) == {"encounters", "mean", "covariance"}
            and np.linalg.eigvalsh(law["covariance"]).min() > 0.0
        )


def test_few_encounters_hardly_move_the_shipped_law_and_many_make_it_theirs():
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


def test_distances_are_those_of_the_pooled_law_with_smaller_correlations():
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


def test_the_joint_features_know_who_answers_the_other():
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


def test_what_no_recorded_driver_does_is_rarer_and_others_that_do_it_make_it_usual(encounters):
    own, fast = encounters[0], replace(encounters[0], speed=3.0 * encounters[0].speed)
    rarity = measures_in(1.0, own).rarity
    alike = measures_in(1.0, own, [replace(fast, name=f"fast {n}") for n in range(9)]).rarity
    assert rarity(as_scenario(own, 3.0)) > 1.5 * rarity(as_scenario(own))
    assert alike(as_scenario(own, 3.0)) < 0.7 * rarity(as_scenario(own, 3.0))
    assert measures_in(0.0, own).rarity is None


def test_the_template_counts_once_whether_it_is_named_or_not(encounters):
    scenario = as_scenario(encounters[1])
    named, unnamed = (
        measures_in(1.0, encounters[0], others).rarity for others in (encounters, encounters[1:])
    )
    assert named(scenario) == pytest.approx(unnamed(scenario))


def test_encounters_are_told_apart_by_what_they_are_and_not_by_their_names(encounters):
    scenario = as_scenario(encounters[1])
    others, copies = [replace(one, name="log") for one in encounters[1:]], 5 * [encounters[0]]
    named, alike, copied = (
        measures_in(1.0, encounters[0], given).rarity(scenario)
        for given in (encounters[1:], others, copies)
    )
    assert alike == pytest.approx(named)
    assert copied == pytest.approx(measures_in(1.0, encounters[0]).rarity(scenario))


def test_vehicles_that_share_no_area_are_in_no_population(encounters):
    position = encounters[0].position.copy()
    position[0] += 1000.0
    assert (
        measures_in(1.0, encounters[0]).rarity(
            as_scenario(replace(encounters[0], position=position))
        )
        == np.inf
    )


def test_approaches_of_a_set_spread_towards_those_of_the_population(sets, encounters):
    def spread(motions):
        return np.std([features_of(motion, "", 0).features[APPROACH] for motion in motions])

    population, one_driver = map(spread, sets)
    assert 1.2 * one_driver < population < spread(encounters)


def test_scenarios_say_their_rarity_and_the_others_are_counted(sets):
    population, one_driver = (made.generated for made in sets)
    rarities = np.array([scenario.facts.rarity for scenario in population])
    assert len(population) == 40 and population.refused[Cause.UNUSUAL] > 0
    (note,) = (note for note in population.adaptations if note.kind is NoteKind.UNUSUAL)
    assert 1.0 < rarities.max() <= note.values["rarity"] + 1e-9
    assert not one_driver.refused[Cause.UNUSUAL] and one_driver[0].facts.rarity is None


def test_the_same_seed_gives_the_same(sets, encounters):
    made = sets[0]
    again = generate(encounters, "corridor", POPULATION, count=5, seed=5)
    assert [one.index for one in again] == [one.index for one in made][:5]


def test_an_unusual_template_keeps_its_least_rare_ones_and_says_so(encounters):
    others = [
        replace(other, name=f"{n}", speed=0.1 * other.speed)
        for n, other in enumerate(4 * encounters)
    ]
    made = generate([encounters[0], *others], "corridor", POPULATION, count=10, seed=5)
    assert len(made) == 10 and any(
        note.kind is NoteKind.UNUSUAL for note in made.generated.adaptations
    )


def test_natural_scenarios_of_a_population_are_usual_too(sets, encounters):
    plan, sampling = (
        Plan.of(sets[0], POPULATION.sampling, POPULATION.limits, Request()),
        POPULATION.sampling,
    )
    measures = measures_in(1.0, encounters[0], encounters)
    check = checker_of(plan, sampling, POPULATION.limits, Request()).check
    natural, any_of_them = (
        NaturalScenarios.of(plan, check, sampling, 5, given) for given in (measures, None)
    )
    numbers = np.random.default_rng(0).standard_normal((40, natural.size))
    usual, valid = natural.scenarios(numbers), any_of_them.scenarios(numbers)
    kept = [
        one is not None and measures.rarity(one) <= natural.filters.rarity.max_rarity
        for one in valid
    ]
    assert [one is not None for one in usual] == kept and sum(kept) < sum(
        one is not None for one in valid
    )


def test_a_command_generates_each_encounter_as_a_call_or_a_node_that_knows_it_alone(encounters):
    pairs = [(encounter, "corridor") for encounter in encounters[:2]]
    made, _ = generate_all(pairs, FolderRequest([], POPULATION, count=5, seed=5))
    alone = [generate(*pair, POPULATION, count=5, seed=5) for pair in pairs]
    assert made == alone
    assert [each.generated.refused for each in made] == [each.generated.refused for each in alone]
