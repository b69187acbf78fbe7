# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Speed as a cubic B-spline over the template's clock, with continuous acceleration.

The coefficients of the derivatives are differences of neighbouring ones, and a spline lies in
the convex hull of its coefficients (de Boor, A Practical Guide to Splines, 2001): coefficients
that are not negative are speeds that are not.

Knots lie at changepoints, and where a stand or a slow wait begins or ends.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, pairwise

import numpy as np
from scipy.interpolate import BSpline

from scenario_gen.method.sampling.time_warp import MIN_RATE_RATIO
from scenario_gen.numerics import Bools, Floats, frozen, frozen_ints, Ints, runs
from scenario_gen.situation import STANDSTILL_SPEED_MPS, Wait
from scenario_gen.types import Encounter

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


Spans = list[tuple[float, float]]
"""Begin and end of intervals [s]."""

STANDING_MPS = 0.05  # a lower requested speed is met by standing
MIN_WAIT_S = 1.25  # shorter waits are lengthened, so that they remain waits on the published grid
_MIN_WARPED_WAIT_S = 1.15  # to which a fast clock may shorten one
_MIN_KNOT_DISTANCE_S = 0.2
_ROLLING_MPS2 = 1.5  # by which a vehicle that is requested to roll comes to a stand
_WAIT_MARGIN_S = 1.0  # around a wait, in which the clock keeps it


@dataclass(frozen=True, eq=False)
class SpeedKnots:
    """The knots of one vehicle on the template's clock.

    Attributes:
        knot: (M,) seconds.
        still: (M - 1,) whether the vehicle stands between two knots.
        creeping: (M - 1,) whether it waits there, but rolls slowly.
    """

    knot: Floats
    still: Bools
    creeping: Bools

    def spans(self, marked: Bools) -> Spans:
        """Return the longest runs of marked intervals (M - 1,)."""
        return [(float(self.knot[a]), float(self.knot[b])) for a, b in runs(marked)]


def speed_knots(
    clock: Floats, dwells: Bools, stands: Spans, ends: tuple[float, float], creeping: Spans
) -> SpeedKnots:
    """Place the knots of one vehicle.

    Args:
        clock: (K + 2,) template times [s] of start, changepoints and end.
        dwells: (K + 1,) whether the route does not move in a primitive.
        stands: begin and end [s] of the vehicle's stands.
        ends: requested speeds [m/s] at start and end.
        creeping: begin and end [s] of the waits in which it moves slowly.
    """
    if dwells.all():
        still = np.ones(len(dwells), dtype=np.bool_)
        return SpeedKnots(clock, still, np.zeros_like(still))

    def stands_at(time: float) -> bool:
        k = min(max(int(np.searchsorted(clock, time, side="right")) - 1, 0), len(dwells) - 1)
        return bool(dwells[k]) or _contains(stands, time)

    # a vehicle that stands in the template rolls where it is requested to move
    margin = 0.5 * _MIN_KNOT_DISTANCE_S
    start, end = float(clock[0]), float(clock[-1])
    start += _rolling_time(ends[0]) if stands_at(start + margin) else 0.0
    end -= _rolling_time(ends[1]) if stands_at(end - margin) else 0.0

    knots = clock.tolist()
    for time in (start, end, *chain(*stands, *creeping)):
        distance = min(abs(time - knot) for knot in knots)
        if clock[0] < time < clock[-1] and distance >= _MIN_KNOT_DISTANCE_S - 1e-9:
            knots.append(float(time))
    knots.sort()
    middles = [0.5 * (a + b) for a, b in pairwise(knots)]
    still = np.array([start < time < end and stands_at(time) for time in middles])
    slow = np.array([_contains(creeping, time) for time in middles])
    return SpeedKnots(np.array(knots), still, slow & ~still)


def _rolling_time(speed: float) -> float:
    """Return the seconds from a standstill to a requested speed [m/s]; 0 if it is a standstill."""
    return max(_MIN_KNOT_DISTANCE_S, speed / _ROLLING_MPS2) if speed > STANDING_MPS else 0.0


def _contains(spans: Spans, time: float) -> bool:
    """Return whether a time [s] lies in one of some intervals."""
    return any(begin <= time <= end for begin, end in spans)


def standing_part(encounter: Encounter, wait: Wait) -> Wait:
    """Return the part of a wait in which the vehicle stands; a slow wait unchanged.

    A wait begins below 0.5 m/s, so a vehicle that brakes gently still rolls for a while.
    """
    inside = (encounter.time >= wait.start) & (encounter.time <= wait.end)
    stands = encounter.time[inside & (encounter.speed[wait.vehicle] <= STANDSTILL_SPEED_MPS)]
    if wait.moves_slowly or len(stands) == 0:
        return wait
    start = wait.start if wait.start <= encounter.time[0] else float(stands[0])
    end = wait.end if wait.end >= encounter.time[-1] else float(stands[-1])
    return replace(wait, start=start, end=end)


def standing_within(
    times: Floats, dwells: Bools, stands: Spans, time: Floats, speed: Floats
) -> tuple[Spans, Bools]:
    """Replace dwells by the parts in which the template stands: a primitive may begin rolling.

    Args:
        times: (K + 2,) of start, changepoints and end [s].
        dwells: (K + 1,) primitives in which the route does not move.
        stands: begin and end [s] of the vehicle's stands.
        time: (T,) the template's samples [s].
        speed: (T,) its speeds [m/s].

    Returns:
        The stands with those in dwells, and the dwells (K + 1,) in which it never stands.
    """
    stands, left = list(stands), dwells.copy()
    for a, b in runs(dwells):
        inside = (time >= times[a]) & (time <= times[b])
        still = time[inside & (speed <= STANDSTILL_SPEED_MPS)]
        if len(still):
            at_start = a == 0 and speed[0] <= STANDSTILL_SPEED_MPS
            at_end = b == len(dwells) and speed[-1] <= STANDSTILL_SPEED_MPS
            start = times[a] if at_start else still[0]
            end = times[b] if at_end else still[-1]
            stands.append((float(start), float(end)))
            left[a:b] = False
    return stands, left


def least_shares(grid: Floats, waits: Sequence[Wait]) -> Floats:
    """Return the slowest rates (G,) of a clock, over the nominal one, at which waits remain waits.

    Args:
        grid: (G,) template times [s].
        waits: that are kept.
    """
    shares = np.full(len(grid), MIN_RATE_RATIO)
    for wait in waits:
        inside = (grid > wait.start - _WAIT_MARGIN_S) & (grid < wait.end + _WAIT_MARGIN_S)
        least = _MIN_WARPED_WAIT_S / max(wait.end - wait.start, MIN_WAIT_S)
        shares[inside] = np.maximum(shares[inside], least)
    return shares


def lengthened_waits(n: int, waits: Sequence[Wait], *, creeping: bool) -> Spans:
    """Return vehicle n's stands, or slow waits, with short ones lengthened."""
    spans = []
    for wait in waits:
        if wait.vehicle == n and wait.moves_slowly == creeping:
            pad = max(0.0, 0.5 * (MIN_WAIT_S - (wait.end - wait.start)))
            spans.append((wait.start - pad, wait.end + pad))
    return spans
