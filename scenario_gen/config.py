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

"""The parameters of every stage."""

from dataclasses import dataclass, field

from scenario_gen.evaluation import EvaluationConfig
from scenario_gen.fitting import FittingConfig
from scenario_gen.logs import LogConfig
from scenario_gen.roads import RoadConfig
from scenario_gen.routing import PlanningConfig
from scenario_gen.sampling import SamplingConfig
from scenario_gen.segmentation import SegmentationConfig
from scenario_gen.storage.config import BagConfig
from scenario_gen.validity import Limits


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
