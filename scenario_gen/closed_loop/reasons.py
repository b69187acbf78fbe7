# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Why two vehicles met: what the ego had done, by both motions and by the order that the certificate has."""

from enum import StrEnum
import math
from typing import NamedTuple

import numpy as np

from scenario_gen.closed_loop.simulation import ClosedLoop, Drive
from scenario_gen.numerics.plane import ahead_and_left
from scenario_gen.template import conflict_of

STANDS = 0.5  # m/s
SAME_WAY = 0.7  # cosine of the angle between two headings, from which on they drive the same way
BEFORE = 1.5  # seconds before a contact, at which the ego was not yet in the other's way if it cut in


class Runner(StrEnum):
    """Who ran into whom: whose own motion closed the gap."""

    EGO = "ego"
    OTHER = "other"
    BOTH = "both"


class Reason(StrEnum):
    """What was behind a contact."""

    REAR_END = "rear_end"  # the ego ran into one ahead on the same way
    CUT_IN = "cut_in"  # the ego came into the way of one that drives the same way
    CROSSING_OUT_OF_ORDER = "crossing_out_of_order"  # the ego was where its witness goes second, before the first had left
    CROSSING = "crossing"  # the ways cross, and the ego goes first by the certificate, or nobody does
    HEAD_ON = "head_on"  # they drove towards each other
    STANDING = "standing"  # the ego stood in the way
    OTHER_RAN_INTO_EGO = "other_ran_into_ego"  # none of these: nothing that the ego did


class At(NamedTuple):
    """A vehicle at one instant: x, y [m], yaw [rad], speed [m/s]."""

    x: float
    y: float
    yaw: float
    speed: float


def state_at(drive: Drive, vehicle: int, time: float) -> At:
    """Return where a vehicle is at a time [s], linear between two instants."""
    motion = drive.motion
    columns = (*motion.position[vehicle].T, motion.heading[vehicle], motion.speed[vehicle])
    return At(*(float(np.interp(time, motion.time, column)) for column in columns))


def reason_of(loop: ClosedLoop, drive: Drive, who: int, time: float, ran: Runner) -> Reason:
    """Say what was behind the contact of the ego with vehicle `who` at a time [s]."""
    ego, other = state_at(drive, drive.ego, time), state_at(drive, who, time)
    along = math.cos(other.yaw - ego.yaw)
    if ran is Runner.OTHER and ego.speed < STANDS:
        return Reason.STANDING
    if along > SAME_WAY:
        ahead, _ = ahead_and_left(np.subtract(other[:2], ego[:2]), ego.yaw)
        if _came_in(drive, who, time):
            return Reason.CUT_IN
        return Reason.REAR_END if ahead > 0.0 and ran is not Runner.OTHER else Reason.OTHER_RAN_INTO_EGO
    conflict = conflict_of(loop.scenario, drive.ego, who)
    if conflict is not None and not conflict.following and conflict.second == drive.ego:
        return Reason.CROSSING_OUT_OF_ORDER
    if ran is Runner.OTHER:
        return Reason.OTHER_RAN_INTO_EGO
    return Reason.HEAD_ON if along < -SAME_WAY else Reason.CROSSING


def _came_in(drive: Drive, who: int, time: float) -> bool:
    """Whether the ego was beside the other's way shortly before, and had been ahead of the other's tail."""
    then = max(time - BEFORE, 0.0)
    ego, other = state_at(drive, drive.ego, then), state_at(drive, who, then)
    ahead, left = ahead_and_left(np.subtract(ego[:2], other[:2]), other.yaw)
    mine, its, turn = drive.motion.vehicles[drive.ego], drive.motion.vehicles[who], ego.yaw - other.yaw
    wide = 0.5 * (its.width + mine.width * abs(math.cos(turn)) + mine.length * abs(math.sin(turn)))
    return bool(abs(left) > wide and ahead > -0.5 * its.length) and not math.isclose(then, time)
