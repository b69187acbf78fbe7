# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The grid of a road: cells with their centre in a lane or on paved ground are drivable."""

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from scenario_gen.numerics import Floats
from scenario_gen.numerics.polygons import fill_slits, polygon_cells
from scenario_gen.roads.config import refuse_too_many_cells, RoadConfig
from scenario_gen.roads.vector.network import lane_ends
from scenario_gen.types import LaneNetwork, Road

VERGE_M = 2.0
"""Around all lanes, at the border of a grid."""


def road_of(
    network: LaneNetwork, box: Floats | None, config: RoadConfig, paved: BaseGeometry | None = None
) -> Road:
    """Draw the part of a network that lies in a box.

    Args:
        network: its lanes end at the box.
        box: (2, 2) [m] lowest and highest x, y; None: all lanes and a verge.
        config: cell size and the most cells.
        paved: other drivable ground [m].

    Raises:
        RefusedError: it has more than `max_cells` cells.
    """
    cell_size = float(np.float32(config.resolution))
    low, high = network.box + np.array([[-VERGE_M], [VERGE_M]]) if box is None else box
    first = np.floor(low / cell_size).astype(np.int64)
    last = np.ceil(high / cell_size - 1e-9).astype(np.int64)
    width, height = (last - first).tolist()
    refuse_too_many_cells(network.name, width, height, config)

    parts = shapely.get_parts(paved).tolist() if paved is not None else []
    outlines = [(part.exterior.coords, True) for part in parts]
    outlines += [(hole.coords, False) for part in parts for hole in part.interiors]
    outlines += [(lane.outline, True) for lane in network.lanes]
    drivable = np.zeros((height, width), dtype=np.bool_)
    for outline, is_road in outlines:
        corner, inside = polygon_cells(np.asarray(outline), cell_size, first, drivable.shape)
        rows, columns = inside.shape
        window = drivable[corner[1] : corner[1] + rows, corner[0] : corner[0] + columns]
        window[inside] = is_road

    entries, exits = lane_ends(network)
    return Road(
        name=network.name,
        drivable=fill_slits(drivable),
        resolution=cell_size,
        origin=first * cell_size,
        entries=entries,
        exits=exits,
        lanes=network if network.lanes else None,
    )
