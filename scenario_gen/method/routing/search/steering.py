# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Steering, the parameter of the search: the straight lines of a disc, or the Dubins curves of a car.

An edge is a `Curve`; a straight line is one whose arcs have no length. What moves decides at compile time: numba takes the
function for a `Disc` or that for a `Car`. Lengths are in cells.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

from numba.extending import overload
import numpy as np

from scenario_gen.method.routing.search.dubins import Curve, end_of, LSL, POSE, Pose, shortest
from scenario_gen.method.routing.search.sweep import Car, CAR_SCENE, Disc, follow, Scene
from scenario_gen.method.routing.search.tree_samples import (
    Rules,
    sample_point,
    sample_pose,
    States,
)
from scenario_gen.numerics.kernels import kernel
from scenario_gen.roads import free_length, segment_free

_overload: Callable[..., Callable[[Callable[..., Any]], Any]] = partial(
    overload, jit_options={"forceinline": True}, strict=False
)


def _is_disc(body: Any) -> bool:
    return bool(body.instance_class is Disc)


def steer(start: Pose, end: Pose, body: Disc | Car) -> Curve:
    """Return the shortest edge from pose to pose."""
    raise NotImplementedError  # for kernels only, as all that follow


def end_of_first(start: Pose, end: Pose, first: Curve, length: float, body: Disc | Car) -> Pose:
    """Return the pose at the end of the first part of an edge, which is so long in all."""
    raise NotImplementedError


def price(start: Pose, end: Pose, edge: Curve, body: Disc | Car, scene: Scene) -> float:
    """Return what an edge costs: its length or, of curves, more (see `follow`); infinity if it is not free."""
    raise NotImplementedError


def surely_free(start: Pose, end: Pose, body: Disc | Car, scene: Scene) -> float:
    """Return how much of an edge is free, infinity if all is; 0: it must be looked at piece by piece."""
    raise NotImplementedError


def sample(body: Disc | Car, scene: Scene, rules: Rules, state: States) -> Pose:
    """Return a pose to grow to."""
    raise NotImplementedError


@_overload(steer)
def _steer(start: Any, end: Any, body: Any) -> Any:
    def line(start: Pose, end: Pose, body: Disc) -> Curve:
        dx, dy = end.x - start.x, end.y - start.y
        return Curve(LSL, 0.0, np.sqrt(dx * dx + dy * dy), 0.0)

    def curve(start: Pose, end: Pose, body: Car) -> Curve:
        return shortest(start, end, body.turn)

    return line if _is_disc(body) else curve


@_overload(end_of_first)
def _end_of_first(start: Any, end: Any, first: Any, length: Any, body: Any) -> Any:
    def line(start: Pose, end: Pose, first: Curve, length: float, body: Disc) -> Pose:
        return Pose(
            start.x + (end.x - start.x) * first.b / length,
            start.y + (end.y - start.y) * first.b / length,
            0.0,
        )

    def curve(start: Pose, end: Pose, first: Curve, length: float, body: Car) -> Pose:
        return end_of(start, first, body.turn)

    return line if _is_disc(body) else curve


@_overload(price)
def _price(start: Any, end: Any, edge: Any, body: Any, scene: Any) -> Any:
    def line(start: Pose, end: Pose, edge: Curve, body: Disc, scene: Scene) -> float:
        return (
            edge.b
            if segment_free(scene.clearance, start.x, start.y, end.x, end.y, body.radius)
            else np.inf
        )

    def curve(start: Pose, end: Pose, edge: Curve, body: Car, scene: Scene) -> float:
        free, cost = follow(start, edge, body, scene)
        return cost if free else np.inf

    return line if _is_disc(body) else curve


@_overload(surely_free)
def _surely_free(start: Any, end: Any, body: Any, scene: Any) -> Any:
    def line(start: Pose, end: Pose, body: Disc, scene: Scene) -> float:
        return float(free_length(scene.clearance, start.x, start.y, end.x, end.y, body.radius))

    def curve(start: Pose, end: Pose, body: Car, scene: Scene) -> float:
        return 0.0

    return line if _is_disc(body) else curve


@_overload(sample)
def _sample(body: Any, scene: Any, rules: Any, state: Any) -> Any:
    def point(body: Disc, scene: Scene, rules: Rules, state: States) -> Pose:
        return sample_point(scene.clearance, rules, state)

    def pose(body: Car, scene: Scene, rules: Rules, state: States) -> Pose:
        return sample_pose(body, scene, rules, state)

    return point if _is_disc(body) else pose


@kernel(POSE, POSE, CAR_SCENE)
def curve_cost(start: Pose, end: Pose, scene: Scene) -> float:
    """What the shortest curve between two poses costs, the first of which is free; infinity if the curve is not."""
    return price(start, end, steer(start, end, scene.body), scene.body, scene)
