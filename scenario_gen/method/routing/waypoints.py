# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Which anchors a route goes through, and how strongly the others attract it."""

import itertools

import numpy as np

from scenario_gen.method.routing.task import VehicleTask
from scenario_gen.numerics import Bools, Floats
from scenario_gen.numerics.plane import angle_between
from scenario_gen.roads import nearest_pose_with_room

MIN_CHORD_M = 0.3  # between two waypoints
MAX_TURN_RAD = np.deg2rad(100.0)  # a waypoint at a larger angle to the heading lies behind
CURVATURE_FACTOR = 1.5  # of the allowed curvature that a waypoint may demand before smoothing
OTHER_ANCHOR_WEIGHT = 0.1  # of an anchor that is no waypoint
EASED_ROOM_M = 0.15  # around the footprint at an eased waypoint
MAX_EASED_MOVE_M = 1.0


def choose_waypoints(anchors: Floats, stands: Bools, limit: float) -> list[int]:
    """Return the anchors (A, 3) that the first guess goes through: those it can drive in order.

    Args:
        anchors: poses.
        stands: (A - 1,) whether the vehicle stands between two anchors.
        limit: curvature [1/m].
    """
    kept, last = [0], len(anchors) - 1
    for k in range(1, last):
        if not stands[k - 1] and _leads_to(anchors[kept[-1]], anchors[k], limit):
            kept.append(k)
    while len(kept) > 1 and not _leads_to(anchors[kept[-1]], anchors[last], limit):
        kept.pop()
    return [*kept, last]


def _leads_to(start: Floats, end: Floats, limit: float) -> bool:
    """Whether `end` lies ahead of `start`, by both headings, without too sharp a turn."""
    dx, dy = (end - start)[:2]
    chord = float(np.hypot(dx, dy))
    if chord < MIN_CHORD_M:
        return False
    direction = float(np.arctan2(dy, dx))
    turn = max(abs(angle_between(direction, yaw)) for yaw in (start[2], end[2]))
    curvature = 2.0 * np.sin(min(turn, 0.5 * np.pi)) / chord
    return turn <= MAX_TURN_RAD and bool(curvature <= CURVATURE_FACTOR * limit)


def anchor_weights(anchors: Floats, waypoints: list[int]) -> Floats:
    """Return how strongly each anchor (A,) attracts the route.

    Waypoints between the ends have weight 1, other anchors less, if they lie between their
    neighbouring waypoints.
    """
    weight = np.zeros(len(anchors))
    weight[waypoints[1:-1]] = 1.0
    for a, b in itertools.pairwise(waypoints):
        chord = (anchors[b] - anchors[a])[:2]
        from_a = (anchors[a + 1 : b] - anchors[a])[:, :2]
        to_b = (anchors[b] - anchors[a + 1 : b])[:, :2]
        is_between = (from_a @ chord > 0.0) & (to_b @ chord > 0.0)
        distance = np.minimum(np.hypot(*from_a.T), np.hypot(*to_b.T))
        weight[a + 1 : b][is_between & (distance > MIN_CHORD_M)] = OTHER_ANCHOR_WEIGHT
    return weight


def eased_pose(task: VehicleTask, before: Floats, pose: Floats, after: Floats) -> Floats:
    """Return a pose with room near `pose` that heads from the waypoint before to that after."""
    dx, dy = (after - before)[:2]
    turned = np.array([pose[0], pose[1], np.arctan2(dy, dx)])
    length = task.vehicle.length + 2.0 * EASED_ROOM_M
    width = task.vehicle.width + 2.0 * EASED_ROOM_M
    moved = nearest_pose_with_room(task.road, turned, length, width, MAX_EASED_MOVE_M)
    return pose if moved is None else moved[0]
