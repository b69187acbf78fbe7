# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The order of events among the others: no vehicle reaches a place before its turn.

The page docs/closed_loop.md proves that the vehicles never collide and never wait in a circle. A
vehicle may pass one that stands before its turn: the order of the two is then drawn again, if
every vehicle provably still comes to its end.
"""

import numpy as np

from scenario_gen.closed_loop.coordination_space import World
from scenario_gen.numerics import Bools, Floats
from scenario_gen.numerics.boxes import boxes_meet
from scenario_gen.numerics.kernels import kernel

MIN_PROGRESS_S = 1e-6  # sum of the progress of all clocks in a step in which somebody moves


@kernel(inline=True)
def _first_meeting(world: World, i: int, j: int, clock: float, other: float) -> float:
    """Return the clock [s] at which vehicle i would meet the remaining path of vehicle j.

    Vehicle i starts at `clock`, vehicle j at `other` [s]. Infinity if they do not meet.
    """
    count = world.cells.shape[1]
    first = min(int(other / world.cell), count - 1)
    for k in range(min(int(clock / world.cell), count - 1), count):
        for m in range(first, count):
            if boxes_meet(world.cells[i, k], world.cells[j, m]):
                return float(k * world.cell)
    return np.inf


@kernel(inline=True)
def passing_limit(world: World, moving: Bools, clocks: Floats, passes: Bools, i: int) -> float:
    """Return the clock [s] that vehicle i may not pass because of vehicles that pass it."""
    limit = np.inf
    for j in range(len(clocks)):
        if passes[j, i] and moving[j]:
            limit = min(limit, _first_meeting(world, i, j, clocks[i], clocks[j]))
    return limit


@kernel(inline=True)
def _end_limit(
    world: World, moving: Bools, begin: Floats, passes: Bools, end: Floats, i: int, j: int
) -> float:
    """Return the clock [s] at which a step of vehicle i ends at last with regard to vehicle j.

    Arguments as in `enforce_order`.
    """
    if i == j or world.ego in (i, j) or not (moving[i] and moving[j]):
        return np.inf
    if passes[i, j] or passes[j, i]:
        return np.inf
    order = world.order[i, j]
    limit = max(begin[j], order[min(int(begin[j] / world.cell), order.shape[0] - 1)])
    return float(max(limit, end[j]) if begin[i] <= begin[j] else limit)


@kernel(inline=True)
def enforce_order(world: World, moving: Bools, begin: Floats, passes: Bools, end: Floats) -> None:
    """Shorten the ways of vehicles that would reach a place before their turn, except the ego.

    Clocks run evenly in a step. Vehicle i respects its order with j if its clock ends before its
    limit at the start of the step, since limits never decrease, or if it stays behind clock j. The
    ends are the latest ones for which this holds, so vehicles with equal clocks advance together.

    Args:
        world: the scenario.
        moving: (N,) whether a vehicle is on its way.
        begin: (N,) clocks at the start of the step [s].
        passes: (N, N) whether vehicle i goes ahead of vehicle j against the certified order.
        end: (N,) clocks at the end [s]: the wanted ones, which are changed.
    """
    n = begin.shape[0]
    for i in range(n):
        if i != world.ego and moving[i]:
            limit = passing_limit(world, moving, begin, passes, i)
            end[i] = max(min(end[i], limit), begin[i])
    changed = True
    while changed:
        changed = False
        for pair in range(n * n):
            i = pair // n
            limit = _end_limit(world, moving, begin, passes, end, i, pair % n)
            if end[i] > limit:
                end[i] = limit
                changed = True


@kernel(inline=True)
def may_pass(world: World, moving: Bools, clocks: Floats, passes: Bools, i: int, j: int) -> bool:
    """Return whether vehicle i can go ahead of vehicle j, although the certified order is other.

    Vehicle j must not be in the way already. The proof that no circle of vehicles then waits for
    one another is a trial in which all but the ego go on to their ends: limits never decrease, so
    what one sequence of moves reaches is reached from all that can happen before.
    """
    if passes[j, i] or _first_meeting(world, j, i, clocks[j], clocks[i]) <= clocks[j]:
        return False
    trial = passes.copy()
    trial[i, j] = True
    begin = clocks.copy()
    running = moving.copy()
    while True:
        end = begin.copy()
        for k in range(len(end)):
            end[k] = min(end[k] + world.cell, world.time[-1])
        enforce_order(world, running, begin, trial, end)
        progress = 0.0
        waiting = 0
        for k in range(len(clocks)):
            if k != world.ego and running[k]:
                progress += end[k] - begin[k]
                arrives = end[k] >= world.spans[k, 1]
                waiting += not arrives
                running[k] = not (arrives and world.leaves[k])
        begin = end
        if waiting == 0 or progress < MIN_PROGRESS_S:
            return waiting == 0
