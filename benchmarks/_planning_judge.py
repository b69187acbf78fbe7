# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A judge of obstructed roads that shares no code with the planners: can the car drive from start to goal at all?

Breadth first, all poses that the car reaches by arcs of its sharpest curvature and by straight pieces, one pose for each cell and
direction. The footprint's obstacles are found by dilation for each direction, larger by what rounding to cells and directions
can hide, so a way that is found is one (LaValle 2006, 14.4.1; Dolgov et al. 2010). One that is not found may exist: a narrow one.
"""

import numpy as np
from scipy.signal import fftconvolve

from benchmarks._planning_obstructed import Obstructed
from scenario_gen.numerics import Bools, Floats

DIRECTIONS = 120
STEP = 0.4  # m of a piece
NEAR = np.array([0.3, 0.3, 0.1])  # m, m, rad from the goal at which it counts as reached
PIECES = 4000  # most rounds


def is_drivable(case: Obstructed) -> bool:
    """Return whether the judge finds a way."""
    road, query = case.road, case.query
    free = _free(road.drivable, road.resolution, query.length, query.width)
    height, width = road.drivable.shape
    seen = np.zeros((DIRECTIONS, height, width), dtype=np.bool_)
    poses = (np.asarray(query.start) - [*road.origin, 0.0])[None]
    goal = np.asarray(query.goal) - [*road.origin, 0.0]
    for _ in range(PIECES):
        poses = np.concatenate(
            [_moved(poses, k) for k in (-query.curvature, 0.0, query.curvature)]
        )
        cell = np.floor(poses[:, :2] / road.resolution).astype(int)
        turn = np.round(poses[:, 2] / (2.0 * np.pi / DIRECTIONS)).astype(int) % DIRECTIONS
        inside = ((cell >= 0) & (cell < (width, height))).all(axis=1)
        poses, cell, turn = poses[inside], cell[inside], turn[inside]
        place = np.ravel_multi_index((turn, cell[:, 1], cell[:, 0]), seen.shape)
        new = np.unique(place, return_index=True)[1]
        new = new[free.ravel()[place[new]] & ~seen.ravel()[place[new]]]
        poses = poses[new]
        if not len(poses):
            return False
        seen.ravel()[place[new]] = True
        off = poses - goal
        off[:, 2] = (off[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
        if (np.abs(off) < NEAR).all(axis=1).any():
            return True
    return False


def _moved(poses: Floats, curvature: float) -> Floats:
    """Return poses (M, 3) a piece further on."""
    x, y, yaw = poses.T
    turned = yaw + STEP * curvature
    chord = STEP * np.sinc(0.5 * STEP * curvature / np.pi)
    middle = yaw + 0.5 * STEP * curvature
    return np.stack([x + chord * np.cos(middle), y + chord * np.sin(middle), turned], axis=1)


def _free(drivable: Bools, cell: float, length: float, width: float) -> Bools:
    """(DIRECTIONS, H, W): whether a footprint anywhere in a cell, within half a step of a direction or a piece, is drivable."""
    reach = 0.5 * np.hypot(length, width)
    slack = (
        np.sqrt(0.5) * cell + reach * np.pi / DIRECTIONS + 0.5 * STEP * 0.05
    )  # of the place, of the direction, of a piece
    size = int(np.ceil((reach + slack) / cell)) + 1
    y, x = (cell * axis for axis in np.mgrid[-size : size + 1, -size : size + 1])
    blocked = np.pad(~drivable, size, constant_values=True).astype(np.float64)
    out = np.empty((DIRECTIONS, *drivable.shape), dtype=np.bool_)
    for k in range(DIRECTIONS):
        c, s = np.cos(2.0 * np.pi * k / DIRECTIONS), np.sin(2.0 * np.pi * k / DIRECTIONS)
        along, across = np.abs(c * x + s * y) - 0.5 * length, np.abs(c * y - s * x) - 0.5 * width
        body = (
            np.hypot(np.maximum(along, 0.0), np.maximum(across, 0.0))
            <= slack + np.sqrt(0.5) * cell
        )
        out[k] = fftconvolve(blocked, body[::-1, ::-1], mode="valid") < 0.5
    return out
