# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Changepoints that know everything: the best piecewise-linear approximation of the speeds.

Constant acceleration within a primitive (paper IV-B) asks for it.
"""

import numpy as np

from scenario_gen.method.evaluation.references import with_changepoints_at
from scenario_gen.numerics import Floats, Ints
from scenario_gen.types import Encounter, Segmentation


def linear_changepoints(encounter: Encounter, segmentation: Segmentation) -> Segmentation:
    """Return as many changepoints as the segmentation has, where straight lines fit the speeds of all vehicles best."""
    places = best_linear_pieces(encounter.speed, len(segmentation.changepoints))
    return with_changepoints_at(segmentation, places, "linear piece")


def best_linear_pieces(series: Floats, count: int, shortest: int = 5) -> Ints:
    """Return the `count` changepoints of the least-squares piecewise-linear fit, by dynamic programming (Bellman 1961).

    Args:
        series: (N, T) with T >= (count + 1)·shortest; one line per channel and piece.
        count: number of changepoints.
        shortest: samples in a piece, at least.
    """
    steps = series.shape[1]
    cost = _line_costs(series)
    begin, end = np.indices(cost.shape)
    cost[end - begin < shortest] = np.inf  # piece [begin, end)
    best = cost[0].copy()  # best[e]: cost of samples before e
    origin = np.zeros((count, steps + 1), dtype=np.int64)
    for k in range(count):
        total = best[:, None] + cost
        origin[k] = total.argmin(axis=0)
        best = total.min(axis=0)
    places = [steps]
    for k in range(count - 1, -1, -1):
        places.append(int(origin[k, places[-1]]))
    return np.array(places[:0:-1], dtype=np.int64)


def _line_costs(series: Floats) -> Floats:
    """Return (T + 1, T + 1): summed squared error of the best line through samples [begin, end), from running sums."""
    steps = series.shape[1]
    x = np.arange(steps) - 0.5 * steps  # centred, or the sums of squares lose digits

    def between(values: Floats) -> Floats:
        sums = np.concatenate([[0.0], np.cumsum(values)])
        return np.asarray(sums[None, :] - sums[:, None])

    n, sx, sxx = between(np.ones(steps)), between(x), between(x * x)
    cost = np.zeros((steps + 1, steps + 1))
    with np.errstate(divide="ignore", invalid="ignore"):
        for row in series - series.mean(axis=1, keepdims=True):
            sy, sxy, syy = between(row), between(x * row), between(row * row)
            spread = sxx - sx * sx / n
            cost += (
                syy
                - sy * sy / n
                - np.where(spread > 0.0, np.square(sxy - sx * sy / n) / spread, 0.0)
            )
    return np.where(n > 0, np.maximum(cost, 0.0), np.inf)
