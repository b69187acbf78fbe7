# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Direct connections between two poses: the smooth curves that are tried before any search, gentlest first."""

from collections.abc import Iterator
import math

import numpy as np

from scenario_gen.method.routing.search.dubins import Pose, shortest_curve, TURNS
from scenario_gen.method.routing.search.sweep import sweep_is_free
from scenario_gen.numerics import Floats
from scenario_gen.numerics.plane import angle_between, unit
from scenario_gen.types import Road, Vehicle

SPACING = 0.2  # [m]
STRETCHES = (1.0, 1.3, 0.8, 1.6)  # of a Hermite curve's tangents
WIDEST = 12.0  # [m] radius of an arc: a wider one cuts a junction's corner
PARALLEL = np.radians(8.0)


def direct(
    road: Road, vehicle: Vehicle, start: Floats, end: Floats, limit: float
) -> Floats | None:
    """The first free one of the curves of `candidates`: poses (P, 3); None if there is none."""
    for poses in candidates(start, end, limit):
        if (sweep_is_free(road, poses, vehicle.length, vehicle.width)[:, 0] > 0.0).all():
            return poses
    return None


def candidates(start: Floats, end: Floats, limit: float) -> Iterator[Floats]:
    """Curves from pose (3,) to pose [m, rad] as poses (P, 3) some 0.2 m apart, whose curvature is within the limit [1/m].

    Hermite curves, cubic and with tangents of several lengths; straight lines joined by an arc, from the widest to the tightest;
    last the shortest curve (Dubins 1957).
    """
    for stretch in STRETCHES:
        poses = hermite(start, end, stretch, limit)
        if poses is not None:
            yield poses
    yield from _by_an_arc(start, end, limit)
    (word, *lengths), _ = shortest_curve(Pose(*start), Pose(*end), 1.0 / limit)
    yield chained(
        start,
        [(float(turn) * limit, length) for turn, length in zip(TURNS[word], lengths, strict=True)],
    )


def hermite(start: Floats, end: Floats, stretch: float, limit: float) -> Floats | None:
    """A cubic Hermite curve as poses (P, 3), if it has no cusp and its curvature stays within the limit [1/m]."""
    chord = float(np.hypot(*(end - start)[:2]))
    count = max(int(np.ceil(chord / SPACING)) + 1, 8)
    t = np.linspace(0.0, 1.0, count)[:, None]
    a, b = (stretch * chord * unit(pose[2]) for pose in (start, end))
    rise = end[:2] - start[:2]
    points = (
        start[:2]
        + rise * np.square(t) * (3 - 2 * t)
        + a * t * np.square(1 - t)
        + b * np.square(t) * (t - 1)
    )
    first = 6.0 * rise * t * (1 - t) + a * (1 - t) * (1 - 3 * t) + b * t * (3 * t - 2)
    second = 6.0 * rise * (1 - 2 * t) + a * (6 * t - 4) + b * (6 * t - 2)
    speed = np.hypot(*first.T)
    if speed.min() < 0.1 * chord:
        return None
    bend = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / speed**3
    if bend.max() > limit:
        return None
    return np.column_stack((points, np.arctan2(first[:, 1], first[:, 0])))


def _by_an_arc(start: Floats, end: Floats, limit: float) -> Iterator[Floats]:
    """A straight line, an arc and a straight line, from the widest arc to the tightest."""
    turn = angle_between(end[2], start[2])
    if not PARALLEL < abs(turn) < np.pi - PARALLEL:
        return
    d = end[:2] - start[:2]
    cos, sin = np.cos(start[2]), np.sin(start[2])
    ahead, left = d[0] * cos + d[1] * sin, d[1] * cos - d[0] * sin
    after = left / np.sin(turn)  # from where the lines meet to the end
    before = ahead - after * np.cos(turn)
    half = float(np.tan(0.5 * abs(turn)))
    tightest, widest = 1.0 / limit, min(min(before, after) / half, WIDEST)
    steps = 0 if widest < tightest else max(math.ceil((widest - tightest) / 2.0), 1)
    for radius in np.linspace(widest, tightest, steps + 1) if steps else ():
        tangent = float(radius) * half
        arc = math.copysign(1.0 / float(radius), turn)
        yield chained(
            start,
            [(0.0, before - tangent), (arc, abs(turn) * float(radius)), (0.0, after - tangent)],
        )


def chained(start: Floats, parts: list[tuple[float, float]]) -> Floats:
    """Poses (P, 3) some 0.2 m apart along parts of constant curvature [1/m] and length [m], from a pose (3,) on."""
    poses = [np.asarray(start, dtype=np.float64)[None]]
    for curvature, length in parts:
        if length < 1e-6:
            continue
        x, y, yaw = poses[-1][-1]
        s = np.linspace(0.0, length, int(np.ceil(length / SPACING)) + 1)[1:]
        heading = yaw + curvature * s
        if curvature == 0.0:
            piece = (x + s * np.cos(yaw), y + s * np.sin(yaw), heading)
        else:
            sin, cos = (
                (np.sin(heading) - np.sin(yaw)) / curvature,
                (np.cos(heading) - np.cos(yaw)) / curvature,
            )
            piece = (x + sin, y - cos, heading)
        poses.append(np.column_stack(piece))
    return np.concatenate(poses)
