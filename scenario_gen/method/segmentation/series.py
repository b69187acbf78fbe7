# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A plain (T, D) array -> posterior over its segmentations: the sticky HDP-HMM without any driving in it."""

from collections.abc import Iterator
from dataclasses import replace
import warnings

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from scenario_gen.base.errors import InputError
from scenario_gen.method.segmentation.hdp_hmm.config import SamplerConfig
from scenario_gen.method.segmentation.hdp_hmm.problem import new_top, Place, Problem
from scenario_gen.method.segmentation.hdp_hmm.start import (
    FAR_QUANTILE,
    find_start,
    MOST_STATES,
    other_start,
    Start,
)
from scenario_gen.method.segmentation.posterior import pool, Posterior, r_hat
from scenario_gen.numerics import Floats, Ints

SPARE_STATES = 5  # beyond those that the start has
FIRST_CHECK = 40  # sweeps before the chains are first compared
MOST_FULL = 0.05  # share of a chain's samples that may use all states
COLLINEAR = 1e-4  # share of a channel's length that must not follow from the channels before it
SIDE = 4  # samples before, and after, whose median a sample is compared with
OUTLIER = 8.0  # usual distances from both medians, beyond which a sample is an outlier


def segment_series(
    x: Floats,
    config: SamplerConfig = SamplerConfig(),
    seed: int = 0,
    *,
    ends: tuple[int, ...] | None = None,
    blur: Floats | None = None,
) -> Posterior:
    """Sample the segmentations of a series under the sticky HDP-HMM (Fox et al. 2011; priors chosen from the data).

    Args:
        x: (T, D), any units, NaN where nothing was measured; see `standardised`.
        config: model and sampler.
        seed: same seed, same answer.
        ends: where several sequences stand one after the other, the index one past the last sample of each.
        blur: (D,) measurement error of each channel, a standard deviation in x's units (None: 0).

    Raises:
        InputError: fewer than 4 samples, an infinite value, or a sequence too short for the order.
    """
    x = np.asarray(x, dtype=np.float64)
    if x.ndim == 1:
        x = x[:, None]
    if x.ndim != 2 or x.shape[0] < 4:
        raise InputError(
            f"a series to segment needs at least 4 samples in (T, D), not an array of shape {x.shape}"
        )
    if np.isinf(x).any():
        row, column = np.argwhere(np.isinf(x))[0]
        raise InputError(
            f"the series to segment holds {x[row, column]} at sample {row}, channel {column}; put NaN where nothing was measured"
        )
    stops = np.array([len(x)] if ends is None else ends, dtype=np.int64)
    if stops[-1] != len(x) or (np.diff(np.concatenate([[0], stops])) < 1).any():
        raise InputError(
            f"the ends of the sequences must rise to the number of samples, {len(x)}; they are {stops.tolist()}"
        )
    error = np.zeros(x.shape[1]) if blur is None else np.asarray(blur)
    return segment_visible(
        without_outliers(x, usual_distances(x, stops), stops), config, seed, stops, error
    )


def segment_visible(
    x: Floats, config: SamplerConfig, seed: int, ends: Ints, error: Floats
) -> Posterior:
    """`segment_series` of x (T, D), finite or NaN, whose outliers are NaN already; `error` (D,) of each channel.

    Raises:
        InputError: a sequence is too short for the order.
    """
    scaled, variance, channels = standardised(x, error)
    if not len(channels):
        return Posterior.constant(ends)
    problem = Problem.build(scaled, ends, config, variance)
    return sample(problem, config, seed, ends, channels)


def standardised(x: Floats, error: Floats) -> tuple[Floats, Floats, Ints]:
    """Centre and scale the channels of x (T, D); leave out those that do not vary or that follow from the others.

    The scale is the spread without the farthest 2 % on either side, so that outliers do not set it. A channel that is, to 1 in
    10⁴, a linear combination of those before it would make every covariance singular and adds nothing.

    Args:
        x: (T, D), NaN where nothing was measured or a single outlier stood (`without_outliers`).
        error: (D,) measurement error of each channel, a standard deviation.

    Returns:
        (T, D') scaled series, (D',) variance of the measurement error in its units, and the indices (D',) of its channels.
    """
    filled = without_rare_channels(x)
    spread, centre = np.nanstd(filled, axis=0), np.nanmean(filled, axis=0)
    inner = inner_spread(filled)
    varies = spread > 1e-9 * np.maximum(np.nanmax(np.abs(filled), axis=0), 1e-300)
    unit = np.where(inner > 0.1 * spread, inner, spread)
    unit = np.maximum(
        unit, error
    )  # a channel of noise alone must not be scaled up to look like the others
    channels = np.flatnonzero(varies)
    scaled = (filled[:, channels] - centre[channels]) / unit[channels]
    complete = scaled[~np.isnan(scaled).any(axis=1)]
    if len(complete) > 2 * len(channels):
        kept = independent(complete / np.maximum(complete.std(axis=0), 1e-300))
        channels, scaled = channels[kept], scaled[:, kept]
    return np.ascontiguousarray(scaled), np.square(error[channels] / unit[channels]), channels


def inner_spread(x: Floats) -> Floats:
    """(D,) spread of the channels of x (T, D), the farthest 2 % on either side clipped."""
    low, high = np.nanquantile(x, [FAR_QUANTILE, 1.0 - FAR_QUANTILE], axis=0)
    return np.asarray(np.nanstd(np.clip(x, low, high), axis=0))


def without_rare_channels(x: Floats) -> Floats:
    """Return x (T, D) with zeros in the channels that were measured less than twice: these have no spread."""
    return np.where((~np.isnan(x)).sum(axis=0) < 2, 0.0, x)


def usual_distances(x: Floats, ends: Ints) -> Floats:
    """(D,) usual distance of a sample of x (T, D) from the median of the four before it, or a tenth of the channel's spread.

    Sequences end before the samples `ends` (Q,); the first sample of a sequence has nothing before it and is not counted.
    """
    x = without_rare_channels(x)
    before, _ = _from_medians(x, ends)
    with np.errstate(all="ignore"):
        return np.asarray(
            np.fmax(1.4826 * np.nanmedian(np.abs(before), axis=0), 0.1 * inner_spread(x))
        )


def without_outliers(x: Floats, usual: Floats, ends: Ints) -> Floats:
    """Replace single cells of x (T, D) by NaN that lie far beyond the medians of the four samples before and the four after.

    Sequences end before the samples `ends` (Q,); a cell is compared with its own sequence only. Far is OUTLIER times `usual`
    (D,), see `usual_distances`. Why: the 10⁶ of a failed sensor would set the scale of its channel, and the sampler would
    rather give it a state of its own than call it noise.
    """
    before, after = _from_medians(x, ends)
    before, after = (
        np.where(np.isnan(before), after, before),
        np.where(np.isnan(after), before, after),
    )
    nearest = np.where(before * after > 0.0, np.minimum(np.abs(before), np.abs(after)), 0.0)
    return np.where((nearest > OUTLIER * usual) & (usual > 0.0), np.nan, x)


def _from_medians(x: Floats, ends: Ints) -> tuple[Floats, Floats]:
    """Distances of x (T, D) from the medians of the four samples before and the four after; NaN where there are none."""
    gap = np.full((SIDE, x.shape[1]), np.nan)
    pieces = np.split(x, ends[:-1])
    separated = np.concatenate([gap, *(part for piece in pieces for part in (piece, gap))])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of windows that hold NaN alone
        median = np.nanmedian(sliding_window_view(separated, SIDE, axis=0), axis=-1)
    at = np.arange(len(x)) + SIDE * np.repeat(
        np.arange(len(ends)), np.diff(ends, prepend=0)
    )  # its row among the gaps
    return x - median[at], x - median[at + SIDE + 1]


def independent(x: Floats) -> Ints:
    """Columns of x (T, D) that are no linear combination of those before them."""
    x = x - x.mean(axis=0)
    kept: list[int] = []
    for i, column in enumerate(x.T):
        rest = column - x[:, kept] @ np.linalg.lstsq(x[:, kept], column)[0]
        if np.linalg.norm(rest) > COLLINEAR * np.linalg.norm(column):
            kept.append(i)
    return np.array(kept, dtype=np.int64)


def sample(
    problem: Problem, config: SamplerConfig, seed: int, ends: Ints, channels: Ints
) -> Posterior:
    """Run the chains until they agree or `config.sweeps` is reached; start again with more states where all were used.

    Args:
        problem: the samples, scaled, with their priors.
        config: model and sampler.
        seed: any integer.
        ends: (Q,) index one past the last sample of each sequence.
        channels: (D',) indices of the problem's channels in the caller's series.
    """
    first, *seeds = np.random.SeedSequence([seed]).spawn(config.chains + 1)
    start = find_start(problem, config, np.random.Generator(np.random.PCG64(first)))
    streams = [np.random.Generator(np.random.PCG64(stream)) for stream in seeds]
    places = [start.place] + [
        other_start(start, config, index, streams[index]) for index in range(1, config.chains)
    ]
    states = config.states or start.states + SPARE_STATES
    places = [Place(np.minimum(place.labels, states - 1), place.mass) for place in places]
    while True:
        chains = [
            Chain(start, config, place, states, rng)
            for place, rng in zip(places, streams, strict=True)
        ]
        for sweeps in schedule(config.sweeps):
            for chain in chains:
                chain.extend_to(sweeps)
            if (
                config.r_hat > 1.0
                and float(r_hat([chain.trace for chain in chains]).max()) <= config.r_hat
            ):
                break
        full = max(float(np.mean(chain.trace[:, 1] == states)) for chain in chains) > MOST_FULL
        if not full or config.states or states >= MOST_STATES:
            break
        places, states = [chain.place for chain in chains], min(2 * states, MOST_STATES)
    posterior = pool(
        [chain.samples for chain in chains], [chain.trace for chain in chains], ends, problem.lead
    )
    drawn = np.log(np.array([[chain.prior.extra, chain.prior.worth] for chain in chains]))
    extra, worth = np.exp(drawn.mean(axis=0)).tolist()
    return replace(
        posterior,
        states=states,
        full=full,
        dof=start.problem.dof,
        weight=start.problem.weight,
        channels=channels,
        extra=extra,
        worth=worth,
    )


def schedule(sweeps: int) -> Iterator[int]:
    """Numbers of sweeps after which the chains are compared, each half as large again as the one before."""
    sweep = min(FIRST_CHECK, sweeps)
    while True:
        yield sweep
        if sweep >= sweeps:
            return
        sweep = min(sweep + sweep // 2, sweeps)


class Chain:
    """A chain that can be continued; the first half of its sweeps is burn-in and not kept."""

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
        self._top = new_top(states)
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
    def samples(self) -> Ints:
        """(S, T') kept labels."""
        return np.concatenate(self._samples)[self._ran // 2 :]

    @property
    def trace(self) -> Floats:
        """(S, 5) trace of the kept sweeps."""
        return np.concatenate(self._traces)[self._ran // 2 :]
