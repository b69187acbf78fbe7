# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Where the trees grow to: random points of the component, later only where a shorter path can lie.

Large trees draw their samples ahead and take them bucket by bucket: the same samples in another order, but one after the
other they need the same neighbours, which are then still in the processor's cache.
"""

from numba import types
import numpy as np
from numpy.typing import NDArray

from scenario_gen.method.routing.search.tree_nodes import BOUND, CORNERS, DRAWN, NODES_A, NODES_B, SIDE, USED
from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.kernels import kernel

AHEAD = 8  # so many nodes per sample drawn ahead: the trees' density hardly changes within a batch
RandomState = types.Array(types.uint64, 1, "C")
Random = NDArray[np.uint64]


@kernel(inline=True)
def uniform(state: Random) -> float:
    """A number in [0, 1) from SplitMix64 (Steele, Lea & Flood 2014); advances `state` (1,)."""
    state[0] += np.uint64(0x9E3779B97F4A7C15)
    z = state[0]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    value: float = float((z ^ (z >> np.uint64(31))) >> np.uint64(11)) * 2.0**-53
    return value


@kernel(inline=True)
def _in_cell(cells: Ints, width: int, random: Random) -> tuple[float, float]:
    """A point of one of the cells (flat indices), uniformly."""
    cell = cells[int(uniform(random) * cells.size)]
    return cell % width + uniform(random), cell // width + uniform(random)


@kernel(inline=True)
def detour(ends: Floats, x: float, y: float) -> float:
    """The least length [cells] of a path from start to goal, `ends` (2, 2), by way of (x, y)."""
    from_start = np.sqrt((x - ends[0, 0]) ** 2 + (y - ends[0, 1]) ** 2)
    to_goal = np.sqrt((x - ends[1, 0]) ** 2 + (y - ends[1, 1]) ** 2)
    return float(from_start + to_goal)


@kernel(inline=True)
def _sample(
    ends: Floats, free_cells: Ints, corner_cells: Ints, clearance: Floats, bound: float, corners: float, random: Random
) -> tuple[float, float]:
    """A point of the component, uniformly; once a path of length `bound` is known, of the ellipse that can better it.

    From then on a share of the samples lies in the cells diagonally before obstacles' convex corners: where shortest paths bend.
    """
    if corner_cells.size > 0 and corners > 0.0 and bound < np.inf and uniform(random) < corners:
        for _ in range(20):
            x, y = _in_cell(corner_cells, clearance.shape[1], random)
            if detour(ends, x, y) < bound:
                return x, y
    height, width = clearance.shape
    dx, dy = ends[1, 0] - ends[0, 0], ends[1, 1] - ends[0, 1]
    straight = np.sqrt(dx * dx + dy * dy)
    major = 0.5 * bound
    minor = 0.5 * np.sqrt(max(bound * bound - straight * straight, 0.0)) if bound < np.inf else np.inf
    small = np.pi * major * minor < free_cells.size
    x, y = ends[1, 0], ends[1, 1]
    for _ in range(100):
        if small:  # Gammell, Srinivasa & Barfoot 2014: sample the ellipse directly
            angle, r = 2.0 * np.pi * uniform(random), np.sqrt(uniform(random))
            u, v = major * r * np.cos(angle), minor * r * np.sin(angle)
            c, s = (dx / straight, dy / straight) if straight > 0.0 else (1.0, 0.0)
            x = 0.5 * (ends[0, 0] + ends[1, 0]) + c * u - s * v
            y = 0.5 * (ends[0, 1] + ends[1, 1]) + s * u + c * v
            i, j = int(np.floor(y)), int(np.floor(x))
            if 0 <= i < height and 0 <= j < width and clearance[i, j] > 0.0:
                break
        else:
            x, y = _in_cell(free_cells, width, random)
            if detour(ends, x, y) < bound:
                break
    return x, y


@kernel(inline=True)
def next_sample(
    ends: Floats, free_cells: Ints, corner_cells: Ints, clearance: Floats, drawn: Floats, buckets: int, columns: int,
    counter: Ints, setting: Floats, random: Random,
) -> tuple[float, float]:  # fmt: skip
    """The next place [cells] to grow to; `drawn` (a, 2) keeps what large trees have drawn ahead (empty: they draw one by one)."""
    bound, corners, side = setting[BOUND], setting[CORNERS], setting[SIDE]
    if counter[USED] == counter[DRAWN]:
        batch = min((counter[NODES_A] + counter[NODES_B]) // AHEAD, drawn.shape[0])
        if batch < 1:
            return _sample(ends, free_cells, corner_cells, clearance, bound, corners, random)
        fresh = np.empty((batch, 2))
        begin = np.zeros(buckets + 1, dtype=np.int64)
        for k in range(batch):
            x, y = _sample(ends, free_cells, corner_cells, clearance, bound, corners, random)
            fresh[k, 0], fresh[k, 1] = x, y
            begin[int(y / side) * columns + int(x / side) + 1] += 1
        for b in range(buckets):
            begin[b + 1] += begin[b]
        for k in range(batch):
            b = int(fresh[k, 1] / side) * columns + int(fresh[k, 0] / side)
            drawn[begin[b], 0], drawn[begin[b], 1] = fresh[k, 0], fresh[k, 1]
            begin[b] += 1
        counter[DRAWN], counter[USED] = batch, 0
    k = counter[USED]
    counter[USED] += 1
    return drawn[k, 0], drawn[k, 1]
