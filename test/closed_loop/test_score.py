# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The terms of nuPlan's and NAVSIM's scores, and the reasons of contacts, in drives made by hand."""

from dataclasses import replace

import numpy as np
import pytest
from test_verdict import go_on, straight, verdict_of

from scenario_gen.closed_loop.ego import Command, Pose
from scenario_gen.roads import build_road, RoadConfig
from scenario_gen.types.road import Road


def test_witness_like_drive_has_full_score():
    verdict, _ = verdict_of([straight(0, 0, 0, 10.0), straight(0.0, 50.0, 0, 10.0)], go_on)
    assert verdict.terms.nuplan == verdict.terms.pdms == 1.0 and verdict.fault == ""
    assert verdict.document()["terms"]["pdms"] == 1.0


def test_standing_and_hard_braking_lose_terms():
    motions = [straight(0, 0, 0, 10.0), straight(0.0, 50.0, 0, 10.0)]
    verdict, _ = verdict_of(motions, lambda _: Command(-3.0, 0.0))
    assert (
        verdict.terms.making_progress == 0.0 == verdict.terms.nuplan
        and verdict.fault == "standing"
    )
    assert 0.5 < verdict.terms.pdms < 0.65  # (5 TTC + 2 comfort) / 12 and little progress
    verdict, _ = verdict_of(motions, lambda seen: Command(-8.0 * (1.0 < seen.time < 2.0), 0.0))
    assert verdict.terms.comfort == 0.0 and verdict.terms.making_progress == 1.0


def test_front_hits_are_at_fault():
    """As nuPlan has it: not the one that stands, nor the one that is hit from behind."""
    stands, comes = straight(40.0, 0, 0, 0.0), straight(0, 0, 0, 10.0)
    hit, _ = verdict_of([comes, stands], go_on)
    assert (
        hit.terms.no_at_fault_collision == 0.0 and hit.terms.ttc == 0.0 and hit.fault == "rear_end"
    )
    hit, _ = verdict_of([stands, comes], go_on)
    assert hit.terms.no_at_fault_collision == 1.0 == hit.terms.ttc and hit.fault == "standing"
    hit, _ = verdict_of([straight(30.0, 0, 0, 4.0), comes], go_on)
    assert hit.terms.no_at_fault_collision == 1.0 and hit.fault == "other_ran_into_ego"


def test_jump_fails_despite_the_goal():
    verdict, _ = verdict_of(
        [straight(0, 0, 0, 10.0), straight(0.0, 50.0, 0, 10.0)],
        lambda _: Pose(149.0, 0.0, 0.0, 10.0),
    )
    assert np.isnan(verdict.goal) and verdict.jumps == 1 and verdict.collision is None
    assert (
        not verdict.passed
        and verdict.fault == verdict.failure == "jump"
        and "1 teleport(s)" in verdict.sentence()
    )


def test_jump_is_no_collision_or_exit():
    """From one lane across another car to a place beyond the road's edge."""
    drivable = np.ones((100, 1000), dtype=np.bool_)
    road = Road(
        "field", drivable, 0.2, np.array((-20.0, -10.0)), np.empty((0, 3)), np.empty((0, 3))
    )
    motions = [straight(0, 0, 0, 10.0), straight(0.0, 4.0, 0, 10.0)]
    verdict, _ = verdict_of(
        motions,
        lambda seen: Pose(10.0 * (seen.time + 0.1), 80.0 * (seen.time > 0.45), 0.0, 10.0),
        road=road,
    )
    assert (
        verdict.failure == "jump"
        and verdict.collision is None
        and np.isnan(verdict.off_road)
        and verdict.road_margin > 0.0
    )


@pytest.mark.parametrize(("aside", "counted"), [(0.02, False), (0.3, True)])
def test_off_road_counts_from_a_depth(aside, counted):
    drivable = np.zeros((100, 1000), dtype=np.bool_)
    drivable[40:60] = True  # y from -2 to 2 m
    road = Road(
        "strip", drivable, 0.2, np.array((-20.0, -10.0)), np.empty((0, 3)), np.empty((0, 3))
    )
    motions = [straight(0, 0, 0, 10.0), straight(0.0, 50.0, 0, 10.0)]

    def beside(seen):
        time = seen.time + 0.1
        return Pose(10.0 * time, min(time, 1.1 + aside), 0.0, 10.0)

    verdict, drive = verdict_of(motions, beside, road=road)
    assert (
        verdict.road_margin == pytest.approx(-aside, abs=1e-6)
        and np.isfinite(verdict.off_road) == counted
    )
    assert verdict.passed != counted and (f"by {aside:.2f} m" in verdict.sentence()) == counted
    assert drive.motion.position[0, -1, 1] > 1.1
    verdict, _ = verdict_of(motions, beside, road=road, off_road_depth=0.0)
    assert np.isfinite(verdict.off_road)
    verdict, _ = verdict_of(motions, go_on, road=road)
    assert verdict.road_margin == pytest.approx(1.1)
    assert "by more than 10 m" in replace(verdict, off_road=1.0, road_margin=-10.0).sentence()


def test_obstacle_in_the_way_is_named():
    config = RoadConfig(arm_length=100.0)
    x, y = build_road("straight", config=config).lanes.lanes[0].centre[30].tolist()
    name = f"{x:g} {y + 1.85:g} 0 4 2"
    road = build_road("straight", config=replace(config, obstacles=name))
    others = straight(60.0, y, 0.0, 10.0)
    verdict, _ = verdict_of([straight(5.0, y, 0.0, 10.0), others], go_on, road=road)
    assert verdict.off_road == pytest.approx(0.1 * (x - 2.0 - 2.0 - 5.0), abs=0.01)
    assert (verdict.failure, verdict.fault, verdict.obstacle) == ("off_road", "obstacle", name)
    assert f"ran into obstacle `{name}` at" in verdict.sentence()
    passed, _ = verdict_of([straight(5.0, y - 0.3, 0.0, 10.0), others], go_on, road=road)
    assert passed.obstacle == "" and passed.passed
