# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""RRT*-Connect in the vehicle's own space: from pose to pose for a rectangle that turns no tighter than a curvature allows."""

from dataclasses import dataclass, field
import math
from time import thread_time
from typing import Protocol, runtime_checkable

import numpy as np

from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.method.routing.search import pose_tree as trees
from scenario_gen.method.routing.search import tree_nodes as shared
from scenario_gen.method.routing.search.planner import BlockedError, Budget, BudgetSpentError, NoWayError, Query
from scenario_gen.method.routing.search.pose_path import shorten, trace
from scenario_gen.method.routing.search.rrt_star_connect import RrtStarConnect, RrtStarConnectConfig, string_pulled
from scenario_gen.method.routing.search.sweep import SWEEP
from scenario_gen.numerics import Floats, wrap_angle
from scenario_gen.roads import (
    blocked_before,
    clearance_in_cells,
    common_component,
    component_cells,
    footprint_fits,
    to_cells,
    to_metres,
)
from scenario_gen.types import Road

POOL = 512  # nodes that a pool has room for at first
PIECE = 0.5  # [m] longest piece of a path
BATCH = 64  # iterations between two looks at the clock
DISCS = (0.0, 0.25, 0.05)  # [m] by which the discs are wider than the footprint whose paths are sampled about, one after another
DISC_BUDGET = 5000  # iterations for such a path
ANOTHER = 512  # iterations after which another one is taken, if there is no path yet
DISC = RrtStarConnect(RrtStarConnectConfig(pull=False))
NOWHERE = np.empty((0, 3))


@dataclass(frozen=True)
class PoseSearchConfig(Parameters):
    """Settings of RRT*-Connect in the vehicle's own space."""

    step: float = parameter(4.0, "longest new edge before the first path", unit="m", low=0.5, high=100.0)
    stride: float = parameter(15.0, "longest new edge from then on", unit="m", low=0.5, high=100.0)
    zeta: float = parameter(15.0, "largest near radius, zeta of eq 10", unit="m", low=0.5, high=100.0)
    gamma_factor: float = parameter(
        1.1, "gamma of eq 10 as a multiple of the least that is asymptotically optimal", low=1.0, high=10.0
    )
    about: float = parameter(0.7, "share of samples about a path that is known, a disc's or the best so far", low=0.0, high=0.95)
    spread: float = parameter(1.0, "how far from it", unit="m", low=0.05, high=20.0)
    yaw_spread: float = parameter(0.4, "and from its heading", unit="rad", low=0.01, high=3.2)
    improve: int = parameter(50, "iterations for a better path, once there is one", low=0, high=10_000_000)
    shortcuts: int = parameter(
        50, "pairs of poses between which a shorter curve is tried, whenever a better path is found", low=0
    )


@dataclass(frozen=True, eq=False)
class Wishes:
    """What is dearer than its length, so that it is kept to where the road has room.

    Attributes:
        room: metres wished for beside the footprint.
        lack: price of a metre without any room, beside the metre itself.
        guide: (G, 3) poses of a line to keep to; none: no side is dearer than the other.
        left: price of a metre driven a metre left of it.
        right: likewise right of it.
        most_left: farthest left of it [m]; what lies beyond is closed.
        most_right: likewise right of it.
        about: (G, 3) poses to sample about; none: those of a disc's path.
    """

    room: float = 0.0
    lack: float = 1.0
    guide: Floats = field(default_factory=lambda: NOWHERE)
    left: float = 0.0
    right: float = 0.0
    most_left: float = math.inf
    most_right: float = math.inf
    about: Floats = field(default_factory=lambda: NOWHERE)


@dataclass(frozen=True, eq=False)
class PoseQuery:
    """From where to where: start and goal (3,) x [m], y [m], yaw [rad]; footprint [m]; largest curvature [1/m]."""

    start: Floats
    goal: Floats
    length: float
    width: float
    curvature: float


@dataclass(frozen=True, eq=False)
class PosePlan:
    """The planner's answer.

    Attributes:
        poses: (P, 3) x [m], y [m], yaw [rad]: a chain of straight lines and arcs, start to goal.
        curvature: (P,) 1/m, of the piece that leads to each pose; 0 at the start.
        step: (P,) its length [m]; 0 at the start.
        cost: its length [m], and what the wishes add.
        iterations: how many were made; 1: the direct curve was free.
        history: (h, 3) iteration, CPU seconds, cost [m] of each improvement.
    """

    poses: Floats
    curvature: Floats
    step: Floats
    cost: float
    iterations: int
    history: Floats


class _Search:
    """The two trees' arrays, and their growth."""

    def __init__(self, road: Road, query: PoseQuery, wishes: Wishes, config: PoseSearchConfig, seed: int) -> None:
        cell = road.resolution
        self.road, self.query, self.wishes = road, query, wishes
        self.clearance, self.blocked = clearance_in_cells(road), blocked_before(road)
        self.ends = np.stack([_in_cells(road, pose) for pose in (query.start, query.goal)])
        self.free_cells = np.zeros(1, dtype=np.int64)
        self.guide, self.about = _in_cells(road, wishes.guide), NOWHERE
        self.setting = np.zeros(trees.SETTINGS)
        self.setting[[shared.BOUND, shared.BEST]] = np.inf
        self.setting[[shared.STEP, shared.ZETA]] = config.step / cell, config.zeta / cell
        self.setting[[shared.GREEDY, shared.INFORMED]] = 1.0, 1.0
        self.setting[trees.TURN] = 1.0 / (query.curvature * cell)
        self.setting[[trees.HALF_LENGTH, trees.HALF_WIDTH]] = 0.5 * query.length / cell, 0.5 * query.width / cell
        self.setting[trees.SWEEP] = SWEEP / cell
        prices = wishes.room / cell, wishes.lack, wishes.left * cell, wishes.right * cell
        self.setting[trees.WISH : trees.WISH + 6] = *prices, wishes.most_left / cell, wishes.most_right / cell
        self.setting[[trees.ABOUT, trees.SPREAD, trees.YAW_SPREAD]] = config.about, config.spread / cell, config.yaw_spread
        self.counter = np.zeros(shared.COUNTERS, dtype=np.int64)
        self.counter[shared.CONNECTION] = -1
        self.random = np.array([seed % 2**64], dtype=np.uint64)
        self.node, self.link = np.empty((POOL, trees.COLUMNS)), np.empty((POOL, 5), dtype=np.int32)
        trees.plant(self.ends, self.node, self.link, self.counter)

    def sample_from(self, cells: "np.ndarray[tuple[int], np.dtype[np.int64]]", about: Floats, gamma_factor: float) -> None:
        """Say where samples may lie: flat indices of cells, and poses (G, 3) [m] of a path to sample about."""
        self.free_cells, self.about = cells, _in_cells(self.road, about)
        # Karaman & Frazzoli 2013; a ball of radius r holds poses r ahead, r² / 2R aside, r / R in heading
        volume = len(cells) * 2.0 * math.pi
        unit = 1.0 / np.square(self.setting[trees.TURN])
        dimensions = trees.DIMENSIONS
        root = np.sqrt(np.sqrt((1.0 + 1.0 / dimensions) * volume / unit))  # 1 / d
        self.setting[shared.GAMMA] = gamma_factor * 2.0 * float(root)

    def grow(self, iterations: int) -> None:
        """Make so many iterations, or fewer where the first path is found."""
        goal = self.counter[shared.ITERATION] + iterations
        had_path = self.best < np.inf
        while self.counter[shared.ITERATION] < goal and (had_path or self.best == np.inf):
            trees.grow(
                goal - self.counter[shared.ITERATION], self.clearance, self.blocked, self.ends, self.free_cells, self.about,
                self.guide, self.node, self.link, self.counter, self.setting, self.random,
            )  # fmt: skip
            if self.counter[shared.NODES_A] + self.counter[shared.NODES_B] + 64 >= len(self.node):
                self._make_room()

    def _make_room(self) -> None:
        """Twice the pool; the second tree moves to the new back."""
        old, theirs = len(self.node), int(self.counter[shared.NODES_B])
        first, shift = old - theirs, old
        node, link = np.empty((2 * old, trees.COLUMNS)), np.empty((2 * old, 5), dtype=np.int32)
        self.link = np.where(self.link >= first, self.link + shift, self.link).astype(np.int32)
        ours = int(self.counter[shared.NODES_A])
        for new, had in ((node, self.node), (link, self.link)):
            new[:ours], new[2 * old - theirs :] = had[:ours], had[first:]
        self.node, self.link = node, link
        if self.counter[shared.CONNECTION] >= first:
            self.counter[shared.CONNECTION] += shift

    @property
    def best(self) -> float:
        """Cost [cells] of the trees' best path."""
        return float(self.setting[shared.BEST])

    def path(self, shortcuts: int) -> tuple[Floats, float]:
        """The best path, shortened: (P, 5) poses, curvature and length of the piece to each; and its cost [cells]."""
        room = 256
        piece = PIECE / self.road.resolution
        while True:
            path = np.empty((room, 5))
            count = trace(self.node, self.link, self.counter, float(self.setting[trees.TURN]), piece, path)
            if count < room // 2:
                break
            room *= 2
        path[count - 1, :3] = self.ends[1]
        count = shorten(
            count, shortcuts, piece, self.clearance, self.blocked, self.guide, self.setting, self.random, path
        )  # fmt: skip
        return path[:count].copy(), float(self.setting[trees.LENGTH])


def _refuse_blocked(road: Road, query: PoseQuery) -> None:
    """Refuse a start or goal at which the footprint has no room.

    Raises:
        BlockedError: one has none; it names it.
    """
    ends = np.stack((query.start, query.goal))
    fits = footprint_fits(road, ends, query.length, query.width)
    for name, pose, fit in zip(("start", "goal"), ends, fits, strict=True):
        if not fit:
            raise BlockedError(
                name,
                f"the {name} ({pose[0]:.2f}, {pose[1]:.2f}) m has no room on road {road.name!r} for a footprint of "
                f"{query.length:.2f} m by {query.width:.2f} m",
            )


@runtime_checkable
class PlansPoses(Protocol):
    """A planner that also plans for the vehicle itself: drivable routes are then searched for with this method."""

    def plan_poses(self, road: Road, query: PoseQuery, budget: Budget, seed: int, wishes: Wishes = Wishes()) -> PosePlan:
        """Return the best path found within the budget.

        Raises:
            BlockedError: the footprint has no room at start or goal.
            NoWayError: there is no way.
            BudgetSpentError: none was found within the budget.
        """
        ...


class PoseRrtStarConnect:
    """RRT*-Connect for a car: poses for points, Dubins curves for straight lines, the rectangle for the disc.

    Source: paper III-B and appendix; Dubins curves in RRT* as Karaman & Frazzoli 2013.
    """

    def __init__(self, config: PoseSearchConfig = PoseSearchConfig()) -> None:
        self.config = config

    def plan(self, road: Road, query: PoseQuery, budget: Budget, seed: int, wishes: Wishes = Wishes()) -> PosePlan:
        """Return the best path found within the budget: its iterations are those for a first path, `improve` more follow.

        With a budget in iterations the answer depends on the seed only.

        Raises:
            BlockedError: the footprint has no room at start or goal.
            NoWayError: not even a disc as wide as the footprint can get there.
            BudgetSpentError: none was found within the budget.
        """
        started = thread_time()
        _refuse_blocked(road, query)
        search = _Search(road, query, wishes, self.config, seed)
        look, end = 1, 0  # iterations at which the way of a disc is looked for, and at which enough was made for a better path
        search.grow(1)  # the direct curve
        best: Floats | None = None
        cost, known = np.inf, np.inf
        history: list[tuple[int, float, float]] = []
        straight = float(np.hypot(*(search.ends[1] - search.ends[0])[:2]))
        while not (budget.cancelled and budget.cancelled()):
            if search.best < known:
                known = search.best
                path, length = search.path(self.config.shortcuts if best is not None or not budget.first else 0)
                if length < cost:
                    cost, best = length, path
                    history.append((int(search.counter[shared.ITERATION]), thread_time() - started, cost * road.resolution))
                    if search.about is not NOWHERE:
                        search.about = np.ascontiguousarray(path[:, :3])
                if len(history) <= 1:
                    search.setting[shared.STEP] = self.config.stride / road.resolution
                    end = int(search.counter[shared.ITERATION]) + self.config.improve
            if best is not None and (budget.first or cost <= straight * (1.0 + 1e-9) or search.about is NOWHERE):
                break
            done = int(search.counter[shared.ITERATION])
            if best is None and done >= look:
                self._look_around(search, seed, look)
                look += ANOTHER
            most = budget.iterations if best is None else end
            batch = BATCH if most is None else min(BATCH, most - done)
            if batch <= 0 or (budget.seconds is not None and thread_time() - started >= budget.seconds):
                break
            search.grow(batch)
        if best is None:
            raise BudgetSpentError(
                f"no path found on road {road.name!r} within {int(search.counter[shared.ITERATION])} iterations, "
                f"{thread_time() - started:.2f} s of CPU time"
            )
        poses = np.column_stack((to_metres(road, best[:, :2]), best[:, 2]))
        poses[0, :2], poses[-1, :2] = query.start[:2], query.goal[:2]
        return PosePlan(
            poses,
            best[:, 3] / road.resolution,
            best[:, 4] * road.resolution,
            cost * road.resolution,
            int(search.counter[shared.ITERATION]),
            np.array(history),
        )

    def _look_around(self, search: _Search, seed: int, look: int) -> None:
        """Find the way of the disc that the footprint holds, and sample about it.

        Raises:
            NoWayError: there is none, so that there is none for the footprint.
        """
        road, query = search.road, search.query
        half = 0.5 * min(query.width, query.length)
        last = max(half - 0.75 * road.resolution, 0.0)  # connected components may miss a gap between cells' centres
        for radius in (half + DISCS[(look // ANOTHER) % len(DISCS)], half, last):
            disc = Query(query.start[:2], query.goal[:2], radius)
            try:
                line = DISC.plan(road, disc, Budget(DISC_BUDGET, first=True), seed + look).path
            except (BlockedError, NoWayError):
                if radius > last:
                    continue
                (x0, y0), (x1, y1) = disc.start, disc.goal
                raise NoWayError(
                    f"no way leads from ({x0:.2f}, {y0:.2f}) m to ({x1:.2f}, {y1:.2f}) m on road {road.name!r}: it is too narrow "
                    f"for a width of {query.width:.2f} m"
                ) from None
            except BudgetSpentError:
                if radius > last:
                    continue
                line = np.stack((disc.start, disc.goal))
            field = clearance_in_cells(road)
            taut = string_pulled(field, to_cells(road, line), radius / road.resolution, 1)
            cells = component_cells(road, radius, common_component(road, disc.start, disc.goal, radius) or 0)[0]
            if not len(cells):
                cells = np.flatnonzero(road.drivable)
            about = search.wishes.about if len(search.wishes.about) else along(to_metres(road, taut), PIECE)
            search.sample_from(cells, about, self.config.gamma_factor)
            return


def along(line: Floats, spacing: float) -> Floats:
    """Poses (M, 3) about `spacing` apart on a polyline (P, 2) [m]."""
    edge = np.diff(line, axis=0)
    size = np.hypot(*edge.T)
    at = np.concatenate(([0.0], np.cumsum(size)))
    s = np.linspace(0.0, at[-1], max(int(np.ceil(at[-1] / spacing)) + 1, 2))
    yaw = np.arctan2(edge[:, 1], edge[:, 0])
    which = np.clip(np.searchsorted(at, s, side="right") - 1, 0, len(edge) - 1)
    return np.column_stack((np.interp(s, at, line[:, 0]), np.interp(s, at, line[:, 1]), yaw[which]))


def _in_cells(road: Road, poses: Floats) -> Floats:
    """Poses (..., 3) [m, rad] in cells."""
    poses = np.asarray(poses, dtype=np.float64)
    return np.concatenate((to_cells(road, poses[..., :2]), wrap_angle(poses[..., 2:])), axis=-1)
