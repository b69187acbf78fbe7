# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Directions, frames and polylines in the plane."""

import numpy as np

from scenario_gen.numerics.arrays import Floats, running_sum, wrap_angle


def unit(yaw: Floats | float) -> Floats:
    """Return unit vectors (..., 2) in directions (...) [rad]."""
    return np.stack((np.cos(yaw), np.sin(yaw)), axis=-1)


def unit_left(yaw: Floats | float) -> Floats:
    """Return unit vectors (..., 2) to the left of directions (...) [rad]."""
    return np.stack((-np.sin(yaw), np.cos(yaw)), axis=-1)


def angle_between(angle: float, other: float) -> float:
    """Return the difference `angle` - `other` [rad], wrapped to [-pi, pi)."""
    return float(wrap_angle(np.asarray(angle - other)))


def ahead_and_left(offset: Floats, yaw: Floats | float) -> tuple[Floats, Floats]:
    """Return the longitudinal and lateral components (...) [m] of offsets (..., 2) [m].

    Args:
        offset: in the frame of the plane.
        yaw: (...) the headings [rad] of the frames with x ahead and y to the left.
    """
    x, y = offset[..., 0], offset[..., 1]
    cos, sin = np.cos(yaw), np.sin(yaw)
    return x * cos + y * sin, y * cos - x * sin


def place(poses: Floats, ahead: Floats | float, left: Floats | float) -> Floats:
    """Return points (..., 2) [m] at offsets (...) [m] in the frames of poses (..., 3)."""
    cos, sin = np.cos(poses[..., 2]), np.sin(poses[..., 2])
    x = poses[..., 0] + ahead * cos - left * sin
    y = poses[..., 1] + ahead * sin + left * cos
    return np.stack((x, y), axis=-1)


def edge_lengths(points: Floats) -> Floats:
    """Return the lengths (M - 1,) [m] of the edges of a polyline (M, 2) [m]."""
    step = np.diff(points, axis=0)
    return np.hypot(step[:, 0], step[:, 1])


def arc_lengths(points: Floats) -> Floats:
    """Return the lengths (M,) [m] of a polyline (M, 2) [m] up to each of its points."""
    return running_sum(edge_lengths(points))


def edge_yaws(points: Floats) -> Floats:
    """Return the directions (M - 1,) [rad] of the edges of a polyline (M, 2) [m]."""
    step = np.diff(points, axis=0)
    return np.arctan2(step[:, 1], step[:, 0])


def meeting_shares(p: Floats, u: Floats, q: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
    """Intersect lines p + t u and q + s v (..., 2) [m].

    Returns:
        t and s (...), not finite where the lines are parallel, and the cross product u x v (...)
        [m²].
    """
    w = q - p
    cross = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        t = (w[..., 0] * v[..., 1] - w[..., 1] * v[..., 0]) / cross
        s = (w[..., 0] * u[..., 1] - w[..., 1] * u[..., 0]) / cross
    return t, s, cross


def polyline_of(yaw: Floats, step: Floats | float) -> Floats:
    """Integrate a heading: return the points (M, 2) [m] of a path from the origin.

    Args:
        yaw: (M,) headings [rad] at the points.
        step: distance [m] between two points, one for all or (M - 1,).
    """
    mean_yaw = (yaw[1:] + yaw[:-1]) / 2.0
    lengths = np.reshape(step, (-1, 1))
    return np.vstack((np.zeros((1, 2)), np.cumsum(lengths * unit(mean_yaw), axis=0)))
