# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Why a vehicle has no drivable route: parts of the messages to users."""

import numpy as np
from scipy.spatial.distance import cdist

from scenario_gen.method.routing.smooth import Curve
from scenario_gen.method.routing.task import VehicleTask
from scenario_gen.numerics import Floats, wrap_angle
from scenario_gen.numerics.plane import arc_lengths
from scenario_gen.roads import footprint_fits

WINDOW_STEPS = 4  # of a path, over which its curvature is measured
MIN_WINDOW_M = 0.3
STRAIGHT_PER_M = 0.02  # curvature of a lane that counts as straight


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
        distance = cdist(outside[:, :2], (lane.left + lane.right) / 2.0)
        width = np.hypot(*(lane.left - lane.right).T)[distance.argmin(axis=1)]
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


def not_drivable(task: VehicleTask, curve: Curve) -> str:
    """Return why a curve cannot be driven, and near which anchor."""
    reasons, (x, y) = [], curve.sharpest
    if curve.curvature > task.max_curvature:
        reasons.append(
            f"its curvature reaches {curve.curvature:.3f} 1/m at ({x:.2f}, {y:.2f}) m, the limit "
            f"is {task.max_curvature:.3f} (9/10 of limits.{task.vehicle.type}.max_curvature)"
        )
    if len(curve.off_road):
        x, y = curve.off_road[len(curve.off_road) // 2, :2]
        reasons.append(f"its footprint leaves the road at ({x:.2f}, {y:.2f}) m")
    nearest = int(np.argmin(np.hypot(*(task.anchors[:, :2] - [x, y]).T)))
    return (
        f"no drivable route for vehicle {task.vehicle.id} on road {task.road.name!r} near "
        f"{task.anchor_name(nearest)}: {'; '.join(reasons)}"
    )
