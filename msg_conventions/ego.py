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

"""The ego slot on the wire: `ego/start`, `ego/goal` (odometry.py) and `ego/track` (trajectory.py, one vehicle).

They belong to the request whose `scenarios/info` names the vehicle as its `ego`; being latched, they are those of the last such
request. `ego/track` is the vehicle's template along its planned route, on the template's clock, not a scenario's.
"""

from collections.abc import Iterator
import json

import numpy as np

from msg_conventions.names import token
from msg_conventions.odometry import encode_state
from msg_conventions.scenarios import encode_scenario
from scenario_gen.arrays import Floats
from scenario_gen.scenario import Scenario


def end_states(track: Scenario) -> tuple[Floats, Floats]:
    """Return start and goal (4,) x, y, yaw, speed of an ego's track."""
    first, last = (np.array([*track.position[0, k], track.heading[0, k], track.speed[0, k]]) for k in (0, -1))
    return first, last


def ego_messages(track: Scenario, stamp_ns: int) -> Iterator[tuple[str, bytes]]:
    """Yield topic and CDR bytes of the ego's start, goal and template track."""
    child = f"vehicle_{token(track.vehicles[0].id)}"
    for topic, state in zip(("ego/start", "ego/goal"), end_states(track), strict=True):
        yield topic, encode_state(state, child, track.frame_id, stamp_ns)
    yield "ego/track", encode_scenario(track, stamp_ns)


def ego_values(track: Scenario | None) -> dict[str, str]:
    """Return what `scenarios/info` says of the ego: its id, start and goal; nothing if there is none."""
    if track is None:
        return {}
    start, goal = (json.dumps([float(value) for value in state]) for state in end_states(track))
    return {"ego": token(track.vehicles[0].id), "ego_start": start, "ego_goal": goal}
