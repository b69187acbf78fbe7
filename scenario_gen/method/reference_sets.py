# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Reference sets: what `evaluation.compare` compares a result with."""

from collections.abc import Sequence
from dataclasses import replace

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.chain import Chain
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.evaluation import (
    MEASURED_SCENARIOS,
    uniform_changepoints,
    without_changepoints,
)
from scenario_gen.situation import Situation
from scenario_gen.types import Encounter, GenerationResult, ONE_DRIVER, Request, UNIFORM, WITHOUT


def with_references(
    result: GenerationResult,
    situation: Situation,
    config: PipelineConfig,
    request: Request = Request(),
    population: Sequence[Encounter] = (),
) -> GenerationResult:
    """Add sets without changepoints, with uniform ones, and with one driver.

    They have the parameters and the seed of the result. They keep no recorded waits, since the
    ends of a wait would be two more changepoints, and have no target and order; a result with one
    of these is not compared. A set has only as many scenarios as are measured.

    Raises:
        InputError: road or fit of the result are not known.
    """
    road, _ = result.road_and_fit()
    count = min(result.generated.requested, MEASURED_SCENARIOS)
    plain = Chain(
        situation,
        result.segmentation,
        road,
        config,
        request.plain,
        count,
        result.seed,
        population=population,
    )
    chains = {
        WITHOUT: replace(plain, segmentation=without_changepoints(result.segmentation), waits=())
    }
    if result.segmentation.changepoints.size:
        chains[UNIFORM] = replace(
            plain, segmentation=uniform_changepoints(result.segmentation), waits=()
        )
    if config.sampling.drivers > 0.0:
        one_driver = replace(config, sampling=replace(config.sampling, drivers=0.0))
        chains[ONE_DRIVER] = replace(plain, config=one_driver)
    references, refusals = {}, {}
    for name, chain in chains.items():
        try:
            references[name] = (
                chain.sample(result) if name == ONE_DRIVER else chain.run()
            ).generated
        except RefusedError as error:
            refusals[name] = str(error)
    requested = [
        name
        for name in ("target", "order")
        if getattr(request, name) != getattr(request.plain, name)
    ]
    not_compared = ""
    if requested:
        names = " and ".join(requested)
        not_compared = f"only the delivered set was drawn with {names} as requested"
    return replace(result, references=references, refusals=refusals, not_compared=not_compared)
