# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The state of one vehicle ⇄ nav_msgs/Odometry: pose in the header's frame, twist in the vehicle's own; covariances are 0.

Speed: twist.linear.x, m/s; yaw rate: twist.angular.z, rad/s.
"""

import numpy as np

from msg_conventions.cdr import CdrReader, CdrWriter
from msg_conventions.poses import pose_rows, poses_of
from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Floats

TYPE = "nav_msgs/msg/Odometry"
_COVARIANCE = 36


def encode_odometry(state: Floats, yaw_rate: float, child: str, frame_id: str, stamp_ns: int) -> bytes:
    """Return a state (4,) of x [m], y [m], yaw [rad], speed [m/s] and the yaw rate [rad/s] as CDR bytes."""
    writer = CdrWriter().header(stamp_ns, frame_id).string(child)
    writer.pack("d", *pose_rows(state[None, :3])[0], *[0.0] * _COVARIANCE)
    return writer.pack("d", float(state[3]), 0.0, 0.0, 0.0, 0.0, yaw_rate, *[0.0] * _COVARIANCE).finish()


def decode_odometry(data: bytes, what: str = "odom", *, framed: bool = False) -> tuple[int, str, str, Floats]:
    """Return stamp [ns], frame, child frame and (5,) x [m], y [m], yaw [rad], speed [m/s], yaw rate [rad/s].

    Args:
        data: CDR bytes.
        what: names the message in errors.
        framed: its frame may not be empty.

    Raises:
        InputError: the message is damaged, or a value is not finite.
    """
    reader = CdrReader(data, what)
    stamp_ns, frame_id = reader.framed_header() if framed else reader.header()
    child = reader.string()
    row = reader.floats(7 + _COVARIANCE)
    twist = reader.floats(6 + _COVARIANCE)[:6]
    if not np.isfinite(twist).all():
        raise InputError(f"{what}: the twist holds a value that is not finite")
    return stamp_ns, frame_id, child, np.append(poses_of(row[None, :7], what)[0], (twist[0], twist[5]))
