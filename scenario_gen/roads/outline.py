# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Roads of a user's own: a grid as an array, or the outline of drivable space as a polygon."""

from typing import TypeAlias

import numpy as np
from shapely import contains_xy, MultiPolygon, Polygon, prepare

from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Bools
from scenario_gen.roads.config import refuse_too_many_cells, RoadConfig
from scenario_gen.roads.openings import find_openings
from scenario_gen.types import Road

Shape: TypeAlias = Bools | Polygon | MultiPolygon


def road_of_shape(shape: Shape, config: RoadConfig = RoadConfig()) -> Road:
    """Return the road of a drivable shape; traffic comes and goes where the shape touches the border of its grid.

    Args:
        shape: (H, W) bool, drivable cells of `config.resolution`, row 0 the lowest y, the lower-left corner at (0, 0); or a
            polygon in metres: cells whose centres lie inside are drivable.
        config: cell size, lane width, and side of traffic.

    Raises:
        InputError: the array has another shape or type, the polygon is invalid or empty, or nothing is drivable.
        RefusedError: the grid would have more than `config.max_cells` cells.
    """
    if isinstance(shape, np.ndarray):
        if shape.ndim != 2 or shape.dtype != np.bool_ or not shape.any():
            raise InputError(
                f"road: an array (H, W) of bool with a drivable cell is needed, not {shape.dtype} {shape.shape}"
            )
        drivable, origin, name = shape, np.zeros(2), "array"
        refuse_too_many_cells(name, shape.shape[1], shape.shape[0], config)
    else:
        if not isinstance(shape, Polygon | MultiPolygon):
            raise InputError(
                f"road: a name, a path, an array or a polygon is needed, not {type(shape).__name__}"
            )
        if shape.is_empty or not np.isfinite(shape.bounds).all() or not shape.is_valid:
            raise InputError(
                "road: the polygon is empty, not finite, or crosses itself; `shapely.make_valid` mends the last"
            )
        low_x, low_y, high_x, high_y = shape.bounds
        width, height = (
            max(round(size / config.resolution), 1) for size in (high_x - low_x, high_y - low_y)
        )
        name, origin = "polygon", np.array([low_x, low_y])
        refuse_too_many_cells(name, width, height, config)
        prepare(shape)
        x, y = (
            low + (np.arange(cells) + 0.5) * config.resolution
            for low, cells in ((low_x, width), (low_y, height))
        )
        drivable = np.stack([contains_xy(shape, x, np.full(width, at)) for at in y])
    entries, exits = find_openings(drivable, config.resolution, origin, config)
    return Road(name, drivable, config.resolution, origin, entries, exits)
