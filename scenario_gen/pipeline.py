# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The whole method on one screen: an encounter and a road in, valid new scenarios and their evaluation out."""

from collections.abc import Callable
from dataclasses import replace

from scenario_gen.base.provenance import what_makes_it_again
from scenario_gen.method.attempt import with_references
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.evaluation import coverage_of, evaluate, MEASURES
from scenario_gen.method.fitting import fit_template
from scenario_gen.method.nearest import suggest_nearest
from scenario_gen.method.routing import plan_routes
from scenario_gen.method.sampling import Callbacks, Progress, sample_scenarios
from scenario_gen.method.segmentation import segment
from scenario_gen.roads import road_and_template
from scenario_gen.types import Encounter, GenerationResult, Request, Road

__all__ = ["PipelineConfig", "generate"]


@suggest_nearest
def generate(
    encounter: Encounter,
    road: Road | str,
    config: PipelineConfig = PipelineConfig(),
    *,
    count: int = 50,
    seed: int = 0,
    request: Request = Request(),
    progress: Progress = lambda *_: None,
    select: Callable[[GenerationResult], GenerationResult] = lambda sampled: sampled,
) -> GenerationResult:
    """Segment, fit, plan, sample (every candidate is checked) and evaluate.

    Args:
        encounter: the template.
        road: the target, of `build_road`, the name or path that this takes, or "auto": the first built-in road that suits. A
            template of right-hand traffic is mirrored on a map of left-hand traffic, and the other way round.
        config: the parameters of every stage.
        count: valid scenarios wanted.
        seed: of all randomness.
        request: a vehicle to be left out for a planner under test, start and end states, a target, a choice, an order.
        progress: called with scenarios so far, scenarios wanted, candidates so far.
        select: leaves out some of the `count` valid scenarios before the set is evaluated.

    Raises:
        InputError: a vehicle of the request does not exist.
        RefusedError: the encounter is too large, the template does not fit the road, there is no way, or what the request
            asks cannot be had; the message says why, and what nearby can.
    """
    road, encounter = road_and_template(road, encounter, config.road)
    segmentation = segment(encounter, config.segmentation, seed)
    fit = fit_template(encounter, segmentation, road, config.fitting, request=request, max_speed=config.sampling.max_speed)
    routes = plan_routes(road, fit, config.planning, seed)
    again = what_makes_it_again(config, request)
    planned = GenerationResult(encounter, segmentation, road, fit, routes, seed=seed, provenance=again)
    sampled = sample_scenarios(
        planned, config.sampling, config.limits, request, count=count, callbacks=Callbacks(progress), measures=MEASURES
    )
    result = with_references(select(sampled), config, request)
    coverage = coverage_of(encounter, result.generated.scenarios)
    return replace(result, evaluation=evaluate(result, config.evaluation), coverage=coverage)
