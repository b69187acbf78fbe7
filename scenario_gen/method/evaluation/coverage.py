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

PET_EDGES_S = (0.0, 0.5, 1.0, 2.0, 4.0)
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
    whole = [join_ego(scenario) for scenario in measured(scenarios)]
    each = [figures_of(scenario) for scenario in whole]
    rows = [
        _row(scenario, most_critical(figures))
        for scenario, figures in zip(whole, each, strict=True)
    ]
    template = _row(encounter, most_critical(figures_of(encounter)))
    spreads = {
        name: Spread(label, unit, tuple(row[name] for row in rows), template[name])
        for name, (label, unit) in LABELS.items()
    }
    pairs: dict[str, Counter[int]] = {}
    for scenario, figures in zip(whole, each, strict=True):
        names = [manoeuvre_of(float(heading[-1] - heading[0])) for heading in scenario.heading]
        for figure in figures:
            kind = " and ".join(sorted(names[n] for n in figure.pair))
            pairs.setdefault(kind, Counter())[_bin(figure.pet)] += 1
    orders = Counter(
        join_pieces(scenario.facts.passing_order)
        for scenario in whole
        if scenario.facts.passing_order
    )
    index = tuple(scenario.index for scenario in whole)
    return Coverage(
        index,
        spreads,
        PET_BINS,
        {
            kind: tuple(counts[k] for k in range(len(PET_BINS)))
            for kind, counts in sorted(pairs.items())
        },
        _picks(index, rows, template),
        dict(sorted(orders.items())),
    )


def _row(motion: Scenario | Encounter, figures: PairFigures | None) -> dict[str, float]:
    there = motion.is_present
    row = dict.fromkeys(LABELS, math.nan) | {"speed": float(motion.speed[there].mean())}
    if figures is not None:
        row |= {name: getattr(figures, name) for name in LABELS if name != "speed"}
    return row


def _bin(pet: float) -> int:
    return (
        len(PET_BINS) - 1
        if math.isnan(pet)
        else int(np.searchsorted(PET_EDGES_S, pet, side="right"))
    )


def _picks(
    index: Sequence[int], rows: Sequence[dict[str, float]], template: dict[str, float]
) -> dict[str, int]:
    """Index of the scenarios that stand out."""
    if not rows:
        return {}
    table = np.array([[row[name] for name in ALIKE] for row in rows])
    own = np.array([template[name] for name in ALIKE])
    critical = table[:, 0] if np.isfinite(table[:, 0]).any() else table[:, 2]
    middle = np.array(
        [
            float(np.median(column[np.isfinite(column)])) if np.isfinite(column).any() else 0.0
            for column in table.T
        ]
    )
    spread = np.maximum(
        np.array(
            [float(np.nanstd(column)) if np.isfinite(column).any() else 1.0 for column in table.T]
        ),
        1e-3,
    )
    return {
        "most critical": index[int(np.argmin(np.where(np.isfinite(critical), critical, np.inf)))],
        "most typical": index[int(np.argmin(_from(table, middle, spread)))],
        "most different": index[int(np.argmax(_from(table, own, spread)))],
    }


def _from(table: Floats, centre: Floats, spread: Floats) -> Floats:
    """Squared distances (S,) of rows to a centre in spreads; a missing value counts as 1."""
    step = (table - centre) / spread
    return np.asarray(np.square(np.where(np.isfinite(step), step, 1.0)).sum(axis=1))
