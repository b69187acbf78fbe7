# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Proof that oriented footprints stay apart at every instant.

Over a stretch of time the relative position of two vehicles lies in the convex hull of four control points, and each
heading within a known angle of its middle. A line that separates the boxes at the middle, and still does so for all four
points after both boxes have been widened by what the rotation can add, separates them throughout (a swept separating
axis). Where no such line is found the stretch is halved, until it is proven, an overlap is found, or it is too short.
"""

import numpy as np

from scenario_gen.method.validity.dynamics import stretch
from scenario_gen.numerics import Floats
from scenario_gen.numerics.boxes import axes, Box, reaches
from scenario_gen.numerics.kernels import F, F1, F2, F4, kernel, OUT2

BLOCK = 16  # intervals that share one bounding box
ROUNDING = 1e-7  # m, above the rounding of the largest coordinates (`dynamics.LARGEST`)
PROVEN, FOUND, UNPROVEN = 0.0, 1.0, 2.0


@kernel(inline=True)
def _gap(
    d: Floats,
    yaw_a: float,
    yaw_b: float,
    half_a: Floats,
    half_b: Floats,
    turn_a: float,
    turn_b: float,
) -> float:
    """Largest separation [m] along the four box axes that holds for all relative positions d (4, 2) and all headings.

    The headings are within turn_a and turn_b of yaw_a and yaw_b. A box's extent along its own axis l grows by at most
    w sin(turn) <= w turn, along any other line by at most (half diagonal) turn.
    """
    a = Box(0.0, 0.0, np.cos(yaw_a), np.sin(yaw_a), half_a[0], half_a[1])
    b = Box(0.0, 0.0, np.cos(yaw_b), np.sin(yaw_b), half_b[0], half_b[1])
    by_a, by_b = np.hypot(a.length, a.width) * turn_a, np.hypot(b.length, b.width) * turn_b
    grown = (
        a.width * turn_a + by_b,
        a.length * turn_a + by_b,
        b.width * turn_b + by_a,
        b.length * turn_b + by_a,
    )
    axis, reach = axes(a, b), reaches(a, b)
    best = -np.inf
    for k in range(4):
        low, high = np.inf, -np.inf
        for i in range(4):
            along = axis[k][0] * d[i, 0] + axis[k][1] * d[i, 1]
            low, high = min(low, along), max(high, along)
        best = max(best, max(low, -high) - reach[k] - grown[k])
    return best


@kernel(inline=True)
def _from_origin(low_x: float, high_x: float, low_y: float, high_y: float) -> float:
    """Distance of the origin from what lies between these bounds."""
    x, y = max(low_x, -high_x, 0.0), max(low_y, -high_y, 0.0)
    return float(np.sqrt(x * x + y * y))


@kernel(inline=True)
def _first_contact(
    d: Floats,
    h: float,
    yaw_a: Floats,
    yaw_b: Floats,
    half_a: Floats,
    half_b: Floats,
    clearance: float,
    resolution: float,
) -> tuple[float, float, float]:
    """(status, u, gap) of one interval: relative control points d (4, 2), start and change of both headings (2,)."""
    part = np.empty((4, 2))
    u, step = 0.0, 1.0
    while u < 1.0:
        middle = u + 0.5 * step
        stretch(d, u, u + step, part)
        at_a, at_b = yaw_a[0] + yaw_a[1] * middle, yaw_b[0] + yaw_b[1] * middle
        turn_a, turn_b = 0.5 * step * abs(yaw_a[1]), 0.5 * step * abs(yaw_b[1])
        if _gap(part, at_a, at_b, half_a, half_b, turn_a, turn_b) > clearance + ROUNDING:
            u += step
            step = min(2.0 * step, 1.0 - u)
            continue
        stretch(d, middle, middle, part)
        gap = _gap(part, at_a, at_b, half_a, half_b, 0.0, 0.0)
        if gap <= clearance:
            return FOUND, middle, gap
        step *= 0.5
        if step * h < resolution:
            return UNPROVEN, middle, gap
    return PROVEN, 1.0, np.inf


@kernel(inline=True)
def _block_bounds(control: Floats) -> Floats:
    """Bounding boxes (N, B, 4) low x, high x, low y, high y of the control points (N, K, 4, 2) of each BLOCK of intervals."""
    n, intervals = control.shape[0], control.shape[1]
    bounds = np.empty((n, (intervals + BLOCK - 1) // BLOCK, 4))
    for i in range(n):
        for k in range(intervals):
            box = bounds[i, k // BLOCK]
            if k % BLOCK == 0:
                box[0] = box[2] = np.inf
                box[1] = box[3] = -np.inf
            for c in range(4):
                box[0], box[1] = min(box[0], control[i, k, c, 0]), max(box[1], control[i, k, c, 0])
                box[2], box[3] = min(box[2], control[i, k, c, 1]), max(box[3], control[i, k, c, 1])
    return bounds


@kernel(F1, F4, F2, F2, F, F, OUT2)
def first_contacts(
    time: Floats,
    control: Floats,
    heading: Floats,
    half: Floats,
    clearance: float,
    resolution: float,
    out: Floats,
) -> None:
    """Fill `out` (N (N - 1) / 2, 3) with status, time [s] and gap [m] of the first contact of each pair i < j.

    Args:
        time: (T,) seconds.
        control: (N, T - 1, 4, 2) control points, metres.
        heading: (N, T) rad.
        half: (N, 2) half lengths and half widths, metres.
        clearance: gap [m] that must be exceeded.
        resolution: shortest stretch of time [s] looked at.
        out: status PROVEN, FOUND or UNPROVEN; time and gap where not proven.
    """
    n, intervals = control.shape[0], control.shape[1]
    bounds = _block_bounds(control)
    d, yaw_i, yaw_j = np.empty((4, 2)), np.empty(2), np.empty(2)
    pair = -1
    for i in range(n):
        for j in range(i + 1, n):
            pair += 1
            out[pair, 0] = PROVEN
            reach = (
                np.hypot(half[i, 0], half[i, 1])
                + np.hypot(half[j, 0], half[j, 1])
                + clearance
                + ROUNDING
            )
            for b in range(bounds.shape[1]):
                if out[pair, 0] != PROVEN:
                    break
                p, q = bounds[i, b], bounds[j, b]
                if _from_origin(q[0] - p[1], q[1] - p[0], q[2] - p[3], q[3] - p[2]) > reach:
                    continue
                for k in range(b * BLOCK, min(intervals, (b + 1) * BLOCK)):
                    low_x, high_x, low_y, high_y = np.inf, -np.inf, np.inf, -np.inf
                    for c in range(4):
                        d[c, 0] = control[j, k, c, 0] - control[i, k, c, 0]
                        d[c, 1] = control[j, k, c, 1] - control[i, k, c, 1]
                        low_x, high_x = min(low_x, d[c, 0]), max(high_x, d[c, 0])
                        low_y, high_y = min(low_y, d[c, 1]), max(high_y, d[c, 1])
                    if _from_origin(low_x, high_x, low_y, high_y) > reach:
                        continue
                    h = time[k + 1] - time[k]
                    yaw_i[0], yaw_i[1] = heading[i, k], heading[i, k + 1] - heading[i, k]
                    yaw_j[0], yaw_j[1] = heading[j, k], heading[j, k + 1] - heading[j, k]
                    status, u, gap = _first_contact(
                        d, h, yaw_i, yaw_j, half[i], half[j], clearance, resolution
                    )
                    if status != PROVEN:
                        out[pair, 0], out[pair, 1], out[pair, 2] = status, time[k] + u * h, gap
                        break
