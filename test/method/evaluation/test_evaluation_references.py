# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Reference changepoints: evenly spaced."""

import numpy as np

from scenario_gen.method.evaluation.references import uniform_changepoints
from scenario_gen.types.segmentation import Segmentation


def test_as_many_as_the_segmenter_placed_and_evenly_spaced():
    labels = np.repeat([0, 1, 0], [11, 70, 40])
    segmentation = Segmentation(labels, np.array([11, 81]), np.zeros(121), ("a", "b", "c"))
    even = uniform_changepoints(segmentation)
    assert even.changepoints.tolist() == [40, 80] and len(even.descriptions) == 3
    assert (np.flatnonzero(np.diff(even.labels)) + 1).tolist() == [40, 80]
