# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""An occupancy grid around the ego, with the road and the other vehicles."""

import numpy as np

from scenario_gen.closed_loop.simulation import ClosedLoop, State
from scenario_gen.numerics import ahead_and_left, Bools, Floats
from scenario_gen.types import Road

HALF_SIZE_M = 30.0


def local_map(loop: ClosedLoop, road: Road, state: State) -> tuple[Bools, Floats]:
    """Return the cells of the road's grid within HALF_SIZE_M of the ego, in x and in y.

    A cell with its centre in another vehicle is occupied.

    Returns:
        (H, W) whether each cell is occupied, where row 0 has the lowest y, and the lower-left
        corner (2,) [m].
    """
    size = road.resolution
    cells = round(2.0 * HALF_SIZE_M / size)
    origin = (
        road.origin + np.floor((np.array(state.ego[:2]) - HALF_SIZE_M - road.origin) / size) * size
    )
    rows, columns = np.indices((cells, cells)) + 0.5
    centres = origin + size * np.stack([columns, rows], axis=-1)
    blocked = ~road.drivable_at(centres)
    for i in np.flatnonzero(state.present):
        if i != loop.ego:
            ahead, left = ahead_and_left(centres - state.vehicles[i, :2], state.vehicles[i, 2])
            half_length, half_width = loop.world.half[i]
            blocked |= (np.abs(ahead) <= half_length) & (np.abs(left) <= half_width)
    return blocked, origin
