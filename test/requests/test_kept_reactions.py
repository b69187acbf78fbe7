# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Requests of every kind keep the reactions of the template: an ego slot, late arrivals, groups, targets, choices."""

from dataclasses import replace

import numpy as np
import pytest
from support.given import answer, Given
from support.reaction_scenes import answering, crossing, lane_encounter, platoon, wander

from benchmarks._interaction_measures import following, yielding
from scenario_gen.bags.recordings.write import write_recording
from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.method.segmentation import segment
from scenario_gen.method.validity import Limits
from scenario_gen.output.review.evaluation import evaluate_bag
from scenario_gen.pipeline import PipelineConfig
from scenario_gen.roads import build_road
from scenario_gen.types import FOLLOW, join_ego
from scenario_gen.types.request import Request

LANE = lane_encounter(LEADER := wander(np.random.default_rng(3), 200), answering(LEADER, 1.2, 0.9))


def late(encounter, who, sample):
    """The encounter with one vehicle there only from a sample on."""
    present = encounter.present.copy()
    present[who, 0] = sample
    return replace(encounter, present=present)


def made(encounter, request=Request(), count=20):
    road, segmentation = build_road("corridor", encounter), segment(encounter, seed=1)
    given = Given(encounter, segmentation, road, 1, sampling=SamplingConfig())
    return answer(given, request, count=count)


def wholes(result):
    """The scenarios with their witnesses, vehicles in the template's order."""
    ids = [vehicle.id for vehicle in result.encounter.vehicles]
    found = []
    for scenario in map(join_ego, result.generated.scenarios):
        rows = [[vehicle.id for vehicle in scenario.vehicles].index(known) for known in ids]
        arrays = {
            name: getattr(scenario, name)[rows]
            for name in ("position", "heading", "speed", "acceleration", "present")
        }
        found.append(
            replace(scenario, vehicles=tuple(scenario.vehicles[row] for row in rows), **arrays)
        )
    return found


def assert_kept(result, names):
    """Every scenario names these reactions; followers are as fast as their leaders, at the gaps of drivers who differ; no yielder is early."""
    ids, scenarios = [vehicle.id for vehicle in result.encounter.vehicles], wholes(result)
    edges = result.generated.reactions
    assert [str(edge.named(ids)) for edge in edges] == names
    assert {tuple(map(str, scenario.facts.reactions)) for scenario in scenarios} == {tuple(names)}
    for edge in edges:
        if edge.kind == FOLLOW:
            seen = following(edge, result.encounter, scenarios)
            assert (
                seen.slope > 0.75 and 0.5 < seen.gaps[0] < seen.gaps[1] < 2.0 and seen.own > 0.05
            )
        else:
            seen = yielding(edge, scenarios)
            assert seen.early == 0.0 and seen.spread > 0.0


@pytest.mark.parametrize("ego", ["1", "2"])
def test_ego_slot_keeps_follower_and_leader(ego, tmp_path):
    """The follower answers the witness in the slot before it; a witness in the slot behind answers the leader."""
    result = made(LANE, Request(ego=ego))
    assert all(
        scenario.reference_drive.vehicles[0].id == ego for scenario in result.generated.scenarios
    )
    assert_kept(result, ["2 follows 1"])
    bag = write_recording(tmp_path / "bag", result)
    (found,) = evaluate_bag(bag)
    assert found.causes == {} and found.valid == 20  # with the witness, from the bag alone
    assert len(found.result.generated.reactions) == 1
    (strict,) = evaluate_bag(bag, PipelineConfig(limits=Limits(headway_share=0.01)))
    assert set(strict.causes) == {"reaction"}


def test_an_ego_slot_inside_a_platoon():
    assert_kept(
        made(platoon(4), Request(ego="2"), count=25), ["2 follows 1", "3 follows 2", "4 follows 3"]
    )


@pytest.mark.parametrize("who", [0, 1])
def test_late_arrival_keeps_its_reaction(who):
    result = made(late(LANE, who, 60))
    assert {int(scenario.present[who, 0]) > 0 for scenario in result.generated.scenarios} == {True}
    assert_kept(result, ["2 follows 1"])


def test_a_target():
    result = made(crossing(8.0), Request(target="pet=0.5..1.5"), count=12)
    assert_kept(result, ["2 yields to 1"])
    (edge,) = result.generated.reactions
    assert yielding(edge, wholes(result)).mean < edge.lag - 0.5, (
        "the range asks for less than the template's"
    )
