# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Results of the evaluation: metrics with intervals, and the measures of one scenario."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
import json
import math
import re
from typing import Literal, TYPE_CHECKING

from scenario_gen.base.errors import printable
from scenario_gen.types.facts import Facts
from scenario_gen.types.html import html_list, html_table
from scenario_gen.types.notes import Note
from scenario_gen.types.scenario import Scenario
from scenario_gen.types.target import Pair

if TYPE_CHECKING:
    from pandas import DataFrame

RECORDING = "recording"
"""The recorded encounter itself."""
WITH = "with changepoints"
REPLAY = "replay"
"""The recording as fitted to the road."""

Better = Literal["lower", "higher", ""]


_KEYS = {
    "duration": "duration_s",
    "level": "confidence_level",
}  # of fields that are named otherwise in JSON


@dataclass(frozen=True)
class Interval:
    """An estimate and its confidence interval; NaN bounds: no interval (a single sample)."""

    value: float
    low: float = float("nan")
    high: float = float("nan")


@dataclass(frozen=True)
class Metric:
    """A kind of figure.

    Attributes:
        id: its key in JSON.
        label: for people.
        unit: of its values, "" for a plain number, "%" for shares (stored as 0 to 1).
        better: which direction is better, "" where neither is.
        group: heading under which it stands.
        meaning: one sentence.
        cap: a larger value counts as this; None: there is no such value.
    """

    id: str
    label: str
    unit: str
    better: Better
    group: str
    meaning: str
    cap: float | None = None


@dataclass(frozen=True)
class Row:
    """All figures of one set of scenarios.

    Attributes:
        name: e.g. "with changepoints".
        samples: number of scenarios.
        values: estimates by metric id; what could not be had is absent or NaN.
        notes: what a reader must know.
    """

    name: str
    samples: int
    values: Mapping[str, Interval]
    notes: tuple[Note, ...] = ()


@dataclass(frozen=True)
class Evaluation:
    """Rows of metrics for one encounter on one road.

    Attributes:
        encounter: its name; road: its name.
        vehicles: ids.
        duration: of the template [s].
        changepoints: K, which always stands beside E.
        level: confidence level of the intervals; resamples: of the bootstrap; seed: of its draws.
        metrics: what the rows hold, in order.
        rows: the recorded template first, then in the order given.
    """

    encounter: str
    road: str
    vehicles: tuple[str, ...]
    duration: float
    changepoints: int
    level: float
    resamples: int
    seed: int
    metrics: tuple[Metric, ...]
    rows: tuple[Row, ...]

    @classmethod
    def empty(cls) -> "Evaluation":
        """Return one of nothing."""
        return cls("", "", (), 0.0, 0, 0.0, 0, 0, (), ())

    def row(self, name: str) -> Row | None:
        """Return the row of that name, or None."""
        return next((row for row in self.rows if row.name == name), None)

    def value(self, row: str, metric: str) -> float:
        """Return one figure; NaN if there is none."""
        entry = self.row(row)
        return entry.values[metric].value if entry and metric in entry.values else math.nan

    def to_dataframe(self) -> "DataFrame":
        """Return a table: a row for each metric, a column for each row's estimate."""
        import pandas as pd

        rows = {
            row.name: {m.id: self.value(row.name, m.id) for m in self.metrics} for row in self.rows
        }
        return pd.DataFrame(rows)

    def to_json(self) -> str:
        """Return JSON; what is not a number is null, figures have six significant digits."""
        document = {_KEYS.get(name, name): value for name, value in vars(self).items()} | {
            "duration_s": finite(self.duration),
            "metrics": [
                {key: value for key, value in vars(metric).items() if value is not None}
                for metric in self.metrics
            ],
            "rows": [
                {
                    "name": row.name,
                    "samples": row.samples,
                    "notes": [str(note) for note in row.notes],
                    "values": {
                        key: {name: finite(figure) for name, figure in vars(e).items()}
                        for key, e in row.values.items()
                    },
                }
                for row in self.rows
            ],
        }
        return json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False)

    def _table(self) -> list[tuple[str, ...]]:
        """Return the header, then the cells of each metric: label, better, a figure per row."""
        header = ("metric", "better", *(f"{row.name} ({row.samples})" for row in self.rows))
        lines = [header]
        for metric in self.metrics:
            figures = [
                formatted(row.values.get(metric.id), metric.unit, cap=metric.cap)
                for row in self.rows
            ]
            unit = f" [{metric.unit}]" if metric.unit else ""
            lines.append((metric.label + unit, metric.better, *figures))
        return lines

    def _repr_html_(self) -> str:
        """Return the table with its notes for a notebook."""
        notes = [f"{row.name}: {note}" for row in self.rows for note in row.notes]
        title = f"Evaluation of {self.encounter} on {self.road or 'no road'}"
        return html_table(title, self._table()) + html_list(notes)

    def to_markdown(self) -> str:
        """Return a table: metrics down, rows across, each figure with its interval."""
        header, *table = (f"| {' | '.join(cells)} |" for cells in self._table())
        lines = [
            f"# {as_markdown(self.encounter)} on {as_markdown(self.road)}",
            "",
            f"{len(self.vehicles)} vehicles, {self.duration:.1f} s, "
            f"K = {self.changepoints} changepoints; "
            f"{self.level:.0%} bootstrap intervals in brackets "
            f"({self.resamples} resamples, seed {self.seed}).",
            "",
            header,
            "|---|---|" + "---|" * len(self.rows),
        ]
        group = ""
        for metric, line in zip(self.metrics, table, strict=True):
            if metric.group != group:
                group = metric.group
                lines.append(f"| **{group}** | |" + " |" * len(self.rows))
            lines.append(line)
        notes = [f"- {row.name}: {note}" for row in self.rows for note in row.notes]
        return "\n".join([*lines, "", *notes]).rstrip() + "\n"


def as_markdown(name: str) -> str:
    """Return a name so that Markdown shows it letter by letter."""
    return re.sub(r"([\\`*\[\]<>|]|^[_#]|_$)", r"\\\1", printable(name))


def formatted(
    estimate: Interval | None, unit: str, *, bounds: bool = True, cap: float | None = None
) -> str:
    """Format an estimate: three significant digits, the interval in brackets, a dash without one.

    Where nothing lies below `cap` (see `Metric`), this is said.
    """
    if estimate is None or not math.isfinite(estimate.value):
        return "–"
    if cap is not None and estimate.value >= cap:
        return f"none below {cap:g}" + (f" {unit}" if unit else "")
    factor = 100.0 if unit == "%" else 1.0

    def figure(value: float) -> str:
        value *= factor
        return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"

    text = figure(estimate.value)
    if bounds and math.isfinite(estimate.low) and math.isfinite(estimate.high):
        text += f" [{figure(estimate.low)}, {figure(estimate.high)}]"
    return text


def finite(value: float) -> float | None:
    """Return six digits of a value; None if it is not finite."""
    return float(f"{value:.6g}") if math.isfinite(value) else None


Measure = Callable[
    [Scenario, str, Pair | None], float
]  # a figure of a scenario; NaN if it has none


@dataclass(frozen=True)
class Measures:
    """What measures a scenario of all vehicles.

    Attributes:
        figure: returns one figure by its name, of a pair or of the most critical one.
        rarity: returns how unusual a scenario is among recorded encounters of its kind, up to 1 it
            is usual; None: nobody asks.
    """

    figure: Measure
    rarity: Callable[[Scenario], float] | None = None

    def facts(self, scenario: Scenario) -> Facts:
        """Return how near the vehicles of a scenario come, and how rare that is."""
        return Facts(
            closest_approach_m=_known(self.figure(scenario, "gap", None)),
            pet_s=_known(self.figure(scenario, "pet", None)),
            rarity=None if self.rarity is None else _known(self.rarity(scenario)),
        )


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
