# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The parameters of every stage."""

from dataclasses import dataclass, field

from scenario_gen.bags.storage.config import BagConfig
from scenario_gen.logs import LogConfig
from scenario_gen.method.evaluation import EvaluationConfig
from scenario_gen.method.fitting import FittingConfig
from scenario_gen.method.routing import PlanningConfig
from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.method.segmentation import SegmentationConfig
from scenario_gen.method.validity import Limits
from scenario_gen.roads import RoadConfig


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
