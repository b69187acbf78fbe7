# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A search in progress: both trees, the budget, and the best path so far."""

from collections.abc import Iterator
from functools import cached_property
import math
from time import thread_time

import numpy as np

from scenario_gen.method.routing.search.dubins import Pose
from scenario_gen.method.routing.search.planner import Budget, BudgetSpentError, Plan
from scenario_gen.method.routing.search.rrt_star_connect import grow, Rules, STATE
from scenario_gen.method.routing.search.sweep import Scene
from scenario_gen.method.routing.search.trees import (
    fill_buckets,
    MAX_NEAR_COUNT,
    NEIGHBOUR,
    NODE,
    Tree,
)
from scenario_gen.numerics import Floats, Ints
from scenario_gen.roads import to_metres
from scenario_gen.types import Road

CROWDED_COUNT = 16  # nodes per bucket at which the buckets are halved
MIN_SIDE_CELLS = 2.0  # of a bucket
INITIAL_COUNT = 1024  # nodes and meetings that have room at first


class Search:
    """Two trees in a scene, and the best path (in cells) that the planner has kept.

    `rules` may be replaced between two rounds; `limit` is the iteration that ends the search.
    """

    def __init__(
        self, road: Road, scene: Scene, rules: Rules, ends: tuple[Pose, Pose], seed: int
    ) -> None:
        self.road, self.scene, self.rules = road, scene, rules
        self.started = thread_time()
        self.seed = seed % 2**64
        self.limit: int | None = None
        self.best = np.inf
        self.path: Floats | None = None
        self.cost = np.inf
        self.history: list[tuple[int, float, float]] = []
        self._straight = math.dist(ends[0][:2], ends[1][:2])
        self.state = np.array([(0, 0, 0, np.inf, self.seed)], dtype=STATE)
        self.meeting = np.empty((INITIAL_COUNT, 2), dtype=np.int64)
        self._best_meeting = -1
        start, goal = ends
        backwards = [Pose(end.x, end.y, end.yaw + np.pi) for end in (goal, start)]
        self.trees = (self._tree(start, goal), self._tree(*backwards))

    def _tree(self, root: Pose, goal: Pose) -> Tree:
        """Return a tree with nothing but its root."""
        node = np.empty(INITIAL_COUNT, dtype=NODE)
        node[0] = (*root, 0.0, 0.0, -1, -1, -1, -1, -1)
        side = max(max(self.scene.clearance.shape) / 8.0, MIN_SIDE_CELLS)
        near = np.empty(MAX_NEAR_COUNT, dtype=NEIGHBOUR)
        tree = Tree(
            root,
            goal,
            node,
            np.ones(1, dtype=np.int64),
            np.zeros((0, 0), dtype=np.int64),
            near,
            side,
        )
        return self._with_buckets(tree, side)

    def _with_buckets(self, tree: Tree, side: float) -> Tree:
        """Return the tree with buckets of another side."""
        rows, columns = (math.ceil(extent / side) for extent in self.scene.clearance.shape)
        bucket = np.full((rows, columns), -1, dtype=np.int64)
        tree = tree._replace(bucket=bucket, side=side)
        fill_buckets(tree)
        return tree

    def _with_room(self, tree: Tree) -> Tree:
        """Return the tree with room for more nodes, and smaller buckets if they are crowded."""
        size = int(tree.size[0])
        if size == len(tree.node):
            tree = tree._replace(node=np.concatenate((tree.node, np.empty_like(tree.node))))
        crowded = size * tree.side**2 > CROWDED_COUNT * len(self.rules.cells)
        if crowded and tree.side >= 2.0 * MIN_SIDE_CELLS:
            tree = self._with_buckets(tree, 0.5 * tree.side)
        return tree

    def _choose_meeting(self) -> None:
        """Find the cheapest of all meeting nodes (Algorithm 1, line 7)."""
        count = int(self.state["meetings"][0])
        if not count:
            return
        first, second = (tree.node["cost"] for tree in self.trees)
        pairs = self.meeting[:count]
        costs = first[pairs[:, 0]] + second[pairs[:, 1]]
        self._best_meeting = int(np.argmin(costs))
        self.best = float(costs[self._best_meeting])
        self._tighten_bound(self.best)

    def _tighten_bound(self, cost: float) -> None:
        if self.rules.informed:
            self.state["bound"] = min(self.state["bound"][0], cost)

    @cached_property
    def rng(self) -> np.random.Generator:
        """Random numbers of the planner's own."""
        return np.random.default_rng(self.seed)

    @property
    def iteration(self) -> int:
        """Number of iterations so far."""
        return int(self.state["iteration"][0])

    def grow(self, iterations: int) -> None:
        """Grow by some iterations, or fewer if the first path is found."""
        end, had_path = self.iteration + iterations, self.best < np.inf
        while self.iteration < end and (had_path or self.best == np.inf):
            grow(
                end - self.iteration,
                self.scene,
                self.rules,
                *self.trees,
                self.meeting,
                self.state,
            )
            first, second = self.trees
            self.trees = (self._with_room(first), self._with_room(second))
            if self.state["meetings"][0] == len(self.meeting):
                self.meeting = np.concatenate((self.meeting, np.empty_like(self.meeting)))
            self._choose_meeting()

    def rounds(self, budget: Budget, max_iterations: int) -> Iterator[bool]:
        """Grow by 1, 4, 16, ... iterations within a budget; yield whether the best path improved.

        The first iteration is the direct edge.
        """
        self.limit, size = budget.iterations, 1
        while not self._is_over(budget):
            count = size if self.limit is None else min(size, self.limit - self.iteration)
            known = self.best
            self.grow(count)
            size = min(4 * size, max_iterations)
            yield self.best < known

    def _is_over(self, budget: Budget) -> bool:
        if self.limit is not None and self.iteration >= self.limit:
            return True
        return budget.seconds is not None and thread_time() - self.started >= budget.seconds

    def chains(self) -> tuple[Floats, Floats]:
        """Return the poses (k, 3) of the best path's nodes, from each root to the meeting.

        Those of the second tree have the direction of their tree.
        """
        first, second = self.meeting[self._best_meeting]
        return _chain(self.trees[0], first), _chain(self.trees[1], second)

    def keep(self, path: Floats, cost: float) -> bool:
        """Keep a path (P, 2 or 3) if it costs less than the kept one; return whether it does."""
        if cost >= self.cost:
            return False
        self.path, self.cost = path, cost
        seconds = thread_time() - self.started
        self.history.append((self.iteration, seconds, cost * self.road.resolution))
        self._tighten_bound(cost)
        return True

    def is_straight(self) -> bool:
        """Whether no path can be better than the kept one."""
        return self.cost <= self._straight * (1.0 + 1e-9)

    def plan(self, start: Floats, goal: Floats) -> Plan:
        """Return the kept path in metres, between two positions (2,).

        Raises:
            BudgetSpentError: there is none.
        """
        if self.path is None:
            raise BudgetSpentError(
                f"no path found on road {self.road.name!r} within {self.iteration} iterations, "
                f"{thread_time() - self.started:.2f} s of CPU time"
            )
        path = np.column_stack((to_metres(self.road, self.path[:, :2]), self.path[:, 2:]))
        path[0, :2], path[-1, :2] = start, goal
        cost = self.cost * self.road.resolution
        return Plan(path, cost, self.iteration, np.array(self.history))


def _chain(tree: Tree, m: int) -> Floats:
    """Return the poses (k, 3) from the root to node m."""
    chain: list[int] = []
    while m >= 0:
        chain.append(m)
        m = int(tree.node["parent"][m])
    nodes: Ints = np.array(chain[::-1])
    return np.column_stack([tree.node[name][nodes] for name in ("x", "y", "yaw")])
