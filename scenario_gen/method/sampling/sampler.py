# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Candidates by their index: seed and index determine a candidate.

They are drawn from the standard normal distribution, or towards a target by importance sampling. A
candidate has hundreds of numbers z, and a figure such as its PET depends on few combinations of
them. Ridge regression of the figures on z finds these; the proposal differs from the standard
normal distribution only along them: u = B z has mean m and standard deviations s. So the weight of
a candidate, φ(z) / q(z), is a function of one to three numbers. One candidate in ten is drawn
without regard to the target (a defensive mixture, Hesterberg 1995), which bounds every weight by
ten.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
import hashlib
import itertools
import math
from typing import NamedTuple

import numpy as np
from scipy import linalg, special

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.method.sampling.candidates import CandidateModel
from scenario_gen.method.sampling.vehicle_model import NoiseScale
from scenario_gen.numerics import Floats
from scenario_gen.situation import closest_crossing, Situation
from scenario_gen.types import (
    Facts,
    Measure,
    Measures,
    Pair,
    Request,
    Scenario,
    Target,
    with_witness,
)

NATURAL_SHARE = 0.1  # of the proposal's candidates that ignore the target
TTC_HORIZON_S = 10.0  # a longer time to collision is no collision course
_MIN_TTC_S = 0.1  # of the regression, which explains the inverse
_GAP_WEIGHT = 0.2  # of the gap in the distance of candidates without a collision course
_MAX_MARGIN_S = 3.0  # beyond a swapped order: the first vehicle must have left by then
_INSIDE_S = 0.5  # a vehicle that enters so soon leaves no way to let the other one go first
_MIN_RIDGE_ROWS_COUNT = 8
_RIDGE_SHARE = 0.1  # of the response's variance that is not linear
_RIDGE_ITERATIONS = 3
_MIN_PRIOR_SHARE = 1e-4  # of the largest prior variance: no number is excluded for good
_MAX_EXPONENT = 600.0  # exp overflows at 709
_NORMAL_95_SIGMAS = 1.96
_RULE_OF_THREE_COUNT = 3.0  # 95 % bound of a count of which none was seen


class TargetError(RefusedError):
    """The target cannot be reached; the message states the reachable range."""


@dataclass(frozen=True, eq=False)
class TargetSet:
    """The targets of a request, with the function that measures them.

    Attributes:
        targets: the ranges; at least one.
        pairs: the vehicles of each, None for the most critical pair.
        measure: returns a figure of a scenario.
        margin: how far below the first target's upper bound the search aims.
        note: an addition to a refusal.
    """

    targets: tuple[Target, ...]
    pairs: tuple[Pair | None, ...]
    measure: Measure
    margin: float = 0.0
    note: str = ""

    @classmethod
    def of(
        cls, situation: Situation, request: Request, measures: Measures | None
    ) -> "TargetSet | None":
        """Return the targets of a request; None if it has none.

        For a swapped order that is the arrival gap with the other sign.

        Raises:
            InputError: a target names a vehicle that does not exist, or no measures are given.
        """
        encounter = situation.encounter
        targets, margin, note = request.targets, 0.0, ""
        closest = closest_crossing(situation.conflicts) if request.order == "swap" else None
        if closest is not None:
            first, second = (encounter.vehicles[n].id for n in (closest.first, closest.second))
            targets = (Target("arrival_gap", -np.inf, 0.0, (first, second)), *targets)
            margin = min(closest.exit_first - closest.entry_first, _MAX_MARGIN_S)
            if closest.entry_first <= _INSIDE_S:
                note = (
                    f"; in the recording vehicle {first} enters the conflict area "
                    f"{closest.entry_first:.1f} s after the start"
                )
        if not targets:
            return None
        if measures is None:
            raise InputError("a target or another order is requested, but no `measures` are given")
        pairs = tuple(target.pair(encounter) for target in targets)
        return cls(targets, pairs, measures.figure, margin, note)

    def values(self, scenario: Scenario) -> list[float]:
        """Return the figure of each target."""
        return [
            self.measure(scenario, target.name, pair)
            for target, pair in zip(self.targets, self.pairs, strict=True)
        ]

    def holds(self, values: Sequence[float]) -> bool:
        """Return whether every figure is in its range."""
        return all(target.holds(value) for target, value in zip(self.targets, values, strict=True))

    @property
    def guide_count(self) -> int:
        """Number of guides."""
        return sum(2 if target.name == "ttc" else 1 for target in self.targets)

    def guides(self, scenario: Scenario, values: Sequence[float]) -> list[float]:
        """Return what the regression explains: the figures, for `ttc` its inverse and the gap."""
        guides: list[float] = []
        for target, pair, value in zip(self.targets, self.pairs, values, strict=True):
            if target.name == "ttc":
                gap = self.measure(scenario, "gap", pair)
                guides += [1.0 / max(value, _MIN_TTC_S), gap]
            else:
                guides.append(value)
        return guides

    def distance(
        self, values: Sequence[float], guides: Sequence[float], unit: Sequence[float]
    ) -> float:
        """Return how far figures are from their ranges, in units of `unit`; inf for NaN."""
        if any(math.isnan(value) for value in values):
            return math.inf
        total, k = 0.0, 0
        for n, (target, value) in enumerate(zip(self.targets, values, strict=True)):
            high = target.high - self.margin if n == 0 else target.high
            limited = min(value, TTC_HORIZON_S) if target.name == "ttc" else value
            total += max(target.low - limited, limited - high, 0.0) / unit[n]
            if target.name == "ttc":
                if value > TTC_HORIZON_S:
                    total += _GAP_WEIGHT * guides[k + 1]
                k += 1
            k += 1
        return total


@dataclass(frozen=True, eq=False)
class Proposal:
    """A mixture of the standard normal distribution and one that is shifted in few directions.

    Attributes:
        basis: (k, d) orthonormal rows, the directions.
        mean: (k,) of u = basis z.
        sigma: (k,) standard deviations of u.
    """

    basis: Floats
    mean: Floats
    sigma: Floats

    def transform(self, z: Floats, selector: Floats) -> Floats:
        """Return samples (S, d) of the proposal.

        Args:
            z: (S, d) standard normal numbers.
            selector: (S,) standard normal numbers that select the samples that stay as they are.
        """
        u = z @ self.basis.T
        step = (self.mean + (self.sigma - 1.0) * u) @ self.basis
        natural = special.ndtr(selector) < NATURAL_SHARE
        return np.where(natural[:, None], z, z + step)

    def density_ratio(self, z: Floats) -> Floats:
        """Return q(z) / φ(z) (S,) at samples z (S, d), at least NATURAL_SHARE."""
        u = z @ self.basis.T
        power = 0.5 * (np.square(u) - np.square((u - self.mean) / self.sigma)).sum(axis=1)
        shifted = np.exp(np.minimum(power, _MAX_EXPONENT)) / np.prod(self.sigma)
        return np.asarray(NATURAL_SHARE + (1.0 - NATURAL_SHARE) * shifted)


def directions(z: Floats, guides: Floats) -> Floats:
    """Return orthonormal rows (k, d), k <= g, along which the guides change most.

    Few numbers carry most of the effect, so ridge regression is repeated with each coefficient's
    square as its prior variance (automatic relevance determination, MacKay 1992).

    Args:
        z: (n, d) numbers.
        guides: (n, g) figures; rows with one that is not finite are left out.
    """
    known = np.isfinite(guides).all(axis=1)
    if known.sum() < _MIN_RIDGE_ROWS_COUNT:
        return np.zeros((0, z.shape[1]))
    rows = z[known] - z[known].mean(axis=0)
    basis: list[Floats] = []
    for values in guides[known].T:
        response = values - values.mean()
        if float(np.square(response).mean()) < 1e-12:
            continue
        beta = _sparse_ridge(rows, response)
        for other in basis:
            beta = beta - (beta @ other) * other
        length = float(np.sqrt(np.square(beta).sum()))
        if length > 1e-9:
            basis.append(beta / length)
    return np.array(basis).reshape(len(basis), z.shape[1])


def _sparse_ridge(rows: Floats, response: Floats) -> Floats:
    """Return the coefficients (d,) of a response (n,) on centred rows (n, d)."""
    variance = float(np.square(response).mean())
    prior = np.full(rows.shape[1], 1.0 / rows.shape[1])
    beta = np.zeros(rows.shape[1])
    for _ in range(_RIDGE_ITERATIONS):
        scaled = rows * prior
        kernel = (scaled @ rows.T) * variance
        kernel[np.diag_indices(len(kernel))] += _RIDGE_SHARE * variance
        beta = variance * (scaled.T @ linalg.solve(kernel, response, assume_a="pos"))
        square = np.square(beta)
        square += _MIN_PRIOR_SHARE * float(square.max())
        prior = square / square.sum()
    return beta


def estimated_share(weights: Floats, candidates: int) -> tuple[float, float, float]:
    """Return the share of natural candidates that are hits, with its 95 % interval.

    Args:
        weights: (h,) importance weights of the hits.
        candidates: number of candidates.
    """
    if not candidates:
        return math.nan, 0.0, 1.0
    share = float(weights.sum()) / candidates
    variance = max(float(np.square(weights).sum()) / candidates - share * share, 0.0) / candidates
    half = _NORMAL_95_SIGMAS * math.sqrt(variance)
    if not len(weights):
        half = _RULE_OF_THREE_COUNT / NATURAL_SHARE / candidates
    return share, max(0.0, share - half), min(1.0, share + half)


Label = Callable[[Scenario], Facts]

LEVELS = (
    NoiseScale(),
    NoiseScale(lateral=0.5, vehicle_clock=0.5),
    NoiseScale(lateral=0.5, longitudinal=0.5, vehicle_clock=0.25),
    NoiseScale(lateral=0.25, longitudinal=0.25, time=0.5, vehicle_clock=0.1),
    NoiseScale(lateral=0.1, longitudinal=0.1, time=0.25, vehicle_clock=0.03),
)
"""The levels of standard deviations, tried in this order."""
LEVEL_CANDIDATES = 1 << 20  # of one level whose indices are consecutive
INDEX_LEVELS = 8  # slots of an index; the next candidates of the first level follow the last slot
BLOCK_CANDIDATES = 32  # whose random numbers are drawn together
DIRECTED_SLOT, STAGE_SLOT = 5, 6  # of a proposal's candidates, and of those that find it
SEARCH_SLOT = 7  # of scenarios whose numbers a search selected


def index_of(level: int, candidate: int) -> int:
    """Return the index of a level's candidate."""
    page, within = divmod(candidate, LEVEL_CANDIDATES)
    return (page * INDEX_LEVELS + level) * LEVEL_CANDIDATES + within


def searched_index(numbers: Floats) -> int:
    """Return the index of a scenario whose numbers (d,) a search selected.

    It follows from the SHA-256 of the numbers, rounded to a millionth so that any CPU agrees.
    """
    rounded = np.round(numbers * 1e6).astype(np.int64)
    digest = hashlib.sha256(rounded.tobytes()).digest()[:5]
    return index_of(SEARCH_SLOT, int.from_bytes(digest))


def place_of(index: int) -> tuple[int, int]:
    """Return level and number of the candidate with this index.

    Raises:
        InputError: no candidate has it.
    """
    slot, within = divmod(index, LEVEL_CANDIDATES)
    page, level = divmod(slot, INDEX_LEVELS)
    if index < 0 or level > DIRECTED_SLOT:
        raise InputError(f"no candidate has the index {index}; use one from `scenarios/info`")
    return level, page * LEVEL_CANDIDATES + within


class Block(NamedTuple):
    """Candidates that are drawn together; None for one without a speed profile."""

    indices: list[int]
    scenarios: list[Scenario | None]


@dataclass(frozen=True, eq=False)
class Sampler:
    """Draws candidates by their index.

    Attributes:
        model: of the candidates.
        seed: of all randomness.
        frame_id: the road's frame.
        ego: the vehicle that is left out of published scenarios and becomes the reference drive.
        base: the level whose standard deviations a proposal's candidates have.
        proposal: of the numbers; None for independent standard normal numbers.
        label: returns the facts of a candidate of all vehicles.
    """

    model: CandidateModel
    seed: int
    frame_id: str
    ego: int | None = None
    base: int = 0
    proposal: Proposal | None = None
    label: Label = lambda _: Facts()

    def block(self, level: int, number: int) -> Block:
        """Return a block of a level's candidates."""
        first = index_of(level, number * BLOCK_CANDIDATES)
        indices = list(range(first, first + BLOCK_CANDIDATES))
        batch = self.model.draw(self.numbers(level, number), self._scale(level))
        return Block(indices, batch.scenarios(self.seed, indices, self.frame_id))

    def blocks(self, level: int, first: int = 0) -> Iterator[Block]:
        """Yield the blocks of a level, from a number on."""
        for number in itertools.count(first):
            yield self.block(level, number)

    @property
    def varies(self) -> bool:
        """Whether vehicles have clocks, places, end speeds or sizes that vary."""
        return any(vehicle.variation is not None for vehicle in self.model.vehicles)

    def undisturbed(self) -> Scenario | None:
        """Return the drive without deviations.

        None if nothing varies and no vehicle reacts, or if it has no speed profile.
        """
        if not self.varies and not self.model.reactions.edges:
            return None
        batch = self.model.draw(np.zeros((1, self.model.size)), LEVELS[0])
        return batch.scenarios(self.seed, [0], self.frame_id)[0]

    def published(self, whole: Scenario) -> Scenario:
        """Return a candidate of all vehicles as it is published, with its facts."""
        facts = replace(self.label(whole), lights=whole.facts.lights)
        if self.proposal is not None:
            facts = replace(facts, weight=self.weight(whole.index))
        named = whole.with_facts(facts)
        return named if self.ego is None else with_witness(named, self.ego)

    def weight(self, index: int) -> float:
        """Return the importance weight of a candidate; 1 where there is no proposal."""
        level, candidate = place_of(index)
        if self.proposal is None or level != DIRECTED_SLOT:
            return 1.0
        number, row = divmod(candidate, BLOCK_CANDIDATES)
        numbers = self.numbers(level, number)[row : row + 1]
        return 1.0 / float(self.proposal.density_ratio(numbers)[0])

    def numbers(self, level: int, number: int) -> Floats:
        """Return the numbers (S, size) of a block, those of a proposal transformed by it."""
        if self.proposal is None or level < DIRECTED_SLOT:
            return self._normal(level, number, self.model.size)
        z = self._normal(level, number, self.model.size + 1)
        return self.proposal.transform(z[:, :-1], z[:, -1])

    def _scale(self, level: int) -> NoiseScale:
        return LEVELS[level if level < DIRECTED_SLOT else self.base]

    def _normal(self, level: int, number: int, size: int) -> Floats:
        """Return standard normal numbers (S, size), every other row mirrors the one before.

        So the mean of a set is the drive without deviations, to first order, however few samples
        it has (antithetic variates, Hammersley and Morton 1956).
        """
        seed = np.random.SeedSequence([self.seed, level, number])
        generator = np.random.Generator(np.random.PCG64(seed))
        z = generator.standard_normal((BLOCK_CANDIDATES // 2, size))
        return np.stack([z, -z], axis=1).reshape(BLOCK_CANDIDATES, -1)
