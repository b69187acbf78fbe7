# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The sampler's building blocks against plain numpy and scipy."""

from itertools import permutations

import numba
import numpy as np
from scipy.stats import kstest, norm

from scenario_gen.method.segmentation.hdp_hmm import random
from scenario_gen.method.segmentation.hdp_hmm.random import TAIL
from scenario_gen.method.segmentation.posterior import matched_labels
from scenario_gen.numerics.kernel_cache import OPTIONS


def from_python(helper):
    """A helper of kernels, compiled as they are, for calls from Python."""
    return numba.jit(helper.py_func, **OPTIONS)


normal, beyond = from_python(random.normal), from_python(random.beyond)


def test_matching_is_the_best_one():
    rng = np.random.default_rng(0)
    samples, reference = rng.integers(0, 4, (20, 60)), rng.integers(0, 4, 60)
    for row, found in zip(samples, matched_labels(samples, reference, 4), strict=True):
        assert (found == reference).sum() == max(
            (np.array(p)[row] == reference).sum() for p in permutations(range(4))
        )
        assert len({(a, b) for a, b in zip(row, found, strict=True)}) == len(set(row))


def test_normal_numbers_are_normal():
    state = np.array([11], np.uint64)
    drawn = np.array([normal(state) for _ in range(40_000)])
    assert kstest(drawn, "norm").pvalue > 0.01
    far = np.abs(np.array([beyond(state) for _ in range(4000)]))
    assert kstest(far, lambda x: 1.0 - norm.sf(x) / norm.sf(TAIL)).pvalue > 0.01
