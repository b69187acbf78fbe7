# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The others in one step: how fast each clock runs, so that they stay clear of the ego and never meet each other.

Each vehicle keeps its certified path and never exceeds its certified speed there: its clock runs
at a rate of 0 to 1. Three things slow it down, the strongest counts:

- who is ahead on its path, the ego included (IDM), but only if nearer than in the certified
  execution at the same place;
- the weakest braking that keeps it clear of where the ego will be if it goes on as it does, and
  behind what the order of events lets it do; its acceleration changes by the jerk at most;
- the order itself, without exception: see order.py.

Each driver sees the ego as it was one reaction time ago, and goes before one that stands when it
has waited long enough. Who is on foot goes on whatever the ego does, but does not step onto a lane
before one that cannot stop: see kerb.py.
"""

from typing import NamedTuple

import numpy as np

from scenario_gen.closed_loop.coordination_space import pose_at, World
from scenario_gen.closed_loop.driver import (
    ACCELERATION,
    CLOCK,
    DriverParameters,
    DriverState,
    EGO_CLOCK,
    EGO_RATE,
    FREE,
    gap_ahead,
    HELD,
    minded,
    ON_PATH,
    RATE,
    rate_after,
    STAND,
    WAITED,
)
from scenario_gen.closed_loop.foresight import foresee_ego, foresee_self, Foreseen, weakest
from scenario_gen.closed_loop.kerb import (
    before_kerb,
    beyond_kerb,
    braking_at_kerb,
    foresee_fast_ego,
)
from scenario_gen.closed_loop.order import Clocks, keep_order, limit
from scenario_gen.numerics import Bools, Floats, Ints
from scenario_gen.numerics.boxes import boxes_meet, fill_box
from scenario_gen.numerics.kernels import kernel

CREEP = 0.5  # m/s; the foresight lets everyone creep, so that nobody waits for one who waits for it; who is slower waits
BEHIND = 1.0  # seconds that the order must leave to one so that it does not wait for another
APPROACH = 1.0  # seconds in which a creeping driver would drive what the order leaves it
CREEPS = 1.5  # m/s below which the ego is seen to hold up who waits for it
ASIDE = 0.5  # metres that a driver leaves beside an ego that is not on its way
ENTRY = 3.0  # metres ahead of and behind its place that the ego must leave free for one who comes onto the scene


class StepState(NamedTuple):
    """All vehicles at the begin of a step, and what their drivers expect.

    Attributes:
        drivers: (N, 4) clock [s], its rate, acceleration [m/s²] and patience spent [s], as in
            `State`.
        pose: (N, 5) x, y [m], yaw [rad], certified speed [m/s] and acceleration [m/s²] there.
        goes: (N,) whose clock runs.
        here: (N,) who is on the scene.
        seen: (K, 9) the ego as in `State.seen`, at the end of the step and before.
        delay: (N,) reaction time of each driver in steps.
        ahead: (N, M, 4) the ego as each driver expects it, as in `Foreseen`.
        coming: (N, M) clocks of all, as in `Foreseen`.
    """

    drivers: Floats
    pose: Floats
    goes: Bools
    here: Bools
    seen: Floats
    delay: Ints
    ahead: Floats
    coming: Floats


@kernel(inline=True)
def react(
    world: World, parameters: DriverParameters, seen: Floats, drivers: Floats, after: Floats
) -> None:
    """Write what becomes of all drivers in a step; the row of the ego is left to the caller.

    Args:
        world: the scenario and the step.
        parameters: how they drive.
        seen: (K, 9) the ego as in `State.seen`, at the end of this step and before.
        drivers: (N, 4) as in `StepState`.
        after: (N, 5) clock [s], rate, acceleration that the driver wanted [m/s²], patience spent
            [s], and 1 where the order held it back.
    """
    n = drivers.shape[0]
    now = _begin(world, parameters, drivers, seen)
    level, rate = np.full(n, FREE), drivers[:, RATE].copy()
    _regard_ego(world, parameters, now, level, rate, after)
    if n > 2:
        for i in range(n):
            if i != world.ego and now.goes[i]:
                foresee_self(world, parameters, _me(now, i), level[i], now.coming[i])
        for i in range(n):
            if i != world.ego and now.here[i]:
                rate[i] = _regard_others(
                    world, parameters, now, i, level[i], rate[i], after[i, WAITED]
                )
    _move(world, now, rate, after)


@kernel(inline=True)
def _begin(world: World, parameters: DriverParameters, drivers: Floats, seen: Floats) -> StepState:
    """Where everyone is."""
    n, steps = drivers.shape[0], int(np.ceil(parameters.foresight / world.step))
    pose, goes, here = np.empty((n, 5)), np.empty(n, dtype=np.bool_), np.empty(n, dtype=np.bool_)
    for i in range(n):
        clock = drivers[i, CLOCK]
        goes[i] = not (world.leaves[i] and clock >= world.spans[i, 1])
        here[i] = goes[i] and clock >= world.spans[i, 0]
        pose_at(world.time, world.motion[i], clock, pose[i])
    coming = np.empty((n, steps + 1))
    for m in range(steps + 1):
        coming[:, m] = drivers[:, CLOCK] + m * world.step  # of those who have left
    return StepState(
        drivers, pose, goes, here, seen, parameters.delay, np.empty((n, steps + 1, 4)), coming
    )


@kernel(inline=True)
def _me(now: StepState, i: int) -> DriverState:
    return DriverState(
        i, now.drivers[i, CLOCK], now.drivers[i, RATE], now.drivers[i, ACCELERATION]
    )


@kernel(inline=True)
def _come(world: World, seen: Floats, clock: float, rate: float, i: int) -> float:
    """Rate of one who is not on the scene yet: it comes when it is due, unless the ego is in its place."""
    if clock + 0.5 * (rate + 1.0) * world.step < world.spans[i, 0]:
        return 1.0
    pose, place, box, half = np.empty(5), np.empty(7), np.empty(7), world.half[i]
    pose_at(world.time, world.motion[i], world.spans[i, 0], pose)
    fill_box(pose[0], pose[1], pose[2], half[0] + ENTRY, half[1], place)
    _fill_ego(world, seen, box)
    return 0.0 if boxes_meet(place, box) else 1.0


@kernel(inline=True)
def _fill_ego(world: World, pose: Floats, out: Floats) -> None:
    """Write the box (7,) of the ego at a pose (x, y, yaw, …)."""
    fill_box(pose[0], pose[1], pose[2], world.half[world.ego, 0], world.half[world.ego, 1], out)


@kernel(inline=True)
def _expected(world: World, now: StepState, i: int, spent: float) -> Foreseen:
    """What driver i expects; it does not wait for the ego where the template did if its patience is spent for good."""
    ago = min(now.delay[i], now.seen.shape[0] - 1)
    ego = now.seen[ago]
    rate = ego[EGO_RATE] if ego[ON_PATH] > 0.0 and spent < np.inf else -1.0
    aside = ASIDE if ego[ON_PATH] == 0.0 and spent < np.inf else 0.0
    clock, walks = ego[EGO_CLOCK] + ego[EGO_RATE] * ago * world.step, world.walks[i]
    return Foreseen(now.ahead[i], clock, rate, now.coming, aside, not walks)


@kernel(inline=True)
def _spent(world: World, parameters: DriverParameters, now: StepState, i: int) -> float:
    """Patience [s] that driver i has spent waiting for an ego that hardly moves; infinity once it goes before the ego.

    That it does when its patience is over and its path is free of the ego, where it expects it to
    be now and as far as it looks.
    """
    spent: float = now.drivers[i, WAITED]
    u, box = now.drivers[i, RATE] * now.pose[i, 3], np.empty(7)
    if spent == np.inf:
        return spent
    if (
        u > CREEP
        or now.drivers[i, RATE] >= 1.0
        or now.pose[i, 3] < STAND
        or now.ahead[i, 0, 3] > CREEPS
    ):
        return 0.0
    spent += world.step
    for m in (0, now.ahead.shape[1] - 1):
        _fill_ego(world, now.ahead[i, m], box)
        _, at = gap_ahead(world, i, now.drivers[i, CLOCK], box, now.pose[i])
        if spent < parameters.patience or at >= 0:
            return spent
    return float(np.inf)


@kernel(inline=True)
def _regard_ego(
    world: World,
    parameters: DriverParameters,
    now: StepState,
    level: Floats,
    rate: Floats,
    after: Floats,
) -> None:
    """Write each driver's braking with regard to the ego alone [m/s²], its rate after the step, and its patience spent."""
    last, box = -1, np.empty(7)
    for i in range(level.shape[0]):
        after[i, WAITED] = now.drivers[i, WAITED]
        if i == world.ego or not now.goes[i]:
            continue
        if not now.here[i]:
            rate[i] = _come(world, now.seen[0], now.drivers[i, CLOCK], rate[i], i)
            continue
        ago, me, ahead = min(now.delay[i], now.seen.shape[0] - 1), _me(now, i), now.ahead[i]
        if last >= 0 and now.delay[last] == now.delay[i]:
            now.ahead[i] = now.ahead[last]
        else:
            foresee_ego(world, now.seen[ago], ago, ahead)
        last = last if world.walks[i] else i  # one on foot expects something else
        after[i, WAITED] = _spent(world, parameters, now, i)
        v, a = now.pose[i, 3], now.pose[i, 4]
        _fill_ego(world, ahead[0], box)
        least = minded(world, parameters, me, now.pose[i], world.ego, box, ahead[0, 3], world.step)
        level[i] = _for_ego(world, parameters, now, i, least, after[i, WAITED])
        rate[i] = rate_after(parameters, me.rate, v, a, me.was, level[i], 0.0, world.step)


@kernel(inline=True)
def _for_ego(
    world: World, parameters: DriverParameters, now: StepState, i: int, least: float, spent: float
) -> float:
    """Braking [m/s²] of driver i for the ego, `least` or more."""
    me, expected = _me(now, i), _expected(world, now, i, spent)
    if before_kerb(world, me):
        foresee_fast_ego(world, now.seen[0], now.ahead[i])
        return max(least, braking_at_kerb(world, parameters, me, now.pose[i], expected))
    return weakest(world, parameters, me, least, expected, False)


@kernel(inline=True)
def _regard_others(
    world: World,
    parameters: DriverParameters,
    now: StepState,
    i: int,
    level: float,
    rate: float,
    spent: float,
) -> float:
    """Rate of driver i after the step with regard to the others, too; `rate` is that with its braking for the ego, `level`."""
    me, v, a, box, least = _me(now, i), now.pose[i, 3], now.pose[i, 4], np.empty(7), level
    for j in range(now.pose.shape[0]):
        if j not in (i, world.ego) and now.here[j] and now.drivers[j, CLOCK] < me.clock:
            other, speed = now.pose[j], now.drivers[j, RATE] * now.pose[j, 3]
            fill_box(other[0], other[1], other[2], world.half[j, 0], world.half[j, 1], box)
            least = max(least, minded(world, parameters, me, now.pose[i], j, box, speed, 0.0))
    least = weakest(
        world, parameters, me, least, beyond_kerb(world, me, _expected(world, now, i, spent)), True
    )
    if least <= level:
        return rate
    return min(
        rate,
        rate_after(parameters, me.rate, v, a, me.was, least, _creep(world, now, i), world.step),
    )


@kernel(inline=True)
def _creep(world: World, now: StepState, i: int) -> float:
    """Speed [m/s] to which driver i brakes for the order at most.

    It creeps, so that nobody waits for one who waits for it. For one whose clock is behind and who
    does not wait for it, it comes to a stand where the order ends its way. The one with the
    earliest clock creeps in any case.
    """
    clock, speed = now.drivers[i, CLOCK], CREEP
    for j in range(now.pose.shape[0]):
        other = now.drivers[j, CLOCK]
        if j in (i, world.ego) or not now.goes[j] or other >= clock:
            continue
        if limit(world.order[j, i], world.cell, clock) > other + BEHIND:
            room = limit(world.order[i, j], world.cell, other) - clock
            speed = min(speed, max(room * now.pose[i, 3] / APPROACH, 0.0))
    return speed if speed > STAND else 0.0


@kernel(inline=True)
def _move(world: World, now: StepState, rate: Floats, after: Floats) -> None:
    """Move the clocks as the drivers want, as far as the order lets them."""
    n, h, clock, before = (
        rate.shape[0],
        world.step,
        now.drivers[:, CLOCK].copy(),
        now.drivers[:, RATE].copy(),
    )
    clocks = Clocks(now.goes, clock, before, clock.copy(), rate.copy(), np.zeros(n))
    for i in range(n):
        if i != world.ego and now.goes[i] and (now.here[i] or rate[i] > 0.0):
            clocks.end[i] = clock[i] + 0.5 * (before[i] + rate[i]) * h
    keep_order(world, clocks)
    for i in range(n):
        end = max(now.pose[i, 3] + before[i] * now.pose[i, 4] * h, 0.0)
        after[i, CLOCK] = min(clocks.end[i], world.time[-1]) if now.goes[i] else clocks.end[i]
        after[i, RATE], after[i, ACCELERATION] = (
            clocks.end_rate[i],
            (rate[i] * end - before[i] * now.pose[i, 3]) / h,
        )
        after[i, HELD] = 1.0 if clocks.end_rate[i] < rate[i] or clocks.forced[i] > 0.0 else 0.0
