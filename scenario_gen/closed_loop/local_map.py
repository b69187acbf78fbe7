# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The road around the ego as a grid, with the other vehicles in it: what a planner of obstacles asks for."""

from dataclasses import dataclass

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.closed_loop.simulation import ClosedLoop, State
from scenario_gen.numerics import Bools, Floats
from scenario_gen.numerics.plane import ahead_and_left

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
    origin = road.origin + np.floor((np.array(state.ego[:2]) - REACH - road.origin) / size) * size
    rows, columns = np.indices((cells, cells)) + 0.5
    centres = origin + size * np.stack([columns, rows], axis=-1)
    blocked = ~road.drivable_at(centres)
    for i in np.flatnonzero(state.here):
        if i != loop.ego:
            ahead, left = ahead_and_left(centres - state.vehicles[i, :2], state.vehicles[i, 2])
            length, width = loop.world.half[i]
            blocked |= (np.abs(ahead) <= length) & (np.abs(left) <= width)
    return LocalMap(blocked, size, origin)
