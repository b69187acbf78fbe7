# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`IdmFollower` at merges: it lets those pass who arrive first, and nobody who follows it."""

import numpy as np
import pytest
from support.textbook_motions import EAST, RAMP

from benchmarks._driving_worlds import as_scenario, PERIOD
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.planners import IdmFollower
from scenario_gen.closed_loop.simulation import ClosedLoop
from scenario_gen.closed_loop.verdict import judge


def on(path, start, speed):
    """Return a steady motion along a path from a station [m]."""
    poses = path.at(start + speed * PERIOD * np.arange(150))
    return poses[:, :2], np.unwrap(poses[:, 2]), np.full(150, speed)


def driven(other):
    """Drive from a ramp at 10 m/s, 70 m before its end; the other one drives as recorded."""
    scenario = as_scenario([on(RAMP, 100.0, 10.0), other], 150)
    loop = ClosedLoop(scenario, 0, config=ClosedLoopConfig(policy="replay"))
    drive = loop.drive(IdmFollower())
    return drive, judge(loop, drive)


@pytest.mark.parametrize("lead", [0.0, 4.0, 8.0])
def test_who_arrives_first_merges_first(lead):
    drive, verdict = driven(on(EAST, 101.0 + lead, 10.0))
    assert verdict.collision is None
    x = drive.motion.position[:, 110, 0]
    assert x[0] < x[1] - 5.0 and drive.motion.speed[0].min() > 0.0


def test_nobody_yields_to_a_follower():
    drive, _ = driven(on(RAMP, 85.0, 10.0))
    assert drive.motion.speed[0].min() > 9.0
