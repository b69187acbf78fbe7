# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Piecewise polynomials and means and extremes over moving windows, added up in one stated order.

They give the bits of scipy's `BSpline`, `CubicHermiteSpline`, `uniform_filter1d`, `maximum_filter1d` and `minimum_filter1d`,
whose packages take a third of a second to import.
"""

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from scenario_gen.numerics.arrays import Floats, Ints


def _interval(breaks: Floats, at: Floats) -> Ints:
    """Return k for each of `at` (q,) with breaks[k] <= at < breaks[k + 1]; the first or the last one outside."""
    return np.clip(np.searchsorted(breaks, at, side="right") - 1, 0, len(breaks) - 2)


@dataclass(frozen=True, eq=False)
class BSpline:
    """A spline of simple inner knots; outside it goes on as its first and its last polynomial.

    Attributes:
        knots: (n + degree + 1,) non-decreasing.
        coefficients: (n, d).
        degree: of its polynomials.
    """

    knots: Floats
    coefficients: Floats
    degree: int

    def __call__(self, at: Floats, derivative: int = 0) -> Floats:
        """Return values (q, d) at `at` (q,), or those of a derivative."""
        first, basis = bspline_basis(self.knots, self.degree, at, derivative)
        out = np.zeros((len(at), self.coefficients.shape[1]))
        for k, values in enumerate(basis.T):
            out += self.coefficients[first + k] * values[:, None]
        return out


def bspline_basis(knots: Floats, degree: int, at: Floats, derivative: int = 0) -> tuple[Ints, Floats]:
    """Return at each of `at` (q,) the first (q,) of the functions that are not zero, and the values (q, degree + 1) of these.

    Cox's and de Boor's recursion (de Boor, A Practical Guide to Splines, 2001); a derivative has differences of the values of a
    lower degree.
    """
    cell = degree + _interval(knots[degree : len(knots) - degree], at)
    basis = np.zeros((degree + 1, len(at)))
    basis[0] = 1.0
    for p in range(1, degree + 1):
        before, basis[0] = basis.copy(), 0.0
        for k in range(1, p + 1):
            high, low = knots[cell + k], knots[cell + k - p]
            if p <= degree - derivative:
                share = before[k - 1] / (high - low)
                basis[k - 1] += share * (high - at)
                basis[k] = share * (at - low)
            else:
                share = p * before[k - 1] / (high - low)
                basis[k - 1] -= share
                basis[k] = share
    return cell - degree, basis.T


@dataclass(frozen=True, eq=False)
class CubicSpline:
    """Cubics between points, given by their values and slopes; outside the first and the last one go on.

    Attributes:
        breaks: (n,) increasing.
        powers: (4, n - 1, ...) coefficients of 1, x, x² and x³, x from the break before.
    """

    breaks: Floats
    powers: Floats

    @classmethod
    def through(cls, breaks: Floats, values: Floats, slopes: Floats) -> "CubicSpline":
        """Take values and slopes (n, ...) at the breaks (n,).

        Raises:
            ValueError: the breaks do not increase.
        """
        step = np.diff(breaks)
        if not (step > 0.0).all():
            raise ValueError("the breaks of a spline must increase")
        step = step.reshape(-1, *[1] * (values.ndim - 1))
        chord = np.diff(values, axis=0) / step
        bend = (slopes[:-1] + slopes[1:] - 2.0 * chord) / step
        return cls(breaks, np.stack((values[:-1], slopes[:-1], (chord - slopes[:-1]) / step - bend, bend / step)))

    def __call__(self, at: Floats, derivative: int = 0) -> Floats:
        """Return values (q, ...) at `at` (q,), or those of a derivative."""
        cell = _interval(self.breaks, at)
        x = (at - self.breaks[cell]).reshape(-1, *[1] * (self.powers.ndim - 2))
        out, power = np.zeros((len(at), *self.powers.shape[2:])), np.ones_like(x)
        for k in range(derivative, 4):
            factor = float(np.prod(np.arange(k - derivative + 1, k + 1)))
            out = out + self.powers[k][cell] * power * factor
            power = power * x
        return out


def moving_mean(values: Floats, width: int) -> Floats:
    """Return means over `width` (odd) samples around each along the last axis (..., T); the end samples are repeated."""
    around = _repeated(values, width)
    first = np.cumsum(around[..., :width], axis=-1)[..., -1:]
    return np.asarray(np.cumsum(np.concatenate([first, around[..., width:] - around[..., :-width]], axis=-1), axis=-1) / width)


def moving_max(values: Floats, width: int) -> Floats:
    """Return the largest of `width` (odd) samples around each of `values` (T,); the end samples are repeated."""
    return np.asarray(sliding_window_view(_repeated(values, width), width).max(axis=-1))


def moving_min(values: Floats, width: int) -> Floats:
    """Return the least of `width` (odd) samples around each of `values` (T,); the end samples are repeated."""
    return -moving_max(-values, width)


def _repeated(values: Floats, width: int) -> Floats:
    """`values` (..., T) with half a window of the end samples at either end."""
    half = width // 2
    ends = values[..., :1], values[..., -1:]
    return np.concatenate([np.repeat(ends[0], half, axis=-1), values, np.repeat(ends[1], half, axis=-1)], axis=-1)
