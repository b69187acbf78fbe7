# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The speed profile: when a vehicle is where, with piecewise constant acceleration (paper IV-B).

With one constant acceleration per primitive, path lengths, durations and the two end speeds overdetermine the speeds at
the changepoints, and chaining such pieces makes them ring. So every primitive has one interior knot, and as little use is
made of it as the lengths allow. The speeds v at all knots solve

    minimise ∫ (v - v̂)² dt + θ² ∫ (v' - ā)² dt   subject to   ½ Σ (v_i + v_{i+1}) Δ_i = L_k   for every primitive k.

ā is a primitive's mean acceleration: the second integral is its departure from constant acceleration, which costs a
short primitive dearly and a long one little. v̂ is what the primitives tell of the template: the straight lines,
joined at all knots, that fit its speed best, scaled to this road and clock. v is given at both ends, zero in waits
and dwells, v >= 0 and all limits are kept: a quadratic programme of some twenty unknowns, solved exactly by the dual
active-set method DAQP (Arnström, Bemporad, Axehill 2022).
"""

from dataclasses import dataclass
from functools import cached_property

import daqp
import numpy as np
import numpy.typing as npt

from benchmarks._paper_speed_knots import SpeedKnots
from scenario_gen.numerics import Bools, Floats, frozen, Ints
from scenario_gen.numerics.kernels import F1, F2, I1, kernel, OUT2, OUT3
from scenario_gen.types import Dynamics

Marks = npt.NDArray[np.intc]

_TARGET_SCALE = 4.0  # a template speed is scaled at most so much; beyond it, lengths alone decide
CONSTANCY = 3.0  # s², θ²: what a departure from constant acceleration counts, beside one of speed from the template
_STIFFNESS = 100.0  # 1/s, cost of sliding an anchor: strong, so that it happens only where it must
_LENGTH_TOLERANCE = 1e-6  # m
_EQUALITY = 5  # DAQP's mark


def knots_on(warped: Floats, times: Floats, knots: SpeedKnots) -> Floats:
    """Knots (S, M) [s] of a vehicle at the warped times (S, K + 2) of `times` (K + 2,), linear within each primitive."""
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
        """Arc length [m], speed [m/s] and acceleration [m/s²] at times t [s], any shape, clipped to the profile."""
        t = np.clip(t, self.time[0], self.time[-1])
        i = np.clip(np.searchsorted(self.time, t, side="right") - 1, 0, len(self.time) - 2)
        a = (np.diff(self.speed) / np.diff(self.time))[i]
        since = t - self.time[i]
        v = self.speed[i]
        return self.travelled[i] + (v + 0.5 * a * since) * since, v + a * since, a


@dataclass(frozen=True, eq=False)
class SpeedBounds:
    """Speed bounds of curves and creeping waits: at fraction `at` (B,) of interval `interval` (B,), at most `most` (B,)."""

    interval: Ints
    at: Floats
    most: Floats

    @classmethod
    def none(cls) -> "SpeedBounds":
        """No bound."""
        return cls(np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0))

    def and_(self, other: "SpeedBounds") -> "SpeedBounds":
        """Both."""
        return SpeedBounds(
            np.concatenate([self.interval, other.interval]),
            np.concatenate([self.at, other.at]),
            np.concatenate([self.most, other.most]),
        )


class SpeedProfileQP:
    """Solves the speeds of one vehicle for many samples of clock and lengths."""

    def __init__(
        self, knots: SpeedKnots, limits: Dynamics, bounds: SpeedBounds | None = None
    ) -> None:
        self.knots, self.limits = knots, limits
        self.bounds = bounds or SpeedBounds.none()
        n, groups = knots.size, len(knots.bounds)
        loose = (knots.unknown[:-1] >= 0) | (knots.unknown[1:] >= 0)
        self._rated = np.flatnonzero(loose)
        self._rows = groups + len(self._rated) + len(self.bounds.interval)
        self._sense = np.zeros(n + self._rows, dtype=np.intc)
        self._sense[n : n + groups] = _EQUALITY

    def solve(self, knot: Floats, lengths: Floats) -> tuple[Floats, Bools]:
        """Speeds at the knots, lengths kept exactly.

        Args:
            knot: (S, M) times [s] of the knots on each sample's clock.
            lengths: (S, G) metres to drive in each length constraint.

        Returns:
            speeds (S, M) in m/s and feasible (S,); speeds of infeasible samples are zero.
        """
        if self.knots.size == 0:
            return self._speeds(len(knot)), np.abs(lengths).sum(axis=1) < _LENGTH_TOLERANCE
        return self._optimise(*self._programmes(knot, lengths), self._sense)

    def slide(self, knot: Floats, lengths: Floats) -> tuple[Floats, Bools, Floats]:
        """Speeds at the knots where interior anchors may slide along the route, as little as possible.

        The total length is kept exactly; the squared displacements of the anchors are added to the cost.

        Returns:
            speeds (S, M), feasible (S,), and by how many metres (S, G) each constraint's end slid.
        """
        n, groups = self.knots.size, len(self.knots.bounds)
        if n == 0 or groups < 2:
            return *self.solve(knot, lengths), np.zeros(lengths.shape)
        h, f, a, low, high = self._programmes(knot, lengths)
        reached, wanted = (
            np.cumsum(a[:, :groups], axis=1),
            np.cumsum(low[:, n : n + groups], axis=1),
        )
        inner = reached[:, :-1]
        h += (2.0 * _STIFFNESS * inner.transpose(0, 2, 1)) @ inner
        f -= 2.0 * _STIFFNESS * (wanted[:, None, :-1] @ inner)[:, 0]
        a[:, groups - 1] = reached[:, -1]
        low[:, n + groups - 1] = high[:, n + groups - 1] = wanted[:, -1]
        bounded = np.r_[0:n, n + groups - 1 : n + self._rows]
        a, low, high = (
            np.ascontiguousarray(a[:, groups - 1 :]),
            low[:, bounded].copy(),
            high[:, bounded].copy(),
        )
        speeds, feasible = self._optimise(h, f, a, low, high, self._sense[bounded].copy())
        slid = (reached @ speeds[:, self.knots.unknown >= 0, None])[..., 0] - wanted
        return speeds, feasible, slid

    def _speeds(self, samples: int) -> Floats:
        """The given speeds, (samples, M)."""
        return np.broadcast_to(self.knots.given, (samples, len(self.knots.knot))).copy()

    def _programmes(
        self, knot: Floats, lengths: Floats
    ) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        """The quadratic programmes of S samples."""
        knots, samples, n = self.knots, len(knot), self.knots.size
        h, f, a = (
            np.zeros((samples, n, n)),
            np.zeros((samples, n)),
            np.zeros((samples, self._rows, n)),
        )
        low, high = np.zeros((samples, n + self._rows)), np.zeros((samples, n + self._rows))
        high[:, :n] = self.limits.max_speed
        limits = np.array([self.limits.max_deceleration, self.limits.max_acceleration])
        bounds = self.bounds
        given = (
            knots.group,
            knots.moments,
            knots.interior,
            knots.unknown,
            knots.given,
            self._rated,
            limits,
        )
        _assemble(
            knot, lengths, *given, bounds.interval, bounds.at, bounds.most, h, f, a, low, high
        )
        return h, f, a, low, high

    def _optimise(
        self, h: Floats, f: Floats, a: Floats, low: Floats, high: Floats, sense: Marks
    ) -> tuple[Floats, Bools]:
        """Solve S programmes one after the other; speeds (S, M) and feasible (S,)."""
        speeds, feasible = self._speeds(len(f)), np.zeros(len(f), dtype=np.bool_)
        free = self.knots.unknown >= 0
        for s in range(len(f)):
            x, _, flag, _ = daqp.solve(h[s], f[s], a[s], high[s], low[s], sense)
            feasible[s] = flag > 0
            speeds[s, free] = np.maximum(x, 0.0) if flag > 0 else 0.0
        return speeds, feasible


@kernel(inline=True)
def _term(
    share: float,
    unknown: int,
    given: float,
    a: Floats,
    low: Floats,
    high: Floats,
    row: int,
    n: int,
) -> None:
    """Add share · v to a row: to its coefficients if v is unknown, else to its bounds, which follow n simple ones."""
    if unknown >= 0:
        a[row, unknown] += share
    else:
        low[n + row] -= share * given
        high[n + row] -= share * given


@kernel(inline=True)
def _square(
    weight: float, knots: Ints, shares: Floats, unknown: Ints, given: Floats, h: Floats, f: Floats
) -> None:
    """Add weight · (Σ shares · v at knots)² to the cost; doubled, because of DAQP's ½."""
    for j in range(len(knots)):
        p = unknown[knots[j]]
        if p < 0:
            continue
        for k in range(len(knots)):
            q = unknown[knots[k]]
            if q >= 0:
                h[p, q] += 2.0 * weight * shares[j] * shares[k]
            else:
                f[p] += 2.0 * weight * shares[j] * shares[k] * given[knots[k]]


@kernel(F2, F2, I1, F2, I1, I1, F1, I1, F1, I1, F1, F1, OUT3, OUT2, OUT3, OUT2, OUT2)
def _assemble(
    knot: Floats,
    lengths: Floats,
    group: Ints,
    moments: Floats,
    interior: Ints,
    unknown: Ints,
    given: Floats,
    rated: Ints,
    limits: Floats,
    interval: Ints,
    at: Floats,
    most: Floats,
    h: Floats,
    f: Floats,
    a: Floats,
    low: Floats,
    high: Floats,
) -> None:
    """Fill the quadratic programmes ½x'hx + f'x, low <= (x, a x) <= high, of S samples; see `SpeedProfileQP`.

    Rows of a: one per length constraint, one acceleration per interval in `rated`, one per speed bound.
    """
    samples, groups, n = knot.shape[0], lengths.shape[1], f.shape[1]
    natural = np.empty(max(groups, 1))
    for s in range(samples):
        natural[:] = 0.0
        for i in np.flatnonzero(group >= 0):
            natural[group[i]] += (knot[s, i + 1] - knot[s, i]) * (moments[i, 0] + moments[i, 1])
        for g in range(groups):
            low[s, n + g] = high[s, n + g] = lengths[s, g]
        for i in np.flatnonzero(group >= 0):
            g, step = group[i], knot[s, i + 1] - knot[s, i]
            scale = min(max(lengths[s, g], 0.0), _TARGET_SCALE * natural[g]) / max(
                natural[g], 1e-9
            )
            for end in range(2):
                p, q = unknown[i + end], unknown[i + 1 - end]
                _term(0.5 * step, p, given[i + end], a[s], low[s], high[s], g, n)
                if p < 0:
                    continue
                # Twice ∫ (v - v̂)² over hat functions, because of DAQP's ½: the mass matrix of linear elements.
                h[s, p, p] += 2.0 * step / 3.0
                f[s, p] -= 2.0 * step * scale * moments[i, end]
                if q >= 0:
                    h[s, p, q] += step / 3.0
                else:
                    f[s, p] += given[i + 1 - end] * step / 3.0
        for i in interior:  # ∫ (v' - ā)²: v departs from the straight line by a triangle
            before, after = knot[s, i] - knot[s, i - 1], knot[s, i + 1] - knot[s, i]
            whole = before + after
            shares = np.array([-after / whole, 1.0, -before / whole])
            _square(
                CONSTANCY * (1.0 / before + 1.0 / after),
                np.arange(i - 1, i + 2),
                shares,
                unknown,
                given,
                h[s],
                f[s],
            )
        for k, i in enumerate(rated):
            row, step = groups + k, knot[s, i + 1] - knot[s, i]
            low[s, n + row], high[s, n + row] = -limits[0] * step, limits[1] * step
            _term(-1.0, unknown[i], given[i], a[s], low[s], high[s], row, n)
            _term(1.0, unknown[i + 1], given[i + 1], a[s], low[s], high[s], row, n)
        for k, i in enumerate(interval):
            row = groups + len(rated) + k
            low[s, n + row], high[s, n + row] = -1e9, most[k]
            _term(1.0 - at[k], unknown[i], given[i], a[s], low[s], high[s], row, n)
            _term(at[k], unknown[i + 1], given[i + 1], a[s], low[s], high[s], row, n)
