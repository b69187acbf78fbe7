# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Whether a footprint can follow a curve: the area that it sweeps against the grid, cell by cell; and how much room it leaves.

Between two near poses the convex hull of both footprints, widened by what an arc rises above its chord, is compared with the
cells: the swept area lies in it, so nothing slips between two poses. Lengths are in cells, in kernels.
"""

from typing import Any, NamedTuple

import numpy as np

from scenario_gen.method.routing.search.dubins import Curve, part_of, Pose, TURNS
from scenario_gen.numerics import Counts, Floats, sealed
from scenario_gen.numerics.kernels import F, F2, kernel, N2, named, OUT2
from scenario_gen.roads import blocked_before, clearance_in_cells, CONTACT, to_cells
from scenario_gen.types import Road

SWEEP = 0.2  # [m] between two poses that are compared with the grid
FEELERS = 6  # most discs that cover a footprint
FAR = 1e9  # [cells] room where nothing is near
LONGEST = 64.0  # [cells] no two near poses are farther apart


class Disc(NamedTuple):
    """What moves along straight lines, as in the paper; its headings mean nothing."""

    radius: float


class Car(NamedTuple):
    """What moves along Dubins curves.

    Attributes:
        turn: radius of its arcs.
        half_length: of the footprint.
        half_width: likewise.
        sweep: largest distance between two poses that are looked at.
    """

    turn: float
    half_length: float
    half_width: float
    sweep: float


class Prices(NamedTuple):
    """What is dearer than its length.

    Attributes:
        room: wished for beside the footprint.
        lack: what its lack costs per length.
        left: what a cell left of the guide costs per length.
        right: likewise right of it.
        most_left: how far left of it one may be at all.
        most_right: likewise right of it.
    """

    room: float
    lack: float
    left: float
    right: float
    most_left: float
    most_right: float


class Scene(NamedTuple):
    """What edges are checked against.

    Attributes:
        clearance: (H, W).
        blocked: (H, W + 1) from `blocked_before`; of a disc, none.
        guide: (G, 3) poses of the line to keep to; none: no side is dearer.
        body: what moves, a `Disc` or a `Car`: it says what an edge is, see `steering`.
        prices: what is dear.
        rows: (2, R) scratch for as many rows of cells as the footprint is long across, and more; of a disc, none.
    """

    clearance: Floats
    blocked: Counts
    guide: Floats
    body: Any
    prices: Prices
    rows: Floats


PRICES = named(Prices, F, F, F, F, F, F)
CAR_SCENE = named(Scene, F2, N2, F2, named(Car, F, F, F, F), PRICES, OUT2)
DISC_SCENE = named(Scene, F2, N2, F2, named(Disc, F), PRICES, OUT2)
NOWHERE = sealed(np.empty((0, 3)))
NO_PRICES = Prices(0.0, 0.0, 0.0, 0.0, np.inf, np.inf)


class _Stance(NamedTuple):
    """A place, and cosine and sine of the heading."""

    x: float
    y: float
    cos: float
    sin: float


@kernel(inline=True)
def _spread(
    ax: float, ay: float, bx: float, by: float, first: int, low: Floats, high: Floats
) -> None:
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
def _swept_free(
    blocked: Counts, here: _Stance, there: _Stance, body: Car, bulge: float, rows: Floats
) -> bool:
    """Whether the hull of the footprints at two near stances covers drivable cells only; `bulge` is added on every side."""
    a, b = body.half_length + bulge, body.half_width + bulge
    reach0, reach1 = a * abs(here.sin) + b * abs(here.cos), a * abs(there.sin) + b * abs(there.cos)
    bottom, top = min(here.y - reach0, there.y - reach1), max(here.y + reach0, there.y + reach1)
    first, last = int(np.floor(bottom + CONTACT)), int(np.ceil(top - CONTACT)) - 1
    height, width = blocked.shape[0], blocked.shape[1] - 1
    if first < 0 or last >= height:
        return False
    count = last - first + 1
    low, high = rows[0, :count], rows[1, :count]
    for k in range(count):
        low[k], high[k] = np.inf, -np.inf
    for k in range(4):
        u, v = a if k in (0, 3) else -a, b if k < 2 else -b
        w, z = a if k in (3, 2) else -a, b if k in (3, 0) else -b  # the next corner
        px, py = here.x + here.cos * u - here.sin * v, here.y + here.sin * u + here.cos * v
        qx, qy = there.x + there.cos * u - there.sin * v, there.y + there.sin * u + there.cos * v
        rx, ry = here.x + here.cos * w - here.sin * z, here.y + here.sin * w + here.cos * z
        sx, sy = there.x + there.cos * w - there.sin * z, there.y + there.sin * w + there.cos * z
        _spread(px, py, rx, ry, first, low, high)
        _spread(qx, qy, sx, sy, first, low, high)
        _spread(px, py, qx, qy, first, low, high)
    for k in range(count):
        begin, end = int(np.floor(low[k] + CONTACT)), int(np.ceil(high[k] - CONTACT))
        if (
            begin < 0
            or end > width
            or (end > begin and blocked[first + k, end] != blocked[first + k, begin])
        ):
            return False
    return True


@kernel(inline=True)
def _room_beside(clearance: Floats, at: _Stance, body: Car) -> tuple[float, float]:
    """What a footprint surely has around it, and about what it has beside it; -FAR if it is blocked.

    The first is proven by discs that cover the footprint: below 0 it says nothing.
    """
    height, width = clearance.shape
    count = min(max(1, int(np.ceil(1.5 * body.half_length / body.half_width))), FEELERS)
    spacing = 2.0 * body.half_length / count
    cover = np.sqrt(0.25 * spacing * spacing + body.half_width * body.half_width)
    sure, beside = FAR, FAR
    for i in range(count):
        ahead = (i + 0.5) * spacing - body.half_length
        px, py = at.x + ahead * at.cos, at.y + ahead * at.sin
        column, row = int(np.floor(px)), int(np.floor(py))
        if (
            row < 0
            or column < 0
            or row >= height
            or column >= width
            or clearance[row, column] == 0.0
        ):
            return -FAR, -FAR
        dx, dy = px - column - 0.5, py - row - 0.5
        off = np.sqrt(dx * dx + dy * dy)
        sure = min(sure, clearance[row, column] - off - cover)
        beside = min(beside, clearance[row, column] - body.half_width)
    return sure, beside


@kernel(inline=True)
def _offset_from(x: float, y: float, guide: Floats) -> float:
    """How far (x, y) lies left of a guide (G, 3), at its nearest pose."""
    best, nearest = np.inf, 0
    for k in range(guide.shape[0]):
        dx, dy = x - guide[k, 0], y - guide[k, 1]
        square = dx * dx + dy * dy
        if square < best:
            best, nearest = square, k
    yaw = guide[nearest, 2]
    return float(np.cos(yaw) * (y - guide[nearest, 1]) - np.sin(yaw) * (x - guide[nearest, 0]))


@kernel(inline=True)
def pose_is_free(pose: Pose, body: Car, scene: Scene) -> bool:
    """Whether the footprint at a pose is free."""
    at = _Stance(pose.x, pose.y, np.cos(pose.yaw), np.sin(pose.yaw))
    return bool(_swept_free(scene.blocked, at, at, body, 0.0, scene.rows))


@kernel(inline=True)
def follow(pose: Pose, curve: Curve, body: Car, scene: Scene) -> tuple[bool, float]:
    """Whether a footprint can follow a Dubins curve from a free pose on, and what that costs, or the way to where it cannot.

    The cost is the length, more where there is less room beside the footprint than wished for, and away from the guide.
    """
    prices, radius = scene.prices, body.turn
    cost, since, dear = 0.0, np.inf, 0.0
    at = _Stance(pose.x, pose.y, np.cos(pose.yaw), np.sin(pose.yaw))
    for part in range(3):
        turn, length = TURNS[curve.word, part], part_of(curve, part)
        if length <= 0.0:
            continue
        steps = int(np.ceil(length / body.sweep))
        h = length / steps
        ahead, aside, dc, ds, bulge = h, 0.0, 1.0, 0.0, 0.0
        if turn != 0.0:
            dc, ds = np.cos(h / radius), turn * np.sin(h / radius)
            ahead, aside = radius * turn * ds, turn * radius * (1.0 - dc)
            bulge = (radius + body.half_length) * h * h / (8.0 * radius * radius)
        slack = 0.5 * h * (1.0 + body.half_length / radius)
        for _ in range(steps):
            x, y = at.x + at.cos * ahead - at.sin * aside, at.y + at.sin * ahead + at.cos * aside
            there = _Stance(x, y, at.cos * dc - at.sin * ds, at.sin * dc + at.cos * ds)
            sure, beside = _room_beside(scene.clearance, there, body)
            if sure == -FAR:
                return False, cost
            if sure < slack and not _swept_free(scene.blocked, at, there, body, bulge, scene.rows):
                return False, cost
            at = there
            since += h
            if since >= 5.0 * body.sweep and scene.guide.shape[0] > 0:
                since, offset = 0.0, _offset_from(x, y, scene.guide)
                if offset > prices.most_left or offset < -prices.most_right:
                    return False, cost
                dear = max(prices.left * offset, -prices.right * offset)
            lack = max(prices.room - beside, 0.0) / prices.room if prices.room > 0.0 else 0.0
            cost += h * (1.0 + prices.lack * lack + dear)
    return True, cost


@kernel(F2, N2, F2, F, F, OUT2)
def check_sweep(
    clearance: Floats,
    blocked: Counts,
    poses: Floats,
    half_length: float,
    half_width: float,
    out: Floats,
) -> None:
    """Whether the footprint can move from each of M near poses (M, 3) [cells, rad] to the next; all in cells.

    Writes `out` (M, 2): 1 where the way to the pose (for the first: the pose itself) is free, else 0; and about the room beside.
    """
    body = Car(0.0, half_length, half_width, LONGEST)
    rows = int(2.0 * np.sqrt(half_length * half_length + half_width * half_width) + LONGEST) + 8
    scratch = np.empty((2, rows))
    for m in range(poses.shape[0]):
        k = max(m - 1, 0)
        here = _Stance(poses[k, 0], poses[k, 1], np.cos(poses[k, 2]), np.sin(poses[k, 2]))
        there = _Stance(poses[m, 0], poses[m, 1], np.cos(poses[m, 2]), np.sin(poses[m, 2]))
        sure, out[m, 1] = _room_beside(clearance, there, body)
        dx, dy = there.x - here.x, there.y - here.y
        moved = np.sqrt(dx * dx + dy * dy) + half_length * (
            abs(there.cos - here.cos) + abs(there.sin - here.sin)
        )
        free = sure >= moved
        if not free and sure > -FAR and moved < LONGEST:
            turned = np.sqrt((there.cos - here.cos) ** 2 + (there.sin - here.sin) ** 2)
            bulge = 0.125 * turned * (moved + (half_length + half_width) * turned)
            free = _swept_free(blocked, here, there, body, bulge, scratch)
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
        clearance_in_cells(road),
        blocked_before(road),
        grid,
        0.5 * length / road.resolution,
        0.5 * width / road.resolution,
        out,
    )
    out[:, 1] *= road.resolution
    return out


def car_scene(
    road: Road,
    size: tuple[float, float],
    curvature: float,
    prices: Prices = NO_PRICES,
    guide: Floats = NOWHERE,
) -> Scene:
    """The scene of a car of some length and width [m] that turns within a curvature [1/m]; prices and guide in cells."""
    half_length, half_width = (0.5 * extent / road.resolution for extent in size)
    body = Car(
        1.0 / (curvature * road.resolution), half_length, half_width, SWEEP / road.resolution
    )
    rows = int(2.0 * np.hypot(half_length, half_width) + body.sweep) + 8
    return Scene(
        clearance_in_cells(road), blocked_before(road), guide, body, prices, np.empty((2, rows))
    )
