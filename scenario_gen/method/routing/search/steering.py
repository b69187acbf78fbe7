# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Steering, from pose to pose: the Dubins curves of a car, or the straight lines of a disc, which turns on the spot.

An edge is a `Curve`; a straight line is one whose arcs have no length, and its poses' yaws mean nothing. Lengths are in cells.
"""

import numpy as np

from scenario_gen.method.routing.search.dubins import Curve, end_of, LSL, POSE, Pose, shortest
from scenario_gen.method.routing.search.sweep import Body, follow, SCENE, Scene
from scenario_gen.numerics.kernels import kernel
from scenario_gen.roads import free_length, segment_free


@kernel(inline=True, forced=True)
def steer(start: Pose, end: Pose, body: Body) -> Curve:
    """The shortest edge from pose to pose."""
    if body.turn > 0.0:
        return shortest(start, end, body.turn)
    dx, dy = end.x - start.x, end.y - start.y
    return Curve(LSL, 0.0, np.sqrt(dx * dx + dy * dy), 0.0)


@kernel(inline=True, forced=True)
def end_of_first(start: Pose, end: Pose, first: Curve, length: float, body: Body) -> Pose:
    """The pose at the end of the first part of an edge, which is `length` long in all."""
    if body.turn > 0.0:
        return end_of(start, first, body.turn)
    return Pose(start.x + (end.x - start.x) * first.b / length, start.y + (end.y - start.y) * first.b / length, 0.0)


@kernel(inline=True, forced=True)
def price(start: Pose, end: Pose, edge: Curve, scene: Scene) -> float:
    """What an edge costs: its length or, of curves, more (see `follow`); infinity if it is not free."""
    if scene.body.turn > 0.0:
        free, cost = follow(start, edge, scene)
        return cost if free else np.inf
    return edge.b if segment_free(scene.clearance, start.x, start.y, end.x, end.y, scene.body.half_width) else np.inf


@kernel(inline=True, forced=True)
def surely_free(start: Pose, end: Pose, scene: Scene) -> float:
    """How much of a straight line is free, infinity if all is; 0 of a curve: it is looked at piece by piece."""
    if scene.body.turn > 0.0:
        return 0.0
    return float(free_length(scene.clearance, start.x, start.y, end.x, end.y, scene.body.half_width))


@kernel(POSE, POSE, SCENE)
def edge_cost(start: Pose, end: Pose, scene: Scene) -> float:
    """What the shortest edge between two poses costs, the first of which is free; infinity if the edge is not."""
    return price(start, end, steer(start, end, scene.body), scene)
