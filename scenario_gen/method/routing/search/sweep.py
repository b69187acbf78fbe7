# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Whether a footprint can follow a curve: the area that it sweeps against the grid, cell by cell; and how much room it leaves.

Between two near poses the convex hull of both footprints, widened by what an arc rises above its chord, is compared with the
cells: the swept area lies in it, so nothing slips between two poses.
"""

import numpy as np

from scenario_gen.method.routing.search.dubins import shortest, TURNS
from scenario_gen.numerics import Counts, Floats
from scenario_gen.numerics.kernels import F, F2, kernel, N2, OUT2
from scenario_gen.roads import blocked_before, clearance_in_cells, CONTACT, to_cells
from scenario_gen.types import Road

SWEEP = 0.2  # [m] between two poses that are compared with the grid
FEELERS = 6  # most discs that cover a footprint
FAR = 1e9  # [cells] room where nothing is near


@kernel(inline=True)
def _spread(ax: float, ay: float, bx: float, by: float, first: int, low: Floats, high: Floats) -> None:
    """Widen the extents in x of the rows of cells from `first` on by the segment a-b."""
    if ay > by:
        ax, ay, bx, by = bx, by, ax, ay
    rows = low.shape[0]
    slope = (bx - ax) / (by - ay) if by > ay else 0.0
    begin, end = max(int(np.floor(ay)), first), min(int(np.floor(by)), first + rows - 1)
    for i in range(begin, end + 1):
        p = ax + slope * (max(ay, float(i)) - ay)
        q = bx if by <= i + 1.0 else ax + slope * (i + 1.0 - ay)
        k = i - first
        low[k], high[k] = min(low[k], p, q), max(high[k], p, q)


@kernel(inline=True)
def swept_free(
    blocked: Counts, x0: float, y0: float, c0: float, s0: float, x1: float, y1: float, c1: float, s1: float, half_length: float,
    half_width: float, bulge: float, low: Floats, high: Floats,
) -> bool:  # fmt: skip
    """Whether the hull of the footprints at two near poses (x, y, cos, sin; in cells) covers drivable cells only.

    Args:
        blocked: (H, W + 1) from `blocked_before`.
        x0: of the first pose; the others likewise.
        y0: see above.
        c0: see above.
        s0: see above.
        x1: of the second pose; the others likewise.
        y1: see above.
        c1: see above.
        s1: see above.
        half_length: of the footprint.
        half_width: likewise.
        bulge: what is added on every side.
        low: (R,) scratch, for as many rows of cells as the footprint is long across, and more.
        high: likewise.
    """
    a, b = half_length + bulge, half_width + bulge
    reach0, reach1 = a * abs(s0) + b * abs(c0), a * abs(s1) + b * abs(c1)
    bottom, top = min(y0 - reach0, y1 - reach1), max(y0 + reach0, y1 + reach1)
    first, last = int(np.floor(bottom + CONTACT)), int(np.ceil(top - CONTACT)) - 1
    height, width = blocked.shape[0], blocked.shape[1] - 1
    if first < 0 or last >= height:
        return False
    count = last - first + 1
    for k in range(count):
        low[k], high[k] = np.inf, -np.inf
    lines, columns = low[:count], high[:count]
    for k in range(4):
        u, v = a if k in (0, 3) else -a, b if k < 2 else -b
        w, z = a if k in (3, 2) else -a, b if k in (3, 0) else -b  # the next corner
        px, py, qx, qy = x0 + c0 * u - s0 * v, y0 + s0 * u + c0 * v, x1 + c1 * u - s1 * v, y1 + s1 * u + c1 * v
        _spread(px, py, x0 + c0 * w - s0 * z, y0 + s0 * w + c0 * z, first, lines, columns)
        _spread(qx, qy, x1 + c1 * w - s1 * z, y1 + s1 * w + c1 * z, first, lines, columns)
        _spread(px, py, qx, qy, first, lines, columns)
    for k in range(count):
        begin, end = int(np.floor(low[k] + CONTACT)), int(np.ceil(high[k] - CONTACT))
        if begin < 0 or end > width or (end > begin and blocked[first + k, end] != blocked[first + k, begin]):
            return False
    return True


@kernel(inline=True)
def room_beside(
    clearance: Floats, x: float, y: float, c: float, s: float, half_length: float, half_width: float
) -> tuple[float, float]:
    """What a footprint at a pose (in cells) surely has around it, and about what it has beside it; -FAR if it is blocked.

    Clearances (H, W) are in cells. The first is proven by discs that cover the footprint: below 0 it tells nothing.
    """
    height, width = clearance.shape
    count = min(max(1, int(np.ceil(1.5 * half_length / half_width))), FEELERS)
    spacing = 2.0 * half_length / count
    cover = np.sqrt(0.25 * spacing * spacing + half_width * half_width)
    sure, beside = FAR, FAR
    for i in range(count):
        ahead = (i + 0.5) * spacing - half_length
        px, py = x + ahead * c, y + ahead * s
        column, row = int(np.floor(px)), int(np.floor(py))
        if row < 0 or column < 0 or row >= height or column >= width or clearance[row, column] == 0.0:
            return -FAR, -FAR
        dx, dy = px - column - 0.5, py - row - 0.5
        off = np.sqrt(dx * dx + dy * dy)
        sure = min(sure, clearance[row, column] - off - cover)
        beside = min(beside, clearance[row, column] - half_width)
    return sure, beside


@kernel(inline=True)
def offset_from(x: float, y: float, guide: Floats) -> float:
    """How far (x, y) lies left of a guide (G, 3) [cells, rad], at its nearest pose."""
    best, nearest = np.inf, 0
    for k in range(guide.shape[0]):
        dx, dy = x - guide[k, 0], y - guide[k, 1]
        square = dx * dx + dy * dy
        if square < best:
            best, nearest = square, k
    yaw = guide[nearest, 2]
    return float(np.cos(yaw) * (y - guide[nearest, 1]) - np.sin(yaw) * (x - guide[nearest, 0]))


@kernel(inline=True)
def follow(
    clearance: Floats, blocked: Counts, x: float, y: float, yaw: float, word: int, a: float, b: float, c: float, radius: float,
    half_length: float, half_width: float, sweep: float, wish: Floats, guide: Floats, low: Floats, high: Floats,
) -> tuple[float, float]:  # fmt: skip
    """How far a footprint can follow a Dubins curve, and what that costs; in cells.

    The cost is the length, more where there is less room beside the footprint than wished for, and away from the guide.

    Args:
        clearance: (H, W).
        blocked: (H, W + 1) from `blocked_before`.
        x: of the first pose, which is free.
        y: likewise.
        yaw: likewise.
        word: the curve, see `dubins`.
        a: length of its first part.
        b: of the second.
        c: of the third.
        radius: of its arcs.
        half_length: of the footprint.
        half_width: likewise.
        sweep: largest distance between two poses that are looked at.
        wish: (6,) room wished for beside the footprint, what its lack costs per length, what a cell left of the guide costs, and
            right of it; how far left and right of it one may be at all.
        guide: (G, 3) x, y, yaw; none: no side is dearer.
        low: scratch, see `swept_free`.
        high: likewise.

    Returns:
        Length up to the first pose that is not free (infinity: all is), and the cost up to there.
    """
    gone, cost, since, dear = 0.0, 0.0, np.inf, 0.0
    cos, sin = np.cos(yaw), np.sin(yaw)
    for part in range(3):
        turn = TURNS[word, part]
        length = a if part == 0 else b if part == 1 else c
        if length <= 0.0:
            continue
        steps = int(np.ceil(length / sweep))
        h = length / steps
        ahead, aside, dc, ds = h, 0.0, 1.0, 0.0
        if turn != 0.0:
            dc, ds = np.cos(h / radius), turn * np.sin(h / radius)
            ahead, aside = radius * turn * ds, turn * radius * (1.0 - dc)
        bulge = (radius + half_length) * h * h / (8.0 * radius * radius) if turn != 0.0 else 0.0
        slack = 0.5 * h * (1.0 + half_length / radius)
        for _ in range(steps):
            nx, ny = x + cos * ahead - sin * aside, y + sin * ahead + cos * aside
            nc, ns = cos * dc - sin * ds, sin * dc + cos * ds
            sure, beside = room_beside(clearance, nx, ny, nc, ns, half_length, half_width)
            if sure < slack and (
                sure == -FAR
                or not swept_free(blocked, x, y, cos, sin, nx, ny, nc, ns, half_length, half_width, bulge, low, high)
            ):  # fmt: skip
                return gone, cost
            x, y, cos, sin = nx, ny, nc, ns
            gone += h
            since += h
            if since >= 5.0 * sweep and guide.shape[0] > 0:
                since, offset = 0.0, offset_from(x, y, guide)
                if offset > wish[4] or offset < -wish[5]:
                    return gone, cost
                dear = max(wish[2] * offset, -wish[3] * offset)
            lack = max(wish[0] - beside, 0.0) / wish[0] if wish[0] > 0.0 else 0.0
            cost += h * (1.0 + wish[1] * lack + dear)
    return np.inf, cost


@kernel(inline=True)
def scratch_rows(half_length: float, half_width: float, sweep: float) -> int:
    """How many rows of scratch `swept_free` needs for a footprint."""
    return int(2.0 * np.sqrt(half_length * half_length + half_width * half_width) + sweep) + 8


@kernel(F2, N2, F2, F, F, OUT2)
def check_sweep(clearance: Floats, blocked: Counts, poses: Floats, half_length: float, half_width: float, out: Floats) -> None:
    """Whether the footprint can move from each of M near poses (M, 3) [cells, rad] to the next; all in cells.

    Writes `out` (M, 2): 1 where the way to the pose (for the first: the pose itself) is free, else 0; and about the room beside.
    """
    rows = scratch_rows(half_length, half_width, 64.0)
    low, high = np.empty(rows), np.empty(rows)
    for m in range(poses.shape[0]):
        k = max(m - 1, 0)
        x0, y0, c0, s0 = poses[k, 0], poses[k, 1], np.cos(poses[k, 2]), np.sin(poses[k, 2])
        x1, y1, c1, s1 = poses[m, 0], poses[m, 1], np.cos(poses[m, 2]), np.sin(poses[m, 2])
        sure, out[m, 1] = room_beside(clearance, x1, y1, c1, s1, half_length, half_width)
        dx, dy = x1 - x0, y1 - y0
        moved = np.sqrt(dx * dx + dy * dy) + half_length * (abs(c1 - c0) + abs(s1 - s0))
        free = sure >= moved
        if not free and sure > -FAR and moved < 64.0:
            turned = np.sqrt((c1 - c0) ** 2 + (s1 - s0) ** 2)
            bulge = 0.125 * turned * (moved + (half_length + half_width) * turned)
            free = swept_free(blocked, x0, y0, c0, s0, x1, y1, c1, s1, half_length, half_width, bulge, low, high)
        out[m, 0] = 1.0 if free else 0.0


def sweep_is_free(road: Road, poses: Floats, length: float, width: float) -> Floats:
    """Whether a footprint can move from each of M near poses to the next, and the room beside it.

    Args:
        road: the grid.
        poses: x [m], y [m], yaw [rad], some 0.2 m apart or less.
        length: metres along the yaw.
        width: metres across it.

    Returns:
        (M, 2) 1 where the way to the pose from the one before is free, else 0; metres.
    """
    poses = np.ascontiguousarray(np.reshape(poses, (-1, 3)), dtype=np.float64)
    grid = np.column_stack((to_cells(road, poses[:, :2]), poses[:, 2]))
    out = np.empty((len(poses), 2))
    check_sweep(
        clearance_in_cells(road), blocked_before(road), grid, 0.5 * length / road.resolution, 0.5 * width / road.resolution, out
    )
    out[:, 1] *= road.resolution
    return out


@kernel(F2, N2, F, F, F, F, F, F, F, F, F, F)
def curve_length(
    clearance: Floats, blocked: Counts, x0: float, y0: float, yaw0: float, x1: float, y1: float, yaw1: float, radius: float,
    half_length: float, half_width: float, sweep: float,
) -> float:  # fmt: skip
    """Length of the shortest Dubins curve between two poses if a footprint can follow it, else infinity; all in cells.

    Args:
        clearance: (H, W).
        blocked: (H, W + 1) from `blocked_before`.
        x0: of the first pose, which must itself be free.
        y0: likewise.
        yaw0: likewise.
        x1: of the second pose.
        y1: likewise.
        yaw1: likewise.
        radius: of the arcs.
        half_length: of the footprint.
        half_width: likewise.
        sweep: largest distance between two poses that are looked at.
    """
    rows = scratch_rows(half_length, half_width, sweep)
    word, a, b, c = shortest(x0, y0, yaw0, x1, y1, yaw1, radius)
    free, cost = follow(
        clearance, blocked, x0, y0, yaw0, word, a, b, c, radius, half_length, half_width, sweep, np.zeros(6), np.empty((0, 3)),
        np.empty(rows), np.empty(rows),
    )  # fmt: skip
    return cost if free == np.inf else np.inf
