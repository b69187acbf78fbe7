# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Direct curves between two poses: the smooth curves that are tried before any search."""

from collections.abc import Iterator
import math

import numpy as np

from scenario_gen.method.routing.search.dubins import arc_poses, dubins_poses
from scenario_gen.method.routing.search.sweep import sweep_is_free
from scenario_gen.numerics import Floats
from scenario_gen.numerics.plane import ahead_and_left, angle_between, unit
from scenario_gen.types import Road, Vehicle

SPACING_M = 0.2  # between two poses of a curve
MAX_RADIUS_M = 12.0  # of an arc: a wider one cuts a junction's corner
PARALLEL_RAD = np.radians(8.0)


def direct_curve(
    road: Road, vehicle: Vehicle, start: Floats, end: Floats, limit: float
) -> Floats | None:
    """Return the first free one of `connecting_curves`: poses (P, 3); None if there is none."""
    for poses in connecting_curves(start, end, limit):
        if (sweep_is_free(road, poses, vehicle.length, vehicle.width)[:, 0] > 0.0).all():
            return poses
    return None


def connecting_curves(start: Floats, end: Floats, limit: float) -> Iterator[Floats]:
    """Yield curves from pose (3,) to pose [m, rad], gentlest first, within a curvature [1/m].

    Each has poses (P, 3) about 0.2 m apart. Cubic Hermite curves with tangents of several lengths;
    straight lines joined by an arc, from the widest to the tightest; the Dubins curve.
    """
    for ratio in (1.0, 1.3, 0.8, 1.6):  # of the tangents' length to the chord
        poses = hermite_curve(start, end, ratio, limit)
        if poses is not None:
            yield poses
    yield from _arc_curves(start, end, limit)
    yield dubins_poses(start, end, 1.0 / limit, SPACING_M)


def hermite_curve(start: Floats, end: Floats, ratio: float, limit: float) -> Floats | None:
    """Return a cubic Hermite curve as poses (P, 3); None if it has a cusp or exceeds the limit."""
    rise = (end - start)[:2]
    chord = float(np.hypot(*rise))
    t = np.linspace(0.0, 1.0, max(int(np.ceil(chord / SPACING_M)) + 1, 8))[:, None]
    a = ratio * chord * unit(start[2])
    b = ratio * chord * unit(end[2])
    points = start[:2] + rise * t**2 * (3 - 2 * t) + a * t * (1 - t) ** 2 + b * t**2 * (t - 1)
    first = 6.0 * rise * t * (1 - t) + a * (1 - t) * (1 - 3 * t) + b * t * (3 * t - 2)
    second = 6.0 * rise * (1 - 2 * t) + a * (6 * t - 4) + b * (6 * t - 2)
    speed = np.hypot(*first.T)
    if speed.min() < 0.1 * chord:
        return None
    curvature = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / speed**3
    if curvature.max() > limit:
        return None
    return np.column_stack((points, np.arctan2(first[:, 1], first[:, 0])))


def _arc_curves(start: Floats, end: Floats, limit: float) -> Iterator[Floats]:
    """Yield a straight line, an arc and a straight line, from the widest arc to the tightest."""
    turn = angle_between(end[2], start[2])
    if not PARALLEL_RAD < abs(turn) < np.pi - PARALLEL_RAD:
        return
    ahead, left = ahead_and_left((end - start)[:2], start[2])
    after = left / np.sin(turn)  # from where the lines meet to the end
    before = ahead - after * np.cos(turn)
    half_tangent = float(np.tan(0.5 * abs(turn)))
    tightest = 1.0 / limit
    widest = min(min(before, after) / half_tangent, MAX_RADIUS_M)
    if widest < tightest:
        return
    for radius in np.linspace(widest, tightest, max(math.ceil((widest - tightest) / 2.0), 1) + 1):
        tangent = radius * half_tangent
        arc = (math.copysign(1.0 / radius, turn), abs(turn) * radius)
        parts = [(0.0, before - tangent), arc, (0.0, after - tangent)]
        yield arc_poses(start, parts, SPACING_M)
