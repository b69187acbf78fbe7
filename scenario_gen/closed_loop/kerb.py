# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Pedestrians at the kerb: they wait for an ego that would meet them and cannot stop.

They also wait where the template waited for the ego. On the lane they go on. A pedestrian looks
before it steps onto the lane, so it has no reaction time. It stops late, as pedestrians do.
"""

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
from scenario_gen.closed_loop.foresight import Prediction
from scenario_gen.numerics import Floats
from scenario_gen.numerics.boxes import boxes_meet, fill_box
from scenario_gen.numerics.kernels import kernel


@kernel(inline=True)
def _kerb_clock(world: World, walker: DriverState) -> float:
    """Return the clock [s] of the next step onto a lane, now or earlier if it is on a lane."""
    kerbs = world.kerbs[walker.vehicle]
    return float(kerbs[min(int(walker.clock / world.cell), kerbs.shape[0] - 1)])


@kernel(inline=True)
def _kerb_cell(world: World, walker: DriverState) -> int:
    """Return the cell that begins where a pedestrian steps onto a lane."""
    return int(_kerb_clock(world, walker) / world.cell + 0.5)


@kernel(inline=True)
def is_before_kerb(world: World, walker: DriverState) -> bool:
    """Return whether this is a pedestrian that has not yet stepped onto its next lane."""
    return walker.clock + 1e-9 < _kerb_clock(world, walker) < np.inf


@kernel(inline=True)
def predict_fast_ego(world: World, seen: Floats, out: Floats) -> None:
    """Replace a prediction (M, 4) of the ego if it is faster than its witness: it stays so.

    Args:
        world: the scenario.
        seen: (9,) the ego as in `State.seen`, at the end of this step.
        out: (M, 4) as `predict_ego` wrote it.
    """
    if seen[ON_PATH] == 0.0 or seen[EGO_RATE] <= MODEL.max_ego_rate_ratio:
        return
    way = world.cells[world.ego, :, 7]
    pose = np.empty(5)
    last = way.shape[0] - 1
    k = min(int(seen[EGO_CLOCK] / world.cell), last)
    driven = way[k] + (way[min(k + 1, last)] - way[k]) * (seen[EGO_CLOCK] / world.cell - k)
    for m in range(1, out.shape[0]):
        driven += seen[3] * world.step
        while k < last and way[k + 1] <= driven:
            k += 1
        share = (driven - way[k]) / (way[k + 1] - way[k]) if k < last else 0.0
        pose_at(world.time, world.motion[world.ego], (k + share) * world.cell, pose)
        out[m, :3] = pose[:3]
        out[m, 3] = seen[3]


@kernel(inline=True)
def braking_at_kerb(
    world: World,
    parameters: DriverParameters,
    walker: DriverState,
    pose: Floats,
    prediction: Prediction,
) -> float:
    """Return the braking [m/s²] of a pedestrian before the kerb, at its certified pose (5,).

    NO_BRAKING_MPS2 if it need not wait, or need not brake yet.
    """
    if not _must_wait(world, parameters, walker, prediction):
        return NO_BRAKING_MPS2
    way = world.cells[walker.vehicle, :, 7]
    k = int(walker.clock / world.cell)
    walked = way[k] + (way[k + 1] - way[k]) * (walker.clock / world.cell - k)
    room = way[_kerb_cell(world, walker)] - walked - MODEL.clearance_m
    speed = walker.rate * pose[3]
    reached = min(speed + parameters.acceleration * world.step, pose[3])
    stopping_way = reached * reached / (2.0 * MODEL.walker_braking_mps2)
    if room > reached * world.step + stopping_way:
        return NO_BRAKING_MPS2
    return float(
        min(speed * speed / (2.0 * max(room, 0.01)), parameters.strongest[walker.vehicle])
    )


@kernel(inline=True)
def _must_wait(
    world: World, parameters: DriverParameters, walker: DriverState, prediction: Prediction
) -> bool:
    """Return whether a pedestrian must not go on.

    It would go ahead of an ego that the template let pass, or meet one that cannot stop.
    """
    i = walker.vehicle
    clearance = prediction.clearance
    half = world.half[i]
    ego_half = world.half[world.ego]
    pose = np.empty(5)
    footprint = np.empty(7)
    ego_box = np.empty(7)
    state = walker
    meets = False
    time = world.time
    motion = world.motion[i]
    pose_at(time, motion, state.clock, pose)
    for m in range(prediction.ego.shape[0] - 1):
        state = drive_step(parameters, state, time, motion, pose, NO_BRAKING_MPS2, world.step)
        if state.clock > prediction.limits[m]:
            return True
        ego = prediction.ego[m]
        fill_box(pose[0], pose[1], pose[2], half[0] + clearance, half[1] + clearance, footprint)
        fill_box(ego[0], ego[1], ego[2], ego_half[0], ego_half[1], ego_box)
        meets = meets or boxes_meet(footprint, ego_box)
    return meets and not _ego_stops(world, parameters, walker, prediction)


@kernel(inline=True)
def _ego_stops(
    world: World, parameters: DriverParameters, walker: DriverState, prediction: Prediction
) -> bool:
    """Return whether the ego can stop comfortably before the crossing of a pedestrian."""
    ego = prediction.ego
    box = np.empty(7)
    half = world.half[world.ego]
    speed = ego[0, 3]
    stopping_way = speed * MODEL.ego_response_s + speed * speed / (2.0 * parameters.comfortable)
    way = 0.0
    for m in range(ego.shape[0]):
        if m > 0:
            way += np.hypot(ego[m, 0] - ego[m - 1, 0], ego[m, 1] - ego[m - 1, 1])
        if way > stopping_way:
            return True
        fill_box(ego[m, 0], ego[m, 1], ego[m, 2], half[0], half[1], box)
        if _crosses(world, walker, box):
            return False
    return True


@kernel(inline=True)
def _crosses(world: World, walker: DriverState, box: Floats) -> bool:
    """Return whether the crossing of a pedestrian on its next lane meets a box (7,)."""
    cells = world.cells[walker.vehicle]
    for k in range(_kerb_cell(world, walker), cells.shape[0]):
        if world.kerbs[walker.vehicle, k] > (k + 0.5) * world.cell:
            break
        if boxes_meet(cells[k], box):
            return True
    return False
