# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""RRT*-Connect in the plane, as in the paper: straight lines for a disc, pulled taut.

String pulling has three moves. Each keeps the path free (exact edge checks) and shortens it by the
triangle inequality: remove a vertex; slide it along one of its edges as far as its other neighbour
sees it; cut its corner parallel to the line between its neighbours. The path is taut when none of
them helps.
"""

from dataclasses import dataclass
import math

import numpy as np

from scenario_gen.method.routing.search.dubins import Pose
from scenario_gen.method.routing.search.planner import (
    BlockedError,
    Budget,
    BudgetSpentError,
    NO_POSES,
    NoWayError,
    path_length,
    Plan,
)
from scenario_gen.method.routing.search.rrt_star_connect import Rules
from scenario_gen.method.routing.search.search import Search
from scenario_gen.method.routing.search.sweep import disc_scene
from scenario_gen.numerics import Floats, frozen
from scenario_gen.numerics.kernels import F, F2, I, kernel, OUT2
from scenario_gen.numerics.loops import copy_to
from scenario_gen.roads import (
    free_cells,
    free_space,
    FreeSpace,
    segment_free,
    segments_free,
    to_cells,
)
from scenario_gen.types import Road

MAX_ROUND_ITERATIONS = 512  # between two checks of the budget
RETRY_FACTOR = 100  # more iterations for a first path where connected components prove a route
CORNER_SPREAD_CELLS = 0.5  # of samples near convex corners
BISECTIONS_COUNT = 14  # of an edge, per pass; later passes refine
MIN_CUT_SHARE = 1e-3  # of a corner
MIN_SHORTENING_CELLS = 1e-7  # of a pass
CORNER_MARGIN_CELLS = 1e-7  # added to a disc, so that rounding touches no corner
PASSES_COUNT = 30


@dataclass(frozen=True)
class Query:
    """A query for a disc: start and goal (2,) [m] in the road's frame, radius [m]."""

    start: Floats
    goal: Floats
    radius: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", frozen(np.reshape(self.start, 2)))
        object.__setattr__(self, "goal", frozen(np.reshape(self.goal, 2)))


@dataclass(frozen=True)
class RrtStarConnectConfig:
    """Settings of RRT*-Connect; lengths in cells, as in the paper.

    Attributes:
        step: longest new edge (the paper's preset: 5).
        zeta: largest near radius, zeta of eq 10; it decides quality (the paper's preset: 30).
        gamma_factor: gamma of eq 10 as a multiple of the minimum that is asymptotically optimal.
        greedy: extend as far as possible until the first path is found (the paper: one step).
        corners: share of samples near convex corners of obstacles (the paper: 0).
        informed: sample only where a shorter path can lie, once there is one.
        pull: pull the path taut at the end (string pulling).
    """

    step: float = 120.0
    zeta: float = 120.0
    gamma_factor: float = 1.1
    greedy: bool = True
    corners: float = 0.5
    informed: bool = True
    pull: bool = True


PAPER = RrtStarConnectConfig(
    step=5.0, zeta=30.0, greedy=False, corners=0.0, informed=False, pull=False
)


class RrtStarConnect:
    """The paper's planner.

    Source: paper III-B and appendix.
    """

    def __init__(self, config: RrtStarConnectConfig = RrtStarConnectConfig()) -> None:
        self.config = config

    def search(self, space: FreeSpace, query: Query, label: int, seed: int) -> Search:
        """Return the search of a query before it grows; it samples from a component's cells."""
        config, road = self.config, space.road
        ends = to_cells(road, np.array((query.start, query.goal))).tolist()
        cells = free_cells(space, label)
        least_gamma = 2.0 * math.sqrt(1.5 * max(len(cells), 1) / math.pi)  # of eq 10, d = 2
        rules = Rules(
            cells=cells,
            near=NO_POSES,
            near_share=config.corners,
            spread=CORNER_SPREAD_CELLS,
            yaw_spread=0.0,
            step=config.step,
            gamma=config.gamma_factor * least_gamma,
            zeta=config.zeta,
            exponent=0.5,
            greedy=config.greedy,
            informed=config.informed,
        )
        start, goal = (Pose(x, y, 0.0) for x, y in ends)
        return Search(road, disc_scene(road, query.radius), rules, (start, goal), seed)

    def plan(self, road: Road, query: Query, budget: Budget, seed: int) -> Plan:
        """Return the best path; with a budget in iterations it depends on the seed only.

        Raises:
            BlockedError: start or goal collides.
            NoWayError: there is no route.
            BudgetSpentError: no path was found within the budget.
        """
        space = free_space(road, query.radius)
        label = joining_component(space, query)
        search = self.search(space, query, label, seed)
        for improved in search.rounds(budget, MAX_ROUND_ITERATIONS):
            if improved:
                if search.path is None and not budget.first:
                    corners = _corner_poses(space, label)
                    search.rules = search.rules._replace(near=corners)
                path = straight_path(search)
                if self.config.pull:
                    clearance, radius = search.scene.clearance, search.scene.body.half_length
                    path = string_pulled(clearance, path, radius)
                search.keep(path, path_length(path))
            if search.path is not None and (budget.first or search.is_straight()):
                break
        return search.plan(query.start, query.goal)


def plan_with_retry(
    planner: RrtStarConnect, road: Road, query: Query, iterations: int, seed: int
) -> Plan:
    """Return the best path within `iterations`, or else the first path of a longer search.

    Raises:
        BlockedError, NoWayError, BudgetSpentError: as `RrtStarConnect.plan`.
    """
    try:
        return planner.plan(road, query, Budget(iterations), seed)
    except BudgetSpentError:
        return planner.plan(road, query, Budget(RETRY_FACTOR * iterations, first=True), seed)


def straight_path(search: Search) -> Floats:
    """Return the best path (P, 2) of the trees, from start to goal, in cells."""
    first, second = search.chains()
    return np.concatenate((first, second[-2::-1]))[:, :2]


def _corner_poses(space: FreeSpace, label: int) -> Floats:
    """Return poses (c, 3) [cells] in front of convex corners of obstacles, where paths bend."""
    inside = np.pad(space.labels == label, 1)
    rows, columns = space.labels.shape
    corner = np.zeros((rows, columns), dtype=np.bool_)
    for di, dj in ((0, 0), (0, 2), (2, 0), (2, 2)):
        # The diagonal neighbour is closed, the two cells between are open.
        diagonal = inside[di : di + rows, dj : dj + columns]
        in_row = inside[1:-1, dj : dj + columns]
        in_column = inside[di : di + rows, 1:-1]
        corner |= ~diagonal & in_row & in_column
    corners = np.flatnonzero(corner & inside[1:-1, 1:-1])
    row, column = np.divmod(corners, space.road.drivable.shape[1])
    return np.column_stack((column + 0.5, row + 0.5, np.zeros(len(corners))))


def joining_component(space: FreeSpace, query: Query) -> int:
    """Return the label of the component that joins start and goal.

    It is 0 if only the straight line joins them.

    Raises:
        BlockedError, NoWayError: no search could succeed.
    """
    road = space.road
    label = space.common_component(query.start, query.goal)
    if label:  # both ends can move to one of its cells
        return label
    ends = np.stack((query.start, query.goal))
    free = segments_free(road, ends, ends, query.radius)
    for name, (x, y), is_free in zip(("start", "goal"), ends, free, strict=True):
        if not is_free:
            raise BlockedError(
                name,
                f"the {name} ({x:.2f}, {y:.2f}) m is not drivable on road {road.name!r} "
                f"for a disc of radius {query.radius:.2f} m",
            )
    if label is None:
        raise NoWayError(
            f"no route leads from {query.start} m to {query.goal} m on road {road.name!r} "
            f"for a disc of radius {query.radius:.2f} m"
        )
    return label


@kernel(inline=True)
def _sees(clearance: Floats, path: Floats, a: int, x: float, y: float, radius: float) -> bool:
    """Whether the straight line from vertex a to (x, y) is free."""
    return bool(segment_free(clearance, path[a, 0], path[a, 1], x, y, radius))


@kernel(inline=True)
def _slide(clearance: Floats, path: Floats, a: int, v: int, b: int, radius: float) -> float:
    """Move vertex v along its edge to vertex b, as far as vertex a sees it; return the share."""
    vx, vy = path[v, 0], path[v, 1]
    dx, dy = path[b, 0] - vx, path[b, 1] - vy
    seen, hidden = 0.0, 1.0
    for _ in range(BISECTIONS_COUNT):
        middle = 0.5 * (seen + hidden)
        if _sees(clearance, path, a, vx + middle * dx, vy + middle * dy, radius):
            seen = middle
        else:
            hidden = middle
    path[v, 0] = vx + seen * dx
    path[v, 1] = vy + seen * dy
    return seen


@kernel(inline=True)
def _cut(clearance: Floats, path: Floats, v: int, n: int, radius: float) -> int:
    """Cut the corner at vertex v as far as the cut is free; return the number of vertices."""
    vx, vy = path[v, 0], path[v, 1]
    ax, ay = path[v - 1, 0] - vx, path[v - 1, 1] - vy
    bx, by = path[v + 1, 0] - vx, path[v + 1, 1] - vy
    free, blocked = 0.0, 1.0
    for _ in range(BISECTIONS_COUNT):
        cut = 0.5 * (free + blocked)
        if segment_free(
            clearance, vx + cut * ax, vy + cut * ay, vx + cut * bx, vy + cut * by, radius
        ):
            free = cut
        else:
            blocked = cut
    if free < MIN_CUT_SHARE or n == path.shape[0]:
        return n
    for k in range(n, v + 1, -1):
        copy_to(path[k], path[k - 1])
    path[v, 0], path[v, 1] = vx + free * ax, vy + free * ay
    path[v + 1, 0], path[v + 1, 1] = vx + free * bx, vy + free * by
    return n + 1


@kernel(inline=True)
def _remove_vertices(clearance: Floats, path: Floats, n: int, radius: float) -> int:
    """Go straight from each vertex to the farthest one that it sees, found by doubling."""
    kept, i = 1, 0
    while i < n - 1:
        farthest, stride = i + 1, 2
        while stride >= 1:
            j = farthest + stride
            if j < n and _sees(clearance, path, i, path[j, 0], path[j, 1], radius):
                farthest, stride = j, 2 * stride
            else:
                stride //= 2
        i = farthest
        copy_to(path[kept], path[i])  # and vertex i is still there: kept <= i
        kept += 1
    return kept


@kernel(inline=True)
def _length(path: Floats, n: int) -> float:
    total = 0.0
    for k in range(1, n):
        total += np.hypot(path[k, 0] - path[k - 1, 0], path[k, 1] - path[k - 1, 1])
    return total


@kernel(F2, I, F, I, OUT2, on_demand=True)
def pull_string(clearance: Floats, n: int, radius: float, passes: int, path: Floats) -> int:
    """Shorten the first `n` vertices of `path` (m, 2) [cells] in place; m - n have room for cuts.

    Returns:
        The number of vertices. The first and last are unchanged; every edge is free for the disc.
    """
    for _ in range(passes):
        n = _remove_vertices(clearance, path, n, radius)
        before = _length(path, n)
        v = 1
        while v < n - 1:
            slid = _slide(clearance, path, v - 1, v, v + 1, radius)
            slid += _slide(clearance, path, v + 1, v, v - 1, radius)
            grown = n if slid > 0.0 else _cut(clearance, path, v, n, radius)
            v += 1 + grown - n
            n = grown
        if before - _length(path, n) < MIN_SHORTENING_CELLS:
            break
    return n


def string_pulled(
    clearance: Floats, path: Floats, radius: float, passes: int = PASSES_COUNT
) -> Floats:
    """Return a path (P, 2), shortened by string pulling for a disc of `radius`; in cells."""
    vertices = np.empty((2 * len(path) + 32, 2))
    vertices[: len(path)] = path
    count = pull_string(clearance, len(path), radius + CORNER_MARGIN_CELLS, passes, vertices)
    return vertices[:count].copy()
