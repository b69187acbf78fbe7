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

"""Gaussian-process regression with a squared-exponential kernel, in low-rank square-root form (paper III-C, eqs 11-15).

The model is f(x) = h(x)ᵀβ + g(x), g ~ GP(0, k), with k the squared exponential of eq 14 and h(x) = (1, x, …, x^p).
The coefficients β have a flat prior and are inferred with everything else, so that their uncertainty is part of the
covariance (Rasmussen & Williams, Gaussian Processes for Machine Learning, §2.7).

On an interval the kernel is numerically of low rank: k(x, x') = φ(x)ᵀφ(x') to rounding, φ built from r Chebyshev nodes.
Regression is then least squares in r + p + 1 weights. Observations without noise are equality constraints and are
eliminated by an orthonormal basis of their null space; the rest is one QR factorisation. No matrix is ever squared and
none needs a jitter: mean and covariance agree with a dense reference to rounding, at a cost of O(n r² + m r S).
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
import scipy.linalg

from scenario_gen.arrays import Floats
from scenario_gen.blas import on_one_thread
from scenario_gen.errors import InputError
from scenario_gen.kernels import F2, kernel, OUT2

_RANK_TOLERANCE = 1e-17  # eigenvalues below this share of the largest are rounding


def squared_exponential(a: Floats, b: Floats, sigma: float, length: float) -> Floats:
    """Kernel matrix (len(a), len(b)) of eq 14: sigma² exp(-(a - b)² / (2 length²))."""
    return np.asarray(sigma**2 * np.exp(-0.5 * ((a[:, None] - b[None, :]) / length) ** 2))


class Features:
    """φ with φ(x)ᵀφ(x') = k(x, x') on an interval, from Chebyshev interpolation of the kernel in both arguments."""

    @on_one_thread
    def __init__(self, low: float, high: float, sigma: float, length: float, degree: int = -1) -> None:
        """Build the features.

        Args:
            low: left end of the interval.
            high: right end of it, above `low`.
            sigma: σ_f.
            length: l, in the units of x.
            degree: p of the polynomial mean; -1 for a zero mean.
        """
        if not (high > low and length > 0.0 and sigma >= 0.0):
            raise InputError(f"a Gaussian process needs low < high, length > 0, sigma >= 0, not {low}, {high}, {length}, {sigma}")
        self.low, self.high, self.degree = low, high, degree
        ratio = (high - low) / length
        n = 20 + int(np.ceil(3.0 * ratio))
        node = np.cos(np.pi * (np.arange(n) + 0.5) / n)
        kernel = squared_exponential(node, node, sigma, 2.0 / ratio)
        value, vector = np.linalg.eigh(kernel)
        keep = value > max(_RANK_TOLERANCE * value[-1], 0.0)
        root = vector[:, keep][:, ::-1] * np.sqrt(value[keep][::-1])
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
        coefficients = chebyshev.chebder(self._coefficients, derivative) * scale**derivative if derivative else self._coefficients
        columns = [chebyshev.chebvander(u, coefficients.shape[0] - 1) @ coefficients]
        if self.degree >= 0:
            mean = np.polynomial.legendre.legder(np.eye(self.degree + 1), derivative) if derivative else np.eye(self.degree + 1)
            columns.append(np.polynomial.legendre.legvander(u, mean.shape[0] - 1) @ mean * scale**derivative)
        return np.hstack(columns)


@dataclass(frozen=True, eq=False)
class Observations:
    """Values seen of f.

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

    @on_one_thread
    def sample(self, z: Floats) -> Floats:
        """Curves (S, m) from standard normal numbers z (S, r)."""
        return self.mean + combine(z, self.factor)


class Regression:
    """The posterior over the weights, ready to be asked at any points."""

    @on_one_thread
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
        exact = seen.noise == 0.0
        start, basis = _constrained(rows[exact], seen.y[exact], width)
        weight = 1.0 / seen.noise[~exact, None]
        prior = np.eye(width)[: width - p]
        stacked = np.vstack([(weight * rows[~exact]) @ basis, prior @ basis])
        target = np.concatenate([weight[:, 0] * (seen.y[~exact] - rows[~exact] @ start), -start[: width - p]])
        q, r = scipy.linalg.qr(stacked, mode="economic", check_finite=False)
        if r.shape[0] < r.shape[1] or np.abs(np.diag(r)).min(initial=np.inf) < 1e-13 * np.abs(r).max(initial=0.0):
            raise InputError(f"{len(seen.x)} observations are too few for a mean of degree {features.degree}")
        self._weights = start + basis @ scipy.linalg.solve_triangular(r, q.T @ target, check_finite=False)
        self._root = scipy.linalg.solve_triangular(r, basis.T, trans="T", check_finite=False).T  # basis·r⁻¹

    @on_one_thread
    def predict(self, x: Floats) -> Posterior:
        """The posterior of f at x (m,)."""
        rows = self.features(x)
        return Posterior(rows @ self._weights, rows @ self._root)


def _constrained(rows: Floats, values: Floats, width: int) -> tuple[Floats, Floats]:
    """All weights that meet rows·w = values: w = start + basis·a, basis orthonormal (width, width - c)."""
    if len(rows) == 0:
        return np.zeros(width), np.eye(width)
    norm = np.linalg.norm(rows, axis=1)
    q, r = scipy.linalg.qr((rows / norm[:, None]).T, check_finite=False)
    c = len(rows)
    if c > width or np.abs(np.diag(r)).min() < 1e-12:
        raise InputError("two exact observations of a Gaussian process repeat or contradict one another")
    return q[:, :c] @ scipy.linalg.solve_triangular(r[:c], values / norm, trans="T", check_finite=False), q[:, c:]


@kernel(F2, F2, OUT2)
def _combine(z: Floats, rows: Floats, out: Floats) -> None:
    for s in range(z.shape[0]):
        for k in range(z.shape[1]):
            for j in range(rows.shape[1]):
                out[s, j] += z[s, k] * rows[k, j]


def combine(z: Floats, factor: Floats) -> Floats:
    """Samples (S, m) of zero mean from numbers z (S, r) and a square root of the covariance, factor (m, r).

    Each row is summed in the same order whatever the number of rows and threads, so that any single sample can be
    drawn again bit for bit; a matrix product of the linear-algebra library promises no such thing.
    """
    out = np.zeros((len(z), len(factor)))
    _combine(np.ascontiguousarray(z), np.ascontiguousarray(factor.T), out)
    return out
