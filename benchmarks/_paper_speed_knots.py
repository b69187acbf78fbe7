# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The knots of the paper's speed profile, and the template's speeds between them.

The target of a speed profile is a chain of straight lines, joined at changepoints, at interior
knots and at the ends of stands, that fits the template's speed best by least squares. The interior
knot of a primitive lies where the template bends.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from scenario_gen.numerics import Bools, Floats, frozen, Ints

STAND_MPS = 0.05
"""A vehicle with an asked speed below this stands."""
MIN_DISTANCE_S = 0.2
"""Between two knots in the template."""
KNOT_DISTANCE_S = 0.25
"""From a primitive's knot to its ends: at most one knot lies between two samples."""
RAMP_MPS2 = 1.5
"""Deceleration to a stand of a vehicle with an asked speed."""
Waits = list[tuple[float, float]]


@dataclass(frozen=True, eq=False)
class SpeedKnots:
    """The knots of one vehicle on the template's clock.

    Attributes:
        knot: (M,) seconds.
        piece: (M - 1,) primitive of each interval.
        group: (M - 1,) length constraint of each moving interval, -1 where it stands.
        bounds: (G, 2) anchors at which each length constraint begins and ends.
        lines: (M,) m/s, v̂ at the knots: the straight lines that fit the template's speed best.
        interior: numbers of the knots inside primitives.
        unknown: (M,) number of each knot's unknown speed, -1 where it is given.
        given: (M,) m/s, the speed where it is given, 0 elsewhere.
    """

    knot: Floats
    piece: Ints
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

    @property
    def size(self) -> int:
        """Number of unknown speeds."""
        return int(self.unknown.max(initial=-1)) + 1


def speed_knots(
    clock: Floats,
    dwells: Bools,
    waits: Waits,
    time: Floats,
    speed: Floats,
    ends: tuple[float, float],
    knot_share: float | None = None,
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
        knot_share: place of the knot as a share of its primitive; 0: no knot; None: where the
            template bends.
    """
    cuts, still = _cuts(clock, dwells, waits, ends)
    knots, stands, interior = [cuts[0]], list[bool](), list[int]()
    for a, b, stand in zip(cuts[:-1], cuts[1:], still, strict=True):
        if not stand and knot_share != 0.0:
            at = best_knot(time, speed, a, b) if knot_share is None else a + knot_share * (b - a)
            distance = min(KNOT_DISTANCE_S, 0.5 * (b - a))
            interior.append(len(knots))
            knots.append(min(max(at, a + distance), b - distance))
            stands.append(False)
        knots.append(b)
        stands.append(stand)
    knot, standing = np.array(knots), np.array(stands)
    middle = 0.5 * (knot[:-1] + knot[1:])
    piece = np.clip(np.searchsorted(clock, middle, side="right") - 1, 0, len(clock) - 2)
    group, bounds = _groups(piece, standing, dwells)
    given = np.full(len(knot), np.nan)
    given[[0, -1]] = ends
    given[:-1][standing] = 0.0
    given[1:][standing] = 0.0
    unknown = np.where(np.isnan(given), np.cumsum(np.isnan(given)) - 1, -1)
    return SpeedKnots(
        knot,
        piece,
        group,
        bounds,
        frozen(_joined_lines(time, speed, knot, standing)),
        np.array(interior, dtype=np.int64),
        unknown,
        np.nan_to_num(given),
    )


def _stands(t: float, clock: Floats, dwells: Bools, waits: Waits) -> bool:
    """Whether the template has the vehicle stand at time t."""
    k = min(max(int(np.searchsorted(clock, t, side="right")) - 1, 0), len(dwells) - 1)
    return bool(dwells[k]) or any(a <= t <= b for a, b in waits)


def _cuts(
    clock: Floats, dwells: Bools, waits: Waits, ends: tuple[float, float]
) -> tuple[list[float], list[bool]]:
    """Return the borders of primitives, waits and ramps, and which intervals are stands.

    A vehicle that stands in the template but has an asked speed at that end rolls on a ramp.
    """
    cuts = [float(t) for t in clock]
    if dwells.all():
        return cuts, [True] * len(dwells)
    inside = 0.5 * MIN_DISTANCE_S
    ramps = [
        max(MIN_DISTANCE_S, v / RAMP_MPS2)
        if _stands(t, clock, dwells, waits) and v > STAND_MPS
        else 0.0
        for t, v in zip((clock[0] + inside, clock[-1] - inside), ends, strict=True)
    ]
    first, last = float(clock[0] + ramps[0]), float(clock[-1] - ramps[1])
    for t in [first, last, *np.ravel(waits).tolist()]:
        if clock[0] < t < clock[-1] and min(abs(t - c) for c in cuts) >= MIN_DISTANCE_S - 1e-9:
            cuts.append(t)
    cuts.sort()
    middle = [0.5 * (a + b) for a, b in pairwise(cuts)]
    return cuts, [first < t < last and _stands(t, clock, dwells, waits) for t in middle]


def _groups(piece: Ints, still: Bools, dwells: Bools) -> tuple[Ints, Ints]:
    """Return the length constraints: one per primitive that moves.

    A length that cannot be driven within its own primitive (a route that moves while the vehicle
    stands, a vehicle that still rolls while the route dwells) belongs to the next primitive that
    moves, or to the last one.
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
    """Return speeds (M,) [m/s] at the knots whose lines fit `speed` (T,) best; zero at stands."""
    at = np.clip(np.searchsorted(knot, time, side="right") - 1, 0, len(still) - 1)
    share = (time - knot[at]) / np.diff(knot)[at]
    hats, rows = np.zeros((len(time), len(knot))), np.arange(len(time))
    hats[rows, at] = 1.0 - share
    hats[rows, at + 1] = share
    free = ~(np.append(still, False) | np.append(False, still))
    lines = np.where(free, np.interp(knot, time, speed), 0.0)
    moving = ~still[at]
    if free.any():  # corrections of the speeds at the knots: none where there is no sample
        residual = (speed - hats @ lines)[moving]
        lines[free] += np.linalg.lstsq(hats[np.ix_(moving, free)], residual, rcond=None)[0]
    return np.asarray(np.maximum(lines, 0.0))


def best_knot(time: Floats, speed: Floats, a: float, b: float) -> float:
    """Return the time in (a, b) [s] at which two joined lines fit speeds (T,) [m/s] best."""
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
