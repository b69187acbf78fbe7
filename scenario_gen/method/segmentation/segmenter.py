# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Encounter -> Segmentation: features, sampler, and rules for plausible changepoints."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.method.segmentation.features import (
    driving_features,
    paper_features,
    without_outliers,
)
from scenario_gen.method.segmentation.hdp_hmm.config import SamplerConfig
from scenario_gen.method.segmentation.hdp_hmm.sample import (
    hide_outliers,
    sample_posterior,
    usual_distances,
)
from scenario_gen.method.segmentation.posterior import in_order, Posterior
from scenario_gen.method.segmentation.trends import course, Trends
from scenario_gen.numerics import Floats, Ints
from scenario_gen.types import describe_segments, Motion, Segmentation, Vehicle

DRIVING_SAMPLER = SamplerConfig(weight=0.5, chains=3, sweeps=60)


@dataclass(frozen=True)
class SegmentationConfig(Parameters):
    """How an encounter is cut into primitives."""

    preset: str = parameter(
        "driving",
        "features: accelerations and standing, or the paper's positions and speeds",
        choices=("driving", "paper"),
    )
    max_rate: float = parameter(
        0.5,
        "maximum mean number of changepoints per second (the least useful are dropped)",
        unit="1/s",
        low=0.0,
        high=10.0,
    )
    min_segment: float = parameter(
        0.2, "shorter segments join a neighbour", unit="s", low=0.0, high=10.0
    )
    settle: float = parameter(
        0.8,
        "a changepoint may move this far to where trends of speed or course change",
        unit="s",
        low=0.0,
        high=2.0,
    )
    significance_level: float = parameter(
        1e-4,
        "probability that noise alone makes a changepoint as useful as required",
        low=1e-12,
        high=0.5,
    )
    min_probability: float = parameter(
        0.05, "posterior probability above which a changepoint may be added", low=0.0, high=1.0
    )
    speed_window: float = parameter(
        1.0, "window of the longitudinal acceleration", unit="s", low=0.3, high=5.0
    )
    turn_window: float = parameter(
        2.0, "window of the lateral acceleration", unit="s", low=0.4, high=10.0
    )
    speed_noise: float = parameter(
        0.2,
        "differences of longitudinal acceleration that are noise",
        unit="m/s²",
        low=0.0,
        high=5.0,
    )
    turn_noise: float = parameter(
        0.4,
        "differences of lateral acceleration that are noise",
        unit="m/s²",
        low=0.0,
        high=5.0,
    )
    sampler: SamplerConfig = DRIVING_SAMPLER


DEFAULT = SegmentationConfig()


def segment(
    encounter: Motion, config: SegmentationConfig = DEFAULT, seed: int = 0
) -> Segmentation:
    """Cut an encounter into joint primitives (paper II-B).

    Args:
        encounter: N >= 1 vehicles, T samples.
        config: with `preset="paper"` the sampler gets raw positions and speeds, and only segments
            that are too short are merged.
        seed: same seed, same answer.

    Raises:
        InputError: fewer than 4 samples, or it is no encounter.
    """
    if not isinstance(encounter, Motion):
        raise InputError(
            "segment: an encounter is needed, e.g. read_log(path).encounters[0], not "
            f"{type(encounter).__name__}"
        )
    if config.preset == "paper":
        features = paper_features(encounter)
        posterior = sample_features(features, np.zeros(features.shape[1]), config.sampler, seed)
        points = cut(posterior, config, encounter.dt)
    else:
        encounter = without_outliers(encounter)
        features, noise = driving_features(
            encounter,
            config.speed_window,
            config.turn_window,
            config.speed_noise,
            config.turn_noise,
        )
        posterior = sample_features(features, noise, config.sampler, seed)
        points = on_trends(encounter, posterior, cut(posterior, config, encounter.dt), config)
    labels = in_order(relabel(posterior.labels, points))
    r_hat = float(posterior.r_hat.max())
    return Segmentation(
        labels, points, posterior.probability, describe_segments(encounter, points), r_hat
    )


def sample_features(
    features: Floats, noise: Floats, config: SamplerConfig, seed: int
) -> Posterior:
    """Return the posterior of features (T, D) with this noise (D,)."""
    ends = np.array([len(features)])
    visible = hide_outliers(features, usual_distances(features, ends), ends)
    return sample_posterior(visible, config, seed, ends, noise)


def segment_track(
    position: Floats, speed: Floats, dt: float, config: SegmentationConfig = DEFAULT, seed: int = 0
) -> Segmentation:
    """Cut the drive of one vehicle alone into primitives; see `segment`.

    Args:
        position: (T, 2) m.
        speed: (T,) m/s.
        dt: sampling period, s.
        config: as for an encounter.
        seed: same seed, same answer.

    Raises:
        InputError: fewer than 4 samples, inconsistent shapes, a value that is not finite, or a
            negative speed.
    """
    position, speed = np.asarray(position, np.float64), np.asarray(speed, np.float64)
    samples = len(speed) if speed.ndim == 1 else 0
    if position.shape != (samples, 2) or samples < 4:
        raise InputError(
            "a track needs (T, 2) positions and (T,) speeds with T >= 4; the shapes are "
            f"{position.shape} and {speed.shape}"
        )
    is_finite = np.isfinite(position).all() and np.isfinite(speed).all()
    if not (dt > 0.0 and is_finite and (speed >= 0.0).all()):
        raise InputError(
            f"a track needs finite positions, finite speeds >= 0 and dt > 0 s; dt is {dt}"
        )
    heading = course(position, speed, dt)[0]
    track = Motion.sampled((Vehicle("0"),), dt, position[None], heading[None], speed[None])
    return segment(track, config, seed)


def on_trends(
    encounter: Motion, posterior: Posterior, points: Ints, config: SegmentationConfig
) -> Ints:
    """Move changepoints (K,) to where trends change, and keep the most useful ones.

    See `trends`; `max_rate` limits their number.
    """
    trends = Trends.of(encounter)
    chance = config.significance_level
    min_gain, sure_gain = trends.threshold(chance), trends.threshold(chance * chance)
    reach = round(config.settle / encounter.dt)
    gap = _min_samples(config, encounter.dt)
    no_limit = encounter.speed.shape[1]
    max_count = int(encounter.duration * config.max_rate)
    probability = posterior.probability_within(round(0.5 / encounter.dt))
    candidates = np.flatnonzero(probability > config.min_probability)
    knots = trends.align(points.tolist(), reach, gap)
    knots = trends.align(trends.drop(knots, min_gain, no_limit), reach, gap)
    knots = trends.align(trends.add(knots, candidates, min_gain, gap), reach, gap)
    # A speed change below the noise in the sampler's window can still be clear over many seconds.
    anywhere = np.arange(trends.samples)
    knots = trends.align(trends.add(knots, anywhere, sure_gain, gap), reach, gap)
    knots = trends.align(trends.drop(knots, min_gain, max_count), reach, gap)
    return np.array(knots, dtype=np.int64)


def _min_samples(config: SegmentationConfig, dt: float) -> int:
    """Return the number of samples of the shortest segment."""
    return max(2, int(np.ceil(config.min_segment / dt - 1e-9)))


def cut(posterior: Posterior, config: SegmentationConfig, dt: float) -> Ints:
    """Return the estimate's changepoints (K,) without segments shorter than `min_segment`.

    Of the two changepoints around such a segment the less probable one is removed; of a segment at
    either end, the inner one.
    """
    labels = posterior.labels
    shortest = _min_samples(config, dt)
    points = list(posterior.changepoints)
    while points:
        edges = np.array([0, *points, len(labels)])
        lengths = np.diff(edges)
        i = int(np.argmin(lengths))
        if lengths[i] >= shortest:
            break
        around = [j for j in (i - 1, i) if 0 <= j < len(points)]
        probability = [
            posterior.probability[max(points[j] - 1, 0) : points[j] + 2].sum() for j in around
        ]
        del points[around[int(np.argmin(probability))]]
    return np.array(points, dtype=np.int64)


def relabel(labels: Ints, points: Ints) -> Ints:
    """Give each segment between `points` (K,) the most frequent one of its labels (T,).

    Neighbours get different labels. A segment that has only its left neighbour's label gets a new
    one.
    """
    edges = [0, *(int(c) for c in points), len(labels)]
    result = np.empty_like(labels)
    previous, new = -1, int(labels.max()) + 1
    for a, b in pairwise(edges):
        votes = np.bincount(labels[a:b])
        if 0 <= previous < len(votes):
            votes[previous] = 0
        label = int(votes.argmax()) if votes.any() else new
        new += label == new
        previous = label
        result[a:b] = label
    return result
