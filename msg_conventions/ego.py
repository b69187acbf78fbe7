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

"""The ego slot ⇄ `ego/start`, `ego/goal` (nav_msgs/Odometry) and `ego/track` (conventions: trajectory.py; one vehicle).

They belong to the request whose `scenarios/info` names the vehicle as its `ego`; being latched, they are those of the last such
request. Frame: the road's. Stamp: the template's, also for the goal (when it is reached stands in `ego/track`).
Odometry: `child_frame_id` is `vehicle_<id>`, `pose.pose` the centre of the footprint, z = 0, yaw as a quaternion,
`twist.twist.linear.x` the speed along the heading, m/s. Covariances and all else are 0. QoS: reliable, transient_local, depth 1.
`ego/track` is the vehicle's template along its planned route, on the template's clock, not a scenario's.
"""

from collections.abc import Iterator
import json

import numpy as np

from msg_conventions.cdr import CdrReader, CdrWriter
from msg_conventions.roads import pose_rows, poses_of
from msg_conventions.scenarios import encode_scenario
from scenario_gen.arrays import Floats
from scenario_gen.errors import InputError
from scenario_gen.types.names import token
from scenario_gen.types.scenario import Scenario

STATE_TYPE = "nav_msgs/msg/Odometry"
_COVARIANCE = 36


def encode_state(state: Floats, child_frame_id: str, frame_id: str, stamp_ns: int) -> bytes:
    """Return the state (4,) x [m], y [m], yaw [rad], speed [m/s] as CDR bytes.

    Raises:
        InputError: a value is not finite.
    """
    if not np.isfinite(state).all():
        raise InputError("a state with a value that is not finite cannot be sent")
    writer = CdrWriter().header(stamp_ns, frame_id).string(child_frame_id)
    writer.pack("d", *pose_rows(state[None, :3])[0], *[0.0] * _COVARIANCE)
    return writer.pack("d", float(state[3]), *[0.0] * (5 + _COVARIANCE)).finish()


def decode_state(data: bytes, what: str = "state") -> tuple[int, str, str, Floats]:
    """Return stamp [ns], frame, child frame and the state (4,).

    Raises:
        InputError: the message is damaged, or a value is not finite.
    """
    reader = CdrReader(data, what)
    stamp_ns, frame_id = reader.framed_header()
    child = reader.string()
    row = reader.floats(7 + _COVARIANCE)
    speed = float(reader.floats(6 + _COVARIANCE)[0])
    if not np.isfinite(speed):
        raise InputError(f"{what}: the speed is not finite")
    return stamp_ns, frame_id, child, np.append(poses_of(row[None, :7], what)[0], speed)


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
