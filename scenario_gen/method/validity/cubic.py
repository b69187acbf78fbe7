# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The cubic between two samples as a Bézier curve, and the outcome of a proof over an interval."""

from enum import IntEnum

import numpy as np

from scenario_gen.numerics import Floats
from scenario_gen.numerics.kernels import F1, F2, F3, kernel, OUT4


class Proof(IntEnum):
    """The outcome of a proof over an interval of time."""

    PROVEN = 0
    VIOLATED = 1
    UNPROVEN = 2


@kernel(F1, F3, F2, F2, OUT4)
def control_points(
    time: Floats, position: Floats, heading: Floats, speed: Floats, out: Floats
) -> None:
    """Fill `out` (N, T - 1, 4, 2) with the control points [m] of every vehicle in every interval.

    A control point lies a third of the interval's duration along the velocity from its end.
    """
    n, t = heading.shape
    for i in range(n):
        for k in range(t - 1):
            third = (time[k + 1] - time[k]) / 3.0
            for axis in range(2):
                velocity = speed[i, k] * _direction(heading[i, k], axis)
                next_velocity = speed[i, k + 1] * _direction(heading[i, k + 1], axis)
                out[i, k, 0, axis] = position[i, k, axis]
                out[i, k, 1, axis] = position[i, k, axis] + third * velocity
                out[i, k, 2, axis] = position[i, k + 1, axis] - third * next_velocity
                out[i, k, 3, axis] = position[i, k + 1, axis]


@kernel(inline=True)
def _direction(yaw: float, axis: int) -> float:
    """Component x (axis 0) or y (axis 1) of the unit vector with this heading [rad]."""
    return float(np.cos(yaw) if axis == 0 else np.sin(yaw))


@kernel(inline=True)
def blossom(b: Floats, c: int, r: float, s: float, t: float) -> float:
    """Blossom [m] at (r, s, t) of coordinate c of the cubic with control points b (4, 2).

    Source: de Casteljau's algorithm with three parameters (Ramshaw 1989).
    """
    d0 = b[0, c] + (b[1, c] - b[0, c]) * r
    d1 = b[1, c] + (b[2, c] - b[1, c]) * r
    d2 = b[2, c] + (b[3, c] - b[2, c]) * r
    e0 = d0 + (d1 - d0) * s
    e1 = d1 + (d2 - d1) * s
    return float(e0 + (e1 - e0) * t)


@kernel(inline=True)
def split_cubic(b: Floats, u0: float, u1: float, out: Floats) -> None:
    """Write the control points [m] of the part of `b` (4, 2) from u0 to u1 into `out` (4, 2)."""
    for c in range(2):
        out[0, c] = blossom(b, c, u0, u0, u0)
        out[1, c] = blossom(b, c, u0, u0, u1)
        out[2, c] = blossom(b, c, u0, u1, u1)
        out[3, c] = blossom(b, c, u1, u1, u1)
