# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Connectivity: which parts of a road a disc can reach from which.

Cells whose centre has more clearance than the disc's radius are joined to their four neighbours. Between two such centres
the clearance is nowhere less than at one of them (a square's profile is flat for half a cell to either side of its
middle), so every step is a move that the disc can really make: where two cells share a component, there is a way.
"""

from collections.abc import Iterator
import math

import numpy as np
from scipy import ndimage

from scenario_gen.numerics import Floats, Ints, sealed
from scenario_gen.roads.clearance import clearance_in_cells, segment_free, segments_free, to_metres
from scenario_gen.types import once_per_object, Road


@once_per_object
def components(road: Road, radius: float) -> Ints:
    """Connected components for a disc of `radius` [m]: (H, W), 0 where its centre cannot be, else 1, 2, …; read-only, cached."""
    return sealed(
        ndimage.label(clearance_in_cells(road) > radius / road.resolution)[0].astype(np.int64)
    )


@once_per_object
def component_cells(road: Road, radius: float, label: int) -> tuple[Ints, Ints]:
    """Flat indices of the cells of one component, in order, for a disc of `radius` [m]; cached.

    Returns:
        All of them (n,), and those (c,) that lie diagonally before a convex corner of what the disc cannot enter.
    """
    inside = np.pad(components(road, radius) == label, 1)
    corner = np.zeros(road.drivable.shape, dtype=np.bool_)
    rows, columns = road.drivable.shape
    for di, dj in (
        (0, 0),
        (0, 2),
        (2, 0),
        (2, 2),
    ):  # the diagonal neighbour is closed, the two between are open
        beside, above = inside[1:-1, dj : dj + columns], inside[di : di + rows, 1:-1]
        corner |= ~inside[di : di + rows, dj : dj + columns] & beside & above
    corner &= inside[1:-1, 1:-1]
    return sealed(np.flatnonzero(inside[1:-1, 1:-1])), sealed(np.flatnonzero(corner))


def component_at(road: Road, xy: Floats, radius: float) -> int:
    """The component that a disc of `radius` [m] at `xy` (2,) [m] can move to at once; 0 if it collides or is walled in."""
    u, v = (float(xy[axis] - road.origin[axis]) / road.resolution for axis in range(2))
    column, row = math.floor(u), math.floor(v)
    labels = components(road, radius)
    if 0 <= row < labels.shape[0] and 0 <= column < labels.shape[1] and labels[row, column] > 0:
        field = clearance_in_cells(road)  # nearly always the cell's own centre will do
        if segment_free(field, u, v, column + 0.5, row + 0.5, radius / road.resolution):
            return int(labels[row, column])
    return next(_reachable(road, np.asarray(xy, dtype=np.float64), radius), 0)


def common_component(road: Road, start_xy: Floats, goal_xy: Floats, radius: float) -> int | None:
    """The component by which a disc of `radius` [m] can move from start (2,) [m] to goal (2,) [m].

    Returns:
        Its label; 0 where there is none, but the straight way is free; None where no way is known.
    """
    first, last = component_at(road, start_xy, radius), component_at(road, goal_xy, radius)
    if first == last > 0:
        return first
    start, goal = np.asarray(start_xy, dtype=np.float64), np.asarray(goal_xy, dtype=np.float64)
    if segments_free(road, start[None], goal[None], radius)[0]:
        return first or last
    theirs = set(_reachable(road, goal, radius))
    return next((label for label in _reachable(road, start, radius) if label in theirs), None)


def _reachable(road: Road, xy: Floats, radius: float) -> Iterator[int]:
    """Labels of the cell centres near `xy` that a straight move leads to, nearest first."""
    labels = components(road, radius)
    height, width = labels.shape
    column, row = np.floor((xy - road.origin) / road.resolution).astype(int)
    i, j = np.mgrid[row - 2 : row + 3, column - 2 : column + 3].reshape(2, -1)
    inside = (i >= 0) & (j >= 0) & (i < height) & (j < width)
    i, j = i[inside], j[inside]
    i, j = i[labels[i, j] > 0], j[labels[i, j] > 0]
    centres = to_metres(road, np.stack((j + 0.5, i + 0.5), axis=-1))
    free = segments_free(road, np.broadcast_to(xy, centres.shape), centres, radius)
    for k in np.argsort(np.hypot(*(centres - xy).T), kind="stable"):
        if free[k]:
            yield int(labels[i[k], j[k]])
