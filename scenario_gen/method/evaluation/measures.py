# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Criticality of a scenario, pair by pair: figures for targets and the coverage page.

They are taken on the published samples (0.1 s). Of a pair a, b:

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
  shifted to meet b; 0 if it would. See `scenario_gen.method.evaluation.non_reactive`.

Over all pairs the most critical value counts: the least, of `closing_speed` the greatest.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, permutations
import math

import numpy as np

from scenario_gen.method.evaluation.criticality import least_distance_and_ttc
from scenario_gen.method.evaluation.non_reactive import blind_margin
from scenario_gen.numerics.plane import unit
from scenario_gen.situation import (
    Conflict,
    conflicts_by_pair,
    encroachment,
    find_conflicts,
    PairConflicts,
)
from scenario_gen.types import Measures, Motion, Pair

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
