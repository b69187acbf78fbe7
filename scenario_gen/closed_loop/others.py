# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The others in one step: how fast each clock runs, so that they stay clear of the ego and never meet each other.

Each vehicle keeps its certified path and never exceeds its certified speed there: its clock runs at a rate of 0 to 1. Three
things slow it down, the strongest counts:

- who is ahead on its path, the ego included (IDM), but only if nearer than in the certified execution at the same place;
- the weakest braking that keeps it clear of where the ego will be if it goes on as it does, and behind what the order of events
  lets it do;
- the order itself, without exception: see order.py.

Each driver sees the ego as it was one reaction time ago.
"""

from typing import NamedTuple

import numpy as np

from scenario_gen.closed_loop.certified import boxes_meet, fill_box, pose_at, World
from scenario_gen.closed_loop.driver import Manner, minded, rate_after
from scenario_gen.closed_loop.foresight import foresee_ego, FORESEEN, Foreseen, weakest
from scenario_gen.closed_loop.order import keep_order
from scenario_gen.numerics import Bools, Floats, Ints
from scenario_gen.numerics.kernels import kernel

CREEP = 0.5  # m/s; the foresight lets everyone creep, so that nobody waits for one who waits for it
ENTRY = 3.0  # metres ahead of and behind its place that the ego must leave free for one who comes onto the scene


class Now(NamedTuple):
    """All vehicles at the begin of a step.

    Attributes:
        clock: (N,) s.
        rate: (N,) of the clocks.
        pose: (N, 5) x, y [m], yaw [rad], certified speed [m/s] and acceleration [m/s²] there.
        goes: (N,) whose clock runs.
        here: (N,) who is on the scene.
    """

    clock: Floats
    rate: Floats
    pose: Floats
    goes: Bools
    here: Bools


@kernel(inline=True)
def react(
    world: World,
    manner: Manner,
    seen: Floats,
    delay: Ints,
    clock: Floats,
    rate: Floats,
    new_clock: Floats,
    new_rate: Floats,
    forced: Floats,
) -> None:
    """Write clocks and rates of all vehicles one step later; those of the ego stay as they are.

    Args:
        world: the scenario and the step.
        manner: how they drive.
        seen: (K, 9) the ego as in `State.seen`, at the end of this step and before.
        delay: (N,) reaction time of each driver in steps.
        clock: (N,) seconds.
        rate: (N,) rates of the clocks.
        new_clock: (N,) likewise, one step later.
        new_rate: (N,) likewise.
        forced: (N,) above 0 where the order stopped a vehicle at once.
    """
    n, h, ego = clock.shape[0], world.step, world.ego
    steps = int(np.ceil(FORESEEN / h))
    now = Now(clock, rate, np.empty((n, 5)), np.empty(n, dtype=np.bool_), np.empty(n, dtype=np.bool_))
    for i in range(n):
        now.goes[i] = not (world.leaves[i] and clock[i] >= world.spans[i, 1])
        now.here[i] = now.goes[i] and clock[i] >= world.spans[i, 0]
        new_clock[i], new_rate[i], forced[i] = clock[i], rate[i], 0.0
        pose_at(world.time, world.motion[i], clock[i], now.pose[i])
    level, ahead, coming = np.zeros(n), np.empty((n, steps + 1, 8)), np.empty((n, steps + 1))
    _regard_ego(world, manner, now, seen, delay, ahead, coming, level, new_rate)
    if n > 2:
        _foresee_others(h, now, new_rate, coming)
        for i in range(n):
            if i != ego and now.here[i]:
                ago = min(delay[i], seen.shape[0] - 1)
                foreseen = _expected(seen[ago], ago, h, ahead[i], coming)
                new_rate[i] = _regard_others(world, manner, now, i, level[i], foreseen, new_rate[i])
    for i in range(n):
        if i != ego and now.goes[i]:
            new_clock[i] = clock[i] + 0.5 * (rate[i] + new_rate[i]) * h
            if not now.here[i] and new_rate[i] == 0.0:
                new_clock[i] = clock[i]
    keep_order(world, now.goes, clock, rate, new_clock, new_rate, forced)
    for i in range(n):
        if i != ego and now.goes[i]:
            new_clock[i] = min(new_clock[i], world.time[-1])


@kernel(inline=True)
def _come(world: World, seen: Floats, clock: float, rate: float, i: int) -> float:
    """Rate of one who is not on the scene yet: it comes when it is due, unless the ego is in its place."""
    if clock + 0.5 * (rate + 1.0) * world.step < world.spans[i, 0]:
        return 1.0
    pose, place, box, half = np.empty(5), np.empty(7), np.empty(7), world.half
    pose_at(world.time, world.motion[i], world.spans[i, 0], pose)
    fill_box(pose[0], pose[1], pose[2], half[i, 0] + ENTRY, half[i, 1], place)
    fill_box(seen[0], seen[1], seen[2], half[world.ego, 0], half[world.ego, 1], box)
    return 0.0 if boxes_meet(place, box) else 1.0


@kernel(inline=True)
def _expected(seen: Floats, ago: int, h: float, ahead: Floats, coming: Floats) -> Foreseen:
    """What a driver expects who sees the ego as it was `ago` steps ago, which is `seen` (9,)."""
    rate = seen[7] if seen[8] > 0.0 else -1.0
    return Foreseen(ahead, seen[6] + seen[7] * ago * h, rate, coming)


@kernel(inline=True)
def _regard_ego(
    world: World,
    manner: Manner,
    now: Now,
    seen: Floats,
    delay: Ints,
    ahead: Floats,
    coming: Floats,
    level: Floats,
    new_rate: Floats,
) -> None:
    """Write what each driver expects of the ego into `ahead` (N, M, 8), its braking for it [m/s²], and its rate after the step."""
    last = -1
    for i in range(level.shape[0]):
        if i == world.ego or not now.goes[i]:
            continue
        if not now.here[i]:
            new_rate[i] = _come(world, seen[0], now.clock[i], now.rate[i], i)
            continue
        ago = min(delay[i], seen.shape[0] - 1)
        if last >= 0 and delay[last] == delay[i]:
            ahead[i] = ahead[last]
        else:
            foresee_ego(world, seen[ago], ago, ahead[i])
        last = i
        foreseen = _expected(seen[ago], ago, world.step, ahead[i], coming)
        v, a, box = now.pose[i, 3], now.pose[i, 4], ahead[i, 0]
        least = minded(world, manner, i, world.ego, now.clock[i], now.rate[i] * v, now.pose[i], box[:7], box[7], world.step)
        level[i] = weakest(world, manner, i, now.clock, now.rate, least, foreseen, False)
        new_rate[i] = rate_after(now.rate[i], v, a, level[i], manner.acceleration, world.step)


@kernel(inline=True)
def _foresee_others(h: float, now: Now, new_rate: Floats, coming: Floats) -> None:
    """Fill `coming` (N, M) with everyone's clocks if their rates go on changing as with regard to the ego alone."""
    for i in range(coming.shape[0]):
        r, change = now.rate[i], new_rate[i] - now.rate[i]
        coming[i, 0] = now.clock[i]
        for m in range(1, coming.shape[1]):
            after = min(max(now.rate[i] + change * m, 0.0), 1.0) if now.goes[i] else 1.0
            coming[i, m] = coming[i, m - 1] + 0.5 * (r + after) * h
            r = after


@kernel(inline=True)
def _regard_others(world: World, manner: Manner, now: Now, i: int, level: float, foreseen: Foreseen, rate: float) -> float:
    """Rate of driver i after the step with regard to the others, too; `rate` is that with its braking for the ego, `level`."""
    v, a, u, box, least = now.pose[i, 3], now.pose[i, 4], now.rate[i] * now.pose[i, 3], np.empty(7), level
    for j in range(now.clock.shape[0]):
        if j not in (i, world.ego) and now.here[j] and now.clock[j] < now.clock[i]:
            other = now.pose[j]
            fill_box(other[0], other[1], other[2], world.half[j, 0], world.half[j, 1], box)
            braking = minded(world, manner, i, j, now.clock[i], u, now.pose[i], box, now.rate[j] * other[3], 0.0)
            least = max(least, braking)
    least = weakest(world, manner, i, now.clock, now.rate, least, foreseen, True)
    if least <= level:
        return rate
    slower = rate_after(now.rate[i], v, a, least, manner.acceleration, world.step)
    return min(rate, max(slower, min(CREEP / v, 1.0) if v > CREEP else 1.0))
