# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How far the ego's footprint stayed inside the drivable area, or how much of it was outside.

The kernel of the validity check proves whether the footprint stayed inside at every instant. Only
if it reports an exit, the depth is measured, at poses so close together that no point of the
footprint moves more than POSE_SPACING_M from one to the next.
"""

from dataclasses import dataclass
from functools import cached_property
import math
from typing import Any, NamedTuple

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from scenario_gen.closed_loop.drive import Drive
from scenario_gen.method.validity import first_exits, Ground, Proof
from scenario_gen.numerics import Bools, Floats, Ints
from scenario_gen.numerics.boxes import corners
from scenario_gen.numerics.hermite import control_points
from scenario_gen.numerics.plane import edge_lengths, place
from scenario_gen.numerics.polygons import distance_field
from scenario_gen.roads import footprint_fits, to_cells, to_metres
from scenario_gen.types import Motion, Obstacle, Road
from scenario_gen.types.road import MAX_DEPTH_M

POSE_SPACING_M = 0.05
POINTS_COUNT = (25, 11)  # along and across a footprint, of which the deepest is found
DEPTH_ERROR_M = 0.01
_ROUNDING_M = 1e-6  # of depths, so that it leaves out no point
SUBSTEPS_COUNT = 200  # per step, to locate the beginning of an event
RESOLUTION_S = 1e-6  # an event that cannot be excluded over such an interval counts


class RoadUse(NamedTuple):
    """The footprint's position with respect to the road's edge.

    Attributes:
        margin: least signed distance [m] to the area that is not drivable: positive inside,
            negative the greatest depth outside; NaN if no road is known, at most MAX_DEPTH_M
            either way.
        area: greatest part of the footprint [m²] outside at one instant; 0 if it stayed inside.
        time: first time at which the depth reached the limit [s], NaN if it never did.
    """

    margin: float
    area: float
    time: float


def road_use(drive: Drive, road: Road | None, limit: float) -> RoadUse:
    """Measure a drive up to its first jump.

    The ego leaves the road when its footprint is outside by more than 0 and at least `limit` [m].
    """
    if road is None or drive.driven < 2:
        return RoadUse(math.nan, 0.0, math.nan)
    motion = drive.motion.select([drive.ego], 0, drive.driven - 1)
    half = motion.vehicles[0].half
    control, out = np.empty((1, len(motion.time) - 1, 4, 2)), np.empty((1, 2))
    control_points(motion.time, motion.position, motion.heading, motion.speed, control)
    first_exits(
        motion.time, control, motion.heading, np.array([half]), Ground.of(road), RESOLUTION_S, out
    )
    if out[0, 0] == Proof.PROVEN:
        edge = _Ground.around(road, motion.poses[0], half).pavement.boundary
        room = shapely.distance(_footprints(motion.poses[0], half), edge).min()
        return RoadUse(float(np.clip(room, RESOLUTION_S, MAX_DEPTH_M)), 0.0, math.nan)
    is_out = _Ground.around(road, motion.poses[0], half).is_out(motion.poses[0], half, limit)
    first_out = motion.time[np.argmax(is_out)] if is_out.any() else motion.time[-1]
    time = _fine_times(motion)  # from then on the samples suffice
    time = np.union1d(time[time <= first_out], motion.time)
    poses = motion.at(time).poses[0]
    ground = _Ground.around(road, poses, half)
    reached = ground.is_out(poses, half, limit)
    begin = math.nan
    if reached.any():
        k = int(np.argmax(reached))
        between = np.linspace(time[max(k - 1, 0)], time[k], SUBSTEPS_COUNT + 1)
        begin = float(between[np.argmax(ground.is_out(motion.at(between).poses[0], half, limit))])
    area = shapely.area(shapely.difference(_footprints(poses, half), ground.pavement)).max()
    deepest = poses[np.argmax(ground.greatest_depths(poses, _grid(half)).max(axis=1))]
    return RoadUse(-_depth(road, deepest, half), float(area), begin)


def first_obstacle(drive: Drive, road: Road | None) -> tuple[float, Obstacle] | None:
    """Return when a drive first touches an obstacle [s], and which; None if it touches none.

    The drive is measured up to its first jump, at poses as close together as in `road_use`.
    """
    if road is None or not road.obstacles or drive.driven < 2:
        return None
    motion = drive.motion.select([drive.ego], 0, drive.driven - 1)
    time = _fine_times(motion)
    touches = _touches(road, motion.at(time).poses[0], motion.vehicles[0].half)
    if not touches.any():
        return None
    instant, obstacle = np.argwhere(touches)[0].tolist()
    return float(time[instant]), road.obstacles[obstacle]


def _touches(road: Road, poses: Floats, half: tuple[float, float]) -> Bools:
    """Return (P, K) whether a footprint at poses (P, 3) overlaps each obstacle of a road."""
    obstacles = shapely.polygons([obstacle.outline for obstacle in road.obstacles])
    return np.asarray(shapely.intersects(_footprints(poses, half)[:, None], obstacles))


def is_off_road(road: Road, pose: Floats, half: tuple[float, float], limit: float) -> bool:
    """Whether a footprint at a pose (3,) is off the road, as in `road_use`, or in an obstacle."""
    if footprint_fits(road, pose[None], 2.0 * half[0], 2.0 * half[1])[0]:
        return False
    in_obstacle = bool(road.obstacles) and bool(_touches(road, pose[None], half).any())
    return in_obstacle or _depth(road, pose, half) >= limit


def _fine_times(motion: Motion) -> Floats:
    """Return times [s] between which no point of a vehicle moves by more than POSE_SPACING_M."""
    distance = np.maximum(edge_lengths(motion.position[0]), motion.speed[0, 1:] * motion.dt)
    distance += np.abs(np.diff(motion.heading[0])) * sum(motion.vehicles[0].half)
    count = math.ceil(np.clip(distance.max() / POSE_SPACING_M, 1.0, SUBSTEPS_COUNT))
    steps = len(motion.time) - 1
    place_in_steps = np.linspace(0.0, steps, steps * count + 1)
    return np.asarray(np.interp(place_in_steps, np.arange(steps + 1), motion.time))


def _depth(road: Road, pose: Floats, half: tuple[float, float]) -> float:
    """Return the greatest depth [m] of a footprint at a pose (3,) outside the road, to 1 cm."""
    ground = _Ground.around(road, pose[None], half)
    points = _grid(half)
    spacing = 2.0 * max(half) / (min(POINTS_COUNT) - 1)
    while spacing > DEPTH_ERROR_M:
        deepest = points[np.argmax(ground.greatest_depths(pose[None], points))]
        spacing /= 4.0
        points = np.clip(deepest + spacing * _grid((4.0, 4.0)), np.negative(half), half)
    return float(ground.greatest_depths(pose[None], points).max())


def _grid(half: tuple[float, float]) -> Floats:
    """Return points (M, 2) [m] spread over a footprint in its frame."""
    along, across = (np.linspace(-h, h, n) for h, n in zip(half, POINTS_COUNT, strict=True))
    return np.stack(np.meshgrid(along, across), axis=-1).reshape(-1, 2)


def _footprints(poses: Floats, half: tuple[float, float]) -> Any:
    """Return the footprints (P,) at poses (P, 3) as polygons."""
    return shapely.polygons(corners(poses, 2.0 * half[0], 2.0 * half[1]))


@dataclass(frozen=True, eq=False)
class _Ground:
    """The drivable area, as far as it matters for some poses.

    Attributes:
        road: the road.
        first: (2,) column and row of the first cell.
        cells: (H, W) whether they are drivable.
    """

    road: Road
    first: Ints
    cells: Bools

    @classmethod
    def around(cls, road: Road, poses: Floats, half: tuple[float, float]) -> "_Ground":
        """Return the area around a footprint at poses (P, 3)."""
        reach = MAX_DEPTH_M + math.hypot(*half)
        low, high = (
            np.clip(np.floor(to_cells(road, end)), 0, road.drivable.shape[::-1]).astype(np.int64)
            for end in (poses[:, :2].min(axis=0) - reach, poses[:, :2].max(axis=0) + reach)
        )
        return cls(road, low, road.drivable[low[1] : high[1] + 1, low[0] : high[0] + 1])

    @cached_property
    def pavement(self) -> BaseGeometry:
        """The drivable cells as one polygon."""
        change = np.diff(np.pad(self.cells, ((0, 0), (1, 1))).astype(np.int8), axis=1)
        rows, first = np.nonzero(change > 0)
        _, last = np.nonzero(change < 0)
        runs = shapely.union_all(shapely.box(first, rows, last, rows + 1))
        area = shapely.transform(runs, lambda cells: to_metres(self.road, cells + self.first))
        shapely.prepare(area)
        return area

    @cached_property
    def _depth_cells(self) -> Floats:
        """Distances [cells] from centres of closed cells to drivable squares, with a wide rim."""
        return distance_field(np.pad(~self.cells, self._rim, constant_values=True))

    @property
    def _rim(self) -> int:
        return 2 * math.ceil(MAX_DEPTH_M / self.road.resolution) + 2

    def is_out(self, poses: Floats, half: tuple[float, float], limit: float) -> Bools:
        """Return (P,) whether a point of a footprint is outside by more than 0 and a limit [m]."""
        fits = footprint_fits(self.road, poses, 2.0 * half[0], 2.0 * half[1])
        out = np.asarray(~fits)
        places, least, most = self._bounds(poses[out], _grid(half))
        is_sure = np.asarray((least >= limit + _ROUNDING_M).any(axis=1))
        unsure = (most >= limit - _ROUNDING_M) & ~is_sure[:, None]
        depths = np.zeros(least.shape)
        depths[unsure] = self._depths(places[unsure])
        out[out] = is_sure | ((depths >= limit) & (depths > 0.0)).any(axis=1)
        return out

    def greatest_depths(self, poses: Floats, points: Floats) -> Floats:
        """Return (P, M) how far [m] points (M, 2) of a footprint at poses (P, 3) are outside.

        It is 0 for points that are surely not the farthest ones.
        """
        places, least, most = self._bounds(poses, points)
        deep = most >= least.max() - _ROUNDING_M
        depths = np.zeros(deep.shape)
        depths[deep] = self._depths(places[deep])
        return depths

    def _depths(self, places: Floats) -> Floats:
        """Return (K,) how far [m] places (K, 2) [m] are outside."""
        distance = shapely.distance(shapely.points(places), self.pavement)
        return np.asarray(np.nan_to_num(distance, nan=MAX_DEPTH_M).clip(max=MAX_DEPTH_M))

    def _bounds(self, poses: Floats, points: Floats) -> tuple[Floats, Floats, Floats]:
        """Return places (P, M, 2) of points of a footprint, and their least and greatest depths.

        A point is as deep as the centre of its cell, but for the distance between them.
        """
        places = place(poses[:, None], *points.T)
        cell = to_cells(self.road, places) - self.first + self._rim
        inside = np.clip(np.floor(cell), 0, np.array(self._depth_cells.shape[::-1]) - 1)
        between = np.hypot(*np.moveaxis(cell - inside - 0.5, -1, 0))
        column, row = np.moveaxis(inside.astype(np.int64), -1, 0)
        about, size = self._depth_cells[row, column], self.road.resolution
        between[about == 0.0] = 0.0  # they are in drivable cells
        least = np.minimum((about - between) * size, MAX_DEPTH_M)
        return places, least, np.minimum((about + between) * size, MAX_DEPTH_M)
