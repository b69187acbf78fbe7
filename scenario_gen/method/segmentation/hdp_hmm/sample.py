# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A series (T, D) -> posterior over its segmentations."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
import warnings

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from scenario_gen.base.errors import InputError
from scenario_gen.method.segmentation.hdp_hmm.config import SamplerConfig
from scenario_gen.method.segmentation.hdp_hmm.problem import new_top, Place, Problem
from scenario_gen.method.segmentation.hdp_hmm.start import (
    find_start,
    MAX_STATES_COUNT,
    other_start,
    Start,
    TAIL_SHARE,
)
from scenario_gen.method.segmentation.posterior import pool, Posterior, r_hat
from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.blas import one_blas_thread

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
