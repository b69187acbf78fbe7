# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""RRT*-Connect (the paper's Algorithms 1-5) in the plane: straight lines for a disc."""

from dataclasses import dataclass
import math

import numpy as np

from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.method.routing.search.dubins import Pose
from scenario_gen.method.routing.search.planner import (
    Budget,
    check_query,
    path_length,
    Plan,
    Query,
)
from scenario_gen.method.routing.search.shortcut import pull_string
from scenario_gen.method.routing.search.sweep import Disc, NO_PRICES, NOWHERE, Scene
from scenario_gen.method.routing.search.tree_samples import Rules
from scenario_gen.method.routing.search.two_trees import Search
from scenario_gen.numerics import Floats, sealed
from scenario_gen.roads import clearance_in_cells, component_cells, to_cells, to_metres
from scenario_gen.types import Road

RADIUS_MARGIN = 1e-7  # [cells] added to the disc, so that rounding touches no corner
BATCH = 512  # iterations between two looks at the clock
NO_GRID, NO_ROWS = sealed(np.zeros((0, 1), dtype=np.int32)), np.empty((2, 0))


@dataclass(frozen=True)
class RrtStarConnectConfig(Parameters):
    """Settings of RRT*-Connect; lengths in cells, as in the paper."""

    step: float = parameter(
        120.0, "longest new edge (the paper's preset: 5)", unit="cells", low=0.1, high=1e6
    )
    zeta: float = parameter(
        120.0,
        "largest near radius, zeta of eq 10; it decides quality (the paper's preset: 30)",
        unit="cells",
        low=0.1,
        high=1e6,
    )
    gamma_factor: float = parameter(
        1.1,
        "gamma of eq 10 as a multiple of the minimum that is asymptotically optimal",
        low=1.0,
        high=10.0,
    )
    greedy: bool = parameter(
        True, "extend as far as possible until the first path is found (the paper: one step)"
    )
    skip: bool = parameter(
        True, "let new edges skip visible ancestors, as Quick-RRT* does (the paper: no)"
    )
    corners: float = parameter(
        0.5,
        "share of samples beside convex corners of obstacles (the paper: 0)",
        low=0.0,
        high=0.9,
    )
    informed: bool = parameter(True, "sample only where a shorter path can lie, once there is one")
    pull: bool = parameter(True, "pull the path taut at the end (string pulling)")


PAPER = RrtStarConnectConfig(
    step=5.0, zeta=30.0, greedy=False, skip=False, corners=0.0, informed=False, pull=False
)


class RrtStarConnect:
    """The paper's planner, behind the Protocol of all planners.

    Source: paper III-B and appendix.
    """

    def __init__(self, config: RrtStarConnectConfig = RrtStarConnectConfig()) -> None:
        self.config = config

    def search(self, road: Road, query: Query, label: int, seed: int) -> Search:
        """The trees of a query, with no more than their roots; `label` is that of the component to sample from."""
        config = self.config
        scene = Scene(
            clearance_in_cells(road), NO_GRID, NOWHERE, Disc(query.radius / road.resolution), NO_PRICES, NO_ROWS
        )  # fmt: skip
        start, goal = (
            Pose(x, y, 0.0)
            for x, y in to_cells(road, np.array((query.start, query.goal))).tolist()
        )
        cells, corners = component_cells(road, query.radius, label)
        least_gamma = 2.0 * math.sqrt(
            1.5 * max(len(cells), 1) / math.pi
        )  # Karaman & Frazzoli 2011, d = 2
        rules = Rules(
            start, goal, cells, corners, NOWHERE, config.corners, 0.0, 0.0, config.step, 0.0, config.gamma_factor * least_gamma,
            config.zeta, config.greedy, config.skip, config.informed,
        )  # fmt: skip
        return Search(road, scene, rules, seed)

    def plan(self, road: Road, query: Query, budget: Budget, seed: int) -> Plan:
        """See `Planner.plan`; with a budget in iterations the answer depends on the seed only.

        Raises:
            BudgetSpentError: no path was found within the budget.
        """
        search = self.search(road, query, check_query(road, query), seed)
        known, size = np.inf, BATCH
        while (batch := search.batch(size, budget.iterations, budget)) > 0:
            search.grow(batch)
            size = min(2 * batch, BATCH)
            if search.best < known:
                size = (
                    16 if known == np.inf else size
                )  # look often at first: a path pulled taut bounds what follows
                known = search.best
                path = straight_path(search)
                if self.config.pull:
                    path = string_pulled(
                        search.scene.clearance, path, query.radius / road.resolution
                    )
                search.keep(path, path_length(path))
            if search.path is not None and (budget.first or search.is_straight()):
                break
        metres = to_metres(road, search.result())
        metres[0], metres[-1] = query.start, query.goal
        return Plan(metres, path_length(metres), search.iteration, np.array(search.history))


def straight_path(search: Search) -> Floats:
    """The trees' best path (P, 2), start to goal, in cells."""
    ours, theirs = search.chains()
    return search.tree.node[ours + theirs[1:], :2]


def string_pulled(clearance: Floats, path: Floats, radius: float, passes: int = 30) -> Floats:
    """`path` (P, 2), shortened by string pulling for a disc of `radius` (and a margin for rounding at corners); in cells."""
    room = np.empty((2 * len(path) + 32, 2))
    room[: len(path)] = path
    return room[: pull_string(clearance, len(path), radius + RADIUS_MARGIN, passes, room)].copy()
