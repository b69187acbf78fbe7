# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Repair: the nearest pose at which a vehicle's footprint has room."""

import numpy as np

from scenario_gen import exact
from scenario_gen.arrays import Floats
from scenario_gen.roads.clearance import footprint_fits
from scenario_gen.roads.road import Road

BISECTIONS = 20


def nearest_pose_with_room(
    road: Road, pose: Floats, length: float, width: float, max_distance: float = 3.0
) -> tuple[Floats, float] | None:
    """Move a pose, keeping its yaw, as little as it takes for the footprint to cover drivable cells only.

    Offsets on a lattice of the grid's resolution are tried outward, and the nearest that fits is drawn back towards the
    pose as far as the footprint keeps its room: the answer is within about half a cell of the true nearest pose.

    Args:
        road: the grid.
        pose: (3,) x [m], y [m], yaw [rad].
        length: footprint length [m].
        width: footprint width [m].
        max_distance: how far to look [m].

    Returns:
        The pose (3,) and how far it was moved [m]; None if there is no room within `max_distance`.
    """
    pose = np.array(pose, dtype=np.float64)
    if footprint_fits(road, pose[None], length, width)[0]:
        return pose, 0.0
    reach = int(max_distance / road.resolution)
    steps = np.arange(-reach, reach + 1) * road.resolution
    offset = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    distance = exact.hypot(offset[:, 0], offset[:, 1])
    order = np.argsort(distance, kind="stable")
    order = order[distance[order] <= max_distance]
    candidates = pose + np.pad(offset[order], ((0, 0), (0, 1)))
    fits = footprint_fits(road, candidates, length, width)
    if not fits.any():
        return None
    shift = candidates[np.argmax(fits)] - pose
    blocked, free = 0.0, 1.0
    for _ in range(BISECTIONS):
        middle = 0.5 * (blocked + free)
        if footprint_fits(road, (pose + middle * shift)[None], length, width)[0]:
            free = middle
        else:
            blocked = middle
    moved = pose + free * shift
    return moved, float(exact.hypot(*(moved - pose)[:2]))
