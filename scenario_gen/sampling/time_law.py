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

"""The time law: when a vehicle is where, with piecewise constant acceleration (paper IV-B).

With one constant acceleration per primitive, path lengths, durations and the two end speeds overdetermine the speeds at
the changepoints, and chaining the law makes them ring. So every primitive has one interior knot. The speeds v at all
knots are the least-squares fit, over time, to the template's speed scaled to this road and clock,

    minimise ∫ (v(t) - v̂(t))² dt   subject to   ½ Σ (v_i + v_{i+1}) Δ_i = L_k   for every primitive k,

with v given at both ends, zero in waits and dwells, v >= 0 and all limits kept: a quadratic programme of some twenty
unknowns, solved exactly by the dual active-set method DAQP (Arnström, Bemporad, Axehill 2022).
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import daqp
import numpy as np
import numpy.typing as npt

from scenario_gen.arrays import Bools, Floats, frozen, Ints
from scenario_gen.kernels import F1, F2, I1, kernel, OUT2, OUT3
from scenario_gen.sampling.config import SamplingConfig

Marks = npt.NDArray[np.intc]

STAND = 0.05  # m/s; an asked speed below this is met by standing
SHORTEST = 0.2  # s, between two knots in the template
KNOT_DISTANCE = 0.25  # s, of a primitive's knot from its ends where there is room: at most one knot between two samples
_RAMP = 1.5  # m/s², by which a vehicle that is asked to roll comes to a stand
_TARGET_SCALE = 4.0  # a template speed is scaled at most so much; beyond it, lengths alone decide
_STIFFNESS = 100.0  # 1/s, cost of sliding an anchor: strong, so that it happens only where it must
_LENGTH_TOLERANCE = 1e-6  # m
_EQUALITY = 5  # DAQP's mark


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
class TimeLayout:
    """The knots of one vehicle on the template's clock, and what the template's speed says about each interval.

    Attributes:
        knot: (M,) seconds.
        piece: (M - 1,) primitive of each interval.
        still: (M - 1,) True where the vehicle stands.
        group: (M - 1,) length constraint each moving interval belongs to, -1 where it stands.
        bounds: (G, 2) anchors at which each length constraint begins and ends.
        moments: (M - 1, 2) ∫ (1 - ξ) v̂ dξ and ∫ ξ v̂ dξ over each interval, ξ from 0 to 1 [m/s].
        unknown: (M,) number of each knot's unknown speed, -1 where it is given.
        given: (M,) m/s, the speed where it is given.
    """

    knot: Floats
    piece: Ints
    still: Bools
    group: Ints
    bounds: Ints
    moments: Floats
    unknown: Ints
    given: Floats

    @property
    def size(self) -> int:
        """Number of unknown speeds."""
        return int(self.unknown.max(initial=-1)) + 1


def layout(
    clock: Floats,
    dwells: Bools,
    waits: list[tuple[float, float]],
    time: Floats,
    speed: Floats,
    ends: tuple[float, float],
    knot_share: float | None = None,
) -> TimeLayout:
    """Lay out the knots of one vehicle.

    Args:
        clock: (K + 2,) template times [s] of start, changepoints and end.
        dwells: (K + 1,) True for primitives in which the route does not move.
        waits: begin and end [s] of the vehicle's waits.
        time: (T,) the template's samples [s].
        speed: (T,) its speeds [m/s].
        ends: asked speeds [m/s] at start and end.
        knot_share: where in each primitive its knot lies, as a share of its duration; None for where the template bends.
    """
    cuts, still = _cuts(clock, dwells, waits, ends)
    knots, stands = [cuts[0]], []
    for a, b, stand in zip(cuts[:-1], cuts[1:], still, strict=True):
        if not stand:
            at = best_knot(time, speed, a, b) if knot_share is None else a + knot_share * (b - a)
            apart = min(KNOT_DISTANCE, 0.5 * (b - a))
            knots.append(min(max(at, a + apart), b - apart))
            stands.append(False)
        knots.append(b)
        stands.append(stand)
    knot, standing = np.array(knots), np.array(stands)
    piece = np.clip(np.searchsorted(clock, 0.5 * (knot[:-1] + knot[1:]), side="right") - 1, 0, len(clock) - 2)
    group, bounds = _groups(piece, standing, dwells)
    given = np.full(len(knot), np.nan)
    given[[0, -1]] = ends
    given[:-1][standing] = 0.0
    given[1:][standing] = 0.0
    unknown = np.where(np.isnan(given), np.cumsum(np.isnan(given)) - 1, -1)
    xi = (np.arange(64) + 0.5) / 64
    values = np.interp(knot[:-1, None] + np.diff(knot)[:, None] * xi, time, speed)
    moments = np.column_stack([values @ (1.0 - xi), values @ xi]) / 64
    return TimeLayout(knot, piece, standing, group, bounds, frozen(moments), unknown, np.nan_to_num(given))


def _asleep(t: float, clock: Floats, dwells: Bools, waits: list[tuple[float, float]]) -> bool:
    """Whether the template has the vehicle stand at time t."""
    k = min(max(int(np.searchsorted(clock, t, side="right")) - 1, 0), len(dwells) - 1)
    return bool(dwells[k]) or any(a <= t <= b for a, b in waits)


def _ramps(clock: Floats, dwells: Bools, waits: list[tuple[float, float]], ends: tuple[float, float]) -> tuple[float, float]:
    """Time until which, and from which on, a vehicle rolls that stands in the template but is asked to move at that end."""
    inside = 0.5 * SHORTEST
    asleep = [_asleep(t, clock, dwells, waits) for t in (clock[0] + inside, clock[-1] - inside)]
    rolls = [max(SHORTEST, v / _RAMP) if stands and v > STAND else 0.0 for stands, v in zip(asleep, ends, strict=True)]
    return float(clock[0] + rolls[0]), float(clock[-1] - rolls[1])


def _cuts(
    clock: Floats, dwells: Bools, waits: list[tuple[float, float]], ends: tuple[float, float]
) -> tuple[list[float], list[bool]]:
    """Times at which a primitive, a wait or a roll begins or ends, none nearer than `SHORTEST`; where the vehicle stands."""
    cuts = [float(t) for t in clock]
    if dwells.all():
        return cuts, [True] * len(dwells)
    rolls = _ramps(clock, dwells, waits, ends)
    for t in [*rolls, *(t for wait in waits for t in wait)]:
        if clock[0] < t < clock[-1] and min(abs(t - c) for c in cuts) >= SHORTEST - 1e-9:
            cuts.append(float(t))
    cuts.sort()
    middle = [0.5 * (a + b) for a, b in pairwise(cuts)]
    return cuts, [rolls[0] < t < rolls[1] and _asleep(t, clock, dwells, waits) for t in middle]


def _groups(piece: Ints, still: Bools, dwells: Bools) -> tuple[Ints, Ints]:
    """Length constraints: one per primitive that moves.

    What cannot be driven within its own primitive (a route that moves while the vehicle stands, a vehicle that still
    rolls while the route dwells) is driven in the next primitive that moves, or the last one.
    """
    moving = np.array([bool((~still[piece == k]).any()) for k in range(len(dwells))])
    own = np.flatnonzero(moving & ~dwells)
    if len(own) == 0:
        own = np.flatnonzero(moving)[-1:]
    group = np.full(len(piece), -1, dtype=np.int64)
    if len(own) == 0:
        return group, np.zeros((0, 2), dtype=np.int64)
    home = np.minimum(np.searchsorted(own, piece), len(own) - 1)
    group[~still] = home[~still]
    last = np.append(own[:-1] + 1, len(dwells))
    return group, np.column_stack([np.append(0, last[:-1]), last])


def best_knot(time: Floats, speed: Floats, a: float, b: float) -> float:
    """Time in (a, b) at which two joined straight lines fit the speed best in the least-squares sense."""
    inside = (time >= a) & (time <= b)
    t, v = time[inside], speed[inside]
    candidates = t[(t > a + 0.2 * (b - a)) & (t < b - 0.2 * (b - a))]
    if len(t) < 6 or len(candidates) < 2:
        return 0.5 * (a + b)
    cost = []
    for knot in candidates:
        basis = np.column_stack([np.ones_like(t), t - a, np.maximum(t - knot, 0.0)])
        _, residual, *_ = np.linalg.lstsq(basis, v, rcond=None)
        cost.append(float(residual[0]) if len(residual) else 0.0)
    return float(candidates[int(np.argmin(np.round(cost, 9)))])


@dataclass(frozen=True, eq=False)
class SpeedBounds:
    """Speed bounds that stand in for curvature: at fraction `at` (B,) of interval `interval` (B,), at most `most` (B,)."""

    interval: Ints
    at: Floats
    most: Floats

    @classmethod
    def none(cls) -> "SpeedBounds":
        """No bound."""
        return cls(np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0))


class TimeLaw:
    """Solves the speeds of one vehicle for many samples of clock and lengths."""

    def __init__(self, lay: TimeLayout, config: SamplingConfig, bounds: SpeedBounds | None = None) -> None:
        self.layout, self.config = lay, config
        self.bounds = bounds or SpeedBounds.none()
        n, groups = lay.size, len(lay.bounds)
        loose = (lay.unknown[:-1] >= 0) | (lay.unknown[1:] >= 0)
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
        if self.layout.size == 0:
            return self._speeds(len(knot)), np.abs(lengths).sum(axis=1) < _LENGTH_TOLERANCE
        return self._optimise(*self._programmes(knot, lengths), self._sense)

    def slide(self, knot: Floats, lengths: Floats) -> tuple[Floats, Bools, Floats]:
        """Speeds at the knots where interior anchors may slide along the route, as little as possible.

        The total length is kept exactly; the squared displacements of the anchors are added to the cost.

        Returns:
            speeds (S, M), feasible (S,), and by how many metres (S, G) each constraint's end slid.
        """
        n, groups = self.layout.size, len(self.layout.bounds)
        if n == 0 or groups < 2:
            return *self.solve(knot, lengths), np.zeros(lengths.shape)
        h, f, a, low, high = self._programmes(knot, lengths)
        reached, wanted = np.cumsum(a[:, :groups], axis=1), np.cumsum(low[:, n : n + groups], axis=1)
        inner = reached[:, :-1]
        h += 2.0 * _STIFFNESS * inner.transpose(0, 2, 1) @ inner
        f -= 2.0 * _STIFFNESS * (wanted[:, None, :-1] @ inner)[:, 0]
        a[:, groups - 1] = reached[:, -1]
        low[:, n + groups - 1] = high[:, n + groups - 1] = wanted[:, -1]
        bounded = np.r_[0:n, n + groups - 1 : n + self._rows]
        a, low, high = np.ascontiguousarray(a[:, groups - 1 :]), low[:, bounded].copy(), high[:, bounded].copy()
        speeds, feasible = self._optimise(h, f, a, low, high, self._sense[bounded].copy())
        slid = (reached @ speeds[:, self.layout.unknown >= 0, None])[..., 0] - wanted
        return speeds, feasible, slid

    def _speeds(self, samples: int) -> Floats:
        """The given speeds, (samples, M)."""
        return np.broadcast_to(self.layout.given, (samples, len(self.layout.knot))).copy()

    def _programmes(self, knot: Floats, lengths: Floats) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        """The quadratic programmes of S samples."""
        lay, samples, n = self.layout, len(knot), self.layout.size
        h, f, a = np.zeros((samples, n, n)), np.zeros((samples, n)), np.zeros((samples, self._rows, n))
        low, high = np.zeros((samples, n + self._rows)), np.zeros((samples, n + self._rows))
        high[:, :n] = self.config.max_speed
        limits = np.array([self.config.max_deceleration, self.config.max_acceleration])
        bounds = self.bounds
        given = (lay.group, lay.moments, lay.unknown, lay.given, self._rated, limits, bounds.interval, bounds.at, bounds.most)
        _assemble(knot, lengths, *given, h, f, a, low, high)
        return h, f, a, low, high

    def _optimise(self, h: Floats, f: Floats, a: Floats, low: Floats, high: Floats, sense: Marks) -> tuple[Floats, Bools]:
        """Solve S programmes one after the other; speeds (S, M) and feasible (S,)."""
        speeds, feasible = self._speeds(len(f)), np.zeros(len(f), dtype=np.bool_)
        free = self.layout.unknown >= 0
        for s in range(len(f)):
            x, _, flag, _ = daqp.solve(h[s], f[s], a[s], high[s], low[s], sense)
            feasible[s] = flag > 0
            speeds[s, free] = np.maximum(x, 0.0) if flag > 0 else 0.0
        return speeds, feasible


@kernel(inline=True)
def _term(share: float, unknown: int, given: float, a: Floats, low: Floats, high: Floats, row: int, n: int) -> None:
    """Add share · v to a row: to its coefficients if v is unknown, else to its bounds, which follow n simple ones."""
    if unknown >= 0:
        a[row, unknown] += share
    else:
        low[n + row] -= share * given
        high[n + row] -= share * given


@kernel(F2, F2, I1, F2, I1, F1, I1, F1, I1, F1, F1, OUT3, OUT2, OUT3, OUT2, OUT2)
def _assemble(
    knot: Floats,
    lengths: Floats,
    group: Ints,
    moments: Floats,
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
    """Fill the quadratic programmes ½x'hx + f'x, low <= (x, a x) <= high, of S samples; see `TimeLaw`.

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
            scale = min(max(lengths[s, g], 0.0), _TARGET_SCALE * natural[g]) / max(natural[g], 1e-9)
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
