# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The filters of candidates: target, validity, rarity. Each refusal has a cause."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
import math
from typing import NamedTuple, Protocol

import numpy as np

from scenario_gen.method.sampling.candidates import CandidateModel
from scenario_gen.method.sampling.sampler import (
    Block,
    BLOCK_CANDIDATES,
    LEVELS,
    Sampler,
    TargetSet,
)
from scenario_gen.method.sampling.time_warp import MIN_RATE_RATIO, SAMPLE_PERIOD_S
from scenario_gen.method.sampling.trimming import MIN_DURATION_S
from scenario_gen.numerics import Floats
from scenario_gen.types import (
    Cause,
    FOLLOW,
    Note,
    NoteKind,
    Reaction,
    Scenario,
    Verdict,
    Violation,
)


class CheckScenarios(Protocol):
    """The validity checker, see `Checker.check`."""

    def __call__(
        self, scenarios: Sequence[Scenario], is_enough: Callable[[Violation], bool] = ..., /
    ) -> list[Verdict]:
        """Return one verdict per scenario."""
        ...


NO_LIMIT_COUNT = 1 << 30  # with one clock for all vehicles, conflicts depend on the road alone
PILOT_CANDIDATES = 2 * BLOCK_CANDIDATES  # by which a level is judged
MIN_RARITY_SCENARIOS = 20  # valid ones from which a bound is taken
_LARGE_PILOT_FACTOR = 5  # over a pilot that has too few valid candidates
_MIN_DISTANCE_SHARE = 0.55  # of a route; half of the recorded distance, which may be longer
_KEPT_SHARE = 0.4  # of the valid candidates with a conflict area that are kept at least
_SHARED_AREA_SHARE = 0.1  # of valid candidates, from which all must have one
_ENDING_S = 2.5  # before a record's end
_HARDER_MPS2 = 1.0  # braking at the end over the strongest of the undisturbed drive
_COMFORTABLE_MPS2 = 2.0  # braking at the end that any driver may show


@dataclass(frozen=True, eq=False)
class Candidate:
    """A candidate with its verdict.

    Attributes:
        index: of the candidate.
        scenario: all its vehicles; None without a speed profile.
        cause: why it is refused; None if it is kept.
    """

    index: int
    scenario: Scenario | None
    cause: Cause | None


class Pilot(NamedTuple):
    """The first candidates of the level to use, with the verdicts of the checker.

    Attributes:
        level: whose standard deviations they have.
        tried: number of levels that were tried.
        candidates: in the order of their indices.
    """

    level: int
    tried: int
    candidates: list[Candidate]

    @property
    def valid(self) -> list[Scenario]:
        """The valid ones."""
        return [
            each.scenario
            for each in self.candidates
            if each.scenario is not None and each.cause is None
        ]


@dataclass(frozen=True, eq=False)
class ValidityFilter:
    """Refuses candidates that are not valid.

    Attributes:
        check: the validity checker.
        max_absent: conflicts of the template that candidates may lose: as many as the undisturbed
            drive, or, where that loses some, as the best of the first candidates.
        enough: share of valid candidates from which a level of standard deviations is used.
        lost: reactions of the template, by their vehicles, that cannot be kept on this road, each
            with a message: neither the undisturbed drive nor those candidates keep them. No
            candidate is refused for them.
        min_distances: (N,) metres that each vehicle drives at least.
        min_duration: s that a scenario lasts at least.
        max_end_braking: (N,) m/s² that each vehicle brakes at most shortly before its record
            ends without a leader.
    """

    check: CheckScenarios
    max_absent: int
    enough: float
    lost: Mapping[tuple[int, ...], str] = field(default_factory=dict)
    min_distances: Floats | float = 0.0
    min_duration: float = 0.0
    max_end_braking: Floats | float = math.inf

    @classmethod
    def of(cls, sampler: Sampler, check: CheckScenarios, enough: float) -> "ValidityFilter":
        """Find what the drive without deviations loses."""
        undisturbed = sampler.undisturbed()
        if undisturbed is None:
            return cls(check, NO_LIMIT_COUNT, enough)
        (verdict,) = check([undisturbed])
        lost, absent = _lost_reactions(verdict), verdict.not_applicable
        if not sampler.varies:
            return cls(check, NO_LIMIT_COUNT, enough, lost)
        first = _drivable(sampler.block(0, 0)) if absent else []
        if first:
            verdicts = sorted(check(first), key=lambda verdict: verdict.not_applicable)
            absent = min(absent, verdicts[0].not_applicable)
            for verdict in verdicts:
                if verdict.not_applicable <= absent:
                    also_lost = _lost_reactions(verdict)
                    lost = {pair: lost[pair] for pair in lost if pair in also_lost}
        vehicles = sampler.model.vehicles
        distances = np.array([_MIN_DISTANCE_SHARE * vehicle.path.length for vehicle in vehicles])
        duration = min(MIN_DURATION_S, MIN_RATE_RATIO * float(sampler.model.warp.nominal.time[-1]))
        braking = _allowed_end_braking(sampler.model, undisturbed)
        return cls(check, absent, enough, lost, distances, duration, braking)

    def __call__(self, scenarios: Sequence[Scenario]) -> list[Cause | None]:
        """Return the first cause for which each scenario is refused, None for a valid one."""
        unfit = [self._unfit(scenario) for scenario in scenarios]
        checked = [each for each, cause in zip(scenarios, unfit, strict=True) if cause is None]
        verdicts = iter(self.check(checked, self._decides) if checked else [])
        return [cause or self._cause(next(verdicts)) for cause in unfit]

    def _unfit(self, scenario: Scenario) -> Cause | None:
        """Return why a scenario need not be checked."""
        driven = (scenario.speed * scenario.is_present).sum(axis=1) * SAMPLE_PERIOD_S
        if scenario.time[-1] < self.min_duration or (driven < self.min_distances).any():
            return Cause.TOO_SHORT
        is_late = (_strongest_braking(scenario, _ENDING_S) > self.max_end_braking).any()
        return Cause.LATE_BRAKING if is_late else None

    def _cause(self, verdict: Verdict) -> Cause | None:
        for violation in filter(self._decides, verdict.violations):
            return violation.cause
        return Cause.CONFLICT_LOST if verdict.not_applicable > self.max_absent else None

    def _decides(self, violation: Violation) -> bool:
        """Return whether a violation is a reason to refuse."""
        return violation.cause != Cause.REACTION or violation.vehicles not in self.lost

    def kept(self, edges: Iterable[Reaction]) -> tuple[Reaction, ...]:
        """Return the reactions that candidates keep."""
        return tuple(edge for edge in edges if (edge.who, edge.whom) not in self.lost)

    def judged(self, blocks: Iterable[Block]) -> Iterator[Candidate]:
        """Yield the candidates of blocks with their verdicts."""
        for block in blocks:
            causes = iter(self([each for each in block.scenarios if each is not None]))
            for index, each in zip(*block, strict=True):
                cause = Cause.SPEED_PROFILE if each is None else next(causes)
                yield Candidate(index, each, cause)

    def pilot(
        self,
        sampler: Sampler,
        rarity: Callable[[Scenario], float] | None,
        cancelled: Callable[[], bool] = lambda: False,
    ) -> Pilot:
        """Return the pilot of the first level with enough valid candidates, or of the best.

        With too few valid candidates for a bound of `rarity`, five times as many are drawn.
        """
        count = PILOT_CANDIDATES // BLOCK_CANDIDATES
        pilots: list[Pilot] = []
        for level in range(len(LEVELS)):
            first = list(self.judged(sampler.block(level, k) for k in range(count)))
            pilots.append(Pilot(level, level + 1, first))
            if len(pilots[level].valid) >= self.enough * PILOT_CANDIDATES or cancelled():
                break
        best = max(pilots, key=lambda pilot: len(pilot.valid))._replace(tried=len(pilots))
        if rarity and len(best.valid) < MIN_RARITY_SCENARIOS and not cancelled():
            further = range(count, _LARGE_PILOT_FACTOR * count)
            best.candidates.extend(self.judged(sampler.block(best.level, k) for k in further))
        return best


def _allowed_end_braking(model: CandidateModel, undisturbed: Scenario) -> Floats:
    """Return how hard (N,) [m/s²] each vehicle may brake at its end; inf behind a leader."""
    braking = _HARDER_MPS2 + _strongest_braking(undisturbed, math.inf)
    braking = np.maximum(braking, _COMFORTABLE_MPS2)
    end = float(model.warp.nominal.grid[-1]) - _ENDING_S
    for edge in model.reactions.edges:
        if edge.kind == FOLLOW and edge.until > end:
            braking[edge.who] = math.inf
    return braking


def _strongest_braking(scenario: Scenario, seconds: float) -> Floats:
    """Return each vehicle's strongest braking (N,) [m/s²], at most `seconds` before it leaves."""
    first = scenario.present[:, 1:] - seconds / SAMPLE_PERIOD_S
    ending = scenario.is_present & (np.arange(len(scenario.time)) >= first)
    return np.asarray(np.where(ending, -scenario.acceleration, 0.0).max(axis=1))


def _drivable(block: Block) -> list[Scenario]:
    """Return the candidates with a speed profile."""
    return [each for each in block.scenarios if each is not None]


def _lost_reactions(verdict: Verdict) -> dict[tuple[int, ...], str]:
    """Return the reactions that a drive does not keep, by their vehicles, with their messages."""
    return {
        violation.vehicles: violation.message
        for violation in verdict.violations
        if violation.cause == Cause.REACTION
    }


@dataclass(frozen=True, eq=False)
class RarityFilter:
    """Refuses valid candidates that are rare among recorded encounters of their kind.

    A template may be rare itself, and then so is everything generated from it. So candidates with
    a rarity of at most 1 are kept, or the two fifths of the valid candidates that are least rare;
    without a conflict area none is.
    The bound is found with the first candidates, and is the same for all.

    Attributes:
        rarity: returns the rarity of a scenario; None: all are kept.
        max_rarity: the greatest rarity that is kept; infinite where vehicles hardly ever share an
            area.
        kept_share: of the valid candidates.
    """

    rarity: Callable[[Scenario], float] | None = None
    max_rarity: float = math.inf
    kept_share: float = 1.0

    @classmethod
    def of(
        cls, rarity: Callable[[Scenario], float] | None, valid: Sequence[Scenario]
    ) -> "RarityFilter":
        """Find the bound from the first valid candidates."""
        if rarity is None or not valid:
            return cls(rarity)
        rarities = np.sort([rarity(scenario) for scenario in valid])
        shared = rarities[np.isfinite(rarities)]
        if len(shared) < _SHARED_AREA_SHARE * len(rarities):
            return cls(rarity)
        bound = max(1.0, float(shared[int(_KEPT_SHARE * len(shared))]))
        return cls(rarity, bound, float((rarities <= bound).mean()))

    def __call__(self, scenario: Scenario) -> bool:
        """Return whether a valid candidate is kept."""
        return self.rarity is None or self.rarity(scenario) <= self.max_rarity

    @property
    def valid_per_kept(self) -> int:
        """Valid candidates per candidate that is kept."""
        return math.ceil(1.0 / self.kept_share)

    def notes(self) -> tuple[Note, ...]:
        """Return a note on the bound, unless only usual candidates are kept."""
        if self.rarity is None or self.max_rarity <= 1.0:
            return ()
        if math.isinf(self.max_rarity):
            return (Note.of(NoteKind.NO_SHARED_AREA),)
        return (Note.of(NoteKind.UNUSUAL, rarity=self.max_rarity),)


@dataclass(frozen=True, eq=False)
class Filters:
    """All filters of a request: speed profile, target, validity, rarity, in this order."""

    validity: ValidityFilter
    target: TargetSet | None = None
    rarity: RarityFilter = RarityFilter()

    def judged(self, blocks: Iterable[Block]) -> Iterator[Candidate]:
        """Yield the candidates of blocks, each with the cause for which it is refused."""
        for block in blocks:
            near = [
                each if each is None or self._in_range(each) else None for each in block.scenarios
            ]
            judged = self.validity.judged([block._replace(scenarios=near)])
            for candidate, scenario in zip(judged, block.scenarios, strict=True):
                if candidate.scenario is scenario:
                    yield self.rejudged(candidate)
                else:
                    yield replace(candidate, scenario=scenario, cause=Cause.OUT_OF_RANGE)

    def rejudged(self, candidate: Candidate) -> Candidate:
        """Return a checked candidate; out of range, or rare, with that cause."""
        scenario = candidate.scenario
        if scenario is None or candidate.cause is not None:
            return candidate
        if not self._in_range(scenario):
            return replace(candidate, cause=Cause.OUT_OF_RANGE)
        return candidate if self.rarity(scenario) else replace(candidate, cause=Cause.UNUSUAL)

    def notes(self) -> tuple[Note, ...]:
        """Return notes on reactions that cannot be kept, and on rare scenarios that are kept."""
        messages = self.validity.lost.values()
        lost = [Note.of(NoteKind.REACTION_LOST, message=message) for message in messages]
        return (*lost, *self.rarity.notes())

    def _in_range(self, scenario: Scenario) -> bool:
        return self.target is None or self.target.holds(self.target.values(scenario))
