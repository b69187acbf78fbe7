# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One set of scenarios for each outcome of a decision, with sizes drawn by probability."""

from collections import Counter
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

    The scenarios of an outcome that is not possible on the road get the recorded one. Every set
    has a note on the mix.

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
    recorded, *others = decisions.possible
    _, *sizes = drawn_sizes(decisions.possible, count, seed)
    results, notes = [], []
    for decision, size in zip(others, sizes, strict=True):
        if size == 0:
            continue
        try:
            results.append(generate(decided(encounter, decision), size))
        except RefusedError as error:
            notes.append(Note.of(NoteKind.OUTCOME_REFUSED, decision=decision, reason=error))
    left = count - sum(result.generated.requested for result in results)
    if left:
        results.insert(0, generate(decided(encounter, recorded), left))
    notes.append(Note.of(NoteKind.OUTCOMES, mix=outcome_mix(results)))
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
    """Return how many scenarios have each outcome, in words."""
    sizes: Counter[Outcome] = Counter()
    who = ""
    for result in results:
        decision = result.encounter.decision
        if decision is not None:
            who = decision.who
            sizes[decision.outcome] += len(result)
    parts = [f"{outcome} in {size}" for outcome, size in sizes.items()]
    parts[0] += " scenarios"
    *others, last = parts
    mix = f"{', '.join(others)} and {last}" if others else last
    return f"vehicle {who} {mix}"


def swapped_order(encounter: Encounter, sampling: SamplingConfig) -> Encounter | None:
    """Return the encounter with the likeliest decision that swaps the order; None without one."""
    possible = decisions_of(encounter, sampling).possible
    first = [decision for decision in possible if decision.outcome is Outcome.GOES_FIRST]
    if not first:
        return None
    return decided(encounter, max(first, key=lambda decision: decision.probability))
