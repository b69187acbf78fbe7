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

WINDOW_SAMPLES = (9, 15, 5, 25)  # averaged before k-means; each chain has another one
INITIAL_EXTRA_COUNT, INITIAL_WORTH_WEIGHT = 25.0, 0.1  # ν0 - D and κ0
DOF_COUNT = (2.0, 3.0, 4.0, 6.0, 10.0)  # candidates for the noise's degrees of freedom
MIN_GAIN_LOG_RATIO = 10.0  # of heavy tails over Gaussian noise
CLUSTERS_COUNT, MAX_STATES_COUNT = 20, 160
FULL_SHARE = 0.8  # of the clusters in use, above which there are too few
EXTRA_STATES_COUNT = 2  # of the other chains
STAGE_ITERATIONS = (15, 10)  # Gibbs sweeps between two rounds of merging
MIN_WEIGHT = 0.02  # of a sample
TAIL_SHARE, TAIL_MARGIN_RATIO = 0.02, 0.5  # clipped before k-means


@dataclass(frozen=True, eq=False)
class Start:
    """Where a chain starts, and the problem and prior, whose open parameters are chosen."""

    problem: Problem
    prior: Prior
    place: Place

    @property
    def states(self) -> int:
        """States in use."""
        return int(self.place.labels.max()) + 1


def cluster(problem: Problem, clusters: int, window: int, rng: np.random.Generator) -> Place:
    """Label samples by k-means of moving averages over `window`; outliers are clipped first."""
    window = min(window, max(len(problem.v) // 8, 1))
    signals = problem.y if problem.regressors == 1 else _dynamics(problem)
    low, high = np.quantile(signals, [TAIL_SHARE, 1.0 - TAIL_SHARE], axis=0)
    margin = TAIL_MARGIN_RATIO * (high - low)
    clipped = np.clip(signals, low - margin, high + margin)
    smooth = np.ascontiguousarray(moving_mean(clipped, window))
    centres = min(clusters, max(2, len(smooth) // 4))
    with warnings.catch_warnings(), np.errstate(invalid="ignore"):
        warnings.simplefilter("ignore", UserWarning)  # empty clusters, equal samples
        _, labels = kmeans2(smooth, centres, iter=10, minit="++", rng=rng)
    return Place(compact(labels), problem.observed)


def _dynamics(problem: Problem) -> Floats:
    """Return what distinguishes autoregressive states: sample, step and size of the step."""
    y = problem.y
    step = y - problem.v[:, 1 : 1 + problem.dimensions]
    size = np.abs(step)
    return np.hstack([y, step / (step.std(axis=0) + 1e-12), size / (size.std(axis=0) + 1e-12)])


def find_start(problem: Problem, config: SamplerConfig, rng: np.random.Generator) -> Start:
    """Find where the first chain starts, and choose open parameters of the model from the data.

    k-means of averaged samples gives labels; a few Gibbs sweeps improve them; states are merged
    while the marginal likelihood grows; all this twice. Chosen on the way: the tails of the noise
    (`tails`), the weight of a sample (`sample_weight`), and the mean of the states' covariances.
    If most clusters stay in use, it starts again with twice as many.
    """
    clusters = config.states or CLUSTERS_COUNT
    largest = min(MAX_STATES_COUNT, len(problem.v) // 8)
    while True:
        start = _start_with(problem, config, clusters, rng)
        if config.states or start.states < FULL_SHARE * clusters or clusters >= largest:
            return start
        clusters *= 2


def _start_with(
    problem: Problem, config: SamplerConfig, clusters: int, rng: np.random.Generator
) -> Start:
    place = cluster(problem, clusters, WINDOW_SAMPLES[0], rng)
    initial_correlation = _autocorrelation(problem, place)
    prior = Prior(problem.within(place), INITIAL_EXTRA_COUNT, INITIAL_WORTH_WEIGHT)
    for stage, sweeps in enumerate(STAGE_ITERATIONS):
        top = new_top(max(clusters, place.labels.max() + 1))
        seed = int(rng.integers(2**62))
        place, drawn, _, _ = problem.run(config, prior, place, top, sweeps - 1, 1, seed)
        place = problem.merge(drawn, place)
        prior = replace(drawn, within=problem.within(place))
        if stage == 0:
            chosen = problem
            if config.dof == 0.0:
                chosen = replace(chosen, dof=tails(problem, place))
            if config.weight == 0.0:
                weight = sample_weight(problem, place, initial_correlation)
                chosen = replace(chosen, weight=weight)
            if chosen.dof == 0.0:
                place = Place(place.labels, problem.observed)
            if chosen.weight != problem.weight:
                place = cluster(chosen, clusters, WINDOW_SAMPLES[0], rng)
            problem = chosen
    return Start(problem, prior, place)


def other_start(
    start: Start, config: SamplerConfig, index: int, rng: np.random.Generator
) -> Place:
    """Return where chain number `index` > 0 starts, under the prior of `start`.

    It uses k-means with another window, a few sweeps, and merging.
    """
    problem, clusters = start.problem, start.states + EXTRA_STATES_COUNT
    place = cluster(problem, clusters, WINDOW_SAMPLES[index % len(WINDOW_SAMPLES)], rng)
    seed, sweeps = int(rng.integers(2**62)), STAGE_ITERATIONS[1]
    place = problem.run(config, start.prior, place, new_top(clusters), sweeps - 1, 1, seed)[0]
    return problem.merge(start.prior, place)


def tails(problem: Problem, place: Place) -> float:
    """Return the most likely of DOF_COUNT given the whitened squares; 0 (Gaussian) if none is.

    For each a common scale of the squares is fitted, too: states fitted under other tails have
    another spread.
    """
    squares = problem.unexplained(place)[2][place.mass > 0.0]
    d, n = problem.dimensions, len(squares)
    if n == 0:
        return 0.0
    scale = n * d / max(float(squares.sum()), 1e-300)
    gaussian = 0.5 * n * d * (np.log(scale) - 1.0)
    best, chosen = MIN_GAIN_LOG_RATIO / problem.weight, 0.0
    for dof in DOF_COUNT:
        c = scale
        for _ in range(30):
            c = n * d / float(((dof + d) * squares / (dof + c * squares)).sum())
        gammas = special.gammaln(0.5 * (dof + d)) - special.gammaln(0.5 * dof)
        value = n * (gammas - 0.5 * d * np.log(0.5 * dof))
        distances = float(np.log(1.0 + c * squares / dof).sum())
        value += 0.5 * n * d * np.log(c) - 0.5 * (dof + d) * distances
        if value - gaussian > best:
            best, chosen = value - gaussian, dof
    return chosen


def sample_weight(problem: Problem, place: Place, initial_correlation: float) -> float:
    """Return the weight of a sample: (1 - φ) / (1 + φ), φ the lag-1 autocorrelation of residuals.

    An HMM assumes independent samples given their state. If they are correlated (smoothed, slowly
    varying or oversampled signals), it spends states on wiggles. The weight makes n correlated
    samples count as many as the independent ones that hold the same information; for independent
    samples it is 1. Wrong states leave correlation, too, so φ is the smaller one of that around
    k-means' labels (`initial_correlation`) and that around the labels of `place`.
    """
    phi = min(initial_correlation, _autocorrelation(problem, place))
    if phi < 2.0 / np.sqrt(len(problem.v)):
        return 1.0
    return max((1.0 - phi) / (1.0 + phi), MIN_WEIGHT)


def _autocorrelation(problem: Problem, place: Place) -> float:
    """Return the lag-1 autocorrelation of the residuals, mean over channels.

    Only neighbours with one label count.
    """
    labels = place.labels
    residual = problem.unexplained(place)[0] * np.sqrt(place.mass)[:, None]
    pairs = labels[:-1] == labels[1:]
    pairs[problem.ends[:-1] - 1] = False
    observed = problem.observed > 0.0
    pairs &= observed[:-1] & observed[1:]
    if not pairs.any():
        return 0.0
    power = np.square(residual[observed]).mean(axis=0) + 1e-300
    return float(np.mean((residual[:-1] * residual[1:])[pairs].mean(axis=0) / power))
