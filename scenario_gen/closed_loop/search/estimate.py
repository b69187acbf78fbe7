# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How rare is a failure, and where is it? A drive is dear, a certified scenario is cheap: so most scenarios are not driven.

Two steps take turns, so that any budget is a prefix of a larger one:

- Exploration by small runs of subset simulation (Au & Beck 2001) with preconditioned
  Crank-Nicolson moves (Cotter et al. 2013). Of many moves the one is driven that a regression
  predicts to be the nearest to failure. Runs start anew, so that they find the first failure
  early, and different failures.
- Estimation by two-phase sampling (Neyman 1938). Natural scenarios are drawn; each is driven with
  a probability that is the higher the nearer to failure it is predicted to be, and counts by the
  inverse of that (Horvitz & Thompson 1952). So the rate is unbiased whatever the regression is
  worth, and no weight exceeds the inverse of the least probability.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
import math
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np
from scipy import optimize, special

from scenario_gen.closed_loop.search.surrogate import Surrogate
from scenario_gen.method.evaluation import wilson
from scenario_gen.numerics import Floats
from scenario_gen.types import Interval

POPULATION, LARGEST = (
    24,
    96,
)  # drives of a level of an exploration; it grows with the drives so far, up to the largest
GROWTH = 25  # one drive of a level for so many drives so far
SEEDS = 4  # one in so many of a population starts a chain
MOVES = 24  # of a chain, of which one is driven
LEVELS = 12  # of one exploration at most
EXPLORED = 0.2  # share of the drives that explore
BATCH = 256  # natural candidates of which some are driven
REFIT = 1.1  # times as many drives as at the last regression ask for a new one
EXPLORING = 0.4  # share of a batch's drives that are chosen evenly
LEAST, MOST = 0.005, 0.1  # bounds of the probability with which every scenario is driven
OFTEN = 1.5  # times the share of natural drives that fail is driven, where that is above MOST: frequent failures need no choice
WIDER = 3.0  # factor on the error of the regression: the wider, the more is driven, and the smaller are the weights
LEVEL = 0.95  # of the intervals
_STEP, _ACCEPTED = (
    0.5,
    0.4,
)  # first step of a chain, and the share of accepted moves that it is adapted to


@dataclass(frozen=True)
class Response:
    """What one drive came to.

    Attributes:
        margin: 0 or less if it failed; the smaller, the nearer to failure.
        parts: figures whose least is the margin where it did not fail; as many for every drive, or
            none.
        kind: which failure it is, "" for none.
        events: what happened whose rates are told, too.
    """

    margin: float
    parts: tuple[float, ...] = ()
    kind: str = ""
    events: tuple[str, ...] = ()

    @property
    def failed(self) -> bool:
        """Whether it is a failure."""
        return self.margin <= 0.0


Candidate = TypeVar("Candidate")


class Problem(Protocol[Candidate]):
    """What is searched."""

    @property
    def size(self) -> int:
        """Standard normal numbers of a candidate."""

    def candidates(self, z: Floats) -> list[Candidate | None]:
        """Return the certified scenarios of numbers (S, size), None where a number gives none."""

    def features(self, candidate: Candidate) -> tuple[float, ...]:
        """Return figures of a scenario that the drive may hang on, as many for each."""

    def drive(self, candidates: Sequence[Candidate]) -> list[Response]:
        """Drive the planner in each."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """What a search came to.

    Attributes:
        rate: share of certified natural scenarios in which the planner fails, with its interval.
        plain: the same by natural drives alone: failures, drives.
        drives: how many; first: number of the first that failed, counted from 1, 0 if none did.
        seen: certified natural scenarios that the rate is of, driven or not; valid: their share of
            the candidates.
        unexpected: upper end (95 %) of the rate of failures that the regression does not expect.
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
        """Upper end (95 %) of the rate, whatever the regression is worth."""
        return max(self.rate.high, self.unexpected) if self.unexpected >= 0.0 else self.rate.high


class _SpentError(Exception):
    """The budget is spent."""


class _Drawn(NamedTuple):
    """A certified scenario: its numbers (d,), itself, and its features."""

    z: Floats
    candidate: Any
    features: tuple[float, ...]


@dataclass(eq=False)
class Search:
    """The account of one search; `run` fills it.

    Attributes:
        problem: what is searched.
        seed: of all randomness.
        budget: drives at most.
        worst: explore on beyond the first failures, for the worst, and estimate no rate.
        z: (d,) numbers of each drive.
        responses: of each drive.
        weights: of drives of natural scenarios that count for the rate: for how many of these each
            stands.
        told: names of events whose rates are told.
    """

    problem: Problem  # type: ignore[type-arg]
    seed: int
    budget: int
    worst: bool = False
    z: list[Floats] = field(default_factory=list)
    responses: list[Response] = field(default_factory=list)
    weights: dict[int, float] = field(default_factory=dict)
    _features: list[tuple[float, ...]] = field(default_factory=list)
    _natural: list[int] = field(
        default_factory=list
    )  # drives of natural scenarios that nobody chose
    _sampled: list[int] = field(
        default_factory=list
    )  # drives of natural scenarios that the regression chose
    told: Sequence[str] = ()
    _even: list[tuple[int, float]] = field(
        default_factory=list
    )  # of each batch: scenarios, least probability to be driven
    _drawn: int = 0  # numbers drawn for natural scenarios
    _certified: int = 0  # of these
    _floor: list[int] = field(
        default_factory=list
    )  # drives of scenarios that were chosen evenly: no failure was expected
    _explored: int = 0
    _runs: int = 0
    _batches: int = 0
    _known: "tuple[int, _Predictor] | None" = (
        None  # the last regression, and from how many drives it is
    )
    _evenly: float = (
        0.02  # probability with which each scenario of the next batch is driven at least
    )

    def run(self) -> Estimate:
        """Search until the budget is spent, or nothing certified is found."""
        try:
            while self.worst or self._explored <= EXPLORED * len(self.z) or self._estimate():
                if (
                    self.worst or self._explored <= EXPLORED * len(self.z)
                ) and not self._explore():
                    break
        except _SpentError:
            pass
        return self._result()

    def _generator(self, *place: int) -> np.random.Generator:
        return np.random.Generator(np.random.PCG64(np.random.SeedSequence([self.seed, 7, *place])))

    def _drive(self, drawn: Sequence[_Drawn]) -> list[int]:
        """Drive in certified scenarios, as many as the budget allows; return the numbers of these drives."""
        first, driven = len(self.z), drawn[: self.budget - len(self.z)]
        self.responses += self.problem.drive([one.candidate for one in driven])
        self.z += [one.z for one in driven]
        self._features += [one.features for one in driven]
        return list(range(first, len(self.z)))

    def _check_budget(self) -> None:
        if len(self.z) >= self.budget:
            raise _SpentError

    def _certify(self, z: Floats) -> list[_Drawn]:
        """Return the certified scenarios among those of numbers (S, d)."""
        pairs = zip(z, self.problem.candidates(z), strict=True)
        return [
            _Drawn(row, one, self.problem.features(one)) for row, one in pairs if one is not None
        ]

    def _draw(self, generator: np.random.Generator) -> list[_Drawn]:
        """Return the certified scenarios of a batch of natural ones."""
        drawn = self._certify(generator.standard_normal((BATCH, self.problem.size)))
        self._drawn += BATCH
        self._certified += len(drawn)
        return drawn

    def _explore(self) -> bool:
        """Run one small subset simulation, towards any failure or by one part; False if nothing is certified."""
        run, self._runs = self._runs, self._runs + 1
        before = len(self.z)
        count = min(max(POPULATION, before // GROWTH // SEEDS * SEEDS), LARGEST)
        generator = self._generator(1, run)
        try:
            population = self._natural_drives(generator, count)
            if not population:
                return False
            towards, step = run % (1 + len(self.responses[0].parts)), _STEP
            for _ in range(LEVELS):
                order = sorted(population, key=lambda k: (self._distance(k, towards), k))
                seeds = order[: count // SEEDS]
                threshold = self._distance(seeds[-1], towards)
                if threshold >= self._distance(order[-1], towards):
                    break
                goal = threshold if self.worst else max(threshold, 0.0)
                population, step = self._chains(generator, seeds, (towards, goal), step)
                if threshold <= 0.0 and not self.worst:
                    break
        finally:
            self._explored += len(self.z) - before
        return True

    def _distance(self, k: int, towards: int) -> float:
        """Return the margin of a drive, or one of its parts."""
        response = self.responses[k]
        return response.margin if towards == 0 else response.parts[towards - 1]

    def _natural_drives(self, generator: np.random.Generator, count: int) -> list[int]:
        """Drive in `count` certified natural scenarios; none are returned if hardly any can be certified."""
        found: list[int] = []
        while len(found) < count:
            drawn = self._draw(generator)
            if not drawn:
                return []
            new = self._drive(drawn[: count - len(found)])
            self._natural += new
            found += new
            self._check_budget()
        return found

    def _chains(
        self,
        generator: np.random.Generator,
        seeds: list[int],
        below: tuple[int, float],
        step: float,
    ) -> tuple[list[int], float]:
        """Return the population of the next level, and the next step: from each seed a chain, below a threshold."""
        towards, threshold = below
        population, heads, accepted = list(seeds), list(seeds), 0
        for _ in range(SEEDS - 1):
            predict = self._predictor()
            chosen: dict[int, _Drawn] = {}
            for place, head in enumerate(heads):
                noise = generator.standard_normal((MOVES, self.problem.size))
                drawn = self._certify(math.sqrt(1.0 - step * step) * self.z[head] + step * noise)
                if drawn:
                    predicted = predict(drawn)[0]
                    best = np.argmin(
                        predicted[:, towards - 1] if towards else predicted.min(axis=1)
                    )
                    chosen[place] = drawn[best]
            for place, k in zip(chosen, self._drive(list(chosen.values())), strict=False):
                if self._distance(k, towards) <= threshold:
                    heads[place] = k
                    accepted += 1
            self._check_budget()
            population += heads
        share = accepted / (len(seeds) * (SEEDS - 1))
        return population, min(max(step * float(np.exp(share - _ACCEPTED)), 0.05), 1.0)

    def _predictor(self) -> "_Predictor":
        """Return what predicts the parts of a drive from what was driven so far."""
        if self._known is not None and len(self.z) < REFIT * self._known[0]:
            return self._known[1]
        columns = np.column_stack([self.z, self._features])
        figures = np.array([one.parts or (one.margin,) for one in self.responses])
        failed = np.array([one.failed for one in self.responses])
        natural = np.isin(np.arange(len(failed)), [*self._natural, *self._sampled])
        for part in figures.T:  # a failure is one of the least part
            part[failed & (part == figures.min(axis=1))] = -math.inf
        count = len(self._features[0])
        self._known = (
            len(self.z),
            _Predictor([Surrogate.fit(columns, part, count, natural) for part in figures.T]),
        )
        return self._known[1]

    def _estimate(self) -> bool:
        """Draw one batch of natural scenarios and drive in some of them; False if none can be certified.

        The batch is drawn whole and weighed before anything is driven, so that the rate is
        unbiased. One that the budget cuts off does not count.
        """
        generator = self._generator(2, self._batches)
        self._batches += 1
        drawn = self._draw(generator)
        choosing = generator.random(len(drawn))
        if not drawn:
            return False
        frequent = self._failed(self._natural) / len(self._natural)
        evenly = max(self._evenly, min(OFTEN * frequent, 1.0) if frequent > MOST else 0.0)
        predicted, error = self._predictor()(drawn)
        near = np.clip(2.0 * special.ndtr(-predicted / (WIDER * error)).max(axis=1), 0.0, 1.0)
        probability = np.maximum(near, evenly)
        chosen = np.flatnonzero(choosing < probability).tolist()
        driven = self._drive([drawn[place] for place in chosen])
        self._sampled += driven
        if len(driven) == len(chosen):
            self._even.append((len(drawn), evenly))
            for place, k in zip(chosen, driven, strict=True):
                self.weights[k] = float(1.0 / probability[place])
                if probability[place] <= evenly:
                    self._floor.append(k)
            likely = float(near.mean())
            self._evenly = min(max(EXPLORING / (1.0 - EXPLORING) * likely, LEAST), MOST)
        self._check_budget()
        return True

    def _failed(self, drives: Sequence[int]) -> int:
        """Return how many of some drives failed."""
        return sum(self.responses[k].failed for k in drives)

    def _result(self) -> Estimate:
        hits, natural = self._failed(self._natural), len(self._natural)
        plain = wilson(hits, natural, LEVEL) if natural else Interval(math.nan, 0.0, 1.0)
        shares: dict[str, float] = {}
        failed = [k for k in self.weights if self.responses[k].failed]
        for k in failed:
            shares[self.responses[k].kind] = (
                shares.get(self.responses[k].kind, 0.0) + self.weights[k]
            )
        seen = sum(count for count, _ in self._even)
        return Estimate(
            rate=self._rate(failed, also=not hits) if seen else plain,
            plain=(hits, natural),
            drives=len(self.z),
            first=next((k for k, one in enumerate(self.responses, start=1) if one.failed), 0),
            seen=seen,
            valid=self._certified / max(self._drawn, 1),
            unexpected=self._rate(
                [k for k in self._floor if self.responses[k].failed], also=not hits
            ).high
            if seen
            else math.nan,
            shares={kind: part / math.fsum(shares.values()) for kind, part in shares.items()},
            events={name: self._event(name) for name in self.told},
        )

    def _event(self, name: str) -> Interval:
        """Return the rate of an event."""
        if self._even:
            never = not any(name in self.responses[k].events for k in self._natural)
            return self._rate(
                [k for k in self.weights if name in self.responses[k].events], also=never
            )
        hits = sum(name in self.responses[k].events for k in self._natural)
        return (
            wilson(hits, len(self._natural), LEVEL)
            if self._natural
            else Interval(math.nan, 0.0, 1.0)
        )

    def deviation(self, k: int) -> float:
        """Return how far a drive's scenario is from the mean, in standard deviations along what the regression goes by."""
        parts = self.responses[k].parts
        slope = (
            self._predictor()
            .surrogates[int(np.argmin(parts)) if parts else 0]
            .direction(self.problem.size)
        )
        return abs(float(slope @ self.z[k]))

    def _rate(self, hits: Sequence[int], *, also: bool) -> Interval:
        """Return the rate over the batches of what happened in some drives, with its interval.

        That is the gamma interval of a sum of weights (Fay & Feuer 1997). If it never happened,
        the upper end is the rate at which that has a probability of 2.5 %: in batch b each of n
        scenarios is driven with a probability of e at least, which is fixed before they are drawn,
        so it is Π (1 - rate · e)^n at most. `also`: nor in any natural drive of the exploration.
        """
        w = np.array([self.weights[k] for k in hits])
        if not len(w):
            count, evenly = np.array([*self._even, (len(self._natural) * also, 1.0)]).T
            tail, most = math.log(0.5 - 0.5 * LEVEL), 1.0 - 1e-12
            if count @ np.log1p(-most * evenly) > tail:
                return Interval(0.0, 0.0, 1.0)
            return Interval(
                0.0,
                0.0,
                float(
                    optimize.brentq(
                        lambda rate: count @ np.log1p(-rate * evenly) - tail, 0.0, most
                    )
                ),
            )
        seen = sum(count for count, _ in self._even)
        total, square = float(w.sum()), float((w * (w - w.sum() / seen)).sum())
        low = _gamma_quantile(total, max(square, total * 1e-9), 0.5 - 0.5 * LEVEL)
        most = float(w.max())
        high = _gamma_quantile(total + most, square + most * most, 0.5 + 0.5 * LEVEL)
        return Interval(min(total / seen, 1.0), min(low / seen, 1.0), min(high / seen, 1.0))


def _gamma_quantile(mean: float, variance: float, share: float) -> float:
    """The quantile at a share of the gamma distribution with this mean and variance."""
    return float(special.gammaincinv(mean * mean / variance, share)) * variance / mean


@dataclass(frozen=True, eq=False)
class _Predictor:
    """Predicts the parts of a drive."""

    surrogates: list[Surrogate]

    def __call__(self, drawn: Sequence[_Drawn]) -> tuple[Floats, Floats]:
        """Return predictions (S, parts) and their errors (parts,) for scenarios (S,)."""
        columns = np.column_stack([[one.z for one in drawn], [one.features for one in drawn]])
        predicted = np.column_stack([one.predict(columns) for one in self.surrogates])
        return predicted, np.array([one.error for one in self.surrogates])
