# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The paved parts of a drawn road as polygons in metres: strips, swept footprints, corners."""

from collections.abc import Callable, Iterable
from typing import TypeAlias

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from scenario_gen.numerics import Bools, Floats, running_sum
from scenario_gen.numerics.boxes import corners
from scenario_gen.numerics.curve import Curve
from scenario_gen.types import Trailer, trailer_poses

Inside: TypeAlias = Callable[[Floats], Bools]
"""Returns whether points (..., 2) [m] are drivable."""

ARM_COUNT = {"straight": 2, "curve": 2, "t_intersection": 3, "four_way": 4, "roundabout": 4}
SIDE_ARM_YAWS_RAD = (-np.pi / 2.0, np.pi / 2.0)
"""From the direction of the main road."""
END_ROOM_M = 6.0
"""Behind the first and before the last footprint on a road."""
JUNCTION_SLACK_M = 12.0
"""By which a junction's geometry may differ from the recorded one."""
MIN_ARM_M = 30.0
LANE_GAP_M = 2.0
"""Vehicles that are farther apart sideways use two lanes."""

_MAX_FILLED_HOLE_M2 = 60.0
_STATION_STEP_M = 0.5
_QUARTER_CIRCLE_POINTS = 16


def strip(line: Curve, right: float, left: float) -> Polygon:
    """Return the area between `right` and `left` [m] to the left of a line (right < left)."""
    dense = line if len(line.points) == 2 else line.cut(0.0, line.length, _STATION_STEP_M)
    edges = [dense.at_offset(dense.station, offset)[:, :2] for offset in (right, left)]
    return shapely.make_valid(Polygon(np.concatenate((edges[0], edges[1][::-1]))))


def swept(
    line: Curve, length: float, width: float, trailer: Trailer | None = None
) -> BaseGeometry:
    """Return the area that a footprint with length and width [m] covers along a line.

    A trailer is as wide. The area is the union of the hulls of two footprints each, which are at
    most 10 m and 0.05 rad apart.
    """
    dense = line.cut(0.0, line.length, _STATION_STEP_M)
    turned = running_sum(np.abs(np.diff(dense.points[:, 2])))
    interval = np.floor(turned / 0.05 + dense.station / 10.0)
    _, first = np.unique(interval, return_index=True)
    boxes = corners(dense.points[[*first, -1]], length, width)
    pairs = np.concatenate((boxes[:-1], boxes[1:]), axis=1)
    area = shapely.union_all(shapely.convex_hull(shapely.multipoints(pairs)))
    if trailer is None:
        return area
    towed = Curve(trailer_poses(dense.points, trailer))
    return area.union(swept(towed, trailer.length, width))


def ring(radius: float, half_width: float) -> BaseGeometry:
    """Return a lane with a half width [m] along a circle about the origin."""
    circle = shapely.Point(0.0, 0.0).buffer(radius, quad_segs=4 * _QUARTER_CIRCLE_POINTS)
    return circle.exterior.buffer(half_width)


def paved(pieces: Iterable[BaseGeometry], corner_radius: float) -> BaseGeometry:
    """Return the union of pieces with rounded corners between them and small holes filled.

    The radius is in metres; 0 leaves the corners as they are.
    """
    surface = shapely.union_all(list(pieces))
    if corner_radius > 0.0:
        grown = surface.buffer(corner_radius, quad_segs=_QUARTER_CIRCLE_POINTS)
        surface = grown.buffer(-corner_radius, quad_segs=_QUARTER_CIRCLE_POINTS)
    holes = [Polygon(hole) for part in shapely.get_parts(surface) for hole in part.interiors]
    small = [hole for hole in holes if hole.area <= _MAX_FILLED_HOLE_M2]
    return shapely.union_all([surface, *small])


def inside(surface: BaseGeometry) -> Inside:
    """Return the function that tells whether points lie on a surface."""
    shapely.prepare(surface)
    return lambda points: np.asarray(shapely.contains_xy(surface, points[..., 0], points[..., 1]))


def drivable_width(
    drivable: Inside, line: Curve, side: float, max_width: float, step: float = 0.1
) -> Floats:
    """Return how far (M,) [m] the road reaches to the left (side 1) or right (-1) of a line.

    The width is at most `max_width` and exact to `step` [m].
    """
    distance = np.arange(0.0, max_width, step)
    station = np.repeat(line.station[:, None], len(distance), axis=1)
    is_drivable = drivable(line.at_offset(station, side * distance[None, :])[..., :2])
    width = np.logical_and.accumulate(is_drivable, axis=1).sum(axis=1) * step
    return np.asarray(np.minimum(width, max_width))
