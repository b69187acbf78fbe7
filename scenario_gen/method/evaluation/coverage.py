# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Coverage of a set: distributions of criticality, manoeuvres, and notable scenarios."""

from collections import Counter
from collections.abc import Sequence
import math

import numpy as np

from scenario_gen.method.evaluation.evaluate import measured
from scenario_gen.method.evaluation.measures import figures_of, most_critical, PairFigures
from scenario_gen.numerics import Floats
from scenario_gen.situation import manoeuvre_of
from scenario_gen.types import (
    Coverage,
    Encounter,
    join_ego,
    join_pieces,
    Scenario,
    Spread,
)

PET_BINS = (
    "below 0 s",
    "0 … 0.5 s",
    "0.5 … 1 s",
    "1 … 2 s",
    "2 … 4 s",
    "4 s and more",
    "no crossing",
)
LABELS = {
    "pet": ("PET", "s"),
    "ttc": ("time to collision", "s"),
    "gap": ("minimum gap", "m"),
    "arrival_gap": ("arrival gap", "s"),
    "closing_speed": ("closing speed", "m/s"),
    "speed": ("mean speed", "m/s"),
}
ALIKE = (
    "pet",
    "arrival_gap",
    "gap",
    "closing_speed",
    "speed",
)  # by which scenarios are typical or different


def coverage_of(encounter: Encounter, scenarios: Sequence[Scenario]) -> Coverage:
    """Measure the coverage of a set; of a large set the same scenarios as in the evaluation.

    The figures are those of a scenario's most critical pair (`most_critical`). Most critical is
    the scenario with the least PET, or, if nobody crosses, the least gap; most typical the one
    nearest to the medians of the set, each figure in units of its spread; most different the one
    farthest from the template.
    """
    joined = [join_ego(scenario) for scenario in measured(scenarios)]
    figures = [figures_of(scenario) for scenario in joined]
    rows = [_row(*each) for each in zip(joined, map(most_critical, figures), strict=True)]
    template = _row(encounter, most_critical(figures_of(encounter)))
    spreads = {
        name: Spread(label, unit, tuple(row[name] for row in rows), template[name])
        for name, (label, unit) in LABELS.items()
    }
    orders = Counter(
        join_pieces(scenario.facts.passing_order)
        for scenario in joined
        if scenario.facts.passing_order
    )
    index = tuple(scenario.index for scenario in joined)
    return Coverage(
        index,
        spreads,
        PET_BINS,
        _pairs_by_manoeuvres(joined, figures),
        _picks(index, rows, template),
        dict(sorted(orders.items())),
    )


def _pairs_by_manoeuvres(
    scenarios: Sequence[Scenario], figures: Sequence[Sequence[PairFigures]]
) -> dict[str, tuple[int, ...]]:
    """Return the number of pairs in each bin of PET, by the pair's manoeuvres."""
    counts: dict[str, list[int]] = {}
    for scenario, pairs in zip(scenarios, figures, strict=True):
        names = [manoeuvre_of(float(heading[-1] - heading[0])) for heading in scenario.heading]
        for pair in pairs:
            kind = " and ".join(sorted(names[n] for n in pair.pair))
            counts.setdefault(kind, [0] * len(PET_BINS))[_bin(pair.pet)] += 1
    return {kind: tuple(counts[kind]) for kind in sorted(counts)}


def _row(motion: Scenario | Encounter, figures: PairFigures | None) -> dict[str, float]:
    speed = float(motion.speed[motion.is_present].mean())
    row = dict.fromkeys(LABELS, math.nan) | {"speed": speed}
    if figures is not None:
        row |= {name: getattr(figures, name) for name in LABELS if name != "speed"}
    return row


def _bin(pet: float) -> int:
    return (
        len(PET_BINS) - 1
        if math.isnan(pet)
        else int(np.searchsorted((0.0, 0.5, 1.0, 2.0, 4.0), pet, side="right"))
    )


def _picks(
    index: Sequence[int], rows: Sequence[dict[str, float]], template: dict[str, float]
) -> dict[str, int]:
    """Return the indices of the notable scenarios."""
    if not rows:
        return {}
    table = np.array([[row[name] for name in ALIKE] for row in rows])
    target = np.array([template[name] for name in ALIKE])
    critical = table[:, 0] if np.isfinite(table[:, 0]).any() else table[:, 2]
    columns = [column[np.isfinite(column)] for column in table.T]
    median = np.array([np.median(known) if known.size else 0.0 for known in columns])
    deviation = np.array([known.std() if known.size else 1.0 for known in columns])
    spread = np.maximum(deviation, 1e-3)
    return {
        "most critical": index[int(np.argmin(np.where(np.isfinite(critical), critical, np.inf)))],
        "most typical": index[int(np.argmin(_squared_distance(table, median, spread)))],
        "most different": index[int(np.argmax(_squared_distance(table, target, spread)))],
    }


def _squared_distance(table: Floats, centre: Floats, spread: Floats) -> Floats:
    """Return squared distances (S,) of rows to a centre in spreads; a missing value adds 1."""
    step = (table - centre) / spread
    return np.asarray(np.square(np.where(np.isfinite(step), step, 1.0)).sum(axis=1))
