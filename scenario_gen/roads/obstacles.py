# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What stands in the way: parked cars, works, a closed lane, as rectangles drawn into a road."""

from dataclasses import dataclass, replace

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Bools
from scenario_gen.numerics.boxes import footprint_gaps
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
            raise InputError(
                f"{what}: {piece!r} is not of the form `{_FORM}` with finite numbers, e.g. `20 1.5 0 4.6 1.9`"
            )
        if not all(0.0 < size <= _LARGEST for size in values[3:]):
            raise InputError(
                f"{what}: {piece!r} has length {values[3]:g} m and width {values[4]:g} m; above 0 to {_LARGEST:g} m are drawn"
            )
        obstacles.append(Obstacle(*values))
    return tuple(obstacles)


def with_obstacles(
    road: Road, obstacles: tuple[Obstacle, ...], others: Bools | bool = False
) -> Road:
    """Return the road with every cell that an obstacle overlaps no longer drivable; `others` (H, W) are so for some types alone.

    Raises:
        InputError: an obstacle overlaps no drivable cell, or leaves none; the message names it.
    """
    if not obstacles:
        return road
    blocked = np.zeros(road.drivable.shape, dtype=np.bool_)
    height, width = road.drivable.shape
    low, high = road.origin, road.origin + np.array([width, height]) * road.resolution
    x, y = (
        first + (np.arange(n) + 0.5) * road.resolution
        for first, n in zip(low, (width, height), strict=True)
    )
    cells = np.stack((*np.broadcast_arrays(x, y[:, None]), np.zeros((height, width))), axis=-1)
    half = 0.5 * road.resolution * (1.0 - 1e-9)  # touching is no overlap
    for obstacle in obstacles:
        pose, size = (
            np.array([obstacle.x, obstacle.y, obstacle.yaw]),
            (obstacle.length / 2.0, obstacle.width / 2.0),
        )
        near = (
            np.hypot(*np.moveaxis(cells[..., :2] - pose[:2], -1, 0))
            < np.hypot(*size) + road.resolution
        )
        over = np.zeros_like(blocked)
        own = np.ascontiguousarray(cells[near])
        over[near] = footprint_gaps((half, half), own, size, np.tile(pose, (len(own), 1)))[0] < 0.0
        if not (over & (road.drivable | others)).any():
            raise InputError(
                f"obstacle `{obstacle}` stands nowhere on what is drivable of road {road.name!r}, which lies between "
                f"({low[0]:.1f}, {low[1]:.1f}) and ({high[0]:.1f}, {high[1]:.1f}) m"
            )
        blocked |= over
    if not (road.drivable & ~blocked).any():
        raise InputError(f"the obstacles leave nothing drivable of road {road.name!r}")
    return replace(
        road, drivable=road.drivable & ~blocked, obstructed=(road.drivable | others) & blocked
    )
