# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A series (T, D) -> posterior over its segmentations.

Chains start with k-means over windows of the series.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
import warnings

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy import special
from scipy.cluster.vq import kmeans2

from scenario_gen.base.errors import InputError
from scenario_gen.method.segmentation.hdp_hmm.config import SamplerConfig
from scenario_gen.method.segmentation.hdp_hmm.problem import (
    compact,
    moving_mean,
    new_top,
    Place,
    Prior,
    Problem,
)
from scenario_gen.method.segmentation.posterior import pool, Posterior, r_hat
from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.blas import one_blas_thread

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


MIN_SAMPLES = 4
SPARE_COUNT = 5  # states beyond those of the start
FIRST_CHECK_ITERATIONS = 40  # sweeps before the chains are first compared
MAX_FULL_SHARE = 0.05  # of a chain's samples that may use all states
MIN_RESIDUAL_RATIO = 1e-4  # of a channel, not explained by the channels before it, to its norm
SIDE_SAMPLES = 4  # before, and after, whose median a sample is compared with
OUTLIER_FACTOR = 8.0  # of the usual distance from both medians


def sample_posterior(
    x: Floats, config: SamplerConfig, seed: int, ends: Ints, error: Floats
) -> Posterior:
    """Sample the segmentations of a series under the sticky HDP-HMM, with priors from the data.

    Source: Fox et al. 2011.

    Args:
        x: (T, D), any units, NaN for outliers (`hide_outliers`).
        config: model and sampler.
        seed: same seed, same answer.
        ends: (Q,) one past the index of the last sample of each sequence.
        error: (D,) standard deviation of each channel's measurement error, in x's units.

    Raises:
        InputError: a sequence is too short for the order.
    """
    scaled, variance, channels = standardised(x, error)
    if not len(channels):
        return Posterior.constant(ends)
    with one_blas_thread():
        problem = Problem.build(scaled, ends, config, variance)
        return sample(problem, config, seed, ends, channels)


def standardised(x: Floats, error: Floats) -> tuple[Floats, Floats, Ints]:
    """Centre and scale the channels of x (T, D), and leave out those without information.

    The scale is the standard deviation of the series clipped by 2 % on either side, so that
    outliers do not determine it. A channel that is, to 1 in 10^4, a linear combination of those
    before it adds nothing and would make every covariance singular.

    Args:
        x: (T, D), NaN for outliers (`hide_outliers`).
        error: (D,) measurement error of each channel, a standard deviation.

    Returns:
        Scaled series (T, D'), variance of its measurement error (D',), indices of its channels
        (D',).
    """
    spread, centre = np.nanstd(x, axis=0), np.nanmean(x, axis=0)
    inner = inner_spread(x)
    varies = spread > 1e-9 * np.maximum(np.nanmax(np.abs(x), axis=0), 1e-300)
    unit = np.where(inner > 0.1 * spread, inner, spread)
    unit = np.maximum(unit, error)  # a channel of pure noise is not scaled up
    channels = np.flatnonzero(varies)
    scaled = (x[:, channels] - centre[channels]) / unit[channels]
    complete = scaled[~np.isnan(scaled).any(axis=1)]
    if len(complete) > 2 * len(channels):
        deviation = complete.std(axis=0)
        kept = independent(complete / np.where(deviation > 0.0, deviation, np.inf))
        channels, scaled = channels[kept], scaled[:, kept]
    return np.ascontiguousarray(scaled), np.square(error[channels] / unit[channels]), channels


def inner_spread(x: Floats) -> Floats:
    """Return the standard deviation (D,) of the channels of x (T, D), clipped by 2 % per side."""
    low, high = np.nanquantile(x, [TAIL_SHARE, 1.0 - TAIL_SHARE], axis=0)
    return np.asarray(np.nanstd(np.clip(x, low, high), axis=0))


def usual_distances(x: Floats, ends: Ints) -> Floats:
    """Return the usual distance (D,) of a sample from the median of the four before it.

    It is at least a tenth of the channel's spread. Sequences end before the samples `ends` (Q,);
    the first sample of a sequence does not count.

    Raises:
        InputError: fewer than 4 samples.
    """
    if len(x) < MIN_SAMPLES:
        raise InputError(
            f"segmentation needs at least {MIN_SAMPLES} samples; n_samples = {len(x)}"
        )
    before, _ = _from_medians(x, ends)
    with np.errstate(all="ignore"):
        deviation = 1.4826 * np.nanmedian(np.abs(before), axis=0)
        return np.asarray(np.fmax(deviation, 0.1 * inner_spread(x)))


def hide_outliers(x: Floats, usual: Floats, ends: Ints) -> Floats:
    """Replace single outliers of x (T, D) by NaN.

    An outlier lies more than OUTLIER_FACTOR times `usual` (D,) beyond the medians of both the four
    samples before and the four after it, within its sequence; sequences end before the samples
    `ends` (Q,). Without this, the 10^6 of a failed sensor would determine the scale of its
    channel, and the sampler would give it a state rather than treat it as noise.
    """
    from_before, from_after = _from_medians(x, ends)
    before = np.where(np.isnan(from_before), from_after, from_before)
    after = np.where(np.isnan(from_after), from_before, from_after)
    nearest = np.where(before * after > 0.0, np.minimum(np.abs(before), np.abs(after)), 0.0)
    return np.where((nearest > OUTLIER_FACTOR * usual) & (usual > 0.0), np.nan, x)


def _from_medians(x: Floats, ends: Ints) -> tuple[Floats, Floats]:
    """Return x (T, D) minus the medians of the four samples before, and of the four after it."""
    gap = np.full((SIDE_SAMPLES, x.shape[1]), np.nan)
    pieces = np.split(x, ends[:-1])
    separated = np.concatenate([gap, *(part for piece in pieces for part in (piece, gap))])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # windows of NaN only
        median = np.nanmedian(sliding_window_view(separated, SIDE_SAMPLES, axis=0), axis=-1)
    gaps_before = np.repeat(np.arange(len(ends)), np.diff(ends, prepend=0))
    row = np.arange(len(x)) + SIDE_SAMPLES * gaps_before
    return x - median[row], x - median[row + SIDE_SAMPLES + 1]


def independent(x: Floats) -> Ints:
    """Return the columns of x (T, D) that are no linear combination of those before them."""
    x = x - x.mean(axis=0)
    kept: list[int] = []
    for i, column in enumerate(x.T):
        rest = column - x[:, kept] @ np.linalg.lstsq(x[:, kept], column)[0]
        if np.linalg.norm(rest) > MIN_RESIDUAL_RATIO * np.linalg.norm(column):
            kept.append(i)
    return np.array(kept, dtype=np.int64)


def sample(
    problem: Problem, config: SamplerConfig, seed: int, ends: Ints, channels: Ints
) -> Posterior:
    """Run the chains until they agree or `config.sweeps` is reached.

    If all states were used, start again with twice as many.

    Args:
        problem: the samples, scaled, with their priors.
        config: model and sampler.
        seed: any integer.
        ends: (Q,) one past the index of the last sample of each sequence.
        channels: (D',) indices of the problem's channels in the caller's series.
    """
    first, *seeds = np.random.SeedSequence([seed]).spawn(config.chains + 1)
    start = find_start(problem, config, np.random.Generator(np.random.PCG64(first)))
    streams = [np.random.Generator(np.random.PCG64(stream)) for stream in seeds]
    states = config.states or start.states + SPARE_COUNT
    places = _places(start, config, states, streams)
    while True:
        pairs = zip(places, streams, strict=True)
        chains = [Chain(start, config, place, states, rng) for place, rng in pairs]
        run_until_agreed(chains, config)
        is_full = max(chain.full_share for chain in chains) > MAX_FULL_SHARE
        if not is_full or config.states or states >= MAX_STATES_COUNT:
            break
        places = [chain.place for chain in chains]
        states = min(2 * states, MAX_STATES_COUNT)
    samples, traces = [chain.samples for chain in chains], [chain.trace for chain in chains]
    posterior = pool(samples, traces, ends, problem.lead)
    drawn = np.log(np.array([[chain.prior.extra, chain.prior.worth] for chain in chains]))
    extra, worth = np.exp(drawn.mean(axis=0)).tolist()
    return replace(
        posterior,
        states=states,
        full=is_full,
        dof=start.problem.dof,
        weight=start.problem.weight,
        channels=channels,
        extra=extra,
        worth=worth,
    )


def _places(
    start: Start, config: SamplerConfig, states: int, streams: list[np.random.Generator]
) -> list[Place]:
    """Return where each chain starts, with labels below `states`."""
    places = [start.place]
    places += [other_start(start, config, k, streams[k]) for k in range(1, config.chains)]
    return [Place(np.minimum(place.labels, states - 1), place.mass) for place in places]


def run_until_agreed(chains: Sequence["Chain"], config: SamplerConfig) -> None:
    """Run chains until their R-hat is low enough, at most `config.sweeps` sweeps."""
    for sweeps in schedule(config.sweeps):
        for chain in chains:
            chain.extend_to(sweeps)
        if config.r_hat > 1.0 and r_hat([chain.trace for chain in chains]).max() <= config.r_hat:
            break


def schedule(sweeps: int) -> Iterator[int]:
    """Yield the numbers of sweeps after which the chains are compared, growing by a half each."""
    sweep = min(FIRST_CHECK_ITERATIONS, sweeps)
    while True:
        yield sweep
        if sweep >= sweeps:
            return
        sweep = min(sweep + sweep // 2, sweeps)


class Chain:
    """A chain that can be continued; the first half of its sweeps is burn-in."""

    def __init__(
        self,
        start: Start,
        config: SamplerConfig,
        place: Place,
        states: int,
        rng: np.random.Generator,
    ) -> None:
        """Start at `place` with weak-limit truncation L = `states`."""
        self._start, self._config, self._rng = start, config, rng
        self._samples: list[Ints] = []
        self._traces: list[Floats] = []
        self._ran = 0
        self.prior = start.prior
        self._states, self._top = states, new_top(states)
        self.place = place

    def extend_to(self, sweeps: int) -> None:
        """Run until `sweeps` sweeps have been run."""
        more = sweeps - self._ran
        seed = int(self._rng.integers(2**62))
        problem = self._start.problem
        self.place, self.prior, samples, trace = problem.run(
            self._config, self.prior, self.place, self._top, 0, more, seed
        )
        self._samples.append(samples)
        self._traces.append(trace)
        self._ran = sweeps

    @property
    def full_share(self) -> float:
        """Share of the kept sweeps in which all states were in use."""
        return float(np.mean(self.trace[:, 1] == self._states))

    @property
    def samples(self) -> Ints:
        """(S, T') kept labels."""
        return np.concatenate(self._samples)[self._ran // 2 :]

    @property
    def trace(self) -> Floats:
        """(S, 5) trace of the kept sweeps."""
        return np.concatenate(self._traces)[self._ran // 2 :]
