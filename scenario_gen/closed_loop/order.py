# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The order of events of the certified execution, kept without exception: nobody comes to a place before its turn.

Why nobody meets and nobody waits in a circle: docs/closed_loop.md.
"""

import numpy as np

from scenario_gen.closed_loop.certified import World
from scenario_gen.numerics import Bools, Floats
from scenario_gen.numerics.kernels import kernel

PARTS = 4  # of a step, in each of which the order is proven


@kernel(inline=True)
def limit(order: Floats, cell: float, clock: float) -> float:
    """Clock [s] that one may not pass while the other's is at `clock`; order (K,) is that of the pair."""
    return float(max(clock, order[min(int(clock / cell), order.shape[0] - 1)]))


@kernel(inline=True)
def _part(start: float, end: float, r: float, after: float, forced: bool, h: float, part: float) -> float:
    """Clock [s] at a share of a step; its rate changes evenly, or it moves evenly where it was forced."""
    if forced or part == 1.0:
        return start + part * (end - start)
    return start + h * part * (r + 0.5 * part * (after - r))


@kernel(inline=True)
def _slope(start: float, end: float, r: float, after: float, forced: bool, h: float, part: float) -> float:
    """Rate of a clock at a share of a step."""
    return (end - start) / h if forced else r + part * (after - r)


@kernel(inline=True)
def _ordered(world: World, i: int, j: int, clock: Floats, rate: Floats, new: Floats, after: Floats, forced: Floats) -> bool:
    """Whether vehicle i keeps to the order with j throughout the step, proven for each of its parts.

    In a part, either the clock of i ends no farther than it may while that of j is where it begins, for that limit only grows; or
    it stays behind the clock of j throughout: their difference is a parabola, least at an end or at its vertex.
    """
    h, cell, order = world.step, world.cell, world.order[i, j]
    a0, b0 = clock[i], clock[j]
    for k in range(PARTS):
        start, part = k / PARTS, (k + 1.0) / PARTS
        a = _part(clock[i], new[i], rate[i], after[i], forced[i] > 0.0, h, part)
        b = _part(clock[j], new[j], rate[j], after[j], forced[j] > 0.0, h, part)
        if a > limit(order, cell, b0):
            if b0 < a0 or b < a:
                return False
            first = _slope(clock[j], new[j], rate[j], after[j], forced[j] > 0.0, h, start) - _slope(
                clock[i], new[i], rate[i], after[i], forced[i] > 0.0, h, start
            )
            last = _slope(clock[j], new[j], rate[j], after[j], forced[j] > 0.0, h, part) - _slope(
                clock[i], new[i], rate[i], after[i], forced[i] > 0.0, h, part
            )
            if first < 0.0 < last and b0 - a0 - 0.5 * first * first / (last - first) * h / PARTS < 0.0:
                return False
        a0, b0 = a, b
    return True


@kernel(inline=True)
def keep_order(
    world: World,
    goes: Bools,
    clock: Floats,
    rate: Floats,
    new_clock: Floats,
    new_rate: Floats,
    forced: Floats,
) -> None:
    """Hold back who would come to a place before its turn.

    First at the rate of the one it waits for, then at once, evenly to where the order ends its way at the step's begin: that is
    allowed whatever the other does. Holding one back may hold back others, but the way of each is cut only once.

    Args:
        world: the scenario, whose ego is not held back, and the step.
        goes: (N,) who is on the way.
        clock: (N,) certified times at the step's begin [s].
        rate: (N,) how fast these run then.
        new_clock: (N,) at its end; changed.
        new_rate: (N,) likewise.
        forced: (N,) 1 where one brakes as hard as it can, 2 where its way is cut; changed.
    """
    n, h, ego = clock.shape[0], world.step, world.ego
    wanted, wanted_rate = new_clock.copy(), new_rate.copy()
    changed = True
    while changed:
        changed = False
        for i in range(n):
            for j in range(n):
                if i in (j, ego) or j == ego or not goes[i] or not goes[j] or forced[i] > 1.0:
                    continue
                if _ordered(world, i, j, clock, rate, new_clock, new_rate, forced):
                    continue
                changed = True
                if new_rate[i] > new_rate[j] > 0.0 and forced[i] == 0.0:
                    new_rate[i] = new_rate[j]
                    new_clock[i] = clock[i] + 0.5 * (rate[i] + new_rate[i]) * h
                    if _ordered(world, i, j, clock, rate, new_clock, new_rate, forced):
                        continue
                room = np.inf
                for k in range(n):
                    if k not in (i, ego) and goes[k]:
                        room = min(room, limit(world.order[i, k], world.cell, clock[k]) - clock[i])
                new_clock[i] = clock[i] + max(min(new_clock[i] - clock[i], room), 0.0)
                new_rate[i] = min(new_rate[i], (new_clock[i] - clock[i]) / h)
                forced[i] = 2.0
    _go_together(world, goes, clock, wanted, wanted_rate, new_clock, new_rate, forced)


@kernel(inline=True)
def _go_together(
    world: World,
    goes: Bools,
    clock: Floats,
    wanted: Floats,
    wanted_rate: Floats,
    new_clock: Floats,
    new_rate: Floats,
    forced: Floats,
) -> None:
    """Let those with the earliest clock go on, evenly and with one clock, if the order held them back only for each other.

    That is always allowed, up to the next later clock: on one clock they are certified, and nobody is behind them. Without it
    they could stand for ever: each alone may not leave the others behind, and a whole step would take them beyond the next one.
    """
    n, h, ego = clock.shape[0], world.step, world.ego
    least, later = np.inf, np.inf
    for i in range(n):
        if i != ego and goes[i] and clock[i] < least:
            least, later = clock[i], least
        elif i != ego and goes[i] and least < clock[i] < later:
            later = clock[i]
    held = np.empty(n, dtype=np.bool_)
    for i in range(n):
        held[i] = i != ego and goes[i] and clock[i] == least and new_clock[i] == least and wanted[i] > least
    changed, until = True, least
    while changed:
        changed, until = False, later
        for i in range(n):
            if held[i]:
                until = min(until, wanted[i])
        for i in range(n):
            for j in range(n):
                at_once = held[i] and not held[j] and j != ego and goes[j] and clock[j] == least
                if at_once and until > limit(world.order[i, j], world.cell, least):
                    held[i], changed = False, True
    for i in range(n):
        if held[i]:
            new_clock[i] = until
            new_rate[i] = min(wanted_rate[i], (until - least) / h)
            forced[i] = 2.0
