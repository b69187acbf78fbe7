# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Sampling with every candidate checked, as every request does it: what is freed, the checker, the sampler and the measures."""

from dataclasses import replace

from scenario_gen.method.evaluation.measures import MEASURES
from scenario_gen.method.sampling import (
    Cancelled,
    freed_states,
    kept_reactions,
    OnValid,
    Progress,
    sample_scenarios,
    SamplingConfig,
)
from scenario_gen.method.validity import Checker, Limits
from scenario_gen.template.interaction import Wait, waits_to_keep
from scenario_gen.template.reactions import reactions_of
from scenario_gen.types.generation import GenerationResult
from scenario_gen.types.lanes import MIRRORED
from scenario_gen.types.request import Request


def sample_checked(
    planned: GenerationResult,
    sampling: SamplingConfig,
    limits: Limits,
    request: Request,
    *,
    count: int,
    waits: tuple[Wait, ...] | None = None,
    progress: Progress = lambda *_: None,
    cancelled: Cancelled = lambda: False,
    found: OnValid = lambda *_: None,
) -> GenerationResult:
    """Add scenarios to a template that was fitted and planned.

    Args:
        planned: with road, fit, routes and seed.
        sampling: the sampler's parameters.
        limits: the checker's.
        request: what is asked for.
        count: valid scenarios wanted.
        waits: that are kept; the template's unless given.
        progress: as `sample_scenarios` takes it.
        cancelled: likewise.
        found: likewise.

    Raises:
        InputError: road or fit are not known.
        RefusedError: as `sample_scenarios`.
    """
    encounter, (road, fit) = planned.encounter, planned.placed()
    waits = waits_to_keep(encounter, planned.segmentation) if waits is None else waits
    fit = replace(fit, asked=freed_states(fit.asked, encounter, sampling, request))
    graph = kept_reactions(encounter, sampling, request.order)
    edges = graph.edges if graph is not None else ()
    check = Checker.of_template(encounter, road, fit.asked, waits, limits, request.order, edges).check
    generated = sample_scenarios(
        encounter, planned.segmentation, road, planned.routes, fit.asked, check, sampling, count=count, seed=planned.seed,
        waits=waits, request=request, progress=progress, cancelled=cancelled, found=found, measures=MEASURES,
    )  # fmt: skip
    turned = [note for note in (road.lanes.notes if road.lanes is not None else ()) if note.startswith(MIRRORED)]
    said = (*turned, *generated.adaptations)
    return replace(planned, fit=fit, generated=replace(generated, adaptations=said, graph=reactions_of(encounter)))
