# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How rare is a failure, and where is it? Drives are chosen in the space of the sampler's standard normal numbers.

Two steps take turns, so that any budget is a prefix of a larger one:

- Exploration by subset simulation (Au & Beck 2001) with preconditioned Crank-Nicolson moves (Cotter et al. 2013). Small runs that
  start anew find the first failure early, and different failures.
- Estimation by importance sampling. The proposal is a mixture: one part is the natural distribution, the others are normal
  distributions around each kind of failure, in the few directions that matter. Samples of all proposals are weighted together
  (adaptive multiple importance sampling, Cornuet et al. 2012).

A number that gives no certified scenario costs no drive.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
import math
from typing import Protocol, TypeVar

import numpy as np
from scipy import special

from scenario_gen.method.evaluation import wilson
from scenario_gen.method.sampling import directions
from scenario_gen.numerics import Bools, exact, Floats, Ints
from scenario_gen.types import Interval

POPULATION, LARGEST = 24, 192  # drives of a level of an exploration; it grows with the drives so far, up to the largest
GROWTH = 25  # one drive of a level for so many drives so far
SEEDS = 4  # one in so many of a population starts a chain
LEVELS = 12  # of one exploration at most
EXPLORED = 0.5  # share of the drives that explore
BATCH = 64  # numbers drawn from one proposal
NATURAL_SHARE = 0.15  # of a proposal, so that no weight exceeds 1 / NATURAL_SHARE
LEARNED = 500  # drives from which the directions are learned, at most
ADDED = 0.3  # share of a direction that the others before it must leave, else it is noise
FEWEST = 4  # failures of a kind that make a component of their own
TRUSTED = 20.0  # effective number of weighted failures from which on those of the explorations are left out
CHECKED = 512  # natural candidates that are checked, without a drive, for the share of valid ones
LEVEL = 0.95  # of the intervals
_STEP, _ACCEPTED = 0.5, 0.4  # first step of a chain, and the share of accepted moves that it is adapted to
_SPREAD, _LEAST, _MOST = 1.3, 0.8, 2.0  # of a component's standard deviations: factor on the failures', least, greatest


@dataclass(frozen=True)
class Response:
    """What one drive came to.

    Attributes:
        margin: 0 or less if it failed; the smaller, the nearer to failure.
        guides: figures that the margin may hang on; as many for every drive.
        kind: which failure it is, "" for none.
    """

    margin: float
    guides: tuple[float, ...] = ()
    kind: str = ""

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

    def drive(self, candidates: Sequence[Candidate]) -> list[Response]:
        """Drive the planner in each."""


@dataclass(frozen=True, eq=False)
class Proposal:
    """A mixture of the natural distribution and of normal ones in a few directions, C of them.

    Attributes:
        basis: (k, d) orthonormal rows.
        share: (C,) of the components; they add up to 1 - NATURAL_SHARE.
        mean: (C, k) of u = basis z.
        sigma: (C, k) standard deviations of u.
    """

    basis: Floats
    share: Floats
    mean: Floats
    sigma: Floats

    def sample(self, z: Floats, chooser: Floats) -> Floats:
        """Return samples (S, d) made of standard normal numbers (S, d), and (S,) that choose the components."""
        part = np.searchsorted(NATURAL_SHARE + np.cumsum(self.share), exact.ndtr(chooser))
        part = np.minimum(part, len(self.share) - 1)
        natural = exact.ndtr(chooser) < NATURAL_SHARE
        u = exact.matmul(z, self.basis.T)
        step = exact.matmul(self.mean[part] + (self.sigma[part] - 1.0) * u, self.basis)
        return np.where(natural[:, None], z, z + step)

    def ratio(self, z: Floats) -> Floats:
        """Return its density over the natural one (S,) at numbers z (S, d)."""
        u = exact.matmul(z, self.basis.T)[:, None]
        power = 0.5 * (np.square(u) - np.square((u - self.mean) / self.sigma)).sum(axis=-1)
        parts = self.share * exact.exp(np.minimum(power, 600.0)) / np.prod(self.sigma, axis=-1)
        return np.asarray(NATURAL_SHARE + parts.sum(axis=1))


def _orthonormal(rows: Sequence[Floats]) -> Floats:
    """Return orthonormal rows that span the given ones (Gram and Schmidt); those that add little are left out."""
    basis: list[Floats] = []
    for row in rows:
        left = row
        for other in basis:
            left = left - exact.dot(left, other) * other
        length, whole = (float(np.sqrt(np.square(one).sum())) for one in (left, row))
        if length > max(ADDED * whole, 1e-9):
            basis.append(left / length)
    return np.array(basis).reshape(len(basis), len(rows[0]) if rows else 0)


@dataclass(frozen=True, eq=False)
class Estimate:
    """What a search came to.

    Attributes:
        rate: share of certified natural scenarios in which the planner fails, with its interval.
        plain: the same by the natural drives alone: failures, drives.
        drives: how many; first: number of the first that failed, counted from 1, 0 if none did.
        valid: share of natural candidates that are certified.
        unseen: upper end of the 95 % interval for failures of kinds that the natural drives have not shown.
        shares: of the rate, by kind of failure.
    """

    rate: Interval
    plain: tuple[int, int]
    drives: int
    first: int
    valid: float
    unseen: float
    shares: dict[str, float]


class _SpentError(Exception):
    """The budget is spent."""


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
        weights: of failures that a proposal drew, by drive: natural density over the proposals'.
    """

    problem: Problem  # type: ignore[type-arg]
    seed: int
    budget: int
    worst: bool = False
    z: list[Floats] = field(default_factory=list)
    responses: list[Response] = field(default_factory=list)
    weights: dict[int, float] = field(default_factory=dict)
    _natural: list[int] = field(default_factory=list)  # drives of the natural distribution, each of its own numbers
    _batches: list[tuple[int, int, int]] = field(default_factory=list)  # first drive, drive behind the last, numbers drawn
    _last: Proposal | None = None
    _explored: int = 0
    _runs: int = 0
    _valid: float = 1.0

    def run(self) -> Estimate:
        """Search until the budget is spent."""
        self._valid = self._share_of_valid()
        try:
            while self._valid > 0.0:
                if self.worst or self._explored <= EXPLORED * len(self.z) or not self._failures() or not self._estimate():
                    self._explore()
        except _SpentError:
            pass
        return self._result()

    def _share_of_valid(self) -> float:
        generator = self._generator(0)
        good = 0
        for _ in range(CHECKED // BATCH):
            z = exact.standard_normal(generator, (BATCH, self.problem.size))
            good += sum(one is not None for one in self.problem.candidates(z))
        return good / CHECKED

    def _generator(self, *place: int) -> np.random.Generator:
        return np.random.Generator(np.random.PCG64(np.random.SeedSequence([self.seed, 7, *place])))

    def _drive(self, z: Floats) -> tuple[Bools, list[int]]:
        """Drive in all of numbers (S, d) that are certified: which they are (S,), and the numbers of their drives.

        Raises:
            _SpentError: the budget does not suffice; as many as it allows are driven.
        """
        candidates = self.problem.candidates(z)
        rows = [k for k, one in enumerate(candidates) if one is not None]
        affordable = rows[: self.budget - len(self.z)]
        first = len(self.z)
        self.responses += self.problem.drive([candidates[k] for k in affordable])
        self.z += [z[k] for k in affordable]
        if len(affordable) < len(rows) or len(self.z) >= self.budget:
            raise _SpentError
        ok = np.array([one is not None for one in candidates])
        return ok, list(range(first, len(self.z)))

    def _failures(self) -> list[int]:
        return [k for k, one in enumerate(self.responses) if one.failed]

    def _explore(self) -> None:
        """Run one small subset simulation, towards any failure or towards that of one guide."""
        run, self._runs = self._runs, self._runs + 1
        before = len(self.z)
        count = min(max(POPULATION, before // GROWTH // SEEDS * SEEDS), LARGEST)
        generator = self._generator(1, run)
        try:
            population = self._natural_drives(generator, count)
            towards, step = run % (1 + len(self.responses[0].guides)), _STEP
            for _ in range(LEVELS):
                order = sorted(population, key=lambda k: (self._distance(k, towards), k))
                seeds = order[: count // SEEDS]
                threshold = self._distance(seeds[-1], towards)
                if threshold >= self._distance(order[-1], towards):
                    break
                population, step = self._chains(
                    generator, seeds, (towards, threshold if self.worst else max(threshold, 0.0)), step
                )
                if threshold <= 0.0 and not self.worst:
                    break
        finally:
            self._explored += len(self.z) - before

    def _distance(self, k: int, towards: int) -> float:
        """Return the margin of a drive, or one of its guides."""
        response = self.responses[k]
        return response.margin if towards == 0 else response.guides[towards - 1]

    def _natural_drives(self, generator: np.random.Generator, count: int) -> list[int]:
        """Drive in `count` certified scenarios of the natural distribution."""
        found: list[int] = []
        while len(found) < count:
            z = exact.standard_normal(generator, (count - len(found), self.problem.size))
            before = len(self.z)
            try:
                found += self._drive(z)[1]
            finally:
                self._natural += range(before, len(self.z))
        return found

    def _chains(
        self, generator: np.random.Generator, seeds: list[int], below: tuple[int, float], step: float
    ) -> tuple[list[int], float]:
        """Return the population of the next level, and the next step: from each seed a chain, below a threshold."""
        towards, threshold = below
        population, heads, accepted = list(seeds), list(seeds), 0
        for _ in range(SEEDS - 1):
            z = np.stack([self.z[k] for k in heads])
            noise = exact.standard_normal(generator, z.shape)
            ok, driven = self._drive(math.sqrt(1.0 - step * step) * z + step * noise)
            number = iter(driven)
            for place, certified in enumerate(ok.tolist()):
                k = next(number) if certified else -1
                if k >= 0 and self._distance(k, towards) <= threshold:
                    heads[place] = k
                    accepted += 1
            population += heads
        share = accepted / (len(seeds) * (SEEDS - 1))
        return population, min(max(step * math.exp(share - _ACCEPTED), 0.05), 1.0)

    def _estimate(self) -> bool:
        """Draw one batch from a proposal around the failures; False if there is none."""
        proposal = self._proposal()
        if proposal is None:
            return False
        self._last = proposal
        number = len(self._batches)
        numbers = exact.standard_normal(self._generator(2, number), (BATCH, self.problem.size + 1))
        z = proposal.sample(numbers[:, :-1], numbers[:, -1])
        before, drawn = len(self.z), BATCH
        try:
            self._drive(z)
        except _SpentError:
            drawn = next((k + 1 for k in range(BATCH) if len(self.z) > before and np.array_equal(z[k], self.z[-1])), 0)
            raise
        finally:
            failed = [k for k in range(before, len(self.z)) if self.responses[k].failed]
            if failed:
                ratio = proposal.ratio(np.stack([self.z[k] for k in failed]))
                self.weights |= dict(zip(failed, (1.0 / ratio).tolist(), strict=True))
            self._batches.append((before, len(self.z), drawn))
        return True

    def _proposal(self) -> Proposal | None:
        """Return a proposal around the known failures; None if too few are known, or they do not lie in any direction."""
        failures = self._failures()
        weights = np.array([self.weights.get(k, 0.0) for k in failures])
        trusted = weights.sum() ** 2 / max(float(np.square(weights).sum()), 1e-300) >= TRUSTED
        explored = float(weights[weights > 0.0].mean()) if trusted else 1.0
        if not trusted:
            weights = np.ones(len(failures))
        if len(failures) < FEWEST:
            return None
        basis = self._basis()
        if not len(basis):
            return None
        u = exact.matmul(np.stack([self.z[k] for k in failures]), basis.T)
        share, mean, sigma = [], [], []
        for rows in self._of_kinds(failures):
            own = weights[rows]
            if not own.any():  # only explorations have seen it
                own = np.full(len(own), 0.1 * explored)
            part = own / own.sum()
            m = exact.matmul(part, u[rows])
            share.append(float(own.sum()))
            mean.append(m * np.maximum(1.0 - 0.5 / np.maximum(np.square(m), 1e-12), 0.0) if not trusted else m)
            sigma.append(np.sqrt(exact.matmul(part, np.square(u[rows] - m))))
        if not share:
            return None
        shares = 0.5 * np.array(share) / sum(share) + 0.5 / len(share)
        shares *= (1.0 - NATURAL_SHARE) / shares.sum()
        return Proposal(basis, shares, np.stack(mean), np.clip(_SPREAD * np.stack(sigma), _LEAST, _MOST))

    def deviation(self, k: int) -> float:
        """Return how far a drive's numbers are from 0, along the directions that matter if these are known."""
        z = self.z[k]
        return float(np.sqrt(np.square(z if self._last is None else exact.matmul(self._last.basis, z)).sum()))

    def _basis(self) -> Floats:
        """Return orthonormal rows (k, d): the directions in which margin and guides change, over drives near to failure and far."""
        figures = np.array([(one.margin, *one.guides) for one in self.responses])
        order = np.array(sorted(range(len(self.z)), key=lambda k: (self.responses[k].margin, k)))
        spread = order[np.linspace(0, len(order) - 1, min(len(order), LEARNED)).astype(np.int64)]
        z = np.stack([self.z[k] for k in spread])
        return _orthonormal([row for figure in figures[spread].T for row in directions(z, figure[:, None])])

    def _of_kinds(self, failures: list[int]) -> list[Ints]:
        """Return the rows of failures of each kind that has enough of them."""
        kinds = [self.responses[k].kind for k in failures]
        rows = [np.flatnonzero([one == kind for one in kinds]) for kind in sorted(set(kinds))]
        return [own for own in rows if len(own) >= FEWEST]

    def _result(self) -> Estimate:
        failures = self._failures()
        hits, natural = sum(self.responses[k].failed for k in self._natural), len(self._natural)
        plain = wilson(hits, natural, LEVEL) if natural else Interval(math.nan, 0.0, 1.0)
        own, drawn = self._counted()
        shares: dict[str, float] = {}
        for k in own:
            shares[self.responses[k].kind] = shares.get(self.responses[k].kind, 0.0) + self.weights[k]
        whole = sum(shares.values())
        rate = plain
        if whole > 0.0:
            rate = self._weighted(np.array([self.weights[k] for k in own]), drawn)
            if rate.high - rate.low > plain.high - plain.low and hits:
                rate = plain
        unseen = 1.0 - (1.0 - LEVEL) ** (1.0 / natural) if natural else 1.0
        first = failures[0] + 1 if failures else 0
        return Estimate(
            rate, (hits, natural), len(self.z), first, self._valid, unseen, {kind: part / whole for kind, part in shares.items()}
        )

    def _counted(self) -> tuple[list[int], int]:
        """Return the failures that count for the rate, and how many numbers were drawn with them: the later half of the batches.

        The first proposals know little; which batches count hangs on their number alone, so the rate is unbiased.
        """
        later = self._batches[len(self._batches) // 2 :]
        own = [k for first, end, _ in later for k in range(first, end) if k in self.weights]
        return own, sum(drawn for _, _, drawn in later)

    def _weighted(self, weights: Floats, total: int) -> Interval:
        """Return the rate by weights of failures among `total` numbers; its interval is that of a lognormal variable.

        Weights are skewed: the largest that a proposal can give may not have come yet. So the upper end has the largest twice.
        """
        rate, low, _ = self._lognormal(weights, total)
        _, _, high = self._lognormal(np.append(weights, weights.max()), total)
        return Interval(min(rate, 1.0), low, min(high, 1.0))

    def _lognormal(self, weights: Floats, total: int) -> tuple[float, float, float]:
        mean = float(weights.sum()) / total
        variance = max(float(np.square(weights).sum()) / total - mean * mean, 0.0) / total / (mean * mean)
        variance += (1.0 - self._valid) / (self._valid * CHECKED)
        quantile = float(special.stdtrit(max(len(weights) - 1, 1), 0.5 + 0.5 * LEVEL))
        reach = math.exp(quantile * math.sqrt(math.log1p(variance)))
        rate = mean / self._valid
        return rate, rate / reach, rate * reach
