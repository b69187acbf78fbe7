# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The whole method on one screen: from an encounter and a road to valid, evaluated scenarios."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from scenario_gen.base.provenance import what_makes_it_again
from scenario_gen.method.arguments import (
    config_of,
    encounters_of,
    progress_of,
    request_of,
    seed_of,
    Templates,
    whole_number,
)
from scenario_gen.method.chain import AUTO, Generation
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.evaluation import coverage_of, evaluate, EvaluationConfig, replay
from scenario_gen.method.outcome_sets import for_one_set, outcome_sets, swapped_order
from scenario_gen.method.sampling import Callbacks, Progress
from scenario_gen.numerics.blas import one_blas_thread
from scenario_gen.types import (
    Coverage,
    Encounter,
    Evaluation,
    GenerationResult,
    Request,
    Road,
    Scenario,
)

__all__ = ["PipelineConfig", "generate", "generate_outcomes"]


def generate(
    encounter: Templates,
    road: Road | Path | str = AUTO,
    config: PipelineConfig | Mapping[str, Any] = PipelineConfig(),
    *,
    count: int = 50,
    seed: int | None = 0,
    request: Request | Mapping[str, Any] | str = Request(),
    progress: Progress | bool = False,
    accepts: Callable[[Road, Scenario], bool] = lambda *_: True,
) -> GenerationResult:
    """Segment, fit, plan, sample (every candidate is checked) and evaluate.

    Args:
        encounter: the template: an encounter, or a log with one encounter (a path, a DataFrame, or
            what `read_log` returns). Further encounters in a list show how encounters differ:
            scenarios that are usual among them are kept.
        road: the target: a road, a name or path for `build_road`, or "auto" (the default):
            the first built-in road that is suitable. A template is mirrored on a map with the
            other side of traffic.
        config: the parameters of every stage, or a mapping like a parameter file.
        count: valid scenarios wanted.
        seed: of all randomness; None draws one, which the result has.
        request: a vehicle to leave out for a planner under test, start and end states, a target,
            an order; a text is the target.
        progress: True prints it; a function takes scenarios so far, scenarios wanted, candidates
            so far.
        accepts: takes the road and a valid scenario of all vehicles; a scenario that it refuses is
            left out of the set.

    Raises:
        InputError: an argument cannot be used, or a vehicle of the request does not exist.
        RefusedError: the encounter is too large, it does not fit the road, there is no route, the
            request is impossible, or no candidate is valid; the message has the reason.

    Examples:
        >>> import scenario_gen as sg
        >>> encounter = sg.read_log("my_log.csv").encounters[0]
        >>> result = sg.generate(encounter, "four_way", count=5)
        >>> len(result)
        5
    """
    config, request, progress = config_of(config), request_of(request), progress_of(progress)
    count, seed = whole_number("count", count, 1), seed_of(seed)
    encounter, *population = encounters_of(encounter, config)
    generation = Generation(road, config, request, seed, population, Callbacks(progress), accepts)
    return _set_of(generation, encounter, count)


def _set_of(generation: Generation, encounter: Encounter, count: int) -> GenerationResult:
    """Return the scenarios of an encounter, or of one that swaps its order if that is asked."""
    if generation.request.order == "swap":
        swapped = swapped_order(encounter, generation.config.sampling)
        if swapped is not None:
            request = replace(generation.request, order="keep")
            generation, encounter = replace(generation, request=request), swapped
    with one_blas_thread():
        result = generation.run(encounter, count)
        return completed(result, generation.config, generation.request)


def _outcome_of(generation: Generation, encounter: Encounter, count: int) -> GenerationResult:
    """Return the scenarios of one outcome of an encounter."""
    sampling = for_one_set(generation.config.sampling, encounter)
    config = replace(generation.config, sampling=sampling)
    return _set_of(replace(generation, config=config), encounter, count)


def completed(
    result: GenerationResult,
    config: PipelineConfig,
    request: Request,
) -> GenerationResult:
    """Return a set of scenarios with its replay and provenance; it is evaluated when read."""
    road, fit = result.road_and_fit()
    return replace(
        result,
        replay=replay(result.encounter, fit, road.frame_id),
        figures=partial(_evaluated, config=config.evaluation),
        covered=_coverage,
        provenance=what_makes_it_again(config, request),
    )


def _evaluated(result: GenerationResult, config: EvaluationConfig) -> Evaluation:
    """Return the evaluation of a set."""
    with one_blas_thread():
        return evaluate(result, config)


def _coverage(result: GenerationResult) -> Coverage:
    """Return the coverage of a set."""
    with one_blas_thread():
        return coverage_of(result.encounter, result.generated.scenarios)


def generate_outcomes(
    encounter: Templates,
    road: Road | Path | str = AUTO,
    config: PipelineConfig | Mapping[str, Any] = PipelineConfig(),
    *,
    count: int = 50,
    seed: int | None = 0,
    request: Request | Mapping[str, Any] | str = Request(),
    progress: Progress | bool = False,
) -> list[GenerationResult]:
    """Generate one set for each outcome of the encounter's decision, the recorded one first.

    With `sampling.decisions=recorded` there is one set, that of `generate`.

    Args:
        encounter: the template and further encounters, as for `generate`.
        road: the target.
        config: the parameters of every stage; `sampling` has the law of decisions.
        count: valid scenarios wanted in all sets.
        seed: of all randomness.
        request: as for `generate`.
        progress: as for `generate`, for each set.

    Raises:
        InputError, RefusedError: as `generate`, for the recorded outcome.

    Examples:
        >>> import scenario_gen as sg
        >>> encounter = sg.read_log("my_log.csv").encounters[0]
        >>> config = sg.PipelineConfig(sampling=sg.SamplingConfig(decisions="drawn"))
        >>> sum(map(len, sg.generate_outcomes(encounter, "four_way", config)))
        50
    """
    config, request, progress = config_of(config), request_of(request), progress_of(progress)
    count, seed = whole_number("count", count, 1), seed_of(seed)
    encounter, *population = encounters_of(encounter, config)

    generation = Generation(road, config, request, seed, population, Callbacks(progress))
    generate_set = partial(_outcome_of, generation)
    return outcome_sets(generate_set, encounter, config.sampling, request, count, seed)
