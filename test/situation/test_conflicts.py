# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Waits, conflicts and passing orders: known cases, and agreement with shapely on random ones."""

from dataclasses import replace

from hypothesis import example, given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
import shapely
from support.motions import encounter_of
from support.oracle import footprints

from scenario_gen.situation import find_conflicts, find_waits, Wait
from scenario_gen.types import Motion, Vehicle

CARS = (Vehicle("a"), Vehicle("b"))
TIME = np.arange(101) * 0.1


def straight(x, y, yaw, speed, time=TIME):
    """Position (T, 2) and heading (T,) of a steady straight drive."""
    s = speed * time
    return np.stack([x + s * np.cos(yaw), y + s * np.sin(yaw)], -1), np.full(time.size, yaw)


def moving(vehicles, time, position, heading, **present):
    return Motion(vehicles, time, position, heading, np.zeros_like(heading), **present)


def conflicts(*tracks, vehicles=CARS, time=TIME):
    position, heading = (np.array(a) for a in zip(*tracks, strict=True))
    return find_conflicts(moving(vehicles, time, position, heading))


def encounter(speed):
    return encounter_of(np.zeros((*speed.shape, 2)), 0.0, speed, CARS[: len(speed)])


def test_crossing_is_ordered_by_first_entry():
    (found,) = conflicts(straight(-30, 0, 0, 5), straight(0, -20, np.pi / 2, 5))
    assert (found.first, found.second, found.following) == (1, 0, False)
    # b's front (2.4 m ahead) reaches a's sweep (|y| <= 0.95) after 20 - 2.4 - 0.95 = 16.65 m, its rear leaves it 6.7 m later
    assert found.entry_first == pytest.approx(16.65 / 5, abs=1e-3)
    assert found.exit_first == pytest.approx((20 + 2.4 + 0.95) / 5, abs=1e-3)
    assert found.entry_second == pytest.approx((30 - 2.4 - 0.95) / 5, abs=1e-3)


def test_parallel_lanes_are_no_conflict():
    assert conflicts(straight(0, 0, 0, 10), straight(100, 2.0, np.pi, 10)) == ()
    (found,) = conflicts(straight(0, 0, 0, 10), straight(110, 1.8, np.pi, 10))
    # both sweeps share a strip; a enters it where b's journey ends, b where a's ends
    assert not found.following
    assert (found.first, found.second) == (0, 1)
    (found,) = conflicts(straight(0, 0, 0, 10), straight(110, 1.8, np.pi, 20))
    assert (found.first, found.entry_first, found.entry_second) == (
        0,
        0.0,
        pytest.approx((110 - 102.4 - 2.4) / 20, abs=1e-3),
    )


@pytest.mark.parametrize("leader", [0, 1])
@pytest.mark.parametrize(
    ("ahead", "speed", "beside", "entry"),
    [(20, 9, 0.3, 15.2), (3, 10, 0.0, None)],
    ids=["apart", "on top"],
)
def test_following_is_ordered_along_the_route(leader, ahead, speed, beside, entry):
    """Also of cars that were recorded on top of each other."""
    tracks = [straight(0, 0 if entry else 0.2, 0, 10)] * 2
    tracks[leader] = straight(ahead, beside, 0, speed)
    (found,) = conflicts(*tracks)
    assert (found.first, found.second, found.following, found.entry_first) == (
        leader,
        1 - leader,
        True,
        0.0,
    )
    assert entry is None or found.entry_second == pytest.approx(entry / 10, abs=1e-3)


def test_standing_vehicle_in_way_is_first():
    (found,) = conflicts(straight(0, 0, 0, 10), straight(50, 1.0, 0, 0))
    assert (found.first, found.following, found.entry_first, found.exit_first) == (
        1,
        False,
        0.0,
        10.0,
    )


def test_simultaneous_entry_is_ordered_by_index():
    (found,) = conflicts(straight(-20, 0, 0, 5), straight(0, -20, np.pi / 2, 5))
    assert (found.first, found.second) == (0, 1)


def test_merging_is_ordered_by_merge():
    x = np.linspace(0, 100, TIME.size)
    merge = np.stack([x + 5, 3.5 * (1 - 1 / (1 + np.exp(-(x - 40) / 5)))], -1)
    heading = np.arctan2(np.gradient(merge[:, 1]), np.gradient(merge[:, 0]))
    (found,) = conflicts(straight(-10, 0, 0, 10), (merge, heading))
    assert (found.first, found.following) == (1, True)


def test_fast_crossing_between_samples_is_seen():
    time = np.arange(11) * 1.0  # 40 m between samples
    (found,) = conflicts(
        straight(-100, 0, 0, 40, time), straight(20, -210, np.pi / 2, 40, time), time=time
    )
    assert found.first == 0
    assert found.entry_first == pytest.approx((120 - 2.4 - 0.95) / 40, abs=0.01)


def speeds(first, second, *changes):
    """Speeds (2, 101), and changes of them: who, from which sample, to which, how fast."""
    speed = np.repeat([[first], [second]], 101, axis=1).astype(float)
    for who, begin, end, value in changes:
        speed[who, begin:end] = value
    return encounter(speed)


def test_waits_are_slow_for_a_second():
    found = find_waits(
        speeds(5.0, 0.2, (0, 20, 40, 0.0), (0, 60, 66, 0.0))
    )  # the second time for half a second
    assert found == (
        Wait(0, pytest.approx(2.2), pytest.approx(3.7)),
        Wait(1, 0.0, 10.0, moves_slowly=True),
    )
    assert find_waits(speeds(0.1, 0.1, (0, 50, 51, 1.4))) == (
        Wait(0, 0.0, 10.0),
        Wait(1, 0.0, 10.0),
    )


def test_short_stand_is_slow_motion():
    made = speeds(
        5.0, 5.0, (0, 20, 60, 0.3), (0, 30, 39, 0.0), (1, 20, 60, 0.3), (1, 30, 41, 0.05)
    )
    assert [wait.moves_slowly for wait in find_waits(made)] == [True, False]


PARTS = 8  # of a step in the finest sweep; an even number, so that it has every pose of ours, which halves steps above 1 m
TURN_ERROR = 1e-4  # m; between samples cosines are interpolated: at 0.05 rad a step that turns a box of 8 m by less than 1e-5 rad
DEPTH = 2e-6  # m by which the oracle's boxes are smaller, so that what still meets is deeper than what we call a touch (1e-6 m)


def boxes_of(vehicle, poses, grow=0.0):
    size = vehicle.length + grow, vehicle.width + grow
    return footprints(poses[:, :2], poses[:, 2], *size)


@given(seed=st.integers(0, 2**32 - 1))
@example(seed=1485272)  # in whose long steps the halves are met before any sample
@example(seed=120182612)
@settings(max_examples=40)
def test_existence_and_entry_agree_with_shapely(seed):
    """An entry is no later than into the samples' sweep, which lies in ours, and meets a finer one, in which ours lies.

    How far these two are apart depends on how slowly one grazes a corner of the other's sweep, and has no bound.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(41) * 0.1
    fine = np.linspace(0.0, time[-1], PARTS * (time.size - 1) + 1)
    vehicles = tuple(Vehicle(str(i), rng.uniform(2, 8), rng.uniform(0.8, 2.5)) for i in range(2))
    tracks = []
    for _ in range(2):
        yaw = rng.uniform(-np.pi, np.pi) + np.cumsum(np.full(time.size, rng.uniform(-0.05, 0.05)))
        # slower than 2 cm a sample, samples are left out of the sweep; `test_standing_vehicle_in_way_is_first`
        step = np.stack([np.cos(yaw), np.sin(yaw)], -1) * max(rng.uniform(0, 1.5), 0.02)
        tracks.append((rng.uniform(-15, 15, 2) + np.cumsum(step, 0), yaw))
    found = conflicts(*tracks, vehicles=vehicles, time=time)

    def poses(i, at):
        position, yaw = tracks[i]
        return np.column_stack([np.interp(at, time, column) for column in (*position.T, yaw)])

    samples = [boxes_of(vehicles[i], poses(i, time), -DEPTH) for i in range(2)]
    sweeps = [shapely.union_all(one) for one in samples]
    latest = [
        next(
            (t for t, one in zip(time, samples[i], strict=True) if one.intersects(sweeps[1 - i])),
            np.inf,
        )
        for i in range(2)
    ]
    if not found:
        assert latest == [np.inf, np.inf]
        return
    (one,) = found
    times = {one.first: one.entry_first, one.second: one.entry_second}
    for i in range(2):
        assert times[i] <= latest[i]
        (here,) = boxes_of(vehicles[i], poses(i, np.array([times[i]])), TURN_ERROR)
        assert any(
            here.intersects(other)
            for other in boxes_of(vehicles[1 - i], poses(1 - i, fine), TURN_ERROR)
        )
    assert one.following or one.entry_first <= one.entry_second


def test_late_presence_enters_late():
    """Vehicle b stands in a's way from its arrival on; before it arrives it is in nobody's way."""
    tracks = straight(-30, 0, 0, 5), straight(-10, 0, 0, 0)
    position, heading = (np.array(a) for a in zip(*tracks, strict=True))
    (found,) = find_conflicts(
        moving(CARS, TIME, position, heading, present=np.array([[0, 100], [70, 100]]))
    )
    assert (found.first, found.entry_second) == (0, 7.0)
    (found,) = find_conflicts(moving(CARS, TIME, position, heading))
    assert (found.first, found.entry_first) == (1, 0.0)


def test_vehicle_waits_only_while_present():
    (wait,) = find_waits(replace(speeds(5.0, 0.2), present=np.array([[0, 100], [30, 80]])))
    assert (wait.vehicle, wait.start, wait.end) == (1, 3.0, 8.0)


def test_who_walks_slowly_does_not_wait():
    """A pedestrian at 0.35 m/s walks, one that stands for 2 s waits; a car at that speed waits."""
    speed = np.full((2, 101), 0.35)
    speed[1, 40:61] = 0.05
    on_foot = replace(
        encounter(speed), vehicles=tuple(Vehicle(name, 0.5, 0.5, "pedestrian") for name in "ab")
    )
    (found,) = find_waits(on_foot)
    assert found.vehicle == 1 and found.end - found.start == pytest.approx(2.0, abs=0.4)
    assert [wait.end - wait.start for wait in find_waits(encounter(speed))] == pytest.approx(
        [10.0, 10.0]
    )


@pytest.mark.parametrize(("dt", "late"), [(0.1, 0.2), (0.05, 0.2), (0.02, 0.18)])
def test_wait_uses_the_mean_speed(dt, late):
    """From 4 m/s at once to a stand from 2 s to 6 s: the mean falls below 0.5 m/s when an eighth moves."""
    time = np.arange(round(10.0 / dt) + 1) * dt
    speed = np.where((time > 2.0 - 1e-9) & (time < 6.0 + 1e-9), 0.0, 4.0)[None]
    flat = np.zeros_like(speed)
    (wait,) = find_waits(Motion.sampled(CARS[:1], dt, np.zeros((1, len(time), 2)), flat, speed))
    assert (wait.start, wait.end) == pytest.approx((2.0 + late, 6.0 - late), abs=1e-6)
