# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The whole method on one screen: an encounter and a road in, valid new scenarios and their evaluation out."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.checked import sample_checked
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.evaluation import coverage_of, evaluate, MEASURED, replay, uniform_changepoints, without_changepoints
from scenario_gen.method.nearest import attempt, nearest_if_impossible, plan
from scenario_gen.method.sampling import Progress
from scenario_gen.method.segmentation import segment
from scenario_gen.roads import road_and_template
from scenario_gen.template.size import refuse_too_large
from scenario_gen.types.encounter import Encounter
from scenario_gen.types.generation import GenerationResult, NARROW, UNIFORM, WITHOUT
from scenario_gen.types.request import Request
from scenario_gen.types.road import Road
from scenario_gen.types.scenario import ScenarioSet
from scenario_gen.types.segmentation import Segmentation

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
        road: the target, of `build_road`, or the name or path that this takes; a template of right-hand traffic is mirrored on
            a map of left-hand traffic, and the other way round.
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
        road, encounter = road_and_template(road, encounter, config.road)
    segmentation = segment(encounter, config.segmentation, seed)
    with nearest_if_impossible(encounter, segmentation, road, config, request, count=count, seed=seed):
        planned = plan(encounter, segmentation, road, config, request, seed)
        made = sample_checked(planned, config.sampling, config.limits, request, count=count, progress=progress)
    return with_evaluation(with_references(made, config, request), config)


def with_references(
    made: GenerationResult,
    config: PipelineConfig,
    request: Request = Request(),
) -> GenerationResult:
    """Add what a result is measured against: sets without changepoints and, if `evaluation.uniform`, with uniform ones.

    They are drawn as the result is, with the same parameters and seed; beside preset `wide` there is a set of `narrow`, too.
    A reference knows of the template what its own changepoints tell, so no wait is asked of it: a wait whose ends were known
    besides would be two more of them. Nor is a target, a choice or another order, and what has one is not compared. Of a
    reference no more scenarios are made than are measured.
    """
    road, fit = made.placed()
    plain, seed, few = request.plain, made.seed, min(made.generated.requested, MEASURED)

    def narrow() -> ScenarioSet:
        sampling = replace(config.sampling, variety="narrow")
        return sample_checked(made, sampling, config.limits, plain, count=few).generated

    def with_changepoints(segmentation: Segmentation) -> ScenarioSet:
        return attempt(made.encounter, segmentation, road, config, plain, count=few, seed=seed, waits=()).generated

    rows: dict[str, Callable[[], ScenarioSet]] = {WITHOUT: partial(with_changepoints, without_changepoints(made.segmentation))}
    if config.evaluation.uniform and made.segmentation.changepoints.size:
        rows[UNIFORM] = partial(with_changepoints, uniform_changepoints(made.segmentation))
    if config.sampling.variety == "wide":
        rows[NARROW] = narrow
    references, refusals = {}, {}
    for name, make in rows.items():
        try:
            references[name] = make()
        except RefusedError as error:
            refusals[name] = str(error)
    oracle = replay(made.encounter, fit, road.frame_id)
    asked = [name for name in ("target", "choose", "order") if getattr(request, name) != getattr(plain, name)]
    apart = f"only the delivered set was drawn with {' and '.join(asked)} as asked" if asked else ""
    return replace(made, references=references, refusals=refusals, oracle=oracle, apart=apart)


def with_evaluation(made: GenerationResult, config: PipelineConfig) -> GenerationResult:
    """Add the evaluation of all sets of a result, and of the fitted template replayed (the oracle row), and its coverage."""
    coverage = coverage_of(made.encounter, made.generated.scenarios)
    return replace(made, evaluation=evaluate(made, config.evaluation), coverage=coverage)
