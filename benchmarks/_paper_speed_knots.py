# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The knots of the paper's speed profile, and the template's speeds between them.

A primitive tells of the template what a speed profile can drive: the straight lines, joined at changepoints, at interior
knots and at the ends of stands, that fit its speed best in the least-squares sense. The interior knot lies where the template
bends.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from scenario_gen.numerics import Bools, Floats, frozen, Ints, runs

STAND = 0.05  # m/s; an asked speed below this is met by standing
SHORTEST = 0.2  # s, between two knots in the template
KNOT_DISTANCE = 0.25  # s, of a primitive's knot from its ends where there is room: at most one knot between two samples
_RAMP = 1.5  # m/s², by which a vehicle that is asked to roll comes to a stand


@dataclass(frozen=True, eq=False)
class SpeedKnots:
    """The knots of one vehicle on the template's clock, and what the template's speed says about each interval.

    Attributes:
        knot: (M,) seconds.
        piece: (M - 1,) primitive of each interval.
        still: (M - 1,) True where the vehicle stands.
        creeping: (M - 1,) True where it waits, but rolls on slowly.
        group: (M - 1,) length constraint each moving interval belongs to, -1 where it stands.
        bounds: (G, 2) anchors at which each length constraint begins and ends.
        lines: (M,) m/s, v̂ at the knots: the straight lines that fit the template's speed best.
        interior: numbers of the knots inside primitives.
        unknown: (M,) number of each knot's unknown speed, -1 where it is given.
        given: (M,) m/s, the speed where it is given.
    """

    knot: Floats
    piece: Ints
    still: Bools
    creeping: Bools
    group: Ints
    bounds: Ints
    lines: Floats
    interior: Ints
    unknown: Ints
    given: Floats

    @property
    def moments(self) -> Floats:
        """(M - 1, 2) ∫ (1 - ξ) v̂ dξ and ∫ ξ v̂ dξ over each interval, ξ from 0 to 1 [m/s]."""
        a, b = self.lines[:-1], self.lines[1:]
        return np.column_stack([a / 3.0 + b / 6.0, a / 6.0 + b / 3.0])

    def stretches(self, marked: Bools) -> list[tuple[float, float]]:
        """Begin and end [s] of the longest runs of marked intervals (M - 1,)."""
        return [(float(self.knot[a]), float(self.knot[b])) for a, b in runs(marked)]

    @property
    def size(self) -> int:
        """Number of unknown speeds."""
        return int(self.unknown.max(initial=-1)) + 1


def speed_knots(
    clock: Floats,
    dwells: Bools,
    waits: list[tuple[float, float]],
    time: Floats,
    speed: Floats,
    ends: tuple[float, float],
    knot_share: float | None = None,
    moves_slowly: Sequence[tuple[float, float]] = (),
) -> SpeedKnots:
    """Place the knots of one vehicle.

    Source: paper IV-B, constant acceleration within a primitive, with one knot more.

    Args:
        clock: (K + 2,) template times [s] of start, changepoints and end.
        dwells: (K + 1,) True for primitives in which the route does not move.
        waits: begin and end [s] of the vehicle's waits.
        time: (T,) the template's samples [s].
        speed: (T,) its speeds [m/s].
        ends: asked speeds [m/s] at start and end.
        knot_share: where in each primitive a knot lies, as a share of its duration; 0 for none, None for where the template
            bends.
        moves_slowly: begin and end [s] of the waits in which it moves slowly; they become knots.
    """
    cuts, still = _cuts(clock, dwells, waits, ends, moves_slowly)
    knots, stands, interior = [cuts[0]], [], []
    for a, b, stand in zip(cuts[:-1], cuts[1:], still, strict=True):
        if not stand and knot_share != 0.0:
            at = best_knot(time, speed, a, b) if knot_share is None else a + knot_share * (b - a)
            distance = min(KNOT_DISTANCE, 0.5 * (b - a))
            interior.append(len(knots))
            knots.append(min(max(at, a + distance), b - distance))
            stands.append(False)
        knots.append(b)
        stands.append(stand)
    knot, standing = np.array(knots), np.array(stands)
    middle = 0.5 * (knot[:-1] + knot[1:])
    piece = np.clip(np.searchsorted(clock, middle, side="right") - 1, 0, len(clock) - 2)
    slow = ~standing & np.array([any(a < t < b for a, b in moves_slowly) for t in middle.tolist()])
    group, bounds = _groups(piece, standing, dwells)
    given = np.full(len(knot), np.nan)
    given[[0, -1]] = ends
    given[:-1][standing] = 0.0
    given[1:][standing] = 0.0
    unknown = np.where(np.isnan(given), np.cumsum(np.isnan(given)) - 1, -1)
    fitted = _joined_lines(time, speed, knot, standing)
    inner = np.array(interior, dtype=np.int64)
    return SpeedKnots(
        knot,
        piece,
        standing,
        slow,
        group,
        bounds,
        frozen(fitted),
        inner,
        unknown,
        np.nan_to_num(given),
    )


def _stands(t: float, clock: Floats, dwells: Bools, waits: list[tuple[float, float]]) -> bool:
    """Whether the template has the vehicle stand at time t."""
    k = min(max(int(np.searchsorted(clock, t, side="right")) - 1, 0), len(dwells) - 1)
    return bool(dwells[k]) or any(a <= t <= b for a, b in waits)


def _ramps(
    clock: Floats, dwells: Bools, waits: list[tuple[float, float]], ends: tuple[float, float]
) -> tuple[float, float]:
    """Time until which, and from which on, a vehicle rolls that stands in the template but is asked to move at that end."""
    inside = 0.5 * SHORTEST
    stands_there = [
        _stands(t, clock, dwells, waits) for t in (clock[0] + inside, clock[-1] - inside)
    ]
    rolls = [
        max(SHORTEST, v / _RAMP) if stands and v > STAND else 0.0
        for stands, v in zip(stands_there, ends, strict=True)
    ]
    return float(clock[0] + rolls[0]), float(clock[-1] - rolls[1])


def _cuts(
    clock: Floats,
    dwells: Bools,
    waits: list[tuple[float, float]],
    ends: tuple[float, float],
    moves_slowly: Sequence[tuple[float, float]],
) -> tuple[list[float], list[bool]]:
    """Times at which a primitive, a wait or a roll begins or ends, none nearer than `SHORTEST`; where the vehicle stands."""
    cuts = [float(t) for t in clock]
    if dwells.all():
        return cuts, [True] * len(dwells)
    rolls = _ramps(clock, dwells, waits, ends)
    for t in [*rolls, *(t for wait in (*waits, *moves_slowly) for t in wait)]:
        if clock[0] < t < clock[-1] and min(abs(t - c) for c in cuts) >= SHORTEST - 1e-9:
            cuts.append(float(t))
    cuts.sort()
    middle = [0.5 * (a + b) for a, b in pairwise(cuts)]
    return cuts, [rolls[0] < t < rolls[1] and _stands(t, clock, dwells, waits) for t in middle]


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


def _joined_lines(time: Floats, speed: Floats, knot: Floats, still: Bools) -> Floats:
    """Speeds (M,) [m/s] at `knot` (M,): straight lines between them fit `speed` (T,) best; zero where a stand begins or ends."""
    at = np.clip(np.searchsorted(knot, time, side="right") - 1, 0, len(still) - 1)
    share = (time - knot[at]) / np.diff(knot)[at]
    hats, rows = np.zeros((len(time), len(knot))), np.arange(len(time))
    hats[rows, at], hats[rows, at + 1] = 1.0 - share, share
    free = ~(np.append(still, False) | np.append(False, still))
    lines = np.where(free, np.interp(knot, time, speed), 0.0)
    moving = ~still[at]
    if free.any():  # changes to the speeds met at the knots: none where no sample says anything
        lines[free] += np.linalg.lstsq(
            hats[np.ix_(moving, free)], (speed - hats @ lines)[moving], rcond=None
        )[0]
    return np.asarray(np.maximum(lines, 0.0))


def best_knot(time: Floats, speed: Floats, a: float, b: float) -> float:
    """Time in (a, b) [s] at which two joined straight lines fit speeds (T,) [m/s] at times (T,) [s] best, by least squares."""
    inside = (time >= a) & (time <= b)
    t, v = time[inside], speed[inside]
    candidates = t[(t > a + 0.2 * (b - a)) & (t < b - 0.2 * (b - a))]
    if len(t) < 6 or len(candidates) < 2:
        return 0.5 * (a + b)
    cost = []
    for knot in candidates:
        basis = np.column_stack([np.ones_like(t), t - a, np.maximum(t - knot, 0.0)])
        cost.append(float(np.square(v - basis @ np.linalg.lstsq(basis, v, rcond=None)[0]).sum()))
    return float(candidates[int(np.argmin(np.round(cost, 9)))])
