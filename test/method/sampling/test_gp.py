# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Gaussian-process regression against the textbook formulas in dense float64, and against its own samples."""

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
import scipy.linalg

from benchmarks._paper_chain import ordinate_posterior, ordinate_samples
from scenario_gen.base.errors import InputError
from scenario_gen.method.sampling.gp import (
    Features,
    Observations,
    principal,
    Regression,
    squared_exponential,
)


def dense(x, y, noise, at, sigma, length, degree):
    """Rasmussen & Williams eqs 2.25, 2.26 and, with a fitted mean, 2.41 and 2.42."""
    k = squared_exponential(x, x, sigma, length) + np.diag(noise**2)
    cross = squared_exponential(x, at, sigma, length)
    prior = squared_exponential(at, at, sigma, length)
    factor = scipy.linalg.cho_factor(k)

    def solve(b):
        return scipy.linalg.cho_solve(factor, b)

    mean, cov = cross.T @ solve(y), prior - cross.T @ solve(cross)
    if degree < 0:
        return mean, cov
    middle, half = 0.5 * (x.max() + x.min()), 0.5 * (x.max() - x.min())
    h, h_at = (np.vander((v - middle) / half, degree + 1).T for v in (x, at))
    a = h @ solve(h.T)
    beta = np.linalg.solve(a, h @ solve(y))
    r = h_at - h @ solve(cross)
    return h_at.T @ beta + cross.T @ solve(y - h.T @ beta), cov + r.T @ np.linalg.solve(a, r)


def data(n, high, seed=0):
    rng = np.random.default_rng(seed)
    x = np.linspace(0.0, high, n) + np.r_[0.0, rng.uniform(-0.3, 0.3, n - 2), 0.0] * high / n
    return x, 50.0 * np.sin(x / 100.0) + 0.1 * x + rng.normal(0.0, 5.0, n)


@settings(max_examples=25)
@given(
    n=st.integers(6, 20),
    ratio=st.floats(0.5, 20.0),
    noise=st.floats(0.05, 2.0),
    degree=st.integers(-1, 3),
)
def test_agrees_with_dense_reference_everywhere(n, ratio, noise, degree):
    x, y = data(n, 100.0, n)
    sigmas = np.full(n, noise)
    sigmas[[0, -1]] = 0.0
    at = np.linspace(0.0, 100.0, 57)
    y = y / np.abs(y).max()
    posterior = Regression(
        Features(0.0, 100.0, 1.0, 100.0 / ratio, degree), Observations(x, y, sigmas)
    ).predict(at)
    mean, cov = dense(x, y, sigmas, at, 1.0, 100.0 / ratio, degree)
    assert np.abs(posterior.mean - mean).max() < 1e-10
    assert np.abs(posterior.covariance - cov).max() < 1e-10


@pytest.mark.parametrize("ratio", [0.3, 1.0, 7.0, 30.0, 100.0])
def test_features_carry_the_kernel(ratio):
    x = np.linspace(2.0, 2.0 + ratio, 300)
    phi = Features(2.0, 2.0 + ratio, 1.0, 1.0)(x)
    assert np.abs(phi @ phi.T - squared_exponential(x, x, 1.0, 1.0)).max() < 1e-9


def test_value_and_slope_are_exact():
    x = np.array([0.0, 40.0, 0.0, 40.0, 20.0])
    seen = Observations(x, np.zeros(5), np.array([0.0, 0.0, 0.0, 0.0, 0.3]), (0, 0, 1, 1, 0))
    regression = Regression(Features(0.0, 40.0, 0.3, 15.0), seen)
    step = 1e-4
    z = np.random.default_rng(0).standard_normal((100, regression.predict(x).factor.shape[1]))
    ends = regression.predict(np.array([0.0, step, 40.0 - step, 40.0])).sample(z)
    assert np.abs(ends[:, [0, 3]]).max() < 1e-12
    assert np.abs(ends[:, 1] / step).max() < 1e-4
    assert np.abs(ends[:, 2] / step).max() < 1e-4
    assert regression.predict(np.array([10.0])).factor.std() > 0.0


def test_derivative_of_features_is_their_rate():
    features = Features(0.0, 50.0, 2.0, 10.0, 3)
    x, step = np.linspace(1.0, 49.0, 20), 1e-5
    assert np.allclose(
        features(x, 1), (features(x + step) - features(x - step)) / (2 * step), atol=1e-7
    )


def test_samples_have_posterior_moments():
    anchors = np.array(
        [[0.0, 100.0], [200.0, 180.0], [450.0, 120.0], [700.0, 300.0], [1000.0, 260.0]]
    )
    x = np.array([0.0, 120.0, 330.0, 500.0, 610.0, 900.0, 1000.0])
    posterior = ordinate_posterior(anchors, x)
    drawn = ordinate_samples(anchors, x, 100_000, seed=3)
    spread = np.sqrt(np.diag(posterior.covariance))
    assert np.abs(drawn.mean(axis=0) - posterior.mean).max() < 5.0 * spread.max() / np.sqrt(
        100_000
    )
    bound = 5.0 * np.sqrt((np.outer(spread**2, spread**2) + posterior.covariance**2) / 100_000)
    assert (np.abs(np.cov(drawn.T) - posterior.covariance) <= bound + 1e-9).all()
    assert (
        (drawn[:, [0, -1]] == pytest.approx(anchors[[0, -1], 1]))
        if drawn.ndim == 1
        else np.allclose(drawn[:, [0, -1]], anchors[[0, -1], 1], atol=1e-9)
    )


def test_ordinate_form_is_exact_at_ends():
    anchors = np.array([[10.0, 3.0], [60.0, 9.0]])
    posterior = ordinate_posterior(anchors, np.array([10.0, 35.0, 60.0]))
    assert posterior.mean[[0, 2]] == pytest.approx([3.0, 9.0])
    assert np.diag(posterior.covariance)[[0, 2]] == pytest.approx([0.0, 0.0], abs=1e-18)
    assert posterior.covariance[1, 1] > 0.1


def test_contradicting_exact_observations():
    with pytest.raises(InputError, match="repeat or contradict"):
        Regression(
            Features(0.0, 10.0, 1.0, 3.0),
            Observations(np.array([1.0, 1.0]), np.array([0.0, 1.0]), np.zeros(2)),
        )


@pytest.mark.parametrize("last", [0.977e-6, 1.002e-6, 1e-9])
def test_directions_do_not_depend_on_rounding(last):
    """A direction of a millionth is noise of the factorisation; it may not number the others."""
    rng = np.random.default_rng(2)
    directions, _ = np.linalg.qr(rng.normal(size=(40, 4)))
    basis, _ = np.linalg.qr(rng.normal(size=(4, 4)))
    factor = directions * np.array([2.0, 0.5, 0.01, last])
    root = principal(factor)
    assert root.shape == (40, 3)
    np.testing.assert_allclose(principal(factor @ basis), root, atol=1e-12)
    np.testing.assert_allclose(root @ root.T, factor @ factor.T, atol=1e-11)
