# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The search for a path between two anchors that no direct curve joins."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.routing.config import PLANNERS, PlanningConfig
from scenario_gen.method.routing.connecting_curves import connecting_curves
from scenario_gen.method.routing.refusals import off_road
from scenario_gen.method.routing.search.planner import (
    BlockedError,
    Budget,
    BudgetSpentError,
    NoWayError,
    Plan,
    PoseQuery,
    Preferences,
)
from scenario_gen.method.routing.task import VehicleTask
from scenario_gen.numerics import Floats
from scenario_gen.numerics.plane import unit_left

GUIDE_STEPS = 10  # every tenth pose of the direct curve
ONCOMING_FACTOR = 3.0  # of the cost of leaving the direct curve, towards oncoming traffic
HALF_LANE_M = 1.75  # allowed towards oncoming traffic in the first attempt
FIRST_ATTEMPT_SHARE = 0.1  # of the iterations: on its own side a path is found soon or never
EXTRA_ROOM_M = 0.05  # on every side of the footprint, which the smoothing can use
LAST_ATTEMPT_FACTOR = 20  # more iterations for a first path where no waypoint can be dropped


@dataclass(frozen=True, eq=False)
class Leg:
    """A pair of anchors, their poses (3,), and the search between them.

    Attributes:
        first: index of the anchor at its start.
        second: index of the anchor at its end.
        start: pose at its start.
        end: pose at its end.
        curvature: largest one of the path [1/m].
        is_last_chance: whether no waypoint can be dropped if the search fails.
    """

    first: int
    second: int
    start: Floats
    end: Floats
    curvature: float
    is_last_chance: bool


def search_path(task: VehicleTask, leg: Leg) -> Floats:
    """Return a free path (P, 2) of a leg.

    Raises:
        RefusedError: there is none, or none was found; the message names the anchors.
    """
    failure: Exception | None = None
    for query, budget in _attempts(task, leg):
        plan = partial(task.planner.plan_poses, task.road, query, budget, task.seed + leg.first)
        try:
            return _checked_path(task, plan)[:, :2]
        except (BlockedError, NoWayError, BudgetSpentError) as error:
            failure = error
    raise _refusal(task, leg, failure)


def _attempts(task: VehicleTask, leg: Leg) -> Iterator[tuple[PoseQuery, Budget]]:
    """Yield the queries of a leg and their budgets, the most demanding query first.

    The first one stays on its side of the road; all but the last have extra room.
    """
    config, vehicle = task.config, task.vehicle
    guide = next(connecting_curves(leg.start, leg.end, task.max_curvature))[::GUIDE_STEPS]
    left, right = _left_and_right(config, ONCOMING_FACTOR * config.keep_side, config.keep_side)
    anywhere = Preferences(config.margin, guide=guide, left_cost=left, right_cost=right)
    exact = PoseQuery(leg.start, leg.end, vehicle.length, vehicle.width, leg.curvature, anywhere)
    length, width = vehicle.length + 2.0 * EXTRA_ROOM_M, vehicle.width + 2.0 * EXTRA_ROOM_M
    roomy = replace(exact, length=length, width=width)
    if config.keep_side > 0.0:
        max_left, max_right = _left_and_right(config, HALF_LANE_M, np.inf)
        samples = _poses_on_side(guide, config)
        on_side = replace(anywhere, samples=samples, max_left=max_left, max_right=max_right)
        iterations = max(int(FIRST_ATTEMPT_SHARE * config.iterations), 1)
        yield replace(roomy, preferences=on_side), Budget(iterations)
    yield roomy, Budget(config.iterations)
    yield exact, Budget(config.iterations)
    if leg.is_last_chance:
        yield exact, Budget(LAST_ATTEMPT_FACTOR * config.iterations, first=True)


def _left_and_right(config: PlanningConfig, oncoming: float, other: float) -> tuple[float, float]:
    """Return the values for the left and the right side, given those towards oncoming traffic."""
    return (oncoming, other) if config.traffic_side == "right" else (other, oncoming)


def _poses_on_side(guide: Floats, config: PlanningConfig) -> Floats:
    """Return poses on a guide (G, 3), and 1 to 3 m to its side, away from oncoming traffic."""
    sign = -1.0 if config.traffic_side == "right" else 1.0
    away = np.column_stack((sign * unit_left(guide[:, 2]), np.zeros(len(guide))))
    return np.concatenate([guide + metres * away for metres in range(4)])


def _checked_path(task: VehicleTask, plan: Callable[[], Plan]) -> Floats:
    """Return the path (P, 3) of a plan; a plugin's planner may return anything."""
    with PLANNERS.running(task.config.planner):
        path = np.asarray(plan().path, dtype=np.float64)
        if path.ndim != 2 or len(path) < 2 or path.shape[1] < 3:
            raise ValueError("its path is no array of two or more rows of 3 numbers")
        if not np.isfinite(path).all():
            raise ValueError("its path is not finite")
        return path


def _between(task: VehicleTask, leg: Leg) -> str:
    return f"between {task.anchor_name(leg.first)} and {task.anchor_name(leg.second)}"


def _refusal(task: VehicleTask, leg: Leg, error: Exception | None) -> RefusedError:
    """Return the error for the user, who knows vehicles and anchors."""
    if isinstance(error, BlockedError):
        k = leg.first if error.end == "start" else leg.second
        return RefusedError(f"{task.anchor_name(k)} is blocked: {error}")
    if isinstance(error, NoWayError):
        return RefusedError(f"{_between(task, leg)}: {error}")
    vehicle = task.vehicle
    factor = LAST_ATTEMPT_FACTOR if leg.is_last_chance else 1
    return RefusedError(
        f"no drivable route for vehicle {vehicle.id} on road {task.road.name!r} "
        f"{_between(task, leg)}: none with a curvature of at most {leg.curvature:.3f} 1/m "
        f"(limits.{vehicle.type}.max_curvature) was found in {factor * task.config.iterations} "
        f"iterations{off_road(task)}"
    )
