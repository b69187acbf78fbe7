# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The whole method on one screen: an encounter and a road in, valid new scenarios and their evaluation out."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from scenario_gen.base.errors import RefusedError
from scenario_gen.base.provenance import what_makes_it_again
from scenario_gen.method.chain import Chain
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.evaluation import coverage_of, evaluate, replay
from scenario_gen.method.reference_sets import with_references
from scenario_gen.method.sampling import Callbacks, Progress
from scenario_gen.method.segmentation import segment
from scenario_gen.method.suitable_roads import AUTO, on_first_suitable_road
from scenario_gen.roads import road_and_template
from scenario_gen.situation import Situation
from scenario_gen.types import (
    causes_in_words,
    Encounter,
    GenerationResult,
    Note,
    NoteKind,
    Recombined,
    Request,
    Road,
    Scenario,
)

__all__ = ["PipelineConfig", "generate"]


def generate(
    encounter: Encounter | Sequence[Encounter],
    road: Road | str,
    config: PipelineConfig = PipelineConfig(),
    *,
    count: int = 50,
    seed: int = 0,
    request: Request = Request(),
    progress: Progress = lambda *_: None,
    accepts: Callable[[Road, Scenario], bool] = lambda *_: True,
) -> GenerationResult:
    """Segment, fit, plan, sample (every candidate is checked) and evaluate.

    Args:
        encounter: the template. In a list others follow it, which say how encounters differ: `sampling.variety=population` keeps
            what is usual among them.
        road: the target, of `build_road`, the name or path that this takes, or "auto": the first built-in road that suits. A
            template of right-hand traffic is mirrored on a map of left-hand traffic, and the other way round.
        config: the parameters of every stage; with `evaluation.compare` further sets are drawn to compare with.
        count: valid scenarios wanted.
        seed: of all randomness.
        request: a vehicle to be left out for a planner under test, start and end states, a target, a choice, an order.
        progress: called with scenarios so far, scenarios wanted, candidates so far.
        accepts: asked of each valid scenario of all vehicles on its road; one that it does not accept is left out of the set.

    Raises:
        InputError: a vehicle of the request does not exist.
        RefusedError: the encounter is too large, the template does not fit the road, there is no route, what the request asks
            cannot be had, or no candidate is valid; the message says why.
    """
    encounter, *population = [encounter] if isinstance(encounter, Encounter) else encounter
    if road == AUTO:
        again = partial(
            generate,
            config=config,
            count=count,
            seed=seed,
            request=request,
            progress=progress,
            accepts=accepts,
        )
        return on_first_suitable_road(
            partial(again, [encounter, *population]), encounter, config, seed
        )
    road, encounter = road_and_template(road, encounter, config.road)
    situation = Situation.of(encounter)
    segmentation = segment(encounter, config.segmentation, seed)
    chain = Chain(
        situation, segmentation, road, config, request, count, seed, population=population
    )
    planned = replace(chain.plan(), provenance=what_makes_it_again(config, request))
    result = chain.sample(planned, Callbacks(progress, accepts=partial(accepts, road)))
    if not result.generated.scenarios:
        causes = ", ".join(
            f"{count} × {cause}" for cause, count in causes_in_words(result.generated.refused)
        )
        notes = map(str, result.generated.adaptations)
        why = "; ".join((causes or "none was drawn", *notes))
        raise RefusedError(f"none of {result.generated.candidates} candidates is valid: {why}")
    if isinstance(encounter.source, Recombined):
        result = result.noted(Note.of(NoteKind.RECOMBINED, **vars(encounter.source)))
    if config.evaluation.compare:
        result = with_references(result, situation, config, request, population)
    result = replace(result, replay=replay(encounter, result.road_and_fit()[1], road.frame_id))
    coverage = coverage_of(encounter, result.generated.scenarios)
    return replace(result, evaluation=evaluate(result, config.evaluation), coverage=coverage)
