# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Who is on foot, before it steps onto a lane: it waits at the kerb for an ego that would meet it and cannot stop before it.

It waits, too, where the template waited for the ego. Once it is on the lane it goes on. It looks
before it steps, so no reaction time passes, and it stops late, as walkers do, not from afar as
drivers do.
"""

import numpy as np

from scenario_gen.closed_loop.coordination_space import pose_at, World
from scenario_gen.closed_loop.driver import (
    DriverParameters,
    DriverState,
    EGO_CLOCK,
    EGO_RATE,
    FREE,
    ON_PATH,
    rate_after,
)
from scenario_gen.closed_loop.foresight import Foreseen, LATE, SPARE
from scenario_gen.closed_loop.order import limit
from scenario_gen.numerics import Floats
from scenario_gen.numerics.boxes import boxes_meet, fill_box
from scenario_gen.numerics.kernels import kernel

RESPONSE = 1.0  # seconds until an ego brakes comfortably for one who steps onto its lane
TOO_FAST = 1.05  # times its witness' speed, from which on an ego is not expected to slow down where that one does
STOPS = 1.5  # m/s² with which one on foot stops at the kerb: from 1.4 m/s within a step of 0.7 m


@kernel(inline=True)
def _next_kerb(world: World, me: DriverState) -> float:
    """Clock [s] at which one next steps onto a lane; no later than now if it is on one."""
    kerbs = world.kerbs[me.i]
    return float(kerbs[min(int(me.clock / world.cell), kerbs.shape[0] - 1)])


@kernel(inline=True)
def _cell(world: World, clock: float) -> int:
    """The cell that begins at a clock [s]."""
    return int(clock / world.cell + 0.5)


@kernel(inline=True)
def before_kerb(world: World, me: DriverState) -> bool:
    """Whether one is on foot and has not stepped yet onto the lane that it comes to."""
    return me.clock + 1e-9 < _next_kerb(world, me) < np.inf


@kernel(inline=True)
def foresee_fast_ego(world: World, seen: Floats, out: Floats) -> None:
    """Change `out` (M, 4), the ego as `foresee_ego` has it, if it is faster on its witness' path: it keeps its speed there.

    Args:
        world: the scenario.
        seen: (9,) the ego as in `State.seen`, at the end of this step.
        out: (M, 4).
    """
    if seen[ON_PATH] == 0.0 or seen[EGO_RATE] <= TOO_FAST:
        return
    way, pose, k = world.cells[world.ego, :, 7], np.empty(5), int(seen[EGO_CLOCK] / world.cell)
    last = way.shape[0] - 1
    k = min(k, last)
    driven = way[k] + (way[min(k + 1, last)] - way[k]) * (seen[EGO_CLOCK] / world.cell - k)
    for m in range(1, out.shape[0]):
        driven += seen[3] * world.step
        while k < last and way[k + 1] <= driven:
            k += 1
        share = (driven - way[k]) / (way[k + 1] - way[k]) if k < last else 0.0
        pose_at(world.time, world.motion[world.ego], (k + share) * world.cell, pose)
        out[m, :3], out[m, 3] = pose[:3], seen[3]


@kernel(inline=True)
def beyond_kerb(world: World, me: DriverState, foreseen: Foreseen) -> Foreseen:
    """What one expects who waits for the ego at the kerb, not where the order ends its way on the lane."""
    rate = -1.0 if before_kerb(world, me) else foreseen.rate
    return Foreseen(
        foreseen.ego, foreseen.clock, rate, foreseen.coming, foreseen.aside, foreseen.heeds
    )


@kernel(inline=True)
def braking_at_kerb(
    world: World, parameters: DriverParameters, me: DriverState, pose: Floats, foreseen: Foreseen
) -> float:
    """Braking [m/s²] of one before the kerb, at its certified pose (5,); FREE if it need not wait, or not brake yet."""
    if not _must_wait(world, parameters, me, foreseen):
        return FREE
    way, cell, k, onto = (
        world.cells[me.i, :, 7],
        world.cell,
        int(me.clock / world.cell),
        _cell(world, _next_kerb(world, me)),
    )
    walked = way[k] + (way[k + 1] - way[k]) * (me.clock / cell - k)
    room, u = way[onto] - walked - SPARE, me.rate * pose[3]
    reached = min(u + parameters.acceleration * world.step, pose[3])
    if room > reached * world.step + reached * reached / (2.0 * STOPS):
        return FREE
    return float(min(u * u / (2.0 * max(room, 0.01)), parameters.strongest[me.i]))


@kernel(inline=True)
def _must_wait(
    world: World, parameters: DriverParameters, me: DriverState, foreseen: Foreseen
) -> bool:
    """Whether one that goes on would go before an ego that the template let pass, or meet one that cannot stop."""
    h, order, half, ego = world.step, world.order[me.i, world.ego], world.half, world.ego
    pose, mine, its = np.empty(5), np.empty(7), np.empty(7)
    t, r, was, meets = me.clock, me.rate, me.was, False
    pose_at(world.time, world.motion[me.i], t, pose)
    for m in range(foreseen.ego.shape[0] - 1):
        u = r * pose[3]
        after = rate_after(parameters, r, pose[3], pose[4], was, FREE, 0.0, h)
        t += 0.5 * (r + after) * h
        r = after
        pose_at(world.time, world.motion[me.i], t, pose)
        was = (r * pose[3] - u) / h
        if (
            parameters.yields
            and foreseen.rate >= 0.0
            and t > limit(order, world.cell, foreseen.clock + foreseen.rate * m * h) + LATE
        ):
            return True
        there, aside = foreseen.ego[m], foreseen.aside
        fill_box(pose[0], pose[1], pose[2], half[me.i, 0] + aside, half[me.i, 1] + aside, mine)
        fill_box(there[0], there[1], there[2], half[ego, 0], half[ego, 1], its)
        meets = meets or boxes_meet(mine, its)
    return meets and not _stops(world, parameters, me, foreseen)


@kernel(inline=True)
def _stops(
    world: World, parameters: DriverParameters, me: DriverState, foreseen: Foreseen
) -> bool:
    """Whether the ego, where it is foreseen to drive, stops comfortably before the way of one on foot across the lane."""
    there, box, cells, half = foreseen.ego, np.empty(7), world.cells[me.i], world.half[world.ego]
    speed, way, onto = there[0, 3], 0.0, _cell(world, _next_kerb(world, me))
    for m in range(there.shape[0]):
        if m > 0:
            way += np.hypot(there[m, 0] - there[m - 1, 0], there[m, 1] - there[m - 1, 1])
        if way > speed * RESPONSE + speed * speed / (2.0 * parameters.comfortable):
            return True
        fill_box(there[m, 0], there[m, 1], there[m, 2], half[0], half[1], box)
        for k in range(onto, cells.shape[0]):
            if world.kerbs[me.i, k] > (k + 0.5) * world.cell:
                break
            if boxes_meet(cells[k], box):
                return False
    return True
