# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The sampling stage: from a fitted and planned template to scenarios that are proven valid.

Candidates are drawn and filtered, and valid ones are kept.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
import itertools

import numpy as np

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.method.sampling.build_model import build_model, kept_reactions
from scenario_gen.method.sampling.config import SamplingConfig
from scenario_gen.method.sampling.cross_entropy import find_proposal, STAGE_BLOCKS_COUNT
from scenario_gen.method.sampling.filters import (
    Candidate,
    CheckScenarios,
    Filters,
    Pilot,
    RarityFilter,
    ValidityFilter,
)
from scenario_gen.method.sampling.plan import Callbacks, Plan
from scenario_gen.method.sampling.sampler import (
    BLOCK_CANDIDATES,
    DIRECTED_SLOT,
    estimated_share,
    Label,
    LEVELS,
    Sampler,
    TargetError,
    TargetSet,
)
from scenario_gen.method.validity import Checker, Limits
from scenario_gen.situation import Conflict, conflict_of, Situation
from scenario_gen.types import (
    Cause,
    EgoSlot,
    Facts,
    GenerationResult,
    Measures,
    Note,
    NoteKind,
    OrderChange,
    PassingOrder,
    Planned,
    Reached,
    Reaction,
    Request,
    Scenario,
    ScenarioSet,
    token,
)

_MIN_COUNT_FACTOR = 20  # scenarios for which to draw, where clocks vary: levels need candidates
_DIRECTED_BUDGET_FACTOR = 10  # of a request with a target
_HOPELESS_CANDIDATES = 20 * BLOCK_CANDIDATES  # of a proposal without any hit
_ENOUGH_SHARE = 0.1  # of valid candidates below which the next level is tried
_ENOUGH_OF_ONE_DRIVER_SHARE = 0.3


def draw_scenarios(
    plan: Plan,
    check: CheckScenarios,
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
        check: the validity checker of all vehicles, the ego included; its verdicts decide.
        config: the standard deviations and limits.
        count: valid scenarios wanted.
        seed: of all randomness; with a scenario's index it gives that scenario again.
        request: the vehicle that is left out, requested states, target and order.
        callbacks: called on progress and with valid scenarios.
        measures: measures scenarios for a target; `check` knows the requested order.

    Returns:
        At most `count` scenarios; fewer if the budget did not suffice, which the account
        (`refused`) explains.

    Raises:
        InputError: routes, segmentation and encounter disagree, or the ego does not exist.
        RefusedError: states or a target were requested, and no candidate that meets them is valid.
    """
    ego, states = request.ego_of(plan.encounter), plan.requested
    slot = None
    if ego is not None:
        slot = EgoSlot(plan.encounter.vehicles[ego], states.start[ego], states.end[ego])
    built = build_model(plan, config, request.order)
    if built.model is None:
        refused = Counter({Cause.SPEED_PROFILE: 1})
        note = Note.of(NoteKind.NOT_DRIVABLE, reasons=built.refusal)
        drawn = ScenarioSet(count, (), 1, refused, (note,), slot)
    else:
        target = TargetSet.of(plan.situation, request, measures)
        sampler = Sampler(built.model, seed, plan.road.frame_id, ego)
        validity = ValidityFilter.of(sampler, check, enough_share(config, request))
        pilot, rarity = None, RarityFilter()
        if target is None:  # who asks for a critical range asks for what is rare
            law = None if measures is None else measures.rarity
            pilot = validity.pilot(sampler, law, callbacks.cancelled)
            rarity = RarityFilter.of(law, pilot.valid)
        filters = Filters(validity, target, rarity)
        kept = validity.kept(built.model.reactions.edges)
        label = label_of(plan.situation, request, target, measures, kept, validity.lost)

        def on_valid(scenario: Scenario) -> None:
            callbacks.on_valid(scenario, states, slot)

        run = _Run(filters, count, callbacks, replace(sampler, label=label), on_valid)
        reached = run.draw(config.attempts * filters.rarity.valid_per_kept, pilot)
        notes = (*built.notes, *filters.notes(), *run.notes)
        drawn = ScenarioSet(
            count, tuple(run.scenarios), run.candidates, run.refused, notes, slot, reached, kept
        )
    if request.moves and not drawn.scenarios and not callbacks.cancelled():
        causes = (f"{number} × {cause.value}" for cause, number in drawn.refused.most_common())
        reasons = "; ".join((", ".join(causes), *map(str, drawn.adaptations)))
        raise RefusedError(
            f"none of {drawn.candidates} candidate(s) with the requested states is valid "
            f"({reasons})"
        )
    return drawn


def enough_share(config: SamplingConfig, request: Request = Request()) -> float:
    """Return the share of valid candidates from which a level is used.

    It is 0 for a swapped order, which makes most candidates invalid at any level.
    """
    if request.order == "swap":
        return 0.0
    return _ENOUGH_SHARE if config.drivers > 0.0 else _ENOUGH_OF_ONE_DRIVER_SHARE


@dataclass
class _Run:
    """The set so far, and the account of all candidates.

    Attributes:
        filters: of the request.
        count: scenarios wanted.
        callbacks: of the caller.
        sampler: draws the candidates.
        on_valid: called with each scenario of the set.
        scenarios: of the set.
        refused: number of refused candidates by cause.
        candidates: number of candidates.
        notes: on what was adapted.
    """

    filters: Filters
    count: int
    callbacks: Callbacks
    sampler: Sampler
    on_valid: Callable[[Scenario], None]
    scenarios: list[Scenario] = field(default_factory=list)
    refused: Counter[Cause] = field(default_factory=Counter)
    candidates: int = 0
    notes: list[Note] = field(default_factory=list)

    def draw(self, attempts: int, pilot: Pilot | None) -> Reached | None:
        """Draw the set; return the outcome of a target, if there is one.

        Args:
            attempts: candidates per scenario, at most.
            pilot: the first candidates; None with a target, which has its own.

        Raises:
            TargetError: no valid candidate in the range was found; the message states which range
                can be reached.
        """
        if self.filters.target is None:
            assert pilot is not None
            minimum = _MIN_COUNT_FACTOR if self.sampler.varies else 1
            self._draw_level(pilot, attempts * max(self.count, minimum))
            return None
        budget = _DIRECTED_BUDGET_FACTOR * attempts * self.count
        return self._draw_directed(self.filters.target, budget)

    def _draw_level(self, pilot: Pilot, budget: int) -> None:
        """Draw from the level of the pilot, which comes first."""
        first = len(pilot.candidates) // BLOCK_CANDIDATES
        further = self.filters.judged(self.sampler.blocks(pilot.level, first))
        self._consume(
            itertools.chain(map(self.filters.rejudged, pilot.candidates), further), budget
        )
        self._note_level(pilot.level, pilot.tried)

    def _draw_directed(self, target: TargetSet, budget: int) -> Reached | None:
        """Find a proposal, then draw from it."""
        search = find_proposal(
            self.sampler, self.filters.validity, target, self.callbacks.cancelled
        )
        self.sampler = search.sampler
        if search.evaluations.hits:
            judged = self._directed(search.pilot)
            while not self._is_done(budget):
                self._consume(judged, min(BLOCK_CANDIDATES, budget - self.candidates))
        reached = None
        if self.candidates:
            weights = np.array(
                [self.sampler.weight(scenario.index) for scenario in self.scenarios]
            )
            share, low, high = estimated_share(weights, self.candidates)
            directed = self.sampler.proposal is not None
            reached = Reached(
                target.targets, search.stages, search.candidates, share, low, high, directed
            )
            self.notes.append(reached.note())
            if self.sampler.base:
                self._note_level(self.sampler.base, 2)
        if len(self.scenarios) < self.count and not self.callbacks.cancelled():
            missed = Note.of(
                NoteKind.TARGET_MISSED,
                target="; ".join(map(str, target.targets)),
                found=len(self.scenarios),
                drawn=search.candidates + self.candidates,
                reachable=search.evaluations.reachable(),
            )
            if not self.scenarios:
                raise TargetError(str(missed))
            self.notes.append(missed)
        return reached

    def _directed(self, pilot: Iterable[Candidate]) -> Iterator[Candidate]:
        """Return the candidates of the proposal, or the pilot and further natural candidates."""
        if self.sampler.proposal is not None:
            return self.filters.judged(self.sampler.blocks(DIRECTED_SLOT))
        further = self.sampler.blocks(self.sampler.base, STAGE_BLOCKS_COUNT)
        return itertools.chain(map(self.filters.rejudged, pilot), self.filters.judged(further))

    def _consume(self, candidates: Iterator[Candidate], most: int) -> None:
        """Add up to `most` candidates."""
        added = 0
        while added < most and not self._is_complete():
            self._add(next(candidates))
            added += 1
            self.candidates += 1
            if added % BLOCK_CANDIDATES == 0 or added == most or self._is_complete():
                self.callbacks.progress(len(self.scenarios), self.count, self.candidates)

    def _add(self, candidate: Candidate) -> None:
        """Add a candidate to the set, or to the account of refused ones."""
        if candidate.cause is not None:
            self.refused[candidate.cause] += 1
        elif candidate.scenario is not None and self.callbacks.accepts(candidate.scenario):
            published = self.sampler.published(candidate.scenario)
            self.scenarios.append(published)
            self.on_valid(published)

    def _is_complete(self) -> bool:
        return len(self.scenarios) >= self.count or self.callbacks.cancelled()

    def _is_done(self, budget: int) -> bool:
        is_hopeless = not self.scenarios and self.candidates >= _HOPELESS_CANDIDATES
        return self.candidates >= budget or is_hopeless or self._is_complete()

    def _note_level(self, best: int, tried: int) -> None:
        """Note which of the tried levels is used."""
        if tried > 1 and best == 0:
            self.notes.append(Note.of(NoteKind.FEW_VALID))
        elif tried > 1:
            scale, varies = LEVELS[best], self.sampler.varies
            note = Note.of(
                NoteKind.LESS_VARIATION_EACH if varies else NoteKind.LESS_VARIATION,
                lateral=scale.lateral,
                longitudinal=scale.longitudinal,
                time=scale.time,
                vehicle=scale.vehicle_clock,
            )
            self.notes.append(note)
        if self.callbacks.cancelled():
            self.notes.append(Note.of(NoteKind.CANCELLED))


def label_of(
    situation: Situation,
    request: Request,
    target: TargetSet | None,
    measures: Measures | None,
    reactions: Sequence[Reaction],
    lost: Iterable[tuple[int, ...]],
) -> Label:
    """Return the function that gives a scenario's facts.

    Args:
        situation: the template's.
        request: its order is named if it is not kept.
        target: its figures are named.
        measures: give the nearness of vehicles.
        reactions: that scenarios keep.
        lost: pairs whose reaction or smallest gap scenarios need not keep on this road.
    """
    names = [token(vehicle.id) for vehicle in situation.encounter.vehicles]
    kept = tuple(edge.named(names) for edge in reactions)
    lost_names = tuple((names[pair[0]], names[pair[1]]) for pair in lost)
    conflicts = () if request.order == "keep" else situation.conflicts

    def label(whole: Scenario) -> Facts:
        figures: dict[str, float] = {}
        if target is not None:
            labels = [each.label for each in target.targets]
            figures = dict(zip(labels, map(float, target.values(whole)), strict=True))
        return replace(
            Facts() if measures is None else measures.facts(whole),
            targets=figures,
            order=request.order,
            passing_order=tuple(_passing_order(names, each, whole) for each in conflicts),
            reactions=kept,
            lost_reactions=lost_names,
            decision=situation.encounter.decision,
        )

    return label


def _passing_order(names: Sequence[str], recorded: Conflict, whole: Scenario) -> PassingOrder:
    """Return the order in which a scenario passes one of the template's conflicts."""
    conflict = conflict_of(whole, *recorded.pair)
    change = OrderChange.NONE
    if conflict is None:
        change = OrderChange.NO_CONFLICT
    elif conflict.first != recorded.first:
        change = OrderChange.SWAPPED
    return PassingOrder(names[recorded.first], names[recorded.second], change)


def sample_scenarios(
    planned: Planned,
    sampling: SamplingConfig = SamplingConfig(),
    limits: Limits = Limits(),
    request: Request = Request(),
    *,
    count: int,
    plan: Plan | None = None,
    callbacks: Callbacks = Callbacks(),
    measures: Measures | None = None,
) -> GenerationResult:
    """Add scenarios to a fitted and planned template; every candidate is checked.

    Source: paper III-C.

    Args:
        planned: the template on its road.
        sampling: the sampler's parameters.
        limits: of motion, and the checker's.
        request: what is requested.
        count: valid scenarios wanted.
        plan: what the scenarios are drawn from, if it is known.
        callbacks: called on progress and with valid scenarios.
        measures: measures scenarios for a target.

    Raises:
        InputError: decisions are to be drawn.
        RefusedError: as `draw_scenarios`.
    """
    if sampling.decisions == "drawn" and planned.encounter.decision is None:
        raise InputError(
            "sampling.decisions=drawn gives a set for each outcome: use `scenario-gen generate` "
            "without --for-testing, `scenario-gen batch` or `generate_outcomes`"
        )
    plan = plan or Plan.of(planned, sampling, limits, request)
    generated = draw_scenarios(
        plan,
        checker_of(plan, sampling, limits, request).check,
        sampling,
        count=count,
        seed=planned.seed,
        request=request,
        callbacks=callbacks,
        measures=measures,
    )
    lanes = planned.road.lanes
    notes = lanes.notes if lanes is not None else ()
    mirrored = [note for note in notes if note.kind is NoteKind.MIRRORED]
    generated = replace(
        generated, adaptations=(*mirrored, *generated.adaptations), graph=plan.situation.reactions
    )
    return planned.with_scenarios(generated, plan.requested)


def checker_of(plan: Plan, sampling: SamplingConfig, limits: Limits, request: Request) -> Checker:
    """Return the checker for a request's scenarios.

    Raises:
        RefusedError: an order is to be swapped, and there is none.
    """
    edges = kept_reactions(plan.situation, sampling, request.order).edges
    checker = Checker.of_template(
        plan.situation, plan.road, plan.requested, plan.waits, limits, request.order, edges
    )
    return replace(checker, abreast=plan.abreast)
