# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Copies and sums for kernels, by plain loops.

Numba compiles an assignment of an array to a slice, `a[:] = b`, with the text of its error
message, which takes a second and more for each kernel. Numbers may be assigned to slices.
"""

from typing import Any

import numpy.typing as npt

from scenario_gen.numerics.arrays import Ints
from scenario_gen.numerics.kernels import kernel


@kernel(inline=True)
def copy_to(out: npt.NDArray[Any], values: npt.NDArray[Any]) -> None:
    """Copy the first values (n or more,) to out (n,)."""
    for i in range(len(out)):
        out[i] = values[i]


@kernel(inline=True)
def copy_rows(out: npt.NDArray[Any], values: npt.NDArray[Any]) -> None:
    """Copy the first columns of values (n, m or more) to out (n, m)."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = values[i, j]


@kernel(inline=True)
def add_to(out: npt.NDArray[Any], values: npt.NDArray[Any]) -> None:
    """Add values (n,) to out (n,)."""
    for i in range(len(out)):
        out[i] += values[i]


@kernel(inline=True)
def column_sums(counts: Ints) -> Ints:
    """Return the sums (m,) of the columns of counts (n, m)."""
    sums: Ints = counts[0].copy()
    for i in range(1, len(counts)):
        add_to(sums, counts[i])
    return sums
