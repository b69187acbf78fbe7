# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Criticality of a scenario, pair by pair: how near vehicles come to each other.

The figures are taken on the published samples (0.1 s). Of a pair a, b:

- `pet`: post-encroachment time [s] (Allen, Shin & Cooper 1978): from the first one's exit of the
  area that both footprints sweep to the second one's entry; negative if both were inside at once.
  Of crossing and merging pairs only, see `scenario_gen.situation.encroachment`.
- `arrival_gap` [s]: from the first one's entry into that area to the second one's. Of a named pair
  [a,b] it has a sign: negative if b is first. Of crossing and merging pairs only.
- `ttc` [s]: least time to collision while both keep their velocities (Hayward 1972), of the
  footprints; infinite if they are never on a collision course.
- `gap` [m]: least distance of the two footprints.
- `closing_speed` [m/s]: rate at which the distance of the two centres shrinks when the first one
  enters the conflict area; of a pair that neither crosses nor merges the greatest rate while both
  are there.
- `blind_margin` [s]: mean time by which vehicle a, at four constant speeds, would have to be
  shifted to meet b; 0 if it would. See `scenario_gen.method.evaluation.time_shift`.

Over all pairs the most critical value counts: the least, of `closing_speed` the greatest.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, permutations
import math
from typing import NamedTuple

import numpy as np

from scenario_gen.method.evaluation.time_shift import blind_margin
from scenario_gen.numerics import Floats, unit
from scenario_gen.numerics.boxes import Box, box_distance, time_to_touch
from scenario_gen.numerics.kernels import B, F, F1, F2, kernel, named, OUT1
from scenario_gen.situation import (
    Conflict,
    conflicts_by_pair,
    encroachment,
    find_conflicts,
    PairConflicts,
)
from scenario_gen.types import Measures, Motion, Pair


def footprint_distance(motion: Motion, a: int, b: int) -> Floats:
    """Return the distance (T,) [m] between footprints a and b; 0 where they overlap."""
    return distance_and_ttc(motion, a, b)[0]


def distance_and_ttc(motion: Motion, a: int, b: int) -> tuple[Floats, Floats]:
    """Return the distance [m] of two footprints and the time to collision [s], (T,) each."""
    distance, time = np.empty_like(motion.time), np.empty_like(motion.time)
    rows = slice(None)
    _fill_nearness(_driven(motion, a, rows), _driven(motion, b, rows), False, distance, time)
    return distance, time


def least_distance_and_ttc(motion: Motion, a: int, b: int) -> tuple[float, float]:
    """Return the least distance [m] and time to collision [s] while both vehicles are present."""
    both = motion.present_slice(a, b)
    distance, time = np.empty_like(motion.time[both]), np.empty_like(motion.time[both])
    _fill_nearness(_driven(motion, a, both), _driven(motion, b, both), True, distance, time)
    return float(distance.min()), float(time.min())


class _Driven(NamedTuple):
    """Positions (T, 2) [m], directions (T, 2), speeds (T,) [m/s], half length, half width [m]."""

    position: Floats
    ahead: Floats
    speed: Floats
    length: float
    width: float


def _driven(motion: Motion, n: int, rows: slice) -> _Driven:
    """Return the motion of one vehicle at some samples."""
    heading, half = motion.heading[n, rows], motion.vehicles[n].half
    return _Driven(motion.position[n, rows], unit(heading), motion.speed[n, rows], *half)


_DRIVEN = named(_Driven, F2, F2, F1, F, F)


@kernel(inline=True)
def _box(driven: _Driven, t: int) -> Box:
    position, ahead = driven.position[t], driven.ahead[t]
    return Box(position[0], position[1], ahead[0], ahead[1], driven.length, driven.width)


@kernel(_DRIVEN, _DRIVEN, B, OUT1, OUT1)
def _fill_nearness(a: _Driven, b: _Driven, least: bool, distance: Floats, time: Floats) -> None:
    """Fill `distance` (T,) [m] and `time` (T,) [s].

    With `least`, values that cannot be the least ones of all samples may be infinite.
    """
    reach = np.hypot(a.length, a.width) + np.hypot(b.length, b.width)
    nearest, soonest = np.inf, np.inf
    for t in range(len(time)):
        first, second = _box(a, t), _box(b, t)
        dx, dy = second.x - first.x, second.y - first.y
        room = np.hypot(dx, dy) - reach
        distance[t] = np.inf
        if not least or room <= nearest:
            distance[t] = box_distance(first, second)
            nearest = min(nearest, distance[t])
        vx = b.speed[t] * second.cos - a.speed[t] * first.cos
        vy = b.speed[t] * second.sin - a.speed[t] * first.sin
        speed = np.hypot(vx, vy)
        recedes = dx * vx + dy * vy >= 0.0 or abs(dx * vy - dy * vx) > reach * speed
        time[t] = np.inf
        if room <= 0.0 or not (recedes or room > soonest * speed):
            time[t] = time_to_touch(first, second, vx, vy)
            soonest = min(soonest, time[t])


@dataclass(frozen=True)
class Criticality:
    """What one motion came to.

    Source: time to collision, Hayward 1972; post-encroachment time, Allen, Shin & Cooper 1978.

    Attributes:
        min_distance: least distance between two footprints [m]; NaN with one vehicle.
        min_ttc: least time to collision [s], at most the horizon; likewise.
        pet: least post-encroachment time [s] of two vehicles that cross or merge; NaN without
            such a pair, see `encroachment`.
        order: (pair, which of them went first) of every conflict, by vehicle index.
    """

    min_distance: float
    min_ttc: float
    pet: float
    order: tuple[tuple[tuple[int, int], int], ...]

    def keeps_order_of(self, template: "Criticality") -> float:
        """Return the share of the template's conflicts found here that have the same order."""
        mine = dict(self.order)
        same = [mine[pair] == first for pair, first in template.order if pair in mine]
        return float(np.mean(same)) if same else math.nan


def criticality(motion: Motion, horizon: float) -> Criticality:
    """Measure one motion; a time to collision above `horizon` [s] counts as the horizon."""
    distances, times = [], [horizon]
    for a, b in combinations(range(len(motion.vehicles)), 2):
        both = motion.present_slice(a, b)
        if both.stop > both.start:
            distance, ttc = least_distance_and_ttc(motion, a, b)
            distances.append(distance)
            times.append(ttc)
    conflicts = find_conflicts(motion)
    encroachments = [encroachment(motion, conflict) for conflict in conflicts]
    return Criticality(
        min_distance=min(distances, default=math.nan),
        min_ttc=min(times) if distances else math.nan,
        pet=float(np.fmin.reduce(encroachments, initial=math.nan)),
        order=tuple((conflict.pair, conflict.first) for conflict in conflicts),
    )


FIGURE_PERIOD_S = 0.1  # of the published samples
_CONFLICT_FIGURES = ("pet", "arrival_gap", "closing_speed")


@dataclass(frozen=True)
class PairFigures:
    """All figures of one pair (a < b), NaN if undefined; `first` enters their area first."""

    pair: Pair
    first: int | None
    pet: float
    arrival_gap: float
    ttc: float
    gap: float
    closing_speed: float


def measure(scenario: Motion, name: str, pair: Pair | None = None) -> float:
    """Return one figure of a pair, or the most critical of all pairs; NaN where no pair has it.

    Args:
        scenario: with all its vehicles, an ego's reference drive too.
        name: of the figure, see above.
        pair: indices of two vehicles, the sign of `arrival_gap` follows their order; of one: its
            most critical pair.
    """
    motion = scenario.resampled(FIGURE_PERIOD_S)
    ordered = permutations(range(len(motion.vehicles)), 2)
    chosen, directed = pair or (), name == "blind_margin"
    pairs = [
        (a, b)
        for a, b in ordered
        if (a, b)[: len(chosen)] == chosen and (chosen or a < b or directed)
    ]
    sought = (pairs if chosen else None) if name in _CONFLICT_FIGURES else []
    met = conflicts_by_pair(find_conflicts(motion, sought))
    values = [value for a, b in pairs if not math.isnan(value := _figure(motion, name, a, b, met))]
    if len(chosen) < 2 and name == "arrival_gap":
        values = [abs(value) for value in values]
    return (max if name == "closing_speed" else min)(values, default=math.nan)


def figures_of(scenario: Motion, pair: Pair | None = None) -> tuple[PairFigures, ...]:
    """Return all figures of each pair that is present together; `arrival_gap` unsigned.

    Args:
        scenario: with all its vehicles.
        pair: the only pair (a < b) of interest; None: all pairs.
    """
    motion = scenario.resampled(FIGURE_PERIOD_S)
    met = conflicts_by_pair(find_conflicts(motion))
    figures = []
    for a, b in combinations(range(len(motion.vehicles)), 2) if pair is None else [pair]:
        both = motion.present_slice(a, b)
        if both.stop - both.start < 2:
            continue
        crossing = _crossing(met.get((a, b)))
        gap, ttc = least_distance_and_ttc(motion, a, b)
        figures.append(
            PairFigures(
                (a, b),
                None if crossing is None else crossing.first,
                _figure(motion, "pet", a, b, met),
                math.nan if crossing is None else crossing.arrival_gap,
                ttc,
                gap,
                _closing_speed(motion, a, b, crossing),
            )
        )
    return tuple(figures)


def most_critical(figures: Sequence[PairFigures]) -> PairFigures | None:
    """Return the pair with the least PET or, without a crossing, with the least gap."""
    crossing = [pair for pair in figures if not math.isnan(pair.pet)]
    return (
        min(crossing, key=lambda pair: pair.pet)
        if crossing
        else min(figures, key=lambda pair: pair.gap, default=None)
    )


MEASURES = Measures(measure)
"""What sampling towards a target, and a choice, measure with."""


def _crossing(conflict: Conflict | None) -> Conflict | None:
    """Return a conflict of two vehicles whose paths cross or merge, else None."""
    return None if conflict is None or conflict.following else conflict


def _figure(motion: Motion, name: str, a: int, b: int, met: PairConflicts) -> float:
    both = motion.present_slice(a, b)
    if both.stop - both.start < 2:
        return math.nan
    if name == "blind_margin":
        return blind_margin(motion, a, b)
    if name == "ttc":
        return least_distance_and_ttc(motion, a, b)[1]
    if name == "gap":
        return least_distance_and_ttc(motion, a, b)[0]
    conflict = met.get((min(a, b), max(a, b)))
    if name == "pet":
        return math.nan if conflict is None else encroachment(motion, conflict)
    conflict = _crossing(conflict)
    if name == "closing_speed":
        return _closing_speed(motion, a, b, conflict)
    if conflict is None:
        return math.nan
    return conflict.arrival_gap if conflict.first == a else -conflict.arrival_gap


def _closing_speed(motion: Motion, a: int, b: int, conflict: Conflict | None) -> float:
    """The closing speed [m/s] of two centres at the conflict's first entry, else the greatest."""
    both = motion.present_slice(a, b)
    if conflict is not None:  # at the sample nearest to it at which both are there
        at = min(max(round(conflict.entry_first / motion.dt), both.start), both.stop - 1)
        both = slice(at, at + 1)
    way = motion.position[b, both] - motion.position[a, both]
    velocity = motion.speed[[a, b], both, None] * unit(motion.heading[[a, b], both])
    distance = np.maximum(np.hypot(way[:, 0], way[:, 1]), 1e-9)
    return float((-((velocity[1] - velocity[0]) * way).sum(axis=-1) / distance).max())
