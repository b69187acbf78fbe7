# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The braking that an ego imposes on a vehicle whose turn it takes."""

import numpy as np

from scenario_gen.closed_loop.drive import Drive
from scenario_gen.closed_loop.simulation import ClosedLoop
from scenario_gen.numerics import Floats
from scenario_gen.situation import conflict_of


def imposed_braking(loop: ClosedLoop, drive: Drive) -> float:
    """Return the hardest braking [m/s²] of a vehicle whose turn the ego takes; 0 without one.

    The ego takes the turn of a vehicle that goes first in the certified scenario if it enters
    their conflict area before that one has left it; of a vehicle in the same direction, before
    that one has entered it. The braking of the certified motion itself does not count.
    """
    hardest = 0.0
    for other in range(len(drive.motion.vehicles)):
        conflict = None if other == drive.ego else conflict_of(loop.scenario, drive.ego, other)
        if conflict is None or conflict.first != other:
            continue
        until = conflict.entry_first if conflict.following else conflict.exit_first
        before = drive.present[other] & (drive.clock[other] < until)
        entered = drive.clock[drive.ego] >= conflict.entry_second
        if (before & entered).any():
            braking = _reactive_braking(loop, drive, other)[before[:-1]]
            hardest = max(hardest, float(braking.max(initial=0.0)))
    return hardest


def _reactive_braking(loop: ClosedLoop, drive: Drive, vehicle: int) -> Floats:
    """Return the braking (T - 1,) [m/s²] of a vehicle beyond that of its certified motion."""
    speed, step = drive.motion.speed[vehicle], loop.config.step
    scenario = loop.scenario
    certified = np.interp(drive.clock[vehicle], scenario.time, scenario.speed[vehicle])
    rate = np.divide(speed, certified, out=np.ones_like(speed), where=certified > 0.0)
    acceleration = np.diff(speed) / step
    usual = rate[:-1] * np.diff(certified) / step
    return np.asarray(np.minimum(-acceleration, usual - acceleration))
