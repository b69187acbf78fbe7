# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The least time shift after which two vehicles meet, against shapely's polygons at every pair of instants."""

import numpy as np
import pytest
import shapely

from scenario_gen.method.evaluation.time_shift import MAX_SHIFT_S, poses_time_shift
from scenario_gen.types import Vehicle

CORNERS = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]]) / 2.0


def polygons(poses, vehicle):
    """The footprints of poses (S, 4) with times."""
    sine, cosine = np.sin(poses[:, 3]), np.cos(poses[:, 3])
    turn = np.stack([cosine, sine, -sine, cosine], -1).reshape(-1, 2, 2)
    return shapely.polygons(CORNERS * (vehicle.length, vehicle.width) @ turn + poses[:, None, 1:3])


def drive(rng, count):
    """Poses (count, 4) with times of a steady turn near the origin."""
    time = rng.uniform(0.0, 2.0) + 0.1 * np.arange(count)
    yaw = rng.uniform(-np.pi, np.pi) + rng.uniform(-0.4, 0.4) * time
    step = 0.1 * rng.uniform(1.0, 12.0) * np.stack([np.cos(yaw), np.sin(yaw)], -1)
    place = np.cumsum(step, axis=0)
    return np.column_stack([time, place - place[count // 2] + rng.uniform(-9.0, 9.0, 2), yaw])


@pytest.mark.parametrize("seed", range(30))
def test_shift_is_least_among_meetings(seed):
    rng = np.random.default_rng(seed)
    vehicles = tuple(Vehicle(name, *rng.uniform((2, 0.6), (9, 2.5))) for name in "ab")
    a, b = drive(rng, 40), drive(rng, 55)
    meet = shapely.intersects(polygons(a, vehicles[0])[:, None], polygons(b, vehicles[1])[None, :])
    shifts = np.where(meet, np.abs(a[:, None, 0] - b[None, :, 0]), MAX_SHIFT_S)
    assert poses_time_shift(a, b, vehicles) == pytest.approx(shifts.min(), abs=1e-9)


def test_standing_vehicle_is_met_once():
    """The second stands across the first one's path at 30 m, which it reaches after 3 s less half its length."""
    time = 0.1 * np.arange(60)
    a = np.column_stack([time, 10.0 * time, 0.0 * time, 0.0 * time])
    b = np.array([[0.0, 30.0, 0.0, np.pi / 2.0], [1.0, 30.0, 0.0, np.pi / 2.0]])
    vehicles = (Vehicle("a", 4.0, 2.0), Vehicle("b", 6.0, 2.0))
    assert poses_time_shift(a, b, vehicles) == pytest.approx(3.0 - 0.3 - 1.0, abs=0.11)
    assert poses_time_shift(a[:20], b, vehicles) == MAX_SHIFT_S
    assert poses_time_shift(a, b[:0], vehicles) == MAX_SHIFT_S


@pytest.mark.parametrize(("beyond", "met"), [(-0.01, True), (0.01, False)])
def test_corners_meet_at_their_diagonals(beyond, met):
    """Two that stand for an instant each, a second apart, on a line through a corner of each."""
    vehicles = (Vehicle("a", 4.0, 2.0), Vehicle("b", 6.0, 3.0))
    apart = np.hypot(2.0, 1.0) + np.hypot(3.0, 1.5) + beyond
    a = np.array([[0.0, 0.0, 0.0, -np.arctan2(1.0, 2.0)]])
    b = np.array([[1.0, apart, 0.0, np.pi - np.arctan2(1.5, 3.0)]])
    assert poses_time_shift(a, b, vehicles) == (1.0 if met else MAX_SHIFT_S)
