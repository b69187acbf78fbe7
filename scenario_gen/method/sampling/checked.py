# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The stage: a template that was fitted and planned, in; scenarios that the checker proved valid, out."""

from dataclasses import replace

from scenario_gen.method.sampling.config import SamplingConfig
from scenario_gen.method.sampling.freedom import relaxed_states
from scenario_gen.method.sampling.plan import Callbacks, Plan
from scenario_gen.method.sampling.prepare import kept_reactions
from scenario_gen.method.sampling.sample import draw_scenarios
from scenario_gen.method.validity import Checker, Limits
from scenario_gen.situation import Situation, Wait
from scenario_gen.types import (
    GenerationResult,
    Measures,
    NoteKind,
    Request,
    TypeLimits,
)


def sample_scenarios(
    planned: GenerationResult,
    sampling: SamplingConfig = SamplingConfig(),
    limits: Limits = Limits(),
    request: Request = Request(),
    *,
    count: int,
    waits: tuple[Wait, ...] | None = None,
    situation: Situation | None = None,
    callbacks: Callbacks = Callbacks(),
    measures: Measures | None = None,
) -> GenerationResult:
    """Add scenarios to a template that was fitted and planned; every candidate is checked (paper III-C).

    Args:
        planned: with road, fit, routes and seed.
        sampling: the sampler's parameters.
        limits: of motion, and the checker's.
        request: what is requested.
        count: valid scenarios wanted.
        waits: that are kept; the template's unless given.
        situation: of the template, if it is known.
        callbacks: called on progress and with valid scenarios.
        measures: what measures a scenario for a target or a choice.

    Raises:
        InputError: road or fit are not known.
        RefusedError: as `draw_scenarios`.
    """
    plan = plan_of(planned, sampling, limits, request, waits, situation)
    check = checker_of(plan, sampling, limits, request).check
    drawn = draw_scenarios(
        plan,
        check,
        sampling,
        count=count,
        seed=planned.seed,
        request=request,
        callbacks=callbacks,
        measures=measures,
    )
    road, fit = planned.road_and_fit()
    mirrored = [
        note
        for note in (road.lanes.notes if road.lanes is not None else ())
        if note.kind is NoteKind.MIRRORED
    ]
    drawn = replace(
        drawn, adaptations=(*mirrored, *drawn.adaptations), graph=plan.situation.reactions
    )
    return replace(planned, fit=replace(fit, requested=plan.requested), generated=drawn)


def plan_of(
    planned: GenerationResult,
    sampling: SamplingConfig,
    limits: TypeLimits,
    request: Request,
    waits: tuple[Wait, ...] | None = None,
    situation: Situation | None = None,
) -> Plan:
    """Return what the scenarios of a request are drawn from: with preset `wide` the states leave the template's where they may.

    Raises:
        InputError: road or fit are not known.
    """
    situation = situation or Situation.of(planned.encounter)
    segmentation, (road, fit) = planned.segmentation, planned.road_and_fit()
    states = relaxed_states(fit.requested, situation, sampling, request)
    waits = situation.waits_to_keep(segmentation) if waits is None else waits
    return Plan(situation, segmentation, road, planned.routes, states, waits, limits)


def checker_of(plan: Plan, sampling: SamplingConfig, limits: Limits, request: Request) -> Checker:
    """Return the checker of a request's scenarios: of road, states, waits, limits, order and reactions.

    Raises:
        RefusedError: an order is to be swapped, and there is none.
    """
    edges = kept_reactions(plan.situation, sampling, request.order).edges
    return Checker.of_template(
        plan.situation, plan.road, plan.requested, plan.waits, limits, request.order, edges
    )
