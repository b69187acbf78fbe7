# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The gap of two motions in space and time: how close vehicles are to one place at one time."""

import numpy as np
from scipy.spatial.distance import cdist

from scenario_gen.numerics import Floats
from scenario_gen.numerics.kernels import F2, kernel

GAP_RATE_MPS = 2.0
"""Metres of the gap per second between two vehicles at one place."""

INTERACTS_M = 6.0
"""Gap up to which two vehicles interact."""

_CHORD_S = 0.3  # of straight and steady motion: at 4 m/s² lateral acceleration, 5 cm off
_MAX_POINT_COUNT = 200  # of a path whose heights are compared
_SAME_PLACE_M = 2.0
_GOLDEN_RATIO = 0.6180339887498949


def space_time_gap(a: Floats, b: Floats, dt: float) -> tuple[float, int, int]:
    """Return min over t, t' of |a(t) - b(t')| + 2 m/s |t - t'| [m], and the nearest samples.

    A vehicle that follows another on its path, s seconds behind, has a gap of 2 s [m] or less at
    any speed.

    Args:
        a: (T, 2) positions [m], T at least 2.
        b: (T, 2) positions at the same times.
        dt: seconds between two samples.
    """
    step = max(round(_CHORD_S / dt), 1)
    ends = np.append(np.arange(0, len(a) - 1, step), len(a) - 1)
    gap, time_a, time_b = _least_gap(_chords(a[ends], ends * dt), _chords(b[ends], ends * dt))
    return float(gap), round(time_a / dt), round(time_b / dt)


def _chords(places: Floats, times: Floats) -> Floats:
    """Return straight motions between places (K, 2) [m] at times (K,) [s].

    Columns: start (x, y), velocity (x, y), start and end time, half the length.
    """
    step = np.diff(places, axis=0)
    seconds = np.diff(times)
    half_length = 0.5 * np.hypot(step[:, 0], step[:, 1])
    return np.column_stack(
        [places[:-1], step / seconds[:, None], times[:-1], times[1:], half_length]
    )


@kernel(F2, F2)
def _least_gap(chords_a: Floats, chords_b: Floats) -> tuple[float, float, float]:
    """Return the least gap [m] of two chains of chords, and its times [s]."""
    least = np.inf
    least_a = 0.0
    least_b = 0.0
    for m in range(len(chords_a)):
        for n in range(len(chords_b)):
            if _lower_bound(chords_a[m], chords_b[n]) >= least:
                continue
            gap, time_a, time_b = _chord_gap(chords_a[m], chords_b[n])
            if gap < least:
                least = gap
                least_a = time_a
                least_b = time_b
    return least, least_a, least_b


@kernel(inline=True)
def _chord_gap(a: Floats, b: Floats) -> tuple[float, float, float]:
    """Return the gap [m] of two chords, and its times [s]: it is convex along the first one."""
    low = a[4]
    high = a[5]
    first = high - _GOLDEN_RATIO * (high - low)
    second = low + _GOLDEN_RATIO * (high - low)
    first_gap = _gap_to_chord(a, first, b)[0]
    second_gap = _gap_to_chord(a, second, b)[0]
    for _ in range(10):  # golden section: a chord at 40 m/s shrinks to 10 cm
        if first_gap <= second_gap:
            high = second
            second = first
            second_gap = first_gap
            first = high - _GOLDEN_RATIO * (high - low)
            first_gap = _gap_to_chord(a, first, b)[0]
        else:
            low = first
            first = second
            first_gap = second_gap
            second = low + _GOLDEN_RATIO * (high - low)
            second_gap = _gap_to_chord(a, second, b)[0]
    least = np.inf
    least_a = 0.0
    least_b = 0.0
    for time_a in (low, first, second, high):
        gap, time_b = _gap_to_chord(a, time_a, b)
        if gap < least:
            least = gap
            least_a = time_a
            least_b = time_b
    return least, least_a, least_b


@kernel(inline=True)
def _lower_bound(a: Floats, b: Floats) -> float:
    """Return a lower bound of the gap of two chords [m]: by centres, lengths and times."""
    half_a = 0.5 * (a[5] - a[4])
    half_b = 0.5 * (b[5] - b[4])
    x = a[0] + half_a * a[2] - b[0] - half_b * b[2]
    y = a[1] + half_a * a[3] - b[1] - half_b * b[3]
    distance: float = max(np.sqrt(x * x + y * y) - a[6] - b[6], 0.0)
    seconds: float = max(a[4] - b[5], b[4] - a[5], 0.0)
    return distance + GAP_RATE_MPS * seconds


@kernel(inline=True)
def _gap_to_chord(a: Floats, time_a: float, b: Floats) -> tuple[float, float]:
    """Return the gap [m] of one motion at a time [s] to a chord of the other, and its time [s]."""
    dx = a[0] + (time_a - a[4]) * a[2] - b[0]
    dy = a[1] + (time_a - a[4]) * a[3] - b[1]
    vx = b[2]
    vy = b[3]
    speed = np.sqrt(vx * vx + vy * vy)
    time_b = time_a
    if speed > GAP_RATE_MPS:  # a slower vehicle is nearest at the same time
        foot = b[4] + (dx * vx + dy * vy) / (speed * speed)
        lateral = abs(dx * vy - dy * vx) / speed
        reach = GAP_RATE_MPS * lateral / (speed * np.sqrt(speed * speed - GAP_RATE_MPS**2))
        time_b = min(max(time_a, foot - reach), foot + reach)
    time_b = min(max(time_b, b[4]), b[5])
    dx = dx - vx * (time_b - b[4])
    dy = dy - vy * (time_b - b[4])
    return np.sqrt(dx * dx + dy * dy) + GAP_RATE_MPS * abs(time_a - time_b), time_b


def height_apart(a: Floats, a_height: Floats | None, b: Floats, b_height: Floats | None) -> float:
    """Return how far two paths (T, 2) [m] differ in height (T,) where they are nearest; else 0."""
    if a_height is None or b_height is None:
        return 0.0
    first, second = (max(len(path) // _MAX_POINT_COUNT, 1) for path in (a, b))
    distance = cdist(a[::first], b[::second])
    nearest = distance <= distance.min() + _SAME_PLACE_M
    difference = np.abs(a_height[::first][:, None] - b_height[::second][None])
    return float(np.median(difference[nearest]))
