# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Two oriented footprints, at many instants at once: their distance, and the time until they meet."""

import numpy as np

from scenario_gen.method.evaluation.motion import Motion
from scenario_gen.numerics import Floats
from scenario_gen.numerics.kernels import F1, F2, kernel, OUT1
from scenario_gen.types import once_per_object

STILL = 1e-6  # m/s; what closes more slowly does not close: rounding alone makes equal velocities differ


def footprint_distance(motion: Motion, a: int, b: int) -> Floats:
    """Return the distance (T,) in metres between the footprints of vehicles a and b; 0 where they overlap."""
    return _nearness(motion, a, b)[0]


def time_to_collision(motion: Motion, a: int, b: int) -> Floats:
    """Return the time (T,) in seconds until footprints a and b touch if both keep their velocity; inf if never.

    Source: Hayward 1972.
    """
    return _nearness(motion, a, b)[1]


@once_per_object
def _nearness(motion: Motion, a: int, b: int) -> tuple[Floats, Floats]:
    """Distance [m] and time to collision [s], (T,) each."""
    ahead = _directions(motion)
    half = np.array([(0.5 * motion.vehicles[n].length, 0.5 * motion.vehicles[n].width) for n in (a, b)])
    distance, time = np.empty_like(motion.speed[a]), np.empty_like(motion.speed[a])
    own, other = ((motion.position[n], ahead[n], motion.speed[n]) for n in (a, b))
    _fill_nearness(*own, *other, half, distance, time)
    return distance, time


@once_per_object
def _directions(motion: Motion) -> Floats:
    """(N, T, 2) unit vectors along the headings."""
    return np.stack([np.cos(motion.heading), np.sin(motion.heading)], axis=-1)


@kernel(F2, F2, F1, F2, F2, F1, F2, OUT1, OUT1)
def _fill_nearness(
    position_a: Floats,
    ahead_a: Floats,
    speed_a: Floats,
    position_b: Floats,
    ahead_b: Floats,
    speed_b: Floats,
    half: Floats,
    distance: Floats,
    time: Floats,
) -> None:
    """Fill `distance` (T,) [m] and `time` (T,) [s]; positions and directions are (T, 2), half lengths and widths (2, 2).

    Two convex shapes that do not overlap are nearest at a corner of one of them. The time is exact for footprints that do not
    turn: on each of the four separating axes they overlap during one interval of time, and they touch when all four intervals
    have begun and none has ended.
    """
    (la, wa), (lb, wb) = half
    offset, closing, reach = np.empty(4), np.empty(4), np.empty(4)
    for t in range(len(speed_a)):
        ca, sa, cb, sb = ahead_a[t, 0], ahead_a[t, 1], ahead_b[t, 0], ahead_b[t, 1]
        dx, dy = position_b[t, 0] - position_a[t, 0], position_b[t, 1] - position_a[t, 1]
        vx, vy = speed_b[t] * cb - speed_a[t] * ca, speed_b[t] * sb - speed_a[t] * sa
        alike, askew = abs(ca * cb + sa * sb), abs(sa * cb - ca * sb)
        reach[0], reach[1] = la + lb * alike + wb * askew, wa + lb * askew + wb * alike
        reach[2], reach[3] = lb + la * alike + wa * askew, wb + la * askew + wa * alike
        overlap, begin, end = True, -np.inf, np.inf
        for k in range(4):
            c, s = (ca, sa) if k < 2 else (cb, sb)
            x, y = (c, s) if k % 2 == 0 else (-s, c)
            offset[k], closing[k] = dx * x + dy * y, vx * x + vy * y
            overlap = overlap and abs(offset[k]) < reach[k]
            if abs(closing[k]) >= STILL:
                enters, leaves = (-reach[k] - offset[k]) / closing[k], (reach[k] - offset[k]) / closing[k]
                begin, end = max(begin, min(enters, leaves)), min(end, max(enters, leaves))
            elif abs(offset[k]) >= reach[k]:
                begin, end = np.inf, -np.inf
        time[t] = max(begin, 0.0) if begin < end and end > 0.0 else np.inf
        if overlap:
            distance[t] = 0.0
            continue
        px, py, qx, qy = position_a[t, 0], position_a[t, 1], position_b[t, 0], position_b[t, 1]
        from_b = _corner_distance(px, py, ca, sa, la, wa, qx, qy, cb, sb, lb, wb)
        distance[t] = min(from_b, _corner_distance(qx, qy, cb, sb, lb, wb, px, py, ca, sa, la, wa))


@kernel(inline=True)
def _corner_distance(
    x: float, y: float, c: float, s: float, length: float, width: float, ox: float, oy: float, oc: float, os: float,
    other_length: float, other_width: float,
) -> float:  # fmt: skip
    """Least distance from the corners of the other footprint to one at (x, y) with direction (c, s); half lengths and widths."""
    least = np.inf
    for k in range(4):
        ahead, left = other_length if k < 2 else -other_length, other_width if k % 3 == 0 else -other_width
        dx, dy = ox + ahead * oc + left * -os - x, oy + ahead * os + left * oc - y
        along, across = abs(dx * c + dy * s) - length, abs(dy * c - dx * s) - width
        least = min(least, np.hypot(max(along, 0.0), max(across, 0.0)))
    return least
