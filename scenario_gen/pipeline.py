# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The whole method on one screen: an encounter and a road in, valid new scenarios and their evaluation out."""

from dataclasses import replace

from scenario_gen.config import PipelineConfig
from scenario_gen.errors import RefusedError
from scenario_gen.evaluation import coverage_of, evaluate, MEASURED, MEASURES, replay, uniform_changepoints, without_changepoints
from scenario_gen.fitting import fit_template
from scenario_gen.nearest import attempt, nearest_if_impossible
from scenario_gen.roads import build_road
from scenario_gen.routing import plan_routes
from scenario_gen.sampling import freed_states, Progress, sample_scenarios
from scenario_gen.segmentation import segment
from scenario_gen.template.interaction import waits_to_keep
from scenario_gen.template.size import refuse_too_large
from scenario_gen.types.encounter import Encounter
from scenario_gen.types.generation import GenerationResult, NARROW, UNIFORM, WITHOUT
from scenario_gen.types.request import Request
from scenario_gen.types.road import Road
from scenario_gen.validity import Checker

__all__ = ["PipelineConfig", "generate", "with_evaluation", "with_references"]


def generate(
    encounter: Encounter,
    road: Road | str,
    config: PipelineConfig = PipelineConfig(),
    *,
    count: int = 50,
    seed: int = 0,
    request: Request = Request(),
    progress: Progress = lambda *_: None,
) -> GenerationResult:
    """Segment, fit, plan, sample (every candidate is checked) and evaluate.

    Args:
        encounter: the template.
        road: the target, of `build_road`, or the name or path that this takes.
        config: the parameters of every stage.
        count: valid scenarios wanted.
        seed: of all randomness.
        request: a vehicle to be left out for a planner under test, start and end states, a target, a choice, an order.
        progress: called with scenarios so far, scenarios wanted, candidates so far.

    Raises:
        InputError: a vehicle of the request does not exist.
        RefusedError: the encounter is too large, the template does not fit the road, there is no way, or what the request
            asks cannot be had; the message says why, and what nearby can.
    """
    refuse_too_large(encounter)
    request.ego_of(encounter)  # refused at once if there is no such vehicle
    if isinstance(road, str):
        road = build_road(road, encounter, config.road)
    segmentation = segment(encounter, config.segmentation, seed)
    with nearest_if_impossible(encounter, segmentation, road, config, request, count=count, seed=seed):
        fit = fit_template(encounter, segmentation, road, config.fitting, request=request, max_speed=config.sampling.max_speed)
        routes = plan_routes(road, fit, config.planning, seed)
        waits = waits_to_keep(encounter, segmentation)
        fit = replace(fit, asked=freed_states(fit.asked, encounter, config.sampling, request))
        check = Checker.of_template(encounter, road, fit.asked, waits, config.limits, request.order).check
        generated = sample_scenarios(
            encounter, segmentation, road, routes, fit.asked, check, config.sampling,
            count=count, seed=seed, waits=waits, request=request, progress=progress, measures=MEASURES,
        )  # fmt: skip
    made = GenerationResult(encounter, segmentation, road, fit, routes, generated, seed)
    return with_evaluation(with_references(made, config, request), config)


def with_references(
    made: GenerationResult,
    config: PipelineConfig,
    request: Request = Request(),
) -> GenerationResult:
    """Add what a result is measured against: sets without changepoints and, if `evaluation.uniform`, with uniform ones.

    A reference knows of the template what its own changepoints tell, so no wait is asked of it: a wait whose ends were known
    besides would be two more of them. Nor is a target, a choice or another order. Of a reference no more scenarios
    are made than are measured.
    """
    road, fit = made.placed()
    plain = request.plain
    others = {WITHOUT: without_changepoints(made.segmentation)}
    if config.sampling.variety == "wide":
        others[NARROW] = made.segmentation
        config = replace(config, sampling=replace(config.sampling, variety="narrow"))
    if config.evaluation.uniform and made.segmentation.changepoints.size:
        others[UNIFORM] = uniform_changepoints(made.segmentation)
    references, refusals = {}, {}
    few = min(made.generated.requested, MEASURED)
    for name, segmentation in others.items():
        try:
            references[name] = attempt(
                made.encounter,
                segmentation,
                road,
                config,
                plain,
                count=few,
                seed=made.seed,
                waits=None if name == NARROW else (),
            ).generated
        except RefusedError as error:
            refusals[name] = str(error)
    oracle = replay(made.encounter, fit, road.frame_id)
    return replace(made, references=references, refusals=refusals, oracle=oracle)


def with_evaluation(made: GenerationResult, config: PipelineConfig) -> GenerationResult:
    """Add the evaluation of all sets of a result, and of the fitted template replayed (the oracle row), and its coverage."""
    coverage = coverage_of(made.encounter, made.generated.scenarios)
    return replace(made, evaluation=evaluate(made, config.evaluation), coverage=coverage)
