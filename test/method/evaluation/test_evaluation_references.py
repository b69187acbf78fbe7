# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Reference changepoints: evenly spaced, and the best piecewise-linear fit."""

from itertools import combinations, pairwise

from evaluation_worlds import crossing
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np

from scenario_gen.method.evaluation.references import best_linear_pieces, linear_changepoints, uniform_changepoints
from scenario_gen.types.segmentation import Segmentation


def cost_of(series, places):
    bounds = [0, *places, series.shape[1]]
    total = 0.0
    for first, last in pairwise(bounds):
        x = np.arange(first, last)
        for row in series[:, first:last]:
            total += float(((row - np.polyval(np.polyfit(x, row, 1), x)) ** 2).sum())
    return total


@settings(max_examples=25)
@given(st.integers(0, 10_000), st.integers(1, 2))
def test_no_other_pieces_fit_better(seed, count):
    series = np.random.default_rng(seed).normal(size=(2, 16)).cumsum(axis=1)
    found = best_linear_pieces(series, count, shortest=3)
    fair = [
        places
        for places in combinations(range(3, 14), count)
        if all(b - a >= 3 for a, b in zip((0, *places), (*places, 16), strict=True))
    ]
    best = min(cost_of(series, places) for places in fair)
    assert abs(cost_of(series, found) - best) < 1e-9


def test_corners_are_found():
    time = np.arange(100.0)
    speed = np.stack([np.interp(time, [0, 30, 70, 99], [0, 15, 15, 2]), np.full(100, 4.0)])
    assert np.abs(best_linear_pieces(speed, 2) - [30, 70]).max() <= 1


def test_as_many_as_the_segmenter_placed():
    labels = np.repeat([0, 1, 0], [11, 70, 40])
    segmentation = Segmentation(labels, np.array([11, 81]), np.zeros(121), ("a", "b", "c"))
    even = uniform_changepoints(segmentation)
    assert even.changepoints.tolist() == [40, 80] and len(even.descriptions) == 3
    assert (np.flatnonzero(np.diff(even.labels)) + 1).tolist() == [40, 80]
    assert len(linear_changepoints(crossing(), segmentation).changepoints) == 2
