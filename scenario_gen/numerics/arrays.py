# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Array types used in signatures; arrays made safe to share; angles, frames and polylines."""

from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
Counts = npt.NDArray[np.int32]
Array = TypeVar("Array", bound=npt.NDArray[Any])

NS_PER_S = 1_000_000_000
MAX_ANGLE_RAD = 3.141592653  # the last whole nanoradian below pi, so that rounding stays inside


def sealed(array: Array) -> Array:
    """Make an array read-only in place, and return it."""
    array.setflags(write=False)
    return array


def frozen(values: npt.ArrayLike) -> Floats:
    """Return a C-contiguous, read-only float64 copy of `values`, any shape."""
    return sealed(np.array(values, dtype=np.float64, order="C"))


def frozen_ints(values: npt.ArrayLike) -> Ints:
    """Return a C-contiguous, read-only int64 copy of `values`, any shape."""
    return sealed(np.array(values, dtype=np.int64, order="C"))


def frozen_bools(values: npt.ArrayLike) -> Bools:
    """Return a C-contiguous, read-only boolean copy of `values`, any shape."""
    return sealed(np.array(values, dtype=np.bool_, order="C"))


def freeze(record: object, **fields: Any) -> None:
    """Set fields of a frozen dataclass in its `__post_init__`."""
    for name, value in fields.items():
        object.__setattr__(record, name, value)


def running_sum(values: npt.ArrayLike) -> Floats:
    """Return the sums (M + 1,) of the first 0, 1, ... M of some values (M,)."""
    return np.concatenate([[0.0], np.cumsum(values)])


def wrap_angle(angle: Floats) -> Floats:
    """Wrap angles [rad], any shape, to [-pi, pi)."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def canonical_angle(angle: npt.ArrayLike) -> Floats:
    """Wrap angles [rad] to [-pi, pi) and round them to a nanoradian, any shape.

    A quaternion in a message changes an angle by about 1e-16 rad. The rounded angle is the same
    number before and after, so values from messages equal the original ones bit for bit.
    """
    rounded = np.round(wrap_angle(np.asarray(angle, dtype=np.float64)), 9) + 0.0  # no -0.0
    # np.clip would take three times as long.
    return frozen(np.minimum(np.maximum(rounded, -MAX_ANGLE_RAD), MAX_ANGLE_RAD))


def canonical_heading(heading: npt.ArrayLike) -> Floats:
    """Return canonical angles (..., T) [rad], continuous along the last axis (time or path)."""
    angle = canonical_angle(heading)
    jumps = np.abs(angle[..., 1:] - angle[..., :-1]) > np.pi
    # Most headings have no jump, and np.unwrap costs ten times as much as this test.
    return sealed(np.unwrap(angle, axis=-1)) if jumps.any() else angle


def canonical_poses(poses: npt.ArrayLike, *, continuous: bool = False) -> Floats:
    """Return poses (..., 3+) x, y, yaw, ... with canonical yaw.

    `continuous` unwraps it along the first axis.
    """
    array = np.array(poses, dtype=np.float64, order="C")
    canonical = canonical_heading if continuous else canonical_angle
    array[..., 2] = canonical(array[..., 2])
    return frozen(array)


def runs(flags: Bools, bridge: int = 0) -> list[tuple[int, int]]:
    """Return begin and end (exclusive) of each run of True in `flags` (T,).

    Runs with at most `bridge` False between them are joined.
    """
    padded = np.concatenate([[False], flags, [False]]).astype(np.int8)
    edges = np.flatnonzero(np.diff(padded))
    joined: list[tuple[int, int]] = []
    for begin, end in edges.reshape(-1, 2).tolist():
        if joined and begin - joined[-1][1] <= bridge:
            joined[-1] = (joined[-1][0], end)
        else:
            joined.append((begin, end))
    return joined


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
