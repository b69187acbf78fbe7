"""Headings as quaternions (0, 0, sin(yaw/2), cos(yaw/2)), and back to the same number."""

import numpy as np

from scenario_gen.arrays import Floats

TWO_PI = 2.0 * np.pi
NEAR_PI = np.pi - 1e-8


def half_angle(heading: Floats) -> tuple[Floats, Floats]:
    """Return sine and cosine of half the canonical headings [rad], any shape, unwrapped or not: z and w of the quaternion.

    A canonical angle is a multiple of a nanoradian plus turns. Next to ±pi two of them differ by less than a
    nanoradian; the one that lies on the nanoradian grid is the one meant.
    """
    if heading.size == 0 or max(heading.max(), -heading.min()) <= NEAR_PI:  # nothing to turn back: the usual case
        half = 0.5 * heading
        return np.sin(half), np.cos(half)
    turn = heading - TWO_PI * np.rint(heading / TWO_PI)
    if (np.abs(turn) > NEAR_PI).any():
        other = turn - np.copysign(TWO_PI, turn)
        nearer = np.abs(other - np.round(other, 9)) < np.abs(turn - np.round(turn, 9))
        turn = np.where((np.abs(other) < np.pi + 1e-9) & nearer, other, turn)
    return np.sin(0.5 * turn), np.cos(0.5 * turn)


def quaternion(heading: Floats) -> Floats:
    """Return (..., 4) x, y, z, w of canonical headings [rad]; w >= 0 up to rounding."""
    result = np.zeros((*np.shape(heading), 4))
    result[..., 2], result[..., 3] = half_angle(heading)
    return result


def yaw(quaternions: Floats) -> Floats:
    """Return the rotation about z [rad] of quaternions (..., 4) x, y, z, w, such that the canonical angle is the one sent."""
    x, y, z, w = np.moveaxis(quaternions, -1, 0)
    angle: Floats = np.where(
        (x == 0.0) & (y == 0.0),
        2.0 * np.arctan2(z, w),
        np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )
    rounded_past_pi = (np.abs(angle) > np.pi) & (np.abs(angle) < np.pi + 1e-9)
    clipped: Floats = np.where(rounded_past_pi, np.copysign(np.nextafter(np.pi, 0.0), angle), angle)
    return clipped
