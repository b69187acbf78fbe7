# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The end of a run on one screen of the terminal."""

from collections.abc import Mapping, Sequence
import math

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from scenario_gen.base.errors import printable
from scenario_gen.types import (
    CAR,
    causes_in_words,
    ERRORS,
    formatted,
    GenerationResult,
    Interval,
    NARROW,
    REPLAY,
    routes_in_words,
    Row,
    UNIFORM,
    WITH,
    WITHOUT,
)

SHORT = {WITHOUT: "without", UNIFORM: "uniform", NARROW: "narrow", REPLAY: "replay"}
COMPARED = (
    "; after |: sets without changepoints and with K evenly spaced ones; in brackets, for "
    "orientation only: preset narrow, replay of the recording"
)
UNCOMPARED = (
    "; in brackets, for orientation only: replay of the recording. --compare draws further sets"
)
VARIED = ("pet", "gap", "speed")
"""Figures whose range is printed: PET, or the smallest gap if no vehicles cross, and the speed."""
WARNING_STYLE = "yellow"


def summary(cases: Sequence[GenerationResult], *, verbose: bool = False) -> RenderableType:
    """Return a summary of each case for rich: recording, reactions, validity, variety.

    Args:
        cases: the generated sets.
        verbose: whether to add routes and the comparison with the recording (E).
    """
    lines = [line for case in cases for line in _case(case, verbose)]
    if verbose:
        beside = COMPARED if any(case.references for case in cases) else UNCOMPARED
        explained = f"K: changepoints. E: distance to the recording, lower is nearer{beside}."
        lines.append(Text(explained, style="dim"))
    return Group(*lines)


def _case(case: GenerationResult, verbose: bool) -> list[RenderableType]:
    """The name of a case and its rows; deviations from the recording are yellow."""
    result, recorded = case.generated, case.encounter
    refused = ", ".join(f"{count} {words}" for words, count in causes_in_words(result.refused))
    tried = (
        f"{result.refused.total()} of {result.candidates} candidates were refused: {refused}"
        if refused
        else "no candidate was refused"
    )
    complete = len(result) >= result.requested
    table = Table.grid(padding=(0, 1))
    types = sorted({vehicle.type for vehicle in recorded.vehicles})
    users = "vehicles" if types == [CAR] else f"road users ({', '.join(types)})"
    table.add_row(
        "", "recording", f"{len(recorded.vehicles)} {users} for {recorded.duration:.1f} s"
    )
    for sentence in case.reacting["sentences"]:
        table.add_row("", "reaction", printable(sentence))
    valid = Text.assemble(
        (f"{len(result)} of {result.requested} scenarios", "green" if complete else "red"),
        f"; {tried}",
    )
    table.add_row("", "valid", valid)
    if varied := _variety(case):
        table.add_row("", "variety", varied)
    row = case.evaluation.row(WITH)
    vanished = [] if row is None else _vanished(row.values)
    losses = case.fit.losses if case.fit else ()
    lost = [loss.message for loss in losses if loss.kind != "arm"]
    remark = case.segmentation.remark(recorded.duration)
    unused = [loss.message for loss in losses if loss.kind == "arm"]
    for message in (*lost, *vanished, *case.lost_reactions):
        table.add_row(
            "",
            Text("not kept", style=WARNING_STYLE),
            Text(printable(message), style=WARNING_STYLE),
        )
    for message in (*unused, *case.route_remarks, *([remark] if remark else [])):
        table.add_row("", "note", printable(message))
    title: list[RenderableType] = [Text(printable(case.title), style="bold"), table]
    return [*title, *_details(case, row)] if verbose else title


def _variety(case: GenerationResult) -> str:
    """The ranges of the figures of a set, each with the recorded value in brackets."""
    spreads = {} if case.coverage is None else case.coverage.spreads
    ranges = []
    for spread in (spreads[name] for name in VARIED if name in spreads):
        values = [value for value in spread.values if math.isfinite(value)]
        own = f" (recorded {spread.template:.1f})" if math.isfinite(spread.template) else ""
        if values and (own or spread is spreads["speed"]):
            ranges.append(
                f"{spread.label} {min(values):.1f} to {max(values):.1f} {spread.unit}{own}"
            )
    return ", ".join(ranges)


def _vanished(values: Mapping[str, Interval]) -> list[str]:
    """Return a sentence on recorded conflicts that vanish in the scenarios."""
    vanished, conflicts = (
        values.get(key, Interval(math.nan)).value for key in ("vanished_conflicts", "conflicts")
    )
    total = vanished + conflicts
    text = f"{vanished:.3g} of {total:.0f} recorded conflict(s) vanish on average"
    return [text] if vanished > 0.0 else []


def _details(case: GenerationResult, row: Row | None) -> list[Text]:
    """Changepoints, order, routes and E of a case."""
    order = formatted(row.values.get("order_kept"), "%", bounds=False) if row else "–"
    figures = f"  K {len(case.segmentation.changepoints)}  order {order if order == '–' else order + ' %'}"
    if row and row.samples < len(case.generated):
        figures += f" (of {row.samples:,}, evenly spaced)"
    if planned := routes_in_words(case.routes):
        figures += f"  routes: {planned}"
    similar = [_errors(case, metric) for metric in ERRORS if row and metric in row.values]
    return [
        Text(figures),
        *similar,
        *(Text(f"  {printable(line)}", style=WARNING_STYLE) for line in case.similarity()["said"]),
    ]


def _errors(case: GenerationResult, metric: str) -> Text:
    """E of the set, of the sets it is compared with (the best is green), and of further rows."""
    compared, best, value = case.compared, case.best(metric), case.evaluation.value
    text = Text(f"  E {ERRORS[metric]} ")
    text.append(
        _figure(value(case.row_name, metric)),
        style="bold green" if best == case.row_name else "bold",
    )
    for k, row in enumerate(compared[1:]):
        text.append(" | " if k == 0 else ", ").append(f"{SHORT[row]} ")
        text.append(_figure(value(row, metric)), style="green" if best == row else "")
    beside = [row for row in SHORT if row not in compared and case.evaluation.row(row) is not None]
    if beside:
        text.append(
            f" ({', '.join(f'{SHORT[row]} {_figure(value(row, metric))}' for row in beside)})",
            style="dim",
        )
    return text


def _figure(value: float) -> str:
    return f"{value:.3f}" if math.isfinite(value) else "–"
