# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Anchors matched to the points of a curve, in their order."""

import numpy as np

from scenario_gen.numerics import Floats, Ints


def squared_distances(rows: Floats, columns: Floats) -> Floats:
    """Return the squared distances (A, M) [m²] of points (A, 2) from others (M, 2)."""
    squares = np.zeros((len(rows), len(columns)))
    for axis in (0, 1):  # a long drive has many points: no array (A, M, 2)
        squares += np.square(rows[:, axis, None] - columns[None, :, axis])
    return squares


def monotone_matching(cost: Floats) -> Ints:
    """Match rows of `cost` (A, M) to non-decreasing columns at the least total cost: (A,) columns.

    Source: dynamic programming (Bellman 1957).
    """
    total = cost[0]
    previous = np.empty(cost.shape, dtype=np.int32)
    for k in range(1, len(cost)):
        lowest = np.minimum.accumulate(total)
        is_lower = np.concatenate(([True], total[1:] < lowest[:-1]))
        previous[k] = np.maximum.accumulate(np.where(is_lower, np.arange(len(total)), 0))
        total = lowest + cost[k]
    column = np.empty(len(cost), dtype=np.int64)
    column[-1] = np.argmin(total)
    for k in range(len(cost) - 1, 0, -1):
        column[k - 1] = previous[k, column[k]]
    return column
