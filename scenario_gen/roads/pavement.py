# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What is paved of a road that is drawn, as polygons in metres: strips along its arms, swept footprints, rounded corners."""

from collections.abc import Callable, Iterable
from typing import TypeAlias

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from scenario_gen.numerics import Bools, Floats
from scenario_gen.numerics.boxes import corners
from scenario_gen.numerics.curve import Curve

Inside: TypeAlias = Callable[[Floats], Bools]
"""Whether points (..., 2) [m] are drivable."""

ARM_COUNT = {"straight": 2, "curve": 2, "t_intersection": 3, "four_way": 4, "roundabout": 4}
SIDE_ARMS = (-np.pi / 2.0, np.pi / 2.0)  # rad, from the direction of the main road
ROOM = 6.0  # metres kept free behind the first and before the last footprint
SLACK = 12.0  # metres by which a junction's geometry, and ways through it, may differ from the template's
SHORTEST = 30.0  # metres of an arm
LANE_GAP = 2.0  # metres sideways that make another lane
_SLIVER = 60.0  # m²: smaller holes are filled
_STEP = 0.5  # metres between two cross sections of a strip
_SWEPT, _SWEPT_TURN = (
    10.0,
    0.05,
)  # metres and rad between two footprints of which the hull is swept, at most
_QUARTER = 16  # segments of a quarter of a circle


def strip(line: Curve, right: float, left: float) -> Polygon:
    """What lies between `right` and `left` metres to the left of a line (right < left)."""
    dense = line if len(line.points) == 2 else line.cut(0.0, line.length, _STEP)
    edges = [dense.beside(dense.station, offset)[:, :2] for offset in (right, left)]
    return shapely.make_valid(Polygon(np.concatenate((edges[0], edges[1][::-1]))))


def swept(line: Curve, length: float, width: float) -> BaseGeometry:
    """What a footprint of `length` and `width` [m] covers on its way along a line."""
    dense = line.cut(0.0, line.length, _STEP)
    turned = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(dense.points[:, 2])))))
    _, first = np.unique(
        np.floor(turned / _SWEPT_TURN + dense.station / _SWEPT), return_index=True
    )
    boxes = corners(dense.points[[*first, -1]], length, width)
    return shapely.union_all(
        shapely.convex_hull(shapely.multipoints(np.concatenate((boxes[:-1], boxes[1:]), axis=1)))
    )


def ring(radius: float, half: float) -> BaseGeometry:
    """A lane `half` metres wide on both sides of a circle about the origin."""
    return shapely.Point(0.0, 0.0).buffer(radius, quad_segs=4 * _QUARTER).exterior.buffer(half)


def paved(pieces: Iterable[BaseGeometry], corner_radius: float) -> BaseGeometry:
    """All pieces, the corners between them rounded with a radius [m] (0: not at all), and small holes filled."""
    surface = shapely.union_all(list(pieces))
    if corner_radius > 0.0:
        surface = surface.buffer(corner_radius, quad_segs=_QUARTER).buffer(
            -corner_radius, quad_segs=_QUARTER
        )
    holes = [Polygon(hole) for part in shapely.get_parts(surface) for hole in part.interiors]
    return shapely.union_all([surface, *(hole for hole in holes if hole.area <= _SLIVER)])


def inside(surface: BaseGeometry) -> Inside:
    """Whether points lie on a surface."""
    shapely.prepare(surface)
    return lambda points: np.asarray(shapely.contains_xy(surface, points[..., 0], points[..., 1]))


def drivable_beside(
    drivable: Inside, line: Curve, sign: float, most: float, step: float = 0.1
) -> Floats:
    """Return (M,) how far [m] it is drivable to the left (`sign` 1) or right (-1) of a line's points, at most `most`."""
    distance = np.arange(0.0, most, step)
    station = np.repeat(line.station[:, None], len(distance), axis=1)
    there = drivable(line.beside(station, sign * distance[None, :])[..., :2])
    free = np.logical_and.accumulate(there, axis=1).sum(axis=1) * step
    return np.asarray(np.minimum(free, most))
