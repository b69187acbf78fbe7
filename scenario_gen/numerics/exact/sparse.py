# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Sparse matrices as Clarabel takes them, without scipy's, which take a tenth of a second to import."""

from dataclasses import dataclass

import numpy as np

from scenario_gen.numerics.arrays import Floats, Ints


@dataclass(frozen=True, eq=False)
class Columns:
    """A sparse matrix, column by column; the attributes are those of scipy's `csc_array`.

    Attributes:
        data: (e,) the entries that are not zero.
        indices: (e,) the row of each.
        indptr: (n + 1,) where each column begins.
        shape: (m, n).
    """

    data: Floats
    indices: Ints
    indptr: Ints
    shape: tuple[int, int]
    has_canonical_format: bool = True

    @classmethod
    def of_entries(cls, rows: Ints, columns: Ints, values: Floats, shape: tuple[int, int]) -> "Columns":
        """Take entries (e,) in any order, each place once at most."""
        order = np.lexsort((rows, columns))
        order = order[values[order] != 0.0]
        return cls(values[order], rows[order], np.searchsorted(columns[order], np.arange(shape[1] + 1)), shape)

    @classmethod
    def of_dense(cls, matrix: Floats) -> "Columns":
        """Take a whole matrix (m, n)."""
        rows, columns = np.nonzero(matrix)
        return cls.of_entries(rows, columns, matrix[rows, columns], (matrix.shape[0], matrix.shape[1]))
