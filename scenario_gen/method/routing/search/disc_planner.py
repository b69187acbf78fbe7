# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""RRT*-Connect in the plane, as in the paper: straight lines for a disc."""

from dataclasses import dataclass
import math

import numpy as np

from scenario_gen.method.routing.search.dubins import Pose
from scenario_gen.method.routing.search.planner import (
    Budget,
    BudgetSpentError,
    joining_component,
    NO_POSES,
    path_length,
    Plan,
    Query,
)
from scenario_gen.method.routing.search.sampler import Rules
from scenario_gen.method.routing.search.search import Search
from scenario_gen.method.routing.search.shortcuts import string_pulled
from scenario_gen.method.routing.search.sweep import disc_scene
from scenario_gen.numerics import Floats
from scenario_gen.roads import free_cells, free_space, FreeSpace, to_cells
from scenario_gen.types import Road

MAX_ROUND_ITERATIONS = 512  # between two checks of the budget
RETRY_FACTOR = 100  # more iterations for a first path where connected components prove a route
CORNER_SPREAD_CELLS = 0.5  # of samples near convex corners


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
        cells, _ = free_cells(space, label)
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
                if search.path is None:
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
    _, corners = free_cells(space, label)
    row, column = np.divmod(corners, space.road.drivable.shape[1])
    return np.column_stack((column + 0.5, row + 0.5, np.zeros(len(corners))))
