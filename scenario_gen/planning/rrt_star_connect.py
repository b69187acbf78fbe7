# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""RRT*-Connect (the paper's Algorithms 1-5): two trees that rewire, meet, and go on improving."""

from dataclasses import dataclass
from time import thread_time

import numpy as np

from scenario_gen.arrays import Floats, Ints
from scenario_gen.parameters import check, parameter
from scenario_gen.planning import tree_kernels as trees
from scenario_gen.planning.planner import Budget, BudgetSpentError, check_query, path_length, Plan, Query
from scenario_gen.planning.shortcut import pull
from scenario_gen.roads.clearance import clearance_in_cells, to_cells, to_metres
from scenario_gen.roads.flood import component_at, component_cells, corner_cells
from scenario_gen.roads.road import Road

OCCUPANCY = 64  # nodes per bucket at which its side is halved
HAIR = 1e-7  # [cells]
BATCH = 512  # iterations between two looks at the clock


@dataclass(frozen=True)
class RrtStarConnectConfig:
    """Settings of RRT*-Connect; lengths in cells, as in the paper."""

    step: float = parameter(30.0, "longest new edge (the paper's preset: 5)", unit="cells", low=0.1, high=1e6)
    zeta: float = parameter(30.0, "largest near radius, zeta of eq 10; it decides quality", unit="cells", low=0.1, high=1e6)
    gamma_factor: float = parameter(
        1.1, "gamma of eq 10 as a multiple of the least that is asymptotically optimal", low=1.0, high=10.0
    )
    greedy: bool = parameter(True, "extend as far as possible until the first path is found (the paper: one step)")
    skip: bool = parameter(True, "let new edges skip ancestors in sight, as Quick-RRT* does (the paper: no)")
    corners: float = parameter(0.3, "share of samples beside convex corners of obstacles (the paper: 0)", low=0.0, high=0.9)
    informed: bool = parameter(True, "sample only where a shorter path can lie, once there is one")
    pull: bool = parameter(True, "draw the path taut at the end")

    def __post_init__(self) -> None:
        check(self)


PAPER = RrtStarConnectConfig(step=5.0, greedy=False, skip=False, corners=0.0, informed=False, pull=False)


class _Trees:
    """The two trees' arrays, and their growth."""

    def __init__(self, road: Road, query: Query, config: RrtStarConnectConfig, seed: int) -> None:
        self.clearance = clearance_in_cells(road)
        self.ends = to_cells(road, np.stack((query.start, query.goal)))
        label = component_at(road, query.start, query.radius)
        self.free_cells = component_cells(road, query.radius, label)
        self.corner_cells = corner_cells(road, query.radius, label)
        area = max(len(self.free_cells), 1)
        least_gamma = 2.0 * 1.5**0.5 * (area / np.pi) ** 0.5  # Karaman & Frazzoli 2011, d = 2
        side = max(max(self.clearance.shape) / 12.0, 1.0)
        radius = query.radius / road.resolution
        gamma = config.gamma_factor * least_gamma
        switches = float(config.greedy), float(config.skip), config.corners
        self.setting = np.array([radius, config.step, gamma, config.zeta, side, np.inf, np.inf, *switches])
        self.counter = np.zeros(7, dtype=np.int64)
        self.counter[trees.MEETING] = -1
        self.history = np.empty((256, 2))
        self.random = np.random.SeedSequence([seed]).generate_state(1, np.uint64).astype(np.uint64)
        self._empty_pool(256)
        trees.plant(self.ends, self.columns, self.node, self.link, self.chunk, self.head, self.counter, self.setting)

    @property
    def columns(self) -> int:
        """Buckets side by side."""
        return int(np.ceil(self.clearance.shape[1] / self.setting[trees.SIDE]))

    def _empty_pool(self, chunks: int) -> None:
        rows = int(np.ceil(self.clearance.shape[0] / self.setting[trees.SIDE]))
        self.node = np.empty((chunks * trees.CHUNK, 4))
        self.link = np.empty((chunks * trees.CHUNK, 5), dtype=np.int64)
        self.chunk = np.empty((chunks, 2), dtype=np.int64)
        self.head = np.full((2, rows * self.columns), -1, dtype=np.int64)

    def grow(self, iterations: int) -> None:
        """Make so many iterations, and give the trees room as they need it."""
        goal = self.counter[trees.ITERATION] + iterations
        while self.counter[trees.ITERATION] < goal:
            had_path = self.best < np.inf
            trees.grow(
                goal - self.counter[trees.ITERATION], self.clearance, self.ends, self.free_cells, self.corner_cells, self.node,
                self.link, self.chunk, self.head, self.counter, self.setting, self.history, self.random,
            )  # fmt: skip
            if self.counter[trees.HISTORY] + 1 >= len(self.history):
                self.history = np.concatenate((self.history, np.empty_like(self.history)))
            self._make_room()
            if not had_path and self.best < np.inf:
                return

    def _make_room(self) -> None:
        nodes = max(self.counter[trees.NODES_A], self.counter[trees.NODES_B])
        side = self.setting[trees.SIDE]
        crowded = nodes * side**2 > OCCUPANCY * len(self.free_cells) and side > 2.0
        full = self.counter[trees.CHUNKS] + 8 >= len(self.chunk)
        if crowded or full:
            old = self.node, self.link, self.chunk, self.head
            if crowded:
                self.setting[trees.SIDE] = 0.5 * side
            self._empty_pool(2 * len(self.chunk))
            trees.transplant(*old, self.columns, self.node, self.link, self.chunk, self.head, self.counter, self.setting)

    @property
    def best(self) -> float:
        """Length [cells] of the trees' best path."""
        return float(self.setting[trees.BEST])

    def path(self) -> Floats:
        """The best path through the trees: (P, 2) cells, start to goal."""
        meeting = int(self.counter[trees.MEETING])
        halves = [self._branch(meeting), self._branch(int(self.link[meeting, trees.PARTNER]))]
        if not np.array_equal(self.node[halves[0][-1], :2], self.ends[0]):
            halves.reverse()
        return np.concatenate((self.node[halves[0][::-1], :2], self.node[halves[1][1:], :2]))

    def _branch(self, m: int) -> Ints:
        branch = np.empty(1024, dtype=np.int64)
        while (count := trees.trace(self.link, m, branch)) > len(branch):
            branch = np.empty(count, dtype=np.int64)
        return branch[:count]


class RrtStarConnect:
    """The paper's planner, behind the Protocol of all planners."""

    def __init__(self, config: RrtStarConnectConfig = RrtStarConnectConfig()) -> None:
        self.config = config

    def plan(self, road: Road, query: Query, budget: Budget, seed: int) -> Plan:
        """See `Planner.plan`; with a budget in iterations the answer depends on the seed only."""
        check_query(road, query)
        started = thread_time()
        search = _Trees(road, query, self.config, seed)
        straight = float(np.hypot(*(search.ends[1] - search.ends[0])))
        shortest: Floats | None = None
        cost, known, batch = np.inf, np.inf, 16
        history: list[tuple[int, float, float]] = []
        while not (budget.cancelled and budget.cancelled()):
            done = int(search.counter[trees.ITERATION])
            if budget.iterations is not None:
                batch = min(batch, budget.iterations - done)
            if batch <= 0 or (budget.seconds is not None and thread_time() - started >= budget.seconds):
                break
            search.grow(batch)
            if search.best < known:
                known = search.best
                path = search.path()
                if self.config.pull:
                    path = taut(search.clearance, path, query.radius / road.resolution)
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


def taut(clearance: Floats, path: Floats, radius: float, passes: int = 30) -> Floats:
    """`path` (P, 2) drawn taut for a disc of `radius`, a hair off the corners so that rounding cannot touch them; in cells."""
    room = np.empty((2 * len(path) + 32, 2))
    room[: len(path)] = path
    return room[: pull(clearance, len(path), radius + HAIR, passes, room)].copy()
