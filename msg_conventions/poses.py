# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Poses in the plane ⇄ geometry_msgs/Pose, nav_msgs/Odometry and tf2_msgs/TFMessage.

A heading is the quaternion (0, 0, sin(yaw/2), cos(yaw/2)), and is the same number when it is read.

Odometry: the pose is in the header's frame, the twist in the vehicle's frame. Speed:
twist.linear.x, m/s; yaw rate: twist.angular.z, rad/s. Covariances are 0.

`/tf` has the vehicles of a scenario in motion. Parent: the road's frame. Child: `vehicle_<id>`, at
the footprint's centre, x ahead. QoS: reliable, volatile, depth 100.
"""

from collections.abc import Sequence

import numpy as np

from msg_conventions.cdr import decode, encode
from msg_conventions.layouts import ODOMETRY, TRANSFORMS
from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Floats

ODOMETRY_TYPE = "nav_msgs/msg/Odometry"
FRAMES_TYPE = "tf2_msgs/msg/TFMessage"
MAX_COORDINATE_M = 1e8  # more than any geodetic grid has
TWO_PI = 2.0 * np.pi
MIN_LENGTH_RATIO = 0.5  # of a quaternion, whose length should be 1
MAX_COMPONENT_RATIO = 2.0


def half_angle(heading: Floats) -> tuple[Floats, Floats]:
    """Return z and w of the quaternions of canonical headings [rad], any shape.

    They are the sine and cosine of half the heading.

    A canonical angle is a multiple of a nanoradian plus full turns, and is not near ±pi, so that
    removing the turns is exact enough.
    """
    if heading.size and max(heading.max(), -heading.min()) > np.pi:
        heading = heading - TWO_PI * np.rint(heading / TWO_PI)
    half = 0.5 * heading
    return np.sin(half), np.cos(half)


def quaternion(heading: Floats) -> Floats:
    """Return (..., 4) x, y, z, w of canonical headings [rad]; w >= 0 up to rounding."""
    result = np.zeros((*np.shape(heading), 4))
    result[..., 2], result[..., 3] = half_angle(heading)
    return result


def check_quaternions(quaternions: Floats, source: str) -> None:
    """Refuse quaternions (..., 4) that are no rotation; lengths near 1 may come from rounding.

    Raises:
        InputError: naming `source`, a quaternion is too short (usually it was not set) or too
            long.
    """
    bound = 2.0 * MAX_COMPONENT_RATIO
    squared = np.square(np.clip(quaternions, -bound, bound)).sum(axis=-1)
    too_short = squared < MIN_LENGTH_RATIO * MIN_LENGTH_RATIO
    wrong = too_short | (np.abs(quaternions) > MAX_COMPONENT_RATIO).any(axis=-1)
    if wrong.any():
        row = int(np.argmax(wrong.reshape(-1)))
        x, y, z, w = quaternions.reshape(-1, 4)[row]
        raise InputError(
            f"{source}: quaternion {row} is ({x:g}, {y:g}, {z:g}, {w:g}), which is no rotation; "
            "(0, 0, 0, 1) means a heading of 0"
        )


def yaw(quaternions: Floats) -> Floats:
    """Return the rotation about z [rad] of quaternions (..., 4) x, y, z, w.

    Its canonical angle is the encoded one.
    """
    x, y, z, w = (quaternions[..., k] for k in range(4))
    angle: Floats = np.where(
        (x == 0.0) & (y == 0.0),
        2.0 * np.arctan2(z, w),
        np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )
    return angle


def pose_rows(poses: Floats) -> Floats:
    """Return poses (M, 3) x, y, yaw as rows (M, 7) of geometry_msgs/Pose.

    Position and quaternion.
    """
    rows = np.zeros((len(poses), 7))
    rows[:, :2] = poses[:, :2]
    rows[:, 5], rows[:, 6] = half_angle(poses[:, 2])
    return rows


def poses_of(rows: Floats, source: str) -> Floats:
    """Return rows (M, 7) as poses (M, 3) x, y, yaw.

    Raises:
        InputError: naming `source`, a value is not finite.
    """
    if not np.isfinite(rows).all():
        raise InputError(f"{source}: a pose holds a value that is not finite")
    if (np.abs(rows[:, :3]) > MAX_COORDINATE_M).any():
        raise InputError(
            f"{source}: a position is {np.abs(rows[:, :3]).max():g}; at most {MAX_COORDINATE_M:g} "
            "is read"
        )
    check_quaternions(rows[:, 3:], source)
    return np.column_stack([rows[:, :2], yaw(rows[:, 3:])])


def encode_odometry(
    state: Floats, yaw_rate: float, child: str, frame_id: str, stamp_ns: int
) -> bytes:
    """Return a state (4,) x, y [m], yaw [rad], speed [m/s] and a yaw rate [rad/s] as CDR bytes."""
    pose, twist = pose_rows(state[None, :3]), (state[3], 0.0, 0.0, 0.0, 0.0, yaw_rate)
    return encode(ODOMETRY, stamp=stamp_ns, frame_id=frame_id, child=child, pose=pose, twist=twist)


def decode_odometry(data: bytes, source: str = "odom") -> tuple[int, str, str, Floats]:
    """Return stamp [ns], frame, child frame and the state (5,) x, y, yaw, speed, yaw rate.

    Units: m, rad, m/s, rad/s.

    Raises:
        InputError: naming `source`, the message is damaged, or a value is not finite.
    """
    message = decode(ODOMETRY, data, source)
    if not np.isfinite(message.twist).all():
        raise InputError(f"{source}: the twist holds a value that is not finite")
    state = np.append(poses_of(message.pose[None], source)[0], message.twist[[0, 5]])
    return message.stamp, message.frame_id, message.child, state


def encode_frames(poses: Floats, children: Sequence[str], parent: str, stamp_ns: int) -> bytes:
    """Return frames `children` at `poses` (N, 3) x, y [m], yaw [rad] in `parent` as CDR bytes."""
    rows = zip(pose_rows(poses), children, strict=True)
    header = {"stamp": stamp_ns, "frame_id": parent}
    return encode(
        TRANSFORMS, transforms=[header | {"child": child, "pose": row} for row, child in rows]
    )
