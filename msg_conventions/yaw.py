"""Headings as quaternions (0, 0, sin(yaw/2), cos(yaw/2)), and back to the same number."""

import numpy as np

from scenario_gen.arrays import Floats

TWO_PI = 2.0 * np.pi


def quaternion(heading: Floats) -> Floats:
    """Return (..., 4) x, y, z, w of canonical headings [rad], any shape, unwrapped or not; w >= 0 up to rounding.

    A canonical angle is a multiple of a nanoradian plus turns. Next to ±pi two of them differ by less than a
    nanoradian; the one that lies on the nanoradian grid is the one meant.
    """
    turn = heading - TWO_PI * np.rint(heading / TWO_PI)
    other = turn - np.copysign(TWO_PI, turn)
    nearer = np.abs(other - np.round(other, 9)) < np.abs(turn - np.round(turn, 9))
    half = 0.5 * np.where((np.abs(other) < np.pi + 1e-9) & nearer, other, turn)
    zero = np.zeros_like(half)
    return np.stack([zero, zero, np.sin(half), np.cos(half)], axis=-1)


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
