# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Array types used in signatures; arrays made safe to share; angles in one form."""

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
