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

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from scenario_gen.encounter import Encounter
from scenario_gen.errors import RefusedError
from scenario_gen.evaluation import (
    Case,
    CheckCounts,
    evaluate,
    EvaluationConfig,
    MEASURED,
    ORACLE,
    replay,
    UNIFORM,
    uniform_changepoints,
    WITH,
    WITHOUT,
)
from scenario_gen.fitting import Fit, FittingConfig
from scenario_gen.logs import LogConfig
from scenario_gen.planning import PlanningConfig, Route
from scenario_gen.requests import Chain, refuse_too_large, Request, run_request
from scenario_gen.roads import build_road, Road, RoadConfig
from scenario_gen.sampling import SamplingConfig
from scenario_gen.scenario import ScenarioSet
from scenario_gen.segmentation import segment, Segmentation, SegmentationConfig
from scenario_gen.storage import BagConfig
from scenario_gen.validity import Limits

Progress = Callable[[int, int, int], None]


@dataclass(frozen=True)
class PipelineConfig:
    """The parameters of every stage."""

    log: LogConfig = field(default_factory=LogConfig)
    segmentation: SegmentationConfig = field(default_factory=SegmentationConfig)
    road: RoadConfig = field(default_factory=RoadConfig)
    fitting: FittingConfig = field(default_factory=FittingConfig)
    planning: PlanningConfig = field(default_factory=PlanningConfig)
    sampling: SamplingConfig = field(default_factory=SamplingConfig)
    limits: Limits = field(default_factory=Limits)
    evaluation: EvaluationConfig = field(default_factory=EvaluationConfig)
    bag: BagConfig = field(default_factory=BagConfig)


@dataclass(frozen=True, eq=False)
class Arm:
    """What the chain made of one set of changepoints."""

    segmentation: Segmentation
    fit: Fit
    routes: tuple[Route, ...]
    scenarios: ScenarioSet


def generate(
    encounter: Encounter,
    road_name: str,
    config: PipelineConfig,
    *,
    count: int,
    seed: int,
    request: Request = Request(),  # noqa: B008 - frozen
    progress: Progress | None = None,
) -> Case:
    """Segment, fit, plan, sample, check and evaluate.

    Raises:
        InputError: the road cannot be read, or a vehicle of the request does not exist.
        RefusedError: the encounter is too large, the template does not fit the road, there is no way, or what the request
            asks cannot be had; the message says why, and what nearby can.
    """
    refuse_too_large(encounter)
    request.ego_of(encounter)
    road = build_road(road_name, encounter, config.road)
    segmentation = segment(encounter, config.segmentation, seed)
    arm = run_arm(encounter, segmentation, road, config, count=count, seed=seed, request=request, progress=progress)
    return with_ablation(encounter, road, arm, config, count=count, seed=seed, request=request)


def run_arm(
    encounter: Encounter,
    segmentation: Segmentation,
    road: Road,
    config: PipelineConfig,
    *,
    count: int,
    seed: int,
    request: Request = Request(),  # noqa: B008 - frozen
    progress: Progress | None = None,
    reference: bool = False,
) -> Arm:
    """Fit the changepoints to the road, plan between them, sample and check.

    A `reference`, which the segmenter's changepoints are measured against, knows of the template what its own changepoints
    tell: a wait whose ends were known besides would be two more of them.
    """
    stages = (config.fitting, config.planning, config.sampling, config.limits)
    chain = Chain(encounter, segmentation, road, seed, *stages, holds_waits=not reference)
    outcome = run_request(chain, request, count=count, progress=progress, suggest=not reference)
    return Arm(segmentation, outcome.fit, outcome.routes, outcome.scenarios)


def without_changepoints(segmentation: Segmentation) -> Segmentation:
    """Return the ablation of paper V-B: the same encounter as one primitive."""
    return replace(
        segmentation,
        labels=np.zeros_like(segmentation.labels),
        changepoints=np.zeros(0, dtype=np.int64),
        descriptions=("the whole encounter as one primitive",),
    )


def with_ablation(
    encounter: Encounter,
    road: Road,
    arm: Arm,
    config: PipelineConfig,
    *,
    count: int,
    seed: int,
    request: Request = Request(),  # noqa: B008 - frozen
) -> Case:
    """Run the chain again without changepoints and, unless `evaluation.uniform` is off, with uniform ones; evaluate all.

    Beside them stands the fitted template (the oracle row). Of these references no more are made than are measured.
    """
    others = {WITHOUT: without_changepoints(arm.segmentation)}
    if config.evaluation.uniform and arm.segmentation.changepoints.size:
        others[UNIFORM] = uniform_changepoints(arm.segmentation)
    arms, refused = {WITH: arm}, {}
    for name, segmentation in others.items():
        try:
            few = min(count, MEASURED)
            arms[name] = run_arm(encounter, segmentation, road, config, count=few, seed=seed, request=request, reference=True)
        except RefusedError as error:
            refused[name] = str(error)
    made = {name: one.scenarios for name, one in arms.items()}
    oracle = replay(encounter, arm.fit, road.frame_id)
    evaluation = evaluate(
        encounter,
        arm.segmentation,
        {name: one.scenarios for name, one in made.items()} | {ORACLE: (oracle,)},
        checks={name: CheckCounts.of_set(one) for name, one in made.items()},
        oracle=ORACLE,
        road=road.name,
        config=config.evaluation,
        seed=seed,
    )
    return Case(
        encounter=encounter,
        segmentation=arm.segmentation,
        road=road,
        fit=arm.fit,
        routes=arm.routes,
        with_changepoints=arm.scenarios,
        without_changepoints=made.get(WITHOUT),
        evaluation=evaluation,
        oracle=oracle,
        without_refused=refused.get(WITHOUT, ""),
        uniform=made.get(UNIFORM),
        uniform_refused=refused.get(UNIFORM, ""),
    )
