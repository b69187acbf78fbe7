# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Where a chain starts: k-means over windows of the series."""

from dataclasses import dataclass, replace
import warnings

import numpy as np
from scipy import special
from scipy.cluster.vq import kmeans2

from scenario_gen.method.segmentation.hdp_hmm.config import SamplerConfig
from scenario_gen.method.segmentation.hdp_hmm.problem import (
    compact,
    moving_mean,
    new_top,
    Place,
    Prior,
    Problem,
)
from scenario_gen.numerics import Floats

WINDOWS = (9, 15, 5, 25)
GUESS = (25.0, 0.1)  # ν0 - D and κ0 to begin with
DEGREES_OF_FREEDOM = (2.0, 3.0, 4.0, 6.0, 10.0)
LEAST_GAIN = 10.0
CLUSTERS, MOST_STATES = 20, 160
FULL = 0.8
MORE_STATES = 2
STAGES = (15, 10)
LEAST_WEIGHT = 0.02
KMEANS_ROUNDS = 10
FAR_QUANTILE, FAR_MARGIN = 0.02, 0.5


@dataclass(frozen=True, eq=False)
class Start:
    """Where to start from, and the problem and prior to run under, chosen from the data."""

    problem: Problem
    prior: Prior
    place: Place

    @property
    def states(self) -> int:
        """States in use."""
        return int(self.place.labels.max()) + 1


def cluster(problem: Problem, clusters: int, window: int, rng: np.random.Generator) -> Place:
    """Labels of k-means on the samples averaged over `window`; what lies far outside the rest is drawn in first."""
    window = min(window, max(len(problem.v) // 8, 1))
    signals = problem.y if problem.regressors == 1 else _dynamics(problem)
    low, high = np.quantile(signals, [FAR_QUANTILE, 1.0 - FAR_QUANTILE], axis=0)
    margin = FAR_MARGIN * (high - low)
    smooth = np.ascontiguousarray(
        moving_mean(np.clip(signals, low - margin, high + margin), window)
    )
    centres = min(clusters, max(2, len(smooth) // 4))
    with (
        warnings.catch_warnings(),
        np.errstate(invalid="ignore"),
    ):  # of clusters that run empty, of samples that are all the same
        warnings.simplefilter("ignore", UserWarning)
        _, labels = kmeans2(smooth, centres, iter=KMEANS_ROUNDS, minit="++", rng=rng)
    return Place(compact(labels), problem.observed)


def _dynamics(problem: Problem) -> Floats:
    """What distinguishes autoregressive states, per row: sample, step and size of the step."""
    y = problem.y
    step = y - problem.v[:, 1 : 1 + problem.dimensions]
    size = np.abs(step)
    return np.hstack([y, step / (step.std(axis=0) + 1e-12), size / (size.std(axis=0) + 1e-12)])


def find_start(problem: Problem, config: SamplerConfig, rng: np.random.Generator) -> Start:
    """Find where the first chain starts, and choose from the data what the model leaves open.

    k-means on averaged samples gives labels; a few Gibbs sweeps clean them; states are merged while the marginal likelihood
    grows; twice. Chosen on the way: how heavy the noise's tails are (`tails`), what a sample counts for (`sample_weight`), and
    the mean of the states' covariances, which is what is seen within the states found. Where most clusters stay in use, it
    begins again with twice as many.
    """
    clusters = config.states or CLUSTERS
    while True:
        start = _search(problem, config, clusters, rng)
        if (
            config.states
            or start.states < FULL * clusters
            or clusters >= min(MOST_STATES, len(problem.v) // 8)
        ):
            return start
        clusters *= 2


def _search(
    problem: Problem, config: SamplerConfig, clusters: int, rng: np.random.Generator
) -> Start:
    place = cluster(problem, clusters, WINDOWS[0], rng)
    rough = _autocorrelation(problem, place)
    prior = Prior(problem.within(place), *GUESS)
    for stage, sweeps in enumerate(STAGES):
        top = new_top(max(clusters, place.labels.max() + 1))
        place, held, _, _ = problem.run(
            config, prior, place, top, sweeps - 1, 1, int(rng.integers(2**62))
        )
        place = problem.merge(held, place)
        prior = replace(held, within=problem.within(place))
        if stage == 0:
            chosen = problem
            if config.dof == 0.0:
                chosen = replace(chosen, dof=tails(problem, place))
            if config.weight == 0.0:
                chosen = replace(chosen, weight=sample_weight(problem, place, rough))
            if chosen.dof == 0.0:
                place = Place(place.labels, problem.observed)
            if chosen.weight != problem.weight:
                place = cluster(chosen, clusters, WINDOWS[0], rng)
            problem = chosen
    return Start(problem, prior, place)


def other_start(
    start: Start, config: SamplerConfig, index: int, rng: np.random.Generator
) -> Place:
    """Where chain number `index` > 0 starts: k-means with another window, a few sweeps, merges, under the prior of `start`."""
    problem, clusters = start.problem, start.states + MORE_STATES
    place = cluster(problem, clusters, WINDOWS[index % len(WINDOWS)], rng)
    place = problem.run(
        config, start.prior, place, new_top(clusters), STAGES[1] - 1, 1, int(rng.integers(2**62))
    )[0]
    return problem.merge(start.prior, place)


def tails(problem: Problem, place: Place) -> float:
    """Degrees of freedom of the noise, of a grid, by the likelihood of the whitened squares; 0 (Gaussian) if none is far better.

    For each a common scale of the squares is fitted, too: states fitted under other tails have another spread.
    """
    squares = problem.unexplained(place)[2][place.mass > 0.0]
    d, n = problem.dimensions, len(squares)
    if n == 0:
        return 0.0
    scale = n * d / max(float(squares.sum()), 1e-300)
    gaussian = 0.5 * n * d * (np.log(scale) - 1.0)
    best, chosen = LEAST_GAIN / problem.weight, 0.0
    for dof in DEGREES_OF_FREEDOM:
        c = scale
        for _ in range(30):
            c = n * d / float(((dof + d) * squares / (dof + c * squares)).sum())
        value = n * (
            special.gammaln(0.5 * (dof + d))
            - special.gammaln(0.5 * dof)
            - 0.5 * d * np.log(0.5 * dof)
        )
        value += 0.5 * n * d * np.log(c) - 0.5 * (dof + d) * float(
            np.log(1.0 + c * squares / dof).sum()
        )
        if value - gaussian > best:
            best, chosen = value - gaussian, dof
    return chosen


def sample_weight(problem: Problem, place: Place, rough: float) -> float:
    """What a sample counts for: (1 - φ) / (1 + φ), φ the lag-1 autocorrelation of what states leave unexplained.

    An HMM takes samples as independent given their state. Where they are not (smoothed, slowly varying or oversampled
    signals), it believes each wiggle and spends states on it. The weight makes n correlated samples count for as many
    independent ones as they are worth; for independent samples it is 1. States that are not right yet leave
    correlation too, so φ is the smaller of two: around k-means' labels (`rough`), and around those of `place`.
    """
    phi = min(rough, _autocorrelation(problem, place))
    return (
        1.0
        if phi < 2.0 / np.sqrt(len(problem.v))
        else max((1.0 - phi) / (1.0 + phi), LEAST_WEIGHT)
    )


def _autocorrelation(problem: Problem, place: Place) -> float:
    """Lag-1 autocorrelation of the residuals, mean over channels, from neighbours with one label that were both observed."""
    labels = place.labels
    residual = problem.unexplained(place)[0] * np.sqrt(place.mass)[:, None]
    pairs = labels[:-1] == labels[1:]
    pairs[problem.ends[:-1] - 1] = False
    if not pairs.any():
        return 0.0
    seen = np.ones(residual.shape, np.bool_)
    seen[problem.gaps] = ~problem.hidden
    residual[~seen] = 0.0  # what was filled in repeats its neighbours
    power = np.square(residual).sum(axis=0) / np.maximum(seen.sum(axis=0), 1) + 1e-300
    both = (seen[:-1] & seen[1:])[pairs].sum(axis=0)
    return float(
        np.mean((residual[:-1] * residual[1:])[pairs].sum(axis=0) / np.maximum(both, 1) / power)
    )
