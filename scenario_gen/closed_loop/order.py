# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The order of events of the certified execution: no vehicle reaches a place before its turn.

The page docs/closed_loop.md proves that the vehicles never collide and never wait in a circle.
"""

from typing import NamedTuple

import numpy as np

from scenario_gen.closed_loop.coordination_space import World
from scenario_gen.numerics import Bools, Floats
from scenario_gen.numerics.kernels import kernel

SUBSTEP_COUNT = 4  # parts of a step, in each of which the order is proven


@kernel(inline=True, forced=True)
def clock_limit(order: Floats, cell: float, clock: float) -> float:
    """Return the clock [s] that a vehicle may not pass while another clock is at `clock` [s].

    The order (K,) is that of the pair.
    """
    return float(max(clock, order[min(int(clock / cell), order.shape[0] - 1)]))


class Clocks(NamedTuple):
    """The clocks of N vehicles in a step; this module changes their ends.

    Attributes:
        moving: (N,) whether a vehicle is on its way.
        begin: (N,) certified times at the start of the step [s].
        rate: (N,) rates at the start.
        end: (N,) certified times at the end [s].
        end_rate: (N,) rates at the end.
        cut: (N,) whether the order shortened the way in this step. Then the clock runs evenly.
    """

    moving: Bools
    begin: Floats
    rate: Floats
    end: Floats
    end_rate: Floats
    cut: Bools


@kernel(inline=True, forced=True)
def _clock_at(c: Clocks, i: int, h: float, part: float) -> float:
    """Return clock i [s] at a share of a step of h [s]; its rate changes evenly."""
    if c.cut[i] or part == 1.0:
        return float(c.begin[i] + part * (c.end[i] - c.begin[i]))
    return float(c.begin[i] + h * part * (c.rate[i] + 0.5 * part * (c.end_rate[i] - c.rate[i])))


@kernel(inline=True, forced=True)
def _rate_at(c: Clocks, i: int, h: float, part: float) -> float:
    """Return the rate of clock i at a share of a step of h [s]."""
    if c.cut[i]:
        return float((c.end[i] - c.begin[i]) / h)
    return float(c.rate[i] + part * (c.end_rate[i] - c.rate[i]))


@kernel(inline=True, forced=True)
def _keeps_order(world: World, c: Clocks, i: int, j: int) -> bool:
    """Return whether vehicle i respects its order with j throughout the step.

    This is proven for each part of the step. Either clock i ends before its limit at the start of
    the part: the limit never decreases. Or clock i stays behind clock j: their difference is a
    parabola, whose minimum is at an end or at the vertex.
    """
    h = world.step
    a0 = c.begin[i]
    b0 = c.begin[j]
    for k in range(SUBSTEP_COUNT):
        start = k / SUBSTEP_COUNT
        end = (k + 1.0) / SUBSTEP_COUNT
        a = _clock_at(c, i, h, end)
        b = _clock_at(c, j, h, end)
        if a > clock_limit(world.order[i, j], world.cell, b0):
            if b0 < a0 or b < a:
                return False
            first = _rate_at(c, j, h, start) - _rate_at(c, i, h, start)
            last = _rate_at(c, j, h, end) - _rate_at(c, i, h, end)
            has_vertex = first < 0.0 < last
            if has_vertex and (
                b0 - a0 - 0.5 * first * first / (last - first) * h / SUBSTEP_COUNT < 0.0
            ):
                return False
        a0 = a
        b0 = b
    return True


@kernel(inline=True, forced=True)
def _match_rate(world: World, c: Clocks, i: int, j: int) -> bool:
    """Slow vehicle i down to the rate of j; return whether the order is respected then."""
    if not c.end_rate[i] > c.end_rate[j] > 0.0:
        return False
    c.end_rate[i] = c.end_rate[j]
    c.end[i] = c.begin[i] + 0.5 * (c.rate[i] + c.end_rate[i]) * world.step
    return bool(_keeps_order(world, c, i, j))


@kernel(inline=True)
def _cut_way(world: World, c: Clocks, i: int) -> None:
    """Stop vehicle i at its limits at the start of the step, which are safe in any case."""
    room = np.inf
    for k in range(c.begin.shape[0]):
        if k not in (i, world.ego) and c.moving[k]:
            limit = clock_limit(world.order[i, k], world.cell, c.begin[k])
            room = min(room, limit - c.begin[i])
    c.end[i] = c.begin[i] + max(min(c.end[i] - c.begin[i], room), 0.0)
    c.end_rate[i] = min(c.end_rate[i], (c.end[i] - c.begin[i]) / world.step)
    c.cut[i] = True


@kernel(inline=True, forced=True)
def _hold_back(world: World, c: Clocks, i: int) -> bool:
    """Slow vehicle i down where it violates its order; return whether anything changed."""
    changed = False
    for j in range(c.begin.shape[0]):
        if j in (i, world.ego) or not c.moving[j] or _keeps_order(world, c, i, j):
            continue
        changed = True
        if not _match_rate(world, c, i, j):
            _cut_way(world, c, i)
            break
    return changed


@kernel(inline=True)
def enforce_order(world: World, c: Clocks) -> None:
    """Hold back vehicles that would reach a place before their turn, except the ego.

    A vehicle is first slowed down to the rate of the one it waits for. If that does not suffice,
    its way is cut where the order ends it at the start of the step: that is safe whatever the
    other one does. A held vehicle may hold back others, but each way is cut only once.
    """
    wanted = c.end.copy()
    wanted_rate = c.end_rate.copy()
    changed = True
    while changed:
        changed = False
        for i in range(c.begin.shape[0]):
            if i != world.ego and c.moving[i] and not c.cut[i]:
                changed = _hold_back(world, c, i) or changed
    _advance_together(world, c, wanted, wanted_rate)


@kernel(inline=True)
def _earliest_clocks(world: World, c: Clocks) -> tuple[float, float]:
    """Return the earliest clock and the next later one [s] of the moving vehicles."""
    earliest = np.inf
    later = np.inf
    for i in range(c.begin.shape[0]):
        if i == world.ego or not c.moving[i]:
            continue
        if c.begin[i] < earliest:
            later = earliest
            earliest = c.begin[i]
        elif earliest < c.begin[i] < later:
            later = c.begin[i]
    return earliest, later


@kernel(inline=True, forced=True)
def _blocked(world: World, c: Clocks, group: Bools, i: int, until: float) -> bool:
    """Return whether a vehicle with the same clock, outside the group (N,), stops vehicle i."""
    clock = c.begin[i]
    for j in range(c.begin.shape[0]):
        outside = not group[j] and j != world.ego and c.moving[j] and c.begin[j] == clock
        if outside and until > clock_limit(world.order[i, j], world.cell, clock):
            return True
    return False


@kernel(inline=True)
def _common_end(c: Clocks, group: Bools, wanted: Floats, later: float) -> float:
    """Return the latest clock [s] that all vehicles of a group (N,) want to reach."""
    until = later
    for i in range(c.begin.shape[0]):
        if group[i]:
            until = min(until, wanted[i])
    return until


@kernel(inline=True)
def _advance_together(world: World, c: Clocks, wanted: Floats, wanted_rate: Floats) -> None:
    """Advance the vehicles with the earliest clock that stand only because of each other.

    They move evenly on a common clock, up to the next later clock. That is always safe: with equal
    clocks they are certified, and no vehicle is behind them. Otherwise they could stand forever,
    because none may leave the others behind, and a whole step would pass the next clock.
    """
    n = c.begin.shape[0]
    earliest, later = _earliest_clocks(world, c)
    group = np.empty(n, dtype=np.bool_)
    for i in range(n):
        stands = c.begin[i] == earliest and c.end[i] == earliest
        group[i] = i != world.ego and c.moving[i] and stands and wanted[i] > earliest
    until = earliest
    changed = True
    while changed:
        changed = False
        until = _common_end(c, group, wanted, later)
        for i in range(n):
            if group[i] and _blocked(world, c, group, i, until):
                group[i] = False
                changed = True
    for i in range(n):
        if group[i]:
            c.end[i] = until
            c.end_rate[i] = min(wanted_rate[i], (until - earliest) / world.step)
            c.cut[i] = True
