# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How far the ego's footprint stayed inside the drivable area, or how much of it was outside.

The kernel of the validity check proves whether the footprint stayed inside at every instant. Only
if it reports an exit, the depth is measured, at poses so close together that no point of the
footprint moves more than POSE_SPACING_M from one to the next.
"""

from functools import lru_cache
import math
from typing import NamedTuple

import numpy as np

from scenario_gen.closed_loop.drive import Drive
from scenario_gen.method.validity import first_exits, Ground, Proof
from scenario_gen.numerics import Bools, Floats, frozen
from scenario_gen.numerics.boxes import footprint_gaps
from scenario_gen.numerics.hermite import control_points
from scenario_gen.numerics.kernels import B2, F, F2, kernel, OUT2
from scenario_gen.numerics.plane import edge_lengths
from scenario_gen.roads import footprint_fits, to_cells
from scenario_gen.types import Motion, Obstacle, Road
from scenario_gen.types.road import MAX_DEPTH_M

POSE_SPACING_M = 0.05
POINT_SPACING_M = 0.1  # greatest distance between sampled points of the footprint
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
        return RoadUse(max(_least_room(road, motion.poses[0], half), RESOLUTION_S), 0.0, math.nan)
    return _excursion(road, motion, limit)


def _excursion(road: Road, motion: Motion, limit: float) -> RoadUse:
    """Measure the motion of one vehicle that leaves the road."""
    half = motion.vehicles[0].half
    deepest, largest_area, begin = 0.0, 0.0, math.nan
    for k in range(len(motion.time) - 1):
        depth, area = _depths_and_areas(road, _poses_in(motion, k, _pose_count(motion, k)), half)
        if math.isnan(begin) and depth.max() > 0.0 and depth.max() >= limit:
            reached_at = int(np.argmax((depth >= limit) & (depth > 0.0))) / (len(depth) - 1)
            last = math.ceil(reached_at * SUBSTEPS_COUNT) + 1
            fine, _ = _depths_and_areas(road, _poses_in(motion, k, SUBSTEPS_COUNT)[:last], half)
            reached = (fine >= limit) & (fine > 0.0)
            share = int(np.argmax(reached)) / SUBSTEPS_COUNT if reached.any() else 1.0
            begin = float(motion.time[k] + share * (motion.time[k + 1] - motion.time[k]))
        if deepest >= MAX_DEPTH_M and largest_area > 0.0:
            break  # greater depths are not reported
        deepest = max(deepest, float(depth.max()))
        largest_area = max(largest_area, float(area.max()))
    return RoadUse(-deepest, largest_area, begin)


def first_obstacle(drive: Drive, road: Road | None) -> tuple[float, Obstacle] | None:
    """Return when a drive first touches an obstacle [s], and which; None if it touches none.

    The drive is measured up to its first jump, at poses as close together as in `road_use`.
    """
    if road is None or not road.obstacles or drive.driven < 2:
        return None
    motion = drive.motion.select([drive.ego], 0, drive.driven - 1)
    for k in range(len(motion.time) - 1):
        poses = _poses_in(motion, k, _pose_count(motion, k))
        touches = _touches(road, poses, motion.vehicles[0].half)
        if touches.any():
            instant, obstacle = np.argwhere(touches)[0].tolist()
            share = instant / (len(poses) - 1)
            time = motion.time[k] + share * (motion.time[k + 1] - motion.time[k])
            return float(time), road.obstacles[obstacle]
    return None


def _touches(road: Road, poses: Floats, half: tuple[float, float]) -> Bools:
    """Return (P, K) whether a footprint at poses (P, 3) overlaps each obstacle of a road."""
    touches = np.zeros((len(poses), len(road.obstacles)), dtype=np.bool_)
    for k, obstacle in enumerate(road.obstacles):
        place = np.tile(obstacle[:3], (len(poses), 1))
        size = (obstacle.length / 2.0, obstacle.width / 2.0)
        touches[:, k] = footprint_gaps(half, poses, size, place)[0] < 0.0
    return touches


def is_off_road(road: Road, pose: Floats, half: tuple[float, float], limit: float) -> bool:
    """Whether a footprint at a pose (3,) is off the road, as in `road_use`, or in an obstacle."""
    if footprint_fits(road, pose, 2.0 * half[0], 2.0 * half[1])[0]:
        return False
    if _touches(road, pose[None], half).any():
        return True
    depth, _ = _depths_and_areas(road, pose[None], half)
    return bool(depth[0] >= limit)


def _poses_in(motion: Motion, k: int, count: int) -> Floats:
    """Return poses (count + 1, 3) of the first vehicle, evenly spread over step k."""
    start, end = motion.time[k : k + 2]
    times = start + np.linspace(0.0, 1.0, count + 1) * (end - start)
    return np.asarray(motion.at(times).poses[0])


def _pose_count(motion: Motion, k: int) -> int:
    """Return the number of intervals into which step k is divided."""
    distance = float(edge_lengths(motion.position[0, k : k + 2])[0])
    step = motion.time[k + 1] - motion.time[k]
    distance = max(distance, float(motion.speed[0, k : k + 2].max() * step))
    turn = abs(float(motion.heading[0, k + 1] - motion.heading[0, k]))
    distance += turn * sum(motion.vehicles[0].half)
    return min(max(math.ceil(distance / POSE_SPACING_M), 1), SUBSTEPS_COUNT)


@lru_cache(maxsize=64)
def _footprint_points(half: tuple[float, float]) -> Floats:
    """Return points (A, B, 2) [m] of a footprint in its frame."""
    along, across = (np.linspace(-h, h, math.ceil(2.0 * h / POINT_SPACING_M) + 1) for h in half)
    return frozen(np.stack(np.meshgrid(along, across, indexing="ij"), axis=-1))


def _cell_poses(road: Road, poses: Floats) -> Floats:
    """Return poses (P, 3) with x, y in cells."""
    return np.concatenate([to_cells(road, poses[:, :2]), poses[:, 2:]], axis=1)


def _depths_and_areas(
    road: Road, poses: Floats, half: tuple[float, float]
) -> tuple[Floats, Floats]:
    """Return (P,) greatest depths [m] and (P,) areas [m²] of a footprint outside the road."""
    points = _footprint_points(half).reshape(-1, 2) / road.resolution
    closed = road.closed_cells
    rim = (closed.shape[0] - road.drivable.shape[0]) // 2
    outside = ~footprint_fits(road, poses, 2.0 * half[0], 2.0 * half[1])
    grid = _cell_poses(road, poses[outside])
    grid[:, :2] += rim
    outcome = np.empty((len(grid), 2))
    out = np.zeros((len(poses), 2))
    limit = MAX_DEPTH_M / road.resolution
    greatest_depths(closed, road.depth_cells, grid, points, float(rim), limit, outcome)
    out[outside] = outcome
    return out[:, 0] * road.resolution, out[:, 1] * (4.0 * half[0] * half[1] / len(points))


def _least_room(road: Road, poses: Floats, half: tuple[float, float]) -> float:
    """Return the least distance [m] from a footprint at poses (P, 3) to the road's edge."""
    grid = _footprint_points(half)  # the nearest point is on the outline
    outline = np.concatenate([grid[0], grid[-1], grid[1:-1, 0], grid[1:-1, -1]]) / road.resolution
    limit = MAX_DEPTH_M / road.resolution
    grid = _cell_poses(road, poses)
    depth = least_depth(road.drivable, road.clearance_cells, grid, outline, limit)
    return float(depth * road.resolution)


@kernel(B2, F2, F2, F2, F, F, OUT2)
def greatest_depths(
    solid: Bools,
    distance: Floats,
    poses: Floats,
    points: Floats,
    rim: float,
    limit: float,
    out: Floats,
) -> None:
    """Write the depth of the deepest point of a footprint in solid cells, for each pose.

    Args:
        solid: (H, W) cells in which a point has a depth; elsewhere it is 0.
        distance: (H, W) distance [cells] from each centre to the nearest square that is not solid.
        poses: (P, 3) x, y [cells], yaw [rad].
        points: (M, 2) points of the footprint in its own frame [cells].
        rim: width of the rim of `solid` [cells]; a point farther than `limit` from the grid inside
            the rim has the depth `limit`.
        limit: greatest depth that is reported [cells].
        out: (P, 2) the depth [cells], and the number of points in solid cells.
    """
    for p in range(poses.shape[0]):
        deepest, count = 0.0, 0
        c, s = np.cos(poses[p, 2]), np.sin(poses[p, 2])
        for m in range(points.shape[0]):
            u, v = _point_at(poses[p], c, s, points[m])
            low, high = _depth_bounds(solid, distance, u, v, rim, limit)
            deepest = max(deepest, low)
            count += high > 0.0
        for m in range(points.shape[0]):
            u, v = _point_at(poses[p], c, s, points[m])
            if _depth_bounds(solid, distance, u, v, rim, limit)[1] > deepest:
                deepest = max(deepest, _exact_depth(solid, distance, u, v, limit))
        out[p, 0], out[p, 1] = deepest, count


@kernel(B2, F2, F2, F2, F)
def least_depth(
    solid: Bools, distance: Floats, poses: Floats, points: Floats, limit: float
) -> float:
    """Return the depth [cells] of the least deep point at all poses; see `greatest_depths`."""
    least = limit
    for p in range(poses.shape[0]):
        c, s = np.cos(poses[p, 2]), np.sin(poses[p, 2])
        for m in range(points.shape[0]):
            u, v = _point_at(poses[p], c, s, points[m])
            least = min(least, _depth_bounds(solid, distance, u, v, 0.0, limit)[1])
    for p in range(poses.shape[0]):
        c, s = np.cos(poses[p, 2]), np.sin(poses[p, 2])
        for m in range(points.shape[0]):
            u, v = _point_at(poses[p], c, s, points[m])
            if _depth_bounds(solid, distance, u, v, 0.0, limit)[0] < least:
                least = min(least, _exact_depth(solid, distance, u, v, limit))
    return least


@kernel(inline=True)
def _point_at(pose: Floats, c: float, s: float, point: Floats) -> tuple[float, float]:
    """Return x and y [cells] of a point of a footprint at a pose, by its cosine and sine."""
    return pose[0] + c * point[0] - s * point[1], pose[1] + s * point[0] + c * point[1]


@kernel(inline=True)
def _depth_bounds(
    solid: Bools, distance: Floats, u: float, v: float, rim: float, limit: float
) -> tuple[float, float]:
    """Return bounds of the depth of a point, by the distance of its cell's centre."""
    height, width = solid.shape
    if rim > 0.0:
        beyond_x = max(rim - u, u - (width - rim), 0.0)
        beyond_y = max(rim - v, v - (height - rim), 0.0)
        if not beyond_x * beyond_x + beyond_y * beyond_y < limit * limit:
            return limit, limit
    i, j = int(np.floor(v)), int(np.floor(u))
    if i < 0 or j < 0 or i >= height or j >= width or not solid[i, j]:
        return 0.0, 0.0
    du, dv = u - j - 0.5, v - i - 0.5  # from the centre of the cell
    offset = np.sqrt(du * du + dv * dv) + 1e-9
    low = min(max(distance[i, j] - offset, 0.0), limit)
    return low, min(distance[i, j] + offset, limit)


@kernel(inline=True)
def _exact_depth(solid: Bools, distance: Floats, u: float, v: float, limit: float) -> float:
    """Return the distance [cells] from a point in a solid cell to the nearest other square."""
    i, j = int(np.floor(v)), int(np.floor(u))
    best = _depth_bounds(solid, distance, u, v, 0.0, limit)[1]
    reach = int(best) + 1
    for a in range(i - reach, i + reach + 1):
        dv = max(a - v, v - a - 1.0, 0.0)
        if dv < best:
            # Squares nearer to the centre of the point's cell than `distance` are solid.
            before = max(abs(a - i) - 0.5, 0.0)
            solid_reach = np.sqrt(max(distance[i, j] ** 2 - before * before, 0.0))
            first = int(solid_reach + 0.5 - 1e-6)
            last = int(np.sqrt(best * best - dv * dv)) + 1
            best = min(best, _distance_in_row(solid, u, a, first, last, dv))
    return best


@kernel(inline=True)
def _distance_in_row(solid: Bools, u: float, row: int, first: int, last: int, dv: float) -> float:
    """Return the distance to the nearest square that is not solid, among some of one row.

    Their columns are `first` to `last` away from that of the point; the row is `dv` away.
    """
    height, width = solid.shape
    best = np.inf
    for k in range(first, last + 1):
        for b in (int(np.floor(u)) - k, int(np.floor(u)) + k):
            if row < 0 or b < 0 or row >= height or b >= width or not solid[row, b]:
                du = max(b - u, u - b - 1.0, 0.0)
                best = min(best, np.sqrt(du * du + dv * dv))
    return best
