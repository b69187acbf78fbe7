# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The proposal's samples, densities and estimates, against scipy.stats."""

import numpy as np
import pytest
from scipy.stats import binomtest, kstest, multivariate_normal, norm, ortho_group

from scenario_gen.method.sampling.sampler import directions, estimated_share, Proposal

DIMENSION = 5
BASIS = ortho_group.rvs(DIMENSION, random_state=3)[:2]
MEAN, SIGMA = np.array([1.5, -0.8]), np.array([0.6, 1.3])
PROPOSAL = Proposal(BASIS, MEAN, SIGMA)
NATURAL = multivariate_normal(np.zeros(DIMENSION))
SHIFTED = multivariate_normal(
    MEAN @ BASIS, np.eye(DIMENSION) + BASIS.T @ np.diag(SIGMA**2 - 1.0) @ BASIS
)


def drawn(seed, count):
    rng = np.random.default_rng(seed)
    return PROPOSAL.transform(rng.normal(size=(count, DIMENSION)), rng.normal(size=count))


def test_weights_are_ratios_of_densities():
    z = np.concatenate((drawn(0, 500), np.random.default_rng(1).normal(size=(500, DIMENSION))))
    proposed = 0.1 * NATURAL.pdf(z) + 0.9 * SHIFTED.pdf(z)
    np.testing.assert_allclose(
        1.0 / PROPOSAL.density_ratio(z), NATURAL.pdf(z) / proposed, rtol=1e-9
    )
    np.testing.assert_allclose(PROPOSAL.density_ratio(z), proposed / NATURAL.pdf(z), rtol=1e-9)


def test_one_in_ten_is_natural():
    z = np.random.default_rng(2).normal(size=(20_000, DIMENSION))
    selector = np.random.default_rng(3).normal(size=len(z))
    samples = PROPOSAL.transform(z, selector)
    natural = (samples == z).all(axis=1)
    assert binomtest(int(natural.sum()), len(z), 0.1).pvalue > 0.01
    shifted = samples[~natural]
    for u, mean, sigma in zip((shifted @ BASIS.T).T, MEAN, SIGMA, strict=True):
        assert kstest(u, norm(mean, sigma).cdf).pvalue > 0.01
    across = np.linalg.svd(BASIS)[2][2:]
    np.testing.assert_allclose(shifted @ across.T, z[~natural] @ across.T, atol=1e-12)


def test_intervals_of_the_share_cover_it():
    """The share of natural candidates with z·b > 1.2, from 300 weighted sets of 400."""
    share = norm.sf(1.2)
    covered = 0
    for seed in range(300):
        z = drawn(seed, 400)
        weights = 1.0 / PROPOSAL.density_ratio(z[z @ BASIS[0] > 1.2])
        estimate, low, high = estimated_share(weights, len(z))
        assert low <= estimate <= high
        covered += low <= share <= high
    assert binomtest(covered, 300, 0.95).pvalue > 0.01


def test_no_hits_give_rule_of_three():
    """If none of n candidates with weights of at most ten is a hit, at most 3 × 10 / n are."""
    assert estimated_share(np.zeros(0), 600) == (0.0, 0.0, pytest.approx(0.05))
    assert estimated_share(np.zeros(0), 0)[1:] == (0.0, 1.0)


def test_directions_are_those_of_the_guides():
    rng = np.random.default_rng(4)
    z = rng.normal(size=(300, 40))
    first, second = np.zeros(40), np.zeros(40)
    first[[3, 7]], second[[7, 20]] = (3.0, 4.0), (1.0, -1.0)
    guides = np.stack((z @ first, z @ second), axis=1)
    guides[::50] = np.nan
    basis = directions(z, guides)
    np.testing.assert_allclose(basis @ basis.T, np.eye(2), atol=1e-9)
    span = np.linalg.qr(np.stack((first, second), axis=1))[0].T
    assert np.linalg.svd(basis @ span.T)[1].min() > 0.99
    assert abs(basis[0] @ first) / 5.0 > 0.99
