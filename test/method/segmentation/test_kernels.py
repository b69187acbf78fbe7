# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The sampler's building blocks against plain numpy and scipy."""

from itertools import permutations

import numba
import numpy as np
import pytest
from scipy.special import gammainccinv, gammaln
from scipy.stats import kstest, multivariate_normal, norm

from scenario_gen.method.segmentation.hdp_hmm import chain, emission, observed, random
from scenario_gen.method.segmentation.hdp_hmm.config import SamplerConfig
from scenario_gen.method.segmentation.hdp_hmm.emission import BLOCK
from scenario_gen.method.segmentation.hdp_hmm.model import States
from scenario_gen.method.segmentation.hdp_hmm.problem import moving_mean, new_top, Place, Prior, Problem, unexplained
from scenario_gen.method.segmentation.hdp_hmm.random import TAIL
from scenario_gen.method.segmentation.hdp_hmm.start import kmeans
from scenario_gen.method.segmentation.posterior import matched_labels
from scenario_gen.method.segmentation.trends import chi2_above
from scenario_gen.numerics.kernels import OPTIONS


def from_python(helper):
    """A helper of kernels, compiled as they are, for calls from Python."""
    return numba.jit(helper.py_func, **OPTIONS)


block_log_likelihood, block_likelihood = from_python(emission.block_log_likelihood), from_python(emission.block_likelihood)
accumulate, log_gammas = from_python(emission.accumulate), from_python(emission.log_gammas)
observed_log_likelihood, update_outer = from_python(observed.observed_log_likelihood), from_python(chain.update_outer)
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


def test_statistics_follow_the_labels():
    rng = np.random.default_rng(2)
    v, before, mass = rng.normal(size=(60, 3)), rng.integers(0, 4, 60), rng.uniform(0.5, 2.0, 60)
    mass[7] = 0.0
    outer, sums = np.zeros((5, 3, 3)), np.zeros((5, 2))
    accumulate(v, before, mass, outer, sums)
    labels = rng.integers(1, 5, 60)
    update_outer(v, before, labels, mass, outer, sums)
    np.testing.assert_allclose(sums[:, 1], np.bincount(labels, mass, minlength=5), atol=1e-12)
    np.testing.assert_array_equal(sums[:, 0], np.bincount(labels[mass > 0.0], minlength=5))
    for k in range(5):
        own = v[labels == k]
        np.testing.assert_allclose(np.tril(outer[k]), np.tril((own.T * mass[labels == k]) @ own), atol=1e-12)


def test_residuals_of_regressions():
    rng = np.random.default_rng(3)
    z, y, labels = np.column_stack([np.ones(80), rng.normal(size=(80, 2))]), rng.normal(size=(80, 2)), rng.integers(0, 3, 80)
    precision, residual, scatter, squares = np.eye(3) * 0.3, np.empty((80, 2)), np.empty((2, 2)), np.empty(80)
    g0 = np.block([[precision, np.zeros((3, 2))], [np.zeros((2, 3)), np.eye(2)]])
    unexplained(np.hstack([z, y]), np.ones(80), labels, g0, 3, residual, scatter, squares)
    for k in range(3):
        own = labels == k
        fit = np.linalg.solve(z[own].T @ z[own] + precision, z[own].T @ y[own])
        np.testing.assert_allclose(residual[own], y[own] - z[own] @ fit, atol=1e-12)
    np.testing.assert_allclose(scatter, residual.T @ residual, atol=1e-12)


def test_kmeans_finds_what_is_far_apart():
    rng = np.random.default_rng(4)
    truth = np.repeat([0, 1, 2], 40)
    x = rng.normal(size=(120, 2)) + np.array([[0.0, 0.0], [30.0, 0.0], [0.0, 30.0]])[truth]
    centres, labels = np.empty((2, 3)), np.empty(120, np.int64)
    kmeans(x, 7, 10, centres, labels)
    assert len({(a, b) for a, b in zip(truth, labels, strict=True)}) == 3
    np.testing.assert_allclose(centres[:, labels[0]], x[:40].mean(axis=0))
    kmeans(np.ones((6, 1)), 7, 10, np.empty((1, 3)), np.empty(6, np.int64))


@pytest.mark.parametrize("width", [1, 4, 5])
def test_moving_mean(width):
    x = np.arange(12.0) ** 2
    padded = np.concatenate([np.full(width, x[0]), x, np.full(width, x[-1])])
    truth = [padded[t + width - width // 2 : t + 2 * width - width // 2].mean() for t in range(12)]
    np.testing.assert_allclose(moving_mean(x, width), truth)
    np.testing.assert_allclose(moving_mean(np.column_stack([x, -x]), width)[:, 1], -np.array(truth))


@pytest.mark.parametrize(("degrees", "chance"), [(2, 1e-6), (4, 1e-4), (16, 0.3), (48, 1e-9)])
def test_chi_squared_quantile(degrees, chance):
    assert chi2_above(degrees, chance) == pytest.approx(2.0 * gammainccinv(degrees / 2.0, chance), rel=1e-9)


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
