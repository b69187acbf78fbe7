# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Where traffic enters and leaves a grid: the openings of drivable space at its border."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Bools, Floats, runs
from scenario_gen.roads.config import RoadConfig

_MIN_OPENING_M = 2.5  # for a car
_MAX_LANES_COUNT = 1000  # at the whole border: 3.5 km of openings


class _Edge(NamedTuple):
    """An edge of a grid.

    Attributes:
        cells: along it.
        begin: (2,) [m] the corner with its first cell.
        along: (2,) unit vector from there.
        outward: [rad] the direction out of the grid.
        right: 1 if a driver who leaves has the edge's end on the right, else -1.
    """

    cells: Bools
    begin: Floats
    along: Floats
    outward: float
    right: int


def _edges(drivable: Bools, low: Floats, high: Floats) -> Iterator[_Edge]:
    """Yield the edges of a grid between its corners (2,) [m]: south, east, north, west."""
    east, north = np.eye(2)
    yield _Edge(drivable[0], low, east, -np.pi / 2.0, -1)
    yield _Edge(drivable[:, -1], np.array([high[0], low[1]]), north, 0.0, -1)
    yield _Edge(drivable[-1], np.array([low[0], high[1]]), east, np.pi / 2.0, 1)
    yield _Edge(drivable[:, 0], low, north, np.pi, 1)


def find_openings(
    drivable: Bools, resolution: float, origin: Floats, config: RoadConfig
) -> tuple[Floats, Floats]:
    """Return entries (E, 3) and exits (X, 3) x, y [m], yaw [rad] of a grid.

    Every run of drivable cells on the grid's edge that is wide enough for a car is an opening. It
    is divided into lanes of about `lane_width`. Traffic keeps to its side; a lane in the middle
    is used both ways.

    Raises:
        InputError: there are more lanes than any road has.
    """
    height, width = drivable.shape
    low = np.asarray(origin)
    high = low + np.array([width, height]) * resolution
    keeps_right = 1 if config.traffic_side == "right" else -1
    entries: list[list[float]] = []
    exits: list[list[float]] = []
    total = 0
    for edge in _edges(drivable, low, high):
        for place, side in _lanes(edge, resolution, config.lane_width):
            total += 1
            if total > _MAX_LANES_COUNT:
                raise InputError(
                    f"the openings at the map's border have room for more than {_MAX_LANES_COUNT} "
                    f"lanes of {config.lane_width:g} m at {resolution:g} m per cell; check the "
                    "resolution, or crop the map to a road"
                )
            if side * keeps_right >= 0:
                exits.append([*place, edge.outward])
            if side * keeps_right <= 0:
                entries.append([*place, edge.outward + np.pi])
    return np.array(entries).reshape(-1, 3), np.array(exits).reshape(-1, 3)


def _lanes(edge: _Edge, resolution: float, lane_width: float) -> Iterator[tuple[Floats, int]]:
    """Yield the lanes in the openings of an edge.

    Each has a place (2,) [m], and a side: positive to the right of a driver who leaves, 0 in the
    middle.
    """
    for first, last in runs(edge.cells):
        size = (last - first) * resolution
        if size >= _MIN_OPENING_M:
            lanes = max(round(size / lane_width), 1)
            for k in range(lanes):
                along = first * resolution + (k + 0.5) * size / lanes
                yield edge.begin + along * edge.along, (2 * k + 1 - lanes) * edge.right
