# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Where traffic enters and leaves a map: the openings of drivable space at the border."""

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Bools, Floats, runs
from scenario_gen.roads.config import RoadConfig

_MIN_WIDTH = 2.5  # metres: narrower gaps are no way in for a car
_MOST_LANES = 1000  # at the whole border: 3.5 km of openings


def find_openings(
    drivable: Bools, resolution: float, origin: Floats, config: RoadConfig
) -> tuple[Floats, Floats]:
    """Return entries (E, 3) and exits (X, 3) of a grid.

    Every run of drivable cells on the grid's edge that a car can pass is an opening. It is divided into lanes of about
    `lane_width`: traffic keeps to its side, and a lane in the middle serves both ways.

    Raises:
        InputError: there are more lanes than any road has.
    """
    height, width = drivable.shape
    low, high = np.asarray(origin), np.asarray(origin) + np.array([width, height]) * resolution
    entries: list[list[float]] = []
    exits: list[list[float]] = []
    edges = (
        (
            drivable[0],
            0,
            low[1],
            -np.pi / 2.0,
            -1,
        ),  # the last: is the right of who leaves the lower or the higher coordinate
        (drivable[:, -1], 1, high[0], 0.0, -1),
        (drivable[-1], 0, high[1], np.pi / 2.0, 1),
        (drivable[:, 0], 1, low[0], np.pi, 1),
    )
    total = 0
    keep_right = 1 if config.traffic_side == "right" else -1
    for cells, axis, fixed, outward, right in edges:
        for first, last in runs(cells):
            size = (last - first) * resolution
            if size < _MIN_WIDTH:
                continue
            lanes = max(round(size / config.lane_width), 1)
            total += lanes
            if total > _MOST_LANES:
                raise InputError(
                    f"the openings at the map's border have room for more than {_MOST_LANES} lanes of {config.lane_width:g} m at "
                    f"{resolution:g} m per cell; check the resolution, or crop the map to a road"
                )
            for k in range(lanes):
                along = low[axis] + first * resolution + (k + 0.5) * size / lanes
                at = [along, fixed] if axis == 0 else [fixed, along]
                side = (2 * k + 1 - lanes) * right * keep_right
                if side >= 0:
                    exits.append([*at, outward])
                if side <= 0:
                    entries.append([*at, outward + np.pi])
    return np.array(entries).reshape(-1, 3), np.array(exits).reshape(-1, 3)
