# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Connected parts of a grid, against scipy."""

from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
import numpy as np
from scipy.ndimage import label

from scenario_gen.roads.labels import labelled, small_parts


@given(arrays(np.bool_, array_shapes(min_dims=2, max_dims=2, max_side=14), elements=st.booleans()))
def test_parts_and_their_numbers_are_those_of_scipy(free):
    np.testing.assert_array_equal(labelled(free), label(free)[0])


@given(arrays(np.bool_, array_shapes(min_dims=2, max_dims=2, max_side=14), elements=st.booleans()), st.integers(0, 9))
def test_small_parts_are_those_of_few_cells(free, most):
    number = label(free)[0]
    np.testing.assert_array_equal(small_parts(free, most), free & (np.bincount(number.ravel()) <= most)[number])


def test_a_spiral_is_one_part():
    free = np.ones((61, 61), dtype=np.bool_)
    free[1:-1:2] = False
    free[1:-1:4, -1] = free[3:-1:4, 0] = True
    assert labelled(free).max() == 1
    np.testing.assert_array_equal(labelled(free), label(free)[0])
