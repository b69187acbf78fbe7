# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Ways across a road, from a lane in to a lane out: a line, a bend whose curvature is continuous, a line.

The bend is a clothoid, an arc and a clothoid. Its curvature is the one that the caller asks for, the template's own; where the
road has no room for that, gentler and tighter ones are tried in turn. So a route drives as the recorded vehicle did.
"""

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from scenario_gen.numerics import Floats, frozen
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.plane import ahead_and_left, angle_between, place, polyline_of, unit

Fits = Callable[[Floats], bool]

_STEP = 0.25  # metres
_PARALLEL = np.radians(8.0)
_BLENDED = np.radians(
    35.0
)  # a turn by up to this is also possible while changing to the line of the exit
_RAMP = 1.0 / 3.0  # share of a bend's length on which its curvature rises, and falls again
_SHORT_RAMP = 0.12
TIGHTEST = 0.2  # 1/m
_LADDER = (1.0, 0.8, 1.25, 0.64, 1.56, 0.5, 1.95, 2.4)  # times the requested curvature
_PLAIN = 0.09  # 1/m, where nothing is known of the vehicle
_LAST = (0.13, 0.155, 0.18, TIGHTEST)  # 1/m, with short ramps: what a car can just drive
_STEEPEST_SHIFT = 0.05  # 1/m, curvature of a change of lanes on the way
_WIDEST_SHIFT = 12.0  # metres sideways
_FLARE = 14.0  # metres, radius of the bends into a roundabout and out of it
_TIGHTEST_U_TURN = 6.0  # metres


def draw_route(
    entry: Floats,
    leave: Floats,
    fits: Fits = lambda _: True,
    sharpness: float | None = None,
    tightest: float = TIGHTEST,
) -> Curve | None:
    """The way from an entry pose (3,) x, y [m], yaw [rad] to an exit pose, or None if `fits` allows none.

    Args:
        entry: where it begins.
        leave: where it ends.
        fits: whether poses (M, 3) have room.
        sharpness: curvature [1/m] that its bend should have.
        tightest: curvature [1/m] that it may have.

    Source: clothoid, arc, clothoid, as roads are laid out.
    """
    turn = angle_between(leave[2], entry[2])
    ahead, left = relative(entry, leave[:2])
    if abs(turn) < _PARALLEL:
        return _accepted(_beside(entry, ahead, left, turn), fits) if ahead > 1.0 else None
    if abs(turn) > np.pi - _PARALLEL:
        return None  # a U-turn: the template says where along the road, see draw_u_turn
    along_exit = left / np.sin(turn)  # from the lines' intersection to the exit
    along_entry = ahead - along_exit * np.cos(turn)
    sharp = sharpness or _PLAIN
    last = dict.fromkeys((*_LAST, tightest))
    for curvature, ramp in (
        *((factor * sharp, _RAMP) for factor in _LADDER),
        *((curvature, _SHORT_RAMP) for curvature in last),
    ):
        if curvature > tightest:
            continue
        bend = _bend(round(turn, 9), round(curvature, 9), ramp)
        tangent = float(bend[-1, 1]) / np.sin(turn)
        if tangent <= min(along_entry, along_exit) - 0.5:
            route = _accepted(
                _joined(entry, along_entry - tangent, bend, along_exit - tangent), fits
            )
            if route is not None:
                return route
    if abs(turn) < _BLENDED and ahead > 1.0:
        return _accepted(_beside(entry, ahead, left, turn), fits)
    return None


def draw_u_turn(entry: Floats, leave: Floats, apex: float) -> Curve | None:
    """The route between two poses (3,) that drives `apex` metres, makes a half circle and leaves by the lane beside it."""
    ahead, left = relative(entry, leave[:2])
    radius = abs(left) / 2.0
    if radius < _TIGHTEST_U_TURN or apex <= max(ahead, 0.0):
        return None
    angle = np.linspace(0.0, np.copysign(np.pi, left), int(np.ceil(np.pi * radius / _STEP)) + 1)
    signed = np.copysign(radius, left)
    arc = np.column_stack((signed * np.sin(angle), signed * (1.0 - np.cos(angle)), angle))
    return _joined(entry, apex, arc, apex - ahead)


def draw_ring_route(entry: Floats, leave: Floats, centre: Floats, radius: float) -> Curve | None:
    """The way from an entry pose (3,) to an exit pose about a roundabout, or None if there is none.

    Args:
        entry: where it begins; who has the centre on the left goes about it counter-clockwise, else clockwise.
        leave: where it ends.
        centre: (2,) [m] of the roundabout.
        radius: [m] of its lane.
    """
    ahead, left = relative(entry, centre)
    behind, right = relative(leave, centre)
    side = 1.0 if left > 0.0 else -1.0
    if ahead < radius or -behind < radius or right * side < 0.0:
        return None
    bends = []
    for distance, aside in ((ahead, abs(left)), (-behind, abs(right))):
        along = float(
            np.sqrt(np.square(radius + _FLARE) - np.square(aside + _FLARE))
        )  # from the bend's centre to the ring's
        if distance - along < 0.5:
            return None
        bends.append((distance - along, float(np.arctan2(along, aside + _FLARE))))
    (before, first), (after, last) = bends
    about = float(((leave[2] - entry[2]) * side + first + last) % (2.0 * np.pi))
    pieces = (
        (before, 0.0),
        (_FLARE * first, -side / _FLARE),
        (radius * about, side / radius),
        (_FLARE * last, -side / _FLARE),
    )
    yaw, steps = [0.0], []
    for length, curvature in (*pieces, (after, 0.0)):
        count = max(round(length / _STEP), 1)
        yaw += (yaw[-1] + curvature * length * np.arange(1, count + 1) / count).tolist()
        steps += [length / count] * count
    turned = np.array(yaw)
    xy = polyline_of(turned, np.array(steps))
    end = np.array(relative(entry, leave[:2]))
    if np.hypot(*(xy[-1] - end)) > 1.0:
        return None
    xy += np.linspace(0.0, 1.0, len(xy))[:, None] * (end - xy[-1])  # what rounding leaves
    return Curve(np.column_stack((place(entry, xy[:, 0], xy[:, 1]), entry[2] + turned)))


def relative(pose: Floats, xy: Floats) -> tuple[float, float]:
    """How far [m] `xy` (2,) lies ahead and to the left of a pose (3,)."""
    ahead, left = ahead_and_left(xy - pose[:2], pose[2])
    return float(ahead), float(left)


def reverse(pose: Floats) -> Floats:
    """The same place (3,) [m, m, rad], heading the other way."""
    return np.asarray(pose + np.array([0.0, 0.0, np.pi]))


def extended(shape: Curve, extra: float, run: float) -> Curve:
    """The shape from the origin along x, turned by `extra` [rad] more, evenly, and `run` metres straight on at both ends."""
    return _joined(np.zeros(3), run, _bent(shape, extra), run)


def _bent(shape: Curve, extra: float) -> Floats:
    """(M, 3) the shape from the origin along x, turned by `extra` [rad] more, evenly."""
    count = max(int(np.ceil(shape.length / _STEP)), 1)
    s = np.linspace(0.0, shape.length, count + 1)
    yaw = np.interp(s, shape.station, shape.points[:, 2])
    yaw = yaw - yaw[0] + extra * s / shape.length
    return np.column_stack((polyline_of(yaw, shape.length / count), yaw))


@lru_cache(maxsize=512)
def _bend(turn: float, curvature: float, ramp: float) -> Floats:
    """(M, 3) clothoid, arc, clothoid from the origin along x: turns by `turn` [rad], curvature at most `curvature` [1/m]."""
    length = abs(turn) / (curvature * (1.0 - ramp))
    count = max(int(np.ceil(length / _STEP)), 8)
    x = np.linspace(0.0, 1.0, count + 1)
    rise = np.minimum(
        np.square(np.minimum(x, ramp)) / (2.0 * ramp) + np.maximum(x - ramp, 0.0), 1.0 - ramp
    )
    fall = np.square(np.maximum(x - (1.0 - ramp), 0.0)) / (2.0 * ramp)
    share = np.where(x > 1.0 - ramp, x - ramp / 2.0 - fall, rise) / (1.0 - ramp)  # of the turn
    return frozen(np.column_stack((polyline_of(turn * share, length / count), turn * share)))


def _accepted(curve: Curve | None, fits: Fits) -> Curve | None:
    if curve is None:
        return None
    inner = curve.cut(
        3.0, max(curve.length - 3.0, 3.5), 0.5
    )  # the first and last footprint reach beyond the road's end
    return curve if fits(inner.points) else None


def _beside(entry: Floats, ahead: float, left: float, turn: float) -> Curve | None:
    """Straight on, or to a line that is parallel, or nearly so, by a smooth shift in the middle (a polynomial of degree 5)."""
    slope = float(np.tan(turn))
    aside = left - slope * ahead / 2.0  # how far the two lines are apart half-way
    if abs(left) < 0.05 and abs(turn) < 1e-3:
        return Curve(np.array([entry[:3], [*place(entry, ahead, left), entry[2]]]))
    reach = max(
        float(
            np.sqrt(abs(aside) * 5.7735 / _STEEPEST_SHIFT)
        ),  # the blend's steepest second derivative is 5.7735
        1.875 * abs(slope) / _STEEPEST_SHIFT,
    )
    if abs(left) > _WIDEST_SHIFT + abs(slope) * ahead or reach > ahead - 2.0:
        return None
    x = np.linspace(0.0, 1.0, max(int(np.ceil(reach / 0.5)), 4) + 1)
    first, last = (ahead - reach) / 2.0, (ahead + reach) / 2.0
    end = left - slope * (ahead - last)
    cube = x**3
    y = end * cube * (10.0 - 15.0 * x + 6.0 * np.square(x)) + slope * reach * cube * (
        -4.0 + 7.0 * x - 3.0 * np.square(x)
    )
    along = np.concatenate(([0.0], first + reach * x, [ahead]))
    return Curve.through(place(entry, along, np.concatenate(([0.0], y, [left]))))


def _joined(entry: Floats, before: float, bend: Floats, after: float) -> Curve:
    """Straight for `before` metres, the bend (M, 3) given from the origin along x, straight for `after` metres."""
    points = bend + np.array([before, 0.0, 0.0])
    end = points[-1] + np.array([*(after * unit(points[-1, 2])), 0.0])
    pieces = [np.zeros((1, 3))] if before > 1e-6 else []
    pieces += [points, end[None]] if after > 1e-6 else [points]
    local = np.vstack(pieces)
    return Curve(np.column_stack((place(entry, local[:, 0], local[:, 1]), entry[2] + local[:, 2])))
