# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The planning task of one vehicle, and why it has no drivable route."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist

from scenario_gen.method.routing.config import PlanningConfig
from scenario_gen.method.routing.search.planner import Planner
from scenario_gen.numerics import Floats, wrap_angle
from scenario_gen.numerics.plane import arc_lengths
from scenario_gen.roads import footprint_fits
from scenario_gen.types import FittedVehicle, Road, Vehicle

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
