# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Speed as a cubic B-spline over the template's clock, with continuous acceleration.

The coefficients of the derivatives are differences of neighbouring ones, and a spline lies in
the convex hull of its coefficients (de Boor, A Practical Guide to Splines, 2001): coefficients
that are not negative are speeds that are not.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.interpolate import BSpline

from scenario_gen.numerics import Bools, Floats, frozen, frozen_ints, Ints

KNOT_SPACING_S = 0.25  # with wider spacing the steps of jerk between knots look artificial
_MAX_KNOTS_COUNT = 600  # long encounters have a wider spacing
_DEGREE = 3
_JUST_BEFORE_S = 1e-9
_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(4)


@dataclass(frozen=True, eq=False)
class SpeedSpline:
    """A clamped cubic B-spline basis, and which of its functions reach into a stand.

    The knot at the begin or end of a stand is double: acceleration is continuous there, and jerk
    may jump, as when a foot leaves the brake.

    Attributes:
        knots: (n + 4,) seconds on the template's clock, the first and the last four times.
        still: (n,) True for the functions that do not vanish throughout the stands.
    """

    knots: Floats
    still: Bools

    @classmethod
    def over(cls, start: float, end: float, stands: list[tuple[float, float]]) -> "SpeedSpline":
        """Return the basis on [start, end] [s].

        Args:
            start: seconds.
            end: seconds.
            stands: begin and end [s] of the vehicle's stands, in order and disjoint.
        """
        spacing = max(KNOT_SPACING_S, (end - start) / _MAX_KNOTS_COUNT)
        cuts = sorted({start, end, *(t for stand in stands for t in stand if start < t < end)})
        inner = [
            np.linspace(a, b, max(round((b - a) / spacing), 1) + 1)[:-1] for a, b in pairwise(cuts)
        ]
        knots = np.sort(
            np.concatenate([[start] * _DEGREE, *inner, cuts[1:-1], [end] * (_DEGREE + 1)])
        )
        low, high = knots[: -_DEGREE - 1], knots[_DEGREE + 1 :]
        still = np.zeros(len(low), dtype=np.bool_)
        for a, b in stands:
            still |= (low < b - 1e-9) & (high > a + 1e-9)
        return cls(frozen(knots), still)

    @property
    def size(self) -> int:
        """Number n of coefficients."""
        return len(self.knots) - _DEGREE - 1

    @cached_property
    def breaks(self) -> Floats:
        """(m + 1,) distinct knots [s]."""
        return frozen(np.unique(self.knots))

    @cached_property
    def first(self) -> Ints:
        """(m,) the first of the four basis functions that are not zero between two breaks."""
        return frozen_ints(
            np.searchsorted(self.knots, self.breaks[:-1], side="right") - 1 - _DEGREE
        )

    @cached_property
    def stations(self) -> Floats:
        """(b,) seconds at which a derivative of the speed can be largest.

        These are the breaks, and instants just before a jump of jerk.
        """
        inner = self.knots[_DEGREE + 1 : -_DEGREE - 1]
        return frozen(
            np.sort(
                np.concatenate([self.breaks, inner[1:][np.diff(inner) == 0.0] - _JUST_BEFORE_S])
            )
        )

    @cached_property
    def at_stations(self) -> tuple[Floats, Floats, Floats]:
        """Values (b, n) of all basis functions at the stations, first and second derivatives."""
        value, slope, bend = (frozen(self.design(self.stations, k)) for k in range(3))
        return value, slope, bend

    @cached_property
    def middle(self) -> Floats:
        """(n,) seconds t such that a spline with coefficients t is t (Greville's abscissae)."""
        return frozen((self.knots[1:-3] + self.knots[2:-2] + self.knots[3:-1]) / 3.0)

    def design(self, at: Floats, derivative: int = 0) -> Floats:
        """Return values (q, n) of all basis functions, or their derivatives, at times (q,) [s]."""
        return np.asarray(BSpline(self.knots, np.eye(self.size), _DEGREE)(at, derivative))

    @cached_property
    def length(self) -> Floats:
        """(n,) metres that each coefficient of 1 m/s drives."""
        return frozen((self.knots[_DEGREE + 1 :] - self.knots[: -_DEGREE - 1]) / (_DEGREE + 1.0))

    def driven(self, until: Floats) -> Floats:
        """Return metres (q, n) that each coefficient of 1 m/s drives until times (q,) [s]."""
        return np.asarray(self._driven(until))

    @cached_property
    def _driven(self) -> BSpline:
        return BSpline(self.knots, np.eye(self.size), _DEGREE).antiderivative()

    @cached_property
    def gram(self) -> Floats:
        """(n, n) integrals [s] of products of two basis functions."""
        return self._gram(0)

    @cached_property
    def bending(self) -> Floats:
        """(n, n) integrals [1/s³] of products of second derivatives of two basis functions."""
        return self._gram(2)

    def _gram(self, derivative: int) -> Floats:
        """Return integrals (n, n) of products of derivatives of two basis functions."""
        half, middle = 0.5 * np.diff(self.breaks), 0.5 * (self.breaks[1:] + self.breaks[:-1])
        at = middle[:, None] + half[:, None] * _GAUSS_X
        weight = half[:, None] * _GAUSS_W
        basis = self.design(at.ravel(), derivative)
        return frozen((basis * weight.ravel()[:, None]).T @ basis)

    def projected(self, at: Floats, values: Floats) -> Floats:
        """Return integrals (n,) of each basis function times a piecewise linear function.

        Args:
            at: (q,) seconds.
            values: (q,) of the function.
        """
        t = np.unique(
            np.concatenate([self.breaks, at[(at > self.breaks[0]) & (at < self.breaks[-1])]])
        )
        half, middle = 0.5 * np.diff(t), 0.5 * (t[1:] + t[:-1])
        points = (middle[:, None] + half[:, None] * _GAUSS_X).ravel()
        weight = (half[:, None] * _GAUSS_W).ravel()
        return np.asarray(self.design(points).T @ (weight * np.interp(points, at, values)))

    @cached_property
    def pieces(self) -> Floats:
        """(m, 4, 4) coefficients of 1, x, x², x³ from the four spline coefficients of a piece.

        x are the seconds since the break.
        """
        out = np.empty((len(self.breaks) - 1, 4, 4))
        inside = self.breaks[:-1]
        factorial = (1.0, 1.0, 2.0, 6.0)
        for power in range(4):
            rows = self.design(inside, power) / factorial[power]
            for i in range(len(out)):
                out[i, power] = rows[i, self.first[i] : self.first[i] + 4]
        return frozen(out)
