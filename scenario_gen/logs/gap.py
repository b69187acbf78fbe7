# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The gap of two motions in place and time: how nearly two vehicles are at one place at one time."""

import numpy as np

from scenario_gen.numerics import Floats
from scenario_gen.numerics.kernels import F2, kernel

METRES_PER_SECOND_APART = 2.0  # of the time between two vehicles at one place
INTERACTS_M = 6.0  # the gap up to which two vehicles interact
CHORD_S = 0.3  # a motion is taken as straight and steady over so long: at 4 m/s² across, 5 cm off
STEPS = 10  # of the search along a chord: each leaves 62 %, in all 10 cm of a chord at 40 m/s
GOLDEN = 0.6180339887498949


def space_time_gap(a: Floats, b: Floats, dt: float) -> tuple[float, int, int]:
    """Return min over t, t' of |a(t) - b(t')| + 2 m/s |t - t'| [m], and the samples nearest to t and t'.

    A vehicle that follows another on its path, s seconds behind, has a gap of 2 s [m] or less at any speed.

    Args:
        a: (T, 2) positions [m], T at least 2.
        b: (T, 2) positions at the same times.
        dt: s between two samples.
    """
    ends = np.append(np.arange(0, len(a) - 1, max(round(CHORD_S / dt), 1)), len(a) - 1)
    gap, when, then = _least_gap(_chords(a[ends], ends * dt), _chords(b[ends], ends * dt))
    return float(gap), round(when / dt), round(then / dt)


def _chords(places: Floats, times: Floats) -> Floats:
    """Straight motions between places (K, 2) [m] at times (K,) [s]: begin and velocity (x, y), from when to when, half length."""
    step, seconds = np.diff(places, axis=0), np.diff(times)
    half = 0.5 * np.hypot(step[:, 0], step[:, 1])
    return np.column_stack([places[:-1], step / seconds[:, None], times[:-1], times[1:], half])


@kernel(F2, F2)
def _least_gap(one: Floats, other: Floats) -> tuple[float, float, float]:
    """The least gap [m] of two chains of chords, and the times of it [s]."""
    least, when, then = np.inf, 0.0, 0.0
    for m in range(len(one)):
        for n in range(len(other)):
            if _at_least(one[m], other[n]) >= least:
                continue
            low, high = one[m, 4], one[m, 5]  # the gap to the other chord is convex between them
            first, second = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
            gap, later = (
                _gap_to_chord(one[m], first, other[n])[0],
                _gap_to_chord(one[m], second, other[n])[0],
            )
            for _ in range(STEPS):
                if gap <= later:
                    high, second, later = second, first, gap
                    first = high - GOLDEN * (high - low)
                    gap = _gap_to_chord(one[m], first, other[n])[0]
                else:
                    low, first, gap = first, second, later
                    second = low + GOLDEN * (high - low)
                    later = _gap_to_chord(one[m], second, other[n])[0]
            for time in (low, first, second, high):
                gap, its = _gap_to_chord(one[m], time, other[n])
                if gap < least:
                    least, when, then = gap, time, its
    return least, when, then


@kernel(inline=True)
def _at_least(one: Floats, other: Floats) -> float:
    """A lower bound of the gap of two chords [m]: by their middles, their lengths and the time between them."""
    mine, its = 0.5 * (one[5] - one[4]), 0.5 * (other[5] - other[4])
    x = one[0] + mine * one[2] - other[0] - its * other[2]
    y = one[1] + mine * one[3] - other[1] - its * other[3]
    apart: float = max(np.sqrt(x * x + y * y) - one[6] - other[6], 0.0)
    seconds: float = max(one[4] - other[5], other[4] - one[5], 0.0)
    return apart + METRES_PER_SECOND_APART * seconds


@kernel(inline=True)
def _gap_to_chord(one: Floats, time: float, other: Floats) -> tuple[float, float]:
    """The least gap [m] of one motion at a time [s] to a chord of the other, and the time on that [s]."""
    dx, dy = (
        one[0] + (time - one[4]) * one[2] - other[0],
        one[1] + (time - one[4]) * one[3] - other[1],
    )
    vx, vy = other[2], other[3]
    speed, then = np.sqrt(vx * vx + vy * vy), time
    if speed > METRES_PER_SECOND_APART:  # else it pays nowhere to be at another time
        foot = other[4] + (dx * vx + dy * vy) / (speed * speed)
        aside = abs(dx * vy - dy * vx) / speed
        off = (
            METRES_PER_SECOND_APART
            * aside
            / (speed * np.sqrt(speed * speed - METRES_PER_SECOND_APART**2))
        )
        then = min(max(time, foot - off), foot + off)
    then = min(max(then, other[4]), other[5])
    dx, dy = dx - vx * (then - other[4]), dy - vy * (then - other[4])
    return np.sqrt(dx * dx + dy * dy) + METRES_PER_SECOND_APART * abs(time - then), then
