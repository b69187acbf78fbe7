# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What a driver foresees: where the ego will be, seen a reaction time ago, and the weakest braking that keeps clear of it."""

from typing import NamedTuple

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
from scenario_gen.closed_loop.order import limit, PARTS
from scenario_gen.numerics import Floats
from scenario_gen.numerics.boxes import boxes_meet, fill_box
from scenario_gen.numerics.kernels import kernel

SLOW = 0.2  # m/s; a certified speed below it counts as this one where it divides
SPARE = 0.3  # metres that a driver who brakes for the ego leaves
HALVINGS = 5  # of the range that holds the braking it looks for
LATE = 0.05  # seconds by which the ego's clock is uncertain
HARDER = 1.0  # m/s² by which an ego on its witness' path must brake harder than that one to be foreseen to go on so


class Foreseen(NamedTuple):
    """What one driver, or all, expect of the steps to come.

    Attributes:
        ego: (M, 4) the ego's x, y [m], yaw [rad], speed [m/s] at the end of this step and of the
            following ones.
        clock: of the ego on its witness' path at the end of this step [s].
        rate: of that clock; negative if the ego is not on that path.
        coming: (N, M) clocks of the others at the step's begin and at the end of each [s].
        aside: metres that it leaves beside the ego if nothing makes it brake.
        heeds: whether it keeps clear of the ego all the way; who is on foot decides at the kerb.
    """

    ego: Floats
    clock: float
    rate: float
    coming: Floats
    aside: float
    heeds: bool


@kernel(inline=True)
def foresee_ego(world: World, seen: Floats, ago: int, out: Floats) -> None:
    """Fill `out` (M, 4) with the ego's x, y, yaw and speed at the end of this step and of the following ones.

    On its witness' path it goes on as the witness did, at its own rate; else straight on. If it
    brakes, on that path harder than the witness, it goes on braking.

    Args:
        world: the scenario.
        seen: (9,) the ego as in `State.seen`.
        ago: how many steps ago that was.
        out: (M, 4).
    """
    h, time, motion, pose, s = (
        world.step,
        world.time,
        world.motion[world.ego],
        np.empty(5),
        seen[3],
    )
    cos, sin = np.cos(seen[2]), np.sin(seen[2])
    usual = 0.0  # the witness' own braking there, in the step that is over and after it
    for back in range(3):
        pose_at(time, motion, seen[EGO_CLOCK] - (1.0 - 0.5 * back) * h * seen[EGO_RATE], pose)
        usual = min(usual, pose[4])
    on_path = seen[ON_PATH] > 0.0
    keeps = on_path and seen[5] > seen[EGO_RATE] * seen[EGO_RATE] * usual - HARDER
    braking, way, clock = max(-seen[5], 0.0), 0.0, seen[EGO_CLOCK]
    if ago == 0:
        out[0] = seen[:4]
    for m in range(1 - ago, out.shape[0]):
        after = max(s - braking * h, 0.0)
        moved = 0.5 * (s + after) * h if after > 0.0 or braking == 0.0 else 0.5 * s * s / braking
        s = after
        if on_path:
            clock += seen[EGO_RATE] * h if keeps else min(moved / max(pose[3], SLOW), h)
            pose_at(time, motion, clock, pose)
        way += moved
        if m < 0:
            continue
        if on_path:
            out[m, :3], out[m, 3] = pose[:3], seen[EGO_RATE] * pose[3] if keeps else s
        else:
            out[m, 0], out[m, 1], out[m, 2], out[m, 3] = (
                seen[0] + way * cos,
                seen[1] + way * sin,
                seen[2],
                s,
            )


@kernel(inline=True)
def weakest(
    world: World,
    parameters: DriverParameters,
    me: DriverState,
    least: float,
    foreseen: Foreseen,
    others: bool,
) -> float:
    """The weakest braking [m/s²], `least` or more, with which a driver meets nothing that it foresees; the strongest if none.

    Looked for between a few brakings first, for more is not always better: who brakes more may be
    there when the ego is.
    """
    if _clear(world, parameters, me, least, foreseen, others):
        return least
    low = max(least, -parameters.acceleration)
    comfortable, strongest = parameters.comfortable, parameters.strongest[me.i]
    for tried in (0.0, 0.5 * comfortable, comfortable, 0.5 * (comfortable + strongest), strongest):
        if tried <= low:
            continue
        if _clear(world, parameters, me, tried, foreseen, others):
            high = tried
            for _ in range(HALVINGS):
                middle = 0.5 * (low + high)
                if _clear(world, parameters, me, middle, foreseen, others):
                    high = middle
                else:
                    low = middle
            return high
        low = tried
    return float(max(strongest, least))


@kernel(inline=True)
def _clear(
    world: World,
    parameters: DriverParameters,
    me: DriverState,
    braking: float,
    foreseen: Foreseen,
    others: bool,
) -> bool:
    """Whether a driver, braking so, stays clear of the ego ahead of it, and keeps to what the order is foreseen to let it do."""
    h, time, motion, cell, order = (
        world.step,
        world.time,
        world.motion[me.i],
        world.cell,
        world.order[me.i],
    )
    pose, mine, ego, half = np.empty(5), np.empty(7), np.empty(7), world.half
    t, r, was = me.clock, me.rate, me.was
    spare = max(foreseen.aside, SPARE) if braking > FREE else foreseen.aside
    length, width = half[me.i, 0] + spare, half[me.i, 1] + spare
    reach = np.sqrt(length**2 + width**2) + np.sqrt(
        half[world.ego, 0] ** 2 + half[world.ego, 1] ** 2
    )
    pose_at(time, motion, t, pose)
    for m in range(foreseen.ego.shape[0] - 1):
        u = r * pose[3]
        after = rate_after(parameters, r, pose[3], pose[4], was, braking, 0.0, h)
        t += 0.5 * (r + after) * h
        r = after
        pose_at(time, motion, t, pose)
        was = (r * pose[3] - u) / h
        if world.leaves[me.i] and t >= world.spans[me.i, 1]:
            return True
        there = foreseen.ego[m]
        dx, dy = there[0] - pose[0], there[1] - pose[1]
        if foreseen.heeds and dx * dx + dy * dy < reach * reach:
            fill_box(pose[0], pose[1], pose[2], length, width, mine)
            fill_box(there[0], there[1], there[2], half[world.ego, 0], half[world.ego, 1], ego)
            if dx * mine[2] + dy * mine[3] > 0.0 and boxes_meet(mine, ego):
                return False
        passed = foreseen.clock + foreseen.rate * m * h
        if (
            parameters.yields
            and foreseen.rate >= 0.0
            and t > limit(order[world.ego], cell, passed) + LATE
        ):
            return False
        if others:
            for j in range(foreseen.coming.shape[0]):
                if j not in (me.i, world.ego):
                    end = foreseen.coming[j, m + 1]
                    before = end - (end - foreseen.coming[j, m]) / PARTS
                    if t > max(limit(order[j], cell, before), end) + 1e-09:
                        return False
        if braking > 0.0 and r == 0.0:
            return True
    return True


@kernel(inline=True)
def foresee_self(
    world: World, parameters: DriverParameters, me: DriverState, braking: float, out: Floats
) -> None:
    """Fill `out` (M,) with a driver's clocks [s] at the step's begin and at the end of each, if it brakes so."""
    h, time, motion, pose = world.step, world.time, world.motion[me.i], np.empty(5)
    t, r, was = me.clock, me.rate, me.was
    out[0] = t
    for m in range(1, out.shape[0]):
        if r < 1.0 or braking > FREE:
            pose_at(time, motion, t, pose)
            after = rate_after(parameters, r, pose[3], pose[4], was, braking, 0.0, h)
            u = r * pose[3]
            t += 0.5 * (r + after) * h
            pose_at(time, motion, t, pose)
            was, r = (after * pose[3] - u) / h, after
        else:
            t += h
        out[m] = t
