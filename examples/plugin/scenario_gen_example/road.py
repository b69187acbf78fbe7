# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A road: two streets of one lane a direction that cross at 75° on a round square."""

import numpy as np

from scenario_gen import Encounter, Road, RoadConfig

REACH = 80.0  # metres from the crossing to the end of each arm


def draw(name: str, _: Encounter | None, config: RoadConfig) -> Road:
    """Return the road; it has one size, whatever the template."""
    centre = np.arange(0.5 * config.resolution - REACH, REACH, config.resolution)
    x, y = np.meshgrid(centre, centre)
    drivable = np.hypot(x, y) < 15.0
    entries, exits = [], []
    for outward in np.radians([0.0, 75.0, 180.0, 255.0]):
        along = np.array([np.cos(outward), np.sin(outward)])
        right = (0.5 if config.traffic_side == "right" else -0.5) * config.lane_width * np.array([along[1], -along[0]])
        drivable |= np.abs(along[0] * y - along[1] * x) < config.lane_width
        exits.append([*(REACH * along + right), outward])
        entries.append([*(REACH * along - right), outward + np.pi])
    return Road(name, drivable, config.resolution, np.full(2, -REACH), np.array(entries), np.array(exits))
