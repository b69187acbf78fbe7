# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The failure search on problems whose failure rate is known."""

import math

import numpy as np
import pytest
from scipy.stats import norm
from support.lengths import LONG

from scenario_gen.closed_loop.search.estimate import Search
from scenario_gen.closed_loop.search.response import Response
from scenario_gen.closed_loop.search.settings import SETTINGS
from scenario_gen.method.evaluation import wilson

DIMENSIONS = 24
SEEDS = 20 if LONG else 6
HELD = 17 if LONG else 4  # at 95 % fewer have a probability of 0.003


class Plane:
    """Fails where a weighted sum is large; candidates with a large eighth number are rejected."""

    def __init__(self, rate, allowed=math.inf):
        direction = np.zeros(DIMENSIONS)
        direction[[3, 10, 20]] = 0.6, 0.5, 0.624
        self.direction = direction / np.linalg.norm(direction)
        self.rate = rate
        self.allowed = allowed
        self.driven = []

    size = DIMENSIONS

    def candidates(self, z):
        return [row if row[7] < self.allowed else None for row in z]

    def features(self, candidate):
        return (float(candidate[0]),)

    def margin(self, row):
        return float(-norm.ppf(self.rate) - self.direction @ row)

    def drive(self, candidates):
        self.driven += [row.copy() for row in candidates]
        margins = [self.margin(row) for row in candidates]
        return [
            Response(margin, (margin,), "fails" if margin <= 0.0 else "") for margin in margins
        ]


class TwoPlanes(Plane):
    """Fails in two ways of equal probability."""

    def margins(self, row):
        return self.margin(row), float(-norm.ppf(self.rate) - row[15])

    def drive(self, candidates):
        both = [self.margins(row) for row in candidates]
        return [
            Response(
                min(pair),
                pair,
                ("first", "second")[int(np.argmin(pair))] if min(pair) <= 0.0 else "",
            )
            for pair in both
        ]


class Unforeseen(Plane):
    """Fails by a digit of a number that no regression can predict."""

    def margin(self, row):
        return -1.0 if abs(row[5]) * 1e6 % 1.0 < self.rate else 0.5 + abs(row[5])


@pytest.mark.parametrize(("rate", "budget", "most"), [(1e-2, 300, 1 / 2), (1e-3, 400, 1 / 3)])
def test_interval_holds_rate_with_fewer_drives(rate, budget, most):
    held, share = 0, []
    for seed in range(SEEDS):
        search = Search(Plane(rate, allowed=1.0), seed, budget)
        estimate = search.run()
        held += estimate.rate.low <= rate <= estimate.rate.high <= estimate.bound
        half = 0.5 * (estimate.rate.high - estimate.rate.low)
        share.append(estimate.drives * half * half / (1.96**2 * rate * (1.0 - rate)))
        assert (
            estimate.drives == len(search.z) == budget and 0.8 < estimate.valid < 0.88
        )  # norm.cdf(1) is 0.84
    assert held >= HELD
    assert np.median(share) < most


class Opposite(Plane):
    """Fails at both ends of one direction, so that a regression sees no slope."""

    def margin(self, row):
        return float(-norm.ppf(0.5 * self.rate) - abs(self.direction @ row))


class Step(Plane):
    """Fails in two regions, of which one gives no warning."""

    def margin(self, row):
        sudden = -1.0 if row[15] > norm.isf(0.5 * self.rate) else 1.0
        return min(float(-norm.ppf(0.5 * self.rate) - self.direction @ row), sudden)


@pytest.mark.parametrize("kind", [Plane, TwoPlanes, Opposite, Step, Unforeseen])
def test_rate_is_unbiased_for_any_regression(kind):
    rate, seeds = 1.2e-2, 400 if LONG else 18
    problem = kind(0.5 * rate if kind is TwoPlanes else rate)
    rates = [Search(problem, seed, 300).run().rate for seed in range(seeds)]
    held = sum(each.low <= rate <= each.high for each in rates)
    assert held >= (0.94 if LONG else 0.8) * seeds  # 14 of 18 have a probability of 0.01 at 95 %
    error = 1.5 * math.sqrt(rate / 300 / seeds)  # of the mean, 1.5 times that of plain sampling
    assert abs(np.mean([each.value for each in rates]) - rate) < 3.0 * error


def test_unpredictable_failures_mean_plain_drives():
    """Only the first exploration is lost; the interval is as wide as that of the other drives."""
    searches = [Search(Unforeseen(1.2e-2), seed, 300) for seed in range(SEEDS)]
    rates = [search.run().rate for search in searches]
    plain = 0
    for search, rate in zip(searches, rates, strict=True):
        driven = len(search.weights)
        is_plain = driven >= 230 and {*search.weights.values()} == {1.0}
        assert not is_plain or rate == wilson(round(rate.value * driven), driven, 0.95)
        plain += is_plain
    assert plain >= 0.8 * SEEDS


def test_bound_without_failure_is_nearly_plain():
    plain = 1.0 - 0.025 ** (1.0 / 300)
    for seed in range(SEEDS):
        estimate = Search(Unforeseen(0.0), seed, 300).run()
        assert plain <= estimate.rate.high <= estimate.bound <= 1.5 * plain


def test_cut_batch_counts_its_driven_share():
    """Whatever the budget, the drives of the batches stand for the scenarios that they count."""
    for budget in range(200, 216, 5):
        search = Search(Unforeseen(5e-2), 3, budget)
        estimate = search.run()
        assert estimate.drives == budget
        assert sum(search.weights.values()) == pytest.approx(estimate.seen, rel=0.15)


@pytest.mark.parametrize(("rate", "budget"), [(0.0, 200), (1e-3, 300), (5e-3, 150), (2e-2, 150)])
def test_bound_holds_unpredictable_failures(rate, budget):
    """Without a failure it comes from the evenly chosen drives."""
    estimates = [Search(Unforeseen(rate), seed, budget).run() for seed in range(SEEDS)]
    assert sum(rate <= each.bound for each in estimates) >= HELD
    highs = [each.rate.high for each in estimates if not each.first]
    assert all(high >= 1.0 - 0.025 ** (1.0 / budget) for high in highs)


def test_weights_sum_to_natural_scenarios():
    """Where every drive fails, the weights of the driven stand for all that were seen."""

    class Always(Plane):
        def margin(self, row):
            return -1.0

    search = Search(Always(1e-2), 0, 300)
    estimate = search.run()
    assert estimate.first == 1 and estimate.rate.high > 0.95 and estimate.rate.low > 0.6
    assert sum(search.weights.values()) == pytest.approx(estimate.seen, rel=0.2)
    assert max(search.weights.values()) <= 1.0 / SETTINGS.min_even_probability


def test_smaller_budget_begins_larger_one():
    small, large = Plane(1e-2), Plane(1e-2)
    Search(small, 5, 333).run()
    Search(large, 5, 480).run()
    assert len(small.driven) == 333
    assert all(np.array_equal(a, b) for a, b in zip(small.driven, large.driven[:333], strict=True))


@pytest.mark.parametrize(
    ("rate", "allowed", "budget"),
    [(1e-2, math.inf, 1), (1e-2, 0.0, 200), (1e-300, math.inf, 400), (1e-2, -math.inf, 100)],
)
def test_degenerate_searches_give_what_they_can(rate, allowed, budget):
    problem = Plane(rate, allowed)
    estimate = Search(problem, 0, budget).run()
    if allowed == -math.inf:
        assert estimate.drives == 0 and math.isnan(estimate.rate.value)
        return
    assert estimate.drives == len(problem.driven) == budget
    assert all(row[7] < allowed for row in problem.driven)
    assert 0.0 <= estimate.rate.low <= estimate.rate.high <= (0.2 if rate < 1e-9 else 1.0)
    assert estimate.first == 0 or rate > 1e-9


def test_worst_search_finds_worse_margins():
    calm, worst = Search(Plane(1e-2), 2, 300), Search(Plane(1e-2), 2, 300, worst=True)
    calm.run(), worst.run()
    assert min(one.margin for one in worst.responses) < min(one.margin for one in calm.responses)
    assert np.median([one.margin for one in worst.responses]) < np.median(
        [one.margin for one in calm.responses]
    )
