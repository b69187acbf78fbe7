# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Cells of a grid: those inside polygons, and the distance to the nearest one."""

import mmap

import numpy as np

from scenario_gen.numerics.arrays import Bools, Floats, Ints, sealed
from scenario_gen.numerics.kernels import B2, kernel, OUT2


def polygon_cells(
    outline: Floats, cell_size: float, first: Ints, shape: tuple[int, int]
) -> tuple[Ints, Ints]:
    """Return the rows and columns (C,) of the cells of a grid whose centres lie in a polygon.

    A cell is inside if its winding number is not zero, so a part that the polygon covers twice, as
    in a sharp bend, is inside, too.

    Args:
        outline: (P, 2) [m].
        cell_size: [m].
        first: (2,) column and row of the grid's first cell, counted from the frame's origin.
        shape: rows and columns of the grid.
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

    # Fill each row from a crossing to the next one where the winding number is not zero.
    order = np.lexsort((column, row))
    row, column = row[order], column[order]
    winding = np.cumsum(np.where(b[edge, 1] > a[edge, 1], 1, -1)[order])
    width = np.where(winding != 0, np.diff(column, append=0), 0)
    offset = np.arange(width.sum()) - np.repeat(np.cumsum(width) - width, width)
    return np.repeat(row + low[1], width), np.repeat(column + low[0], width) + offset


def fill_slits(cells: Bools) -> Bools:
    """Return cells (H, W) with single gaps between two of them filled.

    The borders of neighbouring lanes need not agree to the millimetre.
    """
    filled = cells.copy()
    filled[1:-1] |= cells[:-2] & cells[2:]
    filled[:, 1:-1] |= cells[:, :-2] & cells[:, 2:]
    return filled


def distance_field(is_open: Bools) -> Floats:
    """Return distances (H, W) [cells] from cell centres to the nearest closed square, read-only.

    Closed cells are 0; everything outside the grid is closed. Memory is used only near open cells.
    """
    anonymous = mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS  # zeros; numpy would ask for huge pages
    memory = mmap.mmap(-1, 8 * is_open.size, flags=anonymous)
    distance = np.frombuffer(memory).reshape(is_open.shape)
    distance_transform(is_open, distance)
    return sealed(distance)


@kernel(inline=True)
def is_row_open(distance: Floats, row: int, begin: int, end: int) -> bool:
    """Whether the cells of a row from `begin` to before `end` are open, by their distances."""
    column = begin
    while column < end:
        if distance[row, column] == 0.0:
            return False
        column += int(distance[row, column] + 0.5)  # no square is closed before
    return True


@kernel(B2, OUT2)
def distance_transform(is_open: Bools, out: Floats) -> None:
    """Fill `out` (H, W), zeros, with the distances [cells] from open cells to closed squares.

    Source: the lower envelope of parabolas (Felzenszwalb & Huttenlocher 2012), here of squares
    instead of points.
    """
    height, width = is_open.shape
    _vertical_distances(is_open, out)
    # The columns on the lower envelope, and the first column that each of them governs.
    site = np.empty(width + 2, dtype=np.int64)
    begin = np.empty(width + 3, dtype=np.int64)
    level = np.empty(width + 2)
    for i in range(height):
        end = 0
        while end < width:
            first = end
            while end < width and is_open[i, end]:
                end += 1
            if first < end:
                _envelope_of_run(out, i, first, end, site, begin, level)
            end += 1


@kernel(inline=True)
def _vertical_distances(is_open: Bools, out: Floats) -> None:
    """Fill open cells of `out` (H, W), zeros, with cells to the next closed one above or below."""
    height, width = is_open.shape
    for i in range(height):  # above
        for j in range(width):
            if is_open[i, j]:
                out[i, j] = out[max(i - 1, 0), j] + 1.0
    np.minimum(out[-1], 1.0, out[-1])
    for i in range(height - 2, -1, -1):  # and below
        for j in range(width):
            if is_open[i, j]:
                out[i, j] = min(out[i, j], out[i + 1, j] + 1.0)


@kernel(inline=True)
def _envelope_of_run(
    out: Floats, i: int, first: int, end: int, site: Ints, begin: Ints, level: Floats
) -> None:
    """Replace the vertical distances of a run in row i by the envelope of phi(x - j) + h_j^2.

    The closed cells beside the run are nearer than all beyond them.
    """
    site[0], begin[0], level[0] = first - 1, first, 0.0
    top = 0
    for j in range(first, end + 1):
        height = max(out[i, j] - 0.5, 0.0) if j < end else 0.0
        square = height * height
        governed = _overtakes(site[top], level[top], j, square)
        while top > 0 and governed <= begin[top]:
            top -= 1
            governed = _overtakes(site[top], level[top], j, square)
        if governed < end:
            top += 1
            site[top], begin[top], level[top] = j, max(governed, first), square
    begin[top + 1] = end
    for k in range(top + 1):
        for j in range(begin[k], begin[k + 1]):
            across = max(abs(j - site[k]) - 0.5, 0.0)
            out[i, j] = np.sqrt(across * across + level[k])


@kernel(inline=True)
def _overtakes(i: int, level_i: float, j: int, level_j: float) -> int:
    """Return the first column at which site j > i is no farther away than site i.

    That is where phi(x - i) - phi(x - j) >= level_j - level_i.
    """
    between = float(j - i)
    rise = level_j - level_i
    edge = (between - 0.5) * (between - 0.5)
    if rise > edge:  # right of j
        return int(np.ceil(0.5 * (rise / between + i + j + 1)))
    if rise <= -edge:  # at or left of i
        return min(int(np.ceil(0.5 * (rise / between + i + j - 1))), i)
    if between < 1.5:
        return j
    return min(max(int(np.ceil(0.5 * (rise / (between - 1.0) + i + j))), i + 1), j)
