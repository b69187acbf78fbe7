# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The failure rate of a planner, and the scenarios in which it fails.

A drive is expensive and a certified scenario is cheap, so most scenarios are not driven. Two steps
alternate. A search with a larger budget begins with the drives of a smaller one.

- Exploration: small runs of subset simulation (Au & Beck 2001) with preconditioned Crank-Nicolson
  moves (Cotter et al. 2013). Of many moves only the one is driven that a regression predicts to be
  the nearest to failure. Each run starts anew, so that the first failure is found early, and so
  are different failures.
- Estimation: two-phase sampling (Neyman 1938). Natural scenarios are drawn; the probability that
  one is driven increases with its predicted nearness to failure, and it counts by the inverse of
  that probability (Horvitz & Thompson 1952). The least probability follows from the failures that
  the regression did not expect (Neyman's allocation): a regression that misses failures leads to
  plain sampling. The rate is the mean of the batches' rates, weighted by the number of drives that
  was expected of each before it was drawn. So it is unbiased whatever the quality of the
  regression. The drives of a batch are in random order: a batch that the budget cuts short counts
  with the share that was driven.

Where the moves of an exploration neither lead nearer to failure nor find two, nothing foretells
it: the run is cut, hardly anything is explored, and every natural scenario is driven (plain
sampling).
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
import math
from typing import Any, NamedTuple

import numpy as np
from scipy import special

from scenario_gen.closed_loop.search.rate import Batch, rate_of, rate_without_hits
from scenario_gen.closed_loop.search.response import Problem, Response
from scenario_gen.closed_loop.search.settings import SETTINGS
from scenario_gen.closed_loop.search.surrogate import Surrogate
from scenario_gen.method.evaluation import wilson
from scenario_gen.numerics import Floats
from scenario_gen.types import Interval


@dataclass(frozen=True, eq=False)
class Estimate:
    """The result of a search.

    Attributes:
        rate: share of certified natural scenarios in which the planner fails, with its interval.
        plain: failures and drives of the natural scenarios that the exploration drove.
        drives: number of drives.
        first: number of the first failed drive, counted from 1; 0 if none failed.
        seen: number of certified natural scenarios behind the rate, driven or not.
        valid: share of the natural candidates that are certified.
        unexpected: upper bound (95 %) of the rate of failures that the regression does not expect.
        shares: of the rate, by kind of failure.
        events: rates of the events of the responses, by name, with their intervals.
    """

    rate: Interval
    plain: tuple[int, int]
    drives: int
    first: int
    seen: int
    valid: float
    unexpected: float
    shares: dict[str, float]
    events: dict[str, Interval]

    @property
    def bound(self) -> float:
        """Upper bound (95 %) of the rate, whatever the quality of the regression."""
        return max(self.rate.high, self.unexpected) if self.unexpected >= 0.0 else self.rate.high


class _SpentError(Exception):
    """The budget is spent."""


class _Drawn(NamedTuple):
    """A certified scenario with its numbers (d,) and its features."""

    z: Floats
    candidate: Any
    features: tuple[float, ...]


@dataclass(eq=False)
class Search:
    """One search; `run` fills it.

    Attributes:
        problem: the planner among the candidates.
        seed: of all random numbers.
        budget: largest number of drives.
        worst: search for the worst failures only, and estimate no rate.
        z: (d,) numbers of each drive.
        responses: of each drive.
        weights: number of natural scenarios that a drive represents in the rate, by drive.
        event_names: events whose rates are estimated.
    """

    problem: Problem  # type: ignore[type-arg]
    seed: int
    budget: int
    worst: bool = False
    z: list[Floats] = field(default_factory=list)
    responses: list[Response] = field(default_factory=list)
    weights: dict[int, float] = field(default_factory=dict)
    event_names: Sequence[str] = ()

    # Features of each drive.
    _features: list[tuple[float, ...]] = field(default_factory=list)
    # Drives of natural scenarios: those without any choice, those of the batches, and those of the
    # latter that were chosen evenly, because no failure was expected.
    _natural: list[int] = field(default_factory=list)
    _even: list[int] = field(default_factory=list)
    _batches: list[Batch] = field(default_factory=list)
    _batch_of: dict[int, int] = field(default_factory=dict)
    _batch_count: int = 0
    _nearness: Floats = field(default_factory=lambda: np.zeros(1))  # (S,) of the last batch
    _run_count: int = 0
    _drawn: int = 0  # natural candidates
    _certified: int = 0  # of these
    _explored: int = 0  # drives of the exploration
    _traced: bool = True  # the last exploration led nearer to failure
    # The last regression, and the number of drives that it was fitted to.
    _regression: "tuple[int, _Predictor] | None" = None

    def run(self) -> Estimate:
        """Search until the budget is spent, or no candidate can be certified."""
        try:
            while self._explores() or self._estimate():
                if self._explores() and not self._explore():
                    break
        except _SpentError:
            pass
        return self._result()

    def _explores(self) -> bool:
        """Return whether the next step is an exploration."""
        share = SETTINGS.explored_share if self._traced else SETTINGS.untraced_share
        return self.worst or self._explored <= share * len(self.z)

    def _generator(self, *key: int) -> np.random.Generator:
        return np.random.Generator(np.random.PCG64(np.random.SeedSequence([self.seed, 7, *key])))

    def _drive(self, drawn: Sequence[_Drawn]) -> list[int]:
        """Drive in certified scenarios within the budget; return the numbers of the drives."""
        first = len(self.z)
        driven = drawn[: self.budget - first]
        self.responses += self.problem.drive([scenario.candidate for scenario in driven])
        self.z += [scenario.z for scenario in driven]
        self._features += [scenario.features for scenario in driven]
        return list(range(first, len(self.z)))

    def _check_budget(self) -> None:
        if len(self.z) >= self.budget:
            raise _SpentError

    def _certify(self, z: Floats) -> list[_Drawn]:
        """Return the certified scenarios among the candidates of numbers (S, d)."""
        return [
            _Drawn(numbers, candidate, self.problem.features(candidate))
            for numbers, candidate in zip(z, self.problem.candidates(z), strict=True)
            if candidate is not None
        ]

    def _draw(self, generator: np.random.Generator) -> list[_Drawn]:
        """Return the certified scenarios of a batch of natural candidates."""
        drawn = self._certify(generator.standard_normal((SETTINGS.batch, self.problem.size)))
        self._drawn += SETTINGS.batch
        self._certified += len(drawn)
        return drawn

    def _explore(self) -> bool:
        """Run one subset simulation towards any failure, or towards that of one part.

        Return False if no candidate can be certified.
        """
        before = len(self.z)
        generator = self._generator(1, self._run_count)
        try:
            population = self._natural_drives(generator, self._population_size())
            if not population:
                return False
            target = self._run_count % (1 + len(self.responses[0].parts))
            self._simulate(generator, population, target)
        finally:
            self._run_count += 1
            self._explored += len(self.z) - before
        return True

    def _population_size(self) -> int:
        """Return the number of drives of a level: a multiple of the members per seed."""
        members = SETTINGS.members_per_seed
        grown = len(self.z) // SETTINGS.drives_per_member // members * members
        return min(max(SETTINGS.min_population, grown), SETTINGS.max_population)

    def _simulate(
        self, generator: np.random.Generator, population: list[int], target: int
    ) -> None:
        """Run the levels of a subset simulation from a population of natural drives."""
        allowed = max(SETTINGS.first_explored, SETTINGS.explored_share * len(self.z))
        last = len(self.z) - len(population) + allowed  # number of drives at which it is cut
        seed_count = len(population) // SETTINGS.members_per_seed
        step = SETTINGS.first_step
        self._traced, first = True, len(self.z)
        for _ in range(SETTINGS.max_levels):
            order = sorted(population, key=lambda k: (self._distance(k, target), k))
            seeds = order[:seed_count]
            threshold = self._distance(seeds[-1], target)
            if threshold >= self._distance(order[-1], target):
                break
            goal = threshold if self.worst else max(threshold, 0.0)
            population, share = self._chains(generator, seeds, (target, goal), step)
            step *= math.exp(share - SETTINGS.accepted_share)
            step = min(max(step, 0.05), 1.0)
            if self.worst:
                continue
            failures = self._failure_count(range(first, len(self.z)))
            is_found = goal <= 0.0 or failures >= SETTINGS.traced_failures
            self._traced = is_found or share >= SETTINGS.traced_share
            if threshold <= 0.0 or len(self.z) >= last or not self._traced:
                break

    def _distance(self, k: int, target: int) -> float:
        """Return the margin of a drive, or one of its parts, counted from 1."""
        response = self.responses[k]
        return response.margin if target == 0 else response.parts[target - 1]

    def _natural_drives(self, generator: np.random.Generator, count: int) -> list[int]:
        """Drive in `count` natural scenarios; return none if a whole batch is rejected."""
        drives: list[int] = []
        while len(drives) < count:
            drawn = self._draw(generator)
            if not drawn:
                return []
            new = self._drive(drawn[: count - len(drives)])
            self._natural += new
            drives += new
            self._check_budget()
        return drives

    def _chains(
        self,
        generator: np.random.Generator,
        seeds: list[int],
        goal: tuple[int, float],
        step: float,
    ) -> tuple[list[int], float]:
        """Return the population of the next level, and the accepted share of the moves.

        Each seed starts a chain that stays below a threshold of a target, the goal.
        """
        target, threshold = goal
        population = list(seeds)
        heads = list(seeds)
        accepted = 0
        rounds = SETTINGS.members_per_seed - 1
        for _ in range(rounds):
            moves = self._best_moves(generator, heads, target, step)
            for place, k in zip(moves, self._drive(list(moves.values())), strict=False):
                if self._distance(k, target) <= threshold:
                    heads[place] = k
                    accepted += 1
            self._check_budget()
            population += heads
        return population, accepted / (len(seeds) * rounds)

    def _best_moves(
        self, generator: np.random.Generator, heads: list[int], target: int, step: float
    ) -> dict[int, _Drawn]:
        """Return the move of each chain that is predicted to be nearest to failure, by place.

        A chain without a certified move is left out.
        """
        predict = self._predictor()
        best: dict[int, _Drawn] = {}
        for place, head in enumerate(heads):
            noise = generator.standard_normal((SETTINGS.moves, self.problem.size))
            drawn = self._certify(math.sqrt(1.0 - step * step) * self.z[head] + step * noise)
            if drawn:
                predicted = predict(drawn)[0]
                distance = predicted[:, target - 1] if target else predicted.min(axis=1)
                best[place] = drawn[np.argmin(distance)]
        return best

    def _predictor(self) -> "_Predictor":
        """Return a regression of the parts of the drives so far."""
        if self._regression is not None:
            fitted, predictor = self._regression
            if len(self.z) < SETTINGS.refit_ratio * fitted:
                return predictor
        columns = np.column_stack([self.z, self._features])
        figures = np.array([response.parts or (response.margin,) for response in self.responses])
        failed = np.array([response.failed for response in self.responses])
        natural = np.isin(np.arange(len(failed)), [*self._natural, *self._batch_of])
        for part in figures.T:  # a failure is a failure of its least part
            part[failed & (part == figures.min(axis=1))] = -math.inf
        features = len(self._features[0])
        surrogates = [Surrogate.fit(columns, part, features, natural) for part in figures.T]
        predictor = _Predictor(surrogates)
        self._regression = (len(self.z), predictor)
        return predictor

    def _estimate(self) -> bool:
        """Draw one batch of natural scenarios and drive in some of them.

        The whole batch is drawn and weighted before the first drive. Return False if none can be
        certified.
        """
        generator = self._generator(2, self._batch_count)
        self._batch_count += 1
        if not self._batches:
            natural = [_Drawn(self.z[k], None, self._features[k]) for k in self._natural]
            self._nearness = self._near(natural)
        least, near_factor = self._design()
        expected = SETTINGS.batch * np.maximum(near_factor * self._nearness, least).mean()
        drawn = self._draw(generator)
        if not drawn:
            return False
        self._nearness = self._near(drawn)
        probability = np.maximum(near_factor * self._nearness, least)
        chosen = np.flatnonzero(generator.random(len(drawn)) < probability)
        chosen = generator.permutation(chosen)
        driven = self._drive([drawn[place] for place in chosen])
        share = len(driven) / len(chosen) if len(chosen) else 1.0
        if share > 0.0:
            self._batches.append(Batch(share * len(drawn), least, share * float(expected)))
        for place, k in zip(chosen, driven, strict=False):
            self._batch_of[k] = len(self._batches) - 1
            self.weights[k] = float(1.0 / probability[place])
            if probability[place] <= least:
                self._even.append(k)
        self._check_budget()
        return True

    def _near(self, drawn: Sequence[_Drawn]) -> Floats:
        """Return the probabilities (S,) of being driven for the predicted nearness to failure."""
        predicted, error = self._predictor()(drawn)
        tail: Floats = special.ndtr(-predicted / (SETTINGS.error_factor * error)).max(axis=1)
        return np.clip(2.0 * tail, 0.0, 1.0)

    def _design(self) -> tuple[float, float]:
        """Return the least probability of the next batch, and the factor on nearness.

        Where nothing foretells failure, every scenario is driven. Until a drive fails, most are
        chosen evenly, since they alone bound the rate.
        Afterwards the least probability is that of Neyman's allocation: the root of the ratio of
        unexpected failures per even drive to expected ones per drive near to failure.
        """
        if not self._traced:
            return 1.0, 1.0
        low, high = SETTINGS.min_even_probability, SETTINGS.max_even_probability
        if not self._failure_count(range(len(self.z))):
            ratio = (1.0 - SETTINGS.even_share) / SETTINGS.even_share
            return high, min(1.0, ratio * high / max(float(self._nearness.mean()), 1e-9))
        near = self._batch_of.keys() - set(self._even)
        surprises = self._failure_count(self._even) + SETTINGS.prior_surprises
        surprise_rate = surprises / (len(self._even) + 1.0)
        precision = (self._failure_count(near) + SETTINGS.prior_precision) / (len(near) + 1.0)
        least = max(math.sqrt(surprise_rate / precision), low)
        failure_rate = self._failure_count(self._natural) / len(self._natural)
        if failure_rate > high:
            least = max(least, SETTINGS.frequent_ratio * failure_rate)
        return min(least, 1.0), 1.0

    def _failure_count(self, drives: Collection[int]) -> int:
        """Return the number of failures among some drives."""
        return sum(self.responses[k].failed for k in drives)

    def _natural_rate(self, hits: int) -> Interval:
        """Return the rate of `hits` among the natural drives of the exploration."""
        if not self._natural:
            return Interval(math.nan, 0.0, 1.0)
        return wilson(hits, len(self._natural), SETTINGS.confidence)

    def _result(self) -> Estimate:
        hits = self._failure_count(self._natural)
        rate = self._natural_rate(hits)
        unexpected = math.nan
        failed = [k for k in self.weights if self.responses[k].failed]
        shares: dict[str, float] = {}
        for k in failed:
            kind = self.responses[k].kind
            shares[kind] = shares.get(kind, 0.0) + self.weights[k]
        seen = sum(batch.scenarios for batch in self._batches)
        if seen:
            rate = self._rate(failed, also_natural=not hits)
            surprises = [k for k in self._even if self.responses[k].failed]
            unexpected = self._rate(surprises, also_natural=not hits).high
        numbers = enumerate(self.responses, start=1)
        return Estimate(
            rate=rate,
            plain=(hits, len(self._natural)),
            drives=len(self.z),
            first=next((number for number, response in numbers if response.failed), 0),
            seen=round(seen),
            valid=self._certified / max(self._drawn, 1),
            unexpected=unexpected,
            shares={kind: part / math.fsum(shares.values()) for kind, part in shares.items()},
            events={name: self._event_rate(name) for name in self.event_names},
        )

    def _event_rate(self, name: str) -> Interval:
        """Return the rate of an event."""
        hits = sum(name in self.responses[k].events for k in self._natural)
        if not self._batches:
            return self._natural_rate(hits)
        drives = [k for k in self.weights if name in self.responses[k].events]
        return self._rate(drives, also_natural=not hits)

    def deviation(self, k: int) -> float:
        """Return the distance of a scenario from the mean, in standard deviations.

        It is measured along the slope of the regression of the least part.
        """
        parts = self.responses[k].parts
        surrogate = self._predictor().surrogates[int(np.argmin(parts)) if parts else 0]
        return abs(float(surrogate.direction(self.problem.size) @ self.z[k]))

    def _rate(self, hits: Sequence[int], *, also_natural: bool) -> Interval:
        """Return the rate of some drives over the batches, with its interval.

        Args:
            hits: drives that have a weight.
            also_natural: the natural drives of the exploration have no hit, either.
        """
        if not hits:
            natural_count = len(self._natural) if also_natural else 0
            return rate_without_hits(self._batches, natural_count)
        weights = np.array([self.weights[k] for k in hits])
        return rate_of(self._batches, weights, [self._batch_of[k] for k in hits])


@dataclass(frozen=True, eq=False)
class _Predictor:
    """A regression of the parts of a drive, one surrogate each."""

    surrogates: list[Surrogate]

    def __call__(self, drawn: Sequence[_Drawn]) -> tuple[Floats, Floats]:
        """Return predictions (S, parts) and their errors (parts,) for scenarios (S,)."""
        z = [scenario.z for scenario in drawn]
        features = [scenario.features for scenario in drawn]
        columns = np.column_stack([z, features])
        predicted = np.column_stack([each.predict(columns) for each in self.surrogates])
        return predicted, np.array([each.error for each in self.surrogates])
