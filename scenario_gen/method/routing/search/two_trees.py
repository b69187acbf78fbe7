# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A search with two trees: their growth, their budget, and the best path that was made of them."""

import math
from time import thread_time

import numpy as np

from scenario_gen.method.routing.search.growth import grow_curves, grow_lines
from scenario_gen.method.routing.search.planner import Budget, BudgetSpentError
from scenario_gen.method.routing.search.sweep import Car, Scene
from scenario_gen.method.routing.search.tree import (  # fmt: skip
    CHUNK,
    CURVE,
    LINE,
    NEAR,
    NEIGHBOUR,
    PARENT,
    PARTNER,
    transplant,
    Tree,
)
from scenario_gen.method.routing.search.tree_samples import Rules, STATE
from scenario_gen.numerics import Floats
from scenario_gen.types import Road

OCCUPANCY = 32  # nodes per bucket at which its side is halved
ROOM = 4  # times the nodes there are: what a new pool holds
LARGE = 1 << 15  # nodes from which on samples are drawn ahead
AHEAD = 1 << 18  # how many at most


class Search:
    """Two trees in a scene, and the best path (in cells) that its planner has kept.

    `scene` and `rules` may be exchanged between two growths.
    """

    def __init__(self, road: Road, scene: Scene, rules: Rules, seed: int) -> None:
        self.road, self.scene, self.rules = road, scene, rules
        self.started = thread_time()
        self.state = np.array(
            [((0, 0), 0, 0, 0, -1, 0, 0, 0, np.inf, np.inf, seed % 2**64)], dtype=STATE
        )
        self.near, self.drawn = np.empty(NEAR, dtype=NEIGHBOUR), np.empty((0, 3))
        self.tree = self._pool(max(max(scene.clearance.shape) / 8.0, 1.0))
        self.path: Floats | None = None
        self.cost = np.inf
        self.history: list[tuple[int, float, float]] = []
        self.straight = math.dist(rules.start[:2], rules.goal[:2])

    def _pool(self, side: float) -> Tree:
        """An empty pool with room for four times the nodes there are: no bucket has more than one chunk that is not full."""
        rows, columns = (math.ceil(extent / side) for extent in self.scene.clearance.shape)
        nodes = ROOM * int(self.state["nodes"].sum())
        chunks = 256 + nodes // CHUNK + min(nodes, 2 * rows * columns)
        node = np.empty((chunks * CHUNK, CURVE if isinstance(self.scene.body, Car) else LINE))
        link, chunk = (
            np.empty((len(node), 5), dtype=np.int32),
            np.empty((chunks, 2), dtype=np.int64),
        )
        head = np.full((2, rows * columns), -1)
        return Tree(node, link, chunk, head, self.state, self.drawn, self.near, side, columns)

    def grow(self, iterations: int) -> None:
        """Make so many iterations, or fewer where the first path is found; give the trees room as they need it."""
        goal = self.iteration + iterations
        grow = grow_curves if isinstance(self.scene.body, Car) else grow_lines
        had_path = self.best < np.inf
        while self.iteration < goal and (had_path or self.best == np.inf):
            grow(goal - self.iteration, self.scene, self.rules, self.tree)
            self._make_room()

    def _make_room(self) -> None:
        old, side = self.tree, self.tree.side
        a, b = self.state["nodes"][0].tolist()
        if a + b > LARGE and not len(self.drawn):
            self.drawn = np.empty((AHEAD, 3))
            self.tree = old._replace(drawn=self.drawn)
        crowded = max(a, b) * side * side > OCCUPANCY * len(self.rules.cells) and side > 2.0
        if crowded or self.state["chunks"][0] + 8 >= len(old.chunk):
            self.tree = self._pool(0.5 * side if crowded else side)
            transplant(old, self.tree)

    @property
    def iteration(self) -> int:
        """How many were made."""
        return int(self.state["iteration"][0])

    @property
    def best(self) -> float:
        """Cost of the trees' best path."""
        return float(self.state["best"][0])

    def chains(self) -> tuple[list[int], list[int]]:
        """The nodes of the trees' best path: ids from the start's root to where the trees meet, and from there to the goal's."""
        meeting = int(self.state["connection"][0])
        found = [self._upwards(m) for m in (meeting, int(self.tree.link[meeting, PARTNER]))]
        ours, theirs = found if found[0][-1] == self.state["root"][0] else found[::-1]
        return ours[::-1], theirs

    def _upwards(self, m: int) -> list[int]:
        chain, parent = [], self.tree.link[:, PARENT].item
        while m >= 0:
            chain.append(m)
            m = parent(m)
        return chain

    def batch(self, size: int, limit: int | None, budget: Budget) -> int:
        """How many iterations to make next: at most `size`, up to the `limit` of all; none if the time is up or cancelled."""
        late = budget.seconds is not None and thread_time() - self.started >= budget.seconds
        if late or (budget.cancelled and budget.cancelled()):
            return 0
        return size if limit is None else min(size, limit - self.iteration)

    def keep(self, path: Floats, cost: float) -> bool:
        """Keep a path (P, 2 or more) if it costs less than the one that is kept; what follows must better it, if informed."""
        if cost >= self.cost:
            return False
        self.path, self.cost = path, cost
        self.history.append(
            (self.iteration, thread_time() - self.started, cost * self.road.resolution)
        )
        if self.rules.informed:
            self.state["bound"] = min(self.state["bound"][0], cost)
        return True

    def is_straight(self) -> bool:
        """Whether no path can be better than the one that is kept."""
        return self.cost <= self.straight * (1.0 + 1e-9)

    def result(self) -> Floats:
        """The path that is kept.

        Raises:
            BudgetSpentError: there is none.
        """
        if self.path is None:
            raise BudgetSpentError(
                f"no path found on road {self.road.name!r} within {self.iteration} iterations, "
                f"{thread_time() - self.started:.2f} s of CPU time"
            )
        return self.path
