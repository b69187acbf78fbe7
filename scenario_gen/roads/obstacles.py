# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Obstacles such as parked cars, works or a closed lane, drawn into a road as rectangles."""

from dataclasses import dataclass, replace

import numpy as np

from scenario_gen.base.documents import shown
from scenario_gen.base.errors import did_you_mean, InputError, RefusedError
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.numerics import Bools
from scenario_gen.numerics.boxes import footprint_gaps
from scenario_gen.numerics.curve import Curve
from scenario_gen.types import LaneNetwork, Obstacle, read_numbers, Road, split_pieces

_MAX_SIZE_M = 1000.0


@dataclass(frozen=True)
class ParkedConfig(Parameters):
    """Cars that are parked along lanes, on a drawn road or a vector map."""

    lanes: str = parameter("", "ids of the lanes with a row of parked cars, separated by commas")
    side: str = parameter("right", "edge of the lanes", choices=("right", "left"))
    begin: float = parameter(
        0.0, "of the row, from the lane's begin in driving direction", unit="m", low=0.0
    )
    end: float = parameter(0.0, "of the row; 0: the lane's end", unit="m", low=0.0)
    count: int = parameter(0, "cars per lane; 0: as many as there is room for", low=0, high=1000)
    gap: float = parameter(1.0, "between two cars", unit="m", low=0.1, high=1000.0)
    length: float = parameter(4.5, "of a car", unit="m", low=0.5, high=30.0)
    width: float = parameter(1.8, "of a car", unit="m", low=0.3, high=5.0)
    offset: float = parameter(
        0.0,
        "from the lane's edge to the cars; negative: they stand partly beside the lane",
        unit="m",
        low=-5.0,
        high=10.0,
    )


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
    road: Road,
    obstacles: tuple[Obstacle, ...],
    others: Bools | bool = False,
    *,
    elsewhere: bool = False,
) -> Road:
    """Return the road without the cells that obstacles overlap.

    Args:
        road: the grid.
        obstacles: rectangles in its frame.
        others: (H, W) cells that are drivable for some types of road users only.
        elsewhere: whether obstacles may be off the drivable cells.

    Raises:
        InputError: an obstacle overlaps no drivable cell, or all cells are blocked.
        RefusedError: an obstacle lies outside the part of a vector map.
    """
    if not obstacles:
        return road
    blocked = np.zeros(road.drivable.shape, dtype=np.bool_)
    standing, known = [], [each for each in road.obstacles if each not in obstacles]
    for obstacle in obstacles:
        cells = _overlapped_cells(road, obstacle)
        if not elsewhere and not (cells & (road.drivable | others)).any():
            height, width = road.drivable.shape
            low, high = road.origin, road.origin + np.array([width, height]) * road.resolution
            message = (
                f"obstacle `{obstacle}` is not on drivable ground of road {road.name!r}, which "
                f"lies between ({low[0]:.1f}, {low[1]:.1f}) and ({high[0]:.1f}, {high[1]:.1f}) m"
            )
            if road.map_lanes is not None:
                raise RefusedError(f"{message}; #box=x0,y0,x1,y1 chooses another part of the map")
            raise InputError(message)
        blocked |= cells
        standing += [obstacle] if cells.any() else []
    drivable = road.drivable & ~blocked
    if not drivable.any():
        raise InputError(f"the obstacles leave no drivable cell of road {road.name!r}")
    obstructed = (road.drivable | others) & blocked
    if road.obstructed is not None:
        obstructed |= road.obstructed
    return replace(
        road,
        drivable=drivable,
        obstructed=obstructed if obstructed.any() else None,
        lanes=road.lanes and replace(road.lanes, obstacles=(*known, *standing)),
    )


def parked_cars(network: LaneNetwork | None, row: ParkedConfig) -> tuple[Obstacle, ...]:
    """Return the cars that are parked along lanes of a network.

    Raises:
        InputError: there is no such lane.
    """
    lanes = {lane.id: lane for lane in network.every_lane} if network is not None else {}
    cars: list[Obstacle] = []
    for name in filter(None, map(str.strip, row.lanes.split(","))):
        if name not in lanes:
            known = ", ".join(list(lanes)[:12]) or "no lanes"
            raise InputError(
                f"road.parked.lanes: the road has no lane {shown(name)!r}; it has "
                f"{known}{did_you_mean(name, lanes)}"
            )
        edge = Curve.through(lanes[name].right if row.side == "right" else lanes[name].left)
        inward = row.offset + row.width / 2.0
        end = min(row.end or np.inf, edge.length)
        first = np.arange(row.begin, end - row.length + 1e-6, row.length + row.gap)
        middle = first[: row.count or None] + row.length / 2.0
        places = edge.at_offset(middle, inward if row.side == "right" else -inward)
        cars += [Obstacle(x, y, yaw, row.length, row.width) for x, y, yaw in places.tolist()]
    return tuple(cars)


def _overlapped_cells(road: Road, obstacle: Obstacle) -> Bools:
    """Return (H, W) the cells that an obstacle overlaps; touching is no overlap."""
    reach = np.hypot(obstacle.length, obstacle.width) / 2.0 + road.resolution
    overlapped = road.cells_near(obstacle.x, obstacle.y, reach)
    rows, columns = np.nonzero(overlapped)
    centres = road.origin + (np.column_stack((columns, rows)) + 0.5) * road.resolution
    cells = np.column_stack((centres, np.zeros(len(rows))))
    pose = np.tile(obstacle[:3], (len(cells), 1))
    half_cell = 0.5 * road.resolution * (1.0 - 1e-9)
    half_sizes = (obstacle.length / 2.0, obstacle.width / 2.0)
    gaps, *_ = footprint_gaps((half_cell, half_cell), cells, half_sizes, pose)
    overlapped[rows, columns] = gaps < 0.0
    return overlapped
