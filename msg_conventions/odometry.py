# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The state of one vehicle ⇄ nav_msgs/Odometry: pose in the header's frame, twist in the vehicle's own; covariances are 0.

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
    """Return a state (4,) of x [m], y [m], yaw [rad], speed [m/s] and the yaw rate [rad/s] as CDR bytes."""
    pose, twist = pose_rows(state[None, :3]), (state[3], 0.0, 0.0, 0.0, 0.0, yaw_rate)
    return encode(ODOMETRY, stamp=stamp_ns, frame_id=frame_id, child=child, pose=pose, twist=twist)


def decode_odometry(
    data: bytes, what: str = "odom", *, framed: bool = False
) -> tuple[int, str, str, Floats]:
    """Return stamp [ns], frame, child frame and (5,) x [m], y [m], yaw [rad], speed [m/s], yaw rate [rad/s].

    Args:
        data: CDR bytes.
        what: names the message in errors.
        framed: its frame may not be empty.

    Raises:
        InputError: the message is damaged, or a value is not finite.
    """
    found = decode(ODOMETRY, data, what, framed=framed)
    if not np.isfinite(found.twist).all():
        raise InputError(f"{what}: the twist holds a value that is not finite")
    state = np.append(poses_of(found.pose[None], what)[0], found.twist[[0, 5]])
    return found.stamp, found.frame_id, found.child, state
