# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One driver's speed: how it changes in a step, and how it brakes behind who is ahead on its path."""

from typing import NamedTuple

import numpy as np

from scenario_gen.closed_loop.certified import boxes_meet, fill_box, pose_at, World
from scenario_gen.numerics import Floats
from scenario_gen.numerics.kernels import kernel

AHEAD = 60.0  # metres of its path that it looks along for who is ahead
SLOW = 0.2  # m/s, certified speed below which a clock runs or stands, for there is nothing to brake
STAND = 0.02  # m/s, certified speed of a stand, which passes whatever there is
NEARER = 0.1  # metres by which a gap must be smaller than the certified one to be minded


class Manner(NamedTuple):
    """How the others drive: fields of `ClosedLoopConfig`."""

    headway: float
    standstill: float
    acceleration: float
    comfortable: float
    strongest: float
    yields: bool


@kernel(inline=True)
def _going_on(r: float, v: float, a: float, taking_up: float, h: float) -> float:
    """Rate after a step with nothing in the way: back to 1, with the given acceleration at most."""
    if v < SLOW:
        return 1.0
    return min(r + max((taking_up - r * r * a) / v, 0.0) * h, 1.0)


@kernel(inline=True)
def rate_after(r: float, v: float, a: float, braking: float, taking_up: float, h: float) -> float:
    """Rate after a step of braking [m/s²]; at rate r the speed is r v, and its change v dr/dt + r² a."""
    on = _going_on(r, v, a, taking_up, h)
    if braking <= 0.0:
        return on
    if v < SLOW:
        return 1.0 if v < STAND else 0.0
    return min(max(r + (-braking - r * r * a) / v * h, 0.0), on)


@kernel(inline=True)
def gap_ahead(world: World, i: int, clock: float, box: Floats, here: Floats) -> tuple[float, int]:
    """Way [m] that vehicle i can drive on its path from a clock until it meets a box (7,), and the cell of its clock there.

    Infinity and -1 if it does not within AHEAD, or if the box lies behind it; `here` is its pose (5,).
    """
    cells, cell = world.cells[i], world.cell
    count = cells.shape[0]
    first = min(int(clock / cell), count - 1)
    after = cells[first + 1, 7] if first + 1 < count else cells[first, 7]
    start = cells[first, 7] + (after - cells[first, 7]) * min(clock / cell - first, 1.0)
    for k in range(first, count):
        if cells[k, 7] - start > AHEAD:
            break
        if boxes_meet(cells[k], box):
            c, s = cells[first, 2], cells[first, 3]
            if (box[0] - here[0]) * c + (box[1] - here[1]) * s <= 0.0:
                break
            return float(max(cells[k, 7] - start, 0.0)), k
    return np.inf, -1


@kernel(inline=True)
def _idm(gap: float, u: float, ahead: float, manner: Manner) -> float:
    """Braking [m/s²] behind one at `gap` [m] whose speed along the path is `ahead` [m/s]; none where the gap is wide enough.

    Source: intelligent driver model, Treiber, Hennecke & Helbing 2000; its braking term, for the free one is the certificate.
    """
    a, b = manner.acceleration, manner.comfortable
    wanted = manner.standstill + max(0.0, u * manner.headway + u * (u - ahead) / (2.0 * np.sqrt(a * b)))
    share = wanted / max(gap, 0.1)
    return float(min(max(a * (share * share - 1.0), 0.0), b))


@kernel(inline=True)
def minded(
    world: World, manner: Manner, i: int, j: int, clock: float, u: float, pose: Floats, box: Floats, speed: float, later: float
) -> float:
    """Braking [m/s²] of vehicle i, at speed u [m/s], for j, whose box and speed are given, if it is on its path.

    None if j is no nearer than in the certified execution at the same clock; `later` [s] than that of i is what is given of j.
    """
    gap, at = gap_ahead(world, i, clock, box, pose)
    if at < 0:
        return 0.0
    ahead = speed * max(box[2] * world.cells[i, at, 2] + box[3] * world.cells[i, at, 3], 0.0)
    braking = _idm(gap, u, ahead, manner)
    if braking <= 0.0:
        return 0.0
    certain, there = np.empty(5), np.empty(7)
    pose_at(world.time, world.motion[j], clock + later, certain)
    fill_box(certain[0], certain[1], certain[2], world.half[j, 0], world.half[j, 1], there)
    usual, _ = gap_ahead(world, i, clock, there, pose)
    return braking if gap < usual - NEARER else 0.0
