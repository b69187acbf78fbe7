# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Reactions among the others in closed loop: who waits for another goes on waiting, whatever the ego does to that one."""

from dataclasses import replace

import numpy as np
import pytest
from support.reaction_scenes import led_crossing, platoon

from benchmarks._driving_worlds import Witness
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.ego import Command
from scenario_gen.closed_loop.simulation import ClosedLoop
from scenario_gen.method.chain import Chain
from scenario_gen.method.segmentation import segment
from scenario_gen.pipeline import PipelineConfig
from scenario_gen.roads import build_road
from scenario_gen.situation import conflict_of, departure, lane_gaps, Situation, time_gaps
from scenario_gen.types import Facts, join_ego, with_witness

CONFIG = PipelineConfig()


class Slower:
    """Drives straight on at a share of its first speed."""

    def __init__(self, share):
        self.share = share

    def reset(self, task):
        self.speed = self.share * float(task.start[3])

    def act(self, seen):
        return Command(max(min(self.speed - seen.ego.speed, 2.0), -3.0), 0.0)


def generated(encounter, count):
    road = build_road("corridor", encounter, CONFIG.road)
    segmentation = segment(encounter, CONFIG.segmentation, 1)
    return (
        Chain(Situation.of(encounter), segmentation, road, CONFIG, count=count, seed=1)
        .run()
        .generated
    )


def lag_behind(motion, conflict):
    """Return the time [s] from the exit of the first vehicle to the departure of the second."""
    return departure(motion, conflict.second, conflict.entry_second) - conflict.exit_first


@pytest.fixture(scope="module")
def led():
    """Vehicle 2 waits for vehicle 1, which follows vehicle 3."""
    made = generated(led_crossing(), 4)
    assert {str(edge.named("123")) for edge in made.reactions} == {"2 yields to 1", "1 follows 3"}
    return made.scenarios


@pytest.mark.parametrize("share", [0.5, 0.3])
@pytest.mark.parametrize("slot", [False, True])
def test_yielder_waits_for_a_delayed_vehicle(led, share, slot):
    """The ego is the one ahead: as a vehicle of the scenario, and in its slot with the witness beside it."""
    early = 0
    for scenario in led:
        driven = join_ego(with_witness(scenario, 2)) if slot else scenario
        own = lag_behind(driven, conflict_of(driven, 1, 0))
        for facts, kept in ((driven.facts, True), (Facts(), False)):
            config = ClosedLoopConfig(overtime=1.5)
            loop = ClosedLoop(replace(driven, facts=facts), "3", config=config)
            motion = loop.drive(Slower(share)).motion
            conflict = conflict_of(motion, 1, 0)
            assert conflict.second == 1
            lag = lag_behind(motion, conflict)
            if kept:
                assert conflict.exit_first > conflict_of(driven, 1, 0).exit_first + 0.5, (
                    "the ego did hold it up"
                )
                assert own - 0.2 <= lag <= own + 0.5
            else:
                early += lag < own - 0.4
    assert early > 0, "without the reaction somebody goes early"


def test_nobody_waits_when_driving_as_certified(led):
    for scenario in led:
        last = len(scenario.time) - 1
        drive = ClosedLoop(scenario, "3").drive(
            Witness(scenario, 2), lambda state, last=last: state.step >= last
        )
        assert np.abs(drive.motion.position - scenario.position).max() < 1e-6


def test_followers_keep_distance_to_delayed_leaders():
    made = generated(platoon(4), 3)
    assert len(made.reactions) == 3
    for scenario in made.scenarios:
        for share in (0.7, 0.4):
            motion = ClosedLoop(scenario, "1").drive(Slower(share)).motion
            for edge in made.reactions[1:]:
                assert (
                    time_gaps(lane_gaps(motion), edge.who, edge.whom).min() > 0.5 * edge.headway[0]
                )
