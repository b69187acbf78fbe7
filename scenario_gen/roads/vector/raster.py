# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The grid of a road: a cell is drivable if its centre lies in a lane, or on what else is paved."""

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from scenario_gen.numerics import Bools, Floats, Ints
from scenario_gen.roads.config import refuse_too_many_cells, RoadConfig
from scenario_gen.roads.vector.network import lane_ends
from scenario_gen.types import LaneNetwork, Road

_VERGE = 2.0  # metres of kerb drawn around a whole map


def road_of(
    network: LaneNetwork, box: Floats | None, config: RoadConfig, paved: BaseGeometry | None = None
) -> Road:
    """Draw the part of a network that lies in a box.

    Args:
        network: its lanes end at the box.
        box: (2, 2) metres, lowest and highest x, y; None: all lanes and a verge.
        config: cell size, and the most cells.
        paved: what else is drivable, in metres.

    Raises:
        RefusedError: it has more than `max_cells` cells.
    """
    cell = float(np.float32(config.resolution))
    low, high = network.box + np.array([[-_VERGE], [_VERGE]]) if box is None else box
    first, last = (
        np.floor(low / cell).astype(np.int64),
        np.ceil(high / cell - 1e-9).astype(np.int64),
    )
    width, height = (last - first).tolist()
    refuse_too_many_cells(network.name, width, height, config)
    drivable = np.zeros((height, width), dtype=np.bool_)
    parts = shapely.get_parts(paved).tolist() if paved is not None else []
    outlines = [(part.exterior.coords, True) for part in parts] + [
        (hole.coords, False) for part in parts for hole in part.interiors
    ]
    for outline, is_road in (*outlines, *((lane.outline, True) for lane in network.lanes)):
        corner, inside = covered(np.asarray(outline), cell, first, (height, width))
        window = drivable[
            corner[1] : corner[1] + inside.shape[0], corner[0] : corner[0] + inside.shape[1]
        ]
        window[inside] = is_road
    entries, exits = lane_ends(network)
    return Road(
        name=network.name,
        drivable=without_slits(drivable),
        resolution=cell,
        origin=first * cell,
        entries=entries,
        exits=exits,
        lanes=network if network.lanes else None,
    )


def covered(
    outline: Floats, cell: float, first: Ints, shape: tuple[int, int]
) -> tuple[Ints, Bools]:
    """Cells of a grid whose centres lie in a polygon.

    The winding number of each centre, by counting the edges that a ray from the left crosses: what lies in the polygon twice,
    in a sharp bend, is inside too.

    Args:
        outline: (P, 2) metres.
        cell: its size, metres.
        first: (2,) column and row of the grid's first cell, counted from the frame's origin.
        shape: rows and columns of the grid.

    Returns:
        Column and row (2,) of a window of the grid, and whether its cells are inside.
    """
    points = outline / cell - first  # in cells
    limit = np.array([shape[1], shape[0]])
    low = np.clip(np.floor(points.min(axis=0)).astype(np.int64), 0, limit)
    high = np.clip(np.ceil(points.max(axis=0)).astype(np.int64), low, limit)
    columns, rows = (high - low).tolist()
    winding = np.zeros((rows, columns + 1), dtype=np.int32)
    a, b = points - low, np.roll(points, -1, axis=0) - low
    begin = np.clip(np.ceil(np.minimum(a[:, 1], b[:, 1]) - 0.5).astype(np.int64), 0, rows)
    end = np.clip(np.ceil(np.maximum(a[:, 1], b[:, 1]) - 0.5).astype(np.int64), 0, rows)
    count = np.maximum(end - begin, 0)
    edge = np.repeat(np.arange(len(points)), count)
    row = begin[edge] + np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
    share = (row + 0.5 - a[edge, 1]) / (b[edge, 1] - a[edge, 1])
    crossed = a[edge, 0] + share * (b[edge, 0] - a[edge, 0])
    column = np.clip(np.ceil(crossed - 0.5).astype(np.int64), 0, columns)
    np.add.at(winding, (row, column), np.where(b[edge, 1] > a[edge, 1], 1, -1))
    return low, np.asarray(np.cumsum(winding, axis=1)[:, :columns] != 0)


def without_slits(drivable: Bools) -> Bools:
    """Fill single cells between two drivable ones: borders of neighbouring lanes need not agree to the millimetre."""
    filled = drivable.copy()
    filled[1:-1] |= drivable[:-2] & drivable[2:]
    filled[:, 1:-1] |= drivable[:, :-2] & drivable[:, 2:]
    return filled
