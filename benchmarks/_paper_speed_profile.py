# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The speed profile of the paper: piecewise constant acceleration (IV-B).

With one constant acceleration per primitive, path lengths, durations and the two end speeds
overdetermine the speeds at the changepoints, and chained pieces ring. So every primitive has one
interior knot, which is used as little as the lengths allow. The speeds v at all knots solve

    minimise ∫ (v - v̂)² dt + θ² ∫ (v' - ā)² dt
    subject to ½ Σ (v_i + v_{i+1}) Δ_i = L_k for every primitive k.

ā is a primitive's mean acceleration, so that the second integral is its departure from constant
acceleration. v̂ are the straight lines that fit the template's speed best, scaled to this road and
clock. v is given at both ends, zero in waits and dwells, v >= 0, and all limits hold: a quadratic
programme of some twenty unknowns. DAQP, a dual active-set method, solves it exactly (Arnström,
Bemporad, Axehill 2022).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import daqp
import numpy as np
import numpy.typing as npt

from benchmarks._paper_speed_knots import SpeedKnots
from scenario_gen.numerics import Bools, Floats, frozen
from scenario_gen.types import Dynamics

MAX_TARGET_SCALE_RATIO = 4.0
"""A template speed is scaled at most by this; beyond it, only the lengths decide."""
CONSTANCY_WEIGHT = 3.0
"""θ² [s²]."""
STIFFNESS_WEIGHT = 100.0
"""Cost of sliding an anchor [1/s]: large, so that it happens only where it must."""
LENGTH_TOLERANCE_M = 1e-6
EQUALITY = 5
"""DAQP's mark of an equality."""


def knots_on(warped: Floats, times: Floats, knots: SpeedKnots) -> Floats:
    """Return the knots (S, M) [s] on warped clocks (S, K + 2) of `times` (K + 2,)."""
    piece = np.append(knots.piece, knots.piece[-1])
    share = (knots.knot - times[piece]) / (times[piece + 1] - times[piece])
    return np.asarray(warped[:, piece] + share * (warped[:, piece + 1] - warped[:, piece]))


@dataclass(frozen=True, eq=False)
class SpeedProfile:
    """Speed over time, linear between knots.

    Attributes:
        time: (M,) seconds, strictly increasing.
        speed: (M,) m/s, >= 0.
    """

    time: Floats
    speed: Floats

    @cached_property
    def travelled(self) -> Floats:
        """(M,) metres driven at each knot."""
        pieces = 0.5 * (self.speed[:-1] + self.speed[1:]) * np.diff(self.time)
        return frozen(np.concatenate([[0.0], np.cumsum(pieces)]))

    def state(self, t: Floats) -> tuple[Floats, Floats, Floats]:
        """Return arc length [m], speed [m/s] and acceleration [m/s²] at times of any shape [s]."""
        t = np.clip(t, self.time[0], self.time[-1])
        i = np.clip(np.searchsorted(self.time, t, side="right") - 1, 0, len(self.time) - 2)
        a = (np.diff(self.speed) / np.diff(self.time))[i]
        since = t - self.time[i]
        v = self.speed[i]
        return self.travelled[i] + (v + 0.5 * a * since) * since, v + a * since, a


class Programme(NamedTuple):
    """½ x'hx + f'x with low <= a x <= high; the first rows of a are the length constraints."""

    h: Floats
    f: Floats
    a: Floats
    low: Floats
    high: Floats


class SpeedProfileQP:
    """Solves the speeds of one vehicle for many samples of clock and lengths."""

    def __init__(self, knots: SpeedKnots, limits: Dynamics) -> None:
        self.knots, self.limits = knots, limits
        self._free = knots.unknown >= 0
        loose = self._free[:-1] | self._free[1:]
        self._rated = np.flatnonzero(loose)

    def solve(self, knot: Floats, lengths: Floats) -> tuple[Floats, Bools]:
        """Return the speeds at the knots with exact lengths.

        Args:
            knot: (S, M) times [s] of the knots on each sample's clock.
            lengths: (S, G) metres to drive in each length constraint.

        Returns:
            speeds (S, M) in m/s and feasible (S,); speeds of infeasible samples are zero.
        """
        if self.knots.size == 0:
            speeds = np.tile(self.knots.given, (len(knot), 1))
            return speeds, np.abs(lengths).sum(axis=1) < LENGTH_TOLERANCE_M
        programmes = [self._programme(*sample) for sample in zip(knot, lengths, strict=True)]
        return self._solutions(programmes, len(self.knots.bounds))

    def slide(self, knot: Floats, lengths: Floats) -> tuple[Floats, Bools, Floats]:
        """Return the speeds where interior anchors may slide along the route.

        The total length is exact; the squared displacements of the anchors are part of the cost.

        Returns:
            speeds (S, M), feasible (S,), and by how many metres (S, G) each constraint's end slid.
        """
        groups = len(self.knots.bounds)
        if self.knots.size == 0 or groups < 2:
            return *self.solve(knot, lengths), np.zeros(lengths.shape)
        programmes, slid = [], np.zeros(lengths.shape)
        rigid = [self._programme(*sample) for sample in zip(knot, lengths, strict=True)]
        for one in rigid:
            reached = np.cumsum(one.a[:groups], axis=0)
            wanted = np.cumsum(one.low[:groups])
            inner = reached[:-1]
            programmes.append(
                Programme(
                    one.h + 2.0 * STIFFNESS_WEIGHT * inner.T @ inner,
                    one.f - 2.0 * STIFFNESS_WEIGHT * inner.T @ wanted[:-1],
                    np.vstack([reached[-1:], one.a[groups:]]),
                    np.append(wanted[-1:], one.low[groups:]),
                    np.append(wanted[-1:], one.high[groups:]),
                )
            )
        speeds, feasible = self._solutions(programmes, 1)
        for s, one in enumerate(rigid):
            slid[s] = np.cumsum(one.a[:groups] @ speeds[s, self._free] - one.low[:groups])
        return speeds, feasible, slid

    def _programme(self, knot: Floats, lengths: Floats) -> Programme:
        """Return the quadratic programme of one sample."""
        knots, step, count = self.knots, np.diff(knot), len(knot)
        moving = np.flatnonzero(knots.group >= 0)
        group = knots.group[moving]
        natural = np.bincount(
            group, (step * knots.moments.sum(axis=1))[moving], minlength=len(lengths)
        )
        target = np.minimum(np.maximum(lengths, 0.0), MAX_TARGET_SCALE_RATIO * natural)
        scale = target / np.maximum(natural, 1e-9)
        h, f = np.zeros((count, count)), np.zeros(count)
        length_rows = np.zeros((len(lengths), count))
        for i, g in zip(moving.tolist(), group.tolist(), strict=True):
            ends = [i, i + 1]
            length_rows[g, ends] += 0.5 * step[i]
            # twice ∫ (v - v̂)² over hat functions, because of DAQP's ½: the mass matrix
            h[np.ix_(ends, ends)] += step[i] / 3.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
            f[ends] -= 2.0 * step[i] * scale[g] * knots.moments[i]
        for i in knots.interior.tolist():  # v departs from the straight line by a triangle
            before, after = step[i - 1], step[i]
            triangle = np.array([-after, before + after, -before]) / (before + after)
            weight = 2.0 * CONSTANCY_WEIGHT * (1.0 / before + 1.0 / after)
            h[i - 1 : i + 2, i - 1 : i + 2] += weight * np.outer(triangle, triangle)
        rates = np.diff(np.eye(count), axis=0)[self._rated]
        rows, given, rated = np.vstack([length_rows, rates]), knots.given, step[self._rated]
        low = np.append(lengths, -self.limits.max_deceleration * rated) - rows @ given
        high = np.append(lengths, self.limits.max_acceleration * rated) - rows @ given
        free = self._free
        cost = f[free] + h[free] @ given
        return Programme(h[np.ix_(free, free)], cost, rows[:, free], low, high)

    def _solutions(self, programmes: list[Programme], equalities: int) -> tuple[Floats, Bools]:
        """Solve programmes whose first rows are equalities: speeds (S, M) and feasible (S,)."""
        speeds = np.tile(self.knots.given, (len(programmes), 1))
        feasible = np.zeros(len(programmes), dtype=np.bool_)
        size = self.knots.size
        for s, one in enumerate(programmes):
            low = np.append(np.zeros(size), one.low)
            high = np.append(np.full(size, self.limits.max_speed), one.high)
            sense: npt.NDArray[np.intc] = np.zeros(len(low), dtype=np.intc)
            sense[size : size + equalities] = EQUALITY
            rows = np.ascontiguousarray(one.a)
            x, _, flag, _ = daqp.solve(np.ascontiguousarray(one.h), one.f, rows, high, low, sense)
            feasible[s] = flag > 0
            speeds[s, self._free] = np.maximum(x, 0.0) if flag > 0 else 0.0
        return speeds, feasible
