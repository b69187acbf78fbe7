"""The end of a run on one screen of the terminal."""

import math
from collections import Counter
from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from scenario_gen.evaluation.report import WITH, WITHOUT, Case
from scenario_gen.evaluation.result import formatted
from scenario_gen.scenario import Cause


def summary(cases: Sequence[Case]) -> RenderableType:
    """Return a table with one line per case, and what was refused, for rich to print."""
    table = Table(caption="K changepoints; E: relative distance to the template, with | without changepoints (lower is nearer)")
    table.add_column("encounter", overflow="fold")
    table.add_column("road", overflow="fold")
    for heading in ("N", "s", "K", "valid", "of", "E position", "E speed", "order"):
        table.add_column(heading, justify="right", no_wrap=True)
    for case in cases:
        made = case.with_changepoints
        found = case.evaluation.row(WITH)
        order = formatted(found.values.get("order_kept"), "%", bounds=False) if found else "–"
        table.add_row(
            Text(case.encounter.name),
            Text(case.road.name),
            str(len(case.encounter.vehicles)),
            f"{case.encounter.duration:.1f}",
            str(len(case.segmentation.changepoints)),
            Text(f"{len(made.scenarios)}/{made.requested}", style="green" if len(made.scenarios) >= made.requested else "red"),
            str(made.candidates),
            _errors(case, "e_position"),
            _errors(case, "e_speed"),
            order if order == "–" else f"{order} %",
        )
    refused: Counter[Cause] = sum((case.with_changepoints.refused for case in cases), Counter())
    causes = ", ".join(
        f"{count} {cause.value.replace('_', ' ')}" for cause, count in sorted(refused.items(), key=lambda c: (-c[1], c[0]))
    )
    line = Text(f"refused candidates: {causes}" if causes else "no candidate was refused")
    return Group(table, line)


def _errors(case: Case, metric: str) -> Text:
    """E with and without changepoints; green where changepoints bring it down."""
    values = [case.evaluation.value(row, metric) for row in (WITH, WITHOUT)]
    one, other = (f"{value:.3f}" if math.isfinite(value) else "–" for value in values)
    return Text(f"{one} | {other}", style="green" if values[0] < values[1] else "")
