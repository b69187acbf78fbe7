"""Array types used in signatures, and the one helper that makes an array safe to share."""

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]


def frozen(values: npt.ArrayLike) -> Floats:
    """Return `values` as a C-contiguous, read-only float64 array (a copy if it was writable)."""
    array = np.array(values, dtype=np.float64, order="C")
    array.setflags(write=False)
    return array


def frozen_ints(values: npt.ArrayLike) -> Ints:
    """Return `values` as a C-contiguous, read-only int64 array (a copy if it was writable)."""
    array = np.array(values, dtype=np.int64, order="C")
    array.setflags(write=False)
    return array


def wrap_angle(angle: Floats) -> Floats:
    """Wrap angles [rad], any shape, to [-pi, pi)."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi
