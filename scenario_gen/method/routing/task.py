# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The planning task of one vehicle, the points of its route, and why it has no drivable one.

A route is a curve that is sampled so that one point lies at every anchor.
"""

from collections.abc import Callable
from dataclasses import dataclass
import itertools

import numpy as np
from scipy.spatial.distance import cdist
import shapely

from scenario_gen.method.routing.config import PlanningConfig
from scenario_gen.method.routing.search.planner import Planner
from scenario_gen.numerics import ahead_and_left, arc_lengths, Floats, Ints, wrap_angle
from scenario_gen.roads import footprint_fits
from scenario_gen.types import FittedVehicle, Road, Route, Vehicle

WINDOW_STEPS = 4  # of a path, over which its curvature is measured
MIN_WINDOW_M = 0.3
STRAIGHT_PER_M = 0.02  # curvature of a lane that counts as straight


@dataclass(frozen=True, eq=False)
class VehicleTask:
    """One vehicle on its road.

    Attributes:
        road: where the vehicle may drive.
        vehicle: its type and size.
        fitted: its anchors and its path on the road.
        config: settings of planning.
        planner: the geometric planner.
        seed: of the planner.
        max_curvature: of the route [1/m].
    """

    road: Road
    vehicle: Vehicle
    fitted: FittedVehicle
    config: PlanningConfig
    planner: Planner
    seed: int
    max_curvature: float

    @property
    def anchors(self) -> Floats:
        """(A, 3) poses."""
        return self.fitted.anchors

    def anchor_name(self, k: int) -> str:
        """Return anchor k for messages."""
        name = f"changepoint {k}"
        if k in (0, len(self.anchors) - 1):
            name = "start" if k == 0 else "end"
        x, y = self.anchors[k, :2]
        return f"the {name} of vehicle {self.vehicle.id} (anchor {k}, at {x:.2f}, {y:.2f} m)"


def _bends(task: VehicleTask) -> tuple[Floats, Floats]:
    """Return poses (M, 3) on the fitted path, and its curvature (M,) [1/m] there."""
    path = task.fitted.path
    length = arc_lengths(path[:, :2])
    window = np.maximum(length[WINDOW_STEPS:] - length[:-WINDOW_STEPS], MIN_WINDOW_M)
    turn = np.abs(wrap_angle(path[WINDOW_STEPS:, 2] - path[:-WINDOW_STEPS, 2]))
    return path[WINDOW_STEPS // 2 :][: len(window)], turn / window


def too_narrow(task: VehicleTask) -> str:
    """Return where the fitted path is straight, and its lane 30 cm narrower than the vehicle.

    The clause says what helps; it is empty if there is no such place.
    """
    vehicle, network = task.vehicle, task.road.map_lanes
    poses, curvature = _bends(task)
    fits = footprint_fits(task.road, poses, vehicle.length, vehicle.width)
    outside = poses[~fits & (curvature < STRAIGHT_PER_M)]
    for lane in network.lanes if network is not None and len(outside) else ():
        distance = cdist(outside[:, :2], lane.centre)
        width = lane.width[distance.argmin(axis=1)]
        on_lane = distance.min(axis=1) < width / 2.0
        narrow = np.flatnonzero(on_lane & (width < vehicle.width - 0.3))
        if len(narrow):
            k = narrow[len(narrow) // 2]
            x, y = outside[k, :2]
            return (
                f"lane {lane.id} is {width[k]:.1f} m wide at ({x:.1f}, {y:.1f}) m, too narrow for "
                f"vehicle {vehicle.id} ({vehicle.width:.1f} m); choose another place (#box=…), or "
                "leave it out (log.vehicles)"
            )
    return ""


def too_tight(task: VehicleTask) -> str:
    """Return where the fitted path bends too much for the vehicle or for the road's width.

    The clause says what the vehicle needs and what helps; it is empty if nothing is too tight.
    """
    vehicle = task.vehicle
    if len(task.fitted.path) <= WINDOW_STEPS:
        return ""
    middle, curvature = _bends(task)
    limit = task.max_curvature
    reason = f"it turns with at most {limit:.3f} 1/m ({1.0 / limit:.1f} m)"
    if curvature.max() <= limit:
        fits = footprint_fits(task.road.cleared, middle, vehicle.length, vehicle.width)
        curvature = np.where(fits, 0.0, curvature)
        reason = "there its footprint reaches beyond the road"
        if curvature.max() < STRAIGHT_PER_M:
            return ""
    k = int(np.argmax(curvature))
    return (
        f"the road is too tight for a {vehicle.type} of {vehicle.length:g} m by "
        f"{vehicle.width:g} m: at ({middle[k, 0]:.1f}, {middle[k, 1]:.1f}) m its lanes bend with "
        f"{curvature[k]:.3f} 1/m (radius {1.0 / curvature[k]:.1f} m), and {reason}; "
        "choose another road, or leave it out (log.vehicles)"
    )


def off_road(task: VehicleTask) -> str:
    """Return where the fitted path leaves the road or is blocked, or else what may help."""
    path, vehicle = task.fitted.path, task.vehicle
    outside = path[~footprint_fits(task.road.cleared, path, vehicle.length, vehicle.width)]
    blocked = path[~footprint_fits(task.road, path, vehicle.length, vehicle.width)]
    if not len(blocked):
        return "; planning.iterations allows more"
    if not len(outside):
        x, y = blocked[0, :2]
        return f"; an obstacle is in the way from {x:.2f}, {y:.2f} m on"
    x, y = outside[len(outside) // 2, :2]
    return (
        "; the footprint leaves the road where the recording was placed, at "
        f"{x:.2f}, {y:.2f} m: no search can repair that"
    )


def squared_distances(rows: Floats, columns: Floats) -> Floats:
    """Return the squared distances (A, M) [m²] of points (A, 2) from others (M, 2)."""
    squares = np.zeros((len(rows), len(columns)))
    for axis in (0, 1):  # a long drive has many points: no array (A, M, 2)
        squares += np.square(rows[:, axis, None] - columns[None, :, axis])
    return squares


def monotone_matching(cost: Floats) -> Ints:
    """Match rows of `cost` (A, M) to non-decreasing columns at the least total cost: (A,) columns.

    Source: dynamic programming (Bellman 1957).
    """
    total = cost[0]
    previous = np.empty(cost.shape, dtype=np.int32)
    for k in range(1, len(cost)):
        lowest = np.minimum.accumulate(total)
        is_lower = np.concatenate(([True], total[1:] < lowest[:-1]))
        previous[k] = np.maximum.accumulate(np.where(is_lower, np.arange(len(total)), 0))
        total = lowest + cost[k]
    column = np.empty(len(cost), dtype=np.int64)
    column[-1] = np.argmin(total)
    for k in range(len(cost) - 1, 0, -1):
        column[k - 1] = previous[k, column[k]]
    return column


PROJECTION_SPACING_M = 0.05  # of points at which anchors may project
MAX_PROJECTION_POINTS = 20_000  # each is compared with each anchor
MIN_MOVE_M = 0.1  # a primitive that moves less is a dwell


def route_along(task: VehicleTask, poses_at: Callable[[Floats], Floats], total: float) -> Route:
    """Return a curve of length `total` [m] as a route, its points at most `spacing` apart.

    Args:
        task: the vehicle.
        poses_at: returns poses (M, 3) at arc lengths (M,).
        total: its length.
    """
    stops = _anchor_lengths(task, poses_at, total)
    for k in range(1, len(stops)):
        if stops[k] - stops[k - 1] < MIN_MOVE_M:
            stops[k] = stops[k - 1]
    stops[stops > total - MIN_MOVE_M] = total
    pieces, anchor = [np.zeros(1)], [0]
    for before, after in itertools.pairwise(stops):
        count = int(np.ceil((after - before) / task.config.spacing * 1.001))
        pieces.append(np.linspace(before, after, count + 1)[1:])
        anchor.append(anchor[-1] + count)
    length = np.concatenate(pieces)
    points = poses_at(length)
    points[0], points[-1] = task.anchors[0], task.anchors[-1]
    return Route(points, np.array(anchor), length)


def _anchor_lengths(
    task: VehicleTask, poses_at: Callable[[Floats], Floats], total: float
) -> Floats:
    """Return the arc length (A,) at which the curve passes each anchor, never going back.

    Both ends of a dwell have the same one.
    """
    count = min(int(np.ceil(total / PROJECTION_SPACING_M)), MAX_PROJECTION_POINTS)
    length = np.linspace(0.0, total, count + 1)
    poses = poses_at(length)
    group = np.concatenate(([0], np.cumsum(~task.fitted.stands)))
    cost = np.zeros((group[-1] + 1, len(poses)))
    np.add.at(cost, group, squared_distances(task.anchors[:, :2], poses[:, :2]))
    cost[0, 1:] = np.inf
    cost[-1, :-1] = np.inf
    nearest = monotone_matching(cost)
    matched = poses[nearest[group]]
    ahead, _ = ahead_and_left(task.anchors[:, :2] - matched[:, :2], matched[:, 2])
    mean_ahead = np.bincount(group, ahead) / np.bincount(group)
    step = length[1] if len(length) > 1 else 0.0
    refined = length[nearest] + np.clip(mean_ahead, -step, step)  # between two projection points
    refined[0], refined[-1] = 0.0, total
    return np.maximum.accumulate(np.clip(refined, 0.0, total))[group]


def max_distance(line: Floats, other: Floats) -> float:
    """Return the Hausdorff distance [m] of two polylines' points; NaN if `other` is empty."""
    if not len(other):
        return float("nan")
    return float(max(distances_to_line(line, other).max(), distances_to_line(other, line).max()))


def distances_to_line(points: Floats, line: Floats) -> Floats:
    """Return the distances (M,) [m] from points (M, 2 or more) to a polyline (P, 2 or more)."""
    corners = line[:, :2] if len(line) > 1 else np.repeat(line[:, :2], 2, axis=0)
    return np.asarray(
        shapely.distance(shapely.points(points[:, :2]), shapely.linestrings(corners))
    )
