# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Two roads: two streets of one lane a direction that cross at 75°, and a junction like a Y."""

import numpy as np

from scenario_gen import Encounter, Road, RoadConfig
from scenario_gen.roads import Arm, draw_plan, Plan

REACH = 80.0  # metres from the middle to the end of each arm


def draw(name: str, _: Encounter | None, config: RoadConfig) -> Road:
    """Return the crossing; it has one size, whatever the template."""
    return draw_plan(
        Plan([Arm.towards(yaw, REACH, 1) for yaw in np.radians([0.0, 75.0, 180.0, 255.0])]),
        name,
        config,
    )


def draw_y(name: str, _: Encounter | None, config: RoadConfig) -> Road:
    """Return the Y: a street of two lanes a direction that parts into two streets of one; who comes by these gives way."""
    branches = [Arm.towards(yaw, REACH, 1) for yaw in np.radians([50.0, -50.0])]
    return draw_plan(
        Plan([Arm.towards(np.pi, REACH, 2), *branches], yielding=(1, 2)), name, config
    )
