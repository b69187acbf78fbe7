# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The order of events of the certified execution, kept without exception: nobody comes to a place before its turn.

Why nobody meets and nobody waits in a circle: docs/closed_loop.md.
"""

from typing import NamedTuple

import numpy as np

from scenario_gen.closed_loop.coordination_space import World
from scenario_gen.numerics import Bools, Floats
from scenario_gen.numerics.kernels import kernel

PARTS = 4  # of a step, in each of which the order is proven


@kernel(inline=True)
def limit(order: Floats, cell: float, clock: float) -> float:
    """Clock [s] that one may not pass while the other's is at `clock`; order (K,) is that of the pair."""
    return float(max(clock, order[min(int(clock / cell), order.shape[0] - 1)]))


class Clocks(NamedTuple):
    """The clocks of N vehicles in a step, whose end is changed here.

    Attributes:
        goes: (N,) who is on the way.
        begin: (N,) certified times at the step's begin [s].
        rate: (N,) how fast these run then.
        end: (N,) at its end.
        end_rate: (N,) likewise.
        forced: (N,) 1 where one brakes as hard as it can, 2 where its way is cut.
    """

    goes: Bools
    begin: Floats
    rate: Floats
    end: Floats
    end_rate: Floats
    forced: Floats


@kernel(inline=True)
def _part(c: Clocks, i: int, h: float, part: float) -> float:
    """Clock i [s] at a share of a step of h [s]; its rate changes evenly, or it moves evenly where it was forced."""
    if c.forced[i] > 0.0 or part == 1.0:
        return float(c.begin[i] + part * (c.end[i] - c.begin[i]))
    return float(c.begin[i] + h * part * (c.rate[i] + 0.5 * part * (c.end_rate[i] - c.rate[i])))


@kernel(inline=True)
def _slope(c: Clocks, i: int, h: float, part: float) -> float:
    """Rate of clock i at a share of a step."""
    if c.forced[i] > 0.0:
        return float((c.end[i] - c.begin[i]) / h)
    return float(c.rate[i] + part * (c.end_rate[i] - c.rate[i]))


@kernel(inline=True)
def _ordered(world: World, c: Clocks, i: int, j: int) -> bool:
    """Whether vehicle i keeps to the order with j throughout the step, proven for each of its parts.

    In a part, either the clock of i ends no farther than it may while that of j is where it
    begins, for that limit only grows; or it stays behind the clock of j throughout: their
    difference is a parabola, least at an end or at its vertex.
    """
    h, cell, order = world.step, world.cell, world.order[i, j]
    a0, b0 = c.begin[i], c.begin[j]
    for k in range(PARTS):
        start, part = k / PARTS, (k + 1.0) / PARTS
        a, b = _part(c, i, h, part), _part(c, j, h, part)
        if a > limit(order, cell, b0):
            if b0 < a0 or b < a:
                return False
            first = _slope(c, j, h, start) - _slope(c, i, h, start)
            last = _slope(c, j, h, part) - _slope(c, i, h, part)
            if (
                first < 0.0 < last
                and b0 - a0 - 0.5 * first * first / (last - first) * h / PARTS < 0.0
            ):
                return False
        a0, b0 = a, b
    return True


@kernel(inline=True)
def keep_order(world: World, c: Clocks) -> None:
    """Hold back who would come to a place before its turn; the ego is not held back.

    First at the rate of the one it waits for, then at once, evenly to where the order ends its way
    at the step's begin: that is allowed whatever the other does. Holding one back may hold back
    others, but the way of each is cut only once.
    """
    n, h, ego = c.begin.shape[0], world.step, world.ego
    wanted, wanted_rate = c.end.copy(), c.end_rate.copy()
    changed = True
    while changed:
        changed = False
        for i in range(n):
            for j in range(n):
                if (
                    i in (j, ego)
                    or j == ego
                    or not c.goes[i]
                    or not c.goes[j]
                    or c.forced[i] > 1.0
                ):
                    continue
                if _ordered(world, c, i, j):
                    continue
                changed = True
                if c.end_rate[i] > c.end_rate[j] > 0.0 and c.forced[i] == 0.0:
                    c.end_rate[i] = c.end_rate[j]
                    c.end[i] = c.begin[i] + 0.5 * (c.rate[i] + c.end_rate[i]) * h
                    if _ordered(world, c, i, j):
                        continue
                room = np.inf
                for k in range(n):
                    if k not in (i, ego) and c.goes[k]:
                        room = min(
                            room, limit(world.order[i, k], world.cell, c.begin[k]) - c.begin[i]
                        )
                c.end[i] = c.begin[i] + max(min(c.end[i] - c.begin[i], room), 0.0)
                c.end_rate[i] = min(c.end_rate[i], (c.end[i] - c.begin[i]) / h)
                c.forced[i] = 2.0
    _go_together(world, c, wanted, wanted_rate)


@kernel(inline=True)
def _go_together(world: World, c: Clocks, wanted: Floats, wanted_rate: Floats) -> None:
    """Let those with the earliest clock go on, evenly and with one clock, if the order held them back only for each other.

    That is always allowed, up to the next later clock: on one clock they are certified, and nobody
    is behind them. Without it they could stand for ever: each alone may not leave the others
    behind, and a whole step would take them beyond the next one.
    """
    n, h, ego = c.begin.shape[0], world.step, world.ego
    least, later = np.inf, np.inf
    for i in range(n):
        if i != ego and c.goes[i] and c.begin[i] < least:
            least, later = c.begin[i], least
        elif i != ego and c.goes[i] and least < c.begin[i] < later:
            later = c.begin[i]
    held = np.empty(n, dtype=np.bool_)
    for i in range(n):
        held[i] = (
            i != ego
            and c.goes[i]
            and c.begin[i] == least
            and c.end[i] == least
            and wanted[i] > least
        )
    changed, until = True, least
    while changed:
        changed, until = False, later
        for i in range(n):
            if held[i]:
                until = min(until, wanted[i])
        for i in range(n):
            for j in range(n):
                at_once = (
                    held[i] and not held[j] and j != ego and c.goes[j] and c.begin[j] == least
                )
                if at_once and until > limit(world.order[i, j], world.cell, least):
                    held[i], changed = False, True
    for i in range(n):
        if held[i]:
            c.end[i] = until
            c.end_rate[i] = min(wanted_rate[i], (until - least) / h)
            c.forced[i] = 2.0
