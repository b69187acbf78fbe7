# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Headings as quaternions (0, 0, sin(yaw/2), cos(yaw/2)), and back to the same number."""

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Floats

TWO_PI = 2.0 * np.pi
SHORTEST, LARGEST = 0.5, 2.0  # length, and part, of a quaternion, which should have length 1


def half_angle(heading: Floats) -> tuple[Floats, Floats]:
    """Return sine and cosine of half the canonical headings [rad], any shape, unwrapped or not: z and w of the quaternion.

    A canonical angle is a multiple of a nanoradian plus turns and keeps off ±pi, so that taking back the turns is exact enough.
    """
    if heading.size and max(heading.max(), -heading.min()) > np.pi:  # rarely
        heading = heading - TWO_PI * np.rint(heading / TWO_PI)
    half = 0.5 * heading
    return np.sin(half), np.cos(half)


def quaternion(heading: Floats) -> Floats:
    """Return (..., 4) x, y, z, w of canonical headings [rad]; w >= 0 up to rounding."""
    result = np.zeros((*np.shape(heading), 4))
    result[..., 2], result[..., 3] = half_angle(heading)
    return result


def check_quaternions(quaternions: Floats, what: str) -> None:
    """Refuse quaternions (..., 4) that are no rotation; lengths near 1 are left to rounding.

    Raises:
        InputError: naming `what`, one is shorter than a half (as a rule all zeros, because it was not set), or far too long.
    """
    squared = np.square(np.clip(quaternions, -2.0 * LARGEST, 2.0 * LARGEST)).sum(axis=-1)
    wrong = (squared < SHORTEST * SHORTEST) | (np.abs(quaternions) > LARGEST).any(axis=-1)
    if wrong.any():
        row = int(np.argmax(wrong.reshape(-1)))
        x, y, z, w = quaternions.reshape(-1, 4)[row]
        raise InputError(
            f"{what}: quaternion {row} is ({x:g}, {y:g}, {z:g}, {w:g}), which is no rotation; (0, 0, 0, 1) means a heading of 0"
        )


def yaw(quaternions: Floats) -> Floats:
    """Return the rotation about z [rad] of quaternions (..., 4) x, y, z, w, such that the canonical angle is the one sent."""
    x, y, z, w = np.moveaxis(quaternions, -1, 0)
    angle: Floats = np.where(
        (x == 0.0) & (y == 0.0),
        2.0 * np.arctan2(z, w),
        np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )
    return angle
