# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The other vehicles in one step: the rate of each clock, so that they stay clear of the ego.

Each vehicle stays on its certified path and never exceeds its certified speed there: its clock
runs at a rate from 0 to 1. Three things slow it down, and the strongest one counts:

- a vehicle ahead on its path, the ego included (IDM), but only if it is nearer than in the
  certified execution at the same place;
- the weakest braking that avoids the predicted ego and respects the predicted order of events;
  the acceleration changes by the jerk at most;
- the order itself, without exception: see order.py.

Each driver sees the ego as it was one reaction time ago, and goes ahead of a standing ego after
its patience. A pedestrian on a lane goes on, but does not step onto a lane in front of an ego that
cannot stop: see kerb.py.
"""

from typing import NamedTuple

import numpy as np

from scenario_gen.closed_loop.coordination_space import pose_at, World
from scenario_gen.closed_loop.driver import (
    ACCELERATION,
    CLOCK,
    DriverParameters,
    DriverState,
    EGO_CLOCK,
    EGO_RATE,
    following_braking,
    gap_ahead,
    HELD,
    MODEL,
    next_rate,
    NO_BRAKING_MPS2,
    ON_PATH,
    RATE,
    WAITED,
)
from scenario_gen.closed_loop.foresight import (
    limit_by_ego,
    limit_by_others,
    predict_clock,
    predict_ego,
    Prediction,
    weakest_safe_braking,
)
from scenario_gen.closed_loop.kerb import (
    braking_at_kerb,
    is_before_kerb,
    predict_fast_ego,
)
from scenario_gen.closed_loop.order import clock_limit, Clocks, enforce_order
from scenario_gen.numerics import Bools, Floats, Ints
from scenario_gen.numerics.boxes import boxes_meet, fill_box
from scenario_gen.numerics.kernels import kernel


class StepState(NamedTuple):
    """All vehicles at the start of a step, and the predictions of their drivers.

    Attributes:
        drivers: (N, 4) clock [s], its rate, acceleration [m/s²] and patience spent [s], as in
            `State`.
        pose: (N, 5) x, y [m], yaw [rad], certified speed [m/s] and acceleration [m/s²] there.
        moving: (N,) whether the clock of each vehicle runs.
        present: (N,) whether each vehicle is on the scene.
        seen: (K, 9) the ego as in `State.seen`, at the end of the step and before.
        delay: (N,) reaction time of each driver in steps.
        ego: (N, M, 4) the ego as each driver predicts it, as in `Prediction`.
        clocks: (N, M) predicted clocks [s] of all, at the start and at the end of each step.
    """

    drivers: Floats
    pose: Floats
    moving: Bools
    present: Bools
    seen: Floats
    delay: Ints
    ego: Floats
    clocks: Floats


@kernel(inline=True)
def react(
    world: World, parameters: DriverParameters, seen: Floats, drivers: Floats, after: Floats
) -> None:
    """Write the reaction of all drivers in a step; the caller writes the row of the ego.

    Args:
        world: the scenario and the step.
        parameters: of the drivers.
        seen: (K, 9) the ego as in `State.seen`, at the end of this step and before.
        drivers: (N, 4) as in `StepState`.
        after: (N, 5) clock [s], rate, acceleration that the driver wanted [m/s²], patience spent
            [s], and 1 where the order held the driver back.
    """
    n = drivers.shape[0]
    now = _step_state(world, parameters, drivers, seen)
    braking = np.full(n, NO_BRAKING_MPS2)
    rate = drivers[:, RATE].copy()
    _react_to_ego(world, parameters, now, braking, rate, after)
    if n > 2:
        for i in range(n):
            if i != world.ego and now.moving[i]:
                predict_clock(world, parameters, _driver(now, i), braking[i], now.clocks[i])
        for i in range(n):
            if i != world.ego and now.present[i]:
                patience = after[i, WAITED]
                others_rate = _rate_for_others(world, parameters, now, i, braking[i], patience)
                rate[i] = min(rate[i], others_rate)
    _advance_clocks(world, now, rate, after)


@kernel(inline=True)
def _step_state(
    world: World, parameters: DriverParameters, drivers: Floats, seen: Floats
) -> StepState:
    """Return the state of all vehicles at the start of a step; predictions are not filled."""
    n = drivers.shape[0]
    steps = int(np.ceil(parameters.foresight / world.step))
    pose = np.empty((n, 5))
    moving = np.empty(n, dtype=np.bool_)
    present = np.empty(n, dtype=np.bool_)
    for i in range(n):
        clock = drivers[i, CLOCK]
        moving[i] = not (world.leaves[i] and clock >= world.spans[i, 1])
        present[i] = moving[i] and clock >= world.spans[i, 0]
        pose_at(world.time, world.motion[i], clock, pose[i])
    clocks = np.empty((n, steps + 1))
    for m in range(steps + 1):
        clocks[:, m] = drivers[:, CLOCK] + m * world.step  # of vehicles that have left
    ego = np.empty((n, steps + 1, 4))
    return StepState(drivers, pose, moving, present, seen, parameters.delay, ego, clocks)


@kernel(inline=True, forced=True)
def _driver(now: StepState, i: int) -> DriverState:
    driver = now.drivers[i]
    return DriverState(i, driver[CLOCK], driver[RATE], driver[ACCELERATION])


@kernel(inline=True, forced=True)
def _observation_age(now: StepState, i: int) -> int:
    """Return how old the ego is that driver i sees, in steps."""
    return int(min(now.delay[i], now.seen.shape[0] - 1))


@kernel(inline=True)
def _entry_rate(world: World, now: StepState, i: int) -> float:
    """Return the rate of a vehicle that is not yet on the scene.

    It enters when it is due, unless the ego is in its place.
    """
    clock = now.drivers[i, CLOCK]
    rate = now.drivers[i, RATE]
    begin = world.spans[i, 0]
    if clock + 0.5 * (rate + 1.0) * world.step < begin:
        return 1.0
    pose = np.empty(5)
    entry = np.empty(7)
    ego = np.empty(7)
    half = world.half[i]
    pose_at(world.time, world.motion[i], begin, pose)
    fill_box(pose[0], pose[1], pose[2], half[0] + MODEL.entry_gap_m, half[1], entry)
    _fill_ego(world, now.seen[0], ego)
    return 0.0 if boxes_meet(entry, ego) else 1.0


@kernel(inline=True)
def _fill_ego(world: World, pose: Floats, out: Floats) -> None:
    """Write the box (7,) of the ego at a pose (x, y, yaw, …)."""
    fill_box(pose[0], pose[1], pose[2], world.half[world.ego, 0], world.half[world.ego, 1], out)


@kernel(inline=True)
def _prediction(
    world: World, parameters: DriverParameters, now: StepState, i: int, patience: float
) -> Prediction:
    """Return the prediction of driver i, with the limits that the ego sets.

    There are none if its spent patience [s] is infinite.
    """
    ago = _observation_age(now, i)
    ego = now.seen[ago]
    is_patient = patience < np.inf
    on_path = ego[ON_PATH] > 0.0
    limits = np.full(now.clocks.shape[1], np.inf)
    if parameters.yields and on_path and is_patient and ego[EGO_RATE] >= 0.0:
        clock = ego[EGO_CLOCK] + ego[EGO_RATE] * ago * world.step
        limit_by_ego(world, i, clock, ego[EGO_RATE], limits)
    clearance = MODEL.lateral_clearance_m if not on_path and is_patient else 0.0
    return Prediction(now.ego[i], limits, clearance, not world.walks[i])


@kernel(inline=True, forced=True)
def _is_blocked(now: StepState, i: int) -> bool:
    """Return whether driver i stands or creeps because of an ego that hardly moves."""
    rate = now.drivers[i, RATE]
    certified_speed = now.pose[i, 3]
    creeps = rate * certified_speed <= MODEL.creep_speed_mps and rate < 1.0
    waits = creeps and certified_speed >= MODEL.min_moving_speed_mps
    return bool(waits and now.ego[i, 0, 3] <= MODEL.max_blocking_speed_mps)


@kernel(inline=True)
def _patience_spent(world: World, parameters: DriverParameters, now: StepState, i: int) -> float:
    """Return how long [s] driver i has waited for an ego that hardly moves.

    Infinity once it goes ahead of the ego: its patience is spent, and the ego is predicted off its
    path, both now and at the end of the prediction.
    """
    spent = float(now.drivers[i, WAITED])
    if spent == np.inf:
        return spent
    if not _is_blocked(now, i):
        return 0.0
    spent += world.step
    box = np.empty(7)
    for m in (0, now.ego.shape[1] - 1):
        _fill_ego(world, now.ego[i, m], box)
        _, cell = gap_ahead(world, i, now.drivers[i, CLOCK], box, now.pose[i])
        if spent < parameters.patience or cell >= 0:
            return spent
    return float(np.inf)


@kernel(inline=True)
def _react_to_ego(
    world: World,
    parameters: DriverParameters,
    now: StepState,
    braking: Floats,
    rate: Floats,
    after: Floats,
) -> None:
    """Write the braking for the ego [m/s²], the rate after the step, and the patience spent."""
    last = -1  # the last driver whose prediction others with the same delay can reuse
    for i in range(braking.shape[0]):
        after[i, WAITED] = now.drivers[i, WAITED]
        if i == world.ego or not now.moving[i]:
            continue
        if not now.present[i]:
            rate[i] = _entry_rate(world, now, i)
            continue
        if last >= 0 and now.delay[last] == now.delay[i]:
            now.ego[i] = now.ego[last]
        else:
            ago = _observation_age(now, i)
            predict_ego(world, now.seen[ago], ago, now.ego[i])
        if not world.walks[i]:  # the prediction of a pedestrian differs
            last = i
        after[i, WAITED] = _patience_spent(world, parameters, now, i)
        braking[i] = _braking_for_ego(world, parameters, now, i, after[i, WAITED])
        driver = _driver(now, i)
        rate[i] = next_rate(parameters, driver, now.pose[i], braking[i], 0.0, world.step)


@kernel(inline=True)
def _braking_for_ego(
    world: World, parameters: DriverParameters, now: StepState, i: int, patience: float
) -> float:
    """Return the braking [m/s²] of driver i for the ego, with its patience spent [s]."""
    driver = _driver(now, i)
    pose = now.pose[i]
    box = np.empty(7)
    ego = now.ego[i, 0]
    _fill_ego(world, ego, box)
    following = following_braking(
        world, parameters, driver, pose, world.ego, box, ego[3], world.step
    )
    prediction = _prediction(world, parameters, now, i, patience)
    if is_before_kerb(world, driver):
        predict_fast_ego(world, now.seen[0], now.ego[i])
        return max(following, braking_at_kerb(world, parameters, driver, pose, prediction))
    return weakest_safe_braking(world, parameters, driver, following, prediction)


@kernel(inline=True)
def _rate_for_others(
    world: World,
    parameters: DriverParameters,
    now: StepState,
    i: int,
    ego_braking: float,
    patience: float,
) -> float:
    """Return the rate of driver i after the step with regard to the others.

    Infinity if it need not brake harder than for the ego [m/s²].
    """
    driver = _driver(now, i)
    box = np.empty(7)
    braking = ego_braking
    for j in range(now.pose.shape[0]):
        is_behind = now.present[j] and now.drivers[j, CLOCK] < driver.clock
        if j not in (i, world.ego) and is_behind:
            pose = now.pose[j]
            speed = now.drivers[j, RATE] * pose[3]
            fill_box(pose[0], pose[1], pose[2], world.half[j, 0], world.half[j, 1], box)
            following = following_braking(
                world, parameters, driver, now.pose[i], j, box, speed, 0.0
            )
            braking = max(braking, following)
    prediction = _prediction(world, parameters, now, i, patience)
    if is_before_kerb(world, driver):
        prediction.limits[:] = np.inf  # it waits for the ego at the kerb, not on the lane
    limit_by_others(world, i, now.clocks, prediction.limits)
    braking = weakest_safe_braking(world, parameters, driver, braking, prediction)
    if braking <= ego_braking:
        return np.inf
    floor = _creep_speed(world, now, i)
    return next_rate(parameters, driver, now.pose[i], braking, floor, world.step)


@kernel(inline=True)
def _creep_speed(world: World, now: StepState, i: int) -> float:
    """Return the speed [m/s] at which driver i stops braking for the order.

    Drivers creep, so that no two wait for each other. Where a vehicle with an earlier clock does
    not wait for driver i, driver i stops where the order ends its way. The driver with the
    earliest clock always creeps.
    """
    clock = now.drivers[i, CLOCK]
    speed = MODEL.creep_speed_mps
    for j in range(now.pose.shape[0]):
        other = now.drivers[j, CLOCK]
        if j in (i, world.ego) or not now.moving[j] or other >= clock:
            continue
        if clock_limit(world.order[j, i], world.cell, clock) > other + MODEL.min_lead_s:
            room = clock_limit(world.order[i, j], world.cell, other) - clock
            speed = min(speed, max(room * now.pose[i, 3] / MODEL.approach_s, 0.0))
    return speed if speed > MODEL.min_moving_speed_mps else 0.0


@kernel(inline=True)
def _advance_clocks(world: World, now: StepState, rate: Floats, after: Floats) -> None:
    """Advance the clocks at the wanted rates (N,), as far as the order permits."""
    n = rate.shape[0]
    h = world.step
    begin = now.drivers[:, CLOCK].copy()
    begin_rate = now.drivers[:, RATE].copy()
    cut = np.zeros(n, dtype=np.bool_)
    clocks = Clocks(now.moving, begin, begin_rate, begin.copy(), rate.copy(), cut)
    for i in range(n):
        if i != world.ego and now.moving[i] and (now.present[i] or rate[i] > 0.0):
            clocks.end[i] = begin[i] + 0.5 * (begin_rate[i] + rate[i]) * h
    enforce_order(world, clocks)
    for i in range(n):
        speed = now.pose[i, 3]
        end_speed = max(speed + begin_rate[i] * now.pose[i, 4] * h, 0.0)
        end = clocks.end[i]
        after[i, CLOCK] = min(end, world.time[-1]) if now.moving[i] else end
        after[i, RATE] = clocks.end_rate[i]
        after[i, ACCELERATION] = (rate[i] * end_speed - begin_rate[i] * speed) / h
        after[i, HELD] = 1.0 if clocks.end_rate[i] < rate[i] or cut[i] else 0.0
