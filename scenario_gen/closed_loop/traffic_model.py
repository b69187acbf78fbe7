# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The other vehicles in one step: each drives by what is ahead of it on its certified path.

The intelligent driver model gives the acceleration towards the nearest of these: a vehicle on the
path, the ego included; the place where it would meet the ego; a place that the ego or another
vehicle passes first. On the certified situation nobody leaves the certified motion. A driver that
reacts to one that is early hurries up to the clock of that one. The order of events among the
others holds without exception: see order.py.

Each driver sees the ego as it was one reaction time ago. A pedestrian on a lane goes on, but does
not step onto a lane in front of an ego that cannot stop: see kerb.py.
"""

from typing import NamedTuple

import numpy as np

from scenario_gen.closed_loop.coordination_space import World
from scenario_gen.closed_loop.driver import (
    ACCELERATION,
    approach_acceleration,
    CLOCK,
    drive_step,
    DriverParameters,
    DriverState,
    EGO_CLOCK,
    EGO_RATE,
    gap_ahead,
    HELD,
    leader_acceleration,
    MODEL,
    ON_PATH,
    RATE,
    WAITED,
    way_at,
)
from scenario_gen.closed_loop.foresight import (
    ego_end,
    meeting_acceleration,
    passing_acceleration,
    place_to_wait,
    predict_ego,
    yielding_acceleration,
)
from scenario_gen.closed_loop.kerb import is_before_kerb, kerb_acceleration
from scenario_gen.closed_loop.order import enforce_order, may_pass, passing_limit
from scenario_gen.closed_loop.presence import drive_on, may_enter, place_at
from scenario_gen.numerics import Bools, Floats
from scenario_gen.numerics.boxes import fill_footprint
from scenario_gen.numerics.kernels import kernel
from scenario_gen.numerics.loops import copy_to

MIN_ROOM_M = 0.05  # a driver that is nearer to the end of its permitted way drives up to it


class Traffic(NamedTuple):
    """All vehicles at the start of a step.

    Attributes:
        drivers: (N, 4) clock [s], its rate, acceleration [m/s²] and time waited [s], as in
            `State`.
        pose: (N, 5) x, y [m], yaw [rad], certified speed [m/s] and acceleration [m/s²] there.
        moving: (N,) whether each vehicle has not yet reached the end of its certified motion.
        present: (N,) whether each vehicle is on the scene.
        passes: (N, N) whether vehicle i goes ahead of vehicle j against the certified order.
    """

    drivers: Floats
    pose: Floats
    moving: Bools
    present: Bools
    passes: Bools


@kernel(inline=True, merged=True)
def react(
    world: World,
    parameters: DriverParameters,
    seen: Floats,
    drivers: Floats,
    present: Bools,
    passes: Bools,
    time: float,
    after: Floats,
) -> None:
    """Write the reaction of all drivers in a step; the caller writes the row of the ego.

    Args:
        world: the scenario and the step.
        parameters: of the drivers.
        seen: (K, 9) the ego as in `State.seen`, at the end of this step and before.
        drivers: (N, 4) as in `Traffic`.
        present: (N,) as in `Traffic`.
        passes: (N, N) as in `Traffic`; pairs whose order is drawn again are added.
        time: at the end of the step [s].
        after: (N, 5) clock [s], rate, acceleration that the driver wanted [m/s²], time waited
            [s], and 1 where the order held the driver back.
    """
    now = _traffic(world, drivers, present, passes)
    ego = np.empty((_steps(world, parameters.foresight.max()), 5))
    pose = np.empty(5)
    age = -1  # of the observation in the prediction, which drivers with the same delay share
    for i in range(drivers.shape[0]):
        driver = DriverState(i, drivers[i, CLOCK], drivers[i, RATE], drivers[i, ACCELERATION])
        after[i] = 0.0
        _write_driver(driver, after[i])
        if i == world.ego:
            continue
        if not (now.moving[i] and now.present[i]):
            _enter_or_leave(world, parameters, now, driver, seen[0], time, after[i])
            continue
        delay = min(parameters.delay[i], seen.shape[0] - 1)
        if delay != age:
            age = delay
            predict_ego(world, seen[age], age, ego)
        bound = _bound_by_ego(world, parameters, now, driver, seen[age], ego, after)
        if drivers.shape[0] > 2:
            bound = min(bound, _bound_by_others(world, parameters, now, driver, after))
        bound = min(bound, _bound_by_lights(world, parameters, now, driver, time))
        ego_clock = ego[0, 4] - world.step if seen[age, ON_PATH] > 0.0 else -np.inf
        target = _hurry_until(world, now, i, ego_clock)
        copy_to(pose, now.pose[i])
        driver = drive_step(world, parameters, driver, pose, bound, target)
        _write_driver(driver, after[i])
    _enforce(world, now, time, after)


@kernel(inline=True)
def _write_driver(driver: DriverState, out: Floats) -> None:
    """Write clock, rate and acceleration of a driver to its row (5,)."""
    out[CLOCK] = driver.clock
    out[RATE] = driver.rate
    out[ACCELERATION] = driver.acceleration


@kernel(inline=True)
def _traffic(world: World, drivers: Floats, present: Bools, passes: Bools) -> Traffic:
    """Return all vehicles at the start of a step."""
    n = drivers.shape[0]
    pose = np.empty((n, 5))
    moving = np.empty(n, dtype=np.bool_)
    for i in range(n):
        clock = drivers[i, CLOCK]
        moving[i] = not (world.leaves[i] and clock >= world.spans[i, 1])
        place_at(world, i, clock, pose[i])
    return Traffic(drivers, pose, moving, present, passes)


@kernel(inline=True)
def _on_scene(world: World, now: Traffic, seen: Floats) -> tuple[Floats, Floats]:
    """Return x, y [m], yaw [rad], speed [m/s] (N, 4) of all vehicles, and their clocks (N,) [s].

    The clocks of vehicles that are not on the scene are infinity. `seen` (9,) is the ego; its
    clock is -infinity beside the path of its witness.
    """
    vehicles = now.pose[:, :4].copy()
    vehicles[:, 3] *= now.drivers[:, RATE]
    clocks = np.where(now.present, now.drivers[:, CLOCK] + world.step, np.inf)
    copy_to(vehicles[world.ego], seen[:4])
    clocks[world.ego] = seen[EGO_CLOCK] if seen[ON_PATH] > 0.0 else -np.inf
    return vehicles, clocks


@kernel(inline=True)
def _enter_or_leave(
    world: World,
    parameters: DriverParameters,
    now: Traffic,
    driver: DriverState,
    seen: Floats,
    time: float,
    out: Floats,
) -> None:
    """Write clock and rate (5,) of a driver that is not on the scene, or at the end of its path.

    Other arguments as in `react`; `seen` (9,) is the ego now.
    """
    i = driver.vehicle
    if now.moving[i]:
        vehicles, clocks = _on_scene(world, now, seen)
        out[RATE] = may_enter(world, parameters, driver, vehicles, clocks, time)
        out[CLOCK] += out[RATE] * world.step
    elif now.present[i]:
        drive_on(world, parameters.acceleration[i], now.pose[i, 3], out)


@kernel(inline=True, forced=True)
def _steps(world: World, foresight: float) -> int:
    """Return the number of predicted instants within a horizon [s]."""
    return int(np.ceil(foresight / world.step)) + 1


@kernel(inline=True, forced=True)
def _is_slow(driver: DriverState, speed: float) -> bool:
    """Return whether a driver hardly moves, unlike its certified motion."""
    return driver.rate < 0.5 and speed <= MODEL.max_blocking_speed_mps


@kernel(inline=True)
def _bound_by_ego(
    world: World,
    parameters: DriverParameters,
    now: Traffic,
    driver: DriverState,
    seen: Floats,
    ego: Floats,
    after: Floats,
) -> float:
    """Return the largest acceleration [m/s²] with regard to the ego; write the time waited.

    Args:
        world: the scenario.
        parameters: of the drivers.
        now: all vehicles.
        driver: at the start of the step.
        seen: (9,) the ego as the driver saw it.
        ego: (M, 5) the ego as the driver predicts it.
        after: (N, 5) as in `react`.
    """
    i = driver.vehicle
    pose = now.pose[i]
    speed = driver.rate * pose[3]
    box = np.empty(7)
    fill_footprint(ego[0], world.half[world.ego], box)
    bound = leader_acceleration(
        world, parameters, driver, pose, world.ego, box, ego[0, 3], -seen[5]
    )
    crosses = np.cos(ego[0, 2] - pose[2]) < MODEL.same_direction_ratio
    if bound < np.inf and crosses:
        gap, cell = gap_ahead(world, i, driver.clock, box, pose)
        place = world.cells[i, cell, :7]
        bound = max(bound, passing_acceleration(world, parameters, i, place, gap, speed, ego))
    waited = now.drivers[i, WAITED]
    yielding = np.inf
    if parameters.yields[i] and seen[ON_PATH] > 0.0 and ego[0, 4] < ego_end(world):
        yielding = yielding_acceleration(
            world, parameters, driver, speed, ego[0], seen[EGO_RATE], waited
        )
    is_slow = ego[0, 3] <= MODEL.max_blocking_speed_mps
    waits = yielding < np.inf and _is_slow(driver, speed)
    if is_slow and (waits or waited >= parameters.patience[i]):
        after[i, WAITED] = waited + world.step
    if is_before_kerb(world, driver):
        kerb = kerb_acceleration(world, parameters, driver, pose, ego, yielding < np.inf)
        return min(bound, kerb)
    if world.walks[i]:
        return bound
    predicted = ego[: _steps(world, parameters.foresight[i])]
    meeting = meeting_acceleration(world, parameters, driver, speed, predicted)
    return min(bound, yielding, meeting)


@kernel(inline=True)
def _bound_by_others(
    world: World, parameters: DriverParameters, now: Traffic, driver: DriverState, after: Floats
) -> float:
    """Return the largest acceleration [m/s²] of a driver with regard to the others.

    A driver that has waited long enough for one that stands passes it, if it may. `after` (N, 5)
    is as in `react`.
    """
    i = driver.vehicle
    clocks = now.drivers[:, CLOCK]
    limit = passing_limit(world, now.moving, clocks, now.passes, i)
    bound = _bound_by_limit(world, parameters, now, driver, limit, np.inf)
    blocker = -1
    for j in range(now.pose.shape[0]):
        if j in (i, world.ego) or not now.moving[j]:
            continue
        if now.present[j] and clocks[j] < driver.clock:
            bound = min(bound, _bound_by_leader(world, parameters, now, driver, j))
        limit, wait = _place_to_wait(world, now, driver, j)
        bound = min(bound, _bound_by_limit(world, parameters, now, driver, limit, wait))
        blocker = j if wait == np.inf else blocker
    if blocker >= 0 and _is_slow(driver, driver.rate * now.pose[i, 3]):
        after[i, WAITED] = max(now.drivers[i, WAITED] + world.step, after[i, WAITED])
        if after[i, WAITED] >= parameters.patience[i]:
            after[i, WAITED] = 0.0
            now.passes[i, blocker] = may_pass(world, now.moving, clocks, now.passes, i, blocker)
    return bound


@kernel(inline=True)
def _place_to_wait(world: World, now: Traffic, driver: DriverState, j: int) -> tuple[float, float]:
    """Return the clock [s] of the place where a driver waits for vehicle j, and how long."""
    i = driver.vehicle
    if now.passes[i, j] or now.passes[j, i]:
        return np.inf, 0.0
    other = now.drivers[j]
    order = world.order[i, j]
    return place_to_wait(order, world.cell, driver, other[CLOCK], other[RATE])


@kernel(inline=True)
def _bound_by_leader(
    world: World, parameters: DriverParameters, now: Traffic, driver: DriverState, j: int
) -> float:
    """Return the largest acceleration [m/s²] of a driver behind vehicle j, which is no ego."""
    box = np.empty(7)
    fill_footprint(now.pose[j], world.half[j], box)
    speed = now.drivers[j, RATE] * now.pose[j, 3]
    braking = -now.drivers[j, ACCELERATION]
    pose = now.pose[driver.vehicle]
    return leader_acceleration(world, parameters, driver, pose, j, box, speed, braking)


@kernel(inline=True)
def _bound_by_limit(
    world: World,
    parameters: DriverParameters,
    now: Traffic,
    driver: DriverState,
    limit: float,
    wait: float,
) -> float:
    """Return the largest acceleration [m/s²] towards a clock [s] that is free after a wait [s].

    Infinity if there is no wait. A driver that is near goes there, as far as the order permits.
    """
    i = driver.vehicle
    if limit == np.inf or wait == 0.0:
        return np.inf
    way = way_at(world, i, limit) - way_at(world, i, driver.clock)
    if way <= MIN_ROOM_M:
        return np.inf
    return approach_acceleration(parameters, i, way, driver.rate * now.pose[i, 3], wait)


@kernel(inline=True)
def _hurry_until(world: World, now: Traffic, i: int, ego_clock: float) -> float:
    """Return the clock [s] up to which a driver hurries: the earliest of those it reacts to.

    The ego is at `ego_clock` [s] at the start of the step.
    """
    target = np.inf
    clock = now.drivers[i, CLOCK]
    for j in range(now.pose.shape[0]):
        if clock < world.reacts[i, j]:
            target = min(target, ego_clock if j == world.ego else now.drivers[j, CLOCK])
    return min(target, world.time[-1]) if target < np.inf else -np.inf


@kernel(inline=True)
def _bound_by_lights(
    world: World, parameters: DriverParameters, now: Traffic, driver: DriverState, time: float
) -> float:
    """Return the largest acceleration [m/s²] of a late driver before a light at a time [s].

    It waits at the line if the light is red, or will be when it arrives at its certified speed.
    """
    bound = np.inf
    i = driver.vehicle
    for r in range(world.reds.shape[1]):
        line, begin, end = world.reds[i, r]
        arrival = time + line - driver.clock
        is_late = driver.clock < min(line, time - 1.5 * world.step)
        if is_late and time < end and begin <= arrival and min(time, begin) < end:
            wait = end - time if arrival < end or begin <= time else 0.0
            bound = min(bound, _bound_by_limit(world, parameters, now, driver, line, wait))
    return bound


@kernel(inline=True)
def _enforce(world: World, now: Traffic, time: float, after: Floats) -> None:
    """Advance the clocks as far as the order and red lights permit at the end of a step [s]."""
    begin = now.drivers[:, CLOCK].copy()
    end = after[:, CLOCK].copy()
    for i in range(end.shape[0]):
        for r in range(world.reds.shape[1]):
            line, red, green = world.reds[i, r]
            if i != world.ego and begin[i] <= line and red <= time + world.step and time < green:
                end[i] = min(end[i], line)
    enforce_order(world, now.moving, begin, now.passes, end)
    for i in range(after.shape[0]):
        if end[i] < after[i, CLOCK]:
            after[i, RATE] = min(after[i, RATE], (end[i] - begin[i]) / world.step)
            after[i, HELD] = 1.0
        after[i, CLOCK] = min(end[i], world.time[-1]) if now.moving[i] else end[i]
