# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Directions, frames and polylines in the plane."""

import numpy as np

from scenario_gen.numerics.arrays import Floats, wrap_angle


def unit(yaw: Floats | float) -> Floats:
    """Return unit vectors (..., 2) in directions (...) [rad]."""
    return np.stack((np.cos(yaw), np.sin(yaw)), axis=-1)


def unit_left(yaw: Floats | float) -> Floats:
    """Return unit vectors (..., 2) to the left of directions (...) [rad]."""
    return np.stack((-np.sin(yaw), np.cos(yaw)), axis=-1)


def angle_between(angle: float, other: float) -> float:
    """Return by how much [rad] an angle is larger than another one, in [-pi, pi)."""
    return float(wrap_angle(np.asarray(angle - other)))


def ahead_and_left(offset: Floats, yaw: Floats | float) -> tuple[Floats, Floats]:
    """Return how far [m] offsets (..., 2) [m] reach ahead (...) and to the left (...) of headings (...) [rad]."""
    x, y, cos, sin = offset[..., 0], offset[..., 1], np.cos(yaw), np.sin(yaw)
    return x * cos + y * sin, y * cos - x * sin


def place(poses: Floats, ahead: Floats | float, left: Floats | float) -> Floats:
    """Return the points (..., 2) that lie ahead (...) and to the left (...) [m] of poses (..., 3) x, y [m], yaw [rad]."""
    x, y, cos, sin = poses[..., 0], poses[..., 1], np.cos(poses[..., 2]), np.sin(poses[..., 2])
    return np.stack((x + ahead * cos - left * sin, y + ahead * sin + left * cos), axis=-1)


def edge_lengths(points: Floats) -> Floats:
    """Return the lengths (M - 1,) [m] of the edges of a polyline (M, 2) [m]."""
    step = np.diff(points, axis=0)
    return np.hypot(step[:, 0], step[:, 1])


def edge_yaws(points: Floats) -> Floats:
    """Return the directions (M - 1,) [rad] of the edges of a polyline (M, 2) [m]."""
    step = np.diff(points, axis=0)
    return np.arctan2(step[:, 1], step[:, 0])


def meeting_shares(p: Floats, u: Floats, q: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
    """Return where lines p + t u and q + s v (..., 2) [m] meet: t and s (...), not finite if parallel, and u x v [m²]."""
    w = q - p
    cross = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        t = (w[..., 0] * v[..., 1] - w[..., 1] * v[..., 0]) / cross
        s = (w[..., 0] * u[..., 1] - w[..., 1] * u[..., 0]) / cross
    return t, s, cross


def polyline_of(yaw: Floats, step: Floats | float) -> Floats:
    """Return the points (M, 2) [m] of a path from the origin, whose heading is `yaw` (M,) [rad] at the ends of its steps [m]."""
    middle = (yaw[1:] + yaw[:-1]) / 2.0
    lengths = np.reshape(step, (-1, 1))
    return np.vstack((np.zeros((1, 2)), np.cumsum(lengths * unit(middle), axis=0)))
