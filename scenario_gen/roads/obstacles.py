# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What stands in the way: parked cars, works, a closed lane, as rectangles drawn into a road."""

from dataclasses import dataclass, replace

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.types import read_numbers, Road, split_pieces

_FORM = "x y yaw length width"
_LARGEST = 1000.0  # [m]


@dataclass(frozen=True)
class Obstacle:
    """A rectangle: centre x, y [m], yaw [rad] of its length, length and width [m], in the road's frame."""

    x: float
    y: float
    yaw: float
    length: float
    width: float

    def __str__(self) -> str:
        return f"{self.x:g} {self.y:g} {self.yaw:g} {self.length:g} {self.width:g}"


def read_obstacles(text: str, what: str = "obstacles") -> tuple[Obstacle, ...]:
    """Return the obstacles of a text such as `20 1.5 0.1 4.6 1.9; 35 -2 0 8 2`.

    Raises:
        InputError: it is not of that form, a value is not finite, or a size is not positive; the message names the piece.
    """
    obstacles = []
    for piece in split_pieces(text):
        values = read_numbers(piece)
        if len(values) != 5:
            raise InputError(f"{what}: {piece!r} is not of the form `{_FORM}` with finite numbers, e.g. `20 1.5 0 4.6 1.9`")
        if not all(0.0 < size <= _LARGEST for size in values[3:]):
            raise InputError(
                f"{what}: {piece!r} has length {values[3]:g} m and width {values[4]:g} m; above 0 to {_LARGEST:g} m are drawn"
            )
        obstacles.append(Obstacle(*values))
    return tuple(obstacles)


def with_obstacles(road: Road, obstacles: tuple[Obstacle, ...]) -> Road:
    """Return the road with every cell that an obstacle overlaps no longer drivable.

    Raises:
        InputError: an obstacle overlaps no drivable cell, or leaves none; the message names it.
    """
    if not obstacles:
        return road
    blocked = np.zeros(road.drivable.shape, dtype=np.bool_)
    height, width = road.drivable.shape
    for obstacle in obstacles:
        turn_cos, turn_sin = np.cos(obstacle.yaw), np.sin(obstacle.yaw)
        cos, sin = abs(turn_cos), abs(turn_sin)
        reach_x = 0.5 * (obstacle.length * cos + obstacle.width * sin)
        reach_y = 0.5 * (obstacle.length * sin + obstacle.width * cos)
        cell = road.resolution
        x, y = (np.arange(n) + 0.5 for n in (width, height))
        dx = (road.origin[0] + x * cell - obstacle.x)[None, :]
        dy = (road.origin[1] + y * cell - obstacle.y)[:, None]
        half = 0.5 * cell * (1.0 - 1e-9)  # touching is no overlap
        ahead, aside = np.abs(dx * turn_cos + dy * turn_sin), np.abs(dy * turn_cos - dx * turn_sin)
        slack = half * (cos + sin)  # separating axes: the grid's two and the rectangle's two
        over = (np.abs(dx) < reach_x + half) & (np.abs(dy) < reach_y + half)
        over = over & (ahead < 0.5 * obstacle.length + slack) & (aside < 0.5 * obstacle.width + slack)
        if not (over & road.drivable).any():
            low, high = road.origin, road.origin + np.array([width, height]) * cell
            raise InputError(
                f"obstacle `{obstacle}` stands nowhere on what is drivable of road {road.name!r}, which lies between "
                f"({low[0]:.1f}, {low[1]:.1f}) and ({high[0]:.1f}, {high[1]:.1f}) m"
            )
        blocked |= over
    if not (road.drivable & ~blocked).any():
        raise InputError(f"the obstacles leave nothing drivable of road {road.name!r}")
    return replace(road, drivable=road.drivable & ~blocked, obstructed=road.drivable & blocked)
