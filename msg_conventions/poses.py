# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Poses in the plane ⇄ rows of geometry_msgs/Pose: position and quaternion."""

import numpy as np

from msg_conventions.trajectory import FARTHEST
from msg_conventions.yaw import check_quaternions, half_angle, yaw
from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Floats


def pose_rows(poses: Floats) -> Floats:
    """Return (M, 7) position and quaternion, as geometry_msgs/Pose lays them out, of (M, 3) x, y, yaw."""
    rows = np.zeros((len(poses), 7))
    rows[:, :2] = poses[:, :2]
    rows[:, 5], rows[:, 6] = half_angle(poses[:, 2])
    return rows


def poses_of(rows: Floats, what: str) -> Floats:
    """Return (M, 3) x, y, yaw of (M, 7) poses.

    Raises:
        InputError: naming `what`, a value is not finite.
    """
    if not np.isfinite(rows).all():
        raise InputError(f"{what}: a pose holds a value that is not finite")
    if (np.abs(rows[:, :3]) > FARTHEST).any():
        raise InputError(
            f"{what}: a position is {np.abs(rows[:, :3]).max():g}; at most {FARTHEST:g} is read"
        )
    check_quaternions(rows[:, 3:], what)
    return np.column_stack([rows[:, :2], yaw(rows[:, 3:])])
