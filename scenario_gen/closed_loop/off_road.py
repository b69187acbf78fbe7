# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How far the ego's footprint stayed inside the drivable area, or how much of it was outside.

The kernel of the validity check proves whether the footprint stayed inside at every instant. Only
if it reports an exit, the depth is measured, at poses so close together that no point of the
footprint moves more than POSE_SPACING_M from one to the next.
"""

from bisect import bisect_left
import math
from typing import Any, NamedTuple

import numpy as np
import shapely

from scenario_gen.closed_loop.drive import Drive
from scenario_gen.method.validity import first_exits, Ground, Proof
from scenario_gen.numerics import Bools, edge_lengths, Floats
from scenario_gen.numerics.boxes import Box, box_distance, box_gap, corners
from scenario_gen.numerics.hermite import control_points
from scenario_gen.numerics.kernels import F, F2, kernel
from scenario_gen.roads import to_cells
from scenario_gen.roads.clearance import footprint_free, is_open
from scenario_gen.types import Motion, Obstacle, Road

POSE_SPACING_M = 0.05
MAX_DEPTH_M = 10.0  # room and depth are measured up to this
DEPTH_ERROR_M = 0.001
SUBSTEPS_COUNT = 200  # per step, to locate the beginning of an event
RESOLUTION_S = 1e-6  # an event that cannot be excluded over such an interval counts
_HALF_DIAGONAL_CELLS = 0.7072  # rounded up


class RoadUse(NamedTuple):
    """The footprint's position with respect to the road's edge.

    Attributes:
        margin: least signed distance [m] to the area that is not drivable: positive inside,
            negative the greatest depth outside; NaN if no road is known, at most MAX_DEPTH_M
            either way.
        time: first time at which the depth reached the limit [s], NaN if it never did.
    """

    margin: float
    time: float


def road_use(drive: Drive, road: Road | None, limit: float) -> RoadUse:
    """Measure a drive up to its first jump.

    The ego leaves the road when its footprint is outside by more than 0 and at least `limit` [m].
    """
    if road is None or drive.driven < 2:
        return RoadUse(math.nan, math.nan)
    motion = drive.motion.select([drive.ego], 0, drive.driven - 1)
    half = motion.vehicles[0].half
    control, out = np.empty((1, len(motion.time) - 1, 4, 2)), np.empty((1, 2))
    control_points(motion.time, motion.position, motion.heading, motion.speed, control)
    first_exits(
        motion.time, control, motion.heading, np.array([half]), Ground.of(road), RESOLUTION_S, out
    )
    if out[0, 0] == Proof.PROVEN:
        return RoadUse(max(_room(road, motion.poses[0], half), RESOLUTION_S), math.nan)

    def first_out(time: Floats) -> int:
        return _first_out(road, motion.at(time).poses[0], half, limit)

    time = _fine_times(motion)
    last = motion.time[first_out(motion.time)]  # the last sample, if none is out
    time = np.union1d(time[time <= last], motion.time)
    begin = math.nan
    k = first_out(time)
    if k >= 0:
        between = np.linspace(time[max(k - 1, 0)], time[k], SUBSTEPS_COUNT + 1)
        substeps = range(SUBSTEPS_COUNT)
        begin = float(between[bisect_left(substeps, 0, key=lambda n: first_out(between[[n]]))])
    depth = _depth(road, motion.at(time).poses[0], half)
    return RoadUse(-depth, begin)


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
    column, row = to_cells(road, pose[:2]).astype(np.int64).tolist()
    height, width = road.drivable.shape
    has_room = False
    if 0 <= column < width and 0 <= row < height:
        room = road.clearance_cells[row, column] - _HALF_DIAGONAL_CELLS
        has_room = bool(room * road.resolution > math.hypot(*half))
    if not has_room and _first_out(road, pose[None], half, limit) == 0:
        return True
    return bool(road.obstacles) and bool(_touches(road, pose[None], half).any())


def _fine_times(motion: Motion) -> Floats:
    """Return times [s] between which no point of a vehicle moves by more than POSE_SPACING_M."""
    distance = np.maximum(edge_lengths(motion.position[0]), motion.speed[0, 1:] * motion.dt)
    distance += np.abs(np.diff(motion.heading[0])) * sum(motion.vehicles[0].half)
    count = math.ceil(np.clip(distance.max() / POSE_SPACING_M, 1.0, SUBSTEPS_COUNT))
    steps = len(motion.time) - 1
    place_in_steps = np.linspace(0.0, steps, steps * count + 1)
    return np.asarray(np.interp(place_in_steps, np.arange(steps + 1), motion.time))


def _footprints(poses: Floats, half: tuple[float, float]) -> Any:
    """Return the footprints (P,) at poses (P, 3) as polygons."""
    return shapely.polygons(corners(poses, 2.0 * half[0], 2.0 * half[1]))


def _in_cells(road: Road, poses: Floats) -> Floats:
    """Return poses (P, 3) [m, m, rad] with positions in the road's grid [cells]."""
    return np.concatenate((to_cells(road, poses[:, :2]), poses[:, 2:3]), axis=1)


def _first_out(road: Road, poses: Floats, half: tuple[float, float], limit: float) -> int:
    """Return the first of poses (P, 3) at which a footprint is off the road; -1 without any.

    It is outside by more than 0 and at least a limit [m].
    """
    known, enough = max(limit - DEPTH_ERROR_M, 0.0), max(limit, RESOLUTION_S)
    lengths = np.array((*half, known, enough, MAX_DEPTH_M, DEPTH_ERROR_M)) / road.resolution
    return int(first_deep(road.clearance_cells, _in_cells(road, poses), *lengths))


def _depth(road: Road, poses: Floats, half: tuple[float, float]) -> float:
    """Return how far [m] a footprint at poses (P, 3) is outside at most."""
    size = road.resolution
    lengths = np.array((*half, MAX_DEPTH_M, DEPTH_ERROR_M)) / size
    depth = greatest_depth(road.clearance_cells, _in_cells(road, poses), *lengths) * size
    return float(min(depth, MAX_DEPTH_M))


def _room(road: Road, poses: Floats, half: tuple[float, float]) -> float:
    """Return the least distance [m] from a footprint at poses (P, 3) to closed cells."""
    size = road.resolution
    scaled = (half[0] / size, half[1] / size, MAX_DEPTH_M / size)
    return float(least_room(road.clearance_cells, _in_cells(road, poses), *scaled) * size)


@kernel(inline=True)
def _nearest_open(
    clearance: Floats, x: float, y: float, farthest: float
) -> tuple[float, int, int]:
    """Return the distance [cells] to the nearest drivable square, and its column and row.

    Rings of squares around the point, until the next ring is farther away.
    """
    column, row = int(np.floor(x)), int(np.floor(y))
    best, best_column, best_row, ring = farthest, column, row, 0
    while ring - 1.0 < best:
        for i in range(row - ring, row + ring + 1):
            stride = 1 if abs(i - row) == ring else 2 * ring
            for j in range(column - ring, column + ring + 1, stride):
                gap = _to_square(x, y, j, i)
                if gap < best and is_open(clearance, i, j):
                    best, best_column, best_row = gap, j, i
        ring += 1
    return best, best_column, best_row


@kernel(inline=True)
def _to_square(x: float, y: float, column: int, row: int) -> float:
    """Return the distance [cells] from a point to a square."""
    across = max(column - x, x - column - 1.0, 0.0)
    return float(np.hypot(across, max(row - y, y - row - 1.0, 0.0)))


@kernel(inline=True)
def _farthest_corner(part: Box, column: int, row: int) -> tuple[float, float, float]:
    """Return the distance [cells] of a rectangle's farthest corner from a square, and its x, y."""
    farthest, far_x, far_y = -1.0, part.x, part.y
    for ahead in (-part.length, part.length):
        for left in (-part.width, part.width):
            x = part.x + ahead * part.cos - left * part.sin
            y = part.y + ahead * part.sin + left * part.cos
            distance = _to_square(x, y, column, row)
            if distance > farthest:
                farthest, far_x, far_y = distance, x, y
    return farthest, far_x, far_y


@kernel(inline=True)
def _halves(part: Box) -> tuple[Box, Box]:
    """Return the halves of a rectangle, divided across its longer side."""
    x, y, cos, sin, length, width = part
    if length > width:
        dx, dy = 0.5 * length * cos, 0.5 * length * sin
        length *= 0.5
    else:
        dx, dy = -0.5 * width * sin, 0.5 * width * cos
        width *= 0.5
    return (
        Box(x - dx, y - dy, cos, sin, length, width),
        Box(x + dx, y + dy, cos, sin, length, width),
    )


@kernel(inline=True)
def _deeper(
    clearance: Floats,
    whole: Box,
    yaw: float,
    best: float,
    enough: float,
    farthest: float,
    error: float,
) -> float:
    """Return how far points of a rectangle are at most from drivable squares, or `best` [cells].

    Branch and bound: no point of a part of the rectangle is farther than its farthest corner from
    the square that is nearest to its centre. The search ends at a depth that is enough.
    """
    parts = [whole]
    while len(parts) > 0 and best < enough:
        part = parts.pop()
        if footprint_free(clearance, part.x, part.y, yaw, part.length, part.width):
            continue
        _, column, row = _nearest_open(clearance, part.x, part.y, farthest)
        bound, x, y = _farthest_corner(part, column, row)
        best = max(best, _nearest_open(clearance, x, y, farthest)[0])
        if min(bound, farthest) > best + error:
            parts.extend(_halves(part))
    return best


@kernel(F2, F2, F, F, F, F)
def greatest_depth(
    clearance: Floats,
    poses: Floats,
    half_length: float,
    half_width: float,
    farthest: float,
    error: float,
) -> float:
    """Return how far points of a rectangle are at most from drivable squares (H, W) [cells].

    Args:
        clearance: (H, W) of the squares.
        poses: (P, 3) of the rectangle: x, y, like all lengths in cells, and yaw [rad].
        half_length: along the yaw.
        half_width: across it.
        farthest: a depth that is not exceeded.
        error: of the depth.
    """
    best = 0.0
    for p in range(len(poses) - 1, -1, -1):  # a drive off the road is deepest at its end
        x, y, yaw = poses[p]
        whole = Box(x, y, np.cos(yaw), np.sin(yaw), half_length, half_width)
        best = _deeper(clearance, whole, yaw, best, farthest, farthest, error)
    return best


@kernel(F2, F2, F, F, F, F, F, F)
def first_deep(
    clearance: Floats,
    poses: Floats,
    half_length: float,
    half_width: float,
    known: float,
    enough: float,
    farthest: float,
    error: float,
) -> int:
    """Return the first pose at which a rectangle is deep enough off the road; -1 without any.

    Args:
        clearance: as in `greatest_depth`.
        poses: as there.
        half_length: as there.
        half_width: as there.
        known: a depth that is not enough, by the error.
        enough: the depth [cells].
        farthest: as there.
        error: as there.
    """
    for p in range(len(poses)):
        x, y, yaw = poses[p]
        whole = Box(x, y, np.cos(yaw), np.sin(yaw), half_length, half_width)
        if _deeper(clearance, whole, yaw, known, enough, farthest, error) >= enough:
            return p
    return -1


@kernel(F2, F2, F, F, F)
def least_room(
    clearance: Floats, poses: Floats, half_length: float, half_width: float, farthest: float
) -> float:
    """Return the least distance from a rectangle at poses (P, 3) to closed squares [cells].

    The clearance field (H, W) tells which poses and squares cannot be nearer than the best.
    """
    radius = np.hypot(half_length, half_width)
    best = farthest
    for p in range(len(poses)):
        x, y = poses[p, 0], poses[p, 1]
        if clearance[int(y), int(x)] - _HALF_DIAGONAL_CELLS - radius >= best:
            continue
        box = Box(x, y, np.cos(poses[p, 2]), np.sin(poses[p, 2]), half_length, half_width)
        reach = best + radius
        for i in range(int(np.floor(y - reach)), int(y + reach) + 1):
            for j in range(int(np.floor(x - reach)), int(x + reach) + 1):
                if not is_open(clearance, i, j):
                    square = Box(j + 0.5, i + 0.5, 1.0, 0.0, 0.5, 0.5)
                    if box_gap(box, square) < best:  # at most the distance
                        best = min(best, box_distance(box, square))
    return best
