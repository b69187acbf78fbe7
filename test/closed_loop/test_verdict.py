# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Verdicts against cases made by hand, where the answer is known."""

from dataclasses import replace
import json
import math
from xml.etree import ElementTree

import numpy as np
import pytest
from support.driving_scenes import Acts
from support.motions import road_of

from benchmarks._driving_worlds import as_scenario, PERIOD
from benchmarks.drive import seen_at
from scenario_gen.closed_loop.bars import Bars, broken_bars
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.ego import Command, Pose
from scenario_gen.closed_loop.origin import Trial
from scenario_gen.closed_loop.planners import ConstantSpeed
from scenario_gen.closed_loop.results import as_junit, Drives
from scenario_gen.closed_loop.simulation import ClosedLoop
from scenario_gen.closed_loop.trials import rates, run_trials
from scenario_gen.closed_loop.verdict import judge, Runner
from scenario_gen.roads import build_road, RoadConfig

TIME = np.arange(150) * PERIOD


def straight(x, y, yaw, speed):
    """A motion along a straight line."""
    way = speed * TIME
    xy = np.stack([x + way * np.cos(yaw), y + way * np.sin(yaw)], axis=1)
    return xy, np.full_like(TIME, yaw), np.full_like(TIME, speed)


def verdict_of(motions, act, policy="replay", road=None, **config):
    """The verdict on an ego in place of vehicle 0 that does `act(seen)`."""
    loop = ClosedLoop(
        as_scenario(motions, len(TIME)), 0, road, ClosedLoopConfig(policy=policy, **config)
    )

    drive = loop.drive(Acts(act))
    return judge(loop, drive), drive


def go_on(_):
    return Command(0.0, 0.0)


def test_moving_vehicle_runs_into_standing_one():
    """Lengths are 4.0 and 4.5 m: at 10 m/s the front reaches the tail after (40 - 4.25) / 10 s."""
    comes, stands = straight(0, 0, 0, 10.0), straight(40.0, 0, 0, 0.0)
    verdict, drive = verdict_of([comes, stands], go_on)
    assert not verdict.passed and "the ego ran into v1 at 3.57 s" in verdict.sentence()
    collision = verdict.collision
    assert (collision.ran, collision.vehicle) == (Runner.EGO, "v1")
    assert collision.speed == pytest.approx(10.0)
    assert collision.time == pytest.approx(3.575, abs=1e-4)
    assert collision.time == pytest.approx(seen_at(drive), abs=2e-3)
    collision = verdict_of([stands, comes], go_on)[0].collision
    assert collision.ran is Runner.OTHER
    assert collision.time == pytest.approx(3.575, abs=1e-4)
    collision = verdict_of([comes, straight(60.0, 0, np.pi, 10.0)], go_on)[0].collision
    assert collision.ran is Runner.BOTH and collision.speed == pytest.approx(20.0)


def test_contact_between_instants_is_found():
    """The ego passes through the other's corner in less than a step: at no instant do they overlap."""
    side = straight(0.0, 30.0, -np.pi / 2, 0.0)  # stands across the way, its end at y = 27.75
    passes = straight(-40.0, 27.75 - 0.95 + 0.06, 0, 40.0)
    verdict, drive = verdict_of([passes, side], go_on, step=0.5, goal_width=0.1)
    assert seen_at(drive) == pytest.approx(verdict.collision.time, abs=2e-3)


def strip(half_width):
    """A road along the x axis, so many metres [m] to either side of it."""
    drivable = np.zeros((100, 1000), dtype=np.bool_)
    drivable[np.abs(0.2 * (np.arange(100) + 0.5) - 10.0) < half_width] = True
    return road_of(drivable, 0.2, (-20.0, -10.0))


BESIDE = [straight(0, 0, 0, 10.0), straight(0.0, 50.0, 0, 10.0)]  # too far to meet


def test_off_road_goal_and_progress():
    road = strip(2.0)
    verdict, _ = verdict_of(BESIDE, go_on, road=road)
    assert verdict.passed and verdict.jerk == 0.0
    assert verdict.goal == pytest.approx(14.9) and verdict.delay == pytest.approx(0.0)
    assert verdict.min_gap == pytest.approx(50.0 - 1.8)
    assert verdict.min_ttc == 8.0 and math.isnan(verdict.min_pet)
    verdict, _ = verdict_of(
        BESIDE,
        lambda seen: Pose(10.0 * (seen.time + 0.1), 2.0 * (seen.time + 0.1), 0.0, 10.0),
        road=road,
    )
    assert not verdict.passed
    assert verdict.off_road == pytest.approx(
        0.6, abs=2e-3
    )  # 1.1 m and the 0.1 m allowed, at 2 m/s
    assert verdict.progress == pytest.approx(5.0 / 149.0, abs=0.01), "what is driven on the road"
    verdict, _ = verdict_of(BESIDE, lambda _: Command(-5.0, 0.0), road=road)
    assert math.isnan(verdict.goal) and verdict.progress == pytest.approx(10.0 / 149.0, abs=0.01)
    assert verdict.hardest_braking == pytest.approx(5.0)
    assert verdict.hard_braking == pytest.approx(2.0)
    verdict, _ = verdict_of(BESIDE, lambda seen: None if seen.time < 0.25 else Command(1.0, 0.0))
    assert verdict.faults == 3 and not verdict.road_known
    assert "3 faulty command(s)" in verdict.sentence()


def test_time_to_collision_and_post_encroachment():
    """Closing at 5 m/s from a gap of 20 - 4.25 m; crossing 2 s after the other has left."""
    verdict, _ = verdict_of(
        [straight(0, 0, 0, 10.0), straight(20.0, 0, 0, 5.0)],
        lambda s: Command(-5.0 * (s.time >= 0.95), 0.0),
    )
    assert verdict.collision is None and verdict.min_ttc == pytest.approx(10.75 / 5.0, abs=0.1)
    crossing = [straight(-60.0, 0, 0, 10.0), straight(0.0, -30.0, np.pi / 2, 10.0)]
    verdict, _ = verdict_of(crossing, go_on)
    entry, leave = (60.0 - 2.0 - 0.9) / 10.0, (30.0 + 2.25 + 0.9) / 10.0
    assert verdict.min_pet == pytest.approx(entry - leave, abs=0.02)


@pytest.fixture(scope="module")
def trials():
    meet = as_scenario(
        [straight(-60.0, 0, 0, 9.0), straight(0.0, -60.0, np.pi / 2, 6.0)], len(TIME)
    )
    free = as_scenario([straight(0.0, 0, 0, 8.0), straight(0.0, 60.0, 0, 8.0)], len(TIME))
    return [
        Trial("meet", meet, 1, None),
        Trial("free", free, 0, None),
        Trial("first", meet, 0, None),
    ]


def test_two_workers_give_same_bytes(trials):
    name, config = "scenario_gen.closed_loop.planners:IdmFollower", ClosedLoopConfig()
    one, two = (run_trials(trials, name, config, workers) for workers in (1, 2))
    first, second = (Drives(outcomes, name, config, trials) for outcomes in (one, two))
    assert first.json() == second.json() and as_junit(first) == as_junit(second)
    assert first.page() == second.page() and all(trial.name in first.page() for trial in trials)
    assert [outcome.name for outcome in one] == ["meet", "free", "first"]
    assert all(o.verdict.passed for o in one)


def test_json_junit_rates_and_bars(trials):
    outcomes = run_trials(
        trials, lambda: ConstantSpeed(speed=9.3), ClosedLoopConfig(policy="replay")
    )
    failed = [outcome for outcome in outcomes if not outcome.verdict.passed]
    found = rates(outcomes)
    assert found["collisions"].count == len([o for o in outcomes if o.verdict.collision]) == 1
    assert found["goals"].count == 2
    suite = ElementTree.fromstring(as_junit(Drives(outcomes, "p:C", ClosedLoopConfig())))
    assert suite.get("tests") == "3" and suite.get("failures") == str(len(failed))
    assert [case.get("name") for case in suite if case.find("failure") is not None] == [
        f"scenario {o.name}" for o in failed
    ]
    said = json.loads(Drives(outcomes, "p:C", ClosedLoopConfig()).json())
    assert said["summary"]["collisions"]["count"] == 1 and len(said["drives"]) == 3
    assert [line.split(":")[0] for line in broken_bars(outcomes, Bars())] == [
        "collisions",
        "goals",
        "at_fault",
    ]
    loose = Bars(collisions=0.4, at_fault=0.4, goals=0.9, min_ttc=0.5, imposed_braking=0.0)
    assert broken_bars(outcomes, loose) == [
        "goals: 66.7 %; at least 90.0 % is required",
        "min_ttc: 0.00 s; at least 0.50 s is required",
    ]


def test_reference_speed_passes_standing_does_not():
    assert verdict_of(BESIDE, go_on)[0].fault == ""
    verdict, _ = verdict_of(BESIDE, lambda _: Command(-3.0, 0.0))
    assert verdict.fault == "standing" and verdict.progress < 0.2


def test_jump_fails_despite_the_goal():
    verdict, _ = verdict_of(BESIDE, lambda _: Pose(149.0, 0.0, 0.0, 10.0))
    assert np.isnan(verdict.goal) and verdict.jumps == 1 and verdict.collision is None
    assert not verdict.passed and verdict.fault == verdict.failure == "jump"
    assert "1 teleport(s)" in verdict.sentence()


def test_jump_is_no_collision_or_exit():
    """From one lane across another car to a place beyond the road's edge."""
    verdict, _ = verdict_of(
        [straight(0, 0, 0, 10.0), straight(0.0, 4.0, 0, 10.0)],
        lambda seen: Pose(10.0 * (seen.time + 0.1), 80.0 * (seen.time > 0.45), 0.0, 10.0),
        road=strip(10.0),
    )
    assert verdict.failure == "jump" and verdict.collision is None
    assert np.isnan(verdict.off_road) and verdict.road_margin > 0.0


@pytest.mark.parametrize(("aside", "counted"), [(0.02, False), (0.3, True)])
def test_off_road_counts_from_a_depth(aside, counted):
    road = strip(2.0)

    def beside(seen):
        time = seen.time + 0.1
        return Pose(10.0 * time, min(time, 1.1 + aside), 0.0, 10.0)

    verdict, drive = verdict_of(BESIDE, beside, road=road)
    assert verdict.road_margin == pytest.approx(-aside, abs=1e-6)
    assert np.isfinite(verdict.off_road) == counted
    assert verdict.passed != counted and (f"by {aside:.2f} m" in verdict.sentence()) == counted
    assert drive.motion.position[0, -1, 1] > 1.1
    verdict, _ = verdict_of(BESIDE, beside, road=road, off_road_depth=0.0)
    assert np.isfinite(verdict.off_road)
    verdict, _ = verdict_of(BESIDE, go_on, road=road)
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
