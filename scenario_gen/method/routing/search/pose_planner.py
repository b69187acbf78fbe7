# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""RRT*-Connect in the vehicle's own space: from pose to pose for a rectangle that turns no tighter than a curvature allows."""

from dataclasses import dataclass, field
import math
from typing import Protocol, runtime_checkable

import numpy as np

from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.method.routing.search.dubins import Pose
from scenario_gen.method.routing.search.planner import (
    BlockedError,
    Budget,
    BudgetSpentError,
    NoWayError,
    Query,
)
from scenario_gen.method.routing.search.pose_path import shorten, trace
from scenario_gen.method.routing.search.rrt_star_connect import (
    RrtStarConnect,
    RrtStarConnectConfig,
    string_pulled,
)
from scenario_gen.method.routing.search.sweep import car_scene, NOWHERE, Prices
from scenario_gen.method.routing.search.tree_samples import Rules
from scenario_gen.method.routing.search.two_trees import Search
from scenario_gen.numerics import Floats, wrap_angle
from scenario_gen.numerics.plane import edge_lengths, edge_yaws
from scenario_gen.roads import (
    clearance_in_cells,
    common_component,
    component_cells,
    footprint_fits,
    to_cells,
    to_metres,
)
from scenario_gen.types import Road

PIECE = 0.5  # [m] longest piece of a path
BATCH = 64  # iterations between two looks at the clock
DISCS = (
    0.0,
    0.25,
    0.05,
)  # [m] by which the discs are wider than the footprint whose paths are sampled about, one after another
DISC_BUDGET = 5000  # iterations for such a path
ANOTHER = 512  # iterations after which another one is taken, if there is no path yet
DISC = RrtStarConnect(RrtStarConnectConfig(pull=False))
DIMENSIONS = 4  # d of eq 10, of a ball that small Dubins curves reach: along 1, heading 1, sideways 2 (Karaman & Frazzoli 2013)


@dataclass(frozen=True)
class PoseSearchConfig(Parameters):
    """Settings of RRT*-Connect in the vehicle's own space."""

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
        "share of samples about a path that is known, a disc's or the best so far",
        low=0.0,
        high=0.95,
    )
    spread: float = parameter(1.0, "how far from it", unit="m", low=0.05, high=20.0)
    yaw_spread: float = parameter(0.4, "and from its heading", unit="rad", low=0.01, high=3.2)
    improve: int = parameter(
        50, "iterations for a better path, once there is one", low=0, high=10_000_000
    )
    shortcuts: int = parameter(
        50,
        "pairs of poses between which a shorter curve is tried, whenever a better path is found",
        low=0,
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

    def plan_poses(
        self, road: Road, query: PoseQuery, budget: Budget, seed: int, wishes: Wishes = Wishes()
    ) -> PosePlan:
        """Return the best path found within the budget.

        Raises:
            BlockedError: the footprint has no room at start or goal.
            NoWayError: there is no route.
            BudgetSpentError: none was found within the budget.
        """
        ...


class PoseRrtStarConnect:
    """RRT*-Connect for a car: poses for points, Dubins curves for straight lines, the rectangle for the disc.

    Source: paper III-B and appendix; Dubins curves in RRT* as Karaman & Frazzoli 2013.
    """

    def __init__(self, config: PoseSearchConfig = PoseSearchConfig()) -> None:
        self.config = config

    def plan(
        self, road: Road, query: PoseQuery, budget: Budget, seed: int, wishes: Wishes = Wishes()
    ) -> PosePlan:
        """Return the best path found within the budget: its iterations are those for a first path, `improve` more follow.

        With a budget in iterations the answer depends on the seed only.

        Raises:
            BlockedError: the footprint has no room at start or goal.
            NoWayError: not even a disc as wide as the footprint can get there.
            BudgetSpentError: none was found within the budget.
        """
        _refuse_blocked(road, query)
        search = self._search(road, query, wishes, seed)
        look, limit, known = (
            1,
            budget.iterations,
            np.inf,
        )  # look: when the way of a disc is looked for; limit: of iterations
        search.grow(1)  # the direct curve
        while True:
            if search.best < known:
                known = search.best
                shortcuts = (
                    self.config.shortcuts if search.path is not None or not budget.first else 0
                )
                path, cost = _shortened(search, shortcuts)
                if search.keep(path, cost) and len(search.rules.about):
                    search.rules = search.rules._replace(about=np.ascontiguousarray(path[:, :3]))
                if len(search.history) <= 1:
                    search.rules = search.rules._replace(step=self.config.stride / road.resolution)
                    limit = search.iteration + self.config.improve
            found = search.path is not None
            if found and (budget.first or search.is_straight() or not len(search.rules.about)):
                break
            if not found and search.iteration >= look:
                self._look_around(search, query, wishes, seed + look)
                look += ANOTHER
            batch = search.batch(BATCH, limit, budget)
            if batch <= 0:
                break
            search.grow(batch)
        best = search.result()
        poses = np.column_stack((to_metres(road, best[:, :2]), best[:, 2]))
        poses[0, :2], poses[-1, :2] = query.start[:2], query.goal[:2]
        cell = road.resolution
        return PosePlan(
            poses,
            best[:, 3] / cell,
            best[:, 4] * cell,
            search.cost * cell,
            search.iteration,
            np.array(search.history),
        )

    def _search(self, road: Road, query: PoseQuery, wishes: Wishes, seed: int) -> Search:
        """The trees of a query, with no more than their roots."""
        cell, config = road.resolution, self.config
        prices = Prices(
            wishes.room / cell, wishes.lack, wishes.left * cell, wishes.right * cell, wishes.most_left / cell,
            wishes.most_right / cell,
        )  # fmt: skip
        scene = car_scene(
            road,
            (query.length, query.width),
            query.curvature,
            prices,
            _in_cells(road, wishes.guide),
        )
        start, goal = (Pose(*_in_cells(road, pose).tolist()) for pose in (query.start, query.goal))
        step, none = config.step / cell, np.empty(0, dtype=np.int64)
        rules = Rules(
            start, goal, np.flatnonzero(road.drivable), none, NOWHERE, config.about, config.spread / cell, config.yaw_spread,
            step, 0.5 * step, 0.0, config.zeta / cell, greedy=True, skip=False, informed=True,
        )  # fmt: skip
        return Search(road, scene, rules, seed)

    def _look_around(self, search: Search, query: PoseQuery, wishes: Wishes, seed: int) -> None:
        """Find the way of the disc that the footprint holds, and sample about it.

        Raises:
            NoWayError: there is none, so that there is none for the footprint.
        """
        road = search.road
        half = 0.5 * min(query.width, query.length)
        last = max(
            half - 0.75 * road.resolution, 0.0
        )  # connected components may miss a gap between cells' centres
        for radius in (half + DISCS[(search.iteration // ANOTHER) % len(DISCS)], half, last):
            disc = Query(query.start[:2], query.goal[:2], radius)
            try:
                line = DISC.plan(road, disc, Budget(DISC_BUDGET, first=True), seed).path
            except (BlockedError, NoWayError):
                if radius > last:
                    continue
                (x0, y0), (x1, y1) = disc.start, disc.goal
                raise NoWayError(
                    f"no route leads from ({x0:.2f}, {y0:.2f}) m to ({x1:.2f}, {y1:.2f}) m on road {road.name!r}: it is too "
                    f"narrow for a width of {query.width:.2f} m"
                ) from None
            except BudgetSpentError:
                if radius > last:
                    continue
                line = np.stack((disc.start, disc.goal))
            break
        taut = string_pulled(
            clearance_in_cells(road), to_cells(road, line), radius / road.resolution, 1
        )
        cells = component_cells(
            road, radius, common_component(road, disc.start, disc.goal, radius) or 0
        )[0]
        if not len(cells):
            cells = np.flatnonzero(road.drivable)
        about = wishes.about if len(wishes.about) else along(to_metres(road, taut), PIECE)
        # Karaman & Frazzoli 2013; a ball of radius r holds poses r ahead, r² / 2R aside, r / R in heading
        volume = len(cells) * 2.0 * math.pi * (1.0 / (query.curvature * road.resolution)) ** 2
        root = ((1.0 + 1.0 / DIMENSIONS) * volume) ** (1.0 / DIMENSIONS)
        gamma = self.config.gamma_factor * 2.0 * root
        search.rules = search.rules._replace(
            cells=cells, about=_in_cells(road, about), gamma=gamma
        )


def _shortened(search: Search, shortcuts: int) -> tuple[Floats, float]:
    """The trees' best path, shortened: (P, 5) poses, curvature and length of the piece to each; and its cost; in cells."""
    (ours, theirs), spacing, room = search.chains(), PIECE / search.road.resolution, 256
    while True:
        path = np.empty((room, 5))
        count = trace(
            np.array(ours),
            np.array(theirs),
            search.tree.node,
            search.scene.body.turn,
            spacing,
            path,
        )
        if count < room // 2:
            break
        room *= 2
    path[count - 1, :3] = search.rules.goal
    count, cost = shorten(count, shortcuts, spacing, search.scene, search.state, path)
    return path[:count].copy(), float(cost)


def along(line: Floats, spacing: float) -> Floats:
    """Poses (M, 3) about `spacing` apart on a polyline (P, 2) [m]."""
    size, yaw = edge_lengths(line), edge_yaws(line)
    at = np.concatenate(([0.0], np.cumsum(size)))
    s = np.linspace(0.0, at[-1], max(int(np.ceil(at[-1] / spacing)) + 1, 2))
    which = np.clip(np.searchsorted(at, s, side="right") - 1, 0, len(yaw) - 1)
    return np.column_stack(
        (np.interp(s, at, line[:, 0]), np.interp(s, at, line[:, 1]), yaw[which])
    )


def _in_cells(road: Road, poses: Floats) -> Floats:
    """Poses (..., 3) [m, rad] in cells."""
    poses = np.asarray(poses, dtype=np.float64)
    return np.concatenate((to_cells(road, poses[..., :2]), wrap_angle(poses[..., 2:])), axis=-1)
