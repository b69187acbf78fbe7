# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Drivable curves: an elastic band through the anchors, then a spline of continuous curvature.

The band (see `band.relax`) trades four things: closeness to a first guess, closeness to the
anchors, little bending, and clearance. Where the curvature limit or the clearance is violated,
weights rise from step to step. The cubic spline through the band has the requested headings at
both ends; it is the spline that is verified.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from scenario_gen.method.routing.band import Band, relax, Weights
from scenario_gen.method.routing.route_points import monotone_matching, squared_distances
from scenario_gen.method.routing.search.planner import path_length
from scenario_gen.method.routing.search.sweep import sweep_is_free
from scenario_gen.method.routing.task import VehicleTask
from scenario_gen.numerics import Floats, running_sum, wrap_angle
from scenario_gen.numerics.plane import arc_lengths, edge_lengths, unit

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
        moved, adaptive = relax(band, adaptive, points - origin, ROUND_STEPS)
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
        field=road.clearance,
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
    return np.where(inside, task.road.clearance[row, column], 0.0)


def _wanted_clearance(
    task: VehicleTask, disc: Floats, wish: float, spacing: float, count: int
) -> Floats:
    """Return the wanted clearance (count,) [m]: at the ends what there is, rising to `wish`."""
    field = task.road.clearance
    distance = np.arange(count) * spacing
    wanted = np.full(count, wish)
    for pose, from_pose in ((task.anchors[0], distance), (task.anchors[-1], distance[::-1])):
        row, column, _ = task.road.cells(pose[:2] + disc[:, None] * unit(pose[2]))
        wanted = np.minimum(wanted, field[row, column].min() + TAPER_RATIO * from_pose)
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
    fits = sweep_is_free(task.road, poses, task.vehicle.length, task.vehicle.width)[:, 0] > 0.0
    middle = np.hypot(*spline(0.5 * (u[1:] + u[:-1]), 1).T)
    pieces = np.diff(u) * (speed[:-1] + 4.0 * middle + speed[1:]) / 6.0  # Simpson's rule
    arc = running_sum(pieces)
    sharpest = poses[np.argmax(curvature), :2]
    return Curve(spline, u, arc, float(curvature.max()), sharpest, poses[~fits])
