# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The sets that a result is compared with, drawn by the same chain; `evaluation.compare` requests them."""

from collections.abc import Sequence
from dataclasses import replace

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.chain import Chain
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.evaluation import MEASURED, uniform_changepoints, without_changepoints
from scenario_gen.situation import Situation
from scenario_gen.types import Encounter, GenerationResult, NARROW, Request, UNIFORM, WITHOUT


def with_references(
    result: GenerationResult,
    situation: Situation,
    config: PipelineConfig,
    request: Request = Request(),
    population: Sequence[Encounter] = (),
) -> GenerationResult:
    """Add what a result is measured against: sets without changepoints and with uniform ones.

    They are drawn as the result is, with the same parameters and seed; beside any preset but `narrow` there is a set of that.
    A reference keeps no waits of the template: the ends of a wait would be two more changepoints. It has no target or
    order either, and a result that has one is not compared. A reference has only as many scenarios as are measured.

    Raises:
        InputError: road or fit of the result are not known.
    """
    road, _ = result.road_and_fit()
    count = min(result.generated.requested, MEASURED)
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
    if config.sampling.variety != "narrow":
        narrow = replace(config, sampling=replace(config.sampling, variety="narrow"))
        chains[NARROW] = replace(plain, config=narrow)
    references, refusals = {}, {}
    for name, chain in chains.items():
        try:
            references[name] = (chain.sample(result) if name == NARROW else chain.run()).generated
        except RefusedError as error:
            refusals[name] = str(error)
    requested = [
        name
        for name in ("target", "order")
        if getattr(request, name) != getattr(request.plain, name)
    ]
    not_compared = (
        f"only the delivered set was drawn with {' and '.join(requested)} as requested"
        if requested
        else ""
    )
    return replace(result, references=references, refusals=refusals, not_compared=not_compared)
