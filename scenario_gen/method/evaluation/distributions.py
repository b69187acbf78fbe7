# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Statistics of a set: distributions, their distances, and bootstrap intervals.

Every set metric is written as a function of weights (B, S) over its S samples, so that all
resamples are computed at once, mostly as one matrix product.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy import special

from scenario_gen.base.errors import InputError
from scenario_gen.method.evaluation.measures import footprint_distance
from scenario_gen.numerics import Bools, Floats, Ints, running_sum
from scenario_gen.types import Interval, Motion

JERK_SMOOTHING_S = 0.5
"""Acceleration is averaged over this time before it is differentiated to jerk."""

MAX_BIN_COUNT = 20_000_000  # over all samples
MAX_SPAN_BIN_COUNT = 20_000  # of one quantity: gaps of 20 km; each bin has all resamples
GRID_COUNT = 513  # values at which distribution functions are compared
ROUNDING_SHARE = 1e-6
"""A value that is this share of a bin below an edge counts as above it, against rounding."""


@dataclass(frozen=True)
class Quantity:
    """A quantity whose distribution is compared: id, label, unit, and width of its bins."""

    id: str
    label: str
    unit: str
    bin_width: float


QUANTITIES = (
    Quantity("speed", "speed", "m/s", 0.5),
    Quantity("acceleration", "acceleration", "m/s²", 0.25),
    Quantity("jerk", "jerk", "m/s³", 0.5),
    Quantity("yaw_rate", "yaw rate", "rad/s", 0.05),
    Quantity("gap", "gap", "m", 1.0),
)


def values_of(motion: Motion) -> dict[str, Floats]:
    """Return all values (n,) of each quantity in one motion, in the units of QUANTITIES.

    Acceleration, jerk and yaw rate are differentiated from speed and heading, for recorded and
    generated motion alike; the gap is the distance between two footprints. A motion shorter than
    the smoothing has no jerk. A vehicle counts while it is there, a gap while both are.
    """
    width = max(1, round(JERK_SMOOTHING_S / motion.dt))
    samples: dict[str, list[Floats]] = {quantity.id: [np.zeros(0)] for quantity in QUANTITIES}
    for n in range(len(motion.vehicles)):
        present = motion.present_slice(n)
        speed, heading = motion.speed[n, present], motion.heading[n, present]
        acceleration = np.gradient(speed, motion.dt)
        sums = running_sum(acceleration)
        smooth = (sums[width:] - sums[:-width]) / width
        samples["speed"].append(speed)
        samples["acceleration"].append(acceleration)
        samples["jerk"].append(np.diff(smooth) / motion.dt)
        samples["yaw_rate"].append(np.gradient(heading, motion.dt))
    for a, b in combinations(range(len(motion.vehicles)), 2):
        samples["gap"].append(footprint_distance(motion, a, b)[motion.present_slice(a, b)])
    return {name: np.concatenate(values) for name, values in samples.items()}


@dataclass(frozen=True, eq=False)
class Comparison:
    """One quantity in the template and in S samples, on common histogram bins.

    Attributes:
        template: (bins,) counts.
        samples: (S, bins) counts.
        grid: (G,) points at which distribution functions are compared.
        template_cdf: (G,) the template's distribution function there.
        sample_cdf: (S, G) values of each sample at or below each point (a count).
        sizes: (S,) number of values of each sample.
        wasserstein: distance of all samples' values taken together to the template's, exact.
    """

    template: Floats
    samples: Floats
    grid: Floats
    template_cdf: Floats
    sample_cdf: Floats
    sizes: Floats
    wasserstein: float

    def jensen_shannon(self, weights: Floats) -> Floats:
        """Return the Jensen-Shannon divergences (B,) in bits under weights (B, S), 0 to 1."""
        return jensen_shannon(weights @ self.samples, self.template)

    def wasserstein_near(self, weights: Floats) -> Floats:
        """Return Wasserstein distances (B,) under weights (B, S), integrated over the grid."""
        with np.errstate(invalid="ignore"):
            difference = weights @ self.sample_cdf[:, :-1]
            difference /= (weights @ self.sizes)[
                :, None
            ]  # in place: new arrays of this size cost more than their numbers
        difference -= self.template_cdf[:-1]
        return np.abs(difference, out=difference) @ np.diff(self.grid)

    def coverage(self, weights: Floats) -> Floats:
        """Return the share (B,) of the template's values in bins that the set visits, too."""
        with np.errstate(invalid="ignore"):
            return np.asarray(
                (((weights @ self.samples) > 0.0) @ self.template) / self.template.sum()
            )


def compare(quantity: Quantity, template: Floats, samples: Sequence[Floats]) -> Comparison:
    """Compare the values of one quantity; bins are `quantity.bin_width` wide and aligned at zero.

    Args:
        quantity: what the values are, and in which unit.
        template: (n,) its values in the template.
        samples: its values in each sample, (n,) each, of any number.

    Raises:
        InputError: the values are so different that there would be too many bins.
    """
    pooled = np.concatenate(list(samples))
    everything = np.concatenate([template, pooled])
    if template.size == 0 or pooled.size == 0:
        empty = np.zeros((len(samples), 1))
        return Comparison(
            np.zeros(1),
            empty,
            np.zeros(2),
            np.zeros(2),
            np.zeros((len(samples), 2)),
            empty[:, 0],
            float("nan"),
        )

    def bin_of(values: Floats) -> Ints:
        return np.asarray(np.floor(values / quantity.bin_width + ROUNDING_SHARE), dtype=np.int64)

    span = (everything.max() - everything.min()) / quantity.bin_width
    most = min(MAX_SPAN_BIN_COUNT, MAX_BIN_COUNT / (len(samples) + 1))
    if not span < most:
        raise InputError(
            f"{quantity.label} from {everything.min():g} to {everything.max():g} "
            f"{quantity.unit}: no vehicles move so; check the units"
        )
    first, last = (int(bin_of(np.array(bound))) for bound in (everything.min(), everything.max()))

    def counts(values: Floats) -> Floats:
        return np.asarray(
            np.bincount(bin_of(values) - first, minlength=last - first + 1), dtype=np.float64
        )

    grid = np.linspace(everything.min(), everything.max(), GRID_COUNT)
    middle = 0.5 * (
        grid[1:] + grid[:-1]
    )  # the distribution function of an interval is taken in its middle

    def below(values: Floats) -> Floats:
        return np.append(
            np.searchsorted(np.sort(values), middle, side="right"), values.size
        ).astype(np.float64)

    return Comparison(
        template=counts(template),
        samples=np.stack([counts(values) for values in samples]),
        grid=grid,
        template_cdf=below(template) / template.size,
        sample_cdf=np.stack([below(values) for values in samples]),
        sizes=np.array([values.size for values in samples], dtype=np.float64),
        wasserstein=_wasserstein(pooled, template),
    )


def _wasserstein(values: Floats, others: Floats) -> float:
    """Return the area between two empirical distribution functions.

    `scipy.stats` has it, too, but takes long to load.
    """
    ordered = np.sort(np.concatenate((values, others)))
    shares = [
        np.sort(each).searchsorted(ordered[:-1], "right") / each.size for each in (values, others)
    ]
    return float(np.abs(shares[0] - shares[1]) @ np.diff(ordered))


def jensen_shannon(p: Floats, q: Floats) -> Floats:
    """Return the Jensen-Shannon divergence in bits of histograms p (..., bins) and q (bins,).

    Source: Lin 1991, with logarithms of base 2.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        p = p / p.sum(axis=-1, keepdims=True)
        q = q / q.sum()
        middle = 0.5 * (p + q)
        result = (
            0.5
            * (special.rel_entr(p, middle) + special.rel_entr(q, middle)).sum(axis=-1)
            / np.log(2.0)
        )
    return np.where(np.isfinite(p.sum(axis=-1)), np.maximum(result, 0.0), np.nan)


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
            unit: (S,) samples with the same number depend on each other and are drawn together;
                S >= 1.
            resamples: B.
            level: confidence level.
            seed: of the draws.
        """
        units, member = np.unique(unit, return_inverse=True)
        generator = np.random.Generator(
            np.random.PCG64(np.random.SeedSequence([seed, len(unit), resamples]))
        )
        drawn = generator.integers(len(units), size=(resamples, len(units)))
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
        if self.unit.max() < 1 or not np.isfinite(value):
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
