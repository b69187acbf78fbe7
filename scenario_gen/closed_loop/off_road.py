# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How far the ego's footprint stayed inside what is drivable, or how deep and how much of it was outside.

Whether it stayed inside at every instant is proven by the checker's kernel; only where that finds
an exit is the depth measured, at poses that lie so close together that no point of the footprint
moves farther than APART between two of them.
"""

import math
from typing import NamedTuple

import numpy as np

from scenario_gen.closed_loop.simulation import Drive
from scenario_gen.method.validity import first_exits, Ground, Proof
from scenario_gen.numerics import Bools, Floats
from scenario_gen.numerics.hermite import control_points
from scenario_gen.numerics.kernels import B2, F1, F2, kernel, OUT2
from scenario_gen.numerics.plane import edge_lengths
from scenario_gen.roads import footprint_fits, to_cells
from scenario_gen.types import Motion, Road
from scenario_gen.types.road import MAX_DEPTH_M

APART = (
    0.05  # metres that a point of the footprint moves at most between two poses that are looked at
)
SPACING = 0.1  # metres between the points of the footprint that are looked at, at most
CORNER = 0.7072  # cells; from a cell's centre to its corner, rounded up
PARTS = 200  # of a step, to which the beginning of anything is told
RESOLUTION = 1e-6  # seconds; what cannot be told apart over such an interval counts


class RoadUse(NamedTuple):
    """What the footprint did to the road's edge.

    Attributes:
        margin: least signed distance [m] to what is not drivable: positive inside, negative the
            greatest depth outside; NaN if no road is known, at most MAX_DEPTH_M either way.
        area: greatest part of the footprint [m²] that was outside at one instant; 0 if it stayed
            inside.
        time: when the depth first reached the limit [s], NaN if it never did.
    """

    margin: float
    area: float
    time: float


def road_use(drive: Drive, road: Road | None, limit: float) -> RoadUse:
    """Measure a drive up to its first jump; off the road is whoever was `limit` [m] deep outside, and outside at all."""
    if road is None or drive.driven < 2:
        return RoadUse(math.nan, 0.0, math.nan)
    motion, ego, until = drive.motion, [drive.ego], slice(drive.driven)
    half, time, heading = (
        motion.vehicles[drive.ego].half,
        motion.time[until],
        motion.heading[ego, until],
    )
    control, out = np.empty((1, len(time) - 1, 4, 2)), np.empty((1, 2))
    control_points(time, motion.position[ego, until], heading, motion.speed[ego, until], control)
    first_exits(time, control, heading, np.array([half]), Ground.of(road), RESOLUTION, out)
    if out[0, 0] == Proof.PROVEN:
        poses = np.column_stack([motion.position[drive.ego, until], heading[0]])
        room = _measured(road, poses, half, outside=False)[:, 0].min()
        return RoadUse(max(float(room), RESOLUTION), 0.0, math.nan)
    deepest, most, begin = 0.0, 0.0, math.nan
    for k in range(len(time) - 1):
        parts = np.linspace(0.0, 1.0, _parts(motion, drive.ego, k) + 1)
        found = _measured(road, poses_in(motion, ego, k, parts)[0], half, outside=True)
        if math.isnan(begin) and (found[:, 0] > 0.0).any() and found[:, 0].max() >= limit:
            fine = _measured(
                road,
                poses_in(motion, ego, k, np.linspace(0.0, 1.0, PARTS + 1))[0],
                half,
                outside=True,
            )[:, 0]
            reached = (fine >= limit) & (fine > 0.0)
            part = int(np.argmax(reached)) / PARTS if reached.any() else 1.0
            begin = float(motion.time[k] + part * (motion.time[k + 1] - motion.time[k]))
        if deepest >= MAX_DEPTH_M and most > 0.0:
            break  # nothing more is told
        deepest, most = max(deepest, float(found[:, 0].max())), max(most, float(found[:, 1].max()))
    return RoadUse(-deepest, most, begin)


def is_off_road(road: Road, pose: Floats, half: tuple[float, float], limit: float) -> bool:
    """Whether a footprint at a pose (3,) is at least `limit` [m] deep off the road, as `road_use` has it."""
    if footprint_fits(road, pose, 2.0 * half[0], 2.0 * half[1])[0]:
        return False
    return bool(_measured(road, pose[None], half, outside=True)[0, 0] >= limit)


def poses_in(motion: Motion, rows: list[int], k: int, u: Floats) -> Floats:
    """Return x, y [m], yaw [rad] (R, U, 3) of vehicles at parts `u` (U,) of step k."""
    start, end = motion.time[k : k + 2]
    return motion.of_vehicles(rows).at(start + u * (end - start)).poses


def _parts(motion: Motion, ego: int, k: int) -> int:
    """Return into how many parts step k is cut."""
    way = float(edge_lengths(motion.position[ego, k : k + 2])[0])
    way = max(
        way, float(motion.speed[ego, k : k + 2].max() * (motion.time[k + 1] - motion.time[k]))
    )
    vehicle = motion.vehicles[ego]
    turn = (
        abs(float(motion.heading[ego, k + 1] - motion.heading[ego, k]))
        * 0.5
        * (vehicle.length + vehicle.width)
    )
    return min(max(math.ceil((way + turn) / APART), 1), PARTS)


def _measured(road: Road, poses: Floats, half: tuple[float, float], *, outside: bool) -> Floats:
    """Return (P, 2): greatest depth [m] and area outside [m²] of a footprint; if not `outside`, the least room [m] and 0."""
    res = road.resolution
    along, across = (np.linspace(-h, h, math.ceil(2.0 * h / SPACING) + 1) for h in half)
    points = np.stack(np.meshgrid(along, across, indexing="ij"), axis=-1)
    if not outside:  # the nearest is on the edge
        points = np.concatenate([points[0], points[-1], points[1:-1, 0], points[1:-1, -1]])
    points = points.reshape(-1, 2) / res
    grid = np.concatenate([to_cells(road, poses[:, :2]), poses[:, 2:]], axis=1)
    out = np.empty((len(poses), 2))
    if outside:
        closed, depth = road.closed_cells, road.depth_cells
        rim = (closed.shape[0] - road.drivable.shape[0]) // 2
        grid[:, :2] += rim
        measure(closed, depth, grid, points, np.array((MAX_DEPTH_M / res, float(rim), 1.0)), out)
        out[:, 1] *= 4.0 * half[0] * half[1] / len(points)
    else:
        measure(
            road.drivable,
            road.clearance_cells,
            grid,
            points,
            np.array((MAX_DEPTH_M / res, 0.0, -1.0)),
            out,
        )
        out[:, 1] = 0.0
    out[:, 0] *= res
    return out


@kernel(B2, F2, F2, F2, F1, OUT2)
def measure(
    solid: Bools, near: Floats, poses: Floats, points: Floats, how: Floats, out: Floats
) -> None:
    """Write how deep the points of a footprint lie in solid cells, for each pose.

    Args:
        solid: (H, W) cells in which a point has a depth; elsewhere it is 0.
        near: (H, W) distance [cells] from each centre to the nearest square that is not solid.
        poses: (P, 3) x, y [cells], yaw [rad].
        points: (M, 2) of the footprint in its own frame [cells].
        how: the largest depth that is told [cells]; width of the rim of `solid`; 1: the largest
            depth is wanted, -1: the least.
        out: (P, 2) that depth [cells], and how many points are in solid cells.
    """
    height, width = solid.shape
    most, rim, largest = how[0], how[1], how[2] > 0.0
    for p in range(poses.shape[0]):
        c, s = np.cos(poses[p, 2]), np.sin(poses[p, 2])
        found = 0.0 if largest else most
        count = 0
        for m in range(
            2 * points.shape[0]
        ):  # once by the distances of centres, then exactly where that leaves it open
            rough = m < points.shape[0]
            x, y = points[m % points.shape[0], 0], points[m % points.shape[0], 1]
            u, v = poses[p, 0] + c * x - s * y, poses[p, 1] + s * x + c * y
            aside, above = (
                max(rim - u, u - (width - rim), 0.0),
                max(rim - v, v - (height - rim), 0.0),
            )
            if (
                not aside * aside + above * above < most * most
            ):  # farther from the grid than is told
                found = most if largest else 0.0
                count += rough
                continue
            i, j = int(np.floor(v)), int(np.floor(u))
            if i < 0 or j < 0 or i >= height or j >= width or not solid[i, j]:
                found = found if largest else 0.0
                continue
            low, best = near[i, j] - CORNER, min(near[i, j] + CORNER, most)
            if rough:
                count += 1
                found = max(found, min(low, most)) if largest else min(found, best)
                continue
            if best <= found if largest else low >= found:
                continue
            k = max(int(low / 1.4143), 1)
            while k - 1 < best:
                for a in range(i - k, i + k + 1):
                    for b in range(j - k, j + k + 1, 1 if a in (i - k, i + k) else 2 * k):
                        if 0 <= a < height and 0 <= b < width and solid[a, b]:
                            continue
                        du, dv = max(b - u, u - b - 1.0, 0.0), max(a - v, v - a - 1.0, 0.0)
                        best = min(best, np.sqrt(du * du + dv * dv))
                k += 1
            found = max(found, best) if largest else min(found, best)
        out[p, 0], out[p, 1] = found, count
