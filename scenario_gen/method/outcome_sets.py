# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One set of scenarios for each outcome of a decision, with sizes drawn by probability."""

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.decisions import decided, Decisions, decisions_of
from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.types import (
    Decision,
    Encounter,
    ENDS,
    GenerationResult,
    Note,
    NoteKind,
    Outcome,
    Request,
    token,
)


def outcome_sets(
    generate: Callable[[Encounter, int], GenerationResult],
    encounter: Encounter,
    sampling: SamplingConfig,
    request: Request,
    count: int,
    seed: int,
) -> list[GenerationResult]:
    """Return one set for each outcome of an encounter's decision, the recorded one first.

    The scenarios of an outcome that is not possible on the road are drawn from the other ones.
    Every set has a note on the mix, and on outcomes that are not possible.

    Args:
        generate: returns so many scenarios from an encounter.
        encounter: a recorded encounter.
        sampling: has the law of decisions.
        request: of the scenarios.
        count: scenarios in all sets.
        seed: of the sizes.

    Raises:
        InputError, RefusedError: as `generate`, for the recorded outcome.
    """
    if sampling.decisions == "recorded":
        return [generate(encounter, count)]
    decisions = requested_decisions(encounter, sampling, request)
    if decisions.why:
        note = Note.of(NoteKind.NOTHING_DECIDED, reason=decisions.why)
        return [generate(encounter, count).noted(note)]
    *others, recorded = (*decisions.possible[1:], decisions.possible[0])
    sizes = np.array(drawn_sizes((*others, recorded), count, seed))
    results, notes = [], []
    for k, decision in enumerate(others, start=1):
        size = int(sizes[k - 1])
        if size == 0:
            continue
        try:
            results.append(generate(decided(encounter, decision), size))
        except RefusedError as error:
            notes.append(Note.of(NoteKind.OUTCOME_REFUSED, decision=decision, reason=str(error)))
            sizes[k:] += drawn_sizes((*others, recorded)[k:], size, seed)
    if sizes[-1]:
        results.insert(0, generate(decided(encounter, recorded), int(sizes[-1])))
    notes.append(Note.of(NoteKind.OUTCOMES, mix=outcome_mix(results)))
    if decisions.refused:
        notes.append(Note.of(NoteKind.OUTCOMES_MISSING, **missing_outcomes(decisions)))
    for note in notes:
        results = [result.noted(note) for result in results]
    return results


def for_one_set(sampling: SamplingConfig, encounter: Encounter) -> SamplingConfig:
    """Return the parameters of one set: of a recorded encounter no decisions are drawn.

    Those of an outcome stay as they are, so that its scenarios can be generated again.
    """
    return sampling if encounter.decision else replace(sampling, decisions="recorded")


def requested_decisions(
    encounter: Encounter, sampling: SamplingConfig, request: Request
) -> Decisions:
    """Return the decisions of an encounter that a request allows."""
    if request.order != "keep":
        return Decisions(why=f"order={request.order} is requested")
    decisions = decisions_of(encounter, sampling)
    named = {request.ego, *(name for end in ENDS for name in request.states(end))} - {""}
    for decision in decisions.possible[:1]:
        others = {token(name) for name in named} - {decision.who, decision.whom}
        if others:
            return Decisions(why=f"the requested vehicle {min(others)} does not take part in it")
    return decisions


def drawn_sizes(decisions: Sequence[Decision], count: int, seed: int) -> list[int]:
    """Return the sizes of the sets, drawn by the probabilities of the decisions."""
    shares = np.array([decision.probability for decision in decisions])
    sizes = np.random.default_rng(seed).multinomial(count, shares / shares.sum())
    return [int(size) for size in sizes]


def outcome_mix(results: Sequence[GenerationResult]) -> str:
    """Return how many scenarios have each outcome, and its probability, in words."""
    parts: list[str] = []
    for result in results:
        decision = result.encounter.decision
        if decision is not None:
            scenarios = "" if parts else " scenarios"
            share = f"probability {decision.probability:.2f}"
            parts.append(f"{decision.outcome} in {len(result)}{scenarios} ({share})")
            who = decision.who
    *others, last = parts
    mix = f"{', '.join(others)} and {last}" if others else last
    return f"vehicle {who} {mix}"


def missing_outcomes(decisions: Decisions) -> dict[str, object]:
    """Return the probability of outcomes that are not possible, and the reasons."""
    by_reason: defaultdict[str, float] = defaultdict(float)
    for decision, reason in decisions.refused:
        by_reason[reason] += decision.probability
    common = sorted(by_reason.items(), key=lambda item: -item[1])
    reasons = [f"{reason} ({share:.2f})" for reason, share in common]
    return {"probability": f"{sum(by_reason.values()):.2f}", "reasons": "; ".join(reasons)}


def swapped_order(encounter: Encounter, sampling: SamplingConfig) -> Encounter | None:
    """Return the encounter with the likeliest decision that swaps the order; None without one."""
    possible = decisions_of(encounter, sampling).possible
    first = [decision for decision in possible if decision.outcome is Outcome.GOES_FIRST]
    if not first:
        return None
    return decided(encounter, max(first, key=lambda decision: decision.probability))
