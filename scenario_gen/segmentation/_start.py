# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Where a chain starts, and the prior it runs under: k-means, a few sweeps, greedy merges; scales from the data."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING
import warnings

import numpy as np
from scipy.cluster.vq import kmeans2
from scipy.ndimage import uniform_filter1d

from scenario_gen.arrays import Floats, Ints
from scenario_gen.segmentation._problem import compact, Prior, Problem

if TYPE_CHECKING:
    from scenario_gen.segmentation.series import SamplerConfig

WINDOWS = (9, 15, 5, 25)
EXTRA_DEGREES = (3, 10, 20, 50, 100)
STAGES = (20, 15)
LEAST_WEIGHT = 0.02


@dataclass(frozen=True, eq=False)
class Start:
    """Labels (T',) to start from, the prior to run under, and the sweeps spent to find them."""

    labels: Ints
    prior: Prior
    sweeps: int


def cluster(problem: Problem, states: int, window: int, rng: np.random.Generator) -> Ints:
    """(T',) labels of k-means on the samples averaged over `window`."""
    window = min(window, max(len(problem.v) // 8, 1))
    signals = problem.y if problem.regressors == 1 else _dynamics(problem)
    smooth = uniform_filter1d(signals, window, axis=0, mode="nearest")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # fewer clusters than asked for is no trouble: labels are renumbered
        return compact(kmeans2(smooth, min(states, max(2, len(smooth) // 4)), minit="++", rng=rng)[1].astype(np.int64))


def _dynamics(problem: Problem) -> Floats:
    """What distinguishes autoregressive states, per row: sample, step and size of the step."""
    y = problem.y
    step = y - problem.v[:, 1 : 1 + problem.dimensions]
    size = np.abs(step)
    return np.hstack([y, step / (step.std(axis=0) + 1e-12), size / (size.std(axis=0) + 1e-12)])


def sample_weight(problem: Problem, config: "SamplerConfig", rng: np.random.Generator) -> float:
    """What a sample counts for: (1 - φ) / (1 + φ), φ the lag-1 autocorrelation of what states leave unexplained.

    An HMM takes samples as independent given their state. Where they are not (smoothed, slowly varying or oversampled
    signals), it believes each wiggle and spends states on it. The weight makes n correlated samples count for as many
    independent ones as they are worth; for independent samples it is 1. States that are not right yet leave
    correlation too, so φ is the smaller of two: around k-means' labels, and around those a chain would start from.
    """
    whole = replace(problem, weight=1.0)
    rough = cluster(whole, config.states, WINDOWS[0], rng)
    phi = min(_autocorrelation(whole, rough), _autocorrelation(whole, find_start(whole, config, 0, rng).labels))
    return 1.0 if phi < 2.0 / np.sqrt(len(rough)) else max((1.0 - phi) / (1.0 + phi), LEAST_WEIGHT)


def _autocorrelation(problem: Problem, labels: Ints) -> float:
    """Lag-1 autocorrelation of the residuals, mean over channels, from neighbours with one label."""
    residual = problem.residual(labels)
    pairs = labels[:-1] == labels[1:]
    pairs[problem.ends[:-1] - 1] = False
    if not pairs.any():
        return 0.0
    power = (residual**2).mean(axis=0) + 1e-300
    return float(np.mean((residual[:-1] * residual[1:])[pairs].mean(axis=0) / power))


def find_start(problem: Problem, config: "SamplerConfig", index: int, rng: np.random.Generator) -> Start:
    """Find where chain number `index` starts.

    k-means on the samples averaged over a window (another one in each chain) gives L labels; a few Gibbs sweeps clean
    them; states are merged while the marginal likelihood grows; twice. S0 is (ν0 - D - 1) times the covariance within
    the states found, so that the prior's mean is what is seen; ν0, which says how alike the states' covariances are,
    is the value of a grid that gives the merged labels the highest marginal likelihood.
    """
    labels = cluster(problem, config.states, WINDOWS[index % len(WINDOWS)], rng)
    prior = prior_around(problem, labels, EXTRA_DEGREES[-2])
    spent = 0
    for stage in STAGES:
        sweeps = min(stage, config.sweeps // 4)
        labels = compact(problem.run(config, prior, labels, sweeps - 1, 1, int(rng.integers(2**62)))[0][0])
        spent += sweeps
        priors = [prior_around(problem, labels, extra) for extra in EXTRA_DEGREES]
        merged = [problem.merge(config, candidate, labels) for candidate in priors]
        best = int(np.argmax([score for score, _ in merged]))
        prior, labels = priors[best], merged[best][1]
    return Start(labels, prior, spent)


def prior_around(problem: Problem, labels: Ints, extra: int) -> Prior:
    """Return the prior with ν0 = D + extra whose mean covariance is the one within the states given by `labels`."""
    return Prior(problem.within(labels) * (extra - 1.0), float(problem.dimensions + extra))
