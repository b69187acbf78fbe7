# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A trailer stays behind its truck, also when the truck waits for the ego, and the ego sees it."""

import numpy as np
import pytest
from support.small_scenarios import moving

from scenario_gen.base.errors import InputError
from scenario_gen.closed_loop.ego import Command
from scenario_gen.closed_loop.simulation import ClosedLoop
from scenario_gen.types import Trailer, Vehicle

TRUCK = Vehicle("t", 7.0, 2.5, "truck", Trailer("tl", 8.0, 2.4, 3.5, 6.0))
ROWS = [[-45.0, 0.0, 0.0, 5.0, 0.0, 0.02], [0.0, -20.0, np.pi / 2.0, 5.0, 0.0, 0.0]]


class Brakes:
    """Brakes in the way of the truck."""

    def reset(self, task):
        self.seen = set()

    def act(self, observation):
        self.seen.update(observation.ids)
        return None if observation.time > 2.5 else Command(0.0, 0.0)


def test_a_trailer_keeps_to_its_truck():
    scenario = moving(ROWS, vehicles=[TRUCK, Vehicle("c")], count=121)
    loop, planner = ClosedLoop(scenario, "c"), Brakes()
    drive = loop.drive(planner, lambda state: state.step == 100)
    assert planner.seen == {"t", "tl"}
    certified = scenario.with_trailers()
    way = np.hypot(*(drive.motion.position[2, -1] - certified.position[2, 100]))
    assert way > 5.0  # the truck has waited
    distance = np.hypot(*(drive.motion.position[0] - drive.motion.position[2]).T)
    assert distance.min() > 9.3 and distance.max() < 9.5 + 1e-6


def test_vehicle_with_trailer_is_no_ego():
    scenario = moving(ROWS, vehicles=[TRUCK, Vehicle("c")])
    with pytest.raises(InputError, match="has or is a trailer"):
        ClosedLoop(scenario, "t")
