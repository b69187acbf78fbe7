# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One compiled step of the closed loop: the ego on the path of its witness, and the reactions."""

from typing import NamedTuple

import numpy as np

from scenario_gen.closed_loop.coordination_space import pose_at, WORLD, World
from scenario_gen.closed_loop.driver import (
    ACCELERATION,
    CLOCK,
    DRIVER_PARAMETERS,
    DriverParameters,
    EGO_CLOCK,
    HELD,
    MODEL,
    RATE,
    WAITED,
)
from scenario_gen.closed_loop.presence import is_certified, is_in_way, place_at
from scenario_gen.closed_loop.traffic_model import react
from scenario_gen.numerics import Bools, Floats
from scenario_gen.numerics.boxes import boxes_meet, fill_footprint
from scenario_gen.numerics.kernels import B1, F, F2, I, kernel, OUT2, OUTB2
from scenario_gen.numerics.loops import copy_to


class WitnessMatching(NamedTuple):
    """Constants that match the ego to the path of its witness.

    Attributes:
        window_m: search distance beyond the way that the ego has moved.
        search_step_s: time between two candidates of the search.
        min_moving_speed_mps: a slower witness stands, so speed ratios are meaningless.
        same_m: position difference of an ego that drives as its witness.
        same_mps: speed difference of such an ego.
        max_delay_s: delay of an ego that stands together with its witness.
        max_offset_m: lateral distance at which the ego has left the path.
        max_heading_error_rad: heading error at which it has left the path.
    """

    window_m: float = 5.0
    search_step_s: float = 0.05
    min_moving_speed_mps: float = 0.3
    same_m: float = 0.05
    same_mps: float = 0.05
    max_delay_s: float = 0.15
    max_offset_m: float = 1.5
    max_heading_error_rad: float = 0.5


MATCHING = WitnessMatching()


@kernel(inline=True)
def _nearest_clock(
    now: float, time: Floats, motion: Floats, body: Floats, previous: float
) -> float:
    """Return the clock [s], `previous` or later, at which the witness is nearest to a body (6,).

    Of equally near ones the last that is not after `now` [s].
    """
    step = MATCHING.search_step_s
    pose = np.empty(5)
    pose_at(time, motion, previous, pose)
    x = pose[0]
    y = pose[1]
    reach = np.hypot(body[0] - x, body[1] - y) + MATCHING.window_m
    way = 0.0
    best_gap = np.inf
    best = previous
    t = previous
    while t <= time[-1] and way <= reach:
        pose_at(time, motion, t, pose)
        way += np.hypot(pose[0] - x, pose[1] - y)
        x = pose[0]
        y = pose[1]
        gap = np.hypot(body[0] - x, body[1] - y)
        if gap < best_gap - 1e-6 or (gap < best_gap + 1e-6 and t <= now):
            best_gap = min(gap, best_gap)
            best = t
        t += step
    pose_at(time, motion, best, pose)
    if pose[3] > 0.5:
        along = (body[0] - pose[0]) * np.cos(pose[2]) + (body[1] - pose[1]) * np.sin(pose[2])
        best += min(max(along / pose[3], -step), step)
    return float(min(max(best, previous), time[-1]))


@kernel(inline=True)
def _clock_rate(now: float, clock: float, speed: float, witness_speed: float) -> float:
    """Return the rate of the clock [s] of an ego from its speed and that of its witness [m/s]."""
    witness_moves = witness_speed > MATCHING.min_moving_speed_mps
    if abs(speed - witness_speed) < MATCHING.same_mps:
        is_punctual = clock >= now - MATCHING.max_delay_s
        return 1.0 if witness_moves or is_punctual else 0.0
    if witness_moves:
        return speed / witness_speed
    return 1.0 if speed > 0.1 else 0.0


@kernel(inline=True)
def locate_ego(
    now: float, time: Floats, motion: Floats, body: Floats, previous: float, out: Floats
) -> None:
    """Write the clock of the ego on the path of its witness, its rate, and 1 if it is on the path.

    Args:
        now: certified time [s].
        time: (T,) of the scenario.
        motion: (T, 6) of the witness, as in `World`.
        body: (6,) the ego, as in `EgoState`.
        previous: its clock one step ago [s]; a clock never runs back.
        out: (3,).
    """
    pose = np.empty(5)
    pose_at(time, motion, now, pose)
    offset = np.hypot(body[0] - pose[0], body[1] - pose[1])
    if previous <= now <= time[-1] and offset < MATCHING.same_m:
        out[0] = now
    else:
        out[0] = _nearest_clock(now, time, motion, body, previous)
    pose_at(time, motion, out[0], pose)
    cos = np.cos(pose[2])
    sin = np.sin(pose[2])
    heading_error = (body[2] - pose[2] + np.pi) % (2.0 * np.pi) - np.pi
    lateral = abs((body[1] - pose[1]) * cos - (body[0] - pose[0]) * sin)
    out[1] = _clock_rate(now, out[0], body[3], pose[3])
    has_left = lateral > MATCHING.max_offset_m
    has_turned = abs(heading_error) > MATCHING.max_heading_error_rad
    out[2] = 0.0 if has_left or has_turned else 1.0


@kernel(inline=True)
def _fill_vehicles(world: World, drivers: Floats, out: Floats) -> None:
    """Write x, y [m], yaw [rad], speed [m/s] (N, 5) of all vehicles.

    The rows of the drivers (N, 5) begin with clock [s] and rate.
    """
    pose = np.empty(5)
    for i in range(out.shape[0]):
        place_at(world, i, drivers[i, CLOCK], pose)
        copy_to(out[i, :3], pose)
        out[i, 3] = pose[3] * drivers[i, RATE]


@kernel(inline=True)
def _update_acceleration(
    world: World,
    parameters: DriverParameters,
    i: int,
    before: Floats,
    after: Floats,
    speed: float,
) -> None:
    """Write whether the order forced vehicle i, and the acceleration of its driver.

    Args:
        world: the scenario and the step.
        parameters: of the drivers.
        i: index of the vehicle.
        before: (4,) its driver before the step.
        after: (5,) its driver after the step; HELD and ACCELERATION are changed.
        speed: of the vehicle after the step [m/s].
    """
    h = world.step
    pose = np.empty(5)
    place_at(world, i, before[CLOCK], pose)
    strongest = parameters.strongest[i]
    gained = (speed - before[RATE] * pose[3]) / h
    is_certified = before[RATE] == 1.0 and after[RATE] == 1.0
    if not is_certified and gained < -strongest - MODEL.braking_tolerance_mps / h:
        after[HELD] = 1.0
    if after[HELD] > 0.0:
        sudden = (
            min(before[ACCELERATION], 0.0) - parameters.jerk * h - MODEL.jerk_tolerance_mps / h
        )
        hardest = max(sudden, -strongest - MODEL.braking_tolerance_mps / h)
        after[HELD] = 1.0 if gained < hardest else 0.0
    if after[HELD] == 0.0 or speed == 0.0:
        after[ACCELERATION] = gained if speed > 0.0 else 0.0
    after[ACCELERATION] = min(max(after[ACCELERATION], -strongest), parameters.acceleration[i])


@kernel(inline=True)
def _update_presence(world: World, after: Floats, may_stay: bool, vehicles: Floats) -> None:
    """Write who is on the scene; who leaves in the ego's way drives on if it may stay."""
    for i in range(len(world.motion)):
        clock = after[i, CLOCK]
        was_present = vehicles[i, 4] > 0.0
        vehicles[i, 4] = i == world.ego or clock >= world.spans[i, 0]
        if i != world.ego and world.leaves[i] and clock >= world.spans[i, 1]:
            vehicles[i, 4] = may_stay and was_present and is_in_way(world, i, vehicles)


@kernel(WORLD, DRIVER_PARAMETERS, F, F2, OUT2, OUTB2, OUT2, OUT2)
def advance(
    world: World,
    parameters: DriverParameters,
    now: float,
    before: Floats,
    seen: Floats,
    passes: Bools,
    after: Floats,
    vehicles: Floats,
) -> None:
    """Advance all vehicles by one step.

    Args:
        world: the scenario and the step.
        parameters: of the other drivers.
        now: certified time at the end of the step [s].
        before: (N, 4) columns CLOCK … of `driver`.
        seen: (K, 9) as in `State`, at the end of the step; the clock of the ego, its rate and
            whether it is on the path are written.
        passes: (N, N) as in `State`; pairs whose order is drawn again are added.
        after: (N, 5) output, at the end of the step; HELD is 1 where the order makes a driver
            brake harder than the strongest braking, or more suddenly than the jerk limit.
        vehicles: (N, 5) output, x, y [m], yaw [rad], speed [m/s] at the end of the step, and 1 if
            the vehicle is on the scene then; before, 1 if it was on the scene at the start.
    """
    time = world.time
    ego = world.ego
    body = seen[0, :EGO_CLOCK]
    matched = seen[0, EGO_CLOCK:]
    locate_ego(now, time, world.motion[ego], body, before[ego, CLOCK], matched)
    if parameters.reacts:
        react(world, parameters, seen, before, vehicles[:, 4] > 0.0, passes, now, after)
    else:
        after[:] = 0.0
        after[:, CLOCK] = min(now, time[-1])
        after[:, RATE] = 1.0
    after[ego, CLOCK] = matched[0]
    after[ego, RATE] = matched[1]
    after[ego, WAITED] = 0.0
    after[ego, HELD] = 0.0
    _fill_vehicles(world, after, vehicles)
    copy_to(vehicles[ego, :4], body)
    for i in range(len(world.motion)):
        if i != ego and not world.leaves[i] and after[i, CLOCK] >= time[-1]:
            vehicles[i, 3] = 0.0  # it stands where its motion ended
        if vehicles[i, 4] > 0.0:
            _update_acceleration(world, parameters, i, before[i], after[i], vehicles[i, 3])
        else:
            after[i, HELD] = 0.0
    may_stay = parameters.reacts and not is_certified(matched, now)
    _update_presence(world, after, may_stay, vehicles)


@kernel(F2, F2, B1, I)
def ego_hits(vehicles: Floats, half: Floats, present: Bools, ego: int) -> bool:
    """Return whether the ego overlaps another vehicle that is present.

    Args:
        vehicles: (N, 4) x, y [m], yaw [rad], speed [m/s].
        half: (N, 2) half lengths and widths [m].
        present: (N,) whether each vehicle is on the scene.
        ego: index of the ego.
    """
    ego_box = np.empty(7)
    box = np.empty(7)
    fill_footprint(vehicles[ego], half[ego], ego_box)
    for i in range(vehicles.shape[0]):
        if i != ego and present[i]:
            fill_footprint(vehicles[i], half[i], box)
            if boxes_meet(ego_box, box):
                return True
    return False
