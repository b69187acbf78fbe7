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

"""Assignment, against scipy: the same partners, also where several sets of them share as much."""

from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
from scipy.optimize import linear_sum_assignment

from scenario_gen.segmentation.assignment import best_partners

TABLES = st.integers(1, 9).flatmap(lambda n: arrays(np.int64, (n, n), elements=st.one_of(st.just(0), st.integers(0, 40))))


@given(TABLES)
def test_the_partners_are_those_of_scipy(shared):
    assert best_partners(shared) == linear_sum_assignment(shared, maximize=True)[1].tolist()
