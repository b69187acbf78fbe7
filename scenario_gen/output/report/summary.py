# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The end of a run on one screen of the terminal."""

from collections import Counter
from collections.abc import Mapping, Sequence
import math

from rich.console import Group, RenderableType
from rich.text import Text

from scenario_gen.base.errors import printable
from scenario_gen.types import (
    Cause,
    causes_in_words,
    ERRORS,
    formatted,
    GenerationResult,
    Interval,
    NARROW,
    ORACLE,
    routes_in_words,
    UNIFORM,
    WITH,
    WITHOUT,
)

SHORT = {WITHOUT: "without", UNIFORM: "uniform", NARROW: "narrow", ORACLE: "replayed"}
COMPARED = (
    "; after | of sets drawn likewise, without changepoints and with K evenly spaced; in brackets, not compared: preset "
    "narrow, the template replayed"
)
UNCOMPARED = "; in brackets, not compared: the template replayed. --compare draws sets to compare with"


def summary(cases: Sequence[GenerationResult]) -> RenderableType:
    """Return two lines per case and what was refused, for rich to print; names are long, so no table."""
    lines = [line for case in cases for line in _case(case)]
    refused: Counter[Cause] = sum((case.generated.refused for case in cases), Counter())
    causes = ", ".join(f"{count} {words}" for words, count in causes_in_words(refused))
    beside = COMPARED if any(case.references for case in cases) else UNCOMPARED
    return Group(
        *lines,
        Text(f"refused candidates: {causes}" if causes else "no candidate was refused"),
        Text(f"K: changepoints. E: distance of the delivered set to the template, lower is nearer{beside}.", style="dim"),
    )


def _case(case: GenerationResult) -> list[Text]:
    """The name of a case, its figures, and the notes on its segmentation."""
    result, row = case.generated, case.evaluation.row(WITH)
    order = formatted(row.values.get("order_kept"), "%", bounds=False) if row else "–"
    title = Text(printable(case.title), style="bold")
    title.append(f"  {len(case.encounter.vehicles)} vehicles, {case.encounter.duration:.1f} s", style="dim")
    complete = len(result.scenarios) >= result.requested
    measured = f" (of {row.samples:,}, evenly spaced)" if row and row.samples < len(result.scenarios) else ""
    figures = Text.assemble(
        "  ",
        (f"{len(result.scenarios)}/{result.requested} valid", "green" if complete else "red"),
        f" of {result.candidates}  K {len(case.segmentation.changepoints)}"
        f"  order {order if order == '–' else order + ' %'}{measured}",
    )
    kept = [] if row is None else _not_kept(row.values)
    remark = case.segmentation.remark(case.encounter.duration)
    lost = [f"lost on this road: {message}" for message in case.lost]
    planned = routes_in_words(case.routes)
    if planned:
        figures.append(f"  routes: {planned}")
    similar = [_errors(case, metric) for metric in ERRORS if row and metric in row.values]
    kept += [*case.similarity()["said"], *case.lost_reactions]
    reactions = case.reacting["sentences"]
    warnings = [*lost, *kept, *case.route_remarks, *([remark] if remark else [])]
    return [
        title,
        figures,
        *(Text(f"  {printable(line)}") for line in reactions),
        *similar,
        *(Text(f"  {printable(line)}", style="yellow") for line in warnings),
    ]


def _not_kept(values: Mapping[str, Interval]) -> list[str]:
    """Say what of the template the samples have not: turns, conflicts."""
    turns, vanished, conflicts = (
        values.get(key, Interval(math.nan)).value for key in ("turn_kept", "vanished_conflicts", "conflicts")
    )
    message = [f"{100.0 * (1.0 - turns):.3g} % of the vehicles turn otherwise than in the template"] if turns < 1.0 else []
    if vanished > 0.0:
        message.append(f"{vanished:.3g} of the template's {vanished + conflicts:.0f} conflict(s) vanish, mean over samples")
    return message


def _errors(case: GenerationResult, metric: str) -> Text:
    """E of the delivered set, of those it is compared with and of those beside it; the best of the compared is green."""
    compared, best, value = case.compared, case.best(metric), case.evaluation.value
    text = Text(f"  E {ERRORS[metric]} ")
    text.append(_figure(value(case.row, metric)), style="bold green" if best == case.row else "bold")
    for k, row in enumerate(compared[1:]):
        text.append(" | " if k == 0 else ", ").append(f"{SHORT[row]} ")
        text.append(_figure(value(row, metric)), style="green" if best == row else "")
    beside = [row for row in SHORT if row not in compared and case.evaluation.row(row) is not None]
    if beside:
        text.append(f" ({', '.join(f'{SHORT[row]} {_figure(value(row, metric))}' for row in beside)})", style="dim")
    return text


def _figure(value: float) -> str:
    return f"{value:.3f}" if math.isfinite(value) else "–"
