# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Dynamic time warping, and the paper's normalised distance matrix (V-B, Fig. 5).

Series are laid out (D, T): one row per channel, so that the inner loops run over contiguous time.
D = 2 for position (Euclidean distance), 1 for speed, where Euclidean and Manhattan are both the
absolute difference, and 1 for heading, whose difference is wrapped. A kernel takes the kind of
distance as one number, `turn`: 0 is Euclidean, infinite Manhattan, any other a circle's
circumference.
"""

from typing import Literal

import numpy as np
import numpy.typing as npt

from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Floats, wrap_angle
from scenario_gen.numerics.kernels import F, F2, F3, I, kernel, OUT1, OUT2

Distance = Literal["euclidean", "manhattan", "angle"]
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


@kernel(inline=True)
def _distances(a: Floats, i: int, b: Floats, turn: float, out: Floats) -> None:
    """Write the distance of sample i of a (D, n) to every sample of b (D, m) into out (m,)."""
    _sums(a, i, b, turn, out)
    if turn == 0.0:
        for j in range(out.size):
            out[j] = np.sqrt(out[j])


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
            _distances(a[s], first + i, b[s], turn, row)
            for j in range(m):
                value = (row[j] - low) * scale
                row[j] = 1.0 if value > 1.0 else value


@kernel(F2, F2, F, I, on_demand=True)
def _wavefront(a: Floats, b: Floats, turn: float, band: int) -> float:
    """Exact DTW by anti-diagonals, whose cells are independent; three diagonals are kept.

    Cell (i, j) of diagonal k = i + j stands at index i + 1; b is reversed, so j = k - i runs
    forward in memory with i.
    """
    channels, n = a.shape
    m = b.shape[1]
    reverse = np.empty((channels, m))
    for channel in range(channels):
        for j in range(m):
            reverse[channel, j] = b[channel, m - 1 - j]
    below, above = (
        max(0, n - m) + band,
        max(0, m - n) + band,
    )  # how far i may lead j, and j may lead i
    older, old, new = np.full(n + 2, np.inf), np.full(n + 2, np.inf), np.full(n + 2, np.inf)
    cost = np.empty(n)
    older[0] = 0.0  # the virtual cell (-1, -1)
    for k in range(n + m - 1):
        first = max(0, k - m + 1, (k - above + 1) // 2)
        last = min(n - 1, k, (k + below) // 2)
        count = last - first + 1
        for channel in range(channels):
            left = a[channel, first : last + 1]
            right = reverse[channel, m - 1 - k + first : m - k + last]
            for q in range(count):
                step = _step(left[q] - right[q], turn)
                cost[q] = step if channel == 0 else cost[q] + step
        vertical, horizontal, diagonal = (
            old[first : last + 1],
            old[first + 1 : last + 2],
            older[first : last + 1],
        )
        target = new[first + 1 : last + 2]
        for q in range(count):
            best = vertical[q] if vertical[q] < horizontal[q] else horizontal[q]
            best = diagonal[q] if diagonal[q] < best else best
            target[q] = best + (np.sqrt(cost[q]) if turn == 0.0 else cost[q])
        new[first] = new[last + 2] = np.inf  # the neighbours that the next two diagonals may read
        older, old, new = old, new, older
    return float(old[n])


def dtw_distance(
    a: npt.ArrayLike, b: npt.ArrayLike, distance: Distance = "euclidean", band: int | None = None
) -> float:
    """Exact DTW distance of two series: the least sum of distances over all monotone paths.

    Source: Sakoe & Chiba 1978; paper V-B.

    Args:
        a: (n,) or (n, D).
        b: (m,) or (m, D).
        distance: between two samples.
        band: how many samples the path may leave the corridor between the two diagonals
            (Sakoe-Chiba); None: any.

    Raises:
        InputError: an empty series, a different number of channels, a value that is not finite, or
            a negative band.
    """
    left, right = _channels(a, distance), _channels(b, distance)
    return float(_wavefront(left, right, _TURN[distance], _band(left, right, band)))


def feature_matrix(a: npt.ArrayLike, b: npt.ArrayLike, distance: Distance = "euclidean") -> Floats:
    """Return the paper's feature (n, m): distances of a (n[, D]) and b (m[, D]) in [0, 1].

    The smallest distance becomes 0 and the largest 1; if all are equal, the matrix is 0.
    """
    left, right = _channels(a, distance)[None], _channels(b, distance)[None]
    out = np.empty((1, left.shape[2] * right.shape[2]))
    _feature_rows(left, right, feature_extents(left, right, distance), _TURN[distance], 0, out)
    return out.reshape(left.shape[2], right.shape[2])


def feature_extents(a: Floats, b: Floats, distance: Distance = "euclidean") -> Floats:
    """Return the least and largest pairwise distance (S, 2) of a (S, D, n) and b (S, D, m)."""
    a, b, extents = _within(a, distance), _within(b, distance), np.empty((a.shape[0], 2))
    for s in range(a.shape[0]):
        _extent(a[s], b[s], _TURN[distance], extents[s])
    return extents


def feature_rows(
    a: Floats, b: Floats, extents: Floats, rows: range, distance: Distance = "euclidean"
) -> Floats:
    """Return rows of the feature matrices of S samples, (S, len(rows)·m), from their extents.

    A set of long encounters does not fit in memory at once, so what sums over matrices goes
    through them row by row.
    """
    out = np.empty((a.shape[0], len(rows) * b.shape[2]))
    _feature_rows(
        _within(a, distance), _within(b, distance), extents, _TURN[distance], rows.start, out
    )
    return out


def mean_feature(a: Floats, b: Floats, distance: Distance = "euclidean") -> Floats:
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


def blocks(n: int, width: int, budget: int = 400_000) -> list[range]:
    """Cut n rows of `width` numbers into ranges of at most `budget` numbers, at least one row."""
    step = max(1, budget // max(width, 1))
    return [range(first, min(n, first + step)) for first in range(0, n, step)]


def _channels(series: npt.ArrayLike, distance: Distance) -> Floats:
    """Lay a series (n,) or (n, D) out as (D, n); angles [rad] within one turn."""
    array = np.asarray(series, dtype=np.float64)
    if array.ndim not in (1, 2) or array.size == 0:
        raise InputError(
            f"a series of shape {array.shape} cannot be compared; "
            "give (samples,) or (samples, channels)"
        )
    if not np.isfinite(array).all():
        raise InputError("a series holds a value that is not finite")
    return np.ascontiguousarray(_within(array.reshape(array.shape[0], -1).T, distance))


def _within(series: Floats, distance: Distance) -> Floats:
    """Return the series; angles [rad] wrapped, for kernels take them less than a turn apart."""
    return wrap_angle(series) if distance == "angle" else series


def _band(a: Floats, b: Floats, band: int | None) -> int:
    if a.shape[0] != b.shape[0]:
        raise InputError(f"series of {a.shape[0]} and {b.shape[0]} channels cannot be compared")
    if band is not None and band < 0:
        raise InputError(f"band is {band}; it must be at least 0, or None")
    return a.shape[1] + b.shape[1] if band is None else band
