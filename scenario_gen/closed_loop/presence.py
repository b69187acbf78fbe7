# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How the others enter and leave the scene: neither ever happens in the way of the ego.

A vehicle enters when its place and its braking distance are free; until then its clock waits. One
that reaches the end of its certified motion in the way of the ego drives straight on until it is
out of the way. Where the ego drives as its witness, all enter and leave as certified.
"""

import numpy as np

from scenario_gen.closed_loop.coordination_space import pose_at, World
from scenario_gen.closed_loop.driver import (
    CLOCK,
    DriverParameters,
    DriverState,
    gap_ahead,
    MODEL,
    RATE,
)
from scenario_gen.numerics import Floats
from scenario_gen.numerics.boxes import boxes_meet, fill_box, fill_footprint, filled_gap
from scenario_gen.numerics.kernels import kernel

IN_WAY_M = 25.0  # a vehicle that leaves is farther away than this
EGO_BRAKING_MPS2 = 3.0  # of an ego that stops for a vehicle
CERTIFIED_S = 0.15  # clock difference of an ego that drives as its witness


@kernel(inline=True)
def place_at(world: World, i: int, clock: float, out: Floats) -> None:
    """Write x, y, yaw, speed and acceleration (5,) of vehicle i at a clock [s].

    A vehicle that leaves drives straight on after its certified motion.
    """
    pose_at(world.time, world.motion[i], clock, out)
    beyond = clock - world.spans[i, 1]
    if world.leaves[i] and beyond > 0.0:
        out[0] += beyond * out[3] * np.cos(out[2])
        out[1] += beyond * out[3] * np.sin(out[2])
        out[4] = 0.0


@kernel(inline=True, forced=True)
def is_certified(matched: Floats, now: float) -> bool:
    """Return whether an ego drives as its witness.

    `matched` (3,) are its clock [s], the rate of that clock, and whether it is on the path.
    """
    return bool(matched[2] > 0.0 and abs(matched[0] - now) <= CERTIFIED_S)


@kernel(inline=True)
def drive_on(world: World, acceleration: float, speed: float, driver: Floats) -> None:
    """Advance a driver (5,) behind the end of its certified motion [m/s, m/s²]."""
    driver[CLOCK] += driver[RATE] * world.step
    gained = acceleration * world.step / max(speed, MODEL.min_moving_speed_mps)
    driver[RATE] = max(driver[RATE], min(driver[RATE] + gained, 1.0))


@kernel(inline=True)
def may_enter(
    world: World,
    parameters: DriverParameters,
    driver: DriverState,
    vehicles: Floats,
    clocks: Floats,
    now: float,
) -> float:
    """Return the rate of a vehicle that is not yet on the scene: 1, or 0 if it has to wait.

    Args:
        world: the scenario and the step.
        parameters: of the drivers.
        driver: of the vehicle.
        vehicles: (N, 4) x, y [m], yaw [rad], speed [m/s] of all vehicles.
        clocks: (N,) their clocks [s]; infinity for those that are not on the scene, or that drive
            as certified.
        now: certified time at the end of the step [s].
    """
    if driver.clock + world.step < world.spans[driver.vehicle, 0]:
        return 1.0
    for j in range(len(clocks)):
        is_late = abs(clocks[j] - now) > CERTIFIED_S
        if (
            clocks[j] < np.inf
            and is_late
            and _is_in_place(world, parameters, driver, j, vehicles[j])
        ):
            return 0.0
    return 1.0


@kernel(inline=True)
def _is_in_place(
    world: World, parameters: DriverParameters, driver: DriverState, j: int, other: Floats
) -> bool:
    """Return whether vehicle j (4,) is too near for another one to enter.

    The other one would have to brake more than comfortably, or vehicle j behind it would.
    """
    i = driver.vehicle
    begin = world.spans[i, 0]
    pose = np.empty(5)
    place = np.empty(7)
    box = np.empty(7)
    half = world.half[i]
    pose_at(world.time, world.motion[i], begin, pose)
    fill_box(pose[0], pose[1], pose[2], half[0] + MODEL.entry_gap_m, half[1], place)
    direction = max(np.cos(other[2] - pose[2]), 0.0)
    along = pose[3] * direction
    other_along = other[3] * direction
    way = _stopping_way(other[3], along) * (other[3] > along)
    x = other[0] + 0.5 * way * np.cos(other[2])
    y = other[1] + 0.5 * way * np.sin(other[2])
    fill_box(x, y, other[2], world.half[j, 0] + 0.5 * way, world.half[j, 1], box)
    if boxes_meet(place, box):
        return True
    fill_footprint(other, world.half[j], box)
    gap, _ = gap_ahead(world, i, begin, box, pose)
    excess = max(pose[3] * pose[3] - other_along * other_along, 0.0)
    response = max(pose[3] - other_along, 0.0) * parameters.delay[i] * world.step
    braking = MODEL.braking_margin_ratio * excess / (2.0 * parameters.comfortable[i])
    room = response + pose[3] * MODEL.foot_time_s + braking
    return bool(gap < parameters.standstill + room)


@kernel(inline=True, forced=True)
def _stopping_way(speed: float, target: float) -> float:
    """Return the way [m] in which an ego slows down from a speed to a target [m/s]."""
    excess = speed * speed - target * target
    return speed * MODEL.ego_response_s + excess / (2.0 * EGO_BRAKING_MPS2)


@kernel(inline=True)
def is_in_way(world: World, i: int, vehicles: Floats) -> bool:
    """Return whether vehicle i, which would leave, is in the way of the ego.

    It is near, ahead or beside in the same direction, or moving away from the ego. One that
    touches another vehicle leaves.

    Args:
        world: the scenario.
        i: index of the vehicle.
        vehicles: (N, 5) x, y [m], yaw [rad], speed [m/s] and whether each is on the scene.
    """
    ego = vehicles[world.ego]
    dx = vehicles[i, 0] - ego[0]
    dy = vehicles[i, 1] - ego[1]
    half = world.half[i]
    ego_half = world.half[world.ego]
    box = np.empty(7)
    other = np.empty(7)
    fill_footprint(vehicles[i], half, box)
    fill_footprint(ego, ego_half, other)
    cos = box[2]
    sin = box[3]
    ego_cos = other[2]
    ego_sin = other[3]
    if filled_gap(box, other) > max(_stopping_way(ego[3], 0.0), IN_WAY_M):
        return False
    same_direction = cos * ego_cos + sin * ego_sin >= MODEL.same_direction_ratio
    is_behind = dx * ego_cos + dy * ego_sin < -half[0] - ego_half[0]
    if not ((same_direction and not is_behind) or dx * cos + dy * sin > 0.0):
        return False
    for j in range(vehicles.shape[0]):
        if j in (i, world.ego) or vehicles[j, 4] == 0.0:
            continue
        fill_footprint(vehicles[j], world.half[j], other)
        if boxes_meet(box, other):
            return False
    return True
