# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The feature matrix of one pair of series, those of all pairs of vehicles, and exact DTW (paper V-B)."""

from itertools import combinations

import numpy as np
import numpy.typing as npt

from scenario_gen.method.evaluation.dtw import Distance, feature_extents, feature_rows
from scenario_gen.method.evaluation.similarity import pair_similarity, PairSimilarity
from scenario_gen.numerics import Floats
from scenario_gen.numerics.kernels import F2, I, kernel


def feature_matrix(a: npt.ArrayLike, b: npt.ArrayLike, distance: Distance = "euclidean") -> Floats:
    """Return the paper's feature (n, m): distances of a (n[, D]) and b (m[, D]) in [0, 1].

    The smallest distance becomes 0 and the largest 1; if all are equal, the matrix is 0.
    """
    left, right = _channels(a)[None], _channels(b)[None]
    extents, rows = feature_extents(left, right, distance), range(left.shape[2])
    return feature_rows(left, right, extents, rows, distance).reshape(len(rows), -1)


def pair_similarities(
    template: Floats, generated: Floats, distance: Distance
) -> list[PairSimilarity]:
    """Compare all pairs: template (N, T, D) and generated (S, N, T, D), see `pair_similarity`."""
    target, series = np.moveaxis(template, -1, -2), np.moveaxis(generated, -1, -2)
    unit = np.arange(len(series))
    return [
        pair_similarity((target[a], target[b]), (series[:, a], series[:, b]), distance, unit)
        for a, b in combinations(range(template.shape[0]), 2)
    ]


def dtw_distance(a: npt.ArrayLike, b: npt.ArrayLike, band: int | None = None) -> float:
    """Return the exact DTW distance of a (n[, D]) and b (m[, D]): the least sum of Euclidean distances over all paths.

    Source: Sakoe & Chiba 1978. `band` is how many samples a path may leave the corridor between the two diagonals; None: any.
    """
    left, right = _channels(a), _channels(b)
    return float(_wavefront(left, right, left.shape[1] + right.shape[1] if band is None else band))


def _channels(series: npt.ArrayLike) -> Floats:
    """Lay a series (n,) or (n, D) out as (D, n)."""
    array = np.asarray(series, dtype=np.float64)
    return np.ascontiguousarray(array.reshape(len(array), -1).T)


@kernel(F2, F2, I, on_demand=True)
def _wavefront(a: Floats, b: Floats, band: int) -> float:
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
                step = left[q] - right[q]
                cost[q] = step * step if channel == 0 else cost[q] + step * step
        vertical, horizontal, diagonal = (
            old[first : last + 1],
            old[first + 1 : last + 2],
            older[first : last + 1],
        )
        target = new[first + 1 : last + 2]
        for q in range(count):
            best = vertical[q] if vertical[q] < horizontal[q] else horizontal[q]
            best = diagonal[q] if diagonal[q] < best else best
            target[q] = best + np.sqrt(cost[q])
        new[first] = new[last + 2] = np.inf  # the neighbours that the next two diagonals may read
        older, old, new = old, new, older
    return float(old[n])
