# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One driver's speed: how it changes in a step, and how it brakes behind who is ahead on its path."""

from typing import NamedTuple

import numpy as np

from scenario_gen.closed_loop.coordination_space import pose_at, World
from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.boxes import boxes_meet, fill_box
from scenario_gen.numerics.kernels import B, F, F1, I1, kernel, named

AHEAD = 60.0  # metres of its path that it looks along for who is ahead
HALVINGS = 4  # of a cell in which a vehicle meets what is ahead
FREE = -1e3  # m/s²; a braking that does not hinder at all
STAND = 0.02  # m/s, certified speed of a stand, which passes whatever there is
NEARER = 0.1  # metres by which a gap must be smaller than the certified one to be minded


CLOCK, RATE, ACCELERATION, WAITED, HELD = range(5)
"""Columns of what drivers do in a step: `State`'s and, after it, 1 where the order held one back."""
EGO_CLOCK, EGO_RATE, ON_PATH = range(6, 9)
"""Columns of `State.seen` behind those of `EgoState`."""


class DriverState(NamedTuple):
    """A driver at the begin of a step: which, its clock [s], the clock's rate and its acceleration in the step before [m/s²]."""

    i: int
    clock: float
    rate: float
    was: float


class DriverParameters(NamedTuple):
    """How the others drive: fields of `ClosedLoopConfig`; how far they look ahead [s]; whether, and after (N,) how many steps.

    The strongest braking (N,) is that of each one's type, if less.
    """

    headway: float
    standstill: float
    acceleration: float
    comfortable: float
    strongest: Floats
    jerk: float
    patience: float
    foresight: float
    yields: bool
    reacts: bool
    delay: Ints


DRIVER_PARAMETERS = named(DriverParameters, F, F, F, F, F1, F, F, F, B, B, I1)


@kernel(inline=True)
def _eased(short: float, jerk: float, h: float) -> float:
    """Largest change of speed [m/s²] towards a speed that is `short` [m/s] away, so that the jerk lets it end evenly there."""
    if short <= 0.5 * jerk * h * h:
        return max(short, 0.0) / h
    return float(np.sqrt(2.0 * jerk * short)) - 0.5 * jerk * h


@kernel(inline=True)
def rate_after(
    parameters: DriverParameters,
    r: float,
    v: float,
    a: float,
    was: float,
    braking: float,
    floor: float,
    h: float,
) -> float:
    """Rate of a clock after a step in which its driver brakes, as far as its foot gets: acceleration changes by the jerk at most.

    With nothing in the way the rate goes back to 1; at 1 the motion is the certified one, whatever
    jerk that has.

    Args:
        parameters: how it drives.
        r: rate of its clock; its speed is r v.
        v: certified speed there [m/s].
        a: certified acceleration there [m/s²].
        was: its acceleration in the step before [m/s²].
        braking: m/s²; below 0 it speeds up by no more than that, FREE goes on.
        floor: m/s; braking ends there.
        h: the step [s].
    """
    if v < STAND:
        return 1.0
    u, jerk = r * v, parameters.jerk
    end = max(v + r * a * h, STAND)  # certified speed where the step ends, about
    on = 1.0
    if r < 1.0:
        gain = min(
            max(parameters.acceleration, r * r * a), r * a + _eased(v - u, jerk, h), was + jerk * h
        )
        on = min(max((u + gain * h) / end, 0.0), 1.0)
    if braking <= FREE:
        return on
    wanted = -min(braking, _eased(u - floor, jerk, h)) if u > floor or braking <= 0.0 else 0.0
    least = max(u + max(wanted, was - jerk * h) * h, floor)
    first = min(least / end, on)
    return min(least / max(v + 0.5 * (r + first) * a * h, STAND), on)


@kernel(inline=True)
def gap_ahead(world: World, i: int, clock: float, box: Floats, here: Floats) -> tuple[float, int]:
    """Way [m] that vehicle i can drive on its path from a clock until it meets a box (7,), and the cell of its clock there.

    Infinity and -1 if it does not within AHEAD, or if the box lies behind it; `here` is its pose
    (5,).
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
            low, high = max(k * cell, clock), (k + 1) * cell
            pose, mine = np.empty(5), np.empty(7)
            for _ in range(
                HALVINGS
            ):  # where in the cell, so that the gap does not change by leaps
                middle = 0.5 * (low + high)
                pose_at(world.time, world.motion[i], middle, pose)
                fill_box(pose[0], pose[1], pose[2], world.half[i, 0], world.half[i, 1], mine)
                if boxes_meet(mine, box):
                    high = middle
                else:
                    low = middle
            end = cells[k + 1, 7] if k + 1 < count else cells[k, 7]
            way = cells[k, 7] + (end - cells[k, 7]) * (high / cell - k)
            return float(max(way - start, 0.0)), k
    return np.inf, -1


@kernel(inline=True)
def _idm(gap: float, u: float, ahead: float, parameters: DriverParameters) -> float:
    """Braking [m/s²] behind one at `gap` [m] whose speed along the path is `ahead` [m/s]; none where the gap is wide enough.

    Source: intelligent driver model, Treiber, Hennecke & Helbing 2000; its braking term, for the
        free one is the certificate.
    """
    a, b = parameters.acceleration, parameters.comfortable
    wanted = parameters.standstill + max(
        0.0, u * parameters.headway + u * (u - ahead) / (2.0 * np.sqrt(a * b))
    )
    share = wanted / max(gap, 0.1)
    return float(min(max(a * (share * share - 1.0), 0.0), b))


@kernel(inline=True)
def minded(
    world: World,
    parameters: DriverParameters,
    me: DriverState,
    pose: Floats,
    j: int,
    box: Floats,
    speed: float,
    later: float,
) -> float:
    """Braking [m/s²] of a driver at its certified pose (5,) for j, whose box (7,) and speed [m/s] are given, if on its path.

    FREE if j is no nearer than in the certified execution at the same clock; `later` [s] than its
    own is what is given of j.
    """
    i, clock = me.i, me.clock
    gap, at = gap_ahead(world, i, clock, box, pose)
    if at < 0:
        return FREE
    ahead = speed * max(box[2] * world.cells[i, at, 2] + box[3] * world.cells[i, at, 3], 0.0)
    braking = _idm(gap, me.rate * pose[3], ahead, parameters)
    if braking <= 0.0:
        return FREE
    certain, there = np.empty(5), np.empty(7)
    pose_at(world.time, world.motion[j], clock + later, certain)
    fill_box(certain[0], certain[1], certain[2], world.half[j, 0], world.half[j, 1], there)
    usual, _ = gap_ahead(world, i, clock, there, pose)
    return braking if gap < usual - NEARER else FREE
