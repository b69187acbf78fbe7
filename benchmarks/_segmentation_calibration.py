# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Are the posterior's probabilities right? Sequences from the model's own prior, segmented with the defaults."""

from dataclasses import dataclass

import numpy as np

from scenario_gen.method.segmentation import Posterior, SamplerConfig, segment_series
from scenario_gen.numerics.arrays import Floats, Ints


@dataclass(frozen=True)
class Calibration:
    """What came out of many sequences.

    Attributes:
        predicted: (10,) mean p_w in each decile 0-0.1 .. 0.9-1 (nan where no sample falls).
        observed: (10,) how often there was a changepoint.
        counts: (10,) independent samples (one every 2 w) in each.
        coverage: how often the 5-95 % interval holds the true changepoint nearest to an estimated one.
        intervals: how many of those.
    """

    predicted: Floats
    observed: Floats
    counts: Ints
    coverage: float
    intervals: int

    @property
    def table(self) -> str:
        """Every decile in words."""
        rows = zip(self.predicted, self.observed, self.counts, strict=True)
        return "predicted: observed (n) " + ", ".join(
            f"{p:.2f}: {o:.2f} ({n})" for p, o, n in rows
        )

    @property
    def worst(self) -> float:
        """Largest distance of predicted and observed in a decile with at least 30 samples."""
        enough = self.counts >= 30
        return (
            float(np.abs(self.predicted - self.observed)[enough].max())
            if enough.any()
            else float("nan")
        )


def deciles(predicted: Floats, truth: Floats) -> tuple[Floats, Floats, Ints]:
    """Mean prediction, how often it came true, and how many, (10,) each, by decile of the prediction."""
    decile = np.minimum((predicted * 10.0).astype(np.int64), 9)
    counts = np.bincount(decile, minlength=10)
    with np.errstate(invalid="ignore"):
        return (
            np.bincount(decile, predicted, 10) / counts,
            np.bincount(decile, truth, 10) / counts,
            counts,
        )


def near(changepoints: Ints, samples: int, radius: int) -> Floats:
    """(T,) 1 where a changepoint lies within `radius` samples."""
    result = np.zeros(samples)
    for c in changepoints:
        result[max(c - radius, 0) : c + radius + 1] = 1.0
    return result


def from_prior(
    rng: np.random.Generator, samples: int, d: int, config: SamplerConfig
) -> tuple[Floats, Ints]:
    """Draw a series (T, D) and its labels from the sticky HDP-HMM's prior, covariances Inverse-Wishart(D + 10, 9 I)."""
    states = config.states or 20
    gamma = rng.gamma(config.gamma_shape) / config.gamma_rate
    total = rng.gamma(config.alpha_kappa_shape) / config.alpha_kappa_rate
    rho = rng.beta(config.rho_a, config.rho_b)
    beta = np.maximum(rng.dirichlet(np.full(states, gamma / states)), 1e-12)
    rows = np.maximum((1.0 - rho) * total * beta + rho * total * np.eye(states), 1e-9)
    pi = np.array([rng.dirichlet(row) for row in rows])
    labels = np.empty(samples, np.int64)
    labels[0] = rng.choice(states, p=rng.dirichlet(np.maximum((1.0 - rho) * total * beta, 1e-9)))
    for t in range(1, samples):
        labels[t] = rng.choice(states, p=pi[labels[t - 1]])
    x = np.empty((samples, d))
    for k in np.unique(labels):
        root = 3.0 * np.linalg.inv(np.linalg.cholesky(_wishart(rng, d + 10, d))).T
        mean = root @ rng.normal(size=d) / np.sqrt(config.mean_weight)
        chosen = labels == k
        x[chosen] = mean + rng.normal(size=(int(chosen.sum()), d)) @ root.T
    return x, labels


def _wishart(rng: np.random.Generator, freedom: int, d: int) -> Floats:
    """Draw from Wishart(freedom, I)."""
    g = rng.normal(size=(freedom, d))
    return np.asarray(g.T @ g)


def calibrate(seeds: range, samples: int = 200, d: int = 2, radius: int = 5) -> Calibration:
    """Segment one sequence per seed and compare probabilities with what is true."""
    config = SamplerConfig()
    predicted: list[Floats] = []
    truth: list[Floats] = []
    inside: list[bool] = []
    for seed in seeds:
        rng = np.random.default_rng([seed, 77])
        x, labels = from_prior(rng, samples, d, config)
        posterior = segment_series(x, config, seed)
        real = np.flatnonzero(np.diff(labels)) + 1
        apart = slice(int(rng.integers(2 * radius)), None, 2 * radius)
        predicted.append(posterior.probability_within(radius)[apart])
        truth.append(near(real, samples, radius)[apart])
        inside += _covered(posterior, real, rng)
    return Calibration(
        *deciles(np.concatenate(predicted), np.concatenate(truth)),
        float(np.mean(inside)),
        len(inside),
    )


def _covered(posterior: Posterior, real: Ints, rng: np.random.Generator) -> list[bool]:
    """For each estimated changepoint: does the true one nearest to it lie in the 5-95 % interval (rank randomised in ties)?"""
    result = []
    for centre in posterior.changepoints if len(real) else []:
        nearest = []
        for row in posterior.samples:
            sampled = np.flatnonzero(np.diff(row)) + 1
            if len(sampled):
                nearest.append(sampled[np.argmin(np.abs(sampled - centre))])
        true = real[np.argmin(np.abs(real - centre))]
        drawn = np.array(nearest)
        rank = (drawn < true).mean() + rng.uniform() * (drawn == true).mean()
        result.append(bool(0.05 <= rank <= 0.95))
    return result
