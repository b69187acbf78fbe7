# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The braking that an ego imposes on a vehicle whose turn it takes."""

import numpy as np

from scenario_gen.closed_loop.drive import Drive
from scenario_gen.closed_loop.simulation import ClosedLoop
from scenario_gen.numerics import Floats


def imposed_braking(loop: ClosedLoop, drive: Drive) -> float:
    """Return the hardest braking [m/s²] of a vehicle whose turn the ego takes; 0 without one.

    The ego takes the turn of a vehicle that goes first in the certified scenario if it enters
    their conflict area before that one has left it; of a vehicle in the same direction, before
    that one has entered it. It also takes the turn of one that goes second and insists on it, if
    that one brakes while the ego is there. The braking of the certified motion itself does not
    count.
    """
    hardest = 0.0
    for other, conflict in loop.conflicts.items():
        if conflict.first == other:
            until = conflict.entry_first if conflict.following else conflict.exit_first
            entry = conflict.entry_second
        elif loop.insists[other]:
            until, entry = conflict.entry_second, conflict.entry_first
        else:
            continue
        before = drive.present[other] & (drive.clock[other] < until)
        entered = drive.clock[drive.ego] >= entry
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
