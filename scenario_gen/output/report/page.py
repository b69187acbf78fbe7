# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The report: one HTML page that works offline."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
import math
from pathlib import Path
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
    REPLAY,
    Route,
    routes_in_words,
)

MAX_SAMPLES = 1000
"""Scenarios of a set that a page draws; the figures use all."""


@dataclass(frozen=True, eq=False)
class ReportInput:
    """A page.

    Attributes:
        cases: at least one.
        title: heading and window title.
        quality: the log's data quality, in lines.
        provenance: log, its hash, seed, versions, parameters, by name.
    """

    cases: Sequence[GenerationResult]
    title: str = "Generated encounters"
    quality: Sequence[str] = ()
    provenance: Mapping[str, str] = field(default_factory=dict)


def write_report(path: Path, report: ReportInput) -> None:
    """Write the page to `path`; the same input gives the same bytes."""
    write_text(path, render(report))


def render(report: ReportInput) -> str:
    """Return the page as text."""
    views = [_view(index, case) for index, case in enumerate(report.cases)]
    return render_page(
        "report.html.j2",
        ("scene.js", "plots.js", "charts.js", "list.js", "page.js", "tables.js"),
        [case_data(case, MAX_SAMPLES) for case in report.cases],
        report=report,
        views=views,
        verdict={
            "published": sum(case.published for case in report.cases),
            "requested": sum(case.generated.requested for case in report.cases),
            "candidates": sum(case.generated.candidates for case in report.cases),
        },
        facts=[fact for fact in report.provenance.items() if not _is_parameter(fact[0])],
        parameters=[fact for fact in report.provenance.items() if _is_parameter(fact[0])],
    )


def _is_parameter(name: str) -> bool:
    """Whether a provenance entry is a parameter, such as sampling.sigma_f."""
    return "." in name and " " not in name


def _view(index: int, case: GenerationResult) -> dict[str, Any]:
    """Return the contents of the page's tables for one case."""
    evaluation = case.evaluation
    duration = case.encounter.duration
    changepoints = len(case.segmentation.changepoints)
    return {
        "index": index,
        "case": case,
        "causes": causes_in_words(case.generated.refused),
        "rows": [*evaluation.rows[1:], *evaluation.rows[:1]],
        "ego": case.generated.ego.vehicle.id if case.generated.ego else "",
        "k": changepoints,
        "remark": case.segmentation.remark(duration),
        "rate": changepoints / duration,
        "errors": {key: errors_of(case, key) for key in ERRORS},
        "verdict": _in_words(case),
        "reactions": case.reacting,
        "segments": _segments(case),
        "vehicles": _vehicles(case),
        "planned": routes_in_words(case.routes),
        "spreads": _measured(case),
    }


def _measured(case: GenerationResult) -> list[str]:
    """Return the names of the figures that at least one scenario has."""
    spreads = case.coverage.spreads if case.coverage is not None else {}
    return [name for name, spread in spreads.items() if any(map(math.isfinite, spread.values))]


def _segments(case: GenerationResult) -> list[dict[str, Any]]:
    """Return interval [s], label and description of each segment of the recording."""
    segmentation = case.segmentation
    starts = [0, *segmentation.changepoints]
    bounds = [*case.encounter.time[starts].tolist(), case.encounter.duration]
    return [
        {"from": bounds[k], "to": bounds[k + 1], "label": int(label), "text": text}
        for k, (label, text) in enumerate(
            zip(segmentation.labels[starts], segmentation.descriptions, strict=True)
        )
    ]


def _vehicles(case: GenerationResult) -> list[dict[str, Any]]:
    """Return the fit and the route of each vehicle; nothing without a fit."""
    if case.fit is None:
        return []
    routes: Sequence[Route | None] = case.routes or [None] * len(case.encounter.vehicles)
    return [
        {
            "id": vehicle.id,
            "manoeuvre": fitted.manoeuvre,
            "scale": fitted.scale,
            "moved": float(fitted.moved.max()),
            "turned": fitted.figures(),
            "dwells": int(sum(fitted.stands)),
            "route": route.figures() if route else {},
        }
        for vehicle, fitted, route in zip(
            case.encounter.vehicles, case.fit.fitted, routes, strict=True
        )
    ]


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
    ttc = _smallest(case.coverage.spreads["ttc"].values)
    pet = _smallest(case.coverage.spreads["pet"].values)
    parts = []
    if ttc < (math.inf if cap is None else cap):
        parts.append(f"minimum time to collision {ttc:.1f} s")
    elif cap is not None:
        parts.append(f"time to collision: none below {cap:g} s")
    if not math.isnan(pet):
        parts.append(f"minimum PET {pet:.1f} s")
    return ", ".join(parts)


def _smallest(values: Iterable[float]) -> float:
    """Return the smallest finite value; NaN if there is none."""
    return min(filter(math.isfinite, values), default=math.nan)


def errors_of(case: GenerationResult, metric: str) -> tuple[str, str]:
    """Return E of the set, and of the replay, as texts."""
    likeness, replay = (
        formatted(Interval(case.evaluation.value(row, metric)), "")
        for row in (case.row_name, REPLAY)
    )
    return likeness, replay
