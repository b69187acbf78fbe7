# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The report: one HTML page that works offline."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
import math
from pathlib import Path
import shlex
from typing import Any

from scenario_gen.base.folders import write_text
from scenario_gen.output.report.data import case_data
from scenario_gen.output.report.html import render_page
from scenario_gen.types import (
    causes_in_words,
    ERRORS,
    formatted,
    GenerationResult,
    Interval,
    NARROW,
    REPLAY,
    Route,
    routes_in_words,
    UNIFORM,
    WITHOUT,
)

SIGNIFICANT = 0.03
"""A case counts in the comparison if E without changepoints is at least this."""
UNCOMPARED = "not requested; `scenario-gen generate --compare` draws sets to compare with"
MAX_SAMPLES = 50
"""Scenarios of each set that a page draws; the figures use all."""


@dataclass(frozen=True, eq=False)
class ReportInput:
    """A page.

    Attributes:
        cases: at least one.
        title: heading and window title.
        quality: the log's data quality, in lines.
        provenance: log, its hash, seed, versions, parameters, by name.
        bag: path of the bag with the scenarios, for commands on the page; "" if there is none.
    """

    cases: Sequence[GenerationResult]
    title: str = "Generated encounters"
    quality: Sequence[str] = ()
    provenance: Mapping[str, str] = field(default_factory=dict)
    bag: str = ""


def write_report(path: Path, report: ReportInput) -> None:
    """Write the page to `path`; the same input gives the same bytes."""
    write_text(path, render(report))


def render(report: ReportInput) -> str:
    """Return the page as text."""
    views = [_view(index, case) for index, case in enumerate(report.cases)]
    return render_page(
        "report.html.j2",
        ("scene.js", "plots.js", "charts.js", "page.js", "tables.js"),
        [case_data(case, MAX_SAMPLES) for case in report.cases],
        report=report,
        views=views,
        verdict=_verdict(views),
        bag=shlex.quote(report.bag) if report.bag else "",
        significant=SIGNIFICANT,
        compared=any(case.references for case in report.cases),
        uncompared=next(
            (why for case in report.cases for why in case.refusals.values()), UNCOMPARED
        ),
        facts=[fact for fact in report.provenance.items() if not _is_parameter(fact[0])],
        parameters=[fact for fact in report.provenance.items() if _is_parameter(fact[0])],
    )


def _is_parameter(name: str) -> bool:
    """Whether a provenance entry is a parameter, such as sampling.sigma_f."""
    return "." in name and " " not in name


def _view(index: int, case: GenerationResult) -> dict[str, Any]:
    """Return the contents of the page's tables for one case."""
    arms = [
        (case.row_name, case.generated),
        *((name, case.references.get(name)) for name in (WITHOUT, UNIFORM)),
    ]
    evaluation = case.evaluation
    duration = case.encounter.duration
    bounds = [
        *(float(case.encounter.time[i]) for i in (0, *case.segmentation.changepoints)),
        duration,
    ]
    routes: Sequence[Route | None] = case.routes or [None] * len(case.encounter.vehicles)
    vehicles = (
        zip(case.encounter.vehicles, case.fit.fitted, routes, strict=True) if case.fit else ()
    )
    return {
        "index": index,
        "case": case,
        "title": case.title,
        "without": case.references.get(WITHOUT),
        "refused": [case.refusals.get(name, "") for name in (WITHOUT, UNIFORM)],
        "arms": [
            (name, result, causes_in_words(result.refused))
            for name, result in arms
            if result is not None
        ],
        "rows": [*evaluation.rows[1:], evaluation.rows[0]],
        "metrics": evaluation.metrics,
        "ego": case.generated.ego.vehicle.id if case.generated.ego else "",
        "k": len(case.segmentation.changepoints),
        "remark": case.segmentation.remark(duration),
        "rate": len(case.segmentation.changepoints) / duration,
        "errors": {key: _errors(case, key) for key in ERRORS},
        "best": {key: case.best(key) for key in ERRORS},
        "verdict": _in_words(case),
        "reactions": case.reacting,
        "not_kept": case.lost_reactions,
        "nearer": case.similarity()["said"],
        "segments": [
            {
                "from": bounds[k],
                "to": bounds[k + 1],
                "label": int(case.segmentation.labels[start]),
                "text": text,
            }
            for k, (start, text) in enumerate(
                zip(
                    (0, *case.segmentation.changepoints),
                    case.segmentation.descriptions,
                    strict=True,
                )
            )
        ],
        "vehicles": [
            {
                "id": v.id,
                "manoeuvre": f.manoeuvre,
                "scale": f.scale,
                "moved": float(f.moved.max()),
                "turned": f.figures(),
                "dwells": int(sum(f.stands)),
                "route": r.figures() if r else {},
            }
            for v, f, r in vehicles
        ],
        "remarks": case.route_remarks,
        "lost": case.losses,
        "planned": routes_in_words(case.routes),
    }


def _in_words(case: GenerationResult) -> str:
    """Return a summary of the set: valid scenarios, reactions, passing orders, criticality."""
    orders = case.coverage.orders if case.coverage is not None else {}
    first = f"{len(orders)} passing orders" if len(orders) > 1 else ""
    kept = "; ".join(case.reacting["sentences"])
    valid = f"{case.published} of {case.generated.requested} scenarios are valid"
    return "; ".join(filter(None, [valid, kept, first, _criticality(case)]))


def _criticality(case: GenerationResult) -> str:
    """Return the smallest TTC and PET of all scenarios as text; "" if nothing was measured."""
    if case.coverage is None or not case.coverage.index:
        return ""
    cap = next((metric.cap for metric in case.evaluation.metrics if metric.id == "min_ttc"), None)
    said = []
    for name, words in (("ttc", "time to collision"), ("pet", "PET")):
        least = min(filter(math.isfinite, case.coverage.spreads[name].values), default=math.nan)
        if least < (math.inf if name == "pet" or cap is None else cap):
            said.append(f"minimum {words} {least:.1f} s")
        elif name == "ttc" and cap is not None:
            said.append(f"{words}: none below {cap:g} s")
    return ", ".join(said)


def _errors(case: GenerationResult, metric: str) -> dict[str, Any]:
    """E of the set, and of the rows below it: each with its name and whether it is the best."""
    best = case.best(metric)
    words = {WITHOUT: "without", UNIFORM: "uniform", NARROW: "preset narrow", REPLAY: "replay"}
    errors = {
        row: formatted(Interval(case.evaluation.value(row, metric)), "")
        for row in words
        if case.evaluation.row(row)
    }
    return {
        "own": formatted(Interval(case.evaluation.value(case.row_name, metric)), ""),
        "kind": "" if not best else "good" if best == case.row_name else "bad",
        "beside": [
            (f"{value} {words[row]}", row == best) for row, value in errors.items() if value != "–"
        ],
    }


def _verdict(views: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the figures of the page's first sentences: valid scenarios, and where E is lower."""
    better: dict[str, dict[str, tuple[int, int]]] = {}
    for row, words in (
        (WITHOUT, "without changepoints"),
        (UNIFORM, "with as many evenly spaced ones"),
    ):
        cases = [view["case"] for view in views if row in view["case"].compared]
        for key, what in ERRORS.items():
            pairs = [
                (case.evaluation.value(case.row_name, key), case.evaluation.value(row, key))
                for case in cases
            ]
            known = [value < other for value, other in pairs if other >= SIGNIFICANT]
            if known:
                better.setdefault(words, {})[what] = (sum(known), len(known))
    sets = [view["case"].generated for view in views]
    return {
        "published": sum(view["case"].published for view in views),
        "requested": sum(result.requested for result in sets),
        "candidates": sum(result.candidates for result in sets),
        "better": better,
    }
