# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Oriented rectangles: their corners, whether two overlap, their distance, and when they will touch.

Two convex shapes are apart exactly if a line along a side of one of them separates them (separating axes: Gottschalk, Lin &
Manocha 1996). For two rectangles that leaves four axes: along and across each.
"""

from typing import NamedTuple

import numpy as np

from scenario_gen.numerics.arrays import Floats
from scenario_gen.numerics.kernels import F1, F2, kernel, OUT1, OUT2
from scenario_gen.numerics.plane import place

STILL = 1e-6  # m/s; what closes more slowly does not close: rounding alone makes equal velocities differ

Four = tuple[float, float, float, float]


class Box(NamedTuple):
    """A rectangle: its centre [m], the cosine and sine of its heading, half its length and half its width [m]."""

    x: float
    y: float
    cos: float
    sin: float
    length: float
    width: float


def corners(poses: Floats, length: float, width: float) -> Floats:
    """Return the corners (M, 4, 2) [m] of footprints at poses (M, 3), counter-clockwise from the front left one."""
    ahead = np.array([1.0, -1.0, -1.0, 1.0]) * length / 2.0
    left = np.array([1.0, 1.0, -1.0, -1.0]) * width / 2.0
    return place(poses[:, None], ahead, left)


@kernel(inline=True)
def axes(a: Box, b: Box) -> tuple[tuple[float, float], ...]:
    """Return the four axes, unit vectors: along and across `a`, along and across `b`."""
    return (a.cos, a.sin), (-a.sin, a.cos), (b.cos, b.sin), (-b.sin, b.cos)


@kernel(inline=True)
def reaches(a: Box, b: Box) -> Four:
    """Return how far apart [m] the centres are along each of the `axes` when the boxes touch there."""
    cos, sin = abs(a.cos * b.cos + a.sin * b.sin), abs(a.sin * b.cos - a.cos * b.sin)
    return (
        a.length + b.length * cos + b.width * sin,
        a.width + b.length * sin + b.width * cos,
        b.length + a.length * cos + a.width * sin,
        b.width + a.length * sin + a.width * cos,
    )


@kernel(inline=True)
def box_gap(a: Box, b: Box) -> float:
    """Return the largest separation [m] over the axes: negative by how deep they overlap, no more than their distance."""
    dx, dy, axis, reach = b.x - a.x, b.y - a.y, axes(a, b), reaches(a, b)
    gap = -np.inf
    for k in range(4):
        gap = max(gap, abs(dx * axis[k][0] + dy * axis[k][1]) - reach[k])
    return gap


@kernel(inline=True)
def box_distance(a: Box, b: Box) -> float:
    """Return the distance [m] of two boxes, 0 where they overlap: they are nearest at a corner of one of them."""
    if box_gap(a, b) < 0.0:
        return 0.0
    return min(_corner_distance(a, b), _corner_distance(b, a))


@kernel(inline=True)
def _corner_distance(a: Box, b: Box) -> float:
    """Least distance [m] from the corners of b to a."""
    least = np.inf
    for k in range(4):
        ahead, left = b.length if k < 2 else -b.length, b.width if k % 3 == 0 else -b.width
        dx, dy = b.x + ahead * b.cos - left * b.sin - a.x, b.y + ahead * b.sin + left * b.cos - a.y
        along, across = (
            abs(dx * a.cos + dy * a.sin) - a.length,
            abs(dy * a.cos - dx * a.sin) - a.width,
        )
        least = min(least, np.hypot(max(along, 0.0), max(across, 0.0)))
    return least


@kernel(inline=True)
def time_to_touch(a: Box, b: Box, vx: float, vy: float) -> float:
    """Return the seconds until two boxes that do not turn touch, b moving at (vx, vy) [m/s] relative to a; inf if never.

    On each axis they overlap during one interval of time; they touch when all have begun and none has ended.
    """
    dx, dy, axis, reach = b.x - a.x, b.y - a.y, axes(a, b), reaches(a, b)
    begin, end = -np.inf, np.inf
    for k in range(4):
        offset, closing = dx * axis[k][0] + dy * axis[k][1], vx * axis[k][0] + vy * axis[k][1]
        if abs(closing) >= STILL:
            enters, leaves = (-reach[k] - offset) / closing, (reach[k] - offset) / closing
            begin, end = max(begin, min(enters, leaves)), min(end, max(enters, leaves))
        elif abs(offset) >= reach[k]:
            return np.inf
    return max(begin, 0.0) if begin < end and end > 0.0 else np.inf


@kernel(inline=True)
def fill_box(x: float, y: float, yaw: float, length: float, width: float, out: Floats) -> None:
    """Write a box of half sizes `length` and `width` [m] at a pose [m, rad] into `out` (7,): a `Box`, and its radius [m]."""
    out[0], out[1], out[2], out[3] = x, y, np.cos(yaw), np.sin(yaw)
    out[4], out[5], out[6] = length, width, np.sqrt(length * length + width * width)


@kernel(inline=True)
def boxes_meet(a: Floats, b: Floats) -> bool:
    """Return whether two boxes of `fill_box` overlap."""
    dx, dy, reach = b[0] - a[0], b[1] - a[1], a[6] + b[6]
    if dx * dx + dy * dy >= reach * reach:
        return False
    return (
        box_gap(Box(a[0], a[1], a[2], a[3], a[4], a[5]), Box(b[0], b[1], b[2], b[3], b[4], b[5]))
        < 0.0
    )


def footprint_gaps(
    a: tuple[float, float], poses_a: Floats, b: tuple[float, float], poses_b: Floats
) -> tuple[Floats, Floats]:
    """Return the signed gap of two footprints at many instants; between corners the true distance is larger.

    Args:
        a: half length and half width [m] of one.
        poses_a: (T, 3) its poses [m, m, rad].
        b: half length and half width [m] of the other.
        poses_b: (T, 3) its poses.

    Returns:
        (T,) metres, see `box_gap`; and (T, 2) the axis of that separation, a unit vector from b to a.
    """
    gap, axis = np.empty(len(poses_a)), np.empty((len(poses_a), 2))
    _fill_gaps(poses_a, np.array(a), poses_b, np.array(b), gap, axis)
    return gap, axis


@kernel(F2, F1, F2, F1, OUT1, OUT2)
def _fill_gaps(
    poses_a: Floats, half_a: Floats, poses_b: Floats, half_b: Floats, gap: Floats, axis: Floats
) -> None:
    for t in range(len(gap)):
        p, q = poses_a[t], poses_b[t]
        a = Box(p[0], p[1], np.cos(p[2]), np.sin(p[2]), half_a[0], half_a[1])
        b = Box(q[0], q[1], np.cos(q[2]), np.sin(q[2]), half_b[0], half_b[1])
        ways, reach = axes(a, b), reaches(a, b)
        gap[t] = -np.inf
        for k in range(4):
            x, y = ways[k]
            along = (a.x - b.x) * x + (a.y - b.y) * y
            if abs(along) - reach[k] > gap[t]:
                gap[t] = abs(along) - reach[k]
                side = 1.0 if along >= 0.0 else -1.0
                axis[t, 0], axis[t, 1] = side * x, side * y
