# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The ego as a driver predicts it: where they meet, and when it will have passed a place."""

import numpy as np

from scenario_gen.closed_loop.coordination_space import pose_at, World
from scenario_gen.closed_loop.driver import (
    approach_acceleration,
    clock_after,
    DriverParameters,
    DriverState,
    EGO_CLOCK,
    EGO_RATE,
    following_acceleration,
    MODEL,
    ON_PATH,
    way_at,
)
from scenario_gen.numerics import Floats
from scenario_gen.numerics.boxes import boxes_meet, fill_box, fill_footprint
from scenario_gen.numerics.kernels import kernel
from scenario_gen.numerics.loops import copy_to


@kernel(inline=True)
def _keeps_rate(world: World, seen: Floats) -> bool:
    """Return whether an ego (9,) drives no faster and brakes no harder than its witness.

    The braking of its witness is that in this step and the next one.
    """
    pose = np.empty(5)
    usual = 0.0
    rate = seen[EGO_RATE]
    for k in range(3):
        clock = seen[EGO_CLOCK] - (1.0 - 0.5 * k) * world.step * rate
        pose_at(world.time, world.motion[world.ego], clock, pose)
        usual = min(usual, pose[4])
    is_faster = rate > MODEL.max_ego_rate_ratio
    return bool(not is_faster and seen[5] > rate * rate * usual - MODEL.extra_braking_mps2)


@kernel(inline=True)
def _brake(speed: float, braking: float, h: float) -> tuple[float, float]:
    """Return the way [m] in a step of h [s] of braking [m/s²], and the speed [m/s] after it."""
    end_speed = max(speed - braking * h, 0.0)
    if end_speed > 0.0 or braking == 0.0:
        return 0.5 * (speed + end_speed) * h, end_speed
    return 0.5 * speed * speed / braking, end_speed


@kernel(inline=True)
def ego_end(world: World) -> float:
    """Return the clock [s] at which the witness of the ego leaves the scene, infinity if never."""
    return float(world.spans[world.ego, 1] if world.leaves[world.ego] else np.inf)


@kernel(inline=True)
def predict_ego(world: World, seen: Floats, ago: int, out: Floats) -> None:
    """Write x, y, yaw, speed and clock (M, 5) of the ego at the ends of this and later steps.

    On the path of its witness the ego continues at its rate. Beyond the end of that path, and
    beside it, it continues straight on. An ego that brakes, on its path harder than its witness,
    goes on braking.

    Args:
        world: the scenario.
        seen: (9,) the ego as in `State.seen`.
        ago: age of that observation in steps.
        out: (M, 5).
    """
    h = world.step
    motion = world.motion[world.ego]
    speed = seen[3]
    clock = seen[EGO_CLOCK]
    braking = max(-seen[5], 0.0)
    end = ego_end(world)
    on_path = seen[ON_PATH] > 0.0 and clock < end
    keeps_rate = on_path and _keeps_rate(world, seen)
    cos = np.cos(seen[2])
    sin = np.sin(seen[2])
    way = 0.0
    pose = np.empty(5)
    if ago == 0:
        copy_to(out[0, :4], seen)
        out[0, 4] = clock
    for m in range(1 - ago, out.shape[0]):
        moved, speed = _brake(speed, braking, h)
        way += moved
        if keeps_rate:
            clock += seen[EGO_RATE] * h
        elif on_path:
            clock = clock_after(world, world.ego, clock, moved, np.inf)
        if on_path:
            pose_at(world.time, motion, clock, pose)
            beyond = max(clock - end, 0.0) * pose[3]
            pose[0] += beyond * np.cos(pose[2])
            pose[1] += beyond * np.sin(pose[2])
        else:
            pose[0] = seen[0] + way * cos
            pose[1] = seen[1] + way * sin
            pose[2] = seen[2]
        if m >= 0:
            copy_to(out[m, :3], pose)
            out[m, 3] = seen[EGO_RATE] * pose[3] if keeps_rate else speed
            out[m, 4] = clock


@kernel(inline=True)
def passing_acceleration(
    world: World,
    parameters: DriverParameters,
    i: int,
    place: Floats,
    way: float,
    speed: float,
    ego: Floats,
) -> float:
    """Return the acceleration [m/s²] of driver i that lets the predicted ego (M, 5) pass a place.

    -infinity if the ego does not leave the place, or if the driver can no longer stop before it.

    Args:
        world: the scenario.
        parameters: of the drivers.
        i: index of the driver.
        place: (7,) footprint of the driver there.
        way: to the place [m].
        speed: of the driver [m/s].
        ego: as `predict_ego` writes it.
    """
    stopping_way = speed * MODEL.foot_time_s + speed * speed / (2.0 * parameters.strongest[i])
    if stopping_way > way:
        return -np.inf
    box = np.empty(7)
    last = ego.shape[0] - 1
    for m in range(last, -1, -1):
        fill_footprint(ego[m], world.half[world.ego], box)
        if boxes_meet(place, box):
            wait = (m + 1) * world.step + MODEL.foot_time_s
            return approach_acceleration(parameters, i, way, speed, wait) if m < last else -np.inf
    return -np.inf


@kernel(inline=True)
def meeting_acceleration(
    world: World, parameters: DriverParameters, driver: DriverState, speed: float, ego: Floats
) -> float:
    """Return the largest acceleration [m/s²] of a driver that would meet the predicted ego (M, 5).

    The place where they meet is that of a leader. Infinity if they do not meet, or if the ego
    reaches the driver from behind on the same path.
    """
    i = driver.vehicle
    pose = np.empty(5)
    box = np.empty(7)
    footprint = np.empty(7)
    is_fast = speed > MODEL.max_blocking_speed_mps
    clearance = MODEL.clearance_m * (driver.rate != 1.0 and is_fast)
    half = world.half[i]
    ego_half = world.half[world.ego]
    reach = np.hypot(half[0], half[1]) + np.hypot(ego_half[0], ego_half[1]) + clearance
    leaves = world.spans[i, 1] if world.leaves[i] else np.inf
    for m in range(ego.shape[0] - 1):
        clock = driver.clock + driver.rate * (m + 1) * world.step
        if clock >= leaves:
            break
        pose_at(world.time, world.motion[i], clock, pose)
        dx = ego[m, 0] - pose[0]
        dy = ego[m, 1] - pose[1]
        if dx * dx + dy * dy >= reach * reach:
            continue
        fill_box(pose[0], pose[1], pose[2], half[0] + clearance, half[1] + clearance, footprint)
        fill_footprint(ego[m], ego_half, box)
        if not boxes_meet(footprint, box):
            continue
        same_direction = box[2] * footprint[2] + box[3] * footprint[3]
        if dx * footprint[2] + dy * footprint[3] > 0.0:
            gap = way_at(world, i, clock) - way_at(world, i, driver.clock)
            along = ego[m, 3] * max(same_direction, 0.0)
            bound = following_acceleration(parameters, i, gap, speed, along, 0.0)
            if same_direction >= MODEL.same_direction_ratio:
                return bound
            behind = passing_acceleration(world, parameters, i, footprint, gap, speed, ego)
            return max(bound, behind)
        if same_direction >= MODEL.same_direction_ratio:
            break
    return np.inf


@kernel(inline=True)
def place_to_wait(
    order: Floats, cell: float, driver: DriverState, other: float, rate: float
) -> tuple[float, float]:
    """Return the clock [s] of the place where a driver waits for another vehicle, and how long.

    The time is 0 if the driver need not wait on its record, or at its rate if that is higher,
    infinite if the other one stands.

    Args:
        order: (K,) of the pair, as in `World`.
        cell: length of a cell [s].
        driver: that waits.
        other: clock of the other vehicle [s].
        rate: of that clock.
    """
    k = min(int(other / cell), order.shape[0] - 1)
    limit = order[k]
    clock = driver.clock
    if limit == np.inf or limit <= clock or limit <= other:
        return np.inf, 0.0
    while k < order.shape[0] and order[k] <= limit:
        k += 1
    clear = k * cell if k < order.shape[0] else np.inf
    wait = (min(clear, limit) - other) / max(rate, 1e-6)
    if clock + max(driver.rate, 1.0) * wait <= limit + MODEL.clock_tolerance_s:
        return limit, 0.0
    return limit, wait if rate > 0.01 else np.inf


@kernel(inline=True)
def is_gap_accepted(
    world: World,
    parameters: DriverParameters,
    driver: DriverState,
    speed: float,
    clock: float,
    rate: float,
) -> bool:
    """Return whether a driver clears all places that the ego has yet to pass, with its margin.

    The ego continues at its rate from its clock [s].
    """
    i = driver.vehicle
    a = parameters.acceleration[i]
    cell = world.cell
    start = way_at(world, i, driver.clock)
    for k in range(int(driver.clock / cell), world.meets.shape[1]):
        if world.meets[i, k, 1] < clock:
            continue
        need = (k + 1) * cell - driver.clock
        if driver.rate < 0.5:
            way = way_at(world, i, (k + 1) * cell) - start
            need = (np.sqrt(speed * speed + 2.0 * a * way) - speed) / a
        arrival = max(world.meets[i, k, 0] - clock, 0.0) / max(rate, 1e-6)
        if need + parameters.margin[i] > arrival:
            return False
    return True


@kernel(inline=True)
def yielding_acceleration(
    world: World,
    parameters: DriverParameters,
    driver: DriverState,
    speed: float,
    ego: Floats,
    rate: float,
    waited: float,
) -> float:
    """Return the largest acceleration [m/s²] of a driver where the template let the ego pass.

    Infinity if it need not wait or cannot stop any more. A driver goes before an ego that moves if
    it accepts the gap, before one that hardly moves if its patience is spent.

    Args:
        world: the scenario.
        parameters: of the drivers.
        driver: at the start of the step.
        speed: of the driver [m/s].
        ego: (5,) as `predict_ego` writes it.
        rate: of the clock of the ego.
        waited: time for which the driver has waited [s].
    """
    i = driver.vehicle
    clock = ego[4]
    limit, wait = place_to_wait(world.order[i, world.ego], world.cell, driver, clock, rate)
    if wait == 0.0:
        return np.inf
    way = way_at(world, i, limit) - way_at(world, i, driver.clock)
    if speed * speed > 2.0 * parameters.strongest[i] * way:
        return np.inf
    if ego[3] <= MODEL.max_blocking_speed_mps:
        goes = waited >= parameters.patience[i]
    else:
        goes = is_gap_accepted(world, parameters, driver, speed, clock, rate)
    if goes:
        return np.inf
    way = max(way - MODEL.stopping_margin_m, 0.0)
    return approach_acceleration(parameters, i, way, speed, wait)
