# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Oriented rectangles: their corners, overlap, distance and time to contact.

Two convex polygons are disjoint exactly if a line along a side of one of them separates them
(separating axes: Gottschalk, Lin & Manocha 1996). Two rectangles have four such axes: along and
across each.
"""

from typing import NamedTuple

import numpy as np

from scenario_gen.numerics.arrays import Floats, place
from scenario_gen.numerics.kernels import F1, F2, kernel, OUT1, OUT2

MIN_CLOSING_SPEED_MPS = 1e-6  # rounding alone gives equal velocities a smaller difference

PerAxis = tuple[float, float, float, float]


class Box(NamedTuple):
    """A rectangle: centre [m], cosine and sine of the heading, half length and half width [m]."""

    x: float
    y: float
    cos: float
    sin: float
    length: float
    width: float


def corners(poses: Floats, length: float, width: float) -> Floats:
    """Return the corners (M, 4, 2) [m] of footprints at poses (M, 3).

    They are counter-clockwise from the front left.
    """
    ahead = np.array([1.0, -1.0, -1.0, 1.0]) * length / 2.0
    left = np.array([1.0, 1.0, -1.0, -1.0]) * width / 2.0
    return place(poses[:, None], ahead, left)


@kernel(inline=True)
def axes(a: Box, b: Box) -> tuple[tuple[float, float], ...]:
    """Return the four axes as unit vectors: along and across `a`, along and across `b`."""
    return (a.cos, a.sin), (-a.sin, a.cos), (b.cos, b.sin), (-b.sin, b.cos)


@kernel(inline=True)
def reaches(a: Box, b: Box) -> PerAxis:
    """Return the distance [m] of the centres along each of the `axes` at which the boxes touch."""
    cos = abs(a.cos * b.cos + a.sin * b.sin)
    sin = abs(a.sin * b.cos - a.cos * b.sin)
    return (
        a.length + b.length * cos + b.width * sin,
        a.width + b.length * sin + b.width * cos,
        b.length + a.length * cos + a.width * sin,
        b.width + a.length * sin + a.width * cos,
    )


@kernel(inline=True)
def box_gap(a: Box, b: Box) -> float:
    """Return the largest separation [m] over the axes.

    It is at most the distance; of overlapping boxes it is the negative depth of the overlap.
    """
    dx = b.x - a.x
    dy = b.y - a.y
    axis = axes(a, b)
    reach = reaches(a, b)
    gap = -np.inf
    for k in range(4):
        gap = max(gap, abs(dx * axis[k][0] + dy * axis[k][1]) - reach[k])
    return gap


@kernel(inline=True)
def box_distance(a: Box, b: Box) -> float:
    """Return the distance [m] of two boxes, 0 if they overlap.

    It is attained at a corner of one of them.
    """
    if box_gap(a, b) < 0.0:
        return 0.0
    return min(_corner_distance(a, b), _corner_distance(b, a))


@kernel(inline=True)
def _corner_distance(a: Box, b: Box) -> float:
    """Return the smallest distance [m] from the corners of `b` to `a`."""
    distance = np.inf
    for k in range(4):
        ahead = b.length if k < 2 else -b.length
        left = b.width if k % 3 == 0 else -b.width
        dx = b.x + ahead * b.cos - left * b.sin - a.x
        dy = b.y + ahead * b.sin + left * b.cos - a.y
        along = abs(dx * a.cos + dy * a.sin) - a.length
        across = abs(dy * a.cos - dx * a.sin) - a.width
        distance = min(distance, np.hypot(max(along, 0.0), max(across, 0.0)))
    return distance


@kernel(inline=True)
def time_to_touch(a: Box, b: Box, vx: float, vy: float) -> float:
    """Return the time [s] until two boxes that do not turn touch, inf if they never do.

    The boxes overlap along each axis during one time interval. They touch at the beginning of the
    intersection of these intervals.

    Args:
        a: one box.
        b: the other box.
        vx: velocity of `b` relative to `a` in x [m/s].
        vy: the same in y.
    """
    dx = b.x - a.x
    dy = b.y - a.y
    axis = axes(a, b)
    reach = reaches(a, b)
    begin = -np.inf
    end = np.inf
    for k in range(4):
        offset = dx * axis[k][0] + dy * axis[k][1]
        closing = vx * axis[k][0] + vy * axis[k][1]
        if abs(closing) >= MIN_CLOSING_SPEED_MPS:
            one_side = (-reach[k] - offset) / closing
            other_side = (reach[k] - offset) / closing
            begin = max(begin, min(one_side, other_side))
            end = min(end, max(one_side, other_side))
        elif abs(offset) >= reach[k]:
            return np.inf
    return max(begin, 0.0) if begin < end and end > 0.0 else np.inf


@kernel(inline=True)
def fill_box(x: float, y: float, yaw: float, length: float, width: float, out: Floats) -> None:
    """Write the fields of a `Box` with half sizes [m], and its radius [m], into `out` (7,)."""
    out[0] = x
    out[1] = y
    out[2] = np.cos(yaw)
    out[3] = np.sin(yaw)
    out[4] = length
    out[5] = width
    out[6] = np.sqrt(length * length + width * width)


@kernel(inline=True)
def fill_footprint(pose: Floats, half: Floats, out: Floats) -> None:
    """Write the box (7,) of half sizes (2,) [m] at a pose: x, y [m], yaw [rad] and more."""
    fill_box(pose[0], pose[1], pose[2], half[0], half[1], out)


@kernel(inline=True)
def filled_gap(a: Floats, b: Floats) -> float:
    """Return the signed gap [m] of two boxes (7,) from `fill_box`, as `box_gap` does."""
    box_a = Box(a[0], a[1], a[2], a[3], a[4], a[5])
    box_b = Box(b[0], b[1], b[2], b[3], b[4], b[5])
    return box_gap(box_a, box_b)


@kernel(inline=True)
def boxes_meet(a: Floats, b: Floats) -> bool:
    """Return whether two boxes from `fill_box` overlap."""
    dx = b[0] - a[0]
    dy = b[1] - a[1]
    reach = a[6] + b[6]
    if dx * dx + dy * dy >= reach * reach:
        return False
    return filled_gap(a, b) < 0.0


def footprint_gaps(
    a: tuple[float, float], poses_a: Floats, b: tuple[float, float], poses_b: Floats
) -> tuple[Floats, Floats]:
    """Return the signed gaps of two footprints.

    Between corners the distance is larger than the gap.

    Args:
        a: half length and half width [m] of one footprint.
        poses_a: (T, 3) its poses [m, m, rad].
        b: half length and half width [m] of the other one.
        poses_b: (T, 3) its poses.

    Returns:
        (T,) the gaps [m] of `box_gap`, and (T, 2) their axes as unit vectors from `b` to `a`.
    """
    gap = np.empty(len(poses_a))
    axis = np.empty((len(poses_a), 2))
    _fill_gaps(poses_a, np.array(a), poses_b, np.array(b), gap, axis)
    return gap, axis


@kernel(F2, F1, F2, F1, OUT1, OUT2)
def _fill_gaps(
    poses_a: Floats, half_a: Floats, poses_b: Floats, half_b: Floats, gap: Floats, axis: Floats
) -> None:
    for t in range(len(gap)):
        p = poses_a[t]
        q = poses_b[t]
        a = Box(p[0], p[1], np.cos(p[2]), np.sin(p[2]), half_a[0], half_a[1])
        b = Box(q[0], q[1], np.cos(q[2]), np.sin(q[2]), half_b[0], half_b[1])
        directions = axes(a, b)
        reach = reaches(a, b)
        gap[t] = -np.inf
        for k in range(4):
            x, y = directions[k]
            along = (a.x - b.x) * x + (a.y - b.y) * y
            if abs(along) - reach[k] > gap[t]:
                gap[t] = abs(along) - reach[k]
                side = 1.0 if along >= 0.0 else -1.0
                axis[t, 0] = side * x
                axis[t, 1] = side * y
