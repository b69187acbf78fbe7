# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Two sets of results side by side: two seeds, two parameters, two versions."""

from collections.abc import Sequence
from dataclasses import dataclass
import math
from pathlib import Path

from scenario_gen.base.documents import read_json
from scenario_gen.base.errors import InputError, reading
from scenario_gen.types import as_markdown, Evaluation, formatted, Interval, Metric, SCHEMA, WITH

FILE_SCHEMA = {  # evaluation.json of a run, or one evaluation alone
    "type": "object",
    "if": {"required": ["cases"]},
    "then": {"properties": {"cases": {"type": "array", "minItems": 1, "items": SCHEMA}}},
    "else": SCHEMA,
}


@dataclass(frozen=True)
class Difference:
    """One metric of one case in both sets.

    Attributes:
        encounter, road: the case.
        metric: what is compared.
        first, second: the two estimates, None where a set has none.
        changepoints: K of both, which stands beside E.
    """

    encounter: str
    road: str
    metric: Metric
    first: Interval | None
    second: Interval | None
    changepoints: tuple[int, int] = (0, 0)

    @property
    def clear(self) -> bool:
        """Whether both have intervals that do not overlap; a cautious sign of a difference."""
        if self.first is None or self.second is None:
            return False
        bounds = (self.first.low, self.first.high, self.second.low, self.second.high)
        return all(math.isfinite(b) for b in bounds) and (
            bounds[1] < bounds[2] or bounds[3] < bounds[0]
        )

    @property
    def better(self) -> str:
        """Return "first" or "second" if one is clearly better, else ""."""
        if not self.clear or not self.metric.better or self.first is None or self.second is None:
            return ""
        lower = "first" if self.first.value < self.second.value else "second"
        return (
            lower
            if self.metric.better == "lower"
            else {"first": "second", "second": "first"}[lower]
        )


def compare(
    first: Sequence[Evaluation], second: Sequence[Evaluation], row: str = WITH
) -> tuple[Difference, ...]:
    """Pair the cases of two sets by encounter and road, and every metric of `row`.

    Raises:
        InputError: the sets have no case in common, or one has none of that row.
    """
    others = {(other.encounter, other.road): other for other in second}
    differences: list[Difference] = []
    for evaluation in first:
        other = others.get((evaluation.encounter, evaluation.road))
        if other is None:
            continue
        first_row, second_row = evaluation.row(row), other.row(row)
        if first_row is None or second_row is None:
            raise InputError(
                f"{evaluation.encounter} on {evaluation.road} has no row {row!r} in both sets"
            )
        for metric in evaluation.metrics:
            pair = first_row.values.get(metric.id), second_row.values.get(metric.id)
            if any(pair):
                differences.append(
                    Difference(
                        evaluation.encounter,
                        evaluation.road,
                        metric,
                        *pair,
                        (evaluation.changepoints, other.changepoints),
                    )
                )
    if not differences:
        raise InputError("the two sets have no encounter on the same road in common")
    return tuple(differences)


def comparison_table(
    differences: Sequence[Difference], names: tuple[str, str] = ("A", "B")
) -> str:
    """Return Markdown: one table per case, with the better set if intervals do not overlap."""
    lines: list[str] = []
    case = ("", "")
    names = (as_markdown(names[0]), as_markdown(names[1]))
    for entry in differences:
        if (entry.encounter, entry.road) != case:
            case = (entry.encounter, entry.road)
            lines += [
                "",
                f"## {as_markdown(case[0])} on {as_markdown(case[1])}",
                "",
                "K = {} and {} changepoints.".format(*entry.changepoints),
                "",
                f"| metric | {names[0]} | {names[1]} | clearly better |",
                "|---|---|---|---|",
            ]
        unit = f" [{entry.metric.unit}]" if entry.metric.unit else ""
        cells = [
            formatted(estimate, entry.metric.unit, cap=entry.metric.cap)
            for estimate in (entry.first, entry.second)
        ]
        better = {"first": names[0], "second": names[1], "": "differs" if entry.clear else ""}[
            entry.better
        ]
        lines.append(f"| {entry.metric.label}{unit} | {cells[0]} | {cells[1]} | {better} |")
    return "\n".join(lines).lstrip("\n") + "\n"


def read_evaluations(path: Path) -> tuple[Evaluation, ...]:
    """Read the figures of a run: its folder, its evaluation.json, or one evaluation as JSON.

    Raises:
        InputError: there is no such file, or it is not one; the message names the path inside the
            document.
    """
    file = path / "evaluation.json" if path.is_dir() else path
    document = read_json(file, FILE_SCHEMA, f"{file} is no evaluation")
    with reading(file):
        return tuple(Evaluation.from_document(case) for case in document.get("cases", [document]))
