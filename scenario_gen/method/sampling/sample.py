# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The loop: draw candidates, have them checked, keep the valid ones, account for the others."""

from array import array
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
import itertools
from typing import Any

import numpy as np

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.method.sampling.adapt import adapted, aim_of, Check, Judge, label_of
from scenario_gen.method.sampling.config import SamplingConfig
from scenario_gen.method.sampling.directed import Aim, estimated, reachable, STAGE, TargetError
from scenario_gen.method.sampling.plan import Callbacks, Plan
from scenario_gen.method.sampling.prepare import prepare
from scenario_gen.method.sampling.sampler import (
    BLOCK,
    DIRECTED,
    ENOUGH,
    LEVELS,
    place_of,
    RedrawnScenarios,
    Sampler,
)
from scenario_gen.method.sampling.usual import FEW, PILOT, pilot, Usual
from scenario_gen.types import (
    Cause,
    EgoSlot,
    Measures,
    Note,
    NoteKind,
    Reached,
    Request,
    Scenario,
    ScenarioSet,
)

KEPT = 1000  # scenarios up to which a set stays in memory
LEAST_COUNT = 20  # where clocks are free: scenarios for which candidates are drawn at least, so that levels can be tried
DIRECTED_BUDGET = 10  # times the budget of a request without a target
HOPELESS = (
    20 * BLOCK
)  # candidates of a proposal after which it is given up if none of them is valid and in the range


def draw_scenarios(
    plan: Plan,
    check: Check,
    config: SamplingConfig = SamplingConfig(),
    *,
    count: int,
    seed: int = 0,
    request: Request = Request(),
    callbacks: Callbacks = Callbacks(),
    measures: Measures | None = None,
) -> ScenarioSet:
    """Draw candidates until `count` are valid or the budget is spent.

    Source: paper III-C.

    Args:
        plan: the template on its road.
        check: the validity checker of all vehicles, the ego too; its verdicts decide.
        config: the standard deviations and limits.
        count: valid scenarios wanted.
        seed: of all randomness; with a scenario's index it gives that scenario again.
        request: which vehicle is left out of every scenario, its own motion given as witness; whether states were requested;
            which range, choice and order.
        callbacks: called on progress and with valid scenarios.
        measures: what measures a scenario for a target or a choice, see `Measures`; `check` knows the requested order.

    Returns:
        At most `count` scenarios; fewer if the budget did not suffice, which the account (`refused`) explains. Of more than KEPT
        only the indices are kept, so that memory hardly grows with their number.

    Raises:
        InputError: routes, segmentation and encounter disagree, or the ego is none of the vehicles.
        RefusedError: states or a target were requested, and not one candidate that meets them is valid.
    """
    encounter, ego = plan.encounter, request.ego_of(plan.encounter)
    prepared = prepare(plan, config, request.order)
    slot = (
        None
        if ego is None
        else EgoSlot(encounter.vehicles[ego], plan.requested.start[ego], plan.requested.end[ego])
    )
    if prepared.model is None:
        notes: tuple[Note, ...] = (Note.of(NoteKind.NOT_DRIVABLE, reasons=prepared.refusal),)
        drawn = ScenarioSet(count, (), 1, Counter({Cause.SPEED_PROFILE: 1}), notes, slot)
    else:
        aim = aim_of(plan.situation, request, measures)
        sampler = Sampler(
            prepared.model,
            seed,
            plan.road.frame_id,
            ego,
            label=label_of(plan.situation, request, aim, measures),
        )
        judge = Judge.of(sampler, check, _enough(config, request))
        kept = tuple(
            edge
            for edge in prepared.model.reactions.edges
            if (edge.who, edge.whom) not in judge.lost
        )
        sampler = replace(
            sampler, label=label_of(plan.situation, request, aim, measures, kept, judge.lost)
        )
        loop = _Loop(
            sampler,
            judge,
            count,
            callbacks,
            lambda scenario: callbacks.found(scenario, plan.requested, slot),
        )
        loop.aim, loop.measures = aim, measures
        if measures is not None and measures.rarity is not None:
            loop.usual = Usual.among(measures.rarity, pilot(sampler, judge, FEW)[1])
        loop.run_request(config.attempts)
        lost = [
            Note.of(NoteKind.REACTION_LOST, message=message) for message in judge.lost.values()
        ]
        notes = (*prepared.adaptations, *lost, *loop.usual.notes(), *loop.adaptations)
        drawn = ScenarioSet(
            count, loop.scenarios(), loop.candidates, loop.refused, notes, slot, loop.reached, kept,
        )  # fmt: skip
    if request.moves and not drawn.scenarios and not callbacks.cancelled():
        causes = ", ".join(
            f"{number} × {cause.value}" for cause, number in drawn.refused.most_common()
        )
        more = "".join(f"; {note}" for note in drawn.adaptations)
        raise RefusedError(
            f"none of {drawn.candidates} candidate(s) with the requested states is valid ({causes}{more})"
        )
    return drawn


def regenerate(
    plan: Plan,
    config: SamplingConfig = SamplingConfig(),
    *,
    seed: int,
    index: int,
    request: Request = Request(),
    check: Check | None = None,
    measures: Measures | None = None,
) -> Scenario | None:
    """The scenario with this seed and index again, to rounding, without the others; arguments as in `draw_scenarios`.

    One of a proposal needs `check` and `measures`, by which that is found again.

    Raises:
        InputError: no candidate has this index, or nothing is said of the target.
    """
    prepared = prepare(plan, config, request.order)
    if prepared.model is None:
        return None
    ego, aim = request.ego_of(plan.encounter), aim_of(plan.situation, request, measures)
    sampler = Sampler(
        prepared.model,
        seed,
        plan.road.frame_id,
        ego,
        label=label_of(plan.situation, request, aim, measures),
    )
    if place_of(index)[0] == DIRECTED:
        if aim is None or check is None:
            raise InputError(f"index {index} is of a proposal, but no target was requested")
        sampler = adapted(
            sampler, Judge.of(sampler, check, _enough(config, request)), aim, lambda: False
        ).sampler
    return sampler.scenario(index)


def _enough(config: SamplingConfig, request: Request) -> float:
    """Return the share of valid candidates by which a level is good enough; any, where the order alone makes most invalid."""
    return 0.0 if request.order == "swap" else ENOUGH[config.drawn.variety]


@dataclass
class _Loop:
    """The account of one request."""

    sampler: Sampler
    judge: Judge
    count: int
    callbacks: Callbacks
    found: Callable[[Scenario], None]
    kept: list[Scenario] = field(default_factory=list)  # the first KEPT
    index: Any = field(default_factory=lambda: array("q"))  # of all that are valid
    refused: Counter[Cause] = field(default_factory=Counter)
    candidates: int = 0
    adaptations: list[Note] = field(default_factory=list)
    aim: Aim | None = None
    measures: Measures | None = None
    usual: Usual = Usual()
    reached: Reached | None = None

    def run_request(self, attempts: int) -> None:
        """Sample what was asked, towards a target if there is one."""
        attempts *= self.usual.valid_each
        if self.aim is None:
            self.run(attempts * max(self.count, LEAST_COUNT if self.sampler.free else 1))
        else:
            self.run_directed(DIRECTED_BUDGET * attempts * self.count)

    def _take(self, number: int, scenario: Scenario) -> None:
        """Keep a valid candidate of all vehicles if it is accepted."""
        if not self.callbacks.accepts(scenario):
            return
        published = self.sampler.published(scenario)
        self.index.append(number)
        if len(self.kept) < KEPT:
            self.kept.append(published)
        self.found(published)

    def run_directed(self, budget: int) -> None:
        """Find a proposal, then draw from it.

        Raises:
            TargetError: not one valid candidate in the range was found; the message says which range there is.
        """
        aim = self.aim
        assert aim is not None
        result = adapted(self.sampler, self.judge, aim, self.callbacks.cancelled)
        self.sampler = result.sampler
        weights: list[float] = []
        if result.seen.hits() and not self.callbacks.cancelled():
            level = self.sampler.base if result.sampler.proposal is None else DIRECTED
            blocks = self._blocks(level)
            if result.sampler.proposal is None:
                self._take_pilot(result.pilot)
                blocks = itertools.islice(blocks, STAGE // BLOCK, None)
                weights = [1.0] * len(self.index)
            while not self._done(budget) and (self.index or self.candidates < HOPELESS):
                before = len(self.index)
                if not self._spend(blocks, min(BLOCK, budget - self.candidates))[0]:
                    break
                weights += [self.sampler.weight(number) for number in self.index[before:]]
        share, low, high = estimated(np.array(weights), self.candidates)
        if self.candidates:
            directed = self.sampler.proposal is not None
            self.reached = Reached(
                aim.targets, result.stages, result.candidates, share, low, high, directed
            )
            self.adaptations.append(self.reached.note())
            if self.sampler.base:
                self._describe(self.sampler.base, 2)
        if len(self.index) < self.count and not self.callbacks.cancelled():
            missed = Note.of(
                NoteKind.TARGET_MISSED,
                target="; ".join(map(str, aim.targets)),
                found=len(self.index),
                drawn=result.candidates + self.candidates,
                reachable=reachable(aim, result.seen),
            )
            if not self.index:
                raise TargetError(str(missed))
            self.adaptations.append(missed)

    def _take_pilot(self, pilot: Sequence[tuple[int, Scenario | None, Cause | None]]) -> None:
        """Take the candidates of a level that were drawn and checked already."""
        for number, scenario, cause in pilot:
            if len(self.index) == self.count or self.callbacks.cancelled():
                break
            self.candidates += 1
            if scenario is None or cause is not None or not self._in_range(scenario):
                self.refused[
                    cause or (Cause.SPEED_PROFILE if scenario is None else Cause.OUT_OF_RANGE)
                ] += 1
            elif not self.usual(scenario):
                self.refused[Cause.UNUSUAL] += 1
            else:
                self._take(number, scenario)

    def run(self, budget: int) -> None:
        """Judge the levels by their first candidates, then stay with the first that is good enough, or the best."""
        blocks = [self._blocks(level) for level in range(len(LEVELS))]
        share = []
        for level in range(len(LEVELS)):
            seen, good = self._spend(blocks[level], min(PILOT, budget - self.candidates))
            share.append(good / seen if seen else 0.0)
            if self._done(budget) or share[-1] >= self.judge.enough:
                break
        best = int(np.argmax(share))
        while not self._done(budget) and self._spend(blocks[best], budget - self.candidates)[0]:
            pass
        self._describe(best, len(share))

    def scenarios(self) -> Sequence[Scenario]:
        """The valid candidates: themselves, or, where they are many, what draws them again."""
        if len(self.index) <= KEPT:
            return tuple(self.kept)
        return RedrawnScenarios(self.sampler, np.array(self.index, dtype=np.int64))

    def _done(self, budget: int) -> bool:
        return (
            len(self.index) >= self.count
            or self.candidates >= budget
            or self.callbacks.cancelled()
        )

    def _blocks(self, level: int) -> Iterator[tuple[list[int], list[Scenario | None]]]:
        for number in itertools.count():
            yield self.sampler.block(level, number)

    def _spend(
        self, blocks: Iterator[tuple[list[int], list[Scenario | None]]], most: int
    ) -> tuple[int, int]:
        """Check up to `most` candidates, whole blocks at a time; how many were seen, and how many were valid, usual or not."""
        seen = good = 0
        while seen < most and len(self.index) < self.count and not self.callbacks.cancelled():
            index, drawn = next(blocks)
            aimed = [scenario is not None and self._in_range(scenario) for scenario in drawn]
            causes = iter(
                self.judge([s for s, ok in zip(drawn, aimed, strict=True) if ok and s is not None])
            )
            for number, scenario, ok in zip(index, drawn, aimed, strict=True):
                if seen == most or len(self.index) == self.count or self.callbacks.cancelled():
                    break
                seen += 1
                cause = (
                    next(causes)
                    if ok
                    else Cause.SPEED_PROFILE
                    if scenario is None
                    else Cause.OUT_OF_RANGE
                )
                if scenario is not None and cause is None:
                    good += 1
                    cause = None if self.usual(scenario) else Cause.UNUSUAL
                if scenario is not None and cause is None:
                    self._take(number, scenario)
                else:
                    self.refused[cause or Cause.SPEED_PROFILE] += 1
            self.callbacks.progress(len(self.index), self.count, self.candidates + seen)
        self.candidates += seen
        return seen, good

    def _in_range(self, scenario: Scenario) -> bool:
        return self.aim is None or self.aim.holds(self.aim.values(scenario))

    def _describe(self, best: int, tried: int) -> None:
        """Put what was adapted into sentences."""
        if tried > 1 and best == 0:
            self.adaptations.append(Note.of(NoteKind.FEW_VALID))
        elif tried > 1:
            s = LEVELS[best]
            free = self.sampler.free
            self.adaptations.append(
                Note.of(
                    NoteKind.LESS_VARIATION_EACH if free else NoteKind.LESS_VARIATION,
                    lateral=s.lateral,
                    longitudinal=s.longitudinal,
                    time=s.time,
                    vehicle=s.own,
                )
            )
        if self.callbacks.cancelled():
            self.adaptations.append(Note.of(NoteKind.CANCELLED))
