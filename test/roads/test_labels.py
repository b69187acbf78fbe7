# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Connected parts of a grid, against scipy."""

from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
import numpy as np
from scipy.ndimage import label

from scenario_gen.roads.labels import labelled


@given(arrays(np.bool_, array_shapes(min_dims=2, max_dims=2, max_side=14), elements=st.booleans()))
def test_parts_and_their_numbers_are_those_of_scipy(free):
    np.testing.assert_array_equal(labelled(free), label(free)[0])


def test_a_spiral_is_one_part():
    free = np.ones((61, 61), dtype=np.bool_)
    free[1:-1:2] = False
    free[1:-1:4, -1] = free[3:-1:4, 0] = True
    assert labelled(free).max() == 1
    np.testing.assert_array_equal(labelled(free), label(free)[0])
