# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Roads from Python objects: a grid as an array, or the outline of drivable space as a polygon."""

from typing import TypeAlias

import numpy as np
from shapely import contains_xy, MultiPolygon, Polygon, prepare

from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Bools, Floats
from scenario_gen.roads.config import refuse_too_many_cells, RoadConfig
from scenario_gen.types import Road

Shape: TypeAlias = Bools | Polygon | MultiPolygon


def road_of_shape(shape: Shape, config: RoadConfig = RoadConfig()) -> Road:
    """Return the road of a drivable shape, a grid without lanes.

    Args:
        shape: (H, W) bool, drivable cells of `config.resolution`, row 0 the lowest y, the
            lower-left corner at (0, 0); or a polygon in metres: cells with their centre inside
            are drivable.
        config: cell size, and the most cells.

    Raises:
        InputError: the array has another shape or type, the polygon is invalid or empty, or
            nothing is drivable.
        RefusedError: the grid would have more than `config.max_cells` cells.
    """
    if isinstance(shape, np.ndarray):
        name, drivable, origin = "array", _checked(shape, config), np.zeros(2)
    elif isinstance(shape, Polygon | MultiPolygon):
        name, (drivable, origin) = "polygon", _rasterised(shape, config)
    else:
        raise InputError(
            f"road: a name, a path, an array or a polygon is needed, not {type(shape).__name__}"
        )
    return Road(name, drivable, config.resolution, origin)


def _checked(array: Bools, config: RoadConfig) -> Bools:
    """Return the drivable cells (H, W) of an array."""
    if array.ndim != 2 or array.dtype != np.bool_ or not array.any():
        raise InputError(
            "road: an array (H, W) of bool with a drivable cell is needed, not "
            f"{array.dtype} {array.shape}"
        )
    height, width = array.shape
    refuse_too_many_cells("array", width, height, config)
    return array


def _rasterised(polygon: Polygon | MultiPolygon, config: RoadConfig) -> tuple[Bools, Floats]:
    """Return the drivable cells (H, W) of a polygon, and the grid's origin (2,) [m]."""
    if polygon.is_empty or not np.isfinite(polygon.bounds).all() or not polygon.is_valid:
        raise InputError(
            "road: the polygon is empty, not finite, or crosses itself; `shapely.make_valid` "
            "repairs the last"
        )
    low_x, low_y, high_x, high_y = polygon.bounds
    width = max(round((high_x - low_x) / config.resolution), 1)
    height = max(round((high_y - low_y) / config.resolution), 1)
    refuse_too_many_cells("polygon", width, height, config)
    prepare(polygon)
    x = low_x + (np.arange(width) + 0.5) * config.resolution
    y = low_y + (np.arange(height) + 0.5) * config.resolution
    rows = [contains_xy(polygon, x, np.full(width, row)) for row in y]
    return np.stack(rows), np.array([low_x, low_y])
