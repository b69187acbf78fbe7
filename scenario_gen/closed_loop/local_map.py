# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The road around the ego as a grid, with the other vehicles in it: what a planner of obstacles asks for."""

from dataclasses import dataclass

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.closed_loop.simulation import ClosedLoop, State
from scenario_gen.numerics import Bools, Floats
from scenario_gen.numerics.boxes import fill_box
from scenario_gen.numerics.kernels import B1, F1, F2, I, kernel, OUTB2

REACH = 30.0  # metres from the ego to each side of the grid


@dataclass(frozen=True, eq=False)
class LocalMap:
    """(H, W) whether a cell is taken, its size [m], and x, y [m] of the lower-left corner; row 0 has the lowest y."""

    blocked: Bools
    resolution: float
    origin: Floats


def local_map(loop: ClosedLoop, state: State) -> LocalMap:
    """Return the cells of the road's grid within REACH of the ego; a cell whose centre lies in another vehicle is taken.

    Raises:
        InputError: no road is known.
    """
    road = loop.road
    if road is None:
        raise InputError(f"scenario {loop.scenario.index}: no road is known")
    size = road.resolution
    cells = round(2.0 * REACH / size)
    first = np.floor((np.array(state.ego[:2]) - REACH - road.origin) / size).astype(np.int64)
    blocked = np.ones((cells, cells), dtype=np.bool_)
    height, width = road.drivable.shape
    (left, low), (right, high) = np.maximum(first, 0), np.minimum(first + cells, (width, height))
    if right > left and high > low:
        inside = ~road.drivable[low:high, left:right]
        blocked[low - first[1] : high - first[1], left - first[0] : right - first[0]] = inside
    origin = road.origin + first * size
    paint(state.vehicles, loop.certified.half, state.here, loop.ego, np.append(origin, size), blocked)
    return LocalMap(blocked, size, origin)


@kernel(F2, F2, B1, I, F1, OUTB2)
def paint(vehicles: Floats, half: Floats, here: Bools, ego: int, grid: Floats, blocked: Bools) -> None:
    """Mark the cells (H, W) whose centres lie in a vehicle other than the ego.

    Args:
        vehicles: (N, 4) x, y [m], yaw [rad], speed.
        half: (N, 2) half lengths and widths [m].
        here: (N,) who is on the scene.
        ego: index.
        grid: (3,) x, y of the lower-left corner and cell size [m].
        blocked: is changed.
    """
    box, size = np.empty(7), grid[2]
    for i in range(vehicles.shape[0]):
        if i == ego or not here[i]:
            continue
        fill_box(vehicles[i, 0], vehicles[i, 1], vehicles[i, 2], half[i, 0], half[i, 1], box)
        first_row, last_row = int((box[1] - box[6] - grid[1]) / size), int((box[1] + box[6] - grid[1]) / size) + 1
        first, last = int((box[0] - box[6] - grid[0]) / size), int((box[0] + box[6] - grid[0]) / size) + 1
        for row in range(max(first_row, 0), min(last_row, blocked.shape[0])):
            for column in range(max(first, 0), min(last, blocked.shape[1])):
                dx, dy = grid[0] + (column + 0.5) * size - box[0], grid[1] + (row + 0.5) * size - box[1]
                if abs(dx * box[2] + dy * box[3]) <= box[4] and abs(dy * box[2] - dx * box[3]) <= box[5]:
                    blocked[row, column] = True
