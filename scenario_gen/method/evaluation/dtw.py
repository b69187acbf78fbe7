# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The paper's DTW features: normalised distance matrices of two series (V-B, Fig. 5).

Series are laid out (D, T): one row per channel, so that the inner loops run over contiguous time.
D = 2 for position (Euclidean distance), 1 for speed, where Euclidean and Manhattan are both the
absolute difference, and 1 for heading, whose difference is wrapped. A kernel takes the kind of
distance as one number, `turn`: 0 is Euclidean, infinite Manhattan, any other a circle's
circumference.
"""

from typing import Literal

import numpy as np

from scenario_gen.numerics import Floats, wrap_angle
from scenario_gen.numerics.kernels import F, F2, F3, I, kernel, OUT1, OUT2

Distance = Literal["euclidean", "manhattan", "angle"]
MAX_NUMBERS_COUNT = 400_000  # of feature matrices in memory at once
_TURN: dict[Distance, float] = {"euclidean": 0.0, "manhattan": np.inf, "angle": 2.0 * np.pi}


@kernel(inline=True)
def _step(difference: float, turn: float) -> float:
    """What one channel adds to a distance; angles are less than a turn apart."""
    if turn == 0.0:
        return difference * difference
    size = abs(difference)
    return min(size, turn - size)


@kernel(inline=True)
def _sums(a: Floats, i: int, b: Floats, turn: float, out: Floats) -> None:
    """Write distances of sample i of a (D, n) to all of b (D, m) to out (m,); Euclid: squares."""
    for channel in range(a.shape[0]):
        x = a[channel, i]
        row = b[channel]
        for j in range(out.size):
            step = _step(x - row[j], turn)
            out[j] = step if channel == 0 else out[j] + step


@kernel(F2, F2, F, OUT1)
def _extent(a: Floats, b: Floats, turn: float, out: Floats) -> None:
    """Write the smallest and the largest pairwise distance into out (2,), storing no matrix."""
    m = b.shape[1]
    row = np.empty(m)
    low = np.full(m, np.inf)
    high = np.zeros(m)
    for i in range(a.shape[1]):
        _sums(a, i, b, turn, row)
        for j in range(m):  # kept per column: a running scalar minimum would not vectorise
            low[j] = row[j] if row[j] < low[j] else low[j]
            high[j] = row[j] if row[j] > high[j] else high[j]
    out[0] = np.sqrt(low.min()) if turn == 0.0 else low.min()
    out[1] = np.sqrt(high.max()) if turn == 0.0 else high.max()


@kernel(F3, F3, F2, F, I, OUT2)
def _feature_rows(
    a: Floats, b: Floats, extents: Floats, turn: float, first: int, out: Floats
) -> None:
    """Write rows first, first + 1, … of each sample's normalised matrix to out (S, rows·m)."""
    m = b.shape[2]
    for s in range(a.shape[0]):
        low, high = extents[s, 0], extents[s, 1]
        scale = 1.0 / (high - low) if high > low else 0.0
        for i in range(out.shape[1] // m):
            row = out[s, i * m : (i + 1) * m]
            _sums(a[s], first + i, b[s], turn, row)
            for j in range(m):
                value = ((np.sqrt(row[j]) if turn == 0.0 else row[j]) - low) * scale
                row[j] = 1.0 if value > 1.0 else value


def feature_extents(a: Floats, b: Floats, distance: Distance) -> Floats:
    """Return the least and largest pairwise distance (S, 2) of a (S, D, n) and b (S, D, m)."""
    a, b, extents = _within(a, distance), _within(b, distance), np.empty((a.shape[0], 2))
    for s in range(a.shape[0]):
        _extent(a[s], b[s], _TURN[distance], extents[s])
    return extents


def feature_rows(a: Floats, b: Floats, extents: Floats, rows: range, distance: Distance) -> Floats:
    """Return rows of the feature matrices of S samples, (S, len(rows)·m), from their extents.

    A set of long encounters does not fit in memory at once, so what sums over matrices goes
    through them row by row.
    """
    out = np.empty((a.shape[0], len(rows) * b.shape[2]))
    _feature_rows(
        _within(a, distance), _within(b, distance), extents, _TURN[distance], rows.start, out
    )
    return out


def mean_feature(a: Floats, b: Floats, distance: Distance) -> Floats:
    """Return the mean (n, m) of the feature matrices of S samples a (S, D, n) and b (S, D, m).

    Source: paper V-B, Fig. 5.
    """
    extents = feature_extents(a, b, distance)
    n, m = a.shape[2], b.shape[2]
    mean = np.empty((n, m))
    for rows in blocks(n, a.shape[0] * m):
        mean[rows.start : rows.stop] = (
            feature_rows(a, b, extents, rows, distance).mean(axis=0).reshape(-1, m)
        )
    return mean


def blocks(n: int, width: int) -> list[range]:
    """Cut n rows of `width` numbers into ranges of at most MAX_NUMBERS_COUNT, at least one row."""
    step = max(1, MAX_NUMBERS_COUNT // max(width, 1))
    return [range(first, min(n, first + step)) for first in range(0, n, step)]


def _within(series: Floats, distance: Distance) -> Floats:
    """Return the series; angles [rad] wrapped, for kernels take them less than a turn apart."""
    return wrap_angle(series) if distance == "angle" else series
