# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The planning stage: one route per vehicle through its fitted anchors."""

from dataclasses import replace

import numpy as np

from scenario_gen.base.cancelling import stop_if_cancelled
from scenario_gen.base.errors import RefusedError
from scenario_gen.method.routing.config import PLANNERS, PlanningConfig
from scenario_gen.method.routing.legs import anchor_weights, choose_waypoints, join_waypoints, Legs
from scenario_gen.method.routing.search.planner import Planner
from scenario_gen.method.routing.smooth import Curve, Guess, not_drivable, smooth
from scenario_gen.method.routing.task import (
    max_distance,
    route_along,
    too_narrow,
    too_tight,
    VehicleTask,
)
from scenario_gen.roads import footprint_fits, ground_for, own_side
from scenario_gen.types import Fit, Road, Route, TypeLimits

MIN_ROUTE_M = 0.05  # between start and end, else the vehicle has no path
# Shares of the largest curvature that searches may use, in turn: smoothing needs the rest.
CURVATURE_SHARE = (0.97, 0.9, 0.8)


def plan_routes(
    road: Road,
    fit: Fit,
    config: PlanningConfig = PlanningConfig(),
    seed: int = 0,
    limits: TypeLimits = TypeLimits(),
) -> tuple[Route, ...]:
    """Plan one route per vehicle through its anchors.

    Start and end are met exactly, with their headings; interior anchors attract the route.
    The footprint stays on the road along the whole route, and the curvature within the limit.

    Source: paper III-B, between consecutive changepoints.

    Args:
        road: the target road.
        fit: where every vehicle's anchors are on it.
        config: see `PlanningConfig`.
        seed: same seed, same routes.
        limits: of each type of vehicle, for the curvature.

    Returns:
        N routes, geometry only.

    Raises:
        RefusedError: a start or end is blocked, no route leads from anchor to anchor, the
            planner's budget is spent, or no drivable curve was found; the message names the
            vehicle and the anchor.
    """
    planner = make_planner(config)
    routes = []
    for n, (vehicle, fitted) in enumerate(zip(fit.vehicles, fit.fitted, strict=True)):
        curvature = limits.of(vehicle.type).planned.max_curvature
        ground = ground_for(road, vehicle)
        task = VehicleTask(ground, vehicle, fitted, config, planner, seed + 7919 * n, curvature)
        routes.append(_route_on_lanes(task))
    return tuple(routes)


def make_planner(config: PlanningConfig) -> Planner:
    """Return the geometric planner that `config` names."""
    make = PLANNERS[config.planner]
    with PLANNERS.running(config.planner):
        planner = make(config)
        if not hasattr(planner, "plan_poses"):
            name = type(planner).__name__
            raise TypeError(f"it returned {name}, which has no method `plan_poses`")
        return planner


def _route_on_lanes(task: VehicleTask) -> Route:
    """Return the route on the vehicle's lanes if they are known, else on the whole road.

    The whole road is also used if an obstacle blocks these lanes, unless `oncoming` forbids it.

    Raises:
        RefusedError: there is no route, or a lane is too narrow.
    """
    if narrow := too_narrow(task):
        raise RefusedError(narrow)
    road, forbidden = task.road, task.config.oncoming == "never"
    lanes = road.lanes if forbidden else road.map_lanes
    ground = own_side(road, task.fitted.path, task.vehicle, lanes)
    if ground is not road:
        try:
            return _route(replace(task, road=ground))
        except RefusedError as error:
            if forbidden:
                raise RefusedError(
                    f"{error}; planning.oncoming=around_obstacles also uses the oncoming lane"
                ) from error
    try:
        return _route(task)
    except RefusedError as error:
        reasons = filter(None, (str(error), too_tight(task)))
        raise RefusedError("; ".join(reasons)) from error


def _route(task: VehicleTask) -> Route:
    anchors = task.anchors
    _refuse_blocked(task)
    if task.fitted.stands.all() or np.hypot(*(anchors[-1] - anchors[0])[:2]) < MIN_ROUTE_M:
        standing = np.zeros(len(anchors), dtype=np.int64)
        return Route(anchors[:1], standing, np.zeros(1), joined=0, searched=0)
    waypoints = choose_waypoints(anchors, task.fitted.stands, task.max_curvature)
    refusal: RefusedError | None = None
    for share in CURVATURE_SHARE:
        try:
            legs = join_waypoints(task, waypoints, share * task.max_curvature)
        except RefusedError as error:
            raise refusal or error from None
        curve = _smoothed(task, legs)
        if curve.is_drivable(task.max_curvature):
            route = route_along(task, curve.poses, float(curve.arc[-1]))
            return replace(
                route,
                joined=legs.joined,
                searched=legs.searched,
                left_out=legs.left_out,
                farthest=max_distance(route.points, task.fitted.path),
            )
        refusal = refusal or RefusedError(not_drivable(task, curve))
        if not legs.searched:  # the next attempt would be the same
            break
    assert refusal is not None
    raise refusal


def _refuse_blocked(task: VehicleTask) -> None:
    """Raise RefusedError if the footprint has no room at the start or the end."""
    length, width = task.vehicle.length, task.vehicle.width
    for k in (0, len(task.anchors) - 1):
        if not footprint_fits(task.road, task.anchors[k][None], length, width)[0]:
            raise RefusedError(
                f"{task.anchor_name(k)} is blocked: its footprint, {length:.2f} m by "
                f"{width:.2f} m, has no room there on road {task.road.name!r}"
            )


def _smoothed(task: VehicleTask, legs: Legs) -> Curve:
    """Return the first drivable curve near the legs, which it follows ever more closely.

    If there is none, return the last curve.
    """
    weights = anchor_weights(task.anchors, legs.waypoints)
    for factor, rounds in ((1.0, 12), (10.0, 12), (100.0, 12), (1000.0, 24)):
        stop_if_cancelled()
        guess = Guess(legs.guess.points, factor * legs.guess.hold)
        curve = smooth(task, weights, guess, rounds)
        if curve.is_drivable(task.max_curvature):
            break
    return curve
