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

"""A vehicle's state ⇄ nav_msgs/Odometry: `ego/start`, `ego/goal`.

Frame: the road's. Stamp: the template's, also for the goal (what derives from a template repeats its stamp; when the goal is
reached stands in `ego/track`). `child_frame_id`: `vehicle_<id>`. `pose.pose`: centre of the footprint, z = 0, yaw as a
quaternion. `twist.twist.linear.x`: speed along the heading, m/s. Covariances and all else are 0.
QoS: reliable, transient_local, depth 1.
"""

import numpy as np

from msg_conventions.cdr import CdrReader, CdrWriter
from msg_conventions.roads import pose_rows, poses_of
from scenario_gen.arrays import Floats
from scenario_gen.errors import InputError

TYPE = "nav_msgs/msg/Odometry"
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
