# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Obstacles such as parked cars, works or a closed lane, drawn into a road as rectangles."""

from dataclasses import dataclass, replace

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Bools
from scenario_gen.numerics.boxes import footprint_gaps
from scenario_gen.types import read_numbers, Road, split_pieces

_MAX_SIZE_M = 1000.0


@dataclass(frozen=True)
class Obstacle:
    """A rectangle in the road's frame.

    Attributes:
        x: [m] of its centre.
        y: [m] of its centre.
        yaw: [rad] direction of its length.
        length: [m].
        width: [m].
    """

    x: float
    y: float
    yaw: float
    length: float
    width: float

    def __str__(self) -> str:
        return f"{self.x:g} {self.y:g} {self.yaw:g} {self.length:g} {self.width:g}"


def read_obstacles(text: str, parameter: str = "obstacles") -> tuple[Obstacle, ...]:
    """Return the obstacles of a text such as `20 1.5 0.1 4.6 1.9; 35 -2 0 8 2`.

    Args:
        text: their centres, yaws and sizes.
        parameter: its name in messages.

    Raises:
        InputError: a piece has another form, a value is not finite, or a size is not positive;
            the message has the piece.
    """
    obstacles = []
    for piece in split_pieces(text):
        values = read_numbers(piece)
        if len(values) != 5:
            raise InputError(
                f"{parameter}: {piece!r} is not of the form `x y yaw length width` with finite "
                "numbers, e.g. `20 1.5 0 4.6 1.9`"
            )
        obstacle = Obstacle(*values)
        if not all(0.0 < size <= _MAX_SIZE_M for size in (obstacle.length, obstacle.width)):
            raise InputError(
                f"{parameter}: {piece!r} has length {obstacle.length:g} m and width "
                f"{obstacle.width:g} m; sizes above 0 and up to {_MAX_SIZE_M:g} m are drawn"
            )
        obstacles.append(obstacle)
    return tuple(obstacles)


def with_obstacles(
    road: Road, obstacles: tuple[Obstacle, ...], others: Bools | bool = False
) -> Road:
    """Return the road without the cells that obstacles overlap.

    Args:
        road: the grid.
        obstacles: rectangles in its frame.
        others: (H, W) cells that are drivable for some types of road users only.

    Raises:
        InputError: an obstacle overlaps no drivable cell, or all cells are blocked.
    """
    for obstacle in obstacles:
        overlapped = _overlapped_cells(road, obstacle)
        if not (overlapped & (road.drivable | others)).any():
            height, width = road.drivable.shape
            low, high = road.origin, road.origin + np.array([width, height]) * road.resolution
            raise InputError(
                f"obstacle `{obstacle}` is not on drivable ground of road {road.name!r}, which "
                f"lies between ({low[0]:.1f}, {low[1]:.1f}) and ({high[0]:.1f}, {high[1]:.1f}) m"
            )
    return with_obstacles_on(road, obstacles, others)


def with_obstacles_on(
    road: Road, obstacles: tuple[Obstacle, ...], others: Bools | bool = False
) -> Road:
    """Return the road without the cells that obstacles overlap, of which some may be elsewhere.

    Raises:
        InputError: all cells are blocked.
    """
    blocked = np.zeros(road.drivable.shape, dtype=np.bool_)
    for obstacle in obstacles:
        blocked |= _overlapped_cells(road, obstacle)
    obstructed = (road.drivable | others) & blocked
    if not obstructed.any():
        return road
    drivable = road.drivable & ~blocked
    if not drivable.any():
        raise InputError(f"the obstacles leave no drivable cell of road {road.name!r}")
    if road.obstructed is not None:
        obstructed |= road.obstructed
    return replace(road, drivable=drivable, obstructed=obstructed)


def _overlapped_cells(road: Road, obstacle: Obstacle) -> Bools:
    """Return (H, W) the cells that an obstacle overlaps; touching is no overlap."""
    height, width = road.drivable.shape
    x = road.origin[0] + (np.arange(width) + 0.5) * road.resolution
    y = road.origin[1] + (np.arange(height) + 0.5) * road.resolution
    reach = np.hypot(obstacle.length, obstacle.width) / 2.0 + road.resolution
    near = np.hypot(x - obstacle.x, (y - obstacle.y)[:, None]) < reach
    rows, columns = np.nonzero(near)
    cells = np.column_stack((x[columns], y[rows], np.zeros(len(rows))))
    pose = np.tile([obstacle.x, obstacle.y, obstacle.yaw], (len(cells), 1))
    half_cell = 0.5 * road.resolution * (1.0 - 1e-9)
    half_sizes = (obstacle.length / 2.0, obstacle.width / 2.0)
    gaps, *_ = footprint_gaps((half_cell, half_cell), cells, half_sizes, pose)
    overlapped = np.zeros(road.drivable.shape, dtype=np.bool_)
    overlapped[rows, columns] = gaps < 0.0
    return overlapped
