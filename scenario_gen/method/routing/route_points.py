# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The points of a route: a curve sampled so that one point lies at every anchor."""

from collections.abc import Callable
import itertools

import numpy as np
import shapely

from scenario_gen.method.routing.task import VehicleTask
from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.plane import ahead_and_left
from scenario_gen.types import Route


def squared_distances(rows: Floats, columns: Floats) -> Floats:
    """Return the squared distances (A, M) [m²] of points (A, 2) from others (M, 2)."""
    squares = np.zeros((len(rows), len(columns)))
    for axis in (0, 1):  # a long drive has many points: no array (A, M, 2)
        squares += np.square(rows[:, axis, None] - columns[None, :, axis])
    return squares


def monotone_matching(cost: Floats) -> Ints:
    """Match rows of `cost` (A, M) to non-decreasing columns at the least total cost: (A,) columns.

    Source: dynamic programming (Bellman 1957).
    """
    total = cost[0]
    previous = np.empty(cost.shape, dtype=np.int32)
    for k in range(1, len(cost)):
        lowest = np.minimum.accumulate(total)
        is_lower = np.concatenate(([True], total[1:] < lowest[:-1]))
        previous[k] = np.maximum.accumulate(np.where(is_lower, np.arange(len(total)), 0))
        total = lowest + cost[k]
    column = np.empty(len(cost), dtype=np.int64)
    column[-1] = np.argmin(total)
    for k in range(len(cost) - 1, 0, -1):
        column[k - 1] = previous[k, column[k]]
    return column


PROJECTION_SPACING_M = 0.05  # of points at which anchors may project
MAX_PROJECTION_POINTS = 20_000  # each is compared with each anchor
MIN_MOVE_M = 0.1  # a primitive that moves less is a dwell


def route_along(task: VehicleTask, poses_at: Callable[[Floats], Floats], total: float) -> Route:
    """Return a curve of length `total` [m] as a route, its points at most `spacing` apart.

    Args:
        task: the vehicle.
        poses_at: returns poses (M, 3) at arc lengths (M,).
        total: its length.
    """
    stops = _anchor_lengths(task, poses_at, total)
    for k in range(1, len(stops)):
        if stops[k] - stops[k - 1] < MIN_MOVE_M:
            stops[k] = stops[k - 1]
    stops[stops > total - MIN_MOVE_M] = total
    pieces, anchor = [np.zeros(1)], [0]
    for before, after in itertools.pairwise(stops):
        count = int(np.ceil((after - before) / task.config.spacing * 1.001))
        pieces.append(np.linspace(before, after, count + 1)[1:])
        anchor.append(anchor[-1] + count)
    length = np.concatenate(pieces)
    points = poses_at(length)
    points[0], points[-1] = task.anchors[0], task.anchors[-1]
    return Route(points, np.array(anchor), length)


def _anchor_lengths(
    task: VehicleTask, poses_at: Callable[[Floats], Floats], total: float
) -> Floats:
    """Return the arc length (A,) at which the curve passes each anchor, never going back.

    Both ends of a dwell have the same one.
    """
    count = min(int(np.ceil(total / PROJECTION_SPACING_M)), MAX_PROJECTION_POINTS)
    length = np.linspace(0.0, total, count + 1)
    poses = poses_at(length)
    group = np.concatenate(([0], np.cumsum(~task.fitted.stands)))
    cost = np.zeros((group[-1] + 1, len(poses)))
    np.add.at(cost, group, squared_distances(task.anchors[:, :2], poses[:, :2]))
    cost[0, 1:] = np.inf
    cost[-1, :-1] = np.inf
    nearest = monotone_matching(cost)
    matched = poses[nearest[group]]
    ahead, _ = ahead_and_left(task.anchors[:, :2] - matched[:, :2], matched[:, 2])
    mean_ahead = np.bincount(group, ahead) / np.bincount(group)
    step = length[1] if len(length) > 1 else 0.0
    refined = length[nearest] + np.clip(mean_ahead, -step, step)  # between two projection points
    refined[0], refined[-1] = 0.0, total
    return np.maximum.accumulate(np.clip(refined, 0.0, total))[group]


def max_distance(line: Floats, other: Floats) -> float:
    """Return the Hausdorff distance [m] of two polylines' points; NaN if `other` is empty."""
    if not len(other):
        return float("nan")
    return float(max(distances_to_line(line, other).max(), distances_to_line(other, line).max()))


def distances_to_line(points: Floats, line: Floats) -> Floats:
    """Return the distances (M,) [m] from points (M, 2 or more) to a polyline (P, 2 or more)."""
    corners = line[:, :2] if len(line) > 1 else np.repeat(line[:, :2], 2, axis=0)
    return np.asarray(
        shapely.distance(shapely.points(points[:, :2]), shapely.linestrings(corners))
    )
