# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What the paper claims of its figures 2 to 5, as numbers."""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from benchmarks._feature_matrix import pair_similarities
from benchmarks._paper_chain import LENGTH, NOISE, place, rotation, sample, Sampled, SIGMA
from benchmarks._reference_sets import (
    UNIFORM,
    uniform_changepoints,
    WITHOUT,
    without_changepoints,
)
from scenario_gen.base.errors import RefusedError
from scenario_gen.method.evaluation.distributions import Bootstrap
from scenario_gen.method.evaluation.similarity import mean_correlation, mean_error
from scenario_gen.method.sampling.gp import Features, Observations, Regression
from scenario_gen.method.segmentation import segment, SegmentationConfig
from scenario_gen.numerics import Floats, Ints
from scenario_gen.situation import find_waits
from scenario_gen.types import (
    Encounter,
    Interval,
    Road,
    Route,
    Segmentation,
    WITH,
)

PRIORS = {"zero mean": -1, "training data mean": 0, "cubic polynomial": 3}
"""The priors of figure 2, as degrees of the mean."""
RESAMPLES, LEVEL = 1000, 0.95


@dataclass(frozen=True, eq=False)
class Prior:
    """One panel of figure 2: samples (10, m) at x (m,), and how far the posterior's mean is from the truth (RMS, cells)."""

    samples: Floats
    error: float


@dataclass(frozen=True, eq=False)
class Regressions:
    """Figure 2: the planned path (m, 2) of one vehicle as y(x), five training points (5, 2) of it, and the posteriors; metres."""

    x: Floats
    truth: Floats
    training: Floats
    priors: dict[str, Prior]


@dataclass(frozen=True, eq=False)
class PaperCase:
    """Everything the four figures show of one encounter.

    Attributes:
        encounter: the template.
        segmentation: by the paper's preset.
        trends: figure 3, RMS deviation of speed from one straight line per primitive [m/s], and the number of changepoints.
        road: the paper's road, None if it was refused.
        arms: figure 4, samples by arm.
        off_road, stop_speed: share of instants off the road; mean speed during the template's waits [m/s], NaN if there is none.
        regressions: figure 2.
        similarity: figure 5 by arm: E and correlation, each with its interval.
        refused: why an arm, or the whole encounter (""), is missing.
    """

    encounter: Encounter
    segmentation: Segmentation
    trends: dict[str, tuple[float, int]]
    road: Road | None = None
    arms: dict[str, Sampled] = field(default_factory=dict)
    off_road: dict[str, float] = field(default_factory=dict)
    stop_speed: dict[str, float] = field(default_factory=dict)
    regressions: Regressions | None = None
    similarity: dict[str, dict[str, Interval]] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)


def run_case(encounter: Encounter, *, count: int, seed: int) -> PaperCase:
    """Run the paper's chain on one encounter, with its changepoints, without, and with uniform ones."""
    segmentation = segment(encounter, SegmentationConfig(preset="paper"), seed)
    trends = trend_fits(encounter, segmentation, segment(encounter, SegmentationConfig(), seed))
    try:
        road, *ends = place(encounter, segmentation)
    except RefusedError as error:
        return PaperCase(encounter, segmentation, trends, refused={"": str(error)})
    choices = {
        WITH: segmentation,
        WITHOUT: without_changepoints(segmentation),
        UNIFORM: uniform_changepoints(segmentation),
    }
    arms, refused = {}, {}
    for name, chosen in choices.items():
        try:
            arms[name] = sample(
                encounter, chosen, road, (ends[0], ends[1]), count=count, seed=seed
            )
        except RefusedError as error:
            refused[name] = str(error)
    routes = next((arm.routes for arm in arms.values()), ())
    return PaperCase(
        encounter,
        segmentation,
        trends,
        road,
        arms,
        off_road={name: off_road(road, arm.position) for name, arm in arms.items()},
        stop_speed={name: stop_speed(encounter, arm) for name, arm in arms.items()},
        regressions=compare_priors(max(routes, key=_bend), seed) if routes else None,
        similarity={name: similarity_of(encounter, arm, seed) for name, arm in arms.items()},
        refused=refused,
    )


def trend_fits(
    encounter: Encounter, paper: Segmentation, driving: Segmentation
) -> dict[str, tuple[float, int]]:
    """Figure 3: how constant acceleration is within primitives, for several ways of cutting at once."""
    ways = {
        "paper preset": paper,
        "default preset": driving,
        "none": without_changepoints(paper),
        "uniform, as many as the paper preset": uniform_changepoints(paper),
    }
    return {
        name: (line_error(encounter.speed, way.changepoints), len(way.changepoints))
        for name, way in ways.items()
    }


def line_error(speed: Floats, changepoints: Ints) -> float:
    """RMS deviation [m/s] of speeds (N, T) from one least-squares line per vehicle and primitive."""
    total = 0.0
    for a, b in pairwise([0, *changepoints.tolist(), speed.shape[1]]):
        basis = np.vander(np.arange(a, b) - 0.5 * (a + b), 2)
        fitted = basis @ np.linalg.lstsq(basis, speed[:, a:b].T, rcond=None)[0]
        total += float((np.square(speed[:, a:b].T - fitted)).sum())
    return float(np.sqrt(total / speed.size))


def off_road(road: Road, position: Floats) -> float:
    """Share of positions (..., 2) [m], centres of vehicles, that lie off the road."""
    return float(1.0 - road.drivable_at(position).mean())


def stop_speed(encounter: Encounter, arm: Sampled) -> float:
    """Mean speed [m/s, by the vehicle's own scale] during the template's waits of vehicles that also drive; NaN if none."""
    found = []
    for wait in find_waits(encounter):
        if len(arm.routes[wait.vehicle].points) > 1:
            during = (encounter.time >= wait.start) & (encounter.time <= wait.end)
            found.append(
                arm.speed[:, wait.vehicle, during].mean() / arm.fit.fitted[wait.vehicle].scale
            )
    return float(np.mean(found)) if found else float("nan")


def _bend(route: Route) -> tuple[float, float]:
    """How far a path strays from its chord; of straight ones the longest."""
    offset = route.points[:, :2] - route.points[0, :2]
    chord = offset[-1] / max(float(np.hypot(*offset[-1])), 1e-9)
    return round(float(np.abs(offset[:, 0] * chord[1] - offset[:, 1] * chord[0]).max()), 1), float(
        route.length[-1]
    )


def compare_priors(route: Route, seed: int) -> Regressions:
    """Figure 2 on one planned path: the grid is turned so that the path's chord is along x, and y is far from zero."""
    path = route.points[:, :2] @ rotation((route.points[-1] - route.points[0])[:2])
    path = path[
        np.concatenate([[True], path[1:, 0] > np.maximum.accumulate(path[:, 0])[:-1]])
    ]  # a function of x
    x = np.linspace(path[0, 0], path[-1, 0], 120)
    truth = np.interp(x, *path.T)
    at = np.linspace(x[0], x[-1], 5)
    training = np.column_stack([at, np.interp(at, *path.T)])
    observations = Observations(training[:, 0], training[:, 1], np.full(5, NOISE))
    generator = np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, 2])))
    priors = {}
    for name, degree in PRIORS.items():
        posterior = Regression(Features(x[0], x[-1], SIGMA, LENGTH, degree), observations).predict(
            x
        )
        samples = posterior.sample(generator.standard_normal((10, posterior.factor.shape[1])))
        priors[name] = Prior(samples, float(np.sqrt((np.square(posterior.mean - truth)).mean())))
    return Regressions(x, truth, training, priors)


def similarity_of(encounter: Encounter, arm: Sampled, seed: int) -> dict[str, Interval]:
    """Figure 5 as numbers: E and the correlation of the mean matrix, for position and speed."""
    bootstrap = Bootstrap.draw(np.arange(len(arm.position)), RESAMPLES, LEVEL, seed)
    places = pair_similarities(encounter.position, arm.position, "euclidean")
    paces = pair_similarities(encounter.speed[..., None], arm.speed[..., None], "manhattan")
    values: dict[str, Interval] = {}
    for kind, pairs in (("position", places), ("speed", paces)):
        values[f"e_{kind}"] = bootstrap.interval(
            lambda weights, pairs=pairs: mean_error(pairs, weights)  # type: ignore[misc]
        )
        values[f"correlation_{kind}"] = bootstrap.interval(
            lambda weights, pairs=pairs: mean_correlation(pairs, weights)  # type: ignore[misc]
        )
    return values
