# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Pedestrians at the kerb: they wait for an ego that would meet them and cannot stop.

They also wait where the template waited for the ego. On the lane they go on. A pedestrian looks
before it steps onto the lane, so it has no reaction time. It stops late, as pedestrians do.
"""

import numpy as np

from scenario_gen.closed_loop.coordination_space import pose_at, World
from scenario_gen.closed_loop.driver import DriverParameters, DriverState, MODEL, way_at
from scenario_gen.numerics import Floats
from scenario_gen.numerics.boxes import boxes_meet, fill_footprint
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
def kerb_acceleration(
    world: World,
    parameters: DriverParameters,
    walker: DriverState,
    pose: Floats,
    ego: Floats,
    yields: bool,
) -> float:
    """Return the largest acceleration [m/s²] of a pedestrian before the kerb.

    Infinity if it need not wait, or need not brake yet.

    Args:
        world: the scenario.
        parameters: of the drivers.
        walker: the pedestrian.
        pose: (5,) its certified pose.
        ego: (M, 5) as `predict_ego` writes it.
        yields: whether it waits in any case, because the template let the ego pass.
    """
    if not yields and not _would_meet(world, parameters, walker, ego):
        return np.inf
    kerb = _kerb_cell(world, walker) * world.cell
    room = way_at(world, walker.vehicle, kerb) - way_at(world, walker.vehicle, walker.clock)
    room -= MODEL.clearance_m
    speed = walker.rate * pose[3]
    reached = min(speed + parameters.acceleration[walker.vehicle] * world.step, pose[3])
    stopping_way = reached * reached / (2.0 * MODEL.walker_braking_mps2)
    if room > reached * world.step + stopping_way:
        return np.inf
    return float(-speed * speed / (2.0 * max(room, 0.01)))


@kernel(inline=True)
def _would_meet(
    world: World, parameters: DriverParameters, walker: DriverState, ego: Floats
) -> bool:
    """Return whether a pedestrian that goes on would meet an ego (M, 5) that cannot stop."""
    i = walker.vehicle
    pose = np.empty(5)
    footprint = np.empty(7)
    ego_box = np.empty(7)
    for m in range(ego.shape[0] - 1):
        clock = walker.clock + (m + 1) * world.step
        pose_at(world.time, world.motion[i], clock, pose)
        fill_footprint(pose, world.half[i], footprint)
        fill_footprint(ego[m], world.half[world.ego], ego_box)
        if boxes_meet(footprint, ego_box):
            return not _ego_stops(world, parameters, walker, ego)
    return False


@kernel(inline=True)
def _ego_stops(
    world: World, parameters: DriverParameters, walker: DriverState, ego: Floats
) -> bool:
    """Return whether the ego can stop comfortably before the crossing of a pedestrian."""
    box = np.empty(7)
    speed = ego[0, 3]
    stopping_way = speed * MODEL.ego_response_s + speed * speed / (
        2.0 * parameters.comfortable[walker.vehicle]
    )
    way = 0.0
    for m in range(ego.shape[0]):
        if m > 0:
            way += np.hypot(ego[m, 0] - ego[m - 1, 0], ego[m, 1] - ego[m - 1, 1])
        if way > stopping_way:
            return True
        fill_footprint(ego[m], world.half[world.ego], box)
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
