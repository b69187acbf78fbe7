# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Assignment, against scipy: the same partners, also where several sets of them share as much."""

from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
from scipy.optimize import linear_sum_assignment

from scenario_gen.method.segmentation.assignment import best_partners

TABLES = st.integers(1, 9).flatmap(lambda n: arrays(np.int64, (n, n), elements=st.one_of(st.just(0), st.integers(0, 40))))


@given(TABLES)
def test_the_partners_are_those_of_scipy(shared):
    assert best_partners(shared) == linear_sum_assignment(shared, maximize=True)[1].tolist()
