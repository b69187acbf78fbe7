# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Routes from one lane to another: a line, a bend with continuous curvature, and a line.

The bend is a clothoid, an arc and a clothoid. Its curvature is the requested one, as recorded. If
the road has no room for it, gentler and tighter bends are tried in turn. So a route is driven like
the recorded one.
"""

from collections.abc import Callable, Iterator
from functools import lru_cache

import numpy as np

from scenario_gen.numerics import (
    ahead_and_left,
    angle_between,
    Floats,
    frozen,
    place,
    polyline_of,
    unit,
)
from scenario_gen.numerics.curve import Curve

Fits = Callable[[Floats], bool]
"""Returns whether poses (M, 3) have room."""

MAX_CAR_CURVATURE_PER_M = 0.2
_STEP_M = 0.25
_PARALLEL_RAD = np.radians(0.5)
_MAX_TURN_RAD = np.radians(172.0)
_MAX_BLENDED_TURN_RAD = np.radians(35.0)  # while changing to the line of the exit
_MAX_SHIFT_CURVATURE_PER_M = 0.05  # of a lane change on the way
_MAX_SHIFT_M = 12.0  # sideways
_ENTRY_RADIUS_M = 14.0  # of the bends into a roundabout and out of it
_MIN_U_TURN_RADIUS_M = 6.0


def draw_route(
    entry: Floats,
    leave: Floats,
    fits: Fits = lambda _: True,
    sharpness: float | None = None,
    max_curvature: float = MAX_CAR_CURVATURE_PER_M,
) -> Curve | None:
    """Return the route from an entry pose to an exit pose, (3,) x, y [m], yaw [rad] each.

    Args:
        entry: where it begins.
        leave: where it ends.
        fits: whether poses on the route have room.
        sharpness: [1/m] the curvature that its bend should have.
        max_curvature: [1/m] the curvature that it may have.

    Returns:
        The route; None if none is possible and fits. A U-turn needs `draw_u_turn`.

    Source: clothoid, arc, clothoid, as in the design of roads.
    """
    turn = angle_between(leave[2], entry[2])
    ahead, left = relative(entry, leave[:2])
    if abs(turn) > _MAX_TURN_RAD:
        return None
    # From the intersection of the lines of entry and exit to the exit.
    from_intersection = left / np.sin(turn) if abs(turn) > _PARALLEL_RAD else -1.0
    to_intersection = ahead - from_intersection * np.cos(turn)
    room = min(to_intersection, from_intersection) - 0.5
    usual = 0.09
    if abs(turn) < _MAX_BLENDED_TURN_RAD:  # as gently as there is room
        usual = 0.8 * abs(turn) / max(room, 1.0)
    for curvature, ramp in _bend_shapes(sharpness or usual, max_curvature) if room > 0.0 else ():
        bend = _bend(round(turn, 9), round(curvature, 9), ramp)
        tangent = float(bend[-1, 1]) / np.sin(turn)
        if tangent <= room:
            joined = _joined(entry, to_intersection - tangent, bend, from_intersection - tangent)
            route = _fitting(joined, fits)
            if route is not None:
                return route
    if abs(turn) < _MAX_BLENDED_TURN_RAD and ahead > 1.0:
        return _fitting(_shifted(entry, ahead, left, turn), fits)
    return None


def _bend_shapes(curvature: float, max_curvature: float) -> Iterator[tuple[float, float]]:
    """Yield the curvatures [1/m] that are tried, and the share of a bend on which each rises."""
    for factor in (1.0, 0.8, 1.25, 0.64, 1.56, 0.5, 1.95, 2.4):
        if factor * curvature <= max_curvature:
            yield factor * curvature, 1.0 / 3.0
    for sharp in dict.fromkeys((0.13, 0.155, 0.18, MAX_CAR_CURVATURE_PER_M, max_curvature)):
        if sharp <= max_curvature:
            yield sharp, 0.12


def draw_u_turn(entry: Floats, leave: Floats, apex: Floats) -> Curve | None:
    """Return the route between two poses (3,) with a half circle that ends abreast of `apex`.

    It is None if the half circle is too narrow, or begins before the exit; `apex` is (2,) [m].
    """
    ahead, left = relative(entry, leave[:2])
    radius = abs(left) / 2.0
    before = relative(entry, apex)[0] - radius
    if radius < _MIN_U_TURN_RADIUS_M or before <= max(ahead, 0.0):
        return None
    count = int(np.ceil(np.pi * radius / _STEP_M)) + 1
    angle = np.linspace(0.0, np.copysign(np.pi, left), count)
    signed = np.copysign(radius, left)
    arc = np.column_stack((signed * np.sin(angle), signed * (1.0 - np.cos(angle)), angle))
    return _joined(entry, before, arc, before - ahead)


def draw_ring_route(entry: Floats, leave: Floats, centre: Floats, radius: float) -> Curve | None:
    """Return the route from an entry pose (3,) to an exit pose around a roundabout.

    Args:
        entry: where it begins; with the centre on its left, the route is counter-clockwise.
        leave: where it ends.
        centre: (2,) [m] of the roundabout.
        radius: [m] of its lane.

    Returns:
        The route; None if there is none.
    """
    ahead, left = relative(entry, centre)
    behind, right = relative(leave, centre)
    side = 1.0 if left > 0.0 else -1.0
    if ahead < radius or -behind < radius or right * side < 0.0:
        return None
    bends = [
        _ring_bend(distance, offset, radius)
        for distance, offset in ((ahead, abs(left)), (-behind, abs(right)))
    ]
    if any(straight < 0.5 for straight, _ in bends):
        return None

    (before, first), (after, last) = bends
    around = float(((leave[2] - entry[2]) * side + first + last) % (2.0 * np.pi))
    pieces = (
        (before, 0.0),
        (_ENTRY_RADIUS_M * first, -side / _ENTRY_RADIUS_M),
        (radius * around, side / radius),
        (_ENTRY_RADIUS_M * last, -side / _ENTRY_RADIUS_M),
        (after, 0.0),
    )
    yaw, steps = [0.0], []
    for length, curvature in pieces:
        count = max(round(length / _STEP_M), 1)
        yaw += (yaw[-1] + curvature * length * np.arange(1, count + 1) / count).tolist()
        steps += [length / count] * count
    turned = np.array(yaw)
    xy = polyline_of(turned, np.array(steps))
    end = np.array(relative(entry, leave[:2]))
    if np.hypot(*(xy[-1] - end)) > 1.0:
        return None
    xy += np.linspace(0.0, 1.0, len(xy))[:, None] * (end - xy[-1])  # the rounding error
    return Curve(np.column_stack((place(entry, xy[:, 0], xy[:, 1]), entry[2] + turned)))


def _ring_bend(distance: float, offset: float, radius: float) -> tuple[float, float]:
    """Return the straight part [m] before the bend into a ring, and the bend's angle [rad].

    The ring's centre is `distance` ahead of the entry and `offset` to its side.
    """
    between = offset + _ENTRY_RADIUS_M  # the centres of the bend and the ring
    along = float(np.sqrt(np.square(radius + _ENTRY_RADIUS_M) - np.square(between)))
    return distance - along, float(np.arctan2(along, between))


def relative(pose: Floats, xy: Floats) -> tuple[float, float]:
    """Return how far [m] `xy` (2,) lies ahead and to the left of a pose (3,)."""
    ahead, left = ahead_and_left(xy - pose[:2], pose[2])
    return float(ahead), float(left)


def reverse(pose: Floats) -> Floats:
    """Return the same place (3,) x, y [m], yaw [rad] with the opposite heading."""
    return np.asarray(pose + np.array([0.0, 0.0, np.pi]))


def with_turn(shape: Curve, turn: float) -> Curve:
    """Return a shape from the origin along x that turns by `turn` [rad], evenly more or less."""
    count = max(int(np.ceil(shape.length / _STEP_M)), 1)
    s = np.linspace(0.0, shape.length, count + 1)
    yaw = np.interp(s, shape.station, shape.points[:, 2])
    yaw += (turn - yaw[-1] + yaw[0]) * s / shape.length - yaw[0]
    return Curve(np.column_stack((polyline_of(yaw, shape.length / count), yaw)))


@lru_cache(maxsize=512)
def _bend(turn: float, curvature: float, ramp: float) -> Floats:
    """Return (M, 3) a clothoid, an arc and a clothoid from the origin along x.

    They turn by `turn` [rad] with a curvature of at most `curvature` [1/m], which rises and falls
    on the share `ramp` of the length each.
    """
    length = abs(turn) / (curvature * (1.0 - ramp))
    count = max(int(np.ceil(length / _STEP_M)), 8)
    x = np.linspace(0.0, 1.0, count + 1)
    rise = np.square(np.minimum(x, ramp)) / (2.0 * ramp) + np.maximum(x - ramp, 0.0)
    rise = np.minimum(rise, 1.0 - ramp)
    fall = np.square(np.maximum(x - (1.0 - ramp), 0.0)) / (2.0 * ramp)
    share = np.where(x > 1.0 - ramp, x - ramp / 2.0 - fall, rise) / (1.0 - ramp)  # of the turn
    return frozen(np.column_stack((polyline_of(turn * share, length / count), turn * share)))


def _fitting(curve: Curve | None, fits: Fits) -> Curve | None:
    """Return a curve if it fits; its first and last footprints reach beyond the road's end."""
    if curve is None:
        return None
    inner = curve.cut(3.0, max(curve.length - 3.0, 3.5), 0.5)
    return curve if fits(inner.points) else None


def _shifted(entry: Floats, ahead: float, left: float, turn: float) -> Curve | None:
    """Return the route to a (nearly) parallel line by a smooth shift in the middle.

    The shift is a polynomial of degree 5, whose steepest second derivative is 5.7735, and whose
    steepest slope is 1.875.
    """
    if abs(left) < 0.05 and abs(turn) < 1e-3:
        return Curve(np.array([entry[:3], [*place(entry, ahead, left), entry[2]]]))
    slope = float(np.tan(turn))
    between = left - slope * ahead / 2.0  # the two lines, half-way
    reach = max(
        float(np.sqrt(abs(between) * 5.7735 / _MAX_SHIFT_CURVATURE_PER_M)),
        1.875 * abs(slope) / _MAX_SHIFT_CURVATURE_PER_M,
    )
    if abs(left) > _MAX_SHIFT_M + abs(slope) * ahead or reach > ahead - 2.0:
        return None
    x = np.linspace(0.0, 1.0, max(int(np.ceil(reach / 0.5)), 4) + 1)
    first, last = (ahead - reach) / 2.0, (ahead + reach) / 2.0
    end = left - slope * (ahead - last)
    cube = x**3
    y = end * cube * (10.0 - 15.0 * x + 6.0 * np.square(x))
    y += slope * reach * cube * (-4.0 + 7.0 * x - 3.0 * np.square(x))
    along = np.concatenate(([0.0], first + reach * x, [ahead]))
    return Curve.through(place(entry, along, np.concatenate(([0.0], y, [left]))))


def _joined(entry: Floats, before: float, bend: Floats, after: float) -> Curve:
    """Return a line of `before` [m], a bend (M, 3) from the origin along x, and a line."""
    points = bend + np.array([before, 0.0, 0.0])
    end = points[-1] + np.array([*(after * unit(points[-1, 2])), 0.0])
    pieces = [points]
    if before > 1e-6:
        pieces.insert(0, np.zeros((1, 3)))
    if after > 1e-6:
        pieces.append(end[None])
    local = np.vstack(pieces)
    return Curve(np.column_stack((place(entry, local[:, 0], local[:, 1]), entry[2] + local[:, 2])))
