# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The state of one vehicle ⇄ nav_msgs/Odometry.

The pose is in the header's frame, the twist in the vehicle's frame. Covariances are 0.

Speed: twist.linear.x, m/s; yaw rate: twist.angular.z, rad/s.
"""

import numpy as np

from msg_conventions.cdr import decode, encode
from msg_conventions.layouts import ODOMETRY
from msg_conventions.poses import pose_rows, poses_of
from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Floats

TYPE = "nav_msgs/msg/Odometry"


def encode_odometry(
    state: Floats, yaw_rate: float, child: str, frame_id: str, stamp_ns: int
) -> bytes:
    """Return a state (4,) x, y [m], yaw [rad], speed [m/s] and a yaw rate [rad/s] as CDR bytes."""
    pose, twist = pose_rows(state[None, :3]), (state[3], 0.0, 0.0, 0.0, 0.0, yaw_rate)
    return encode(ODOMETRY, stamp=stamp_ns, frame_id=frame_id, child=child, pose=pose, twist=twist)


def decode_odometry(
    data: bytes, source: str = "odom", *, framed: bool = False
) -> tuple[int, str, str, Floats]:
    """Return stamp [ns], frame, child frame and the state (5,) x, y, yaw, speed, yaw rate.

    Units: m, rad, m/s, rad/s.

    Args:
        data: CDR bytes.
        source: names the message in errors.
        framed: whether its frame must not be empty.

    Raises:
        InputError: the message is damaged, or a value is not finite.
    """
    message = decode(ODOMETRY, data, source, framed=framed)
    if not np.isfinite(message.twist).all():
        raise InputError(f"{source}: the twist holds a value that is not finite")
    state = np.append(poses_of(message.pose[None], source)[0], message.twist[[0, 5]])
    return message.stamp, message.frame_id, message.child, state
