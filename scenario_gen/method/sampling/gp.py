# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Gaussian-process regression with a squared-exponential kernel (paper III-C, eqs 11-15).

The model is f(x) = h(x)ᵀβ + g(x), g ~ GP(0, k), with the squared exponential k of eq 14 and
h(x) = (1, x, …, x^p). The coefficients β have a flat prior and are inferred with the rest, so
their uncertainty is part of the covariance (Rasmussen & Williams, Gaussian Processes for Machine
Learning, §2.7).

On an interval the kernel has a low numerical rank: k(x, x') = φ(x)ᵀφ(x') to rounding, with φ built
from r Chebyshev nodes. Regression is then least squares in r + p + 1 weights. Observations without
noise are equality constraints, eliminated by an orthonormal basis of their null space; the rest is
one QR factorisation. No jitter is needed: mean and covariance agree with a dense reference to
rounding, at a cost of O(n r² + m r S).
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev, legendre
from scipy import linalg

from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Floats

_RANK_RATIO = 1e-15  # of the largest variance: smaller ones are rounding
_CARRIES_RATIO = 1e-4  # of the largest standard deviation: a direction that changes a draw
_MIN_PIVOT_RATIO = 1e-12  # of a unit row: a smaller one repeats the others
_MIN_DIAGONAL_RATIO = 1e-13  # of the largest entry: a smaller one leaves the mean undetermined


def squared_exponential(a: Floats, b: Floats, sigma: float, length: float) -> Floats:
    """Kernel matrix (n, m) of eq 14 for a (n,) and b (m,): sigma² exp(-(a - b)² / (2 length²))."""
    return np.asarray(
        np.square(sigma) * np.exp(-0.5 * np.square((a[:, None] - b[None, :]) / length))
    )


def covariance_root(covariance: Floats) -> Floats:
    """Return an f (n, r) with f fᵀ = covariance (n, n), to rounding; r is its numerical rank."""
    variance, direction = np.linalg.eigh(covariance)
    carries = variance > _RANK_RATIO * variance.max(initial=0.0)
    return np.asarray(direction[:, carries] * np.sqrt(variance[carries]))


def principal(factor: Floats) -> Floats:
    """Return the principal directions (n, c) of a Gaussian, the largest first.

    They depend on its covariance alone, not on the basis of the factor: the same standard normal
    numbers give the same draw on any CPU. So directions whose number would depend on rounding are
    left out, and the sign of each is fixed.

    Args:
        factor: (n, r) with the covariance factor factorᵀ.
    """
    direction, deviation, _ = np.linalg.svd(factor, full_matrices=False)
    carries = deviation > _CARRIES_RATIO * deviation.max(initial=0.0)
    direction, deviation = direction[:, carries], deviation[carries]
    rank = np.arange(1.0, len(direction) + 1.0)[:, None]
    sign = np.where((direction / rank).sum(axis=0) < 0.0, -1.0, 1.0)
    return np.asarray(direction * sign * deviation)


class Features:
    """Features φ with φ(x)ᵀφ(x') = k(x, x') on an interval.

    They interpolate the kernel in both arguments at Chebyshev nodes.
    """

    def __init__(
        self, low: float, high: float, sigma: float, length: float, degree: int = -1
    ) -> None:
        """Build the features.

        Args:
            low: left end of the interval.
            high: right end of it, above `low`.
            sigma: σ_f.
            length: l, in the units of x.
            degree: p of the polynomial mean; -1 for a zero mean.
        """
        if not (high > low and length > 0.0 and sigma >= 0.0):
            raise InputError(
                "a Gaussian process needs low < high, length > 0, sigma >= 0, "
                f"not {low}, {high}, {length}, {sigma}"
            )
        self.low, self.high, self.degree = low, high, degree
        ratio = (high - low) / length
        n = 20 + int(np.ceil(3.0 * ratio))
        node = np.cos(np.pi * (np.arange(n) + 0.5) / n)
        kernel = squared_exponential(node, node, sigma, 2.0 / ratio)
        root = covariance_root(kernel)
        # from values at the nodes to Chebyshev coefficients, by discrete orthogonality
        transform = chebyshev.chebvander(node, n - 1).T * (2.0 / n)
        transform[0] *= 0.5
        self._coefficients = transform @ root

    def __call__(self, x: Floats, derivative: int = 0) -> Floats:
        """Features (m, rank + degree + 1) at x (m,), or their derivative of that order."""
        scale = 2.0 / (self.high - self.low)
        u = scale * (np.asarray(x, dtype=np.float64) - self.low) - 1.0
        power = scale**derivative
        coefficients = np.asarray(chebyshev.chebder(self._coefficients, derivative) * power)
        columns = [chebyshev.chebvander(u, coefficients.shape[0] - 1) @ coefficients]
        if self.degree >= 0:
            mean = legendre.legder(np.eye(self.degree + 1), derivative)
            columns.append((legendre.legvander(u, mean.shape[0] - 1) @ mean) * power)
        return np.hstack(columns)


@dataclass(frozen=True, eq=False)
class Observations:
    """Observed values of f.

    Source: the training outputs of eq 13.

    Attributes:
        x: (n,) inputs.
        y: (n,) outputs.
        noise: (n,) standard deviation of each output; 0 is exact.
        derivative: (n,) order of the observed derivative of f; 0 is f itself.
    """

    x: Floats
    y: Floats
    noise: Floats
    derivative: tuple[int, ...] = ()

    def rows(self, features: Features) -> Floats:
        """Features (n, r) of every observation."""
        order = np.array(self.derivative or (0,) * len(self.x))
        rows = features(self.x)
        for k in sorted(set(order.tolist()) - {0}):
            rows[order == k] = features(self.x[order == k], k)
        return rows


@dataclass(frozen=True, eq=False)
class Posterior:
    """f at m points, given the observations: mean + factor z with z ~ N(0, I).

    Source: eq 15, with its covariance corrected (docs/method.md).

    Attributes:
        mean: (m,).
        factor: (m, r), a square root of the covariance.
    """

    mean: Floats
    factor: Floats

    @property
    def covariance(self) -> Floats:
        """(m, m) covariance."""
        return self.factor @ self.factor.T

    def sample(self, z: Floats) -> Floats:
        """Curves (S, m) from standard normal numbers z (S, r)."""
        return self.mean + z @ self.factor.T


class Regression:
    """The posterior of the weights.

    Source: eqs 13 and 15, as least squares in weights.
    """

    def __init__(self, features: Features, observed: Observations) -> None:
        """Condition on observations.

        Args:
            features: kernel and mean.
            observed: the observations; together they must determine the polynomial mean.

        Raises:
            InputError: there are too few observations for the mean, or exact ones contradict or
                repeat one another.
        """
        self.features = features
        rows = observed.rows(features)
        width = rows.shape[1]
        kernel_width = width - (features.degree + 1)  # the mean has a flat prior
        exact = observed.noise == 0.0
        y, noise = observed.y[~exact], observed.noise[~exact]
        noisy = rows[~exact]
        start, basis = _constrained(rows[exact], observed.y[exact], width)
        stacked = np.vstack([(noisy / noise[:, None]) @ basis, basis[:kernel_width]])
        target = np.concatenate([(y - noisy @ start) / noise, -start[:kernel_width]])
        q, r = np.linalg.qr(stacked)
        diagonal = np.abs(np.diag(r)).min(initial=np.inf)
        if r.shape[0] < r.shape[1] or diagonal < _MIN_DIAGONAL_RATIO * np.abs(r).max(initial=0.0):
            raise InputError(
                f"{len(observed.x)} observations are too few "
                f"for a mean of degree {features.degree}"
            )
        self._weights = start + basis @ linalg.solve_triangular(r, q.T @ target)
        self._root = linalg.solve_triangular(r, basis.T, trans="T").T  # basis r⁻¹

    def predict(self, x: Floats, derivative: int = 0) -> Posterior:
        """Return the posterior of f, or of its derivative of that order, at x (m,)."""
        rows = self.features(x, derivative)
        return Posterior(rows @ self._weights, rows @ self._root)


def _constrained(rows: Floats, values: Floats, width: int) -> tuple[Floats, Floats]:
    """Return all weights with rows w = values as w = start + basis a.

    The basis (width, width - c) is orthonormal, for c constraints.
    """
    if len(rows) == 0:
        return np.zeros(width), np.eye(width)
    norm = np.sqrt(np.square(rows).sum(axis=1))
    q, r = np.linalg.qr((rows / norm[:, None]).T, mode="complete")
    c = len(rows)
    if c > width or np.abs(np.diag(r)).min() < _MIN_PIVOT_RATIO:
        raise InputError(
            "two exact observations of a Gaussian process repeat or contradict one another"
        )
    return q[:, :c] @ linalg.solve_triangular(r[:c], values / norm, trans="T"), q[:, c:]
