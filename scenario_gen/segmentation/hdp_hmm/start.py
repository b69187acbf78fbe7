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

"""Where a chain starts: k-means over windows of the series."""

from dataclasses import dataclass, replace

import numpy as np

from scenario_gen import exact
from scenario_gen.arrays import Floats, Ints
from scenario_gen.kernels import F2, I, kernel, OUT2, OUTI1
from scenario_gen.segmentation.hdp_hmm.config import SamplerConfig
from scenario_gen.segmentation.hdp_hmm.problem import compact, moving_mean, Prior, Problem
from scenario_gen.segmentation.hdp_hmm.random import State, uniform


@kernel(inline=True)
def distances(x: Floats, centres: Floats, used: int, out: Floats) -> None:
    """Fill out[:used] with squared distances from x (D,) to centres (D, K)."""
    for k in range(used):
        out[k] = 0.0
    for i in range(len(x)):
        c = x[i]
        row = centres[i]
        for k in range(used):
            out[k] += (c - row[k]) ** 2


@kernel(inline=True)
def spread_centres(state: State, x: Floats, centres: Floats) -> None:
    """Fill centres (D, K) with samples of x (T, D), each drawn by its squared distance to those before (k-means++)."""
    samples, d = x.shape
    far = np.full(samples, np.inf)
    for k in range(centres.shape[1]):
        chosen = int(uniform(state) * samples)
        if k > 0:
            total = 0.0
            for t in range(samples):
                total += far[t]
            left = uniform(state) * total
            chosen = 0
            while chosen < samples - 1 and left > far[chosen]:
                left -= far[chosen]
                chosen += 1
        for t in range(samples):
            square = 0.0
            for i in range(d):
                square += (x[t, i] - x[chosen, i]) ** 2
            far[t] = min(far[t], square)
        for i in range(d):
            centres[i, k] = x[chosen, i]


@kernel(F2, I, I, OUT2, OUTI1)
def kmeans(x: Floats, seed: int, rounds: int, centres: Floats, labels: Ints) -> None:
    """k-means with the starts of k-means++ (Arthur & Vassilvitskii 2007).

    Args:
        x: (T, D).
        seed: any integer.
        rounds: of assigning and averaging.
        centres: (D, K) output; where a cluster runs empty its centre stays.
        labels: (T,) output.
    """
    samples, d = x.shape
    states = centres.shape[1]
    state: State = np.empty(1, np.uint64)
    state[0] = np.uint64(seed)
    spread_centres(state, x, centres)
    near = np.empty(states)
    counts = np.empty(states)
    sums = np.empty((d, states))
    for _ in range(rounds):
        counts[:] = 0.0
        sums[:] = 0.0
        for t in range(samples):
            distances(x[t], centres, states, near)
            best = 0
            for k in range(1, states):
                if near[k] < near[best]:
                    best = k
            labels[t] = best
            counts[best] += 1.0
            for i in range(d):
                sums[i, best] += x[t, i]
        for k in range(states):
            if counts[k] > 0.0:
                for i in range(d):
                    centres[i, k] = sums[i, k] / counts[k]


WINDOWS = (9, 15, 5, 25)
EXTRA_DEGREES = (3, 10, 20, 50, 100)
STAGES = (20, 15)
LEAST_WEIGHT = 0.02
KMEANS_ROUNDS = 10
GUESS_COUNTS = 6
MOST_MEAN_WEIGHT = 3.0


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
    smooth = np.ascontiguousarray(moving_mean(signals, window))
    centres = np.empty((smooth.shape[1], min(states, max(2, len(smooth) // 4))))
    labels = np.empty(len(smooth), np.int64)
    kmeans(smooth, int(rng.integers(2**62)), KMEANS_ROUNDS, centres, labels)
    return compact(labels)


def _dynamics(problem: Problem) -> Floats:
    """What distinguishes autoregressive states, per row: sample, step and size of the step."""
    y = problem.y
    step = y - problem.v[:, 1 : 1 + problem.dimensions]
    size = np.abs(step)
    return np.hstack([y, step / (step.std(axis=0) + 1e-12), size / (size.std(axis=0) + 1e-12)])


def sample_weight(problem: Problem, config: SamplerConfig, rng: np.random.Generator) -> tuple[float, Start]:
    """What a sample counts for: (1 - φ) / (1 + φ), φ the lag-1 autocorrelation of what states leave unexplained.

    An HMM takes samples as independent given their state. Where they are not (smoothed, slowly varying or oversampled
    signals), it believes each wiggle and spends states on it. The weight makes n correlated samples count for as many
    independent ones as they are worth; for independent samples it is 1. States that are not right yet leave
    correlation too, so φ is the smaller of two: around k-means' labels, and around those a chain would start from.

    Returns:
        The weight, and the start found on the way, which holds for the weight 1.
    """
    whole = replace(problem, weight=1.0)
    rough = cluster(whole, config.states, WINDOWS[0], rng)
    start = find_start(whole, config, 0, rng)
    phi = min(_autocorrelation(whole, rough), _autocorrelation(whole, start.labels))
    return 1.0 if phi < 2.0 / np.sqrt(len(rough)) else max((1.0 - phi) / (1.0 + phi), LEAST_WEIGHT), start


def _autocorrelation(problem: Problem, labels: Ints) -> float:
    """Lag-1 autocorrelation of the residuals, mean over channels, from neighbours with one label."""
    residual = problem.unexplained(labels)[0]
    pairs = labels[:-1] == labels[1:]
    pairs[problem.ends[:-1] - 1] = False
    if not pairs.any():
        return 0.0
    power = np.square(residual).mean(axis=0) + 1e-300
    return float(np.mean((residual[:-1] * residual[1:])[pairs].mean(axis=0) / power))


def find_start(problem: Problem, config: SamplerConfig, index: int, rng: np.random.Generator) -> Start:
    """Find where chain number `index` starts.

    k-means on the samples averaged over a window (another one in each chain) gives L labels; a few Gibbs sweeps clean
    them; states are merged while the marginal likelihood grows; twice. S0 is (ν0 - D - 1) times the covariance within
    the states found, so that the prior's mean is what is seen; κ0 see `mean_precision`; ν0, which says how alike the
    states' covariances are, is the value of a grid that gives the merged labels the highest marginal likelihood.
    """
    labels = cluster(problem, config.states, WINDOWS[index % len(WINDOWS)], rng)
    prior = priors_around(problem, labels)[-2]
    spent = 0
    for stage in STAGES:
        sweeps = min(stage, config.sweeps // 4)
        labels = compact(problem.run(config, prior, labels, sweeps - 1, 1, int(rng.integers(2**62)))[0][0])
        spent += sweeps
        priors = priors_around(problem, labels)
        merged = [problem.merge(config, candidate, labels) for candidate in priors]
        best = int(np.argmax([score for score, _ in merged]))
        prior, labels = priors[best], merged[best][1]
    return Start(labels, prior, spent)


def priors_around(problem: Problem, labels: Ints) -> list[Prior]:
    """Return the priors with ν0 = D + each of EXTRA_DEGREES whose mean covariance is that within the states of labels (T',)."""
    within = problem.within(labels)
    precision = mean_precision(problem, labels, within)
    return [Prior(within * (extra - 1.0), float(problem.dimensions + extra), precision) for extra in EXTRA_DEGREES]


def mean_precision(problem: Problem, labels: Ints, within: Floats) -> Floats:
    """(P, P) prior K; for Gaussian states κ0, which says how far apart their means are beside their own spread.

    With a κ0 far too small, states that differ little do not pay for a mean of their own and are merged. What the given
    states' means say, 1 / κ0 = mean squared Mahalanobis length per channel, counts for the (K - 1) D numbers they are;
    the configured guess for GUESS_COUNTS; averaged on the scale of logarithms.
    """
    counts = np.bincount(labels)
    states = len(counts)
    if problem.regressors > 1 or states < 2:
        return problem.precision
    means = np.array([np.bincount(labels, y) for y in problem.y.T]) / counts
    lengths = (means * exact.solve_positive(within, means)).sum(axis=0) / problem.dimensions
    seen = float((lengths * counts).sum()) / len(labels) * states / (states - 1) - states / len(labels)
    guess = float(problem.precision[0, 0])
    most = max(MOST_MEAN_WEIGHT, guess)
    said = min(max(1.0 / max(seen, 1.0 / most), guess), most)
    share = (states - 1) * problem.dimensions
    return np.eye(1) * exact.exp((GUESS_COUNTS * exact.log(guess) + share * exact.log(said)) / (GUESS_COUNTS + share))
