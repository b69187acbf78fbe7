# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The longitudinal law of one driver: free driving, following, and approach to a limit.

Source: intelligent driver model, Treiber, Hennecke & Helbing 2000. The smaller of its free and
its interaction acceleration counts, as in IDM+ (Schakel, Knoop & van Arem 2012).
"""

from typing import NamedTuple

import numpy as np

from scenario_gen.closed_loop.coordination_space import pose_at, World
from scenario_gen.numerics import Bools, Floats, Ints
from scenario_gen.numerics.boxes import boxes_meet, fill_footprint
from scenario_gen.numerics.kernels import B, B1, F, F1, I1, kernel, named

GAP_BISECTION_STEPS = 4  # within a cell of the clock, so that the gap does not jump


class DriverModel(NamedTuple):
    """Constants of the driver model. `ClosedLoopConfig` has what users may change.

    Attributes:
        lookahead_m: a driver ignores vehicles that are farther ahead on its path.
        min_moving_speed_mps: a certified speed below it counts as standing, and the rate is 1.
        min_gap_reduction_m: a driver brakes for a vehicle ahead only if the gap is smaller than
            the certified one by this.
        comfortable_jerk_mps3: largest jerk where comfortable braking suffices; it rises to that of
            an emergency where three times as much is needed.
        foot_time_s: mean delay of braking while the foot moves.
        braking_margin_ratio: of the braking of a driver, to the braking that just suffices.
        clock_tolerance_s: uncertainty of a clock.
        closing_time_s: time in which a driver closes up to the clock that it reacts to.
        clearance_m: distance that a driver leaves to the ego.
        stopping_margin_m: distance from a place that the ego passes first.
        same_direction_ratio: least cosine of the angle between two headings of one direction.
        extra_braking_mps2: an ego that brakes harder than its witness by this goes on braking.
        max_ego_rate_ratio: an ego that is faster than its witness by this does not slow down.
        ego_response_s: delay of an ego that brakes for a pedestrian on its lane.
        walker_braking_mps2: deceleration of a pedestrian: 1.4 m/s to 0 within a step of 0.7 m.
        max_blocking_speed_mps: patience counts for a slower driver behind a slower ego.
        entry_gap_m: free distance ahead of and behind a vehicle that enters the scene.
        braking_tolerance_mps: change of speed in a step beyond the strongest braking.
        jerk_tolerance_mps: change of speed in a step beyond the jerk limit.
    """

    lookahead_m: float = 60.0
    min_moving_speed_mps: float = 0.02
    min_gap_reduction_m: float = 0.1
    comfortable_jerk_mps3: float = 4.0
    foot_time_s: float = 0.4
    braking_margin_ratio: float = 1.25
    clock_tolerance_s: float = 0.1
    closing_time_s: float = 2.0
    clearance_m: float = 0.3
    stopping_margin_m: float = 1.0
    same_direction_ratio: float = 0.7
    extra_braking_mps2: float = 1.0
    max_ego_rate_ratio: float = 1.05
    ego_response_s: float = 1.0
    walker_braking_mps2: float = 1.5
    max_blocking_speed_mps: float = 1.5
    entry_gap_m: float = 3.0
    braking_tolerance_mps: float = 0.2
    jerk_tolerance_mps: float = 0.05


MODEL = DriverModel()

CLOCK, RATE, ACCELERATION, WAITED, HELD = range(5)
"""Columns of the drivers: those of `State`, then 1 where the order held a driver back."""
EGO_CLOCK, EGO_RATE, ON_PATH = range(6, 9)
"""Columns of `State.seen` behind those of `EgoState`."""


class DriverState(NamedTuple):
    """A driver at the start of a step.

    Attributes:
        vehicle: index of its vehicle.
        clock: certified time [s] at which its vehicle is where it is now.
        rate: of that clock.
        acceleration: in the previous step [m/s²].
    """

    vehicle: int
    clock: float
    rate: float
    acceleration: float


class DriverParameters(NamedTuple):
    """Parameters of N drivers, from `ClosedLoopConfig`, their recorded motion and draws.

    Attributes:
        headway: (N,) desired time gaps [s].
        standstill: gap at standstill [m].
        acceleration: (N,) largest accelerations [m/s²].
        comfortable: (N,) comfortable braking [m/s²].
        strongest: (N,) strongest braking [m/s²], at most that of the vehicle's type.
        jerk: largest jerk [m/s³].
        patience: (N,) waiting times [s] before a driver goes ahead of a vehicle that stands.
        margin: (N,) least time [s] between a driver that goes ahead of the ego, and the ego.
        foresight: (N,) prediction horizons [s].
        yields: (N,) whether drivers wait for the ego where the template did.
        reacts: whether drivers react at all.
        delay: (N,) reaction times in steps.
    """

    headway: Floats
    standstill: float
    acceleration: Floats
    comfortable: Floats
    strongest: Floats
    jerk: float
    patience: Floats
    margin: Floats
    foresight: Floats
    yields: Bools
    reacts: bool
    delay: Ints


DRIVER_PARAMETERS = named(DriverParameters, F1, F, F1, F1, F1, F, F1, F1, F1, B1, B, I1)


@kernel(inline=True, forced=True)
def _cell_way(cells: Floats, k: int) -> float:
    """Return the way [m] in cell k of the cells (K, 8) of one vehicle; the last one goes on."""
    last = cells.shape[0] - 1
    k = min(k, last - 1)
    return float(cells[k + 1, 7] - cells[k, 7]) if k >= 0 else 0.0


@kernel(inline=True)
def way_at(world: World, i: int, clock: float) -> float:
    """Return the way [m] that vehicle i has driven at a clock [s]."""
    cells = world.cells[i]
    k = min(int(clock / world.cell), cells.shape[0] - 1)
    return float(cells[k, 7] + _cell_way(cells, k) * (clock / world.cell - k))


@kernel(inline=True)
def clock_after(world: World, i: int, clock: float, distance: float, target: float) -> float:
    """Return the clock [s] of vehicle i after a distance [m] on its path.

    It ends where the vehicle stands in the certified motion. Waits that are over at a target
    clock [s] are skipped.
    """
    if distance <= 0.0:
        return clock
    cells = world.cells[i]
    last = cells.shape[0] - 1
    least = MODEL.min_moving_speed_mps * world.cell
    goal = way_at(world, i, clock) + distance
    k = min(int(clock / world.cell), last)
    while k < last and cells[k + 1, 7] < goal:
        k += 1
        if (k + 1) * world.cell > target and _cell_way(cells, k) < least:
            return float(k * world.cell)
    way = _cell_way(cells, k)
    while k < last and way < least and (k + 2) * world.cell <= target:
        k += 1
        way = _cell_way(cells, k)
    if way < least:
        return float(max(clock, (k + 1) * world.cell))
    return float(max(clock, (k + (goal - cells[k, 7]) / way) * world.cell))


@kernel(inline=True)
def stopping_acceleration(parameters: DriverParameters, i: int, way: float, speed: float) -> float:
    """Return the largest acceleration [m/s²] of driver i that stops at a place.

    It falls to comfortable braking where that just suffices; then the driver brakes as hard as
    necessary, with a margin.

    Args:
        parameters: of the drivers.
        i: index of the driver.
        way: to the place [m].
        speed: of the driver [m/s].
    """
    a = parameters.acceleration[i]
    b = parameters.comfortable[i]
    needed = speed * speed / (2.0 * max(way, 0.01))
    share = needed / b
    return float(max(a - (a + b) * share * share, -max(b, MODEL.braking_margin_ratio * needed)))


@kernel(inline=True)
def _way_to_stand(world: World, i: int, clock: float, target: float) -> float:
    """Return the way [m] to where vehicle i stands next in its certified motion after a clock [s].

    Infinity if it does not stand within the lookahead. Waits that are over at a target clock [s]
    do not count.
    """
    cells = world.cells[i]
    last = cells.shape[0] - 1
    start = way_at(world, i, clock)
    for k in range(min(int(clock / world.cell), last) + 1, last):
        way = cells[k, 7] - start
        if way > MODEL.lookahead_m:
            return np.inf
        is_over = (k + 1) * world.cell <= target
        if not is_over and _cell_way(cells, k) < MODEL.min_moving_speed_mps * world.cell:
            return float(way)
    return np.inf if world.leaves[i] else way_at(world, i, world.time[-1]) - start


@kernel(inline=True)
def following_acceleration(
    parameters: DriverParameters,
    i: int,
    gap: float,
    speed: float,
    leader_speed: float,
    leader_braking: float,
) -> float:
    """Return the acceleration [m/s²] of driver i behind a leader: the interaction term of IDM.

    It is no harder than comfortable braking, or than the braking with which the driver stops
    behind the leader if that is harder, with a margin.

    Args:
        parameters: of the drivers.
        i: index of the driver.
        gap: to the leader [m].
        speed: of the driver [m/s].
        leader_speed: along the path of the driver [m/s].
        leader_braking: deceleration [m/s²] with which the leader may stop.
    """
    a = parameters.acceleration[i]
    b = parameters.comfortable[i]
    closing = speed * (speed - leader_speed) / (2.0 * np.sqrt(a * b))
    wanted = parameters.standstill + max(0.0, speed * parameters.headway[i] + closing)
    share = wanted / max(gap, 0.1)
    wish = a * (1.0 - share * share)
    stopping_way = leader_speed * leader_speed / (2.0 * max(leader_braking, b))
    room = gap + stopping_way - speed * MODEL.foot_time_s
    needed = speed * speed / (2.0 * max(room, 0.1))
    return float(max(wish, -max(b, MODEL.braking_margin_ratio * needed)))


@kernel(inline=True)
def approach_acceleration(
    parameters: DriverParameters, i: int, way: float, speed: float, wait: float
) -> float:
    """Return the acceleration [m/s²] of driver i towards a place that is free after a wait.

    It arrives when the wait is over, as far as it can without standing before, and brakes no
    harder than for a vehicle that stands. Otherwise it stops at the place.

    Args:
        parameters: of the drivers.
        i: index of the driver.
        way: to the place [m].
        speed: of the driver [m/s].
        wait: time until the place is free [s].
    """
    behind = following_acceleration(parameters, i, way + parameters.standstill, speed, 0.0, 0.0)
    if speed * wait < 2.0 * way:
        return max(behind, 2.0 * (way - speed * wait) / (wait * wait))
    needed = speed * speed / (2.0 * max(way, 0.01))
    return min(max(behind, -needed), stopping_acceleration(parameters, i, way, speed))


@kernel(inline=True, forced=True)
def _smooth_acceleration(difference: float, jerk: float, h: float) -> float:
    """Return the largest acceleration [m/s²] towards a speed that is `difference` [m/s] away.

    From it the jerk [m/s³] can bring the acceleration to 0 when the speed is reached.
    """
    if difference <= 0.5 * jerk * h * h:
        return max(difference, 0.0) / h
    return float(np.sqrt(2.0 * jerk * difference)) - 0.5 * jerk * h


@kernel(inline=True)
def _free_acceleration(
    world: World, a: float, driver: DriverState, pose: Floats, target: float
) -> float:
    """Return the free acceleration [m/s²] of a driver towards its certified speed.

    Towards a later `target` clock [s] it drives as fast as its path allows.
    """
    i = driver.vehicle
    rate = driver.rate
    if target <= driver.clock + MODEL.clock_tolerance_s:
        return float(a * (1.0 - rate**4) + rate * rate * pose[4])
    k = min(int(driver.clock / world.cell), world.free.shape[1] - 1)
    behind = way_at(world, i, target) - way_at(world, i, driver.clock)
    wanted = min(world.free[i, k], pose[3] + behind / MODEL.closing_time_s)
    ratio = rate * pose[3] / max(wanted, pose[3], 0.1)
    return float(a * (1.0 - ratio**4))


@kernel(inline=True)
def _next_stop(
    world: World, parameters: DriverParameters, driver: DriverState, speed: float, target: float
) -> tuple[float, float]:
    """Return the acceleration [m/s²] with which a driver stops where it stands as certified.

    Also the clock [s] up to which it skips waits: the target, or infinity if no braking suffices.
    """
    i = driver.vehicle
    strongest = parameters.strongest[i]
    way = _way_to_stand(world, i, driver.clock, target)
    if speed * speed <= 2.0 * strongest * way or speed <= strongest * world.step:
        return stopping_acceleration(parameters, i, way, speed), target
    return np.inf, np.inf


@kernel(inline=True)
def drive_step(
    world: World,
    parameters: DriverParameters,
    driver: DriverState,
    pose: Floats,
    bound: float,
    target: float,
) -> DriverState:
    """Return a driver after a step, at its certified pose (5,), which is changed.

    On the record, with nothing in the way, the motion is the certified one, whatever its jerk is.
    A faster driver brakes for the place where its certified motion stands next, unless no braking
    suffices: it then goes on.

    Args:
        world: the scenario and the step.
        parameters: of the drivers.
        driver: at the start of the step.
        pose: (5,) its certified pose, with speed [m/s] and acceleration [m/s²].
        bound: largest acceleration [m/s²] that the situation ahead permits.
        target: clock [s] up to which the driver may hurry.
    """
    i = driver.vehicle
    h = world.step
    rate = driver.rate
    hurries = target > driver.clock + MODEL.clock_tolerance_s
    stands = pose[3] < MODEL.min_moving_speed_mps
    if not hurries and (stands or (rate == 1.0 and bound >= pose[4])):
        return DriverState(i, driver.clock + h, 1.0, pose[4] * (not stands))
    speed = rate * pose[3]
    skipped = target
    if rate > 1.0 or hurries:
        stop, skipped = _next_stop(world, parameters, driver, speed, target)
        bound = min(bound, stop)
    comfortable = parameters.comfortable[i]
    free = _free_acceleration(world, parameters.acceleration[i], driver, pose, target)
    jerk = parameters.jerk
    if not world.walks[i]:
        urgency = min(max(-0.5 * (bound / comfortable + 1.0), 0.0), 1.0)
        calm = min(jerk, MODEL.comfortable_jerk_mps3)
        jerk = calm + urgency * (jerk - calm)
    slowing = max(comfortable, -rate * rate * pose[4])
    gain = min(max(free, -slowing), bound, driver.acceleration + jerk * h)
    least = max(-parameters.strongest[i], driver.acceleration - jerk * h)
    gain = max(gain, least, -_smooth_acceleration(speed, jerk, h))
    new_speed = max(speed + gain * h, 0.0)
    clock = clock_after(world, i, driver.clock, 0.5 * (speed + new_speed) * h, skipped)
    pose_at(world.time, world.motion[i], clock, pose)
    if pose[3] < MODEL.min_moving_speed_mps:
        return DriverState(i, clock, 1.0 if new_speed > 0.0 else 0.0, gain)
    joins = not hurries and rate <= 1.0
    if joins and new_speed >= pose[3] - 0.5 * jerk * h * h:
        return DriverState(i, clock, 1.0, gain)
    return DriverState(i, clock, new_speed / pose[3], gain)


@kernel(inline=True)
def _contact_clock(world: World, i: int, k: int, clock: float, box: Floats) -> float:
    """Return the clock [s] in cell k, `clock` or later, at which vehicle i meets a box (7,).

    Infinity if it does not meet the box at the end of the cell: it passes by.
    """
    pose = np.empty(5)
    footprint = np.empty(7)
    low = max(k * world.cell, clock)
    high = np.inf
    tried = (k + 1) * world.cell
    for _ in range(1 + GAP_BISECTION_STEPS):
        pose_at(world.time, world.motion[i], tried, pose)
        fill_footprint(pose, world.half[i], footprint)
        if boxes_meet(footprint, box):
            high = tried
        elif high == np.inf:
            return high
        else:
            low = tried
        tried = 0.5 * (low + high)
    return high


@kernel(inline=True)
def gap_ahead(world: World, i: int, clock: float, box: Floats, pose: Floats) -> tuple[float, int]:
    """Return the gap [m] from vehicle i to a box on its path, and the cell in which they meet.

    Infinity and -1 if they do not meet within the lookahead, or if the box is behind.

    Args:
        world: the scenario.
        i: index of the vehicle.
        clock: its clock [s].
        box: (7,) the box.
        pose: (5,) the certified pose at the clock.
    """
    cells = world.cells[i]
    start = way_at(world, i, clock)
    for k in range(min(int(clock / world.cell), cells.shape[0] - 1), cells.shape[0]):
        if cells[k, 7] - start > MODEL.lookahead_m:
            break
        if boxes_meet(cells[k], box):
            along = (box[0] - pose[0]) * cells[k, 2] + (box[1] - pose[1]) * cells[k, 3]
            if along <= 0.0:
                break
            contact = _contact_clock(world, i, k, clock, box)
            if contact < np.inf:
                return max(way_at(world, i, contact) - start, 0.0), k
    return np.inf, -1


@kernel(inline=True)
def leader_acceleration(
    world: World,
    parameters: DriverParameters,
    driver: DriverState,
    pose: Floats,
    j: int,
    box: Floats,
    speed: float,
    braking: float,
) -> float:
    """Return the largest acceleration [m/s²] of a driver behind vehicle j on its path.

    Infinity if the gap is not smaller than in the certified execution at the same clock. A driver
    that the record shows nearer than the model wants keeps that habit.

    Args:
        world: the scenario.
        parameters: of the drivers.
        driver: the follower.
        pose: (5,) its certified pose.
        j: index of the leader.
        box: (7,) footprint of the leader.
        speed: of the leader [m/s].
        braking: deceleration of the leader [m/s²].
    """
    i = driver.vehicle
    gap, cell = gap_ahead(world, i, driver.clock, box, pose)
    if cell < 0:
        return np.inf
    cos = world.cells[i, cell, 2]
    sin = world.cells[i, cell, 3]
    along = speed * max(box[2] * cos + box[3] * sin, 0.0)
    bound = following_acceleration(parameters, i, gap, driver.rate * pose[3], along, braking)
    leader = np.empty(5)
    certified_box = np.empty(7)
    clock = driver.clock + world.step * (j == world.ego)  # the ego has already moved
    pose_at(world.time, world.motion[j], clock, leader)
    fill_footprint(leader, world.half[j], certified_box)
    certified_gap, _ = gap_ahead(world, i, driver.clock, certified_box, pose)
    if gap >= certified_gap - MODEL.min_gap_reduction_m:
        return np.inf
    along = leader[3] * max(certified_box[2] * cos + certified_box[3] * sin, 0.0)
    certified = following_acceleration(parameters, i, certified_gap, pose[3], along, 0.0)
    return float(bound + max(pose[4] - certified, 0.0))
