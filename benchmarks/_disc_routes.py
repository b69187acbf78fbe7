# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Routes as in the paper: the straight lines of a disc through the anchors, by its own RRT*-Connect."""

import itertools

import numpy as np

from benchmarks._paper_planner import PAPER, plan_with_retry, Query, RrtStarConnect
from scenario_gen.base.errors import RefusedError
from scenario_gen.method.routing import PlanningConfig
from scenario_gen.method.routing.config import make_rrt_star_connect
from scenario_gen.method.routing.legs import choose_waypoints
from scenario_gen.method.routing.search.planner import BlockedError
from scenario_gen.method.routing.task import route_along, VehicleTask
from scenario_gen.numerics import arc_lengths, edge_yaws, Floats
from scenario_gen.roads import footprint_fits, ground_for
from scenario_gen.types import Fit, Road, Route, TypeLimits

MIN_ROUTE = 0.05
"""Between start and end [m], else the vehicle has no path."""


def plan_polylines(road: Road, fit: Fit, config: PlanningConfig, seed: int) -> tuple[Route, ...]:
    """Return one route per vehicle through its anchors, with corners; its ends have the asked headings.

    Raises:
        RefusedError: a start or end is blocked, or no route leads from anchor to anchor.
    """
    routes = []
    for n, (vehicle, fitted) in enumerate(zip(fit.vehicles, fit.fitted, strict=True)):
        curvature = TypeLimits().of(vehicle.type).planned.max_curvature
        task = VehicleTask(
            ground_for(road, vehicle), vehicle, fitted, config, make_rrt_star_connect(config),
            seed + 7919 * n, curvature,
        )  # fmt: skip
        routes.append(_polyline(task))
    return tuple(routes)


def _polyline(task: VehicleTask) -> Route:
    anchors, vehicle = task.anchors, task.vehicle
    for k in (0, len(anchors) - 1):
        if not footprint_fits(task.road, anchors[k][None], vehicle.length, vehicle.width)[0]:
            raise RefusedError(f"{task.anchor_name(k)} is blocked on road {task.road.name!r}")
    if task.fitted.stands.all() or np.hypot(*(anchors[-1] - anchors[0])[:2]) < MIN_ROUTE:
        standing = np.zeros(len(anchors), dtype=np.int64)
        return Route(anchors[:1], standing, np.zeros(1), joined=0, searched=0)
    waypoints = choose_waypoints(anchors, task.fitted.stands, task.max_curvature)
    pieces = [_leg(task, *pair) for pair in itertools.pairwise(waypoints)]
    path = np.concatenate([pieces[0], *(piece[1:] for piece in pieces[1:])])
    corners = arc_lengths(path)
    yaw = np.unwrap(edge_yaws(path))

    def poses_at(length: Floats) -> Floats:
        edge = np.searchsorted(corners, length, side="right") - 1
        points = [np.interp(length, corners, path[:, axis]) for axis in range(2)]
        return np.column_stack((*points, yaw[np.clip(edge, 0, len(yaw) - 1)]))

    return route_along(task, poses_at, float(corners[-1]))


def _leg(task: VehicleTask, first: int, second: int) -> Floats:
    """Return a path (P, 2) between two anchors for a disc as wide as the vehicle, where it has that room."""
    ends = task.anchors[[first, second], :2]
    row, column, _ = task.road.cells(ends)
    room = float(task.road.clearance_at(row, column).min()) - task.road.resolution
    radius = max(min(0.5 * task.vehicle.width + task.config.margin, room), 0.0)
    iterations, seed = task.config.iterations, task.seed + first
    try:
        planner = RrtStarConnect(PAPER)
        return plan_with_retry(
            planner, task.road, Query(ends[0], ends[1], radius), iterations, seed
        ).path
    except BlockedError as error:
        k = first if error.end == "start" else second
        raise RefusedError(f"{task.anchor_name(k)} is blocked: {error}") from error
