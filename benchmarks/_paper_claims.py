# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Each figure's claim in the paper, shortened, with the figures that we measure for it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
import math

import plotly.graph_objects as go

from benchmarks._paper_figures import figure_2, figure_3, figure_4, figure_5
from benchmarks._paper_measure import PaperCase
from benchmarks._reference_sets import UNIFORM, WITHOUT
from scenario_gen.types import WITH

MAX_WAIT_SPEED_MPS = 0.5
"""A vehicle with a lower mean speed waits (docs/method.md)."""
MAX_OFF_ROAD_SHARE = 0.005
Values = Mapping[str, float | None]


@dataclass(frozen=True, eq=False)
class Claim:
    """One figure of one case.

    Attributes:
        number: number of the figure in the paper.
        claim: the paper's claim.
        measured: our measurement, in a sentence.
        holds: whether the claim holds; None where the case has no measure of it.
        values: the figures, by name.
        figure: the drawing.
    """

    number: int
    claim: str
    measured: str
    holds: bool | None
    values: Values
    figure: go.Figure


def claims_of(case: PaperCase) -> list[Claim]:
    """Return the claims that the case can test."""
    makers: list[Callable[[PaperCase], Claim]] = [_trends]
    if case.regressions is not None:
        makers = [_priors, *makers, _generated]
        if WITH in case.similarity:
            makers.append(_interaction)
    return [make(case) for make in makers]


def _priors(case: PaperCase) -> Claim:
    assert case.regressions is not None
    errors = {name: prior.error for name, prior in case.regressions.priors.items()}
    text = ", ".join(f"{name} {error:.1f}" for name, error in errors.items())
    return Claim(
        2,
        "A suitable prior mean makes the regression smoother and closer to the ground truth.",
        f"RMS distance of the posterior mean from the planned path, in cells: {text}.",
        errors["cubic polynomial"] <= min(errors.values()) + 1e-6,
        {f"rms_cells {name}": error for name, error in errors.items()},
        figure_2(case.regressions),
    )


def _trends(case: PaperCase) -> Claim:
    trends = case.trends
    text = "; ".join(
        f"{name} {error:.3f} (K = {count})" for name, (error, count) in trends.items()
    )
    values: dict[str, float | None] = {}
    for name, (error, count) in trends.items():
        values |= {f"rms_mps {name}": error, f"changepoints {name}": count}
    return Claim(
        3,
        "Changepoints lie where the trend of speed changes, so that acceleration within a "
        "primitive is about constant.",
        f"RMS deviation of speed from one straight line per primitive, in m/s: {text}.",
        trends["paper preset"][0] < trends["uniform, as many as the paper preset"][0],
        values,
        figure_3(case),
    )


def _generated(case: PaperCase) -> Claim:
    off_road = ", ".join(f"{name} {100.0 * share:.1f} %" for name, share in case.off_road.items())
    stops = {name: speed for name, speed in case.stop_speed.items() if math.isfinite(speed)}
    speeds = ", ".join(f"{name} {speed:.2f}" for name, speed in stops.items())
    stop_text = f"Mean speed during the template's waits, in m/s: {speeds or 'no waits'}."
    notes = "".join(f" ({name}: {note}.)" for name, arm in case.arms.items() for note in arm.notes)
    holds = None
    if {WITH, WITHOUT} <= set(stops):
        holds = stops[WITH] < MAX_WAIT_SPEED_MPS <= stops[WITHOUT]
    if case.off_road.get(WITH, 0.0) > MAX_OFF_ROAD_SHARE:
        holds = False
    values = {f"off_road {name}": share for name, share in case.off_road.items()}
    return Claim(
        4,
        "The results stay on the road and meet the given ends; with changepoints a vehicle slows "
        "down and stands as in the template, without them it does not stop.",
        f"Instants with a vehicle's centre off the road: {off_road}. {stop_text}{notes}",
        holds,
        values | {f"stop_speed_mps {name}": speed for name, speed in stops.items()},
        figure_4(case),
    )


def _interaction(case: PaperCase) -> Claim:
    texts, values, holds = [], dict[str, float | None](), list[bool]()
    arms = {
        name: case.similarity[name] for name in (WITH, WITHOUT, UNIFORM) if name in case.similarity
    }
    for kind in ("position", "speed"):
        for name, measures in arms.items():
            error = measures[f"e_{kind}"]
            texts.append(f"{kind} {name} {error.value:.3f} [{error.low:.3f}, {error.high:.3f}]")
            for key, value in (("", error.value), (" low", error.low), (" high", error.high)):
                values[f"e_{kind} {name}{key}"] = finite(value)
            correlation = measures[f"correlation_{kind}"].value
            values[f"correlation_{kind} {name}"] = finite(correlation)
        if WITHOUT in arms:
            holds.append(arms[WITH][f"e_{kind}"].value < arms[WITHOUT][f"e_{kind}"].value)
    driven = [fitted for fitted in case.arms[WITH].fit.fitted if not fitted.stands.all()]
    scales = ", ".join(f"{fitted.scale:.2f}" for fitted in driven)
    return Claim(
        5,
        "The mean normalised DTW feature of the scenarios with changepoints is close to the "
        "template's, without them it is not.",
        "E, the relative distance of the mean matrix from the template's "
        f"(K = {len(case.segmentation.changepoints)}): {'; '.join(texts)}. "
        f"Scales of eq 9, one per vehicle that drives: {scales} cells per metre.",
        all(holds) if holds else None,
        values,
        figure_5(case),
    )


def finite(value: float) -> float | None:
    """Return the value, or None where it is not finite (as in JSON)."""
    return value if math.isfinite(value) else None
