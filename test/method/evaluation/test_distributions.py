# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Intervals of shares and differences against closed forms."""

import numpy as np
import pytest
from scipy.stats import norm, t

from scenario_gen.method.evaluation.distributions import clustered_wilson, paired_difference


def wilson_half(share, n, z):
    """Half the width of Wilson's interval."""
    return z / (1.0 + z * z / n) * np.sqrt(share * (1.0 - share) / n + z * z / (4.0 * n * n))


def test_alike_samples_count_as_one():
    """Six units of ten samples that are all alike: the design effect is that of the units."""
    hits = np.repeat([True, True, False, True, False, False], 10)
    unit = np.repeat(np.arange(6), 10)
    found = clustered_wilson(hits, unit, 0.95)
    effect = 6.0 * (6 * 5.0**2) / 5.0 / (60 * 0.25)
    half = wilson_half(0.5, 60 / effect, t.ppf(0.975, 5))
    assert (found.high - found.low) / 2.0 == pytest.approx(half)


def test_independent_samples_have_no_effect():
    """Units that each have half of the hits vary less than independent ones: the effect is 1."""
    found = clustered_wilson(np.tile([True, False], 20), np.repeat(np.arange(20), 2), 0.95)
    half = wilson_half(0.5, 40, t.ppf(0.975, 19))
    assert (found.high - found.low) / 2.0 == pytest.approx(half)


def test_equal_pairs_leave_wilson_bounds():
    """No pair of 12 units differs: the bounds are those of 0 of 12."""
    found = paired_difference(np.zeros(24), np.repeat(np.arange(12), 2), 0.95)
    square = norm.ppf(0.975) ** 2
    assert found.high == pytest.approx(square / (12 + square)) and found.low == -found.high
