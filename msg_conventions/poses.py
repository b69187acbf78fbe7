# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Poses in the plane ⇄ rows of geometry_msgs/Pose: position and quaternion."""

import numpy as np

from msg_conventions.trajectory import MAX_COORDINATE_M
from msg_conventions.yaw import check_quaternions, half_angle, yaw
from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Floats


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
