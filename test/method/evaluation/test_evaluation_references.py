# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Reference changepoints: evenly spaced, and the best piecewise-linear fit."""

import numpy as np

from benchmarks._linear_pieces import best_linear_pieces
from scenario_gen.method.evaluation.references import uniform_changepoints
from scenario_gen.types.segmentation import Segmentation


def test_as_many_as_the_segmenter_placed_and_the_best_ones():
    labels = np.repeat([0, 1, 0], [11, 70, 40])
    segmentation = Segmentation(labels, np.array([11, 81]), np.zeros(121), ("a", "b", "c"))
    even = uniform_changepoints(segmentation)
    assert even.changepoints.tolist() == [40, 80] and len(even.descriptions) == 3
    assert (np.flatnonzero(np.diff(even.labels)) + 1).tolist() == [40, 80]
    speed = np.stack(
        [np.interp(np.arange(121.0), [0, 30, 70, 120], [0, 15, 15, 2]), np.full(121, 4.0)]
    )
    assert np.abs(best_linear_pieces(speed, 2) - [30, 70]).max() <= 1  # corners are found
