# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Depth and room of a footprint against every pair of a point and a cell."""

import numpy as np
import pytest

from scenario_gen.closed_loop.off_road import _depths_and_areas, _least_room, MAX_DEPTH_M
from scenario_gen.types.road import Road

HALF = (2.0, 0.9)


def plain(drivable, res, pose, *, outside):
    """Greatest depth or least room [m] by comparing points 10 cm apart with every cell."""
    x, y = np.meshgrid(np.linspace(-HALF[0], HALF[0], 41), np.linspace(-HALF[1], HALF[1], 19))
    c, s = np.cos(pose[2]), np.sin(pose[2])
    px, py = (pose[0] + c * x - s * y).ravel() / res, (pose[1] + s * x + c * y).ravel() / res
    rim = int(np.ceil(10.0 / res))  # beyond it no cell is the nearest of any point
    grid = np.pad(drivable, rim)
    rows, columns = np.nonzero(grid if outside else ~grid)
    du = np.maximum(np.maximum(columns - rim - px[:, None], px[:, None] - columns + rim - 1), 0.0)
    dv = np.maximum(np.maximum(rows - rim - py[:, None], py[:, None] - rows + rim - 1), 0.0)
    nearest = np.sqrt(du * du + dv * dv).min(axis=1) * res
    return min(nearest.max() if outside else nearest.min(), MAX_DEPTH_M)


@pytest.mark.parametrize("seed", range(2))
def test_depth_and_room_are_those_of_points_and_cells(seed):
    rng = np.random.default_rng(seed)
    res = (1.0, 1.5)[seed % 2]
    drivable = np.zeros((30, 30), dtype=np.bool_)
    drivable[8:22, 4:26] = True
    drivable[rng.random((30, 30)) < 0.004] ^= True
    road = Road("patches", drivable, res, np.zeros(2), np.empty((0, 3)), np.empty((0, 3)))
    poses = np.column_stack(
        [rng.uniform(-6.0, 30.0 * res + 6.0, (12, 2)), rng.uniform(-3.0, 3.0, 12)]
    )
    for outside in (True, False):
        if outside:
            measured, _ = _depths_and_areas(road, poses, HALF)
        else:
            measured = [_least_room(road, pose[None], HALF) for pose in poses]
        expected = [plain(drivable, res, pose, outside=outside) for pose in poses]
        assert measured == pytest.approx(expected, abs=0.1)
        assert np.ptp(expected) > 0.5


def test_area_of_a_footprint_half_outside():
    drivable = np.zeros((40, 40), dtype=np.bool_)
    drivable[:20] = True
    road = Road("half", drivable, 0.5, np.zeros(2), np.empty((0, 3)), np.empty((0, 3)))
    (depth,), (area,) = _depths_and_areas(road, np.array([[10.0, 10.0, 0.0]]), HALF)
    assert depth == pytest.approx(0.9) and area == pytest.approx(3.6, rel=0.06)
    (depth,), (area,) = _depths_and_areas(road, np.array([[500.0, 10.0, 0.0]]), HALF)
    assert depth == MAX_DEPTH_M and area == pytest.approx(7.2)
