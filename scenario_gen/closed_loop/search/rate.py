# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The rate of failures over batches of natural scenarios, with its interval."""

from collections.abc import Sequence
import math
from typing import NamedTuple

import numpy as np
from scipy import optimize, special

from scenario_gen.closed_loop.search.settings import SETTINGS
from scenario_gen.method.evaluation import wilson
from scenario_gen.numerics import Floats
from scenario_gen.types import Interval


class Batch(NamedTuple):
    """A batch of natural scenarios, or the share of it that was driven.

    Attributes:
        scenarios: number of certified scenarios.
        least: least probability that one is driven.
        expected: number of drives that was expected before it was drawn.
    """

    scenarios: float
    least: float
    expected: float


def rate_of(batches: Sequence[Batch], weights: Floats, places: Sequence[int]) -> Interval:
    """Return the mean of the batches' rates of hits, weighted by their expected drives.

    Its interval is the gamma interval of a sum of weights (Fay & Feuer 1997). The upper end allows
    for one more hit, which has at least the weight of `extra_even_ratio` evenly chosen drives, or
    a share of the rate if that is less: `extra_rate_ratio`, and more with few hits. Where every
    scenario was driven it is Wilson's.

    Args:
        batches: all batches.
        weights: (H,) number of natural scenarios of its batch that each hit represents, H >= 1.
        places: index of the batch of each hit.
    """
    scenarios, least, expected = np.array(batches).T
    if least.min() == 1.0:
        return wilson(len(weights), round(scenarios.sum()), SETTINGS.confidence)
    parts = weights * (expected / scenarios)[list(places)] / expected.sum()
    rate = float(parts.sum())
    even = float(scenarios @ least)
    share = SETTINGS.extra_rate_ratio + SETTINGS.few_hits_ratio / len(weights) ** 2
    extra = min(SETTINGS.extra_even_ratio / even, share * rate)
    largest = max(float(parts.max()), extra)
    variance = float(parts @ parts)
    half_confidence = 0.5 * SETTINGS.confidence
    low = _gamma_quantile(rate, variance, 0.5 - half_confidence)
    high = _gamma_quantile(rate + largest, variance + largest * largest, 0.5 + half_confidence)
    return Interval(min(rate, 1.0), min(low, 1.0), min(high, 1.0))


def rate_without_hits(batches: Sequence[Batch], natural_count: int) -> Interval:
    """Return the interval of a rate of 0.

    Its upper end is the rate at which no hit has a probability of 2.5 %. In a batch each of n
    scenarios is driven with a probability of e at least, which is fixed before they are drawn. So
    that probability is Π (1 - rate · e)^n at most, over the batches.

    Args:
        batches: all batches.
        natural_count: number of further natural scenarios that were driven without a choice.
    """
    count = np.array([*(batch.scenarios for batch in batches), natural_count])
    probability = np.array([*(batch.least for batch in batches), 1.0])
    log_tail = math.log(0.5 - 0.5 * SETTINGS.confidence)

    def excess(rate: float) -> float:
        return float(count @ np.log1p(-rate * probability) - log_tail)

    largest = 1.0 - 1e-12
    if excess(largest) > 0.0:
        return Interval(0.0, 0.0, 1.0)
    return Interval(0.0, 0.0, float(optimize.brentq(excess, 0.0, largest)))


def _gamma_quantile(mean: float, variance: float, share: float) -> float:
    """Return the quantile at a share of the gamma distribution with a mean and a variance."""
    return float(special.gammaincinv(mean * mean / variance, share)) * variance / mean
