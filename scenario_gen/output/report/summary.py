# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The end of a run on one screen of the terminal."""

from collections.abc import Sequence
import math

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from scenario_gen.base.errors import printable
from scenario_gen.output.report.page import errors_of
from scenario_gen.types import (
    CAR,
    causes_in_words,
    Encounter,
    ERRORS,
    formatted,
    GenerationResult,
    NoteKind,
    REPLAY,
    routes_in_words,
    Row,
    ScenarioSet,
    WITH,
)

VARIED = ("pet", "gap", "speed")
"""Figures whose range is printed: PET, or the smallest gap if no vehicles cross, and the speed."""
LABELS = {
    NoteKind.MIRRORED: "note",
    NoteKind.SHORTENED: "length",
    NoteKind.OUTCOMES: "decision",
    NoteKind.OUTCOMES_MISSING: "decision",
    NoteKind.OUTCOME_REFUSED: "decision",
    NoteKind.NOTHING_DECIDED: "decision",
}
"""Labels of the notes that are printed."""
WARNING_STYLE = "yellow"
DETAILED_COUNT = 5  # cases that are described in full


def summary(cases: Sequence[GenerationResult], *, verbose: bool = False) -> RenderableType:
    """Return a summary of each case for rich: recording, reactions, validity, variety.

    Of more than `DETAILED_COUNT` cases it has validity and losses; the report has the rest.

    Args:
        cases: the generated sets.
        verbose: whether to add routes and the comparison with the recording (E).
    """
    if len(cases) > DETAILED_COUNT and not verbose:
        return Group(*(line for case in cases for line in _in_brief(case)))
    lines = [line for case in cases for line in _case(case, verbose)]
    if verbose:
        explained = (
            "K: changepoints. E: distance to the recording, lower is nearer; in brackets, for "
            "orientation: replay of the recording."
        )
        lines.append(Text(explained, style="dim"))
    return Group(*lines)


def _in_brief(case: GenerationResult) -> list[RenderableType]:
    """Return a line with the validity of a case, and one for each loss."""
    table = Table.grid(padding=(0, 1))
    _add_losses(table, case)
    title = f"{printable(case.title)}: "
    return [Text.assemble((title, "bold"), _validity(case.generated)), table]


def _add_losses(table: Table, case: GenerationResult) -> None:
    """Add a row for each loss of a case."""
    losses = case.fit.losses if case.fit else ()
    messages = [loss.message for loss in losses if loss.kind != "arm"]
    messages += _vanished(case.evaluation.row(WITH), case.encounter.made)
    messages += case.lost_reactions
    for message in messages:
        table.add_row("", Text("not kept", WARNING_STYLE), Text(printable(message), WARNING_STYLE))


def _case(case: GenerationResult, verbose: bool) -> list[RenderableType]:
    """Return the title of a case and its table; deviations from the recording are yellow."""
    row = case.evaluation.row(WITH)
    losses = case.fit.losses if case.fit else ()
    notes = [loss.message for loss in losses if loss.kind == "arm"]
    notes += case.route_remarks
    notes += filter(None, [case.segmentation.remark(case.encounter.duration)])
    table = Table.grid(padding=(0, 1))
    subject = "recording" if case.encounter.made == "recorded" else case.encounter.made
    table.add_row("", subject, _road_users(case.encounter))
    for sentence in case.reacting["sentences"]:
        table.add_row("", "reaction", printable(sentence))
    table.add_row("", "valid", _validity(case.generated))
    for note in case.generated.adaptations:
        if label := LABELS.get(note.kind):
            table.add_row("", label, printable(str(note)))
    if variety := _variety(case):
        table.add_row("", "variety", variety)
    _add_losses(table, case)
    for message in notes:
        table.add_row("", "note", printable(message))
    title = Text(printable(case.title), style="bold")
    return [title, table, *(_details(case, row) if verbose else ())]


def _road_users(encounter: Encounter) -> str:
    """Return number and types of the road users of a template, and the duration."""
    types = sorted({vehicle.type for vehicle in encounter.vehicles})
    users = "vehicles" if types == [CAR] else f"road users ({', '.join(types)})"
    return f"{len(encounter.vehicles)} {users} for {encounter.duration:.1f} s"


def _validity(result: ScenarioSet) -> Text:
    """Return the number of valid scenarios and the causes of refusals."""
    style = "green" if len(result) >= result.requested else "red"
    causes = [f"{count} {words}" for words, count in causes_in_words(result.refused)]
    refusals = "no candidate was refused"
    if causes:
        refused = f"{result.refused.total()} of {result.candidates} candidates were refused"
        refusals = f"{refused}: {', '.join(causes)}"
    valid = f"{len(result)} of {result.requested} scenarios"
    return Text.assemble((valid, style), f"; {refusals}")


def _variety(case: GenerationResult) -> str:
    """Return the ranges of the figures of a set, each with the template's value in brackets."""
    spreads = {} if case.coverage is None else case.coverage.spreads
    ranges = []
    for name in VARIED:
        spread = spreads.get(name)
        values = [] if spread is None else [v for v in spread.values if math.isfinite(v)]
        if spread is None or not values:
            continue
        ends = dict.fromkeys((f"{min(values):.1f}", f"{max(values):.1f}"))
        figures = f"{spread.label} {' to '.join(ends)} {spread.unit}"
        if math.isfinite(spread.template):
            ranges.append(f"{figures} ({case.encounter.made} {spread.template:.1f})")
        elif name == "speed":
            ranges.append(figures)
    return ", ".join(ranges)


def _vanished(row: Row | None, made: str) -> list[str]:
    """Return a sentence on conflicts of the template that vanish in the scenarios."""
    if row is None or not {"vanished_conflicts", "conflicts"} <= row.values.keys():
        return []
    vanished = row.values["vanished_conflicts"].value
    total = vanished + row.values["conflicts"].value
    text = f"{vanished:.3g} of {total:.0f} {made} conflict(s) vanish on average"
    return [text] if vanished > 0.0 else []


def _details(case: GenerationResult, row: Row | None) -> list[Text]:
    """Return changepoints, order, routes and E of a case."""
    order = formatted(row.values.get("order_kept"), "%", bounds=False) if row else "–"
    unit = "" if order == "–" else " %"
    figures = f"  K {len(case.segmentation.changepoints)}  order {order}{unit}"
    if row and row.samples < len(case.generated):
        figures += f" (of {row.samples:,}, evenly spaced)"
    if planned := routes_in_words(case.routes):
        figures += f"  routes: {planned}"
    metrics = [metric for metric in ERRORS if row and metric in row.values]
    return [Text(figures), *(_errors(case, metric) for metric in metrics)]


def _errors(case: GenerationResult, metric: str) -> Text:
    """Return E of the set, and of the replay if there is one."""
    likeness, replay = errors_of(case, metric)
    text = Text(f"  E {ERRORS[metric]} ").append(likeness, style="bold")
    if case.evaluation.row(REPLAY) is not None:
        text.append(f" (replay {replay})", style="dim")
    return text
