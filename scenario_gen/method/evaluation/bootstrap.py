# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Confidence intervals by the bootstrap: samples are drawn again with replacement, as weights.

Every set metric is written as a function of weights (B, S) over its S samples, so that all
resamples are computed at once, mostly as one matrix product.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import special

from scenario_gen.numerics import Bools, Floats, Ints
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
        generator = np.random.Generator(
            np.random.PCG64(np.random.SeedSequence([seed, len(unit), resamples]))
        )
        drawn = (
            generator.integers(len(units), size=(resamples, len(units)))
            if len(units)
            else np.zeros((resamples, 0), np.int64)
        )
        times = np.zeros((resamples, len(units)))
        np.add.at(times, (np.arange(resamples)[:, None], drawn), 1.0)
        return cls(times[:, member], level, member)

    def of_units(self) -> "Bootstrap":
        """Return the same draws for samples that are pooled by unit."""
        units, first = np.unique(self.unit, return_index=True)
        return Bootstrap(self.weights[:, first], self.level, units)

    def interval(self, statistic: Statistic) -> Interval:
        """Return the statistic with percentile bounds that include it (Efron 1979).

        Distances such as E cannot fall below zero, and resampling raises them. Correcting for that
        bias makes intervals too short near zero, so it is left in.

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
        return np.asarray((weights[:, known] @ values[known]) / total)


def wilson(count: int, total: int, level: float) -> Interval:
    """Return the share count / total with Wilson's interval (1927), which stays in [0, 1]."""
    if total == 0:
        return Interval(float("nan"))
    return _wilson(count / total, total, float(special.ndtri(0.5 + 0.5 * level)))


def clustered_wilson(
    hits: Bools, unit: Ints, level: float, weight: Floats | None = None
) -> Interval:
    """Return the share of hits (S,) with Wilson's interval for samples that depend within units.

    With weights (S,) the share is weighted, and a single unit has Kish's number of samples.

    The number of samples is divided by the design effect: the variance between the totals of units
    over that of independent samples, at least 1. The quantile is Student's with a degree of
    freedom for each unit but one. Where nothing or everything is a hit, no sample tells how much
    those of a unit are alike, and each unit counts as one sample.
    Source: Korn & Graubard 1998; for Wilson's interval, Franco, Little, Louis & Slud 2019.
    """
    count, total = int(np.count_nonzero(hits)), len(hits)
    if not total:
        return wilson(0, 0, level)
    _, member = np.unique(unit, return_inverse=True)
    units = int(member.max()) + 1
    weight = np.ones(total) if weight is None else weight * total / weight.sum()
    share = float(weight @ hits) / total
    if units < 2 or count in (0, total):
        independent = float(units) if units > 1 else total * total / float(weight @ weight)
        return _wilson(share, independent, float(special.ndtri(0.5 + 0.5 * level)))
    excess = np.bincount(member, weights=weight * (hits - share))
    between = float(np.sum(excess * excess)) * units / (units - 1)
    effect = max(between / (total * share * (1.0 - share)), 1.0)
    return _wilson(share, total / effect, float(special.stdtrit(units - 1, 0.5 + 0.5 * level)))


def paired_difference(differences: Floats, unit: Ints, level: float) -> Interval:
    """Return the mean of paired differences (S,) of -1, 0 or 1, with an interval for units.

    Its variance is that between the totals of units (S,), its quantile Student's with a degree of
    freedom for each unit but one. Where no pair differs the bounds are those of a share of 0 among
    as many units.
    Source: Liang & Zeger 1986, for one mean.
    """
    _, member = np.unique(unit, return_inverse=True)
    units, total = int(member.max(initial=-1)) + 1, len(differences)
    if units < 2:
        return Interval(float(np.sum(differences)) / total if total else float("nan"), -1.0, 1.0)
    mean = float(np.sum(differences)) / total
    if not differences.any():
        high = _wilson(0.0, float(units), float(special.ndtri(0.5 + 0.5 * level))).high
        return Interval(0.0, -high, high)
    excess = np.bincount(member, weights=differences - mean)
    half = (
        float(special.stdtrit(units - 1, 0.5 + 0.5 * level))
        * float(np.sqrt(np.sum(excess * excess) * units / (units - 1)))
        / total
    )
    return Interval(mean, max(mean - half, -1.0), min(mean + half, 1.0))


def _wilson(share: float, total: float, z: float) -> Interval:
    centre = (share + z * z / (2 * total)) / (1 + z * z / total)
    half = (
        z
        / (1 + z * z / total)
        * float(np.sqrt(share * (1 - share) / total + z * z / (4 * total * total)))
    )
    return Interval(share, max(0.0, centre - half), min(1.0, centre + half))
