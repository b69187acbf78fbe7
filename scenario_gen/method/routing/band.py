# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The elastic band: one banded least-squares problem per step, solved in place (after Quinlan & Khatib 1993)."""

from typing import NamedTuple

import numpy as np

from scenario_gen.numerics import Floats
from scenario_gen.numerics.kernels import F, F1, F2, I, kernel, named, OUT1, OUT2

PINNED = 1e15
STRONG = 1e4  # no weight grows beyond this
DAMPING = 0.05
WISH_WEIGHT = 5.0  # weight of an obstacle that is only nearer than wished for
CURVATURE_THRESHOLD = 0.9  # share of the curvature limit up to which bending is not made dearer


class Band(NamedTuple):
    """What holds a band of M points, and what it keeps clear of; lengths in metres from the grid's corner.

    Attributes:
        field: (H, W) clearance.
        resolution: size of a cell.
        guess: (M, 2) the first guess.
        hold: (M,) its weight.
        anchor: (M, 2) the anchor beside each point.
        pull: (M,) its weight, 0 where there is no anchor.
        ends: (2, 2) unit vectors of the headings at the first and the last point.
        disc: (D,) offsets along the heading of the discs that cover the footprint.
        required: (M, D) clearance that each disc's centre must have: where it lacks, the push becomes ever stronger.
        wish: (M,) clearance that they should have: it only pushes.
        spacing: distance between two points.
        bend: weight of bending [m^4].
        limit: largest curvature wanted [1/m].
    """

    field: Floats
    resolution: float
    guess: Floats
    hold: Floats
    anchor: Floats
    pull: Floats
    ends: Floats
    disc: Floats
    required: Floats
    wish: Floats
    spacing: float
    bend: float
    limit: float


UNIT, SECOND, THIRD = np.ones(1), np.array([1.0, -2.0, 1.0]), np.array([-1.0, 3.0, -3.0, 1.0])
FIRST_THIRD, LAST_THIRD = np.array([3.0, -4.0, 1.0]), np.array([1.0, -4.0, 3.0])
BAND = named(Band, F2, F, F2, F1, F2, F1, F2, F1, F2, F1, F, F, F)


@kernel(inline=True)
def _clearance_at(field: Floats, x: float, y: float) -> tuple[float, float, float]:
    """Clearance and its gradient at (x, y) [cells]: bilinear between the cells' centres."""
    height, width = field.shape
    u, v = x - 0.5, y - 0.5
    j, i = min(max(int(np.floor(u)), 0), width - 2), min(max(int(np.floor(v)), 0), height - 2)
    u, v = min(max(u - j, 0.0), 1.0), min(max(v - i, 0.0), 1.0)
    a, b, c, d = field[i, j], field[i, j + 1], field[i + 1, j], field[i + 1, j + 1]
    low, high = a + u * (b - a), c + u * (d - c)
    return (
        low + v * (high - low),
        (b - a) + v * ((d - c) - (b - a)),
        (c - a) + u * ((d - b) - (c - a)),
    )


@kernel(inline=True)
def _solve(matrix: Floats, right: Floats) -> None:
    """Solve a symmetric positive definite system in place: matrix (n, 4) holds the diagonal and three above it; right (n, 2)."""
    n = matrix.shape[0]
    for i in range(n):  # L D L^T; row i of `matrix` becomes D_i and L[i + 1 .. i + 3, i]
        for k in range(max(i - 3, 0), i):
            factor = matrix[k, i - k] * matrix[k, 0]
            for j in range(i, min(k + 4, n)):
                matrix[i, j - i] -= factor * matrix[k, j - k]
        for j in range(1, min(4, n - i)):
            matrix[i, j] /= matrix[i, 0]
    for axis in range(2):
        for i in range(n):
            for k in range(max(i - 3, 0), i):
                right[i, axis] -= matrix[k, i - k] * right[k, axis]
        for i in range(n - 1, -1, -1):
            right[i, axis] /= matrix[i, 0]
            for k in range(i + 1, min(i + 4, n)):
                right[i, axis] -= matrix[i, k - i] * right[k, axis]


@kernel(inline=True)
def _add(
    matrix: Floats,
    right: Floats,
    first: int,
    row: Floats,
    terms: int,
    weight: float,
    tx: float,
    ty: float,
) -> None:
    """Add weight * |sum_k row[k] p[first + k] - (tx, ty)|^2 to the problem."""
    for k in range(terms):
        right[first + k, 0] += weight * row[k] * tx
        right[first + k, 1] += weight * row[k] * ty
        for m in range(k, terms):
            matrix[first + k, m - k] += weight * row[k] * row[m]


@kernel(inline=True)
def _bending(points: Floats, ends: Floats, spacing: float, i: int) -> tuple[float, float]:
    """Second derivative of the band at point i, with mirrored points beyond its ends."""
    n = points.shape[0]
    if i == 0:
        before_x, before_y = (
            points[1, 0] - 2.0 * spacing * ends[0, 0],
            points[1, 1] - 2.0 * spacing * ends[0, 1],
        )
    else:
        before_x, before_y = points[i - 1, 0], points[i - 1, 1]
    if i == n - 1:
        after_x, after_y = (
            points[n - 2, 0] + 2.0 * spacing * ends[1, 0],
            points[n - 2, 1] + 2.0 * spacing * ends[1, 1],
        )
    else:
        after_x, after_y = points[i + 1, 0], points[i + 1, 1]
    square = spacing * spacing
    return (before_x - 2.0 * points[i, 0] + after_x) / square, (
        before_y - 2.0 * points[i, 1] + after_y
    ) / square


@kernel(inline=True, forced=True)
def _add_tension(
    i: int, band: Band, points: Floats, stiff: Floats, matrix: Floats, right: Floats
) -> None:
    """Add what draws point i to the guess, to its anchor and to where it is, and what bending costs."""
    n, curve, twist = points.shape[0], band.bend / band.spacing**4, band.bend / band.spacing**6
    _add(matrix, right, i, UNIT, 1, band.hold[i], band.guess[i, 0], band.guess[i, 1])
    _add(matrix, right, i, UNIT, 1, band.pull[i], band.anchor[i, 0], band.anchor[i, 1])
    _add(matrix, right, i, UNIT, 1, DAMPING, points[i, 0], points[i, 1])
    if i + 2 < n:
        _add(matrix, right, i, SECOND, 3, stiff[i + 1] * curve, 0.0, 0.0)
    if i + 3 < n:
        _add(matrix, right, i, THIRD, 4, (stiff[i + 1] + stiff[i + 2]) * twist, 0.0, 0.0)


@kernel(inline=True, forced=True)
def _add_obstacles(
    i: int, band: Band, points: Floats, row: Floats, matrix: Floats, right: Floats
) -> float:
    """Add what pushes the discs of point i away from obstacles, with weight row[3]; how much the nearest lacks, as a share."""
    disc, cell = band.disc, band.resolution
    tx, ty = points[i + 1, 0] - points[i - 1, 0], points[i + 1, 1] - points[i - 1, 1]
    norm = max(np.sqrt(tx * tx + ty * ty), 1e-9)
    worst = 0.0
    for k in range(disc.shape[0]):
        x, y = points[i, 0] + disc[k] * tx / norm, points[i, 1] + disc[k] * ty / norm
        room, gx, gy = _clearance_at(band.field, x / cell, y / cell)
        slope, needed = np.sqrt(gx * gx + gy * gy), band.required[i, k]
        aim = needed if room < needed else band.wish[i]
        if room < aim and slope > 1e-9:
            away = (aim - room) / slope
            row[0], row[1], row[2] = -disc[k] / norm, 1.0, disc[k] / norm
            _add(
                matrix,
                right,
                i - 1,
                row,
                3,
                row[3] if room < needed else WISH_WEIGHT,
                x + away * gx,
                y + away * gy,
            )
            if room < needed:
                worst = max(worst, (needed - room) / needed)
    return worst


@kernel(inline=True)
def _pin_ends(band: Band, points: Floats, stiff: Floats, matrix: Floats, right: Floats) -> None:
    """Hold the ends: their positions, and their headings through the mirrored points."""
    n = points.shape[0]
    curve, twist = band.bend / band.spacing**4, band.bend / band.spacing**6
    for side in range(2):
        i, inner = (0, 1) if side == 0 else (n - 1, n - 2)
        sign = band.spacing if side == 0 else -band.spacing
        hx, hy = sign * band.ends[side, 0], sign * band.ends[side, 1]
        _add(matrix, right, i, UNIT, 1, PINNED, points[i, 0], points[i, 1])
        _add(
            matrix,
            right,
            inner,
            UNIT,
            1,
            4.0 * stiff[i] * curve,
            points[i, 0] + hx,
            points[i, 1] + hy,
        )
        edge, first = (FIRST_THIRD, 0) if side == 0 else (LAST_THIRD, n - 3)
        _add(
            matrix, right, first, edge, 3, (stiff[i] + stiff[inner]) * twist, -2.0 * hx, -2.0 * hy
        )


@kernel(I, BAND, OUT1, OUT1, OUT2)
def relax(steps: int, band: Band, stiff: Floats, push: Floats, points: Floats) -> None:
    """Relax a band of M >= 6 points between two fixed poses; lengths in metres from the grid's corner.

    Minimises the sum over its points of hold |p - guess|^2 + pull |p - anchor|^2 + stiff bend (|p''|^2 + 2 |p'''|^2)
    + push (required or wish - clearance)^2, the last for each disc of the footprint that comes too near to an obstacle. The
    headings at the ends enter through a mirrored point beyond each end, so that the band may bend there as anywhere.

    Args:
        steps: how many least-squares problems to solve, each linearised about the one before.
        band: what holds the band, and what it keeps clear of.
        stiff: (M,) factors of `bend`, raised where the limit is exceeded.
        push: (M,) weights of the obstacles, raised where they are too near.
        points: (M, 2) the band, changed in place.
    """
    n = points.shape[0]
    matrix, right, row = np.empty((n, 4)), np.empty((n, 2)), np.empty(4)
    for _ in range(steps):
        matrix[:], right[:] = 0.0, 0.0
        for i in range(n):
            _add_tension(i, band, points, stiff, matrix, right)
            if 1 <= i < n - 1:
                row[3] = push[i]
                push[i] = min(
                    push[i] * (1.0 + _add_obstacles(i, band, points, row, matrix, right)), STRONG
                )
        _pin_ends(band, points, stiff, matrix, right)
        _solve(matrix, right)
        points[1 : n - 1] = right[1 : n - 1]
        for i in range(n):
            bx, by = _bending(points, band.ends, band.spacing, i)
            excess = np.sqrt(bx * bx + by * by) / (CURVATURE_THRESHOLD * band.limit)
            stiff[i] = (
                min(stiff[i] * min(excess, 1.5), STRONG)
                if excess > 1.0
                else max(0.98 * stiff[i], 1.0)
            )
