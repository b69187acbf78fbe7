# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Depth and room of a footprint, against shapely's distances."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from support.motions import road_of

from scenario_gen.closed_loop.off_road import _depth, is_off_road, MAX_DEPTH_M, road_use
from scenario_gen.types import LaneNetwork, Motion, Obstacle, Vehicle

HALF = (2.0, 0.9)


def plain(cells, pose):
    """Greatest distance [m] of points 2 cm apart from the nearest drivable cell, by shapely."""
    x, y = np.meshgrid(np.linspace(-HALF[0], HALF[0], 201), np.linspace(-HALF[1], HALF[1], 91))
    c, s = np.cos(pose[2]), np.sin(pose[2])
    points = shapely.points(pose[0] + c * x - s * y, pose[1] + s * x + c * y)
    _, away = cells.query_nearest(points.ravel(), return_distance=True, all_matches=False)
    return min(away.max(), MAX_DEPTH_M)


@pytest.mark.parametrize("seed", range(2))
def test_depth_is_of_the_deepest_point(seed):
    rng = np.random.default_rng(seed)
    res = (1.0, 0.5)[seed]
    drivable = np.zeros((30, 30), dtype=np.bool_)
    drivable[8:22, 4:26] = True
    drivable[rng.random((30, 30)) < 0.02] ^= True
    poses = np.column_stack(
        [rng.uniform(-2.0, 30.0 * res + 2.0, (20, 2)), rng.uniform(-3.0, 3.0, 20)]
    )
    road = road_of(drivable, res)
    measured = [_depth(road, pose[None], HALF) for pose in poses]
    low = np.argwhere(drivable)[:, ::-1] * res
    cells = shapely.STRtree(shapely.box(*low.T, *(low + res).T))
    expected = [plain(cells, pose) for pose in poses]
    assert measured == pytest.approx(expected, abs=0.014)  # a point may lie between two of 2 cm
    assert np.ptp(expected) > 0.5


def straight_drive(start, end):
    """A drive of a car, 4 × 1.8 m, from pose to pose (3,) in 2 s."""
    time = np.linspace(0.0, 2.0, 21)
    poses = np.linspace(start, end, 21)
    speed = np.full((1, 21), np.hypot(*(np.subtract(end, start)[:2])) / 2.0)
    motion = Motion(
        (Vehicle("ego", 4.0, 1.8),), time, poses[None, :, :2], poses[None, :, 2], speed
    )
    return SimpleNamespace(motion=motion, ego=0, driven=21)


def test_drive_beside_and_over_the_edge():
    drivable = np.zeros((40, 80), dtype=np.bool_)
    drivable[:20] = True  # up to y = 10 m
    road = road_of(drivable, 0.5)
    inside = road_use(straight_drive((5.0, 8.0, 0.0), (25.0, 8.0, 0.0)), road, 0.1)
    assert inside.margin == pytest.approx(1.1) and np.isnan(inside.time)
    over = road_use(straight_drive((5.0, 7.0, np.pi / 4), (15.0, 17.0, np.pi / 4)), road, 0.1)
    corner = (2.0 + 0.9) * np.sqrt(0.5)
    assert over.margin == pytest.approx(-(17.0 + corner - 10.0), abs=1e-6)
    assert over.time == pytest.approx((10.1 - 7.0 - corner) / 5.0, abs=1e-3)
    far = road_use(straight_drive((10.0, 5.0, 0.0), (500.0, 5.0, 0.0)), road, 0.1)
    assert far.margin == -MAX_DEPTH_M


def test_post_under_car_has_centre_depth():
    drivable = np.ones((60, 60), dtype=np.bool_)
    drivable[20:24, 20:24] = False  # 0.8 m wide
    depth = _depth(road_of(drivable, 0.2), np.array([[4.7, 4.3, 0.4]]), HALF)
    assert depth == pytest.approx(0.4, abs=0.001)


@pytest.mark.parametrize(
    ("x", "y", "off"),
    [
        (10.0, 10.0, False),
        (4.0, 10.0, True),  # in the obstacle
        (10.0, 18.95, False),  # nearer to the edge than its diagonal
        (10.0, 19.25, True),  # its centre is on the road
        (10.0, 25.0, True),  # the grid has no cell there
        (-5.0, 10.0, True),
    ],
)
def test_one_pose_off_the_road(x, y, off):
    parked = Obstacle(4.5, 10.0, 0.0, 1.0, 2.0)
    network = LaneNetwork("", (), obstacles=(parked,))
    road = replace(road_of(np.ones((40, 40), dtype=np.bool_), 0.5), lanes=network)
    assert is_off_road(road, np.array([x, y, 0.0]), HALF, 0.1) == off
