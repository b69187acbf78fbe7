# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The sampling stage: from a fitted and planned template to scenarios that are proven valid."""

from dataclasses import replace

from scenario_gen.base.errors import InputError
from scenario_gen.method.sampling.build_model import kept_reactions
from scenario_gen.method.sampling.config import SamplingConfig
from scenario_gen.method.sampling.draw import draw_scenarios
from scenario_gen.method.sampling.plan import Callbacks, Plan
from scenario_gen.method.validity import Checker, Limits
from scenario_gen.types import GenerationResult, Measures, NoteKind, Planned, Request


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
