# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Drivable mode: an elastic band drawn through the anchors, then a spline whose heading and curvature are continuous.

The band (see `band.relax`) trades four things: nearness to a first guess, nearness to the anchors, little bending, and room
beside the footprint. Where the curvature limit or the room is violated, the weights there rise from step to step. The
cubic spline through the band is clamped to the requested headings at both ends, and it is the spline that is verified.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from scenario_gen.method.routing.band import Band, relax
from scenario_gen.method.routing.config import PlanningConfig
from scenario_gen.method.routing.search.planner import path_length
from scenario_gen.method.routing.search.sweep import sweep_is_free
from scenario_gen.numerics import Floats, Ints, wrap_angle
from scenario_gen.numerics.plane import edge_lengths, unit
from scenario_gen.roads import clearance_field
from scenario_gen.types import Road, Vehicle

ROUNDS, STEPS = 40, 8  # the band is resampled between rounds
BEND = 4.0**4  # [m^4] with hold = 1 a kink spreads over about 4 m
ANCHOR_WEIGHT = 200.0  # weight of an anchor
DISCS = 5  # that cover a footprint
TAPER = 0.05  # how fast the wanted clearance rises from what there is at the ends
CHECK = 0.1  # [m] between two poses that are verified


@dataclass(frozen=True, eq=False)
class Guess:
    """Where the band starts: dense points (G, 2) [m] and how strongly each holds it (G,)."""

    points: Floats
    hold: Floats


@dataclass(frozen=True, eq=False)
class Targets:
    """Interior anchors in their order: (A, 2) [m], and how strongly each draws the band (A,), 1 in full."""

    points: Floats
    weight: Floats


@dataclass(frozen=True, eq=False)
class Curve:
    """A verified or failed curve: the spline over `knots` (G,) [m], and what is wrong with it."""

    spline: CubicSpline
    end: float
    curvature: float
    sharpest: Floats  # (2,) where that is
    off_road: Floats  # (B, 3) poses at which the footprint leaves the road

    @cached_property
    def _arc(self) -> tuple[Floats, Floats]:
        u = np.linspace(0.0, self.end, int(np.ceil(self.end / CHECK)) + 1)
        speed = np.hypot(*self.spline(u, 1).T)
        middle = np.hypot(*self.spline(0.5 * (u[1:] + u[:-1]), 1).T)
        pieces = np.diff(u) * (speed[:-1] + 4.0 * middle + speed[1:]) / 6.0  # Simpson
        return u, np.concatenate(([0.0], np.cumsum(pieces)))

    @property
    def length(self) -> float:
        """Arc length [m]."""
        return float(self._arc[1][-1])

    def poses(self, length: Floats) -> Floats:
        """Poses (M, 3) at arc lengths (M,); yaw unwrapped."""
        u = np.interp(length, self._arc[1], self._arc[0])
        slope = self.spline(u, 1)
        return np.column_stack((self.spline(u), np.unwrap(np.arctan2(slope[:, 1], slope[:, 0]))))


def smooth(
    road: Road,
    vehicle: Vehicle,
    ends: tuple[Floats, Floats],
    targets: Targets,
    guess: Guess,
    config: PlanningConfig,
    max_curvature: float,
    rounds: int = ROUNDS,
) -> Curve:
    """Draw a curve between `ends` (poses (3,)), near the interior `targets` and near a guess that is free.

    It is no sharper than `max_curvature` [1/m].

    Source: elastic bands (Quinlan & Khatib 1993).

    Returns:
        The first curve within the limits; if there is none, the last one, with what is wrong about it.
    """
    start, end = ends
    disc = (np.arange(DISCS) - 0.5 * (DISCS - 1)) * vehicle.length / DISCS
    cover = float(np.hypot(0.5 * vehicle.width, 0.5 * vehicle.length / DISCS))
    headings = np.stack([unit(start[2]), unit(end[2])])
    guess = resampled(guess, config.spacing)
    points = guess.points
    points[0], points[-1] = start[:2], end[:2]
    stiff, push = np.ones(len(points)), np.full(len(points), 5.0)
    field = clearance_field(road)
    curve: Curve | None = None
    for round_ in range(rounds):
        spacing = path_length(points) / (len(points) - 1)
        anchor, pull = _assigned(points, targets)
        required = np.minimum(_room(road, guess.points, disc), cover)
        wish = _wished(road, disc, cover + config.margin, start, end, spacing, len(points))
        before, points = points, np.ascontiguousarray(points - road.origin)
        band = Band(
            field, road.resolution, guess.points - road.origin, guess.hold, anchor - road.origin, pull, headings, disc,
            required, wish, spacing, BEND, max_curvature,
        )  # fmt: skip
        relax(STEPS, band, stiff, push, points)
        points = points + road.origin
        still = np.abs(points - before).max() < 0.02
        if still or round_ % 4 == 3:
            curve = verified(road, vehicle, points, start, end)
            if curve.curvature <= max_curvature and not len(curve.off_road):
                return curve
        count = max(int(np.ceil(path_length(points) / config.spacing)) + 1, 8)
        old, new = np.linspace(0.0, 1.0, len(points)), np.linspace(0.0, 1.0, count)
        stiff, push = np.interp(new, old, stiff), np.interp(new, old, push)
        guess = resampled(guess, config.spacing, count)
        points = resampled(Guess(points, np.ones(len(points))), config.spacing, count).points
    assert curve is not None
    return curve


def _room(road: Road, points: Floats, disc: Floats) -> Floats:
    """Clearance (G, D) [m] of the discs of a footprint along a polyline (G, 2) [m]."""
    tangent = np.gradient(points, axis=0)
    tangent /= np.maximum(np.hypot(*tangent.T), 1e-9)[:, None]
    row, column, inside = road.cells(points[:, None] + disc[None, :, None] * tangent[:, None])
    return np.where(inside, clearance_field(road)[row, column], 0.0)


def _wished(
    road: Road, disc: Floats, wish: float, start: Floats, end: Floats, spacing: float, count: int
) -> Floats:
    """Clearance wanted along the band (count,): what there is at its ends, rising from there by 5 cm per metre to `wish`."""
    field = clearance_field(road)
    along = np.arange(count) * spacing
    room = np.full(count, wish)
    for pose, distance in ((start, along), (end, along[::-1])):
        row, column, _ = road.cells(pose[:2] + disc[:, None] * unit(pose[2]))
        room = np.minimum(room, field[row, column].min() + TAPER * distance)
    return room


def verified(road: Road, vehicle: Vehicle, points: Floats, start: Floats, end: Floats) -> Curve:
    """Lay the clamped spline through the band (G, 2) [m], from pose to pose (3,), and measure it."""
    knots = np.concatenate(([0.0], np.cumsum(edge_lengths(points))))
    spline = CubicSpline(knots, points, bc_type=((1, unit(start[2])), (1, unit(end[2]))))
    u = np.linspace(0.0, knots[-1], int(np.ceil(knots[-1] / CHECK)) + 1)
    first, second = spline(u, 1), spline(u, 2)
    bend = (
        np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / np.hypot(*first.T) ** 3
    )
    poses = np.column_stack((spline(u), np.arctan2(first[:, 1], first[:, 0])))
    turned = np.abs(wrap_angle(np.diff(poses[:, 2]))) / np.maximum(
        edge_lengths(poses[:, :2]), 1e-6
    )
    bend[1:] = np.maximum(
        bend[1:], turned
    )  # a cusp on a straight line has no curvature, but turns round
    poses[0], poses[-1] = start, end
    fits = sweep_is_free(road, poses, vehicle.length, vehicle.width)[:, 0] > 0.0
    return Curve(
        spline, float(knots[-1]), float(bend.max()), poses[np.argmax(bend), :2], poses[~fits]
    )


def resampled(guess: Guess, spacing: float, count: int | None = None) -> Guess:
    """The polyline at equal distances of about `spacing` (or with `count` points)."""
    step = edge_lengths(guess.points)
    at = np.concatenate(([0.0], np.cumsum(step)))
    count = count or max(int(np.ceil(at[-1] / spacing)) + 1, 8)
    s = np.linspace(0.0, at[-1], count)
    points = np.column_stack([np.interp(s, at, guess.points[:, axis]) for axis in range(2)])
    return Guess(points, np.interp(s, at, guess.hold))


def _assigned(points: Floats, targets: Targets) -> tuple[Floats, Floats]:
    """Give each target to the point of the band that a monotone matching says: positions (M, 2), weights (M,)."""
    anchor, pull = points.copy(), np.zeros(len(points))
    if len(targets.points):
        index = monotone_matching(squared_gaps(targets.points, points))
        for m, point, weight in zip(index, targets.points, targets.weight, strict=True):
            if weight * ANCHOR_WEIGHT > pull[m]:
                anchor[m], pull[m] = point, weight * ANCHOR_WEIGHT
    return anchor, pull


def squared_gaps(rows: Floats, columns: Floats) -> Floats:
    """Return the squares (A, M) of the distances [m] of places (A, 2) from others (M, 2), axis by axis: a long drive has many."""
    squares = np.zeros((len(rows), len(columns)))
    for axis in (0, 1):
        squares += np.square(rows[:, axis, None] - columns[None, :, axis])
    return squares


def monotone_matching(cost: Floats) -> Ints:
    """Match rows (A) of `cost` (A, M), of any unit, to columns without going back, so that its sum is least: (A,) columns.

    Source: dynamic programming (Bellman 1957).
    """
    total = cost[0]
    came_from = np.empty(cost.shape, dtype=np.int32)
    for k in range(1, len(cost)):
        lowest = np.minimum.accumulate(total)
        new = np.concatenate(([True], total[1:] < lowest[:-1]))
        came_from[k] = np.maximum.accumulate(np.where(new, np.arange(len(total)), 0))
        total = lowest + cost[k]
    index = np.empty(len(cost), dtype=np.int64)
    index[-1] = np.argmin(total)
    for k in range(len(cost) - 1, 0, -1):
        index[k - 1] = came_from[k, index[k]]
    return index
