# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Steering, the parameter of the search: straight lines of a disc, or Dubins curves of a vehicle.

The scene's body decides: a turning radius of 0 means straight lines. An edge is a `Curve`; a
straight line is one whose arcs have no length. Lengths are in cells.
"""

import numpy as np

from scenario_gen.method.routing.search.dubins import (
    Curve,
    LSL_CODE,
    POSE,
    Pose,
    pose_along,
    shortest,
)
from scenario_gen.method.routing.search.sweep import (
    Body,
    cost_at,
    follow,
    footprint_is_free,
    SCENE,
    Scene,
)
from scenario_gen.numerics import Floats
from scenario_gen.numerics.kernels import F2, kernel, OUT1
from scenario_gen.roads import segment_free


@kernel(inline=True, forced=True)
def distance(a: Pose, b: Pose) -> float:
    """Return the straight distance between two poses: no edge between them is shorter."""
    dx, dy = b.x - a.x, b.y - a.y
    return float(np.sqrt(dx * dx + dy * dy))


@kernel(inline=True, forced=True)
def steer(start: Pose, end: Pose, body: Body) -> Curve:
    """Return the shortest edge from pose to pose."""
    if body.turn_radius == 0.0:
        return Curve(LSL_CODE, 0.0, distance(start, end), 0.0)
    return shortest(start, end, body.turn_radius)


@kernel(inline=True, forced=True)
def pose_on_edge(start: Pose, end: Pose, edge: Curve, length: float, body: Body) -> Pose:
    """Return the pose at a length of an edge between two poses."""
    if body.turn_radius == 0.0:
        share = length / edge.second
        x = start.x + (end.x - start.x) * share
        return Pose(x, start.y + (end.y - start.y) * share, 0.0)
    return pose_along(start, edge, length, body.turn_radius)


@kernel(inline=True, forced=True)
def edge_cost(start: Pose, end: Pose, edge: Curve, scene: Scene) -> float:
    """Return the cost of an edge from a free pose; infinity if it is not free."""
    body = scene.body
    if body.turn_radius > 0.0:
        return follow(start, edge, scene)
    free = segment_free(scene.clearance, start.x, start.y, end.x, end.y, body.half_length)
    return edge.second if free else np.inf


@kernel(inline=True)
def is_free(pose: Pose, scene: Scene) -> bool:
    """Whether the body at a pose is free."""
    if scene.body.turn_radius > 0.0:
        return footprint_is_free(pose, scene)
    return segment_free(scene.clearance, pose.x, pose.y, pose.x, pose.y, scene.body.half_length)


@kernel(POSE, POSE, SCENE, on_demand=True)
def steering_cost(start: Pose, end: Pose, scene: Scene) -> float:
    """Return the cost of the shortest edge between two poses, of which the first is free."""
    return edge_cost(start, end, steer(start, end, scene.body), scene)


@kernel(F2, SCENE, OUT1, on_demand=True)
def costs_per_length(poses: Floats, scene: Scene, costs: Floats) -> None:
    """Write the cost per length (P,) at each of P free poses (P, 3)."""
    for k in range(poses.shape[0]):
        costs[k] = cost_at(Pose(poses[k, 0], poses[k, 1], poses[k, 2]), scene)
