# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Distributions of speed, acceleration, jerk, yaw rate and gap, and their distances."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy import special, stats

from scenario_gen.base.errors import InputError
from scenario_gen.method.evaluation.geometry import footprint_distance
from scenario_gen.numerics import Floats, Ints, running_sum
from scenario_gen.types import Motion

JERK_SMOOTHING_S = 0.5
"""Acceleration is averaged over this time before it is differentiated to jerk."""

MAX_BIN_COUNT = 20_000_000  # over all samples
MAX_SPAN_BIN_COUNT = 20_000  # of one quantity: gaps of 20 km; each bin has all resamples
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


def compare(
    quantity: Quantity, template: Floats, samples: Sequence[Floats], points: int = 513
) -> Comparison:
    """Compare the values of one quantity; bins are `quantity.bin_width` wide and aligned at zero.

    Args:
        quantity: what the values are, and in which unit.
        template: (n,) its values in the template.
        samples: its values in each sample, (n,) each, of any number.
        points: numbers of values at which the cumulative distributions are given, at most.

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

    grid = np.linspace(everything.min(), everything.max(), points)
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
        wasserstein=float(stats.wasserstein_distance(pooled, template)),
    )


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
