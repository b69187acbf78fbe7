# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Each term of the checks, computed a second time: by numpy on whole arrays, by complex numbers, by brute force."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from support.motions import causes_of, FREE, scenario_of, straight, wander

from scenario_gen.method.validity import allowed_gap, Limits
from scenario_gen.method.validity.dynamics import Check, MotionLimits, worst_excess
from scenario_gen.method.validity.template_checks import clearance_violations, least_gaps
from scenario_gen.situation import Abreast, MAX_CLEARANCE_CHANGE_M, Wait
from scenario_gen.types import Cause, FOLLOW, Reaction, YIELD
from scenario_gen.types.scenario import BoundaryStates

TIME = np.arange(101) * 0.1


def excesses(time, track, acceleration, limits):
    """The worst excess over each limit, from whole arrays and complex numbers."""
    position, heading, speed = track
    step, place = np.diff(time), position[:, 0] + 1j * position[:, 1]
    velocity, moved = speed * np.exp(1j * heading), np.diff(place)
    rate, turn = np.diff(speed) / step, np.abs(np.diff(heading))
    fastest = np.maximum(speed[1:], speed[:-1])
    slip = moved / step - (velocity[1:] + velocity[:-1]) / 2.0
    slip = slip * np.exp(-0.5j * (heading[1:] + heading[:-1]))
    allowed = limits.slip + limits.slip_share * fastest
    between = np.abs(3.0 * moved / step - velocity[1:] - velocity[:-1])
    bend = np.diff(moved / step) / (0.5 * (time[2:] - time[:-2])) * np.exp(-1j * heading[1:-1])
    pairs = np.stack([acceleration[1:], acceleration[:-1]])
    curvature = turn / np.abs(moved)
    found = {
        Check.NEGATIVE_SPEED: -speed,
        Check.MAX_SPEED: np.append(speed, (fastest + np.maximum(fastest, between)) / 2.0)
        - limits.speed,
        Check.ACCELERATION: np.append(acceleration, rate) - limits.acceleration,
        Check.DECELERATION: -np.append(acceleration, rate) - limits.deceleration,
        Check.SPEED_CHANGE: np.maximum(rate - pairs.max(axis=0), pairs.min(axis=0) - rate)
        - limits.tolerance,
        Check.LATERAL: fastest * turn / step - limits.lateral,
        Check.CURVATURE: curvature[turn > 2e-4] - limits.curvature,
        Check.DISPLACEMENT: np.abs(slip.real) - allowed,
        Check.SLIP: np.abs(slip.imag) - allowed,
        Check.PATH_LONGITUDINAL: np.append(
            bend.real - limits.acceleration, -bend.real - limits.deceleration
        )
        - limits.tolerance,
        Check.PATH_LATERAL: np.abs(bend.imag) - limits.lateral - limits.tolerance,
    }
    at_limit = dict.fromkeys(
        (
            Check.MAX_SPEED,
            Check.ACCELERATION,
            Check.DECELERATION,
            Check.SPEED_CHANGE,
            Check.LATERAL,
        ),
        1e-6,  # m/s, m/s²: for a value exactly at its limit
    )
    worst = {check: found[check].max(initial=0.0) - at_limit.get(check, 0.0) for check in Check}
    return np.array([max(worst[check], 0.0) for check in Check])


@pytest.mark.parametrize("seed", range(12))
def test_excesses_are_those_of_whole_arrays(seed):
    """Every second drive exceeds all limits; its positions, speeds and accelerations disagree."""
    rng = np.random.default_rng(seed)
    time = np.concatenate(([0.0], np.cumsum(rng.uniform(0.05, 0.5, 30))))
    position, heading, speed = wander(rng, time, 20.0)
    position = position + rng.normal(0.0, 0.3, position.shape)
    track = position, heading, speed + rng.normal(0.0, 1.0, len(time))
    acceleration = rng.normal(0.0, 2.0, len(time))
    low = rng.uniform(0.0, 0.05 if seed % 2 else 4.0, 8)
    limits = MotionLimits(*low)
    out = np.full((1, len(Check), 4), np.nan)
    arrays = (values[None] for values in (*track, acceleration))
    worst_excess(time, *arrays, limits, out)
    expected = excesses(time, track, acceleration, limits)
    np.testing.assert_allclose(out[0, :, 0], expected, atol=1e-9)
    assert seed % 2 == 0 or (expected > 0.0).sum() >= 9


@pytest.mark.parametrize("seed", range(6))
def test_compared_speed_bounds_all_between(seed):
    rng = np.random.default_rng(seed)
    time = np.concatenate(([0.0], np.cumsum(rng.uniform(0.2, 2.0, 8))))
    position, heading, speed = wander(rng, time, 20.0)
    out = np.full((1, len(Check), 4), np.nan)
    limits = MotionLimits.of(FREE, "car")._replace(speed=0.0)
    flat = np.zeros((1, len(time)))
    worst_excess(time, position[None], heading[None], speed[None], flat, limits, out)
    velocity = speed[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    motion = CubicHermiteSpline(time, position, velocity).derivative()
    dense = np.hypot(*motion(np.linspace(0.0, time[-1], 20_000)).T).max()
    assert dense <= out[0, Check.MAX_SPEED, 0] + 2e-6


@pytest.mark.parametrize("seed", range(20))
def test_least_gaps_equal_brute_force(seed):
    """Recorded gaps count at speeds within 2 m/s; above 3 m/s a time gap is kept that the driver keeps."""
    rng = np.random.default_rng(seed)
    limits = Limits(floor_share=rng.uniform(0.3, 0.9), least_headway=rng.uniform(0.2, 1.0))
    recorded, speed = rng.uniform(0.0, 15.0, 25), rng.uniform(0.0, 20.0, 40)
    gap = rng.uniform(0.3, 3.0) * (recorded + 1.0) + rng.uniform(0.0, 3.0, 25)
    expected = []
    for v in speed:
        near = np.abs(recorded - v) <= 2.0
        floor = min(limits.floor_share * gap[near].min(), 4.0 + 1.5 * v) if near.any() else -np.inf
        moving = near & (recorded > 3.0)
        headway = (gap[moving] / recorded[moving]).min(initial=np.inf)
        if v > 3.0 and headway >= limits.least_headway:
            floor = max(floor, limits.least_headway * v)
        expected.append(floor)
    np.testing.assert_allclose(least_gaps(speed, recorded, gap, limits), expected)


def test_time_gap_at_limit_is_kept():
    """Whatever the division rounds to: 0.3 s at speeds that no float holds."""
    limits = Limits(least_headway=0.3, floor_share=0.1)
    for speed in np.arange(3.1, 15.0, 0.1):
        (least,) = least_gaps(
            np.array([speed]), np.array([speed]), np.array([0.3 * speed]), limits
        )
        assert least == pytest.approx(0.3 * speed)


@pytest.mark.parametrize(
    ("gap", "low", "high"),
    [(3.0, 0.1, 5.4 + 3.0), (10.0, 1.5, 18.0 + 3.0), (0.4, 0.0, 0.72 + 3.0), (-0.3, -0.3, 3.0)],
)
def test_yielder_gap_differs_by_its_share(gap, low, high):
    edge = Reaction(YIELD, 1, 0, 0.0, 1.0, 0.6, 0.9, 0.0, 9.0, gap=gap)
    assert allowed_gap(edge, Limits()) == pytest.approx((low, high))


@pytest.mark.parametrize(("end", "row"), [("start", [20, 100]), ("end", [0, 80])])
@pytest.mark.parametrize("off", [-1.0, 1.0])
def test_arrival_between_samples_is_tolerated(end, row, off):
    """At 5 m/s and 0.5 m/s² a step of 0.1 s is 0.5 m and 0.05 m/s; the tolerances come on top."""
    position, heading, _ = straight(-25.0, 0.0, 0.0, 5.0, TIME)
    track = position, heading, 5.0 + 0.5 * (TIME - TIME[row[end == "end"]])
    scenario = replace(scenario_of([track], TIME), present=np.array([row]))
    columns = (scenario.position, scenario.heading[..., None], scenario.speed[..., None])
    states = np.concatenate(columns, axis=-1)[0]
    asked = {"start": states[[row[0]]], "end": states[[row[1]]]}
    limits = replace(FREE, position_tolerance=0.1, speed_tolerance=0.1)
    for column, most in ((0, 0.5 + 0.1), (3, 0.05 + 0.1)):
        for error, fault in ((most - 1e-3, []), (most + 1e-3, [Cause.BOUNDARY_STATE])):
            changed = asked[end].copy()
            changed[0, column] += off * error
            requested = BoundaryStates(**(asked | {end: changed}))
            assert causes_of(scenario, requested=requested, limits=limits) == fault


@pytest.mark.parametrize("first", range(20, 60, 3))
def test_stand_of_a_second_is_one(first):
    """Between samples of which differences are no whole seconds."""
    stands = np.zeros(len(TIME), dtype=bool)
    stands[first : first + 11] = True
    speed = np.where(stands, 0.0, 5.0)
    way = np.concatenate(([0.0], np.cumsum(0.05 * (speed[1:] + speed[:-1]))))
    track = np.stack([way, 0.0 * way], axis=-1), 0.0 * way, speed
    for samples, fault in ((11, []), (10, [Cause.STOP_NOT_KEPT])):
        shorter = track[2].copy()
        shorter[first + samples : first + 11] = 1.0
        scenario = scenario_of([(*track[:2], shorter)], TIME)
        assert causes_of(scenario, waits=[Wait(0, 2.0, 3.0)]) == fault


@pytest.mark.parametrize("column", [0, 3])
def test_state_at_its_tolerance_is_met(column):
    """0.1 m or 0.1 m/s off, by numbers that no float holds."""
    scenario = scenario_of([straight(0.7, 0.0, 0.0, 0.7, TIME)], TIME)
    states = np.array([[0.7, 0.0, 0.0, 0.7]]), np.array([[0.7 + 0.7 * 10.0, 0.0, 0.0, 0.7]])
    for error, fault in ((0.8, []), (0.8 + 1e-7, [Cause.BOUNDARY_STATE])):
        start = states[0].copy()
        start[0, column] = error
        assert abs(start[0, column] - states[0][0, column]) > 0.1
        limits = replace(FREE, position_tolerance=0.1, speed_tolerance=0.1)
        assert (
            causes_of(scenario, requested=BoundaryStates(start, states[1]), limits=limits) == fault
        )


def test_stand_within_tolerance_is_throughout():
    """0.1 m by coordinates that no float holds; within it a vehicle may stand, but not twitch."""
    stands = straight(0.7, 0.0, 0.0, 0.0, TIME)
    twitch = np.where(TIME[50] == TIME, 0.4, 0.0)
    asked = BoundaryStates(np.array([[0.7, 0.0, 0.0, 0.0]]), np.array([[0.8, 0.0, 0.0, 0.0]]))
    waits = [Wait(0, 0.0, 10.0)]
    assert asked.end[0, 0] - asked.start[0, 0] > 0.1
    assert causes_of(scenario_of([stands], TIME), requested=asked, waits=waits) == []
    moving = scenario_of([(*stands[:2], twitch)], TIME)
    assert causes_of(moving, requested=asked, waits=waits) == [Cause.STOP_NOT_KEPT]


@pytest.mark.parametrize("offset", [-2.5, 2.5])
def test_two_in_a_lane_keep_apart(offset):
    pair = Abreast((0, 1), offset, 1.3, np.ones(3, dtype=bool), np.zeros((2, 2)))
    for change in (0.99, -0.99, 1.01, -1.01, -2.0 * abs(offset) / MAX_CLEARANCE_CHANGE_M):
        beside = offset + change * MAX_CLEARANCE_CHANGE_M * np.sign(offset)
        tracks = [straight(-25.0, y, 0.0, 8.0, TIME) for y in (0.0, beside)]
        found = list(clearance_violations(scenario_of(tracks, TIME), [pair]))
        assert [fault.cause for fault in found] == [Cause.SIDE_CLEARANCE] * (abs(change) > 1.0)


@pytest.mark.parametrize(("share", "longest"), [(1.0, 4.0), (0.5, 3.0)])
def test_follower_falls_back_by_its_share(share, longest):
    """Its longest recorded time gap is 2 s."""
    edge = Reaction(FOLLOW, 1, 0, 1.0, 1.0, 1.0, 0.9, 0.0, 9.0, (1.0, 1.5, 2.0))
    limits = replace(FREE, headway_share=share)
    for gap in (longest - 0.01, longest + 0.01):
        tracks = [
            straight(0.0, 0.0, 0.0, 8.0, TIME),
            straight(-4.8 - 8.0 * gap, 0.0, 0.0, 8.0, TIME),
        ]
        found = causes_of(scenario_of(tracks, TIME), limits=limits, reactions=[edge])
        assert found == [Cause.REACTION] * (gap > longest)
