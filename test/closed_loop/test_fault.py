# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Whose fault a contact is, in situations that are drawn: the ego drives otherwise than its witness, the other as certified."""

import numpy as np
import pytest
from support.driving_scenes import Acts
from support.lengths import LONG

from benchmarks._driving_worlds import as_scenario, PERIOD
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.ego import Pose
from scenario_gen.closed_loop.fault import safe_gap
from scenario_gen.closed_loop.simulation import ClosedLoop
from scenario_gen.closed_loop.verdict import judge
from scenario_gen.numerics.curve import Curve
from scenario_gen.situation import find_conflicts

STEPS = 160
TIME = np.arange(STEPS) * PERIOD
VARIATIONS = 30 if LONG else 3
LENGTH, WIDTH = 4.25, 1.8  # mean of both vehicles


def drive_along(points, speed, start=0.0):
    """A motion along points (M, 2) [m] at a speed [m/s], or at speeds (T,), from a station [m] on."""
    curve = Curve.through(np.asarray(points, dtype=np.float64))
    speed = np.broadcast_to(np.asarray(speed, dtype=np.float64), TIME.shape)
    poses = curve.at(
        start + np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * PERIOD)])
    )
    return poses[:, :2], poses[:, 2], speed.copy()


def lane(y, reverse=False):
    points = np.column_stack([np.arange(-150.0, 151.0), np.full(301, y)])
    return points[::-1] if reverse else points


def over(y, to, at, length=25.0):
    """From one lane to another, half-way at x = at."""
    x = np.arange(-150.0, 151.0)
    share = np.clip((x - at) / length + 0.5, 0.0, 1.0)
    return np.column_stack([x, y + (to - y) * share * share * (3.0 - 2.0 * share)])


def right_turn(radius):
    """Along +x, then right along -y; the turn begins at (0, 0), 100 m from the start."""
    angle = np.linspace(0.0, np.pi / 2, 20)
    arc = radius * np.column_stack([np.sin(angle), np.cos(angle) - 1.0])
    west = np.column_stack([np.linspace(-100.0, -1.0, 100), np.zeros(100)])
    south = np.column_stack([np.full(80, radius), -radius - np.linspace(1.0, 80.0, 80)])
    return np.concatenate([west, arc, south])


def up():
    return np.column_stack([np.zeros(301), np.arange(-150.0, 151.0)])


def to_pass(points, at, when, speed):
    """A motion at one speed that is at a station of points when it should be."""
    return drive_along(points, speed, at - speed * when)


def both_to_pass(points, at, when, speed):
    """Motions from one start, at one speed each: the witness is at a station at when[0], the ego, at this speed, at when[1]."""
    way = speed * when[1]
    return drive_along(points, way / when[0], at - way), drive_along(points, speed, at - way)


def pulls_out_and_is_hit(rng):
    """The other crosses at x = 0; the ego is there a little earlier, its witness long after."""
    fast, slow = rng.uniform(8.0, 14.0), rng.uniform(4.0, 7.0)
    when = rng.uniform(4.0, 6.0)
    other = to_pass(lane(0.0), 150.0, when, fast)
    late = when + 4.0 + LENGTH / slow + rng.uniform(0.0, 1.0)
    early = when - rng.uniform(0.3, 0.9) * 0.5 * LENGTH / slow
    witness, ego = both_to_pass(up(), 150.0, (late, early), slow)
    return witness, other, ego


def cuts_in(rng, share):
    """The ego comes into the lane of a faster one, leaving it a share of the safe gap; its witness stays."""
    fast, slow, when = rng.uniform(12.0, 18.0), rng.uniform(5.0, 9.0), rng.uniform(2.0, 4.0)
    gap = max(share * float(safe_gap(fast, slow)), 2.0)
    at = -20.0
    enters = at - 25.0 * 0.12  # where its corner comes into the other's way, about
    ego = to_pass(over(3.5, 0.0, at), 150.0 + enters, when, slow)
    other = to_pass(lane(0.0), 150.0 + enters - gap - LENGTH, when, fast)
    return to_pass(lane(3.5), 150.0 + enters, when, slow), other, ego


def cuts_in_unsafely(rng):
    return cuts_in(rng, rng.uniform(0.3, 0.7))


def cuts_in_safely(rng):
    return cuts_in(rng, rng.uniform(1.3, 1.6))


def drifts_sideways(rng):
    speed, beside = rng.uniform(7.0, 14.0), rng.uniform(-2.0, 2.0)
    other = to_pass(lane(0.0), 60.0 + beside, 0.0, speed)
    return (
        to_pass(lane(3.5), 60.0, 0.0, speed),
        other,
        to_pass(over(3.5, 0.0, -40.0, 60.0), 60.0, 0.0, speed),
    )


def edges_into_the_next_lane(rng):
    """The ego touches its neighbour 0.15 m beside its path: too little to have left it."""
    speed = rng.uniform(7.0, 14.0)
    other = to_pass(lane(0.0), 60.0, 0.0, speed)
    own = over(1.85, 1.7, -60.0, 20.0)
    return to_pass(lane(1.85), 60.0, 0.0, speed), other, to_pass(own, 60.0, 0.0, speed)


def head_on_in_the_wrong_lane(rng):
    mine, its = rng.uniform(6.0, 12.0, 2)
    other = to_pass(lane(1.75, reverse=True), 150.0, 6.0, its)
    return (
        to_pass(lane(-1.75), 150.0, 6.0, mine),
        other,
        to_pass(over(-1.75, 1.75, -30.0), 150.0, 6.0, mine),
    )


def brakes_for_nothing(rng):
    speed, braking, begin = rng.uniform(8.0, 15.0), rng.uniform(4.0, 8.0), rng.uniform(2.0, 4.0)
    other = drive_along(lane(0.0), speed, 20.0)
    slower = np.where(
        begin > TIME, speed, np.maximum(speed - braking * (TIME - begin), rng.choice([0.0, 2.0]))
    )
    start = 20.0 + LENGTH + 0.5 * speed
    return drive_along(lane(0.0), speed, start), other, drive_along(lane(0.0), slower, start)


def has_priority_and_is_hit(rng):
    """The ego is late, but cannot stop any more when the other one still can."""
    fast, slow, when = rng.uniform(7.0, 9.0), rng.uniform(2.2, 2.6), rng.uniform(5.0, 6.0)
    other = to_pass(lane(0.0), 150.0, when, fast)
    witness, ego = both_to_pass(up(), 150.0, (when - 3.0, when - rng.uniform(1.1, 1.3)), slow)
    return witness, other, ego


def comes_late_in_its_turn(rng):
    """The ego enters when the other one, which lets it go first in the certificate, cannot stop any more."""
    fast, slow, when = rng.uniform(8.0, 12.0), rng.uniform(3.5, 5.0), rng.uniform(4.0, 6.0)
    other = to_pass(lane(0.0), 150.0, when, fast)
    late = rng.uniform(0.0, 0.8) * 0.5 * LENGTH / slow
    witness, ego = both_to_pass(up(), 150.0, (when - 2.4, when + late), slow)
    return witness, other, ego


def hooks_a_cyclist(rng):
    """The ego turns right, later than its witness, across one that goes straight on beside it."""
    slow, cycling, when = rng.uniform(3.0, 5.0), rng.uniform(4.0, 6.0), rng.uniform(5.0, 7.0)
    half_turn = np.arccos(1.0 - 2.6 / 6.0)  # at a radius of 6 m it is 2.6 m to the right then
    other = to_pass(lane(-2.6), 150.0 + 6.0 * np.sin(half_turn), when, cycling)
    path = right_turn(6.0)
    times = (when - 2.4, when + rng.uniform(-0.2, 0.3))
    witness, ego = both_to_pass(path, 100.0 + 6.0 * half_turn, times, slow)
    return witness, other, ego


def lets_go_and_rams(rng):
    """The ego stands in its turn until the other is in the area, then drives into its flank."""
    fast, slow, when = rng.uniform(6.0, 9.0), rng.uniform(4.0, 6.0), rng.uniform(6.0, 7.5)
    other = to_pass(lane(0.0), 150.0, when, fast)
    stands = 150.0 - 0.5 * (LENGTH + WIDTH) - rng.uniform(0.2, 0.5)
    starts = when - 0.5 * (LENGTH + WIDTH) / fast + PERIOD
    speed = np.where(TIME < 2.0, slow, 0.0)
    speed = np.where(starts <= TIME, 4.0 * (TIME - starts), speed)
    driven = float(np.sum(0.5 * (speed[1:] + speed[:-1])[TIME[1:] <= 2.1]) * PERIOD)
    witness = to_pass(up(), 150.0, when - 3.0, (150.0 - stands + driven) / (when - 3.0))
    return witness, other, drive_along(up(), speed, stands - driven)


def merges_early_into_flank(rng):
    """The ego merges before its turn, beside a faster car that it touches with its front."""
    fast, slow, when = rng.uniform(10.0, 14.0), rng.uniform(6.0, 9.0), rng.uniform(4.0, 5.0)
    ramp = over(-20.0, 0.0, 0.0, 60.0)
    other = to_pass(lane(0.0), 165.0, when, fast)
    station = float(Curve.through(ramp).project(np.array([[15.0, 0.0]]))[0][0])
    early = when + rng.uniform(0.05, 0.25)
    witness, ego = both_to_pass(ramp, station, (when + 4.0, early), slow)
    return witness, other, ego


def teleports(rng):
    speed, when = rng.uniform(8.0, 14.0), 20
    other = drive_along(lane(0.0), speed, 20.0)
    position, yaw, mine = (each.copy() for each in drive_along(lane(30.0), speed, 20.0))
    position[when:] = other[0][when] + (rng.uniform(6.0, 12.0), 0.0)
    mine[when:] = 0.0
    return drive_along(lane(30.0), speed, 20.0), other, (position, yaw, mine)


def reverses(rng):
    back, gap = rng.uniform(1.0, 3.0), rng.uniform(1.0, 4.0)
    other = drive_along(lane(0.0), 0.0, 100.0)
    position, yaw, speed = drive_along(lane(0.0), 0.0, 100.0 + LENGTH + gap)
    position = position - np.column_stack([back * np.maximum(TIME - 1.0, 0.0), np.zeros(STEPS)])
    return (
        drive_along(lane(0.0), np.minimum(2.0 * TIME, 8.0), 100.0 + LENGTH + gap),
        other,
        (position, yaw, speed),
    )


def backs_up_and_stands(rng):
    """The ego drives back into the way of one that follows, and stands when it is hit."""
    speed, gap = rng.uniform(4.0, 8.0), rng.uniform(6.0, 12.0)
    other = drive_along(lane(0.0), speed, 50.0)
    witness = drive_along(lane(0.0), speed + 1.0, 50.0 + LENGTH + gap)
    position, yaw, _ = drive_along(lane(0.0), 0.0, 50.0 + LENGTH + gap)
    back = np.minimum(3.0 * TIME, 0.3 * gap)
    return witness, other, (position - np.column_stack([back, 0.0 * TIME]), yaw, 0.0 * TIME)


def turns_round_and_stands(rng):
    """The ego turns by 60 to 180 degrees in its own lane before a follower, and stands."""
    speed, gap = rng.uniform(6.0, 10.0), rng.uniform(10.0, 14.0)
    other = drive_along(lane(0.0), speed, 50.0)
    witness = drive_along(lane(0.0), speed + 1.0, 50.0 + LENGTH + gap)
    position, yaw, _ = drive_along(lane(0.0), 0.0, 50.0 + LENGTH + gap)
    angle = rng.uniform(np.pi / 3, np.pi)
    return witness, other, (position, yaw + np.minimum(TIME / 1.0, 1.0) * angle, 0.0 * TIME)


def leaves_its_lane_and_stops(rng):
    """The ego changes to the lane of a faster one far ahead of it and stops there."""
    speed = rng.uniform(8.0, 12.0)
    slow = np.maximum(6.0 - 2.0 * np.maximum(TIME - 3.0, 0.0), 0.0)
    other = drive_along(lane(0.0), speed, 20.0)
    ego = drive_along(over(3.5, 0.0, -35.0), slow, 100.0)
    return drive_along(lane(3.5), 6.0, 100.0), other, ego


def stands_after(speed, stop, braking=4.0):
    """Speeds (T,) of one that brakes to a standstill from a time on."""
    return np.maximum(speed - braking * np.maximum(TIME - stop, 0.0), 0.0)


def reverses_into_the_crossing(rng):
    """The ego has crossed in time, and drives back into the way of one that goes straight on."""
    speed, when = rng.uniform(6.0, 9.0), rng.uniform(8.0, 9.0)
    other = to_pass(lane(0.0), 150.0, when, speed)
    witness = drive_along(up(), 6.0, 140.0)
    position, yaw, mine = (
        each.copy() for each in drive_along(up(), stands_after(6.0, 2.0), 140.0)
    )
    position[:, 1] -= 2.5 * np.clip(TIME - 4.5, 0.0, 2.6)
    return witness, other, (position, yaw, mine)


def turns_round(rng):
    """The ego turns about across the lane of oncoming traffic, and stops there."""
    its, when = rng.uniform(8.0, 12.0), rng.uniform(5.0, 6.0)
    angle = np.linspace(0.0, np.pi, 30)
    arc = np.column_stack([4.0 * np.sin(angle), 4.0 - 4.0 * np.cos(angle) - 1.75])
    back = np.column_stack([np.linspace(-1.0, -80.0, 80), np.full(80, 6.25)])
    path = np.concatenate([lane(-1.75)[:150], arc, back])
    station = 150.0 + 2.0 * np.pi
    speed = np.where(when - 1.0 > TIME, 4.0, 0.0)
    ego = drive_along(path, speed, station - 4.0 * (when - 1.0))
    other = to_pass(lane(2.0, reverse=True), 147.0, when + 1.0, its)
    return drive_along(lane(-1.75), 4.0, station - 4.0 * when), other, ego


def hits_a_leader_that_brakes(rng):
    speed, stop = rng.uniform(8.0, 14.0), rng.uniform(3.0, 5.0)
    slower = np.maximum(stands_after(speed, stop), 2.0)
    other = drive_along(lane(0.0), slower, 20.0 + LENGTH + rng.uniform(0.8, 1.2) * speed)
    return drive_along(lane(0.0), slower, 20.0), other, drive_along(lane(0.0), speed, 20.0)


def hits_one_that_stands(rng):
    """It stands for 9 s, as the witness behind it does."""
    speed = rng.uniform(6.0, 12.0)
    departs = np.clip(2.0 * (TIME - 9.0), 0.0, speed)
    start = 100.0 - 2.0 * speed - speed**2 / 8.0 - 8.0
    witness = drive_along(lane(0.0), stands_after(speed, 2.0) + departs, start)
    return witness, drive_along(lane(0.0), departs, 100.0), drive_along(lane(0.0), speed, start)


def crosses_in_time_and_stalls(rng):
    """The ego is in the area in its turn, on time, and stands there when the other comes."""
    fast, when = rng.uniform(6.0, 9.0), rng.uniform(7.0, 8.0)
    other = to_pass(lane(0.0), 150.0, when, fast)
    stop = when - rng.uniform(3.0, 3.5)
    start = 150.0 - 5.0 * stop - 3.1
    return drive_along(up(), 5.0, start), other, drive_along(up(), stands_after(5.0, stop), start)


SITUATIONS = {
    pulls_out_and_is_hit: {"out_of_order"},
    cuts_in_unsafely: {"cut_in"},
    cuts_in_safely: {"other_ran_into_ego"},
    lets_go_and_rams: {"out_of_order"},
    merges_early_into_flank: {"cut_in", "out_of_order"},
    drifts_sideways: {"out_of_path"},
    edges_into_the_next_lane: {"cut_in"},
    head_on_in_the_wrong_lane: {"head_on"},
    brakes_for_nothing: {"other_ran_into_ego", "standing"},
    has_priority_and_is_hit: {"priority"},
    comes_late_in_its_turn: {"out_of_order"},
    hooks_a_cyclist: {"out_of_order"},
    backs_up_and_stands: {"reversing"},
    turns_round_and_stands: {"out_of_path", "head_on"},
    leaves_its_lane_and_stops: {"out_of_path", "cut_in"},
    teleports: {"jump"},
    reverses: {"reversing"},
    reverses_into_the_crossing: {"reversing"},
    turns_round: {"head_on", "out_of_path"},
    hits_a_leader_that_brakes: {"rear_end"},
    hits_one_that_stands: {"rear_end"},
    crosses_in_time_and_stalls: {"standing", "priority"},
}
NOT_AT_FAULT = {
    cuts_in_safely,
    brakes_for_nothing,
    has_priority_and_is_hit,
    crosses_in_time_and_stalls,
}


def placed(motion, angle, mirrored):
    """A motion turned about the origin, and mirrored before if asked."""
    xy, yaw, speed = motion
    side = -1.0 if mirrored else 1.0
    c, s = np.cos(angle), np.sin(angle)
    xy = np.column_stack([xy[:, 0], side * xy[:, 1]]) @ np.array([[c, s], [-s, c]])
    return xy, side * yaw + angle, speed


def plays(motion):
    """Return a planner that is where a motion has it."""

    def act(seen):
        k = min(round(seen.time / PERIOD) + 1, STEPS - 1)
        (x, y), yaw, speed = (each[k] for each in motion)
        return Pose(float(x), float(y), float(yaw), float(speed))

    return Acts(act)


def judged(situation, seed):
    rng = np.random.default_rng([seed, *situation.__name__.encode()])
    angle, mirrored = rng.uniform(-np.pi, np.pi), rng.random() < 0.5
    witness, other, ego = (placed(motion, angle, mirrored) for motion in situation(rng))
    loop = ClosedLoop(
        as_scenario([witness, other], STEPS), 0, config=ClosedLoopConfig(policy="replay")
    )
    proven = judge(loop, loop.drive(plays(witness)))
    assert proven.passed, (
        f"{situation.__name__} {seed}: {proven.sentence()}; {find_conflicts(loop.scenario)}"
    )
    return judge(loop, loop.drive(plays(ego)))


@pytest.mark.parametrize("situation", SITUATIONS, ids=lambda one: one.__name__)
def test_fault_is_of_whoever_left_place(situation):
    for seed in range(VARIATIONS):
        verdict = judged(situation, seed)
        assert verdict.collision is not None, f"{seed}: nobody was met; {verdict.sentence()}"
        assert verdict.collision.reason.value in SITUATIONS[situation], (
            f"{seed}: {verdict.sentence()}"
        )
        assert (
            verdict.at_fault == verdict.document()["at_fault"] == (situation not in NOT_AT_FAULT)
        )


def test_cut_in_compares_its_safe_gap():
    cut_in = judged(cuts_in_unsafely, 0).collision.cut_in
    assert 0.0 < cut_in.gap < cut_in.safe_gap and not cut_in.safe
    assert cut_in.ttc > 0.0 and cut_in.least_ttc > 0.35
    verdict = judged(cuts_in_safely, 0)
    assert verdict.collision.cut_in.safe and "entered" in verdict.sentence()
    assert verdict.sentence().count("not at fault") == 1
    assert float(safe_gap(14.0, 14.0)) == pytest.approx(14.0 + 196.0 / 12.0 - 196.0 / 18.0)
