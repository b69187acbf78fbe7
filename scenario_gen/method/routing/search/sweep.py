# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Edges of the search, and whether a footprint can follow them: its swept area, cell by cell.

Between two near poses the convex hull of both footprints, widened by the sagitta of the arc, is
compared with the cells. The hull contains the swept area, so no obstacle between two poses is
missed. Lengths are in cells.

An edge is a `Curve`. A body without a turning radius is a disc; its edges are straight lines, as
in the paper: curves whose arcs have no length.
"""

from typing import NamedTuple

import numpy as np

from scenario_gen.method.routing.search.dubins import (
    Curve,
    LSL_CODE,
    part_of,
    POSE,
    Pose,
    pose_along,
    shortest,
    TURNS,
)
from scenario_gen.method.routing.search.planner import PoseQuery
from scenario_gen.numerics import Bools, Floats, wrap_angle
from scenario_gen.numerics.kernels import F, F2, kernel, named, OUT1, OUT2, OUTB1
from scenario_gen.numerics.polygons import is_row_open
from scenario_gen.roads import CONTACT_CELLS, segment_free, to_cells
from scenario_gen.types import Road

SWEEP_M = 0.2  # between two poses whose hull is compared with the grid
MAX_DISCS_COUNT = 6  # that cover a footprint
FAR_CELLS = 1e9  # room where no obstacle is near
MAX_STEP_CELLS = 64.0  # between two poses, rotation included


class Body(NamedTuple):
    """What moves.

    Attributes:
        turn_radius: of its tightest arcs; 0: a disc, which moves along straight lines.
        half_length: of the footprint; of a disc, its radius.
        half_width: of the footprint.
        sweep: largest distance between two poses that are checked.
    """

    turn_radius: float
    half_length: float
    half_width: float
    sweep: float


class Costs(NamedTuple):
    """The `Preferences` of a query, in cells."""

    clearance: float
    clearance_cost: float
    left_cost: float
    right_cost: float
    max_left: float
    max_right: float


class Scene(NamedTuple):
    """What edges are checked against.

    Attributes:
        clearance: (H, W).
        guide: (G, 3) poses of the line to stay near; may be empty.
        body: what moves.
        costs: extra costs.
        rows: (2, R) scratch for the rows of cells that a step sweeps; unused by a disc.
    """

    clearance: Floats
    guide: Floats
    body: Body
    costs: Costs
    rows: Floats


class _Frame(NamedTuple):
    """A position, and cosine and sine of the heading; or a step in such a frame."""

    x: float
    y: float
    cos: float
    sin: float


SCENE = named(Scene, F2, F2, named(Body, F, F, F, F), named(Costs, *6 * (F,)), OUT2)


@kernel(inline=True)
def _frame_of(pose: Pose) -> _Frame:
    return _Frame(pose.x, pose.y, np.cos(pose.yaw), np.sin(pose.yaw))


@kernel(inline=True)
def _compose(frame: _Frame, step: _Frame) -> _Frame:
    """Return the frame after a step: x ahead, y to the left, then the rotation."""
    return _Frame(
        frame.x + frame.cos * step.x - frame.sin * step.y,
        frame.y + frame.sin * step.x + frame.cos * step.y,
        frame.cos * step.cos - frame.sin * step.sin,
        frame.sin * step.cos + frame.cos * step.sin,
    )


@kernel(inline=True)
def _widen(a: _Frame, b: _Frame, first: int, low: Floats, high: Floats) -> None:
    """Widen the extents in x of the rows of cells from `first` by the segment from a to b."""
    bottom, top = (a, b) if a.y <= b.y else (b, a)
    slope = (top.x - bottom.x) / (top.y - bottom.y) if top.y > bottom.y else 0.0
    begin = max(int(np.floor(bottom.y)), first)
    end = min(int(np.floor(top.y)), first + low.shape[0] - 1)
    for i in range(begin, end + 1):
        enter = bottom.x + slope * (max(bottom.y, float(i)) - bottom.y)
        leave = top.x if top.y <= i + 1.0 else bottom.x + slope * (i + 1.0 - bottom.y)
        k = i - first
        low[k] = min(low[k], enter, leave)
        high[k] = max(high[k], enter, leave)


@kernel(inline=True)
def _hull_extents(
    a: _Frame, b: _Frame, length: float, width: float, first: int, rows: Floats
) -> None:
    """Write the extents in x, row by row, of the hull of two footprints of these half sizes."""
    low, high = rows[0], rows[1]
    low[:] = np.inf
    high[:] = -np.inf
    for k in range(4):
        ahead = length if k in (0, 3) else -length
        left = width if k < 2 else -width
        next_ahead = length if k in (2, 3) else -length
        next_left = width if k in (0, 3) else -width
        corner = _Frame(ahead, left, 1.0, 0.0)
        next_corner = _Frame(next_ahead, next_left, 1.0, 0.0)
        corner_a, corner_b = _compose(a, corner), _compose(b, corner)
        _widen(corner_a, _compose(a, next_corner), first, low, high)
        _widen(corner_b, _compose(b, next_corner), first, low, high)
        _widen(corner_a, corner_b, first, low, high)


@kernel(inline=True)
def _hull_is_free(a: _Frame, b: _Frame, margin: float, scene: Scene) -> bool:
    """Whether the hull of the footprints at two frames, wider by `margin`, is drivable."""
    clearance = scene.clearance
    length, width = scene.body.half_length + margin, scene.body.half_width + margin
    reach_a = length * abs(a.sin) + width * abs(a.cos)
    reach_b = length * abs(b.sin) + width * abs(b.cos)
    first = int(np.floor(min(a.y - reach_a, b.y - reach_b) + CONTACT_CELLS))
    last = int(np.ceil(max(a.y + reach_a, b.y + reach_b) - CONTACT_CELLS)) - 1
    if first < 0 or last >= clearance.shape[0]:
        return False
    rows = scene.rows[:, : last - first + 1]
    _hull_extents(a, b, length, width, first, rows)
    for k in range(rows.shape[1]):
        begin = int(np.floor(rows[0, k] + CONTACT_CELLS))
        end = int(np.ceil(rows[1, k] - CONTACT_CELLS))
        if begin < 0 or end > clearance.shape[1]:
            return False
        if not is_row_open(clearance, first + k, begin, end):
            return False
    return True


@kernel(inline=True)
def _room_around(frame: _Frame, scene: Scene) -> tuple[float, float]:
    """Return room around a footprint that is proven, and about the room beside it.

    Discs that cover the footprint prove the first; if negative, it proves nothing. Both are
    -FAR_CELLS where the footprint is blocked.
    """
    body, clearance = scene.body, scene.clearance
    count = int(np.ceil(1.5 * body.half_length / body.half_width))
    count = min(max(1, count), MAX_DISCS_COUNT)
    spacing = 2.0 * body.half_length / count
    radius = np.sqrt(0.25 * spacing * spacing + body.half_width * body.half_width)
    proven, room = FAR_CELLS, FAR_CELLS
    for i in range(count):
        ahead = (i + 0.5) * spacing - body.half_length
        x = frame.x + ahead * frame.cos
        y = frame.y + ahead * frame.sin
        row, column = int(np.floor(y)), int(np.floor(x))
        inside = 0 <= row < clearance.shape[0] and 0 <= column < clearance.shape[1]
        if not inside or clearance[row, column] == 0.0:
            return -FAR_CELLS, -FAR_CELLS
        dx, dy = x - column - 0.5, y - row - 0.5
        proven = min(proven, clearance[row, column] - np.sqrt(dx * dx + dy * dy) - radius)
        room = min(room, clearance[row, column] - body.half_width)
    return proven, room


@kernel(inline=True)
def _sweep_step(a: _Frame, b: _Frame, scene: Scene) -> tuple[bool, float]:
    """Whether the footprint can move between two near frames, and the room beside it at b."""
    body = scene.body
    proven, room = _room_around(b, scene)
    dx, dy, dc, ds = b.x - a.x, b.y - a.y, b.cos - a.cos, b.sin - a.sin
    moved = np.sqrt(dx * dx + dy * dy) + body.half_length * (abs(dc) + abs(ds))
    if proven >= moved:
        return True, room
    if proven == -FAR_CELLS or moved >= MAX_STEP_CELLS:
        return False, room
    rotation = np.sqrt(dc * dc + ds * ds)
    sagitta = 0.125 * rotation * (moved + (body.half_length + body.half_width) * rotation)
    return _hull_is_free(a, b, sagitta, scene), room


@kernel(inline=True)
def _offset_from_guide(x: float, y: float, guide: Floats) -> float:
    """Return how far (x, y) lies to the left of a guide (G, 3), at the nearest pose."""
    best, nearest = np.inf, 0
    for k in range(guide.shape[0]):
        dx, dy = x - guide[k, 0], y - guide[k, 1]
        square = dx * dx + dy * dy
        if square < best:
            best, nearest = square, k
    yaw = guide[nearest, 2]
    return float(np.cos(yaw) * (y - guide[nearest, 1]) - np.sin(yaw) * (x - guide[nearest, 0]))


@kernel(inline=True)
def _extra_cost(frame: _Frame, room: float, scene: Scene) -> tuple[bool, float]:
    """Whether the offset from the guide is allowed, and the extra cost per length."""
    costs, extra, allowed = scene.costs, 0.0, True
    if costs.clearance > 0.0:
        extra = costs.clearance_cost * max(costs.clearance - room, 0.0) / costs.clearance
    if scene.guide.shape[0] > 0:
        offset = _offset_from_guide(frame.x, frame.y, scene.guide)
        allowed = -costs.max_right <= offset <= costs.max_left
        extra += max(costs.left_cost * offset, -costs.right_cost * offset)
    return allowed, extra


@kernel(inline=True)
def cost_at(pose: Pose, scene: Scene) -> float:
    """Return the cost per length at a free pose."""
    frame = _frame_of(pose)
    room = _room_around(frame, scene)[1]
    return 1.0 + _extra_cost(frame, room, scene)[1]


@kernel(inline=True)
def _follow_part(frame: _Frame, turn: float, length: float, scene: Scene) -> tuple[float, _Frame]:
    """Return the cost of an arc or a line (infinity: not free), and the frame at its end."""
    radius = scene.body.turn_radius
    steps = int(np.ceil(length / scene.body.sweep))
    h = length / steps
    step = _Frame(h, 0.0, 1.0, 0.0)
    if turn != 0.0:
        cos, sin = np.cos(h / radius), np.sin(h / radius)
        step = _Frame(radius * sin, turn * radius * (1.0 - cos), cos, turn * sin)
    cost = 0.0
    for _ in range(steps):
        following = _compose(frame, step)
        free, room = _sweep_step(frame, following, scene)
        allowed, extra = _extra_cost(following, room, scene)
        if not (free and allowed):
            return np.inf, frame
        frame = following
        cost += h * (1.0 + extra)
    return cost, frame


@kernel(inline=True)
def follow(pose: Pose, curve: Curve, scene: Scene) -> float:
    """Return the cost of a Dubins curve from a free pose: its length and extra costs.

    It is infinite where the footprint cannot follow the curve.
    """
    cost, frame = 0.0, _frame_of(pose)
    for part in range(3):
        length = part_of(curve, part)
        if length > 0.0 and cost < np.inf:
            part_cost, frame = _follow_part(frame, TURNS[curve.word, part], length, scene)
            cost += part_cost
    return cost


@kernel(inline=True, forced=True)
def distance(a: Pose, b: Pose) -> float:
    """Return the straight distance between two poses: no edge between them is shorter."""
    dx, dy = b.x - a.x, b.y - a.y
    return float(np.sqrt(dx * dx + dy * dy))


@kernel(inline=True, forced=True)
def steer(start: Pose, end: Pose, body: Body) -> Curve:
    """Return the shortest edge from pose to pose."""
    if body.turn_radius == 0.0:
        return Curve(LSL_CODE, 0.0, distance(start, end), 0.0)
    return shortest(start, end, body.turn_radius)


@kernel(inline=True, forced=True)
def pose_on_edge(start: Pose, end: Pose, edge: Curve, length: float, body: Body) -> Pose:
    """Return the pose at a length of an edge between two poses."""
    if body.turn_radius == 0.0:
        share = length / edge.second
        x = start.x + (end.x - start.x) * share
        return Pose(x, start.y + (end.y - start.y) * share, 0.0)
    return pose_along(start, edge, length, body.turn_radius)


@kernel(inline=True, forced=True)
def edge_cost(start: Pose, end: Pose, edge: Curve, scene: Scene) -> float:
    """Return the cost of an edge from a free pose; infinity if it is not free."""
    body = scene.body
    if body.turn_radius > 0.0:
        return follow(start, edge, scene)
    free = segment_free(scene.clearance, start.x, start.y, end.x, end.y, body.half_length)
    return edge.second if free else np.inf


@kernel(inline=True)
def is_free(pose: Pose, scene: Scene) -> bool:
    """Whether the body at a pose is free."""
    if scene.body.turn_radius > 0.0:
        frame = _frame_of(pose)
        return bool(_sweep_step(frame, frame, scene)[0])
    return segment_free(scene.clearance, pose.x, pose.y, pose.x, pose.y, scene.body.half_length)


@kernel(POSE, POSE, SCENE, on_demand=True)
def steering_cost(start: Pose, end: Pose, scene: Scene) -> float:
    """Return the cost of the shortest edge between two poses, of which the first is free."""
    return edge_cost(start, end, steer(start, end, scene.body), scene)


@kernel(F2, SCENE, OUT1, on_demand=True)
def costs_per_length(poses: Floats, scene: Scene, costs: Floats) -> None:
    """Write the cost per length (P,) at each of P free poses (P, 3)."""
    for k in range(poses.shape[0]):
        costs[k] = cost_at(Pose(poses[k, 0], poses[k, 1], poses[k, 2]), scene)


@kernel(F2, SCENE, OUTB1)
def check_sweep(poses: Floats, scene: Scene, out: Bools) -> None:
    """Write whether the step to each of M near poses (M, 3) [cells, rad] is free (M,).

    The first is the pose itself.
    """
    before = _frame_of(Pose(poses[0, 0], poses[0, 1], poses[0, 2]))
    for m in range(poses.shape[0]):
        frame = _frame_of(Pose(poses[m, 0], poses[m, 1], poses[m, 2]))
        out[m] = _sweep_step(before, frame, scene)[0]
        before = frame


def sweep_is_free(road: Road, poses: Floats, length: float, width: float) -> Bools:
    """Return whether a footprint can move to each of M near poses from the one before (M,).

    Args:
        road: the grid.
        poses: (M, 3) x [m], y [m], yaw [rad], about 0.2 m apart or less; M >= 1.
        length: of the footprint, along the yaw [m].
        width: across the yaw [m].
    """
    is_free = np.empty(len(poses), dtype=np.bool_)
    grid = np.column_stack((to_cells(road, poses[:, :2]), poses[:, 2]))
    query = PoseQuery(poses[0], poses[-1], length, width, 1.0)
    check_sweep(grid, car_scene(road, query), is_free)
    return is_free


def car_scene(road: Road, query: PoseQuery) -> Scene:
    """Return the scene of a query for a vehicle."""
    cell, wanted = road.resolution, query.preferences
    half_length, half_width = 0.5 * query.length / cell, 0.5 * query.width / cell
    body = Body(1.0 / (query.curvature * cell), half_length, half_width, SWEEP_M / cell)
    costs = Costs(
        wanted.clearance / cell,
        wanted.clearance_cost,
        wanted.left_cost * cell,
        wanted.right_cost * cell,
        wanted.max_left / cell,
        wanted.max_right / cell,
    )
    rows = int(2.0 * np.hypot(half_length, half_width) + MAX_STEP_CELLS) + 8
    return Scene(
        road.clearance_cells,
        poses_in_cells(road, wanted.guide),
        body,
        costs,
        np.empty((2, rows)),
    )


def disc_scene(road: Road, radius: float) -> Scene:
    """Return the scene of a disc of `radius` [m]."""
    cells = radius / road.resolution
    nothing = np.empty((0, 3))
    no_costs = Costs(0.0, 0.0, 0.0, 0.0, np.inf, np.inf)
    body = Body(0.0, cells, cells, 1.0)
    return Scene(road.clearance_cells, nothing, body, no_costs, nothing)


def poses_in_cells(road: Road, poses: Floats) -> Floats:
    """Convert poses (..., 3) [m, rad] to cells."""
    poses = np.asarray(poses, dtype=np.float64)
    return np.concatenate((to_cells(road, poses[..., :2]), wrap_angle(poses[..., 2:])), axis=-1)
