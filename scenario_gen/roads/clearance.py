# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Whether discs and footprints have room on a road, and the nearest pose that has.

The kernels work on `Road.clearance_cells`, with all lengths in cells.
"""

import numpy as np

from scenario_gen.numerics import Bools, Floats
from scenario_gen.numerics.kernels import F, F2, kernel, OUTB1
from scenario_gen.types import Road

CONTACT_CELLS = 1e-9
"""Shapes that are nearer to each other than this touch."""
_HALF_DIAGONAL_CELLS = 0.7072  # rounded up


def to_cells(road: Road, xy: Floats) -> Floats:
    """Return positions (..., 2) [m] in the road's frame as grid coordinates [cells]."""
    return np.ascontiguousarray((np.asarray(xy, dtype=np.float64) - road.origin) / road.resolution)


def to_metres(road: Road, uv: Floats) -> Floats:
    """Return grid coordinates (..., 2) [cells] as positions [m] in the road's frame."""
    return np.asarray(uv * road.resolution + road.origin)


def segments_free(road: Road, start: Floats, end: Floats, radius: float) -> Bools:
    """Return whether a disc can move along each segment, exactly.

    Args:
        road: the grid.
        start: (M, 2) [m].
        end: (M, 2) [m].
        radius: [m]; 0 is a point, which must not even touch a closed cell.

    Returns:
        (M,) True where every closed cell is farther than `radius` from the segment.
    """
    free = np.empty(len(start), dtype=np.bool_)
    check_segments(
        road.clearance_cells,
        to_cells(road, start),
        to_cells(road, end),
        radius / road.resolution,
        free,
    )
    return free


def footprint_fits(road: Road, poses: Floats, length: float, width: float) -> Bools:
    """Return whether a rectangle covers drivable cells only, exactly; it may touch others.

    Args:
        road: the grid.
        poses: (M, 3) x [m], y [m], yaw [rad] of the rectangle's centre.
        length: [m] along the yaw.
        width: [m] across it.

    Returns:
        (M,) bool.
    """
    poses = np.ascontiguousarray(np.reshape(poses, (-1, 3)), dtype=np.float64)
    fits = np.empty(len(poses), dtype=np.bool_)
    check_footprints(
        road.clearance_cells,
        np.concatenate((to_cells(road, poses[:, :2]), poses[:, 2:]), axis=1),
        0.5 * length / road.resolution,
        0.5 * width / road.resolution,
        fits,
    )
    return fits


def nearest_pose_with_room(
    road: Road, pose: Floats, length: float, width: float, max_distance: float = 3.0
) -> tuple[Floats, float] | None:
    """Move a pose as little as its footprint needs to have room; keep its yaw.

    Offsets on a lattice of the grid's resolution are tried, the shortest first. The first that
    fits is shortened as far as the footprint still has room, so the result is within about half a
    cell of the nearest pose.

    Args:
        road: the grid.
        pose: (3,) x [m], y [m], yaw [rad].
        length: of the footprint [m].
        width: of the footprint [m].
        max_distance: [m] of the longest offset.

    Returns:
        The pose (3,) and how far it was moved [m]; None if no offset gives it room.
    """
    pose = np.array(pose, dtype=np.float64)
    if footprint_fits(road, pose[None], length, width)[0]:
        return pose, 0.0

    reach = int(max_distance / road.resolution)
    steps = np.arange(-reach, reach + 1) * road.resolution
    offset = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    distance = np.hypot(offset[:, 0], offset[:, 1])
    order = np.argsort(distance, kind="stable")
    order = order[distance[order] <= max_distance]
    candidates = pose + np.pad(offset[order], ((0, 0), (0, 1)))
    fits = footprint_fits(road, candidates, length, width)
    if not fits.any():
        return None

    shift = candidates[np.argmax(fits)] - pose
    blocked, free = 0.0, 1.0
    for _ in range(20):  # bisections: to a millionth of the offset
        half = 0.5 * (blocked + free)
        if footprint_fits(road, (pose + half * shift)[None], length, width)[0]:
            free = half
        else:
            blocked = half
    moved = pose + free * shift
    return moved, float(np.hypot(*(moved - pose)[:2]))


@kernel(inline=True)
def _segment_enters_square(
    ax: float, ay: float, dx: float, dy: float, left: float, low: float
) -> bool:
    """Return whether the segment from a by d meets the unit square.

    Source: the clipping of Liang & Barsky 1984.
    """
    enter, leave = 0.0, 1.0
    for axis in range(2):
        d, near = (dx, left - ax) if axis == 0 else (dy, low - ay)
        far = near + 1.0
        if d == 0.0:
            if near > 0.0 or far < 0.0:
                leave = -1.0
        else:
            near, far = near / d, far / d
            enter, leave = max(enter, min(near, far)), min(leave, max(near, far))
    return enter <= leave


@kernel(inline=True)
def _gap_squared(ax: float, ay: float, bx: float, by: float, left: float, low: float) -> float:
    """Return the squared distance from segment a-b to the unit square with corner (left, low)."""
    dx, dy = bx - ax, by - ay
    if _segment_enters_square(ax, ay, dx, dy, left, low):
        return 0.0
    gap = np.inf
    for end in range(2):  # from the segment's ends to the square
        x, y = (ax, ay) if end == 0 else (bx, by)
        ex = max(left - x, x - left - 1.0, 0.0)
        ey = max(low - y, y - low - 1.0, 0.0)
        gap = min(gap, ex * ex + ey * ey)
    square = dx * dx + dy * dy
    if square > 0.0:
        for corner in range(4):  # from the square's corners to the segment
            x, y = left + (corner & 1) - ax, low + (corner >> 1) - ay
            t = min(max((x * dx + y * dy) / square, 0.0), 1.0)
            ex, ey = x - t * dx, y - t * dy
            gap = min(gap, ex * ex + ey * ey)
    return gap


@kernel(inline=True)
def is_open(clearance: Floats, i: int, j: int) -> bool:
    """Return whether a cell is inside the grid and drivable."""
    height, width = clearance.shape
    if not (0 <= i < height and 0 <= j < width):
        return False
    return bool(clearance[i, j] != 0.0)


@kernel(inline=True)
def _near_squares_free(
    clearance: Floats, ax: float, ay: float, bx: float, by: float, radius: float
) -> bool:
    """Return whether each closed square is farther than `radius` from a short segment a-b."""
    reach = radius + CONTACT_CELLS
    for i in range(int(np.floor(min(ay, by) - reach)), int(np.floor(max(ay, by) + reach)) + 1):
        for j in range(int(np.floor(min(ax, bx) - reach)), int(np.floor(max(ax, bx) + reach)) + 1):
            if (
                not is_open(clearance, i, j)
                and _gap_squared(ax, ay, bx, by, j, i) <= reach * reach
            ):
                return False
    return True


@kernel(F2, F, F, F, F, F, on_demand=True)
def segment_free(
    clearance: Floats, ax: float, ay: float, bx: float, by: float, radius: float
) -> bool:
    """Return whether a disc can move from a to b, exactly.

    The clearance field (H, W) skips what is surely free; where it does not suffice, the squares
    themselves are checked.

    Source: sphere tracing (Hart 1996).
    """
    height, width = clearance.shape
    dx, dy = bx - ax, by - ay
    length = np.sqrt(dx * dx + dy * dy)
    if length > 0.0:
        dx, dy = dx / length, dy / length
    t = 0.0
    while True:
        x, y = ax + t * dx, ay + t * dy
        i, j = int(np.floor(y)), int(np.floor(x))
        if i < 0 or j < 0 or i >= height or j >= width:
            return False
        at_centre = clearance[i, j]
        if at_centre == 0.0 or at_centre + _HALF_DIAGONAL_CELLS <= radius:
            return False
        ex, ey = x - j - 0.5, y - i - 0.5
        room = at_centre - np.sqrt(ex * ex + ey * ey) - radius  # a free ball about (x, y)
        if room < 0.5:
            room = min(1.0, length - t)
            if not _near_squares_free(clearance, x, y, x + room * dx, y + room * dy, radius):
                return False
        t += room
        if t >= length:
            return True


@kernel(F2, F2, F2, F, OUTB1, on_demand=True)
def check_segments(
    clearance: Floats, start: Floats, end: Floats, radius: float, free: Bools
) -> None:
    """Apply `segment_free` to M segments; start and end (M, 2); writes free (M,)."""
    for m in range(start.shape[0]):
        free[m] = segment_free(clearance, start[m, 0], start[m, 1], end[m, 0], end[m, 1], radius)


@kernel(inline=True)
def _extent_in_row(corner_x: Floats, corner_y: Floats, i: int) -> tuple[float, float]:
    """Return the lowest and highest x of a rectangle, corners (4,), within row i of the cells."""
    low, high = np.inf, -np.inf
    for k in range(4):
        x0, y0 = corner_x[k], corner_y[k]
        x1, y1 = corner_x[(k + 1) % 4], corner_y[(k + 1) % 4]
        if i <= y0 <= i + 1:
            low, high = min(low, x0), max(high, x0)
        for line in (i, i + 1):
            if (y0 - line) * (y1 - line) < 0.0:
                cut = x0 + (line - y0) / (y1 - y0) * (x1 - x0)
                low, high = min(low, cut), max(high, cut)
    return low, high


@kernel(inline=True)
def footprint_free(
    clearance: Floats, x: float, y: float, yaw: float, half_length: float, half_width: float
) -> bool:
    """Return whether the rectangle at one pose covers drivable cells only."""
    i, j = int(np.floor(y)), int(np.floor(x))
    if not is_open(clearance, i, j):
        return False
    reach = np.sqrt(half_length * half_length + half_width * half_width)
    if clearance[i, j] - _HALF_DIAGONAL_CELLS >= reach:
        return True
    c, s = np.cos(yaw), np.sin(yaw)
    corner_x, corner_y = np.empty(4), np.empty(4)
    for k in range(4):
        u = half_length if k in (0, 3) else -half_length
        v = half_width if k < 2 else -half_width
        corner_x[k], corner_y[k] = x + c * u - s * v, y + s * u + c * v
    first = int(np.floor(corner_y.min() + CONTACT_CELLS))
    last = int(np.ceil(corner_y.max() - CONTACT_CELLS))
    for i in range(first, last):
        low, high = _extent_in_row(corner_x, corner_y, i)
        for j in range(int(np.floor(low + CONTACT_CELLS)), int(np.ceil(high - CONTACT_CELLS))):
            if not is_open(clearance, i, j):
                return False
    return True


@kernel(F2, F2, F, F, OUTB1)
def check_footprints(
    clearance: Floats, poses: Floats, half_length: float, half_width: float, fits: Bools
) -> None:
    """Check M footprints with poses (M, 3) in cells and rad; writes fits (M,)."""
    for m in range(poses.shape[0]):
        fits[m] = footprint_free(
            clearance, poses[m, 0], poses[m, 1], poses[m, 2], half_length, half_width
        )
