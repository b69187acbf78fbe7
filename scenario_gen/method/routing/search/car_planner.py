# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""RRT*-Connect for a vehicle, from pose to pose: Dubins curves for a rectangle.

Most samples lie near a path for a disc inside the footprint, later near the best path.
"""

from dataclasses import dataclass
import itertools
import math

import numpy as np

from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.method.routing.search.dubins import dubins_poses, Pose
from scenario_gen.method.routing.search.planner import (
    BlockedError,
    Budget,
    NO_POSES,
    NoWayError,
    Plan,
    PoseQuery,
)
from scenario_gen.method.routing.search.rrt_star_connect import Rules
from scenario_gen.method.routing.search.search import Search
from scenario_gen.method.routing.search.sweep import (
    car_scene,
    costs_per_length,
    disc_scene,
    poses_in_cells,
    Scene,
    steering_cost,
)
from scenario_gen.numerics import arc_lengths, edge_lengths, edge_yaws, Floats, Ints, wrap_angle
from scenario_gen.roads import (
    footprint_fits,
    free_cells,
    free_space,
    segments_free,
    to_cells,
    to_metres,
)
from scenario_gen.types import Road

SPACING_M = 0.5  # between two poses of a path
MAX_ROUND_ITERATIONS = 64  # between two checks of the budget
MAX_DISC_ITERATIONS = 512  # of a search for a disc
DISC_MARGINS_M = (0.0, 0.25, 0.05)  # of the discs whose paths are sampled near, in turn
DISC_ITERATIONS = 5000  # for such a path
NEXT_DISC_ITERATIONS = 512  # without a path, after which the next disc is tried
DISC_STEP_CELLS = 120.0  # longest edge of such a path
MIN_SAVING_CELLS = 1e-3  # of a shortcut
# d of eq 10: a ball of radius r holds poses r ahead, r² / 2R sideways and r / R in heading, which
# count 1 + 2 + 1 (Karaman & Frazzoli 2013)
DIMENSIONS_COUNT = 4


@dataclass(frozen=True)
class PoseSearchConfig(Parameters):
    """Settings of RRT*-Connect for a vehicle."""

    step: float = parameter(
        4.0, "longest new edge before the first path", unit="m", low=0.5, high=100.0
    )
    stride: float = parameter(15.0, "longest new edge from then on", unit="m", low=0.5, high=100.0)
    zeta: float = parameter(
        15.0, "largest near radius, zeta of eq 10", unit="m", low=0.5, high=100.0
    )
    gamma_factor: float = parameter(
        1.1,
        "gamma of eq 10 as a multiple of the minimum that is asymptotically optimal",
        low=1.0,
        high=10.0,
    )
    about: float = parameter(
        0.7,
        "share of samples near a known path: a disc's, or the best so far",
        low=0.0,
        high=0.95,
    )
    spread: float = parameter(
        1.0, "standard deviation of their distance from it", unit="m", low=0.05, high=20.0
    )
    yaw_spread: float = parameter(
        0.4, "standard deviation of their headings", unit="rad", low=0.01, high=3.2
    )
    improve: int = parameter(
        50, "iterations for a better path, once there is one", low=0, high=10_000_000
    )
    shortcuts: int = parameter(
        50,
        "pairs of poses between which a shorter curve is tried, whenever a better path is found",
        low=0,
    )


class PoseRrtStarConnect:
    """RRT*-Connect with poses for points, Dubins curves for lines, the rectangle for the disc.

    Source: paper III-B and appendix; Dubins curves in RRT* as Karaman & Frazzoli 2013.
    """

    def __init__(self, config: PoseSearchConfig = PoseSearchConfig()) -> None:
        self.config = config

    def plan_poses(self, road: Road, query: PoseQuery, budget: Budget, seed: int) -> Plan:
        """See `Planner.plan_poses`; the budget is that of a first path, `improve` come after.

        With a budget in iterations the answer depends on the seed only.

        Raises:
            BlockedError: the footprint has no room at start or goal.
            NoWayError: not even a disc as wide as the footprint can get there.
            BudgetSpentError: none was found within the budget.
        """
        refuse_blocked(road, query)
        search = self._search(road, query, seed)
        next_disc = 1
        for improved in search.rounds(budget, MAX_ROUND_ITERATIONS):
            if improved:
                self._keep_best(search, budget)
            is_direct = not len(search.rules.near)
            if search.path is not None and (budget.first or search.is_straight() or is_direct):
                break
            if search.path is None and search.iteration >= next_disc:
                self._sample_near_disc_path(search, query, seed + next_disc)
                next_disc += NEXT_DISC_ITERATIONS
        return search.plan(query.start[:2], query.goal[:2])

    def _search(self, road: Road, query: PoseQuery, seed: int) -> Search:
        """Return the search of a query before it grows."""
        cell, config = road.resolution, self.config
        rules = Rules(
            cells=np.flatnonzero(road.drivable),
            near=NO_POSES,
            near_share=config.about,
            spread=config.spread / cell,
            yaw_spread=config.yaw_spread,
            step=config.step / cell,
            gamma=0.0,
            zeta=config.zeta / cell,
            exponent=1.0 / DIMENSIONS_COUNT,
            greedy=True,
            informed=True,
        )
        start, goal = (
            Pose(*poses_in_cells(road, pose).tolist()) for pose in (query.start, query.goal)
        )
        return Search(road, car_scene(road, query), rules, (start, goal), seed)

    def _keep_best(self, search: Search, budget: Budget) -> None:
        """Shorten the best path of the trees; keep it, and sample near it, if it is the best."""
        cell, is_first = search.road.resolution, search.path is None
        attempts = 0 if is_first and budget.first else self.config.shortcuts
        path = _driven_path(search)
        path, cost = shortened(path, attempts, SPACING_M / cell, search.scene, search.rng)
        if search.keep(path, cost) and len(search.rules.near):
            search.rules = search.rules._replace(near=path)
        if is_first:
            search.rules = search.rules._replace(step=self.config.stride / cell)
            search.limit = search.iteration + self.config.improve

    def _sample_near_disc_path(self, search: Search, query: PoseQuery, seed: int) -> None:
        """Sample near a path for a disc inside the footprint from now on, and set gamma of eq 10.

        Raises:
            NoWayError: there is none, so that there is none for the footprint.
        """
        road = search.road
        attempt = search.iteration // NEXT_DISC_ITERATIONS
        margin = DISC_MARGINS_M[attempt % len(DISC_MARGINS_M)]
        line, cells = _disc_path(road, query, search.rules, margin, seed)
        samples = query.preferences.samples
        if not len(samples):
            samples = poses_on_line(line, SPACING_M)
        # mu_free / V_d of eq 10, with the ball of DIMENSIONS_COUNT
        volume_ratio = len(cells) * 2.0 * math.pi * search.scene.body.turn_radius**2
        root = ((1.0 + 1.0 / DIMENSIONS_COUNT) * volume_ratio) ** (1.0 / DIMENSIONS_COUNT)
        search.rules = search.rules._replace(
            cells=cells,
            near=poses_in_cells(road, samples),
            gamma=self.config.gamma_factor * 2.0 * root,
        )


def refuse_blocked(road: Road, query: PoseQuery) -> None:
    """Raise BlockedError if the footprint has no room at the start or the goal."""
    ends = np.stack((query.start, query.goal))
    fits = footprint_fits(road, ends, query.length, query.width)
    for name, (x, y, _), has_room in zip(("start", "goal"), ends, fits, strict=True):
        if not has_room:
            raise BlockedError(
                name,
                f"the {name} ({x:.2f}, {y:.2f}) m has no room on road {road.name!r} "
                f"for a footprint of {query.length:.2f} m by {query.width:.2f} m",
            )


def refuse_no_way(road: Road, query: PoseQuery) -> None:
    """Raise NoWayError if not even a disc as wide as the footprint can get from start to goal."""
    if _component(road, query, _least_radius(road, query)) is None:
        (from_x, from_y), (to_x, to_y) = query.start[:2], query.goal[:2]
        raise NoWayError(
            f"no route leads from ({from_x:.2f}, {from_y:.2f}) m to ({to_x:.2f}, {to_y:.2f}) m "
            f"on road {road.name!r}: it is too narrow for a width of {query.width:.2f} m"
        )


def _least_radius(road: Road, query: PoseQuery) -> float:
    """Return the radius [m] of a disc without a way where the footprint has certainly none."""
    half = 0.5 * min(query.width, query.length)
    return max(half - 0.75 * road.resolution, 0.0)  # components may miss gaps between centres


def _component(road: Road, query: PoseQuery, radius: float) -> int | None:
    """Return the component of the free space by which a disc can get from start to goal.

    It is 0 if only the straight line joins them, None if nothing does.
    """
    return free_space(road, radius).common_component(query.start[:2], query.goal[:2])


def _disc_path(
    road: Road, query: PoseQuery, rules: Rules, margin: float, seed: int
) -> tuple[Floats, Ints]:
    """Return a path (P, 2) [m] for the largest disc of three that finds one, and where it can be.

    The latter are the flat indices of the cells to sample from. Without a path the straight line
    takes its place.

    Raises:
        NoWayError: not even the smallest disc has a route.
    """
    refuse_no_way(road, query)
    half, everywhere = 0.5 * min(query.width, query.length), np.flatnonzero(road.drivable)
    ends = np.stack((query.start[:2], query.goal[:2]))
    start, goal = (Pose(x, y, 0.0) for x, y in to_cells(road, ends).tolist())
    cells = everywhere
    for radius in (half + margin, half, _least_radius(road, query)):
        label = _component(road, query, radius)
        if label is None:
            continue
        inside = free_cells(free_space(road, radius), label)
        cells = inside if label and len(inside) else everywhere
        straight = rules._replace(cells=inside, near=NO_POSES, step=DISC_STEP_CELLS)
        search = Search(road, disc_scene(road, radius), straight, (start, goal), seed)
        for has_path in search.rounds(Budget(DISC_ITERATIONS), MAX_DISC_ITERATIONS):
            if has_path:
                first, second = search.chains()
                line = to_metres(road, np.concatenate((first, second[-2::-1]))[:, :2])
                line[[0, -1]] = ends
                return _straightened(road, line, radius), cells
    return ends, cells


def _straightened(road: Road, line: Floats, radius: float) -> Floats:
    """Return a polyline (P, 2) [m] that goes from each vertex to the last one that it sees."""
    kept = [0]
    while kept[-1] < len(line) - 1:
        ahead = line[kept[-1] + 1 :]
        sees = segments_free(road, np.broadcast_to(line[kept[-1]], ahead.shape), ahead, radius)
        kept.append(kept[-1] + 1 + int(np.flatnonzero(sees).max(initial=0)))
    return line[kept]


def _driven_path(search: Search) -> Floats:
    """Return dense poses (P, 3) [cells] along the best path of the trees, from start to goal."""
    spacing, radius = SPACING_M / search.road.resolution, search.scene.body.turn_radius
    first, second = (dense_path(chain, radius, spacing) for chain in search.chains())
    backwards = second[::-1] + np.array([0.0, 0.0, np.pi])  # driven towards the goal
    path = np.concatenate((first, backwards[1:]))
    path[:, 2] = wrap_angle(path[:, 2])
    return path


def dense_path(chain: Floats, radius: float, spacing: float) -> Floats:
    """Return poses (P, 3) along the Dubins curves through a chain of poses (k, 3); in cells."""
    pieces = [chain[:1]]
    for start, end in itertools.pairwise(chain):
        pieces.append(dubins_poses(start, end, radius, spacing)[1:])
        pieces[-1][-1:] = end
    return np.concatenate(pieces)


def shortened(
    path: Floats, attempts: int, spacing: float, scene: Scene, rng: np.random.Generator
) -> tuple[Floats, float]:
    """Put cheaper Dubins curves between random poses of a path (P, 3); return it and its cost.

    The first attempt joins start and goal. All is in cells.

    Source: shortcuts as in Geraerts & Overmars 2007, with Dubins curves.
    """
    radius, costs = scene.body.turn_radius, _costs(path, scene)
    for attempt in range(attempts):
        i, j = sorted(rng.integers(len(path), size=2).tolist())
        if attempt == 0:
            i, j = 0, len(path) - 1
        if j - i < 2:
            continue
        cost = steering_cost(Pose(*path[i]), Pose(*path[j]), scene)
        if cost > costs[i:j].sum() - MIN_SAVING_CELLS:
            continue
        piece = dense_path(path[[i, j]], radius, spacing)
        path = np.concatenate((path[:i], piece, path[j + 1 :]))
        costs = np.concatenate((costs[:i], _costs(piece, scene), costs[j:]))
    return path, float(costs.sum())


def _costs(path: Floats, scene: Scene) -> Floats:
    """Return the cost (P - 1,) of each piece, an arc or a straight line, of a free path (P, 3)."""
    per_length = np.empty(len(path) - 1)
    costs_per_length(path[1:], scene, per_length)
    half_turn = 0.5 * wrap_angle(np.diff(path[:, 2]))
    return per_length * edge_lengths(path[:, :2]) / np.sinc(half_turn / np.pi)


def poses_on_line(line: Floats, spacing: float) -> Floats:
    """Return poses (M, 3) about `spacing` apart on a polyline (P, 2) [m]."""
    yaw = edge_yaws(line)
    corners = arc_lengths(line)
    s = np.linspace(0.0, corners[-1], max(int(np.ceil(corners[-1] / spacing)) + 1, 2))
    edge = np.clip(np.searchsorted(corners, s, side="right") - 1, 0, len(yaw) - 1)
    x = np.interp(s, corners, line[:, 0])
    return np.column_stack((x, np.interp(s, corners, line[:, 1]), yaw[edge]))
