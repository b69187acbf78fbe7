# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Gaussian-process regression with a squared-exponential kernel, in low-rank square-root form (paper III-C, eqs 11-15).

The model is f(x) = h(x)ᵀβ + g(x), g ~ GP(0, k), with k the squared exponential of eq 14 and h(x) = (1, x, …, x^p).
The coefficients β have a flat prior and are inferred with everything else, so that their uncertainty is part of the
covariance (Rasmussen & Williams, Gaussian Processes for Machine Learning, §2.7).

On an interval the kernel is numerically of low rank: k(x, x') = φ(x)ᵀφ(x') to rounding, φ built from r Chebyshev nodes.
Regression is then least squares in r + p + 1 weights. Observations without noise are equality constraints and are
eliminated by an orthonormal basis of their null space; the rest is one QR factorisation. None needs a jitter: mean and
covariance agree with a dense reference to rounding, at a cost of O(n r² + m r S).
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from scipy import linalg

from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Floats

RELATIVE_RANK = 1e-15  # of the largest variance: what is below is rounding


def squared_exponential(a: Floats, b: Floats, sigma: float, length: float) -> Floats:
    """Kernel matrix (n, m) of eq 14 for a (n,) and b (m,): sigma² exp(-(a - b)² / (2 length²))."""
    return np.asarray(
        np.square(sigma) * np.exp(-0.5 * np.square((a[:, None] - b[None, :]) / length))
    )


def covariance_root(covariance: Floats) -> Floats:
    """Return an f (n, r) with f fᵀ = covariance (n, n), positive semidefinite, to rounding; r is the numerical rank."""
    variance, direction = np.linalg.eigh(covariance)
    carries = variance > RELATIVE_RANK * variance.max(initial=0.0)
    return np.asarray(direction[:, carries] * np.sqrt(variance[carries]))


def principal(factor: Floats, tolerance: float) -> Floats:
    """Return the principal directions (n, c) of a Gaussian with the covariance factor factorᵀ, factor (n, r), largest first.

    They depend on the covariance alone: whatever basis the factor comes in, on any CPU, the same standard normal numbers give
    the same draw. Those with a standard deviation of at most `tolerance` are left out; the sign of each is fixed.
    """
    direction, deviation, _ = np.linalg.svd(factor, full_matrices=False)
    direction = direction[:, deviation > tolerance]
    sign = np.where(
        (direction / np.arange(1.0, len(direction) + 1.0)[:, None]).sum(axis=0) < 0.0, -1.0, 1.0
    )
    return np.asarray(direction * sign * deviation[deviation > tolerance])


class Features:
    """φ with φ(x)ᵀφ(x') = k(x, x') on an interval, from Chebyshev interpolation of the kernel in both arguments."""

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
                f"a Gaussian process needs low < high, length > 0, sigma >= 0, not {low}, {high}, {length}, {sigma}"
            )
        self.low, self.high, self.degree = low, high, degree
        ratio = (high - low) / length
        n = 20 + int(np.ceil(3.0 * ratio))
        node = np.cos(np.pi * (np.arange(n) + 0.5) / n)
        kernel = squared_exponential(node, node, sigma, 2.0 / ratio)
        root = covariance_root(kernel)
        # Values at the nodes -> Chebyshev coefficients, by the discrete orthogonality of T_j on these nodes.
        transform = chebyshev.chebvander(node, n - 1).T * (2.0 / n)
        transform[0] *= 0.5
        self._coefficients = transform @ root

    @property
    def rank(self) -> int:
        """Number of features that carry the kernel (without those of the mean)."""
        return int(self._coefficients.shape[1])

    def __call__(self, x: Floats, derivative: int = 0) -> Floats:
        """Features (m, rank + degree + 1) at x (m,), or their derivative of that order."""
        scale = 2.0 / (self.high - self.low)
        u = scale * (np.asarray(x, dtype=np.float64) - self.low) - 1.0
        power = scale**derivative
        coefficients = (
            chebyshev.chebder(self._coefficients, derivative) * power
            if derivative
            else self._coefficients
        )
        columns = [chebyshev.chebvander(u, coefficients.shape[0] - 1) @ coefficients]
        if self.degree >= 0:
            mean = (
                np.polynomial.legendre.legder(np.eye(self.degree + 1), derivative)
                if derivative
                else np.eye(self.degree + 1)
            )
            columns.append((np.polynomial.legendre.legvander(u, mean.shape[0] - 1) @ mean) * power)
        return np.hstack(columns)


@dataclass(frozen=True, eq=False)
class Observations:
    """Values seen of f.

    Source: the training outputs of eq 13.

    Attributes:
        x: (n,) where.
        y: (n,) what.
        noise: (n,) standard deviation of each; 0 is exact.
        derivative: (n,) order of the derivative of f that was seen; 0 is f itself.
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
    """f at m points, given the observations: mean + factor·z with z ~ N(0, I).

    Source: eq 15, its covariance put right (docs/method.md).

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
    """The posterior over the weights, ready to be asked at any points.

    Source: eqs 13 and 15, as least squares in weights.
    """

    def __init__(self, features: Features, seen: Observations) -> None:
        """Condition on what was seen.

        Args:
            features: kernel and mean.
            seen: the observations; together they must determine the polynomial mean.

        Raises:
            InputError: too few observations for the mean, or exact ones that contradict or repeat one another.
        """
        self.features = features
        p = features.degree + 1
        rows = seen.rows(features)
        width = rows.shape[1]
        certain = seen.noise == 0.0
        noisy, y, noise = rows[~certain], seen.y[~certain], seen.noise[~certain]
        start, basis = _constrained(rows[certain], seen.y[certain], width)
        stacked = np.vstack([(noisy / noise[:, None]) @ basis, basis[: width - p]])
        target = np.concatenate([(y - noisy @ start) / noise, -start[: width - p]])
        q, r = np.linalg.qr(stacked)
        if r.shape[0] < r.shape[1] or np.abs(np.diag(r)).min(initial=np.inf) < 1e-13 * np.abs(
            r
        ).max(initial=0.0):
            raise InputError(
                f"{len(seen.x)} observations are too few for a mean of degree {features.degree}"
            )
        self._weights = start + basis @ linalg.solve_triangular(r, q.T @ target)
        self._root = linalg.solve_triangular(r, basis.T, trans="T").T  # basis·r⁻¹

    def predict(self, x: Floats, derivative: int = 0) -> Posterior:
        """The posterior of f, or of its derivative of that order, at x (m,)."""
        rows = self.features(x, derivative)
        return Posterior(rows @ self._weights, rows @ self._root)


def _constrained(rows: Floats, values: Floats, width: int) -> tuple[Floats, Floats]:
    """All weights that meet rows·w = values: w = start + basis·a, basis orthonormal (width, width - c)."""
    if len(rows) == 0:
        return np.zeros(width), np.eye(width)
    norm = np.sqrt(np.square(rows).sum(axis=1))
    q, r = np.linalg.qr((rows / norm[:, None]).T, mode="complete")
    c = len(rows)
    if c > width or np.abs(np.diag(r)).min() < 1e-12:
        raise InputError(
            "two exact observations of a Gaussian process repeat or contradict one another"
        )
    return q[:, :c] @ linalg.solve_triangular(r[:c], values / norm, trans="T"), q[:, c:]
