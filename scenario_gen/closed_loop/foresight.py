# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What a driver foresees: where the ego will be, seen a reaction time ago, and the weakest braking that keeps clear of it."""

from typing import NamedTuple

import numpy as np

from scenario_gen.closed_loop.certified import boxes_meet, fill_box, pose_at, World
from scenario_gen.closed_loop.driver import Manner, rate_after, SLOW
from scenario_gen.closed_loop.order import limit
from scenario_gen.numerics import Floats
from scenario_gen.numerics.kernels import kernel

FORESEEN = 5.0  # seconds that a driver looks ahead
LEVELS = 5  # brakings it can choose from, none among them
LATE = 0.05  # seconds by which the ego's clock is uncertain
HARDER = 1.0  # m/s² by which an ego on its witness' path must brake harder than that one to be foreseen to go on so


class Foreseen(NamedTuple):
    """What one driver, or all, expect of the steps to come.

    Attributes:
        ego: (M, 8) the ego's box (7,) at the end of this step and of the following ones, and its speed [m/s].
        clock: of the ego on its witness' path at the end of this step [s].
        rate: of that clock; negative if the ego is not on that path.
        coming: (N, M) clocks of the others at the step's begin and at the end of each [s].
    """

    ego: Floats
    clock: float
    rate: float
    coming: Floats


@kernel(inline=True)
def foresee_ego(world: World, seen: Floats, ago: int, out: Floats) -> None:
    """Fill `out` (M, 8) with the ego's boxes and speeds at the end of this step and of the following ones.

    On its witness' path it goes on as the witness did, at its own rate; else straight on. If it brakes, on that path harder than
    the witness, it goes on braking.

    Args:
        world: the scenario.
        seen: (9,) the ego as in `State.seen`.
        ago: how many steps ago that was.
        out: (M, 8).
    """
    h, time, motion, half = world.step, world.time, world.motion[world.ego], world.half[world.ego]
    pose = np.empty(5)
    c, s = np.empty(7), seen[3]
    fill_box(seen[0], seen[1], seen[2], half[0], half[1], c)
    usual = 0.0  # the witness' own braking there, in the step that is over and after it
    for back in range(3):
        pose_at(time, motion, seen[6] - (1.0 - 0.5 * back) * h * seen[7], pose)
        usual = min(usual, pose[4])
    on_path = seen[8] > 0.0
    keeps = on_path and seen[5] > seen[7] * seen[7] * usual - HARDER
    braking, way, clock = max(-seen[5], 0.0), 0.0, seen[6]
    if ago == 0:
        out[0, :7], out[0, 7] = c, s
    for m in range(1 - ago, out.shape[0]):
        after = max(s - braking * h, 0.0)
        moved = 0.5 * (s + after) * h if after > 0.0 or braking == 0.0 else 0.5 * s * s / braking
        s = after
        if on_path:
            clock += seen[7] * h if keeps else min(moved / max(pose[3], SLOW), h)
            pose_at(time, motion, clock, pose)
        way += moved
        if m < 0:
            continue
        if on_path:
            fill_box(pose[0], pose[1], pose[2], half[0], half[1], out[m])
            out[m, 7] = seen[7] * pose[3] if keeps else s
        else:
            out[m, :7], out[m, 7] = c, s
            out[m, 0], out[m, 1] = seen[0] + way * c[2], seen[1] + way * c[3]


@kernel(inline=True)
def weakest(
    world: World, manner: Manner, i: int, clock: Floats, rate: Floats, least: float, foreseen: Foreseen, others: bool
) -> float:
    """The weakest braking [m/s²], `least` or more, with which vehicle i meets nothing that it foresees; the strongest if none."""
    comfortable, strongest = manner.comfortable, manner.strongest
    for k in range(LEVELS):
        if k == 0:
            braking = least
        elif k <= 2:
            braking = 0.5 * k * comfortable
        else:
            braking = comfortable + (strongest - comfortable) * (k - 2) / (LEVELS - 3)
        if braking < least:
            continue
        if _clear(world, manner, i, clock, rate, braking, foreseen, others):
            return braking
    return float(max(strongest, least))


@kernel(inline=True)
def _clear(
    world: World, manner: Manner, i: int, clock: Floats, rate: Floats, braking: float, foreseen: Foreseen, others: bool
) -> bool:
    """Whether vehicle i, braking so, stays clear of the ego ahead of it, and keeps to what the order is foreseen to let it do."""
    h, time, motion, cell, order = world.step, world.time, world.motion[i], world.cell, world.order[i]
    pose, box = np.empty(5), np.empty(7)
    t, r = clock[i], rate[i]
    pose_at(time, motion, t, pose)
    for m in range(foreseen.ego.shape[0] - 1):
        after = rate_after(r, pose[3], pose[4], braking, manner.acceleration, h)
        t += 0.5 * (r + after) * h
        r = after
        pose_at(time, motion, t, pose)
        fill_box(pose[0], pose[1], pose[2], world.half[i, 0], world.half[i, 1], box)
        ego = foreseen.ego[m]
        if boxes_meet(box, ego) and (ego[0] - box[0]) * box[2] + (ego[1] - box[1]) * box[3] > 0.0:
            return False
        passed = foreseen.clock + foreseen.rate * m * h
        if manner.yields and foreseen.rate >= 0.0 and t > limit(order[world.ego], cell, passed) + LATE:
            return False
        if others:
            for j in range(foreseen.coming.shape[0]):
                if j not in (i, world.ego) and t > limit(order[j], cell, foreseen.coming[j, m + 1]) + 1e-09:
                    return False
        if braking > 0.0 and r == 0.0:
            return True
    return True
