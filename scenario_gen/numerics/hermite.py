# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Motion between two samples: position is a cubic, heading and speed are linear.

The cubic is the Hermite interpolant of two positions and two velocity vectors (speed along
heading). It is the motion that the validity checker proves; everything else that looks between two
samples evaluates it here.
"""

import numpy as np

from scenario_gen.numerics.arrays import Floats, Ints
from scenario_gen.numerics.kernels import F1, F2, F3, I2, kernel, OUT3, OUT4
from scenario_gen.numerics.loops import copy_to


@kernel(inline=True)
def interval_at(time: Floats, t: float) -> int:
    """Return the index k with time[k] <= t <= time[k + 1], of increasing times (T,).

    T lies between the first and last.
    """
    last = time.shape[0] - 1
    low, high = 0, last
    guess = int((t - time[0]) / (time[last] - time[0]) * last)  # exact on most even clocks
    if guess < last and time[guess] <= t <= time[guess + 1]:
        return guess
    while high - low > 1:
        middle = (low + high) // 2
        if time[middle] <= t:
            low = middle
        else:
            high = middle
    return low


@kernel(inline=True)
def cubic(p: float, v: float, q: float, w: float, h: float, u: float) -> float:
    """Return a coordinate [m] at share u of h [s], from p [m] with v [m/s] to q with w."""
    rest = 1.0 - u
    blend = u * u * (3.0 - 2.0 * u)
    return float(p + blend * (q - p) + h * u * rest * (rest * v - u * w))


@kernel(F1, F3, F2, F2, OUT4)
def control_points(
    time: Floats, position: Floats, heading: Floats, speed: Floats, out: Floats
) -> None:
    """Write the control points [m] of the same cubics in Bézier form.

    Args:
        time: (T,) seconds.
        position: (N, T, 2) metres.
        heading: (N, T) rad.
        speed: (N, T) m/s.
        out: (N, T - 1, 4, 2) four points of every vehicle in every interval.
    """
    for i in range(heading.shape[0]):
        for k in range(heading.shape[1] - 1):
            third = (time[k + 1] - time[k]) / 3.0
            from_start = third * speed[i, k]
            to_end = third * speed[i, k + 1]
            start, end = position[i, k], position[i, k + 1]
            copy_to(out[i, k, 0], start)
            out[i, k, 1, 0] = start[0] + from_start * np.cos(heading[i, k])
            out[i, k, 1, 1] = start[1] + from_start * np.sin(heading[i, k])
            out[i, k, 2, 0] = end[0] - to_end * np.cos(heading[i, k + 1])
            out[i, k, 2, 1] = end[1] - to_end * np.sin(heading[i, k + 1])
            copy_to(out[i, k, 3], end)


@kernel(F1, F3, F2, F2, I2, F1, OUT3)
def fill_states(
    time: Floats,
    position: Floats,
    heading: Floats,
    speed: Floats,
    present: Ints,
    at: Floats,
    out: Floats,
) -> None:
    """Write the state of every vehicle at each time; outside its presence its nearest state.

    Args:
        time: (T,) seconds.
        position: (N, T, 2) metres.
        heading: (N, T) rad.
        speed: (N, T) m/s.
        present: (N, 2) first and last sample of each vehicle.
        at: (M,) seconds.
        out: (N, M, 4) x, y [m], heading [rad], speed [m/s].
    """
    for i in range(out.shape[0]):
        first, last = time[present[i, 0]], time[present[i, 1]]
        for m in range(out.shape[1]):
            t = min(max(at[m], first), last)
            k = interval_at(time, t)
            h = time[k + 1] - time[k]
            u = (t - time[k]) / h
            v, w = speed[i, k], speed[i, k + 1]
            yaw, next_yaw = heading[i, k], heading[i, k + 1]
            start, end = position[i, k], position[i, k + 1]
            out[i, m, 0] = cubic(start[0], v * np.cos(yaw), end[0], w * np.cos(next_yaw), h, u)
            out[i, m, 1] = cubic(start[1], v * np.sin(yaw), end[1], w * np.sin(next_yaw), h, u)
            out[i, m, 2] = yaw + u * (next_yaw - yaw)
            out[i, m, 3] = v + u * (w - v)
