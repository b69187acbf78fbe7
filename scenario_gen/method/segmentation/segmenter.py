# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Encounter -> Segmentation: features, sampler, and the few rules of the road."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.method.segmentation.descriptions import describe_segments
from scenario_gen.method.segmentation.features import (
    driving_features,
    paper_features,
    without_outliers,
)
from scenario_gen.method.segmentation.hdp_hmm.config import SamplerConfig
from scenario_gen.method.segmentation.posterior import in_order, Posterior
from scenario_gen.method.segmentation.series import segment_series
from scenario_gen.method.segmentation.trends import course, Trends
from scenario_gen.numerics import Floats, Ints
from scenario_gen.types import Motion, Segmentation, Vehicle

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
        "most changepoints per second of duration, on average (the least useful are dropped)",
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
        "probability with which noise alone makes a changepoint look as useful as is required of one",
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
        "differences of longitudinal acceleration that mean nothing",
        unit="m/s²",
        low=0.0,
        high=5.0,
    )
    turn_noise: float = parameter(
        0.4,
        "differences of lateral acceleration that mean nothing",
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
        config: with `preset="paper"` the sampler sees raw positions and speeds, and only what is too short is merged.
        seed: same seed, same answer.

    Raises:
        InputError: fewer than 4 samples.
    """
    if config.preset == "paper":
        posterior = segment_series(paper_features(encounter), config.sampler, seed)
        points = cut(posterior, config, encounter.dt)
    else:
        encounter = without_outliers(encounter)
        features, blur = driving_features(
            encounter,
            config.speed_window,
            config.turn_window,
            config.speed_noise,
            config.turn_noise,
        )
        posterior = segment_series(features, config.sampler, seed, blur=blur)
        points = on_trends(encounter, posterior, cut(posterior, config, encounter.dt), config)
    labels = in_order(relabel(posterior.labels, points))
    r_hat = float(posterior.r_hat.max())
    return Segmentation(
        labels, points, posterior.probability, describe_segments(encounter, points), r_hat
    )


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
        InputError: fewer than 4 samples, shapes that disagree, a value that is not finite, or a negative speed.
    """
    position, speed = np.asarray(position, np.float64), np.asarray(speed, np.float64)
    if (
        position.ndim != 2
        or position.shape[1] != 2
        or speed.shape != (len(position),)
        or len(speed) < 4
    ):
        raise InputError(
            f"a track is (T, 2) positions and (T,) speeds, T at least 4; not {position.shape} and {speed.shape}"
        )
    if not (dt > 0.0 and np.isfinite(position).all() and np.isfinite(speed).all()):
        raise InputError(f"a track holds finite positions and speeds, dt > 0 s apart; dt is {dt}")
    heading = course(position, speed, dt)[0]
    return segment(
        Motion.sampled((Vehicle("0"),), dt, position[None], heading[None], speed[None]),
        config,
        seed,
    )


def on_trends(
    encounter: Motion, posterior: Posterior, points: Ints, config: SegmentationConfig
) -> Ints:
    """Put changepoints (K,) where trends change, see `trends`, and keep the most useful ones up to `max_rate`."""
    trends = Trends.of(
        encounter.position, encounter.speed, encounter.dt, encounter.vehicles, encounter.present
    )
    chance = config.significance_level
    least, certain = trends.threshold(chance), trends.threshold(chance * chance)
    reach = round(config.settle / encounter.dt)
    gap = max(2, int(np.ceil(config.min_segment / encounter.dt - 1e-9)))
    most = int(encounter.duration * config.max_rate)
    everything = encounter.speed.shape[1]
    candidates = np.flatnonzero(
        posterior.probability_within(round(0.5 / encounter.dt)) > config.min_probability
    )
    changepoints = trends.settle([int(c) for c in points], reach, gap)
    changepoints = trends.settle(trends.drop(changepoints, least, everything), reach, gap)
    changepoints = trends.settle(trends.add(changepoints, candidates, least, gap), reach, gap)
    # speeds that change by less than their noise in the sampler's window still show in a line's knots over many seconds
    changepoints = trends.settle(
        trends.add(changepoints, np.arange(trends.samples), certain, gap), reach, gap
    )
    changepoints = trends.settle(trends.drop(changepoints, least, most), reach, gap)
    return np.array(changepoints, dtype=np.int64)


def cut(posterior: Posterior, config: SegmentationConfig, dt: float) -> Ints:
    """Return the estimate's changepoints (K,) without segments below `min_segment` or states with fewer than 2 samples.

    Of the two changepoints around such a segment the less probable one goes (at either end, the inner one).
    """
    labels = posterior.labels
    shortest = max(2, int(np.ceil(config.min_segment / dt - 1e-9)))
    points = list(posterior.changepoints)
    while points:
        edges = np.array([0, *points, len(labels)])
        lengths = np.diff(edges)
        i = int(np.argmin(lengths))
        if lengths[i] >= shortest:
            break
        around = [j for j in (i - 1, i) if 0 <= j < len(points)]
        near = [posterior.probability[max(points[j] - 1, 0) : points[j] + 2].sum() for j in around]
        del points[around[int(np.argmin(near))]]
    return np.array(points, dtype=np.int64)


def relabel(labels: Ints, points: Ints, *, fresh: bool = True) -> Ints:
    """Give every segment between `points` (K,) the label, of (T,), that most of its samples have, and neighbours different ones.

    Where a segment holds no other label than its left neighbour's, it gets a new one; or, if not `fresh`, the
    neighbour's after all, so that the changepoint between them is one no longer.
    """
    edges = [0, *(int(c) for c in points), len(labels)]
    result = np.empty_like(labels)
    previous, new = -1, int(labels.max()) + 1
    for a, b in pairwise(edges):
        votes = np.bincount(labels[a:b])
        if 0 <= previous < len(votes):
            votes[previous] = 0
        label = int(votes.argmax()) if votes.max() > 0 else (new if fresh else previous)
        new += label == new
        result[a:b] = previous = label
    return result
