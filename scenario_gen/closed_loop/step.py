# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One step of the closed loop, compiled: where the ego is on its witness' path, how the others react, where all are then."""

import numpy as np

from scenario_gen.closed_loop.coordination_space import pose_at, WORLD, World
from scenario_gen.closed_loop.driver import (
    ACCELERATION,
    CLOCK,
    DRIVER_PARAMETERS,
    DriverParameters,
    EGO_CLOCK,
    HELD,
    RATE,
    WAITED,
)
from scenario_gen.closed_loop.traffic_model import react
from scenario_gen.numerics import Bools, Floats
from scenario_gen.numerics.boxes import boxes_meet, fill_box
from scenario_gen.numerics.kernels import B1, F, F2, I, kernel, OUT2, OUTB1

WINDOW = 5.0  # metres beyond what the ego has moved in which its place on the witness' path is looked for
BESIDE = 1.5  # metres beside that path at which the ego has left it
ASKEW = 0.5  # rad against that path, likewise
HURRY = 1.5  # times the witness' speed at which it is not on it either: it will not do what the witness did
ON = 0.05  # metres and m/s by which an ego that keeps to its witness differs from it
HARDER = 0.2  # m/s of a step beyond the strongest braking that are counted
SUDDEN = 0.05  # m/s of a step beyond what the jerk allows that are counted
PUNCTUAL = 0.15  # seconds by which an ego that stands with its witness may be late


@kernel(inline=True)
def locate(
    now: float, time: Floats, motion: Floats, body: Floats, before: float, out: Floats
) -> None:
    """Write the ego's clock on its witness' path, the rate at which it runs, and whether it is on that path (1 or 0).

    Args:
        now: seconds.
        time: (T,) of the scenario.
        motion: (T, 6) of the witness, as in `World`.
        body: (6,) the ego, as in `EgoState`.
        before: its clock one step ago [s]; it never runs back.
        out: (3,).
    """
    pose, last = np.empty(5), time[-1]
    pose_at(time, motion, now, pose)
    out[0], out[1], out[2] = before, 1.0, 1.0
    if before <= now <= last and np.hypot(body[0] - pose[0], body[1] - pose[1]) < ON:
        out[0] = now
    else:
        way, best, at, step = 0.0, np.inf, before, 0.05
        pose_at(time, motion, before, pose)
        x, y = pose[0], pose[1]
        reach = np.hypot(body[0] - x, body[1] - y) + WINDOW
        t = before
        while t <= last and way <= reach:
            pose_at(time, motion, t, pose)
            way += np.hypot(pose[0] - x, pose[1] - y)
            x, y = pose[0], pose[1]
            gap = np.hypot(body[0] - x, body[1] - y)
            if gap < best - 1e-6 or (gap < best + 1e-6 and t <= now):
                best, at = min(gap, best), t
            t += step
        pose_at(time, motion, at, pose)
        if pose[3] > 0.5:
            along = (body[0] - pose[0]) * np.cos(pose[2]) + (body[1] - pose[1]) * np.sin(pose[2])
            at += min(max(along / pose[3], -step), step)
        out[0] = min(max(at, before), last)
    pose_at(time, motion, out[0], pose)
    c, s = np.cos(pose[2]), np.sin(pose[2])
    turn = (body[2] - pose[2] + np.pi) % (2.0 * np.pi) - np.pi
    aside = abs((body[1] - pose[1]) * c - (body[0] - pose[0]) * s)
    if abs(body[3] - pose[3]) < ON:
        out[1] = 1.0 if pose[3] > 0.3 or out[0] >= now - PUNCTUAL else 0.0
    elif pose[3] > 0.3:
        out[1] = body[3] / pose[3]
    else:
        out[1] = 1.0 if body[3] > 0.1 else 0.0
    if aside > BESIDE or abs(turn) > ASKEW or out[1] > HURRY:
        out[2] = 0.0


@kernel(inline=True)
def place(time: Floats, motion: Floats, drivers: Floats, out: Floats) -> None:
    """Write x, y [m], yaw [rad], speed [m/s] (N, 4) of motions (N, T, 6); rows (N, 5) begin with clock [s] and rate."""
    pose = np.empty(5)
    for i in range(out.shape[0]):
        pose_at(time, motion[i], drivers[i, CLOCK], pose)
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = (
            pose[0],
            pose[1],
            pose[2],
            pose[3] * drivers[i, RATE],
        )


@kernel(WORLD, DRIVER_PARAMETERS, F, F2, OUT2, OUT2, OUT2, OUTB1)
def advance(
    world: World,
    parameters: DriverParameters,
    now: float,
    before: Floats,
    seen: Floats,
    after: Floats,
    vehicles: Floats,
    here: Bools,
) -> None:
    """Move everyone one step on.

    Args:
        world: the scenario and the step.
        parameters: how the others drive.
        now: certified time at the step's end [s].
        before: (N, 4) columns CLOCK … of `driver`.
        seen: (K, 9) as in `State`, at the end of the step; the ego's clock, its rate and whether
            it is on its path are written.
        after: (N, 5) output, at the end of the step; HELD is 1 where the order makes one of the
            others brake harder than the strongest, or more suddenly than the jerk allows.
        vehicles: (N, 4) output, x, y [m], yaw [rad], speed [m/s] then.
        here: (N,) output, who is on the scene then.
    """
    h, time, motion, ego = world.step, world.time, world.motion, world.ego
    pose, body, witness = np.empty(5), seen[0, :EGO_CLOCK], seen[0, EGO_CLOCK:]
    locate(now, time, motion[ego], body, before[ego, CLOCK], witness)
    if parameters.reacts:
        react(world, parameters, seen, before, after)
    else:
        after[:] = 0.0
        after[:, CLOCK], after[:, RATE] = min(now, time[-1]), 1.0
    after[ego, CLOCK], after[ego, RATE], after[ego, WAITED], after[ego, HELD] = (
        witness[0],
        witness[1],
        0.0,
        0.0,
    )
    place(time, motion, after, vehicles)
    vehicles[ego] = body[:4]
    for i in range(len(motion)):
        pose_at(time, motion[i], before[i, CLOCK], pose)
        if i != ego and not world.leaves[i] and after[i, CLOCK] >= time[-1]:
            vehicles[i, 3] = 0.0  # it stays where its motion ended
        speed, was, clock = vehicles[i, 3], before[i, ACCELERATION], after[i, CLOCK]
        gained = (speed - before[i, RATE] * pose[3]) / h
        if after[i, HELD] > 0.0:
            hard, sudden = (
                gained + parameters.strongest[i] + HARDER / h,
                gained - min(was, 0.0) + parameters.jerk * h + SUDDEN / h,
            )
            after[i, HELD] = 1.0 if min(hard, sudden) < 0.0 else 0.0
        if after[i, HELD] == 0.0 or speed == 0.0:
            after[i, ACCELERATION] = gained if speed > 0.0 else 0.0
        after[i, ACCELERATION] = min(
            max(after[i, ACCELERATION], -parameters.strongest[i]), parameters.acceleration
        )
        begin, end = world.spans[i]
        here[i] = i == ego or (clock >= begin and not (world.leaves[i] and clock >= end))


@kernel(F2, F2, B1, I)
def ego_hits(vehicles: Floats, half: Floats, here: Bools, ego: int) -> bool:
    """Whether the ego overlaps another that is here; vehicles (N, 4) x, y, yaw, speed, half sizes (N, 2)."""
    mine, other = np.empty(7), np.empty(7)
    fill_box(
        vehicles[ego, 0], vehicles[ego, 1], vehicles[ego, 2], half[ego, 0], half[ego, 1], mine
    )
    for i in range(vehicles.shape[0]):
        if i != ego and here[i]:
            fill_box(vehicles[i, 0], vehicles[i, 1], vehicles[i, 2], half[i, 0], half[i, 1], other)
            if boxes_meet(mine, other):
                return True
    return False
