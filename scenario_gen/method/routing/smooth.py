# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Drivable curves: an elastic band through the anchors, then a spline of continuous curvature.

The band (see `relax`) trades four things: closeness to a first guess, closeness to the
anchors, little bending, and clearance. Where the curvature limit or the clearance is violated,
weights rise from step to step. The cubic spline through the band has the requested headings at
both ends; it is the spline that is verified.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import solveh_banded

from scenario_gen.method.routing.search.planner import path_length
from scenario_gen.method.routing.search.sweep import sweep_is_free
from scenario_gen.method.routing.task import monotone_matching, squared_distances, VehicleTask
from scenario_gen.numerics import arc_lengths, edge_lengths, Floats, running_sum, unit, wrap_angle

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
        field: (H, W) clearance [cells].
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


def relax(band: Band, weights: Weights, points: Floats) -> tuple[Floats, Weights]:
    """Relax a band of M >= 6 points (M, 2) between two fixed poses.

    Minimises the sum over its points of hold |p - guess|^2 + pull |p - anchor|^2
    + stiffness bending (|p''|^2 + 2 |p'''|^2) + push (required or wish - clearance)^2, the last
    for each disc of the footprint that is too close to an obstacle. The headings at the ends enter
    through a mirrored point beyond each end, so that the band may bend there as anywhere.
    ROUND_STEPS least-squares problems are solved, each linearised about the last result.

    Args:
        band: what attracts the band, and what it avoids.
        weights: at first.
        points: the band.

    Returns:
        The new points and weights.
    """
    stiffness, push = weights
    mirror = band.spacing * unit(band.yaws)
    for _ in range(ROUND_STEPS):
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
    room, gradient = _clearance_at(band, centre)
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


def _clearance_at(band: Band, points: Floats) -> tuple[Floats, Floats]:
    """Return clearance (...) [m] and its gradient (..., 2) per cell at points (..., 2) [m]."""
    cells = points / band.resolution
    highest = np.array(band.field.shape[::-1]) - 2
    corner = np.clip(np.floor(cells - 0.5), 0, highest).astype(np.int64)
    u, v = np.moveaxis(np.clip(cells - 0.5 - corner, 0.0, 1.0), -1, 0)
    column, row = np.moveaxis(corner, -1, 0)
    a, b, c, d = (
        band.field[row + i, column + j] * band.resolution for i in (0, 1) for j in (0, 1)
    )
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


ROUND_STEPS = 8  # of the band, before it is resampled
CHECK_ROUNDS_COUNT = 4  # after so many the spline is verified
ANCHOR_WEIGHT = 200.0
INITIAL_PUSH_WEIGHT = 5.0  # of the obstacles
DISCS_COUNT = 5  # that cover a footprint
TAPER_RATIO = 0.05  # m of wanted clearance per metre from an end, where it may be less
CHECK_SPACING_M = 0.1  # between two poses that are verified
STILL_M = 0.02  # a band that moves less has converged
MIN_POINTS_COUNT = 8  # of a band


@dataclass(frozen=True, eq=False)
class Guess:
    """Where the band starts: dense points (G, 2) [m], and the weight of each (G,)."""

    points: Floats
    hold: Floats

    @classmethod
    def even(cls, poses: Floats, weight: float) -> "Guess":
        """Return a guess of poses (G, 2 or more) with one weight."""
        return cls(poses[:, :2], np.full(len(poses), weight))

    @classmethod
    def joined(cls, guesses: Sequence["Guess"]) -> "Guess":
        """Return guesses end to end; the first point of all but the first is dropped."""
        points = [guesses[0].points] + [guess.points[1:] for guess in guesses[1:]]
        hold = [guesses[0].hold] + [guess.hold[1:] for guess in guesses[1:]]
        return cls(np.concatenate(points), np.concatenate(hold))

    def resampled(self, spacing: float, count: int | None = None) -> "Guess":
        """Return the guess at equal distances of about `spacing` [m], or with `count` points."""
        length = arc_lengths(self.points)
        s = np.linspace(0.0, length[-1], count or _count(length[-1], spacing))
        points = [np.interp(s, length, self.points[:, axis]) for axis in range(2)]
        return Guess(np.column_stack(points), np.interp(s, length, self.hold))


@dataclass(frozen=True, eq=False)
class Curve:
    """A verified or failed curve.

    Attributes:
        spline: the curve.
        parameter: (M,) values of its parameter.
        arc: (M,) its arc length there [m].
        curvature: the largest one [1/m].
        sharpest: (2,) where that is [m].
        off_road: (B, 3) poses at which the footprint leaves the road.
    """

    spline: CubicSpline
    parameter: Floats
    arc: Floats
    curvature: float
    sharpest: Floats
    off_road: Floats

    def is_drivable(self, max_curvature: float) -> bool:
        """Whether the curve is within a curvature [1/m] and on the road."""
        return self.curvature <= max_curvature and not len(self.off_road)

    def poses(self, length: Floats) -> Floats:
        """Return poses (M, 3) at arc lengths (M,); yaw unwrapped."""
        u = np.interp(length, self.arc, self.parameter)
        slope = self.spline(u, 1)
        return np.column_stack((self.spline(u), np.unwrap(np.arctan2(slope[:, 1], slope[:, 0]))))


def smooth(task: VehicleTask, weights: Floats, guess: Guess, rounds: int) -> Curve:
    """Draw a curve between the end anchors, near the others and near a guess that is free.

    Source: elastic bands (Quinlan & Khatib 1993).

    Args:
        task: the vehicle.
        weights: (A,) how strongly each anchor attracts the curve, 0 to 1.
        guess: see `Guess`.
        rounds: most rounds of the band.

    Returns:
        The first curve within the limits, else the last one.
    """
    spacing, length = task.config.spacing, task.vehicle.length
    disc = (np.arange(DISCS_COUNT) - 0.5 * (DISCS_COUNT - 1)) * length / DISCS_COUNT
    guess = guess.resampled(spacing)
    points = guess.points.copy()
    points[0], points[-1] = task.anchors[0, :2], task.anchors[-1, :2]
    adaptive = Weights(np.ones(len(points)), np.full(len(points), INITIAL_PUSH_WEIGHT))
    for k in range(1, rounds + 1):
        band = _band(task, weights, guess, points, disc)
        origin = task.road.origin
        moved, adaptive = relax(band, adaptive, points - origin)
        is_still = np.abs(moved + origin - points).max() < STILL_M
        points = moved + origin
        if is_still or k % CHECK_ROUNDS_COUNT == 0:
            curve = _verified(task, points)
            if curve.is_drivable(task.max_curvature):
                break
        count = _count(path_length(points), spacing)
        old, new = np.linspace(0.0, 1.0, len(points)), np.linspace(0.0, 1.0, count)
        adaptive = Weights(*(np.interp(new, old, values) for values in adaptive))
        guess = guess.resampled(spacing, count)
        points = Guess.even(points, 1.0).resampled(spacing, count).points
    return curve


def _count(length: float, spacing: float) -> int:
    return max(int(np.ceil(length / spacing)) + 1, MIN_POINTS_COUNT)


def _band(task: VehicleTask, weights: Floats, guess: Guess, points: Floats, disc: Floats) -> Band:
    """Return the band for points (M, 2) and a guess of as many points."""
    road, vehicle = task.road, task.vehicle
    cover = float(np.hypot(0.5 * vehicle.width, 0.5 * vehicle.length / DISCS_COUNT))
    spacing = path_length(points) / (len(points) - 1)
    anchor, pull = _anchors_of(points, task.anchors[weights > 0.0, :2], weights[weights > 0.0])
    wish = cover + task.config.margin
    if vehicle.is_narrow and len(task.fitted.path):  # a bicycle rides near the edge on purpose
        on_path = float(np.median(_clearance_along(task, task.fitted.path[:, :2], disc)))
        wish = min(wish, max(on_path, cover))
    return Band(
        field=road.clearance_cells,
        resolution=road.resolution,
        guess=guess.points - road.origin,
        hold=guess.hold,
        anchor=anchor - road.origin,
        pull=pull,
        yaws=task.anchors[[0, -1], 2],
        disc=disc,
        required=np.minimum(_clearance_along(task, guess.points, disc), cover),
        wish=_wanted_clearance(task, disc, wish, spacing, len(points)),
        spacing=spacing,
        max_curvature=task.max_curvature,
    )


def _clearance_along(task: VehicleTask, points: Floats, disc: Floats) -> Floats:
    """Return the clearance (G, D) [m] of the discs of a footprint along a polyline (G, 2) [m]."""
    tangent = np.gradient(points, axis=0)
    tangent /= np.maximum(np.hypot(*tangent.T), 1e-9)[:, None]
    centres = points[:, None] + disc[None, :, None] * tangent[:, None]
    row, column, inside = task.road.cells(centres)
    return np.where(inside, task.road.clearance_at(row, column), 0.0)


def _wanted_clearance(
    task: VehicleTask, disc: Floats, wish: float, spacing: float, count: int
) -> Floats:
    """Return the wanted clearance (count,) [m]: at the ends what there is, rising to `wish`."""
    distance = np.arange(count) * spacing
    wanted = np.full(count, wish)
    for pose, from_pose in ((task.anchors[0], distance), (task.anchors[-1], distance[::-1])):
        row, column, _ = task.road.cells(pose[:2] + disc[:, None] * unit(pose[2]))
        room = task.road.clearance_at(row, column).min()
        wanted = np.minimum(wanted, room + TAPER_RATIO * from_pose)
    return wanted


def _anchors_of(points: Floats, anchors: Floats, weight: Floats) -> tuple[Floats, Floats]:
    """Give each anchor (A, 2) to a point of the band: positions (M, 2), weights (M,)."""
    anchor, pull = points.copy(), np.zeros(len(points))
    if len(anchors):
        nearest = monotone_matching(squared_distances(anchors, points))
        order = np.argsort(-weight, kind="stable")[::-1]  # the strongest one of a point comes last
        anchor[nearest[order]] = anchors[order]
        pull[nearest[order]] = ANCHOR_WEIGHT * weight[order]
    return anchor, pull


def _verified(task: VehicleTask, points: Floats) -> Curve:
    """Lay the clamped spline through a band (G, 2) [m], and measure it."""
    start, end = task.anchors[0], task.anchors[-1]
    knots = arc_lengths(points)
    spline = CubicSpline(knots, points, bc_type=((1, unit(start[2])), (1, unit(end[2]))))
    u = np.linspace(0.0, knots[-1], int(np.ceil(knots[-1] / CHECK_SPACING_M)) + 1)
    first, second = spline(u, 1), spline(u, 2)
    speed = np.hypot(*first.T)
    curvature = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / speed**3
    poses = np.column_stack((spline(u), np.arctan2(first[:, 1], first[:, 0])))
    turn = np.abs(wrap_angle(np.diff(poses[:, 2])))
    step = np.maximum(edge_lengths(poses[:, :2]), 1e-6)
    curvature[1:] = np.maximum(curvature[1:], turn / step)  # sees a cusp on a straight line
    poses[0], poses[-1] = start, end
    fits = sweep_is_free(task.road, poses, task.vehicle.length, task.vehicle.width)
    middle = np.hypot(*spline(0.5 * (u[1:] + u[:-1]), 1).T)
    pieces = np.diff(u) * (speed[:-1] + 4.0 * middle + speed[1:]) / 6.0  # Simpson's rule
    arc = running_sum(pieces)
    sharpest = poses[np.argmax(curvature), :2]
    return Curve(spline, u, arc, float(curvature.max()), sharpest, poses[~fits])


def not_drivable(task: VehicleTask, curve: Curve) -> str:
    """Return why a curve cannot be driven, and near which anchor."""
    reasons, (x, y) = [], curve.sharpest
    if curve.curvature > task.max_curvature:
        reasons.append(
            f"its curvature reaches {curve.curvature:.3f} 1/m at ({x:.2f}, {y:.2f}) m, the limit "
            f"is {task.max_curvature:.3f} (9/10 of limits.{task.vehicle.type}.max_curvature)"
        )
    if len(curve.off_road):
        x, y = curve.off_road[len(curve.off_road) // 2, :2]
        reasons.append(f"its footprint leaves the road at ({x:.2f}, {y:.2f}) m")
    nearest = int(np.argmin(np.hypot(*(task.anchors[:, :2] - [x, y]).T)))
    return (
        f"no drivable route for vehicle {task.vehicle.id} on road {task.road.name!r} near "
        f"{task.anchor_name(nearest)}: {'; '.join(reasons)}"
    )
