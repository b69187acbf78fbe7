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

"""A segmented template on a road, and what comes of a request for it."""

from dataclasses import dataclass, field

from scenario_gen.config import PipelineConfig
from scenario_gen.fitting import FittingConfig
from scenario_gen.nearest import attempt, nearest_if_impossible
from scenario_gen.routing import PlanningConfig
from scenario_gen.sampling import SamplingConfig
from scenario_gen.types.encounter import Encounter
from scenario_gen.types.road import Road
from scenario_gen.types.segmentation import Segmentation
from scenario_gen.validity import Limits


@dataclass(frozen=True, eq=False)
class Given:
    encounter: Encounter
    segmentation: Segmentation
    road: Road
    seed: int
    fitting: FittingConfig = field(default_factory=FittingConfig)
    planning: PlanningConfig = field(default_factory=PlanningConfig)
    sampling: SamplingConfig = field(default_factory=lambda: SamplingConfig(variety="narrow"))  # all states are as given
    limits: Limits = field(default_factory=Limits)

    @property
    def config(self):
        return PipelineConfig(fitting=self.fitting, planning=self.planning, sampling=self.sampling, limits=self.limits)


def answer(given, request, *, count, cancelled=lambda: False):
    """Return what comes of a request; the nearest possible one is looked for where it cannot be had."""
    asked = (given.encounter, given.segmentation, given.road, given.config, request)
    request.ego_of(given.encounter)
    with nearest_if_impossible(*asked, count=count, seed=given.seed, cancelled=cancelled):
        return attempt(*asked, count=count, seed=given.seed, cancelled=cancelled)
