# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The elastic band: one banded least-squares problem per step (after Quinlan & Khatib 1993)."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import solveh_banded

from scenario_gen.numerics import Floats
from scenario_gen.numerics.plane import unit

BENDING_M4_WEIGHT = 4.0**4  # m^4: a kink spreads over about 4 m where a guess holds with weight 1
PINNED_WEIGHT = 1e15  # of the two end points
MAX_WEIGHT = 1e4  # to which stiffness and push may grow
DAMPING_WEIGHT = 0.05  # of where a point is
WISH_WEIGHT = 5.0  # of an obstacle that is only closer than wished
POINT = np.ones(1)  # stencil of a point itself
CURVATURE_SHARE = 0.9  # of the curvature limit, above which stiffness grows


@dataclass(frozen=True, eq=False)
class Band:
    """What attracts a band of M points, and what it avoids; in metres from the grid's corner.

    Attributes:
        field: (H, W) clearance.
        resolution: size of a cell.
        guess: (M, 2) the first guess.
        hold: (M,) its weight.
        anchor: (M, 2) the anchor of each point.
        pull: (M,) its weight, 0 without an anchor.
        yaws: (2,) headings at the first and the last point [rad].
        disc: (D,) offsets along the heading of the discs that cover the footprint.
        required: (M, D) clearance that the discs' centres must have.
        wish: (M,) clearance that they should have.
        spacing: distance between two points.
        max_curvature: wanted [1/m].
    """

    field: Floats
    resolution: float
    guess: Floats
    hold: Floats
    anchor: Floats
    pull: Floats
    yaws: Floats
    disc: Floats
    required: Floats
    wish: Floats
    spacing: float
    max_curvature: float


class Weights(NamedTuple):
    """Weights that adapt from step to step, one per point (M,).

    Attributes:
        stiffness: factor of bending, raised where the curvature limit is exceeded.
        push: of the obstacles, raised where they are too close.
    """

    stiffness: Floats
    push: Floats


class _Problem:
    """Normal equations of a least-squares problem with a band of four diagonals."""

    def __init__(self, count: int) -> None:
        self.matrix = np.zeros((4, count))  # lower diagonals, as `solveh_banded` reads them
        self.right = np.zeros((count, 2))

    def add(self, first: int, stencil: Floats, weight: Floats, target: Floats | float) -> None:
        """Add sum_i weight[i] |sum_k stencil[k] p[first + i + k] - target[i]|^2.

        Args:
            first: index of the first point.
            stencil: (S,), or (S, n) if it differs.
            weight: (n,).
            target: (n, 2), or 0.
        """
        count = len(weight)
        for k, factor in enumerate(stencil):
            rows = slice(first + k, first + k + count)
            self.right[rows] += (weight * factor)[:, None] * target
            for m in range(k, len(stencil)):
                self.matrix[m - k, rows] += weight * factor * stencil[m]

    def solve(self) -> Floats:
        """Return the points (count, 2)."""
        return np.asarray(solveh_banded(self.matrix, self.right, lower=True, check_finite=False))


def relax(band: Band, weights: Weights, points: Floats, steps: int) -> tuple[Floats, Weights]:
    """Relax a band of M >= 6 points (M, 2) between two fixed poses.

    Minimises the sum over its points of hold |p - guess|^2 + pull |p - anchor|^2
    + stiffness bending (|p''|^2 + 2 |p'''|^2) + push (required or wish - clearance)^2, the last
    for each disc of the footprint that is too close to an obstacle. The headings at the ends enter
    through a mirrored point beyond each end, so that the band may bend there as anywhere.

    Args:
        band: what attracts the band, and what it avoids.
        weights: at first.
        points: the band.
        steps: least-squares problems to solve, each linearised about the result of the last one.

    Returns:
        The new points and weights.
    """
    stiffness, push = weights
    mirror = band.spacing * unit(band.yaws)
    for _ in range(steps):
        problem = _Problem(len(points))
        _add_attraction(problem, band, points)
        _add_bending(problem, band, stiffness, points, mirror)
        lack = _add_obstacles(problem, band, push, points)
        push = push.copy()
        push[1:-1] = np.minimum(push[1:-1] * (1.0 + lack), MAX_WEIGHT)
        points = np.vstack((points[:1], problem.solve()[1:-1], points[-1:]))
        excess = _curvature(points, mirror, band.spacing) / (CURVATURE_SHARE * band.max_curvature)
        stiffer = np.minimum(stiffness * np.minimum(excess, 1.5), MAX_WEIGHT)
        stiffness = np.where(excess > 1.0, stiffer, np.maximum(0.98 * stiffness, 1.0))
    return points, Weights(stiffness, push)


def _add_attraction(problem: _Problem, band: Band, points: Floats) -> None:
    """Add the guess, the anchors, the damping, and the fixed ends."""
    damping = np.full(len(points), DAMPING_WEIGHT)
    damping[[0, -1]] = PINNED_WEIGHT
    problem.add(0, POINT, band.hold, band.guess)
    problem.add(0, POINT, band.pull, band.anchor)
    problem.add(0, POINT, damping, points)


def _add_bending(
    problem: _Problem, band: Band, stiffness: Floats, points: Floats, mirror: Floats
) -> None:
    """Add second and third differences, at the ends with the mirrored points."""
    curve = BENDING_M4_WEIGHT / band.spacing**4
    twist = BENDING_M4_WEIGHT / band.spacing**6
    pairs = stiffness[1:] + stiffness[:-1]
    last = len(points) - 1
    problem.add(0, np.array([1.0, -2.0, 1.0]), stiffness[1:-1] * curve, 0.0)
    problem.add(0, np.array([-1.0, 3.0, -3.0, 1.0]), pairs[1:-1] * twist, 0.0)
    problem.add(1, POINT, 4.0 * stiffness[:1] * curve, points[0] + mirror[0])
    problem.add(last - 1, POINT, 4.0 * stiffness[-1:] * curve, points[-1] - mirror[1])
    problem.add(0, np.array([3.0, -4.0, 1.0]), pairs[:1] * twist, -2.0 * mirror[0])
    problem.add(last - 2, np.array([1.0, -4.0, 3.0]), pairs[-1:] * twist, 2.0 * mirror[1])


def _add_obstacles(problem: _Problem, band: Band, push: Floats, points: Floats) -> Floats:
    """Add what pushes the discs away from obstacles.

    Returns:
        (M - 2,) the largest lack of required clearance, as a share of it.
    """
    tangent = points[2:] - points[:-2]
    norm = np.maximum(np.hypot(*tangent.T), 1e-9)
    lever = band.disc[:, None] / norm  # (D, M - 2)
    centre = points[1:-1] + lever[..., None] * tangent
    room, gradient = _clearance_at(band.field, centre / band.resolution)
    slope = np.hypot(gradient[..., 0], gradient[..., 1])
    required = band.required[1:-1].T
    is_short = room < required
    wanted = np.where(is_short, required, band.wish[1:-1])
    weight = np.where(is_short, push[1:-1], WISH_WEIGHT)
    weight *= (room < wanted) & (slope > 1e-9)
    move = (wanted - room) / np.maximum(slope, 1e-9)
    target = centre + move[..., None] * gradient
    for k in np.flatnonzero(weight.any(axis=1)):
        stencil = np.stack((-lever[k], np.ones(len(norm)), lever[k]))
        problem.add(0, stencil, weight[k], target[k])
    share = (required - room) / np.maximum(required, 1e-9)
    lack = np.where(is_short & (slope > 1e-9), share, 0.0)
    return np.asarray(lack.max(axis=0))


def _clearance_at(field: Floats, cells: Floats) -> tuple[Floats, Floats]:
    """Return clearance (...) and gradient (..., 2) at points (..., 2) [cells], bilinear."""
    highest = np.array(field.shape[::-1]) - 2
    corner = np.clip(np.floor(cells - 0.5), 0, highest).astype(np.int64)
    u, v = np.moveaxis(np.clip(cells - 0.5 - corner, 0.0, 1.0), -1, 0)
    column, row = np.moveaxis(corner, -1, 0)
    a, b = field[row, column], field[row, column + 1]
    c, d = field[row + 1, column], field[row + 1, column + 1]
    low = a + u * (b - a)
    high = c + u * (d - c)
    across = (b - a) + v * ((d - c) - (b - a))
    along = (c - a) + u * ((d - b) - (c - a))
    return low + v * (high - low), np.stack((across, along), axis=-1)


def _curvature(points: Floats, mirror: Floats, spacing: float) -> Floats:
    """Return |p''| (M,) [1/m], at the ends with the mirrored points."""
    before = points[1] - 2.0 * mirror[0]
    after = points[-2] + 2.0 * mirror[1]
    second = np.diff(np.vstack((before, points, after)), n=2, axis=0)
    return np.asarray(np.hypot(*second.T) / spacing**2)
