# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How critical each scenario of a result is, as a table; and the scenarios for which a condition holds."""

from dataclasses import replace
from typing import TYPE_CHECKING

from scenario_gen.base.errors import describe, InputError
from scenario_gen.method.evaluation import MEASURES
from scenario_gen.types import (
    Evaluation,
    GenerationResult,
    join_ego,
    Note,
    NoteKind,
)

if TYPE_CHECKING:
    from pandas import DataFrame

FIGURES = {
    "ttc": "ttc",
    "pet": "pet",
    "arrival_gap": "arrival_gap",
    "distance": "gap",
    "closing_speed": "closing_speed",
}
"""Columns, and the measure that each one holds."""


def measures(result: GenerationResult) -> "DataFrame":
    """Return a row for each scenario of a result; an ego's witness counts as a vehicle.

    Columns: scenario (its index), seconds [s], ttc [s], pet [s], arrival_gap [s], distance [m], closing_speed [m/s] (the most
    critical pair of each, NaN where no pair has one, ttc infinite without a collision course), speed [m/s] and braking [m/s²]
    (the greatest of all vehicles).
    """
    import pandas as pd

    rows = []
    for scenario in map(join_ego, result):
        figures = {
            column: MEASURES.figure(scenario, name, None) for column, name in FIGURES.items()
        }
        most = {
            "speed": float(scenario.speed.max()),
            "braking": float(-scenario.acceleration.min()),
        }
        rows.append(
            {"scenario": scenario.index, "seconds": float(scenario.time[-1]), **figures, **most}
        )
    return pd.DataFrame(rows, columns=["scenario", "seconds", *FIGURES, "speed", "braking"])


def filter_scenarios(result: GenerationResult, condition: str) -> GenerationResult:
    """Return the result with those of its scenarios for which a condition holds, and without the figures of the whole set.

    Args:
        result: of `generate`, or read from a bag.
        condition: over the columns of `measures`, as `pandas.DataFrame.query` takes it: "ttc < 2 and speed > 5".

    Raises:
        InputError: the condition cannot be evaluated.
    """
    table = measures(result)
    try:
        kept = table.query(condition).index
        scenarios = tuple(result[int(k)] for k in kept)
    except Exception as error:  # what pandas makes of any text
        columns = ", ".join(table.columns)
        raise InputError(
            f"condition {condition!r}: {describe(error)}; the columns are {columns}"
        ) from error
    note = Note.of(NoteKind.FILTERED, condition=condition, kept=len(scenarios), total=len(result))
    generated = replace(
        result.generated, scenarios=scenarios, adaptations=(*result.generated.adaptations, note)
    )
    return replace(
        result,
        generated=generated,
        evaluation=Evaluation.empty(),
        references={},
        refusals={},
        coverage=None,
        valid=None,
    )
