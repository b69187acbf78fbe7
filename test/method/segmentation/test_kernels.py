# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The sampler's building blocks against plain numpy and scipy."""

from itertools import permutations

import numba
import numpy as np
import pytest
from scipy.special import gammaln
from scipy.stats import kstest, multivariate_normal, norm

from scenario_gen.method.segmentation.hdp_hmm import emission, observed, random
from scenario_gen.method.segmentation.hdp_hmm.config import SamplerConfig
from scenario_gen.method.segmentation.hdp_hmm.emission import BLOCK
from scenario_gen.method.segmentation.hdp_hmm.model import States
from scenario_gen.method.segmentation.hdp_hmm.problem import new_top, Place, Prior, Problem
from scenario_gen.method.segmentation.hdp_hmm.random import TAIL
from scenario_gen.method.segmentation.posterior import matched_labels
from scenario_gen.numerics.kernels import OPTIONS


def from_python(helper):
    """A helper of kernels, compiled as they are, for calls from Python."""
    return numba.jit(helper.py_func, **OPTIONS)


block_log_likelihood, block_likelihood = from_python(emission.block_log_likelihood), from_python(emission.block_likelihood)
log_gammas, observed_log_likelihood = from_python(emission.log_gammas), from_python(observed.observed_log_likelihood)
normal, beyond = from_python(random.normal), from_python(random.beyond)


def test_matching_is_the_best_one():
    rng = np.random.default_rng(0)
    samples, reference = rng.integers(0, 4, (20, 60)), rng.integers(0, 4, 60)
    for row, found in zip(samples, matched_labels(samples, reference, 4), strict=True):
        assert (found == reference).sum() == max((np.array(p)[row] == reference).sum() for p in permutations(range(4)))
        assert len({(a, b) for a, b in zip(row, found, strict=True)}) == len(set(row))


def test_likelihood_of_a_block():
    rng = np.random.default_rng(1)
    states, d, n = 5, 7, 50
    vt = np.vstack([np.ones(n), rng.normal(size=(d, n)) * 4.0])
    coef = rng.normal(size=(states, d, d + 1)) * np.tri(d, d + 1, 1)
    shape = np.column_stack([rng.normal(size=states), rng.uniform(size=states)])
    logs, row, work, out = np.empty((states, BLOCK)), np.empty(BLOCK), np.empty((2, BLOCK)), np.empty((n, states))
    squares = ((coef @ vt) ** 2).sum(axis=1) + shape[:, 1:]
    block_log_likelihood(vt, 0, n, States(coef, shape), 0.5, 3.0, logs, row)
    student = 0.5 * shape[:, :1] - 0.5 * (3.0 + 0.5 * d) * np.log1p(0.5 * squares / 3.0)
    np.testing.assert_allclose(logs[:, :n], student, rtol=1e-12)
    block_log_likelihood(vt, 0, n, States(coef, shape), 0.5, 0.0, logs, row)
    truth = 0.5 * (shape[:, :1] - 0.5 * squares)
    np.testing.assert_allclose(logs[:, :n], truth, rtol=1e-12)
    block_likelihood(logs, n, row, work, out)
    below = (truth - truth.max(axis=0)).T
    np.testing.assert_allclose(out, np.where(below > -300.0, np.exp(below), 0.0), rtol=1e-11)


def test_likelihood_of_the_observed_channels_is_the_marginal():
    rng = np.random.default_rng(6)
    d, hidden = 4, np.array([True, False, True, False])
    coef = np.tril(rng.normal(size=(d, d + 1)), 1)
    coef[np.arange(d), np.arange(1, d + 1)] += 3.0
    whitening = coef[:, 1:]
    mean, covariance = np.linalg.solve(whitening, -coef[:, 0]), np.linalg.inv(whitening.T @ whitening)
    y, out = rng.normal(size=d), np.empty(1)
    shape = np.array([[np.log(np.diag(whitening)).sum(), 0.0]])
    v = np.concatenate([[1.0], np.where(hidden, 1e3, y)])
    observed_log_likelihood(v, hidden, coef[None], shape, 1.0, 0.0, out)
    seen = ~hidden
    truth = multivariate_normal(mean[seen], covariance[np.ix_(seen, seen)]).logpdf(y[seen]) + 0.5 * seen.sum() * np.log(
        2.0 * np.pi
    )
    assert out[0] == pytest.approx(truth)


def test_a_chain_goes_on_from_the_labels_it_ended_with():
    """Also after a single sweep: renumbered, they would no longer belong to the β that goes with them."""
    x = np.random.default_rng(5).normal(size=(60, 2))
    config, ends = SamplerConfig(), np.array([60])
    problem = Problem.build(x, ends, config, np.zeros(2))
    start = Place(np.repeat([2, 5], 30), problem.observed)
    place, _, samples, _ = problem.run(config, Prior(np.eye(2), 25.0, 0.1), start, new_top(8), 0, 1, 3)
    np.testing.assert_array_equal(place.labels, samples[-1])


def test_normal_numbers_are_normal_also_far_out():
    state = np.array([11], np.uint64)
    drawn = np.array([normal(state) for _ in range(40_000)])
    assert kstest(drawn, "norm").pvalue > 0.01
    far = np.abs(np.array([beyond(state) for _ in range(4000)]))
    assert kstest(far, lambda x: 1.0 - norm.sf(x) / norm.sf(TAIL)).pvalue > 0.01


def test_log_gammas_are_those_of_scipy():
    for a, d in ((3.0, 1), (5.0, 6), (200.0, 24), (150.0, 200)):
        assert log_gammas(a, d) == pytest.approx(gammaln(a - 0.5 * np.arange(d)).sum(), rel=1e-13)
