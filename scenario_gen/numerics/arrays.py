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

LARGEST_ANGLE = (
    3.141592653  # the last whole nanoradian inside (-pi, pi); rounding must not step over the cut
)


def sealed(array: Array) -> Array:
    """Make an array of our own read-only, without a copy."""
    array.setflags(write=False)
    return array


def frozen(values: npt.ArrayLike) -> Floats:
    """Return `values` as a C-contiguous, read-only float64 array of any shape (a copy if it was writable)."""
    return sealed(np.array(values, dtype=np.float64, order="C"))


def frozen_ints(values: npt.ArrayLike) -> Ints:
    """Return `values` as a C-contiguous, read-only int64 array of any shape (a copy if it was writable)."""
    return sealed(np.array(values, dtype=np.int64, order="C"))


def frozen_bools(values: npt.ArrayLike) -> Bools:
    """Return `values` as a C-contiguous, read-only array of truth values of any shape (a copy if it was writable)."""
    return sealed(np.array(values, dtype=np.bool_, order="C"))


def freeze(record: object, **fields: Any) -> None:
    """Set fields of a frozen dataclass in its `__post_init__`."""
    for name, value in fields.items():
        object.__setattr__(record, name, value)


def wrap_angle(angle: Floats) -> Floats:
    """Wrap angles [rad], any shape, to [-pi, pi)."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def canonical_angle(angle: npt.ArrayLike) -> Floats:
    """Wrap angles [rad] to [-pi, pi) and round them to a nanoradian, any shape.

    A quaternion on the wire gives an angle back to 1e-16; rounded, it is the very same number, so a value that went
    through a message equals one that did not, bit for bit.
    """
    rounded = (
        np.round(wrap_angle(np.asarray(angle, dtype=np.float64)), 9) + 0.0
    )  # no -0, which other bytes than 0 would mean
    return frozen(
        np.minimum(np.maximum(rounded, -LARGEST_ANGLE), LARGEST_ANGLE)
    )  # a third of the time of np.clip


def canonical_heading(heading: npt.ArrayLike) -> Floats:
    """Canonical angles (..., T) [rad] made continuous along the last axis (time or path)."""
    angle = canonical_angle(heading)
    jumps = (np.abs(angle[..., 1:] - angle[..., :-1]) > np.pi).any()
    return (
        sealed(np.unwrap(angle, axis=-1)) if jumps else angle
    )  # most have none, and unwrapping costs ten times as much


def canonical_poses(poses: npt.ArrayLike, *, continuous: bool = False) -> Floats:
    """Poses (..., 3+) of x, y, yaw, ... with the yaw canonical; `continuous` unwraps it along the first axis."""
    array = np.array(poses, dtype=np.float64, order="C")
    array[..., 2] = (
        canonical_heading(array[..., 2]) if continuous else canonical_angle(array[..., 2])
    )
    return frozen(array)


def runs(flags: Bools, bridge: int = 0) -> list[tuple[int, int]]:
    """Return begin and end (exclusive) of each run of True in `flags` (T,), joined over at most `bridge` False."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    joined: list[tuple[int, int]] = []
    for begin, end in edges.reshape(-1, 2).tolist():
        if joined and begin - joined[-1][1] <= bridge:
            joined[-1] = (joined[-1][0], end)
        else:
            joined.append((begin, end))
    return joined
