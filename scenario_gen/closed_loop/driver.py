# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The speed of one driver: its change in one step, and braking behind a vehicle ahead."""

from typing import NamedTuple

import numpy as np

from scenario_gen.closed_loop.coordination_space import pose_at, World
from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.boxes import boxes_meet, fill_box
from scenario_gen.numerics.kernels import B, F, F1, I1, kernel, named

NO_BRAKING_MPS2 = -1e3  # a braking that limits nothing: the driver accelerates as it likes
GAP_BISECTION_STEPS = 4  # within a cell of the clock, so that the gap does not jump


class DriverModel(NamedTuple):
    """Constants of the driver model. `ClosedLoopConfig` has what users may change.

    Attributes:
        lookahead_m: a driver ignores vehicles that are farther ahead on its path.
        min_moving_speed_mps: a certified speed below it counts as standing, and the rate is 1.
        min_gap_reduction_m: a driver brakes for a vehicle ahead only if the gap is smaller than
            the certified one by this.
        min_divisor_mps: floor of a speed that divides a distance.
        clearance_m: a driver that brakes for the ego leaves this distance.
        lateral_clearance_m: distance to an ego that has left the path of its witness.
        same_direction_ratio: least cosine of the angle between two headings of one direction.
        clock_tolerance_s: uncertainty of the clock of the ego.
        extra_braking_mps2: an ego that brakes harder than its witness by this goes on braking.
        ego_response_s: delay of an ego that brakes for a pedestrian on its lane.
        max_ego_rate_ratio: an ego that is faster than its witness by this does not slow down.
        walker_braking_mps2: deceleration of a pedestrian: 1.4 m/s to 0 within a step of 0.7 m.
        creep_speed_mps: the prediction lets every driver creep, so that no two drivers wait for
            each other.
        max_blocking_speed_mps: a slower ego blocks a driver that waits for it.
        min_lead_s: a driver whose clock may run ahead by this does not wait for another one.
        approach_s: time in which a creeping driver reaches the end of its permitted way.
        entry_gap_m: free distance ahead of and behind a vehicle that enters the scene.
        braking_tolerance_mps: change of speed in a step beyond the strongest braking.
        jerk_tolerance_mps: change of speed in a step beyond the jerk limit.
    """

    lookahead_m: float = 60.0
    min_moving_speed_mps: float = 0.02
    min_gap_reduction_m: float = 0.1
    min_divisor_mps: float = 0.2
    clearance_m: float = 0.3
    lateral_clearance_m: float = 0.5
    same_direction_ratio: float = 0.7
    clock_tolerance_s: float = 0.05
    extra_braking_mps2: float = 1.0
    ego_response_s: float = 1.0
    max_ego_rate_ratio: float = 1.05
    walker_braking_mps2: float = 1.5
    creep_speed_mps: float = 0.5
    max_blocking_speed_mps: float = 1.5
    min_lead_s: float = 1.0
    approach_s: float = 1.0
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
    """Parameters of the other drivers; most are fields of `ClosedLoopConfig`.

    Attributes:
        headway: [s].
        standstill: gap at standstill [m].
        acceleration: largest acceleration [m/s²].
        comfortable: comfortable braking [m/s²].
        strongest: (N,) strongest braking [m/s²], at most that of the vehicle's type.
        jerk: largest jerk [m/s³].
        patience: waiting time [s] before a driver goes ahead of a standing ego.
        foresight: prediction horizon [s].
        yields: whether drivers wait for the ego where the template did.
        reacts: whether drivers react at all.
        delay: (N,) reaction times in steps.
    """

    headway: float
    standstill: float
    acceleration: float
    comfortable: float
    strongest: Floats
    jerk: float
    patience: float
    foresight: float
    yields: bool
    reacts: bool
    delay: Ints


DRIVER_PARAMETERS = named(DriverParameters, F, F, F, F, F1, F, F, F, B, B, I1)


@kernel(inline=True, forced=True)
def _smooth_acceleration(difference: float, jerk: float, h: float) -> float:
    """Return the largest acceleration [m/s²] towards a speed that is `difference` [m/s] away.

    From it the jerk [m/s³] can bring the acceleration to 0 when the speed is reached.
    """
    if difference <= 0.5 * jerk * h * h:
        return max(difference, 0.0) / h
    return float(np.sqrt(2.0 * jerk * difference)) - 0.5 * jerk * h


@kernel(inline=True, forced=True)
def next_rate(
    parameters: DriverParameters,
    driver: DriverState,
    pose: Floats,
    braking: float,
    floor: float,
    h: float,
) -> float:
    """Return the rate of a clock after a step in which its driver brakes.

    The acceleration changes by the jerk at most. Without an obstacle the rate returns to 1. At 1
    the motion is the certified one, whatever its jerk is.

    Args:
        parameters: of the drivers.
        driver: at the start of the step.
        pose: (5,) its certified pose, with speed [m/s] and acceleration [m/s²].
        braking: deceleration [m/s²]; a negative one limits the acceleration; NO_BRAKING_MPS2 does
            not limit it.
        floor: speed [m/s] at which braking ends.
        h: duration of the step [s].
    """
    v = pose[3]
    a = pose[4]
    r = driver.rate
    previous = driver.acceleration
    jerk = parameters.jerk
    if v < MODEL.min_moving_speed_mps:
        return 1.0
    speed = r * v
    end_speed = max(v + r * a * h, MODEL.min_moving_speed_mps)  # certified, approximate
    free_rate = 1.0
    if r < 1.0:
        wanted = r * a + _smooth_acceleration(v - speed, jerk, h)
        gain = min(max(parameters.acceleration, r * r * a), wanted, previous + jerk * h)
        free_rate = min(max((speed + gain * h) / end_speed, 0.0), 1.0)
    if braking <= NO_BRAKING_MPS2:
        return free_rate
    change = 0.0
    if speed > floor or braking <= 0.0:
        change = -min(braking, _smooth_acceleration(speed - floor, jerk, h))
    new_speed = max(speed + max(change, previous - jerk * h) * h, floor)
    first = min(new_speed / end_speed, free_rate)
    mean_speed = max(v + 0.5 * (r + first) * a * h, MODEL.min_moving_speed_mps)
    return float(min(new_speed / mean_speed, free_rate))


@kernel(inline=True, forced=True)
def drive_step(
    parameters: DriverParameters,
    driver: DriverState,
    time: Floats,
    motion: Floats,
    pose: Floats,
    braking: float,
    h: float,
) -> DriverState:
    """Return a driver after a step of h [s] of braking [m/s²]; update its certified pose (5,).

    Times (T,) and motion (T, 6) are those of its vehicle.
    """
    speed = driver.rate * pose[3]
    rate = next_rate(parameters, driver, pose, braking, 0.0, h)
    clock = driver.clock + 0.5 * (driver.rate + rate) * h
    pose_at(time, motion, clock, pose)
    return DriverState(driver.vehicle, clock, rate, (rate * pose[3] - speed) / h)


@kernel(inline=True, forced=True)
def _distance_at(cells: Floats, k: int, share: float) -> float:
    """Return the driven way [m] at a share of cell k of the cells (K, 8) of one vehicle."""
    start = cells[k, 7]
    end = cells[k + 1, 7] if k + 1 < cells.shape[0] else start
    return float(start + (end - start) * share)


@kernel(inline=True)
def _contact_clock(world: World, i: int, k: int, clock: float, box: Floats) -> float:
    """Return the clock [s] in cell k, `clock` or later, at which vehicle i meets a box (7,)."""
    pose = np.empty(5)
    footprint = np.empty(7)
    low = max(k * world.cell, clock)
    high = (k + 1) * world.cell
    for _ in range(GAP_BISECTION_STEPS):
        middle = 0.5 * (low + high)
        pose_at(world.time, world.motion[i], middle, pose)
        fill_box(pose[0], pose[1], pose[2], world.half[i, 0], world.half[i, 1], footprint)
        if boxes_meet(footprint, box):
            high = middle
        else:
            low = middle
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
    cell = world.cell
    first = min(int(clock / cell), cells.shape[0] - 1)
    start = _distance_at(cells, first, min(clock / cell - first, 1.0))
    for k in range(first, cells.shape[0]):
        if cells[k, 7] - start > MODEL.lookahead_m:
            break
        if boxes_meet(cells[k], box):
            along = (box[0] - pose[0]) * cells[k, 2] + (box[1] - pose[1]) * cells[k, 3]
            if along <= 0.0:
                break
            share = _contact_clock(world, i, k, clock, box) / cell - k
            return float(max(_distance_at(cells, k, share) - start, 0.0)), k
    return np.inf, -1


@kernel(inline=True)
def _idm_braking(
    gap: float, speed: float, leader_speed: float, parameters: DriverParameters
) -> float:
    """Return the braking [m/s²] of the intelligent driver model, 0 where the gap is wide enough.

    The free term of the model is not used: the certificate replaces it.
    Source: Treiber, Hennecke & Helbing 2000.

    Args:
        gap: to the leader [m].
        speed: of the driver [m/s].
        leader_speed: along the path of the driver [m/s].
        parameters: of the drivers.
    """
    a = parameters.acceleration
    b = parameters.comfortable
    closing = speed * (speed - leader_speed) / (2.0 * np.sqrt(a * b))
    wanted_gap = parameters.standstill + max(0.0, speed * parameters.headway + closing)
    share = wanted_gap / max(gap, 0.1)
    return float(min(max(a * (share * share - 1.0), 0.0), b))


@kernel(inline=True)
def following_braking(
    world: World,
    parameters: DriverParameters,
    driver: DriverState,
    pose: Floats,
    j: int,
    box: Floats,
    speed: float,
    offset: float,
) -> float:
    """Return the braking [m/s²] of a driver behind vehicle j on its path.

    NO_BRAKING_MPS2 if the gap is not smaller than in the certified execution at the same clock.

    Args:
        world: the scenario.
        parameters: of the drivers.
        driver: the follower.
        pose: (5,) its certified pose.
        j: index of the leader.
        box: (7,) footprint of the leader.
        speed: of the leader [m/s].
        offset: time [s] from the clock of the driver to that of the leader's footprint.
    """
    i = driver.vehicle
    gap, cell = gap_ahead(world, i, driver.clock, box, pose)
    if cell < 0:
        return NO_BRAKING_MPS2
    cos = world.cells[i, cell, 2]
    sin = world.cells[i, cell, 3]
    leader_speed = speed * max(box[2] * cos + box[3] * sin, 0.0)
    braking = _idm_braking(gap, driver.rate * pose[3], leader_speed, parameters)
    if braking <= 0.0:
        return NO_BRAKING_MPS2
    certified = np.empty(5)
    certified_box = np.empty(7)
    pose_at(world.time, world.motion[j], driver.clock + offset, certified)
    half = world.half[j]
    fill_box(certified[0], certified[1], certified[2], half[0], half[1], certified_box)
    certified_gap, _ = gap_ahead(world, i, driver.clock, certified_box, pose)
    is_closer = gap < certified_gap - MODEL.min_gap_reduction_m
    return braking if is_closer else NO_BRAKING_MPS2
