# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Polygons drawn into grids."""

import numpy as np

from scenario_gen.numerics.arrays import Bools, Floats, Ints


def polygon_cells(
    outline: Floats, cell_size: float, first: Ints, shape: tuple[int, int]
) -> tuple[Ints, Bools]:
    """Return the cells of a grid whose centres lie in a polygon.

    A cell is inside if its winding number is not zero, so a part that the polygon covers twice, as
    in a sharp bend, is inside, too.

    Args:
        outline: (P, 2) [m].
        cell_size: [m].
        first: (2,) column and row of the grid's first cell, counted from the frame's origin.
        shape: rows and columns of the grid.

    Returns:
        The first column and row (2,) of a window in the grid, and which of its cells are inside.
    """
    points = outline / cell_size - first  # [cells]
    limit = np.array([shape[1], shape[0]])
    low = np.clip(np.floor(points.min(axis=0)).astype(np.int64), 0, limit)
    high = np.clip(np.ceil(points.max(axis=0)).astype(np.int64), low, limit)
    columns, rows = (high - low).tolist()

    # Count the edges that a ray from the left crosses at the height of each row's centre.
    a = points - low
    b = np.roll(points, -1, axis=0) - low
    begin = np.clip(np.ceil(np.minimum(a[:, 1], b[:, 1]) - 0.5).astype(np.int64), 0, rows)
    end = np.clip(np.ceil(np.maximum(a[:, 1], b[:, 1]) - 0.5).astype(np.int64), 0, rows)
    count = np.maximum(end - begin, 0)
    edge = np.repeat(np.arange(len(points)), count)
    row = begin[edge] + np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
    share = (row + 0.5 - a[edge, 1]) / (b[edge, 1] - a[edge, 1])
    crossed = a[edge, 0] + share * (b[edge, 0] - a[edge, 0])
    column = np.clip(np.ceil(crossed - 0.5).astype(np.int64), 0, columns)

    winding = np.zeros((rows, columns + 1), dtype=np.int32)
    np.add.at(winding, (row, column), np.where(b[edge, 1] > a[edge, 1], 1, -1))
    return low, np.asarray(np.cumsum(winding, axis=1)[:, :columns] != 0)


def fill_slits(cells: Bools) -> Bools:
    """Return cells (H, W) with single gaps between two of them filled.

    The borders of neighbouring lanes need not agree to the millimetre.
    """
    filled = cells.copy()
    filled[1:-1] |= cells[:-2] & cells[2:]
    filled[:, 1:-1] |= cells[:, :-2] & cells[:, 2:]
    return filled
