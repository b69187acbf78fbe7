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

"""Occupancy grids, their entries and exits, and the readers of map formats."""

from scenario_gen.roads.build import build_road, road_and_template
from scenario_gen.roads.builtin import BUILT_IN
from scenario_gen.roads.config import RoadConfig
from scenario_gen.types.road import Road

__all__ = ["BUILT_IN", "Road", "RoadConfig", "build_road", "road_and_template"]
