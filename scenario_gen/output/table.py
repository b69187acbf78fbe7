# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Scenarios and their criticality as tables, and scenarios selected by a condition."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from itertools import count
import math
from typing import TYPE_CHECKING

import numpy as np

from scenario_gen.base.errors import describe, InputError, needs
from scenario_gen.method.evaluation.measures import measure
from scenario_gen.numerics import Floats
from scenario_gen.types import (
    GenerationResult,
    join_ego,
    Motion,
    Note,
    NoteKind,
    Scenario,
)

if TYPE_CHECKING:
    from pandas import DataFrame


def _parquet(table: "DataFrame") -> bytes:
    needs("parquet", "pyarrow")
    return bytes(table.to_parquet(engine="pyarrow", index=False))


TABLES: Mapping[str, Callable[["DataFrame"], bytes]] = {
    "csv": lambda table: table.to_csv(index=False).encode(),
    "parquet": _parquet,
}
"""The content of a file with a table, by its suffix."""


def measures(motions: Iterable[Motion]) -> "DataFrame":
    """Return a row for each scenario of a result, or for each of some scenarios or encounters.

    The ego's reference drive counts as a vehicle.

    Columns: scenario (number), seconds [s], ttc [s], pet [s], arrival_gap [s], distance [m] and
    closing_speed [m/s], each of the most critical pair of vehicles, speed [m/s] and braking
    [m/s²], the largest of all vehicles. A figure that no pair has is NaN: ttc without a collision
    course, pet without crossing paths.
    """
    import pandas as pd

    figures = ["ttc", "pet", "arrival_gap", "gap", "closing_speed"]
    rows = [
        [
            number,
            motion.duration,
            *(measure(motion, name) for name in figures),
            float(motion.speed.max()),
            float(-accelerations.min()),
        ]
        for number, motion, accelerations in map(_joined, count(), motions)
    ]
    columns = ["scenario", "seconds", *figures, "speed", "braking"]
    table = pd.DataFrame(rows, columns=columns).rename(columns={"gap": "distance"})
    return table.replace(math.inf, math.nan)


def _joined(k: int, motion: Motion) -> tuple[int, Motion, Floats]:
    """Return the number of a scenario, or k of an encounter; its motion and accelerations."""
    if isinstance(motion, Scenario):
        scenario = join_ego(motion)
        return motion.index, scenario, scenario.acceleration
    return k, motion, np.diff(motion.speed) / motion.dt


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
