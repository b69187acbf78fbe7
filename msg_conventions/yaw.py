# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Headings as quaternions (0, 0, sin(yaw/2), cos(yaw/2)), and back to the same number."""

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Floats

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
