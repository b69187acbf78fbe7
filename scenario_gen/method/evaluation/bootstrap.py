# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Confidence intervals by the bootstrap: samples are drawn again with replacement, as weights.

Every set metric is written as a function of weights (B, S) over its S samples, so that all resamples are computed at
once, mostly as one matrix product.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from scenario_gen.numerics import exact, Floats, Ints
from scenario_gen.types import Interval

Statistic = Callable[[Floats], Floats]


@dataclass(frozen=True, eq=False)
class Bootstrap:
    """Resampling weights for sets of S samples.

    Attributes:
        weights: (B, S) how often each sample was drawn in each resample.
        level: confidence level.
        unit: (S,) the number, from 0, of the group of each sample; groups are independent.
    """

    weights: Floats
    level: float
    unit: Ints

    @classmethod
    def draw(cls, unit: Ints, resamples: int, level: float, seed: int) -> "Bootstrap":
        """Draw the weights; the same seed gives the same weights.

        Args:
            unit: (S,) samples with the same number depend on each other and are drawn together.
            resamples: B.
            level: confidence level.
            seed: of the draws.
        """
        units, member = np.unique(unit, return_inverse=True)
        generator = np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, len(unit), resamples])))
        drawn = generator.integers(len(units), size=(resamples, len(units))) if len(units) else np.zeros((resamples, 0), np.int64)
        times = np.zeros((resamples, len(units)))
        np.add.at(times, (np.arange(resamples)[:, None], drawn), 1.0)
        return cls(times[:, member], level, member)

    def of_units(self) -> "Bootstrap":
        """Return the same draws for samples that are pooled by unit: what all of a unit enter alike is computed once for each."""
        units, first = np.unique(self.unit, return_index=True)
        return Bootstrap(self.weights[:, first], self.level, units)

    def interval(self, statistic: Statistic) -> Interval:
        """Return the statistic of the whole set with its percentile bounds (Efron 1979), widened to hold the value.

        Distances such as E cannot fall below zero, and resampling raises them. Correcting for that bias makes intervals too
        short near zero (docs/evaluation.md has the figures), so it is left in.

        Args:
            statistic: maps weights (B, S) to values (B,); NaN where a resample has no value.
        """
        samples = self.weights.shape[1]
        value = float(statistic(np.ones((1, samples)))[0])
        if not self.unit.size or self.unit.max() < 1 or not np.isfinite(value):
            return Interval(value)
        values = statistic(self.weights)
        values = values[np.isfinite(values)]
        if values.size < 2:
            return Interval(value)
        tail = 0.5 * (1.0 - self.level)
        low, high = np.quantile(values, [tail, 1.0 - tail])
        return Interval(value, min(value, float(low)), max(value, float(high)))

    def mean(self, values: Floats) -> Interval:
        """Return the mean of one value per sample (S,), leaving out NaN, with its interval."""
        return self.interval(lambda weights: mean_of(values, weights))


def mean_of(values: Floats, weights: Floats) -> Floats:
    """Return the weighted means (B,) of values (S,) under weights (B, S), leaving out NaN."""
    known = np.isfinite(values)
    total = weights[:, known].sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(exact.matmul(weights[:, known], values[known]) / total)


def wilson(count: int, total: int, level: float) -> Interval:
    """Return the share count / total with Wilson's interval (1927), which stays in [0, 1] and is not empty at 0 or 1."""
    if total == 0:
        return Interval(float("nan"))
    z = float(exact.ndtri(0.5 + 0.5 * level))
    share = count / total
    centre = (share + z * z / (2 * total)) / (1 + z * z / total)
    half = z / (1 + z * z / total) * float(np.sqrt(share * (1 - share) / total + z * z / (4 * total * total)))
    return Interval(share, max(0.0, centre - half), min(1.0, centre + half))
