# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Distance to the nearest obstacle, whether discs and footprints have room, and the nearest pose that has."""

import numpy as np

from scenario_gen.numerics import Bools, Counts, Floats, sealed
from scenario_gen.numerics.kernels import B2, F, F2, kernel, OUT2, OUTB1
from scenario_gen.types import once_per_object, Road

CONTACT = 1e-9  # [cells] what lies nearer than this touches


@once_per_object
def clearance_field(road: Road) -> Floats:
    """Distance [m] from every cell's centre to the nearest non-drivable cell, 0 in such cells.

    Outside the grid counts as not drivable. Computed once per Road object and kept as long as it lives.

    Returns:
        (H, W), read-only.
    """
    return sealed(clearance_in_cells(road) * road.resolution)


@once_per_object
def clearance_in_cells(road: Road) -> Floats:
    """The same field in units of cells, for kernels: (H, W), read-only."""
    cells = np.empty(road.drivable.shape)
    distance_transform(road.drivable, cells)
    return sealed(cells)


@once_per_object
def blocked_before(road: Road) -> Counts:
    """(H, W + 1): how many cells left of each column are not drivable: any run of a row is looked up in one step; cached."""
    return sealed(np.pad(np.cumsum(~road.drivable, axis=1, dtype=np.int32), ((0, 0), (1, 0))))


def to_cells(road: Road, xy: Floats) -> Floats:
    """Positions (..., 2) [m] in the road's frame to grid coordinates [cells]."""
    return np.ascontiguousarray((np.asarray(xy, dtype=np.float64) - road.origin) / road.resolution)


def to_metres(road: Road, uv: Floats) -> Floats:
    """Grid coordinates (..., 2) [cells] to positions [m] in the road's frame."""
    return np.asarray(uv * road.resolution + road.origin)


def segments_free(road: Road, start: Floats, end: Floats, radius: float) -> Bools:
    """Whether a disc of `radius` [m] can move along each segment, exactly.

    Args:
        road: the grid.
        start: (M, 2) metres.
        end: (M, 2) metres.
        radius: disc radius in metres; 0 is a point, which must not even touch a non-drivable cell.

    Returns:
        (M,) True where every non-drivable cell is farther than `radius` from the segment.
    """
    free = np.empty(len(start), dtype=np.bool_)
    check_segments(
        clearance_in_cells(road),
        to_cells(road, start),
        to_cells(road, end),
        radius / road.resolution,
        free,
    )
    return free


def footprint_fits(road: Road, poses: Floats, length: float, width: float) -> Bools:
    """Whether an oriented rectangle centred at each pose covers drivable cells only, exactly (touching is allowed).

    Args:
        road: the grid.
        poses: (M, 3) x [m], y [m], yaw [rad] of the rectangle's centre.
        length: metres along the yaw.
        width: metres across it.

    Returns:
        (M,) bool.
    """
    poses = np.ascontiguousarray(np.reshape(poses, (-1, 3)), dtype=np.float64)
    fits = np.empty(len(poses), dtype=np.bool_)
    grid = np.concatenate((to_cells(road, poses[:, :2]), poses[:, 2:]), axis=1)
    check_footprints(
        clearance_in_cells(road),
        grid,
        0.5 * length / road.resolution,
        0.5 * width / road.resolution,
        fits,
    )
    return fits


@kernel(B2, OUT2)
def distance_transform(drivable: Bools, out: Floats) -> None:
    """Fill `out` (H, W) with the distance [cells] from each centre to the nearest non-drivable square.

    Source: the lower envelope of parabolas (Felzenszwalb & Huttenlocher 2012), here of squares instead of points.
    """
    height, width = drivable.shape
    for i in range(height):  # down the columns: cells to the nearest non-drivable one above
        for j in range(width):
            above = out[i - 1, j] if i > 0 else 0.0
            out[i, j] = above + 1.0 if drivable[i, j] else 0.0
    for i in range(height - 1, -1, -1):  # up again
        for j in range(width):
            below = out[i + 1, j] if i < height - 1 else 0.0
            out[i, j] = min(out[i, j], below + 1.0)
    site = np.empty(
        width + 2, dtype=np.int64
    )  # columns on the lower envelope, and where each begins to rule
    begin = np.empty(width + 3, dtype=np.int64)
    level = np.empty(width + 2)
    for i in range(height):  # along the rows: the lower envelope of phi(x - j) + h_j^2
        site[0], begin[0], level[0] = -1, 0, 0.0
        top = 0
        for j in range(width + 1):
            h = max(out[i, j] - 0.5, 0.0) if j < width else 0.0
            square = h * h
            first = _overtakes(site[top], level[top], j, square)
            while top > 0 and first <= begin[top]:
                top -= 1
                first = _overtakes(site[top], level[top], j, square)
            if first < width:
                top += 1
                site[top], begin[top], level[top] = j, max(first, 0), square
        begin[top + 1] = width
        for k in range(top + 1):
            for j in range(begin[k], begin[k + 1]):
                d = max(abs(j - site[k]) - 0.5, 0.0)
                out[i, j] = np.sqrt(d * d + level[k])


@kernel(inline=True)
def _overtakes(i: int, level_i: float, j: int, level_j: float) -> int:
    """The first column at which site j > i is no farther than site i: phi(x - i) - phi(x - j) >= level_j - level_i."""
    apart = float(j - i)
    rise = level_j - level_i
    edge = (apart - 0.5) * (apart - 0.5)
    if rise > edge:  # right of j
        return int(np.ceil(0.5 * (rise / apart + i + j + 1)))
    if rise <= -edge:  # at or left of i
        return min(int(np.ceil(0.5 * (rise / apart + i + j - 1))), i)
    if apart < 1.5:
        return j
    return min(max(int(np.ceil(0.5 * (rise / (apart - 1.0) + i + j))), i + 1), j)


@kernel(inline=True)
def _gap_squared(ax: float, ay: float, bx: float, by: float, left: float, low: float) -> float:
    """Squared distance from the segment a-b to the unit square whose lower-left corner is (left, low)."""
    dx, dy = bx - ax, by - ay
    enter, leave = 0.0, 1.0
    for axis in range(2):  # Liang-Barsky: does the segment enter the square?
        d, near = (dx, left - ax) if axis == 0 else (dy, low - ay)
        far = near + 1.0
        if d == 0.0:
            if near > 0.0 or far < 0.0:
                leave = -1.0
        else:
            near, far = near / d, far / d
            enter, leave = max(enter, min(near, far)), min(leave, max(near, far))
    if enter <= leave:
        return 0.0
    gap = np.inf
    for end in range(2):  # the segment's ends to the square
        x, y = (ax, ay) if end == 0 else (bx, by)
        ex, ey = max(left - x, x - left - 1.0, 0.0), max(low - y, y - low - 1.0, 0.0)
        gap = min(gap, ex * ex + ey * ey)
    square = dx * dx + dy * dy
    if square > 0.0:
        for corner in range(4):  # the square's corners to the segment
            x, y = left + (corner & 1) - ax, low + (corner >> 1) - ay
            t = min(max((x * dx + y * dy) / square, 0.0), 1.0)
            ex, ey = x - t * dx, y - t * dy
            gap = min(gap, ex * ex + ey * ey)
    return gap


@kernel(inline=True)
def near_squares_free(
    clearance: Floats, ax: float, ay: float, bx: float, by: float, radius: float
) -> bool:
    """Whether each non-drivable square of the field (H, W) is farther than `radius` from the (short) segment a-b; in cells."""
    height, width = clearance.shape
    reach = radius + CONTACT
    for i in range(int(np.floor(min(ay, by) - reach)), int(np.floor(max(ay, by) + reach)) + 1):
        for j in range(int(np.floor(min(ax, bx) - reach)), int(np.floor(max(ax, bx) + reach)) + 1):
            inside = 0 <= i < height and 0 <= j < width
            if (not inside or clearance[i, j] == 0.0) and _gap_squared(
                ax, ay, bx, by, float(j), float(i)
            ) <= reach * reach:
                return False
    return True


@kernel(F2, F, F, F, F, F)
def free_length(
    clearance: Floats, ax: float, ay: float, bx: float, by: float, radius: float
) -> float:
    """How far a disc can surely move from a towards b; infinity if all the way, exactly; else what is verified, to a cell.

    Source: sphere tracing (Hart 1996), with exact checks where it would have to creep.

    The clearance field (H, W), all in cells, skips what is surely free, squares decide the rest.
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
            return t
        here = clearance[i, j]
        if here == 0.0 or here + 0.7072 <= radius:  # 0.7072: half a cell's diagonal, rounded up
            return t
        ex, ey = x - j - 0.5, y - i - 0.5
        room = (
            here - np.sqrt(ex * ex + ey * ey) - radius
        )  # a ball about (x, y) that is surely free
        if room < 0.5:
            room = min(1.0, length - t)
            if not near_squares_free(clearance, x, y, x + room * dx, y + room * dy, radius):
                return t
        t += room
        if t >= length:
            return np.inf


@kernel(F2, F, F, F, F, F)
def segment_free(
    clearance: Floats, ax: float, ay: float, bx: float, by: float, radius: float
) -> bool:
    """Whether a disc can move from a to b, exactly; all in cells, with the clearance field (H, W)."""
    return free_length(clearance, ax, ay, bx, by, radius) == np.inf


@kernel(F2, F2, F2, F, OUTB1)
def check_segments(
    clearance: Floats, start: Floats, end: Floats, radius: float, free: Bools
) -> None:
    """`segment_free` for M segments; start and end (M, 2), radius, all in cells; writes free (M,)."""
    for m in range(start.shape[0]):
        free[m] = segment_free(clearance, start[m, 0], start[m, 1], end[m, 0], end[m, 1], radius)


@kernel(inline=True)
def footprint_free(
    clearance: Floats, x: float, y: float, yaw: float, half_length: float, half_width: float
) -> bool:
    """Whether the rectangle at one pose (in cells) covers drivable cells only, by the clearance field (H, W)."""
    height, width = clearance.shape
    i, j = int(np.floor(y)), int(np.floor(x))
    if i < 0 or j < 0 or i >= height or j >= width or clearance[i, j] == 0.0:
        return False
    if clearance[i, j] - 0.7072 >= np.sqrt(half_length * half_length + half_width * half_width):
        return True
    c, s = np.cos(yaw), np.sin(yaw)
    corner_x, corner_y = np.empty(4), np.empty(4)
    for k in range(4):
        u = half_length if k in (0, 3) else -half_length
        v = half_width if k < 2 else -half_width
        corner_x[k], corner_y[k] = x + c * u - s * v, y + s * u + c * v
    for i in range(
        int(np.floor(corner_y.min() + CONTACT)), int(np.ceil(corner_y.max() - CONTACT))
    ):
        low, high = np.inf, -np.inf  # the rectangle's extent in x within this row of cells
        for k in range(4):
            x0, y0, x1, y1 = corner_x[k], corner_y[k], corner_x[(k + 1) % 4], corner_y[(k + 1) % 4]
            if i <= y0 <= i + 1:
                low, high = min(low, x0), max(high, x0)
            for line in (i, i + 1):
                if (y0 - line) * (y1 - line) < 0.0:
                    cut = x0 + (line - y0) / (y1 - y0) * (x1 - x0)
                    low, high = min(low, cut), max(high, cut)
        for j in range(int(np.floor(low + CONTACT)), int(np.ceil(high - CONTACT))):
            if i < 0 or j < 0 or i >= height or j >= width or clearance[i, j] == 0.0:
                return False
    return True


@kernel(F2, F2, F, F, OUTB1)
def check_footprints(
    clearance: Floats, poses: Floats, half_length: float, half_width: float, fits: Bools
) -> None:
    """`footprint_free` for M poses (M, 3), in cells and rad; writes fits (M,)."""
    for m in range(poses.shape[0]):
        fits[m] = footprint_free(
            clearance, poses[m, 0], poses[m, 1], poses[m, 2], half_length, half_width
        )


BISECTIONS = 20


def nearest_pose_with_room(
    road: Road, pose: Floats, length: float, width: float, max_distance: float = 3.0
) -> tuple[Floats, float] | None:
    """Move a pose, keeping its yaw, as little as it takes for the footprint to cover drivable cells only.

    Offsets on a lattice of the grid's resolution are tried outward, and the nearest that fits is drawn back towards the
    pose as far as the footprint keeps its room: the answer is within about half a cell of the true nearest pose.

    Args:
        road: the grid.
        pose: (3,) x [m], y [m], yaw [rad].
        length: footprint length [m].
        width: footprint width [m].
        max_distance: how far to look [m].

    Returns:
        The pose (3,) and how far it was moved [m]; None if there is no room within `max_distance`.
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
    for _ in range(BISECTIONS):
        middle = 0.5 * (blocked + free)
        if footprint_fits(road, (pose + middle * shift)[None], length, width)[0]:
            free = middle
        else:
            blocked = middle
    moved = pose + free * shift
    return moved, float(np.hypot(*(moved - pose)[:2]))
