# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The prediction of a driver: the ego after a reaction time, and the weakest safe braking."""

from typing import NamedTuple

import numpy as np

from scenario_gen.closed_loop.coordination_space import pose_at, World
from scenario_gen.closed_loop.driver import (
    drive_step,
    DriverParameters,
    DriverState,
    EGO_CLOCK,
    EGO_RATE,
    MODEL,
    NO_BRAKING_MPS2,
    ON_PATH,
)
from scenario_gen.closed_loop.order import clock_limit, SUBSTEP_COUNT
from scenario_gen.numerics import Floats
from scenario_gen.numerics.boxes import boxes_meet, fill_box
from scenario_gen.numerics.kernels import kernel

BRAKING_BISECTION_STEPS = 5  # accuracy: a 32nd of the range of braking


class Prediction(NamedTuple):
    """The next M steps, as a driver predicts them.

    Attributes:
        ego: (M, 4) x, y [m], yaw [rad], speed [m/s] of the ego at the ends of the steps.
        limits: (M,) clock [s] that the driver may not pass by the end of each step, because of the
            order of events; infinity if nothing limits it.
        clearance: distance [m] to the ego of a driver that does not brake.
        avoids_ego: whether the driver keeps clear of the ego; a pedestrian decides at the kerb.
    """

    ego: Floats
    limits: Floats
    clearance: float
    avoids_ego: bool


@kernel(inline=True)
def _keeps_rate(world: World, seen: Floats) -> bool:
    """Return whether an ego (9,) brakes no harder than its witness in this step and the next."""
    pose = np.empty(5)
    usual = 0.0
    for k in range(3):
        clock = seen[EGO_CLOCK] - (1.0 - 0.5 * k) * world.step * seen[EGO_RATE]
        pose_at(world.time, world.motion[world.ego], clock, pose)
        usual = min(usual, pose[4])
    rate = seen[EGO_RATE]
    return bool(seen[5] > rate * rate * usual - MODEL.extra_braking_mps2)


@kernel(inline=True)
def _brake(speed: float, braking: float, h: float) -> tuple[float, float]:
    """Return the way [m] in a step of h [s] of braking [m/s²], and the speed [m/s] after it."""
    end_speed = max(speed - braking * h, 0.0)
    if end_speed > 0.0 or braking == 0.0:
        return 0.5 * (speed + end_speed) * h, end_speed
    return 0.5 * speed * speed / braking, end_speed


@kernel(inline=True)
def predict_ego(world: World, seen: Floats, ago: int, out: Floats) -> None:
    """Write x, y, yaw and speed (M, 4) of the ego at the end of this step and of the next ones.

    On the path of its witness the ego continues at its rate, otherwise, and beyond the end of that
    path, straight on. An ego that brakes continues to brake; on that path, only if it brakes harder than its witness.

    Args:
        world: the scenario.
        seen: (9,) the ego as in `State.seen`.
        ago: age of that observation in steps.
        out: (M, 4).
    """
    h = world.step
    motion = world.motion[world.ego]
    speed = seen[3]
    clock = seen[EGO_CLOCK]
    braking = max(-seen[5], 0.0)
    end = world.spans[world.ego, 1] if world.leaves[world.ego] else np.inf
    on_path = seen[ON_PATH] > 0.0 and clock < end
    keeps_rate = on_path and _keeps_rate(world, seen)
    cos = np.cos(seen[2])
    sin = np.sin(seen[2])
    way = 0.0
    pose = np.empty(5)
    pose_at(world.time, motion, clock, pose)
    if ago == 0:
        out[0] = seen[:4]
    for m in range(1 - ago, out.shape[0]):
        moved, speed = _brake(speed, braking, h)
        way += moved
        if on_path:
            delay = min(moved / max(pose[3], MODEL.min_divisor_mps), h)
            clock += seen[EGO_RATE] * h if keeps_rate else delay
            pose_at(world.time, motion, clock, pose)
            beyond = max(clock - end, 0.0) * pose[3]
            pose[0] += beyond * np.cos(pose[2])
            pose[1] += beyond * np.sin(pose[2])
        else:
            pose[0] = seen[0] + way * cos
            pose[1] = seen[1] + way * sin
            pose[2] = seen[2]
        if m >= 0:
            out[m, :3] = pose[:3]
            out[m, 3] = seen[EGO_RATE] * pose[3] if keeps_rate else speed


@kernel(inline=True)
def weakest_safe_braking(
    world: World,
    parameters: DriverParameters,
    driver: DriverState,
    least: float,
    prediction: Prediction,
) -> float:
    """Return the weakest braking [m/s²], `least` or more, with which a driver stays clear.

    The strongest braking if none does. More braking is not always safer: a slower driver may be
    at a crossing together with the ego. So a few values are tried before the bisection.
    """
    if _is_clear(world, parameters, driver, least, prediction):
        return least
    low = max(least, -parameters.acceleration)
    comfortable = parameters.comfortable
    strongest = parameters.strongest[driver.vehicle]
    for high in (0.0, 0.5 * comfortable, comfortable, 0.5 * (comfortable + strongest), strongest):
        if high <= low:
            continue
        if _is_clear(world, parameters, driver, high, prediction):
            return _bisect_braking(world, parameters, driver, (low, high), prediction)
        low = high
    return float(max(strongest, least))


@kernel(inline=True, forced=True)
def _bisect_braking(
    world: World,
    parameters: DriverParameters,
    driver: DriverState,
    bounds: tuple[float, float],
    prediction: Prediction,
) -> float:
    """Return the weakest safe braking [m/s²] between an unsafe and a safe one."""
    low, high = bounds
    for _ in range(BRAKING_BISECTION_STEPS):
        middle = 0.5 * (low + high)
        if _is_clear(world, parameters, driver, middle, prediction):
            high = middle
        else:
            low = middle
    return high


@kernel(inline=True)
def _is_clear(
    world: World,
    parameters: DriverParameters,
    driver: DriverState,
    braking: float,
    prediction: Prediction,
) -> bool:
    """Return whether a driver that brakes stays clear of the ego and respects the order.

    An ego that reaches it from behind is ignored from then on.
    """
    i = driver.vehicle
    pose = np.empty(5)
    brakes = braking > NO_BRAKING_MPS2
    clearance = max(prediction.clearance, MODEL.clearance_m * brakes)
    half = (world.half[i, 0] + clearance, world.half[i, 1] + clearance)
    ego_half = (world.half[world.ego, 0], world.half[world.ego, 1])
    reach = np.sqrt(half[0] ** 2 + half[1] ** 2) + np.sqrt(ego_half[0] ** 2 + ego_half[1] ** 2)
    leave_clock = world.spans[i, 1] if world.leaves[i] else np.inf
    avoids_ego = prediction.avoids_ego
    time = world.time
    motion = world.motion[i]
    pose_at(time, motion, driver.clock, pose)
    for m in range(prediction.ego.shape[0] - 1):
        driver = drive_step(parameters, driver, time, motion, pose, braking, world.step)
        if driver.clock >= leave_clock:
            break
        ego = prediction.ego[m]
        dx = ego[0] - pose[0]
        dy = ego[1] - pose[1]
        is_near = avoids_ego and dx * dx + dy * dy < reach * reach
        if is_near and _meets_ego(pose, half, ego, ego_half):
            if dx * np.cos(pose[2]) + dy * np.sin(pose[2]) > 0.0:
                return False
            avoids_ego = np.cos(ego[2] - pose[2]) < MODEL.same_direction_ratio
        if driver.clock > prediction.limits[m]:
            return False
        if braking > 0.0 and driver.rate == 0.0:
            break
    return True


@kernel(inline=True)
def _meets_ego(
    pose: Floats, half: tuple[float, float], ego: Floats, ego_half: tuple[float, float]
) -> bool:
    """Return whether a footprint at a pose (5,) meets an ego (4,)."""
    footprint = np.empty(7)
    ego_box = np.empty(7)
    fill_box(pose[0], pose[1], pose[2], half[0], half[1], footprint)
    fill_box(ego[0], ego[1], ego[2], ego_half[0], ego_half[1], ego_box)
    return bool(boxes_meet(footprint, ego_box))


@kernel(inline=True)
def limit_by_ego(world: World, i: int, clock: float, rate: float, limits: Floats) -> None:
    """Write the limits (M,) [s] of vehicle i that an ego sets which the template let pass.

    The ego starts at a clock [s] and continues at a rate.
    """
    order = world.order[i, world.ego]
    end = world.spans[world.ego, 1] if world.leaves[world.ego] else np.inf
    for m in range(limits.shape[0]):
        if clock + rate * m * world.step >= end:
            break  # it has left the scene
        limit = clock_limit(order, world.cell, clock + rate * m * world.step)
        limits[m] = limit + MODEL.clock_tolerance_s


@kernel(inline=True)
def limit_by_others(world: World, i: int, clocks: Floats, limits: Floats) -> None:
    """Lower the limits (M,) [s] of vehicle i to those that the clocks (N, M) of the others set."""
    for j in range(clocks.shape[0]):
        if j in (i, world.ego):
            continue
        order = world.order[i, j]
        for m in range(limits.shape[0] - 1):
            end = clocks[j, m + 1]
            last_substep = end - (end - clocks[j, m]) / SUBSTEP_COUNT
            limit = max(clock_limit(order, world.cell, last_substep), end)
            limits[m] = min(limits[m], limit + 1e-09)


@kernel(inline=True)
def predict_clock(
    world: World, parameters: DriverParameters, driver: DriverState, braking: float, out: Floats
) -> None:
    """Write the clocks (M,) [s] of a braking driver at the start and the end of each step."""
    pose = np.empty(5)
    time = world.time
    motion = world.motion[driver.vehicle]
    pose_at(time, motion, driver.clock, pose)
    clock = driver.clock
    out[0] = clock
    for m in range(1, out.shape[0]):
        if driver.rate < 1.0 or braking > NO_BRAKING_MPS2:
            driver = drive_step(parameters, driver, time, motion, pose, braking, world.step)
            clock = driver.clock
        else:
            clock += world.step
        out[m] = clock
