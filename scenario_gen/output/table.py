# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The criticality of each scenario as a table, and scenarios selected by a condition."""

from dataclasses import replace
from typing import TYPE_CHECKING

from scenario_gen.base.errors import describe, InputError
from scenario_gen.method.evaluation import MEASURES
from scenario_gen.types import GenerationResult, join_ego, Note, NoteKind

if TYPE_CHECKING:
    from pandas import DataFrame


def measures(result: GenerationResult) -> "DataFrame":
    """Return a row for each scenario of a result; the ego's reference drive counts as a vehicle.

    Columns: scenario (its index), seconds [s], ttc [s], pet [s], arrival_gap [s], distance [m] and
    closing_speed [m/s], each of the most critical pair of vehicles, speed [m/s] and braking
    [m/s²], the largest of all vehicles. A figure that no pair has is NaN; without a collision
    course, ttc is infinite.
    """
    import pandas as pd

    figures = ["ttc", "pet", "arrival_gap", "gap", "closing_speed"]
    rows = [
        [
            scenario.index,
            float(scenario.time[-1]),
            *(MEASURES.figure(scenario, name, None) for name in figures),
            float(scenario.speed.max()),
            float(-scenario.acceleration.min()),
        ]
        for scenario in map(join_ego, result)
    ]
    columns = ["scenario", "seconds", *figures, "speed", "braking"]
    return pd.DataFrame(rows, columns=columns).rename(columns={"gap": "distance"})


def filter_scenarios(result: GenerationResult, condition: str) -> GenerationResult:
    """Return a result with the scenarios that meet a condition.

    Figures of the whole set (evaluation, references, coverage) are left out.

    Args:
        result: from `generate`, or read from a bag.
        condition: an expression on the columns of `measures` in the syntax of
            `pandas.DataFrame.query`: "ttc < 2 and speed > 5".

    Raises:
        InputError: the condition cannot be evaluated.
    """
    table = measures(result)
    try:
        scenarios = tuple(result[int(k)] for k in table.query(condition).index)
    except Exception as error:  # pandas raises errors of any type
        columns = ", ".join(table.columns)
        raise InputError(
            f"condition {condition!r}: {describe(error)}; the columns are {columns}"
        ) from error
    note = Note.of(NoteKind.FILTERED, condition=condition, kept=len(scenarios), total=len(result))
    generated = replace(
        result.generated, scenarios=scenarios, adaptations=(*result.generated.adaptations, note)
    )
    return result.with_scenarios(generated)
