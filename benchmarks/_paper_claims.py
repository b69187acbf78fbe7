# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Each figure's claim in the paper's words, shortened, and the sentence with the figures that we measure for it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
import math

import plotly.graph_objects as go

from benchmarks._paper_figures import figure_2, figure_3, figure_4, figure_5
from benchmarks._paper_measure import PaperCase
from scenario_gen.types import UNIFORM, WITH, WITHOUT

WAITS, OFF_ROAD = 0.5, 0.005
"""Mean speed [m/s] below which a vehicle waits, as in docs/method.md; share of instants off the road that is too much."""
Values = Mapping[str, float | None]


@dataclass(frozen=True, eq=False)
class Claim:
    """One figure of one case.

    Attributes:
        number: of the figure in the paper.
        claim: what the paper says of it.
        measured: what we find, in a sentence.
        holds: whether that is as claimed; None where the case has nothing to measure it by.
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
    """Return the claims that the case has something to say about."""
    makers: list[Callable[[PaperCase], Claim]] = [_trends]
    if case.regressions is not None:
        makers = [_priors, *makers, _generated]
        if WITH in case.similarity:
            makers.append(_interaction)
    return [make(case) for make in makers]


def _priors(case: PaperCase) -> Claim:
    assert case.regressions is not None
    errors = {name: prior.error for name, prior in case.regressions.priors.items()}
    said = ", ".join(f"{name} {error:.1f}" for name, error in errors.items())
    return Claim(
        2,
        "A suitable prior mean makes the regression much smoother and closer to the ground truth (five training points; zero "
        "mean, mean of the training data, fitted cubic).",
        f"RMS distance of the posterior mean from the planned path, in cells: {said}. The path is seen along its own chord.",
        errors["cubic polynomial"] <= min(errors.values()) + 1e-6,
        {f"rms_cells {name}": error for name, error in errors.items()},
        figure_2(case.regressions),
    )


def _trends(case: PaperCase) -> Claim:
    said = "; ".join(
        f"{name} {error:.3f} (K = {count})" for name, (error, count) in case.trends.items()
    )
    ours, uniform = (
        case.trends[name][0] for name in ("paper preset", "uniform, as many as the paper preset")
    )
    return Claim(
        3,
        "Changepoints lie where the trend of speed changes, so that acceleration within a primitive can be taken as constant.",
        f"RMS deviation of speed from one straight line per primitive, in m/s: {said}.",
        ours < uniform,
        {f"rms_mps {name}": error for name, (error, _) in case.trends.items()}
        | {f"changepoints {name}": count for name, (_, count) in case.trends.items()},
        figure_3(case),
    )


def _generated(case: PaperCase) -> Claim:
    off = ", ".join(f"{name} {100.0 * share:.1f} %" for name, share in case.off_road.items())
    stops = {name: speed for name, speed in case.stop_speed.items() if math.isfinite(speed)}
    said = (
        "While a vehicle waits in the template, its mean speed is, in m/s: "
        + ", ".join(f"{n} {v:.2f}" for n, v in stops.items())
        if stops
        else "No vehicle that drives in this template also waits, so there is no stop to keep"
    )
    notes = "".join(f" ({name}: {note}.)" for name, arm in case.arms.items() for note in arm.notes)
    holds = stops[WITH] < WAITS <= stops[WITHOUT] if {WITH, WITHOUT} <= set(stops) else None
    if case.off_road.get(WITH, 0.0) > OFF_ROAD:
        holds = False
    values = {f"off_road {name}": share for name, share in case.off_road.items()}
    return Claim(
        4,
        "The results keep to the road and to the given ends; with changepoints a vehicle slows down and stands as in the "
        "template, without them it does not stop.",
        f"Instants with a vehicle's centre off the road: {off}. {said}.{notes}",
        holds,
        values | {f"stop_speed_mps {name}": speed for name, speed in stops.items()},
        figure_4(case),
    )


def _interaction(case: PaperCase) -> Claim:
    said, values = [], dict[str, float | None]()
    for kind in ("position", "speed"):
        shown = []
        for name in (WITH, WITHOUT, UNIFORM):
            if name in case.similarity:
                error, correlation = (
                    case.similarity[name][f"{what}_{kind}"] for what in ("e", "correlation")
                )
                shown.append(f"{name} {error.value:.3f} [{error.low:.3f}, {error.high:.3f}]")
                for key, value in (("", error.value), (" low", error.low), (" high", error.high)):
                    values[f"e_{kind} {name}{key}"] = finite(value)
                values[f"correlation_{kind} {name}"] = finite(correlation.value)
        said.append(f"{kind}: " + ", ".join(shown))
    errors = [
        case.similarity[name][f"e_{kind}"].value
        for kind in ("position", "speed")
        for name in (WITH, WITHOUT)
        if name in case.similarity
    ]
    holds = errors[0] < errors[1] and errors[2] < errors[3] if len(errors) == 4 else None
    scales = ", ".join(
        f"{fitted.scale:.2f}" for fitted in case.arms[WITH].fit.fitted if not fitted.stands.all()
    )
    return Claim(
        5,
        "The mean normalised DTW feature of the scenarios generated with changepoints is close to the template's, that of those "
        "without is not; for vehicles that meet on a straight road, speed is what is lost.",
        f"E, the relative distance of the mean matrix to the template's (K = {len(case.segmentation.changepoints)}): "
        + "; ".join(said)
        + f". Scales of eq 9, one per vehicle that drives: {scales} cells per metre; where they differ, so do "
        "the matrices of speed.",
        holds,
        values,
        figure_5(case),
    )


def finite(value: float) -> float | None:
    """Return the value, or None where it is no number (as JSON has it)."""
    return value if math.isfinite(value) else None
