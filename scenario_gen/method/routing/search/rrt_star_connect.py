# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""RRT*-Connect (the paper's Algorithms 1-5): two trees that rewire, meet, and go on improving."""

from dataclasses import dataclass
import math
from time import thread_time

import numpy as np

from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.method.routing.search import tree_nodes as trees
from scenario_gen.method.routing.search.planner import Budget, BudgetSpentError, check_query, path_length, Plan, Query
from scenario_gen.method.routing.search.shortcut import pull_string
from scenario_gen.method.routing.search.tree_kernels import grow
from scenario_gen.numerics import Floats
from scenario_gen.roads import clearance_in_cells, component_cells, to_cells, to_metres
from scenario_gen.types import Road

OCCUPANCY = 32  # nodes per bucket at which its side is halved
ROOM = 4  # times the nodes there are: what a new pool holds
LARGE = 1 << 15  # nodes from which on samples are drawn ahead
AHEAD = 1 << 18  # how many at most
RADIUS_MARGIN = 1e-7  # [cells] added to the disc, so that rounding touches no corner
BATCH = 512  # iterations between two looks at the clock


@dataclass(frozen=True)
class RrtStarConnectConfig(Parameters):
    """Settings of RRT*-Connect; lengths in cells, as in the paper."""

    step: float = parameter(120.0, "longest new edge (the paper's preset: 5)", unit="cells", low=0.1, high=1e6)
    zeta: float = parameter(
        120.0, "largest near radius, zeta of eq 10; it decides quality (the paper's preset: 30)", unit="cells", low=0.1, high=1e6
    )
    gamma_factor: float = parameter(
        1.1, "gamma of eq 10 as a multiple of the least that is asymptotically optimal", low=1.0, high=10.0
    )
    greedy: bool = parameter(True, "extend as far as possible until the first path is found (the paper: one step)")
    skip: bool = parameter(True, "let new edges skip visible ancestors, as Quick-RRT* does (the paper: no)")
    corners: float = parameter(0.5, "share of samples beside convex corners of obstacles (the paper: 0)", low=0.0, high=0.9)
    informed: bool = parameter(True, "sample only where a shorter path can lie, once there is one")
    pull: bool = parameter(True, "pull the path taut at the end (string pulling)")


PAPER = RrtStarConnectConfig(step=5.0, zeta=30.0, greedy=False, skip=False, corners=0.0, informed=False, pull=False)


class _Trees:
    """The two trees' arrays, and their growth."""

    def __init__(self, road: Road, query: Query, label: int, config: RrtStarConnectConfig, seed: int) -> None:
        self.clearance = clearance_in_cells(road)
        self.ends = to_cells(road, np.array((query.start, query.goal)))
        self.free_cells, self.corner_cells = component_cells(road, query.radius, label)
        least_gamma = 2.0 * math.sqrt(1.5 * max(len(self.free_cells), 1) / math.pi)  # Karaman & Frazzoli 2011, d = 2
        gamma = config.gamma_factor * least_gamma
        side = max(max(self.clearance.shape) / 8.0, 1.0)
        radius = query.radius / road.resolution
        switches = config.greedy, config.skip, config.corners, config.informed
        self.setting = np.array([radius, config.step, gamma, config.zeta, side, np.inf, np.inf, *switches])
        self.counter = np.zeros(trees.COUNTERS, dtype=np.int64)
        self.counter[trees.CONNECTION] = -1
        self.history = np.empty((64, 2))
        self.random = np.array([seed % 2**64], dtype=np.uint64)
        self.drawn = np.empty((0, 2))
        self._empty_pool()
        trees.plant(self.ends, self.columns, self.node, self.link, self.chunk, self.head, self.counter, self.setting)

    @property
    def columns(self) -> int:
        """Buckets side by side."""
        return math.ceil(int(self.clearance.shape[1]) / float(self.setting[trees.SIDE]))

    def _empty_pool(self) -> None:
        """An empty pool with room for four times the nodes there are: no bucket has more than one chunk that is not full."""
        buckets = math.ceil(int(self.clearance.shape[0]) / float(self.setting[trees.SIDE])) * self.columns
        nodes = ROOM * int(self.counter[trees.NODES_A] + self.counter[trees.NODES_B])
        chunks = 256 + nodes // trees.CHUNK + min(nodes, 2 * buckets)
        self.node = np.empty((chunks * trees.CHUNK, 4))
        self.link = np.empty((chunks * trees.CHUNK, 5), dtype=np.int32)
        self.chunk = np.empty((chunks, 2), dtype=np.int64)
        self.head = np.empty((2, buckets), dtype=np.int64)
        self.head.fill(-1)

    def grow(self, iterations: int) -> None:
        """Make so many iterations, or fewer where the first path is found; give the trees room as they need it."""
        goal = self.counter[trees.ITERATION] + iterations
        had_path = self.best < np.inf
        while self.counter[trees.ITERATION] < goal and (had_path or self.best == np.inf):
            grow(
                goal - self.counter[trees.ITERATION], self.clearance, self.ends, self.free_cells, self.corner_cells, self.drawn,
                self.node, self.link, self.chunk, self.head, self.counter, self.setting, self.history, self.random,
            )  # fmt: skip
            if self.counter[trees.HISTORY] + 1 >= len(self.history):
                self.history = np.concatenate((self.history, np.empty_like(self.history)))
            self._make_room()

    def _make_room(self) -> None:
        a, b = int(self.counter[trees.NODES_A]), int(self.counter[trees.NODES_B])
        side = self.setting[trees.SIDE]
        crowded = max(a, b) * np.square(side) > OCCUPANCY * len(self.free_cells) and side > 2.0
        if crowded or self.counter[trees.CHUNKS] + 8 >= len(self.chunk):
            old = self.node, self.link, self.chunk, self.head
            if crowded:
                self.setting[trees.SIDE] = 0.5 * side
            self._empty_pool()
            trees.transplant(*old, self.columns, self.node, self.link, self.chunk, self.head, self.counter, self.setting)
        if a + b > LARGE and not len(self.drawn):
            self.drawn = np.empty((AHEAD, 2))

    @property
    def best(self) -> float:
        """Length [cells] of the trees' best path."""
        return float(self.setting[trees.BEST])

    def path(self) -> Floats:
        """The best path through the trees: (P, 2) cells, start to goal."""
        path = np.empty((512, 2))
        connection = int(self.counter[trees.CONNECTION])
        while (count := trees.trace(self.ends, self.node, self.link, connection, path)) > len(path):
            path = np.empty((count, 2))
        return path[:count]


class RrtStarConnect:
    """The paper's planner, behind the Protocol of all planners.

    Source: paper III-B and appendix.
    """

    def __init__(self, config: RrtStarConnectConfig = RrtStarConnectConfig()) -> None:
        self.config = config

    def plan(self, road: Road, query: Query, budget: Budget, seed: int) -> Plan:
        """See `Planner.plan`; with a budget in iterations the answer depends on the seed only.

        Raises:
            BudgetSpentError: no path was found within the budget.
        """
        label = check_query(road, query)
        started = thread_time()
        search = _Trees(road, query, label, self.config, seed)
        straight = float(np.hypot(*(search.ends[1] - search.ends[0])))
        shortest: Floats | None = None
        cost, known, batch = np.inf, np.inf, BATCH
        history: list[tuple[int, float, float]] = []
        while not (budget.cancelled and budget.cancelled()):
            done = int(search.counter[trees.ITERATION])
            if budget.iterations is not None:
                batch = min(batch, budget.iterations - done)
            if batch <= 0 or (budget.seconds is not None and thread_time() - started >= budget.seconds):
                break
            search.grow(batch)
            if search.best < known:
                batch = 8 if known == np.inf else batch  # look often at first: a path drawn string_pulled bounds what follows
                known = search.best
                path = search.path()
                if self.config.pull:
                    path = string_pulled(search.clearance, path, query.radius / road.resolution)
                length = path_length(path)
                if length < cost:
                    cost, shortest = length, path
                    history.append((int(search.counter[trees.ITERATION]), thread_time() - started, cost * road.resolution))
                    if self.config.informed:
                        search.setting[trees.BOUND] = min(search.setting[trees.BOUND], cost)
            if shortest is not None and (budget.first or cost <= straight * (1.0 + 1e-12)):
                break
            batch = min(2 * batch, BATCH)
        if shortest is None:
            raise BudgetSpentError(
                f"no path found on road {road.name!r} within {int(search.counter[trees.ITERATION])} iterations, "
                f"{thread_time() - started:.2f} s of CPU time"
            )
        metres = to_metres(road, shortest)
        metres[0], metres[-1] = query.start, query.goal
        return Plan(metres, path_length(metres), int(search.counter[trees.ITERATION]), np.array(history))


def string_pulled(clearance: Floats, path: Floats, radius: float, passes: int = 30) -> Floats:
    """`path` (P, 2), shortened by string pulling for a disc of `radius` (and a margin for rounding at corners); in cells."""
    room = np.empty((2 * len(path) + 32, 2))
    room[: len(path)] = path
    return room[: pull_string(clearance, len(path), radius + RADIUS_MARGIN, passes, room)].copy()
