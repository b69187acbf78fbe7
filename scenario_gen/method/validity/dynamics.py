# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Speed, acceleration and curvature of the motion between two instants, in closed form, and their limits."""

from enum import IntEnum

import numpy as np

from scenario_gen.numerics import Floats
from scenario_gen.numerics.kernels import F1, F2, F3, kernel, OUT3, OUT4
from scenario_gen.types import Cause

LARGEST = 1e8  # m, s, m/s, …: a coordinate is rounded by some 10 nm here, and more beyond


@kernel(F1, F3, F2, F2, F2)
def is_motion(
    time: Floats, position: Floats, heading: Floats, speed: Floats, acceleration: Floats
) -> bool:
    """Whether all are within LARGEST and time (T,) [s] increases; position (N, T, 2) [m], the others (N, T) in SI units."""
    n, t = heading.shape
    for k in range(t):
        if not abs(time[k]) <= LARGEST or (k > 0 and time[k] <= time[k - 1]):
            return False
    for i in range(n):
        for k in range(t):
            if not (
                abs(position[i, k, 0]) <= LARGEST
                and abs(position[i, k, 1]) <= LARGEST
                and abs(heading[i, k]) <= LARGEST
            ):
                return False
            if not (abs(speed[i, k]) <= LARGEST and abs(acceleration[i, k]) <= LARGEST):
                return False
    return True


@kernel(F1, F3, F2, F2, OUT4)
def control_points(
    time: Floats, position: Floats, heading: Floats, speed: Floats, out: Floats
) -> None:
    """Fill `out` (N, T - 1, 4, 2) with the control points [m] of every vehicle in every interval."""
    n, t = heading.shape
    for i in range(n):
        vx, vy = speed[i, 0] * np.cos(heading[i, 0]), speed[i, 0] * np.sin(heading[i, 0])
        for k in range(t - 1):
            third = (time[k + 1] - time[k]) / 3.0
            wx, wy = (
                speed[i, k + 1] * np.cos(heading[i, k + 1]),
                speed[i, k + 1] * np.sin(heading[i, k + 1]),
            )
            out[i, k, 0, 0], out[i, k, 0, 1] = position[i, k, 0], position[i, k, 1]
            out[i, k, 1, 0], out[i, k, 1, 1] = (
                position[i, k, 0] + third * vx,
                position[i, k, 1] + third * vy,
            )
            out[i, k, 2, 0], out[i, k, 2, 1] = (
                position[i, k + 1, 0] - third * wx,
                position[i, k + 1, 1] - third * wy,
            )
            out[i, k, 3, 0], out[i, k, 3, 1] = position[i, k + 1, 0], position[i, k + 1, 1]
            vx, vy = wx, wy


@kernel(inline=True)
def blossom(b: Floats, c: int, r: float, s: float, t: float) -> float:
    """Blossom [m] of the cubic with control points b (4, 2), coordinate c, at (r, s, t): de Casteljau with three parameters.

    Source: Ramshaw 1989.
    """
    d0, d1, d2 = (
        b[0, c] + (b[1, c] - b[0, c]) * r,
        b[1, c] + (b[2, c] - b[1, c]) * r,
        b[2, c] + (b[3, c] - b[2, c]) * r,
    )
    e0, e1 = d0 + (d1 - d0) * s, d1 + (d2 - d1) * s
    return float(e0 + (e1 - e0) * t)


@kernel(inline=True)
def stretch(b: Floats, u0: float, u1: float, out: Floats) -> None:
    """Write the control points [m] of the part of `b` (4, 2) between u0 and u1 into `out` (4, 2).

    Source: de Casteljau by blossoms (Ramshaw 1989).
    """
    for c in range(2):
        out[0, c] = blossom(b, c, u0, u0, u0)
        out[1, c] = blossom(b, c, u0, u0, u1)
        out[2, c] = blossom(b, c, u0, u1, u1)
        out[3, c] = blossom(b, c, u1, u1, u1)


TURN_ROUNDING = (
    1e-4  # rad, change of heading that a vehicle may show in a step without having moved
)
TURN_DRIFT = 1e-3  # rad/s, and as a rate: many short steps would make a turn of it
SLACK = 1e-6  # rounding of a value that keeps exactly to its limit
OF_TYPE = (
    "max_speed",
    "max_acceleration",
    "max_deceleration",
    "max_lateral_acceleration",
    "sharpest",
)
OF_ALL = ("slip", "slip_share", "acceleration_tolerance")
"""Of a type's `Dynamics`, and of `Limits`, those that `worst_excess` takes."""


class Check(IntEnum):
    """Rows of what `worst_excess` fills in."""

    NEGATIVE_SPEED = 0
    MAX_SPEED = 1
    ACCELERATION = 2
    DECELERATION = 3
    SPEED_CHANGE = 4
    LATERAL = 5
    CURVATURE = 6
    DISPLACEMENT = 7
    SLIP = 8
    PATH_LONGITUDINAL = 9
    PATH_LATERAL = 10


_ALONG, _ASIDE = Cause.LONGITUDINAL_ACCELERATION, Cause.LATERAL_ACCELERATION
MESSAGES: dict[Check, tuple[Cause, str]] = {
    Check.NEGATIVE_SPEED: (Cause.SPEED, "speed falls to {value:.3f} m/s, below zero"),
    Check.MAX_SPEED: (
        Cause.SPEED,
        "speed reaches {value:.3f} m/s, above the limit of {limit:.3f} m/s",
    ),
    Check.ACCELERATION: (
        _ALONG,
        "acceleration reaches {value:.3f} m/s², above the limit of {limit:.3f} m/s²",
    ),
    Check.DECELERATION: (
        _ALONG,
        "braking reaches {value:.3f} m/s², above the limit of {limit:.3f} m/s²",
    ),
    Check.SPEED_CHANGE: (
        _ALONG,
        "speed changes at a rate {value:.3f} m/s² outside the published accelerations; {limit:.3f} m/s² are tolerated",
    ),
    Check.LATERAL: (
        _ASIDE,
        "lateral acceleration reaches {value:.3f} m/s², above the limit of {limit:.3f} m/s²",
    ),
    Check.CURVATURE: (
        Cause.CURVATURE,
        "curvature reaches {value:.3f} 1/m, above the limit of {limit:.3f} 1/m",
    ),
    Check.DISPLACEMENT: (
        Cause.SPEED,
        "position advances {value:.3f} m/s off the published speed; {limit:.3f} m/s are tolerated",
    ),
    Check.SLIP: (
        Cause.CURVATURE,
        "slides sideways at {value:.3f} m/s against the published heading; {limit:.3f} m/s are tolerated",
    ),
    Check.PATH_LONGITUDINAL: (
        _ALONG,
        "positions speed up or brake at {value:.3f} m/s²; {limit:.3f} m/s² are allowed",
    ),
    Check.PATH_LATERAL: (
        _ASIDE,
        "positions accelerate sideways at {value:.3f} m/s²; {limit:.3f} m/s² are allowed",
    ),
}
_PARAMETERS = {
    Check.MAX_SPEED: "max_speed",
    Check.ACCELERATION: "max_acceleration",
    Check.DECELERATION: "max_deceleration",
    Check.LATERAL: "max_lateral_acceleration",
    Check.CURVATURE: "max_curvature",
}


def parameter_of(check: Check, name: str) -> str:
    """Return which parameter is the limit of a check for a type, to be put behind a message; "" if it is none of a type."""
    return f" (limits.{name}.{_PARAMETERS[check]})" if check in _PARAMETERS else ""


@kernel(inline=True)
def _note(out: Floats, row: int, excess: float, value: float, limit: float, time: float) -> None:
    """Keep the worst excess of one check of one vehicle."""
    if excess > out[row, 0]:
        out[row, 0], out[row, 1], out[row, 2], out[row, 3] = excess, value, limit, time


@kernel(inline=True)
def _in_body(yaw: float, x: float, y: float) -> tuple[float, float]:
    """Components ahead and to the left of a vector (x, y) for a heading [rad]."""
    c, s = np.cos(yaw), np.sin(yaw)
    return c * x + s * y, c * y - s * x


@kernel(inline=True)
def _of_path(time: Floats, position: Floats, k: int, yaw: float) -> tuple[float, float]:
    """Acceleration [m/s²] ahead and to the left at instant k of the positions (T, 2) alone.

    Their second difference is a mean of the acceleration over the two steps around k.
    """
    before, after, half = (
        time[k] - time[k - 1],
        time[k + 1] - time[k],
        0.5 * (time[k + 1] - time[k - 1]),
    )
    x = (
        (position[k + 1, 0] - position[k, 0]) / after
        - (position[k, 0] - position[k - 1, 0]) / before
    ) / half
    y = (
        (position[k + 1, 1] - position[k, 1]) / after
        - (position[k, 1] - position[k - 1, 1]) / before
    ) / half
    return _in_body(yaw, x, y)


@kernel(F1, F3, F2, F2, F2, F1, OUT3)
def worst_excess(
    time: Floats,
    position: Floats,
    heading: Floats,
    speed: Floats,
    acceleration: Floats,
    limits: Floats,
    out: Floats,
) -> None:
    """Fill `out` (N, len(Check), 4): how far the worst instant exceeds each limit (<= 0: kept), value, limit, time [s].

    Args:
        time: (T,) seconds.
        position: (N, T, 2) metres.
        heading: (N, T) rad.
        speed: (N, T) m/s.
        acceleration: (N, T) m/s².
        limits: those that OF_TYPE and OF_ALL name, in that order.
        out: one row per `Check`.
    """
    top, speeding, braking, lateral, curvature = (
        limits[0],
        limits[1],
        limits[2],
        limits[3],
        limits[4],
    )
    slip, share, tolerance = limits[5], limits[6], limits[7]
    n, t = speed.shape
    for i in range(n):
        for row in range(out.shape[1]):
            out[i, row, 0] = 0.0
        for k in range(t):
            v, a, now = speed[i, k], acceleration[i, k], time[k]
            _note(out[i], 0, -v, v, 0.0, now)
            _note(out[i], 1, v - top - SLACK, v, top, now)
            _note(out[i], 2, a - speeding - SLACK, a, speeding, now)
            _note(out[i], 3, -a - braking - SLACK, -a, braking, now)
            if k == t - 1:
                break
            h, w, b = time[k + 1] - now, speed[i, k + 1], acceleration[i, k + 1]
            if k > 0:
                ahead, left = _of_path(time, position[i], k, heading[i, k])
                aside = abs(left)
                _note(out[i], 9, ahead - speeding - tolerance, ahead, speeding + tolerance, now)
                _note(out[i], 9, -ahead - braking - tolerance, -ahead, braking + tolerance, now)
                _note(out[i], 10, aside - lateral - tolerance, aside, lateral + tolerance, now)
            rate = (w - v) / h
            _note(out[i], 2, rate - speeding - SLACK, rate, speeding, now)
            _note(out[i], 3, -rate - braking - SLACK, -rate, braking, now)
            off = max(rate - max(a, b), min(a, b) - rate)
            _note(out[i], 4, off - tolerance - SLACK, off, tolerance, now)
            turn, fast = abs(heading[i, k + 1] - heading[i, k]), max(v, w)
            _note(out[i], 5, fast * turn / h - lateral - SLACK, fast * turn / h, lateral, now)
            dx, dy = (
                position[i, k + 1, 0] - position[i, k, 0],
                position[i, k + 1, 1] - position[i, k, 1],
            )
            moved = np.sqrt(dx * dx + dy * dy)
            if (
                turn > min(TURN_ROUNDING, TURN_DRIFT * h + 1e-8) + curvature * moved
            ):  # headings are rounded to 1 nrad
                bend = turn / moved
                _note(out[i], 6, bend - curvature, bend, curvature, now)
            vx, vy = v * np.cos(heading[i, k]), v * np.sin(heading[i, k])
            wx, wy = w * np.cos(heading[i, k + 1]), w * np.sin(heading[i, k + 1])
            # mean velocity of the displacement against that of the published speeds and headings, in the body's axes
            ex, ey = dx / h - 0.5 * (vx + wx), dy / h - 0.5 * (vy + wy)
            ahead, left = _in_body(0.5 * (heading[i, k] + heading[i, k + 1]), ex, ey)
            allowed, ahead, aside = slip + share * fast, abs(ahead), abs(left)
            _note(out[i], 7, ahead - allowed, ahead, allowed, now)
            _note(out[i], 8, aside - allowed, aside, allowed, now)
            # speed of the cubic: its derivative's middle control point is 3 displacement / h - v - w
            qx, qy = 3.0 * dx / h - vx - wx, 3.0 * dy / h - vy - wy
            between = fast + 0.5 * max(0.0, np.sqrt(qx * qx + qy * qy) - fast)
            _note(out[i], 1, between - top - SLACK, between, top, now)
