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

"""The dividing line of a main road that is shaped to its template's bends."""

from scenario_gen.curve import Curve
from scenario_gen.errors import RefusedError
from scenario_gen.roads.config import RoadConfig
from scenario_gen.roads.shaped import bends, main_axis
from scenario_gen.template.frenet import main_line, to_frenet
from scenario_gen.template.tracks import Track


def bent_axis(name: str, tracks: tuple[Track, ...], config: RoadConfig) -> Curve | None:
    """The dividing line of the main road that `draw_bent` draws for a template; None if the road `name` is not drawn so."""
    try:
        main = main_line(to_frenet(tracks), tracks)
    except RefusedError:  # a junction's template
        return None
    return main_axis(name, main, config) if bends(name, main) else None
