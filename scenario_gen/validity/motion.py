# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The motion between samples as Bézier curves, whose control points bound it over any stretch of time.

The cubic Hermite interpolant of positions p0, p1 and velocities m0, m1 over h seconds is the Bézier curve with control
points p0, p0 + h m0 / 3, p1 - h m1 / 3, p1. A Bézier curve lies in the convex hull of its control points; so does the
difference of two of them; and the part between u0 and u1 has control points given by the blossom (Ramshaw 1989).
"""

import numpy as np

from scenario_gen import exact
from scenario_gen.arrays import Floats
from scenario_gen.kernels import F1, F2, F3, kernel, OUT4


@kernel(F1, F3, F2, F2, F2)
def is_motion(time: Floats, position: Floats, heading: Floats, speed: Floats, acceleration: Floats) -> bool:
    """Whether all values are finite and time increases."""
    n, t = heading.shape
    for k in range(t):
        if not np.isfinite(time[k]) or (k > 0 and time[k] <= time[k - 1]):
            return False
    for i in range(n):
        for k in range(t):
            # a sum is finite only if all its terms are
            if not np.isfinite(position[i, k, 0] + position[i, k, 1] + heading[i, k] + speed[i, k] + acceleration[i, k]):
                return False
    return True


@kernel(F1, F3, F2, F2, OUT4)
def control_points(time: Floats, position: Floats, heading: Floats, speed: Floats, out: Floats) -> None:
    """Fill `out` (N, T - 1, 4, 2) with the control points [m] of every vehicle in every interval."""
    n, t = heading.shape
    for i in range(n):
        vx, vy = speed[i, 0] * exact.cos(heading[i, 0]), speed[i, 0] * exact.sin(heading[i, 0])
        for k in range(t - 1):
            third = (time[k + 1] - time[k]) / 3.0
            wx, wy = speed[i, k + 1] * exact.cos(heading[i, k + 1]), speed[i, k + 1] * exact.sin(heading[i, k + 1])
            out[i, k, 0, 0], out[i, k, 0, 1] = position[i, k, 0], position[i, k, 1]
            out[i, k, 1, 0], out[i, k, 1, 1] = position[i, k, 0] + third * vx, position[i, k, 1] + third * vy
            out[i, k, 2, 0], out[i, k, 2, 1] = position[i, k + 1, 0] - third * wx, position[i, k + 1, 1] - third * wy
            out[i, k, 3, 0], out[i, k, 3, 1] = position[i, k + 1, 0], position[i, k + 1, 1]
            vx, vy = wx, wy


@kernel(inline=True)
def blossom(b: Floats, c: int, r: float, s: float, t: float) -> float:
    """Blossom of the cubic with control points b (4, 2), coordinate c, at (r, s, t): de Casteljau with three parameters."""
    d0, d1, d2 = b[0, c] + (b[1, c] - b[0, c]) * r, b[1, c] + (b[2, c] - b[1, c]) * r, b[2, c] + (b[3, c] - b[2, c]) * r
    e0, e1 = d0 + (d1 - d0) * s, d1 + (d2 - d1) * s
    return float(e0 + (e1 - e0) * t)


@kernel(inline=True)
def stretch(b: Floats, u0: float, u1: float, out: Floats) -> None:
    """Write the control points of the part of `b` (4, 2) between u0 and u1 into `out` (4, 2)."""
    for c in range(2):
        out[0, c] = blossom(b, c, u0, u0, u0)
        out[1, c] = blossom(b, c, u0, u0, u1)
        out[2, c] = blossom(b, c, u0, u1, u1)
        out[3, c] = blossom(b, c, u1, u1, u1)
