# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The bars: thresholds of the rates of failures that a planner must meet to pass."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import NamedTuple

import pandas as pd

from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.closed_loop.trials import Outcome, rates
from scenario_gen.closed_loop.verdict import DriveVerdict


class Figure(NamedTuple):
    """A figure of a verdict that says how risky a drive was, though it may have passed.

    Attributes:
        unit: of the figure.
        low_is_risky: whether low values are risky, else high ones.
        limit: value beyond which a drive is risky.
    """

    unit: str
    low_is_risky: bool
    limit: float

    def is_risky(self, value: float) -> bool:
        """Whether a value is beyond the limit; NaN is not."""
        return value < self.limit if self.low_is_risky else value > self.limit


FIGURES = {
    "min_ttc": Figure("s", low_is_risky=True, limit=1.5),
    "min_pet": Figure("s", low_is_risky=True, limit=1.0),
    "imposed_braking": Figure("m/s²", low_is_risky=False, limit=2.0),
}
"""The figures that bars bound, and that comparisons and mutants compare drive by drive."""


def figures_of(verdicts: Sequence[DriveVerdict]) -> pd.DataFrame:
    """Return the figures of drives, a column each; NaN where one does not exist."""
    rows = [[getattr(verdict, name) for name in FIGURES] for verdict in verdicts]
    return pd.DataFrame(rows, columns=[*FIGURES], dtype=float)


@dataclass(frozen=True)
class Bars(Parameters):
    """The thresholds that a planner must meet to pass."""

    collisions: float = parameter(
        0.0, "largest share of drives with a collision", low=0.0, high=1.0
    )
    off_road: float = parameter(
        0.0, "largest share of drives that leave the road", low=0.0, high=1.0
    )
    goals: float = parameter(
        1.0, "smallest share of drives that reach the goal", low=0.0, high=1.0
    )
    at_fault: float = parameter(
        0.0, "largest share of drives with a collision by the ego's fault", low=0.0, high=1.0
    )
    faults: float = parameter(
        0.0,
        "largest share of drives with a command that is missing or not finite, or a teleport",
        low=0.0,
        high=1.0,
    )
    took_turn: float = parameter(
        0.0,
        "largest share of drives in which a vehicle that goes first brakes hard for the ego",
        low=0.0,
        high=1.0,
    )
    criteria: float = parameter(
        0.0, "largest share of drives that miss one of the criteria", low=0.0, high=1.0
    )
    progress: float = parameter(
        0.9,
        "smallest share of drives with progress: 20 % of the reference drive's path, as in nuPlan",
        low=0.0,
        high=1.0,
    )
    min_ttc: float = parameter(
        0.0, "smallest time to collision in any drive", unit="s", low=0.0, high=60.0
    )
    min_pet: float = parameter(
        -100.0, "smallest post-encroachment time in any drive", unit="s", low=-100.0, high=100.0
    )
    imposed_braking: float = parameter(
        100.0,
        "hardest braking, in any drive, of a vehicle whose turn the ego takes",
        unit="m/s²",
        low=0.0,
        high=100.0,
    )


LOWER_BARS = ("goals", "progress", "min_ttc", "min_pet")
"""The bars that are lower bounds."""


def broken_bars(outcomes: Sequence[Outcome], bars: Bars) -> list[str]:
    """Return a sentence for each bar that the outcomes do not meet."""
    shares = {name: 100.0 * rate.share.value for name, rate in rates(outcomes).items()}
    figures = figures_of([outcome.verdict for outcome in outcomes])
    messages = []
    for name, bar in asdict(bars).items():
        if name in FIGURES:
            worst = figures[name].min() if name in LOWER_BARS else figures[name].max()
            messages.append(_broken_bar(name, worst, bar, FIGURES[name].unit, digits=2))
        elif name in shares:  # not criteria, if none is used
            messages.append(_broken_bar(name, shares[name], 100.0 * bar, "%", digits=1))
    return [message for message in messages if message]


def _broken_bar(name: str, value: float, bar: float, unit: str, digits: int) -> str:
    """Return a sentence on a bar that a value does not meet, else ""."""
    is_lower = name in LOWER_BARS
    if not (value < bar if is_lower else value > bar):
        return ""
    side = "at least" if is_lower else "at most"
    required = f"{side} {bar:.{digits}f} {unit} is required"
    return f"{name}: {value:.{digits}f} {unit}; {required}"
