# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Whose fault a contact was: that of the ego if it was out of place, by its witness' path and turn, or drove into what was ahead.

The others keep their certified paths, speeds and order, so a contact is the fault of whoever was where, or when, the certificate
does not have it. The first of `Reason` that holds is the reason.
"""

from dataclasses import dataclass
from enum import StrEnum
import math
from typing import NamedTuple

import numpy as np
import shapely

from scenario_gen.closed_loop.simulation import BEYOND, ClosedLoop, Drive
from scenario_gen.numerics import Floats
from scenario_gen.numerics.boxes import corners
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.plane import ahead_and_left, edge_lengths, place
from scenario_gen.situation import Conflict, conflict_of

STANDS = 0.5  # m/s
SAME_WAY = 0.7  # cosine of the angle between two headings, from which on they drive the same way
TOUCHING = 0.02  # metres from the other's footprint within which the ego's own counts as the place of the contact
# Responsibility-sensitive safety (Shalev-Shwartz, Shammah & Shashua 2017), equation 2; who is behind does not speed up meanwhile.
RESPONSE = 1.0  # s
BRAKES_AT_LEAST, BRAKES_AT_MOST = (
    6.0,
    9.0,
)  # m/s²: who is behind (as UN R157 assumes), who is ahead (the body's limit)
R157_DELAY = 0.35  # s; UN Regulation 157, 5.2.5.3: a cut-in can be answered from a TTC of Δv / (2 · 6 m/s²) + 0.35 s on


class Runner(StrEnum):
    """Who ran into whom: whose own motion closed the gap."""

    EGO = "ego"
    OTHER = "other"
    BOTH = "both"


class Reason(StrEnum):
    """What was behind a contact; from STANDING on it was not the ego's fault."""

    JUMP = "jump"  # the ego had been at a place that no vehicle can reach in a step
    REVERSING = "reversing"  # the ego drove backwards
    OUT_OF_ORDER = "out_of_order"  # the witness goes second where they cross or merge, the ego went before the other had left
    HEAD_ON = "head_on"  # the ego was beside its witness' path, against the other's direction
    OUT_OF_PATH = "out_of_path"  # the ego was beside its witness' path otherwise: it drifted, strayed or stood there
    CUT_IN = (
        "cut_in"  # the ego came in ahead of the other and left less than the safe gap from then on
    )
    REAR_END = "rear_end"  # the ego ran into one that stood, or drove ahead on the same way
    STANDING = "standing"  # the ego stood, on its path and in its turn
    PRIORITY = "priority"  # the ways cross or merge, and the ego goes first by the certificate
    OTHER_RAN_INTO_EGO = "other_ran_into_ego"  # none of these: nothing that the ego did

    @property
    def at_fault(self) -> bool:
        """Whether it was the ego's fault."""
        return self not in (Reason.STANDING, Reason.PRIORITY, Reason.OTHER_RAN_INTO_EGO)


class At(NamedTuple):
    """A vehicle at one instant: x, y [m], yaw [rad], speed [m/s], negative backwards."""

    x: float
    y: float
    yaw: float
    speed: float


@dataclass(frozen=True)
class CutIn:
    """How one came into the way of another, ahead of it.

    Attributes:
        time: when [s].
        gap: metres that it left then, bumper to bumper; below 0 it came in beside the other.
        safe_gap: metres that RSS asks for, by both speeds then.
        ttc: time to collision then [s], None if the gap did not close; least_ttc: the least that UN R157 expects an answer to.
        safe: whether the gap was ever as wide as RSS asks for from then on.
    """

    time: float
    gap: float
    safe_gap: float
    ttc: float | None
    least_ttc: float
    safe: bool


def state_at(drive: Drive, vehicle: int, time: float) -> At:
    """Return where a vehicle is at a time [s], linear between two instants."""
    motion = drive.motion
    columns = (*motion.position[vehicle].T, motion.heading[vehicle], motion.speed[vehicle])
    x, y, yaw, speed = (float(np.interp(time, motion.time, column)) for column in columns)
    k = min(int(np.searchsorted(motion.time, time, side="right")), len(motion.time) - 1)
    moved, _ = ahead_and_left(
        motion.position[vehicle, k] - motion.position[vehicle, max(k - 1, 0)], yaw
    )
    return (
        At(x, y, yaw, min(speed, float(moved) / float(motion.time[1])))
        if moved < -1e-6
        else At(x, y, yaw, speed)
    )


def reason_of(
    loop: ClosedLoop, drive: Drive, who: int, time: float
) -> tuple[Reason, CutIn | None]:
    """Say what was behind the contact of the ego with vehicle `who` at a time [s], and how the ego came in ahead, if it did."""
    ego, other = state_at(drive, drive.ego, time), state_at(drive, who, time)
    along = math.cos(other.yaw - ego.yaw)
    conflict = conflict_of(loop.scenario, drive.ego, who)
    entry = cut_in(loop, drive, (drive.ego, who), time) if along > SAME_WAY else None
    if any(float(drive.motion.time[k]) <= time + 1e-9 for k in drive.jumps):
        return Reason.JUMP, entry
    if ego.speed < 0.0:
        return Reason.REVERSING, entry
    if (
        conflict is not None
        and conflict.second == drive.ego
        and _goes_first(loop, drive, conflict, time)
    ):
        return Reason.OUT_OF_ORDER, entry
    beside = conflict is None or _beside_path(loop, drive, who, time)
    if beside and along < -SAME_WAY:
        return Reason.HEAD_ON, entry
    ahead = entry is not None and entry.gap > 0.0
    if beside and not (ahead and ego.speed >= STANDS):
        return Reason.OUT_OF_PATH, entry
    its_turn = conflict is not None and conflict.first == drive.ego and not beside
    if entry is not None and ahead and not entry.safe and not its_turn:
        return Reason.CUT_IN, entry
    away, _ = ahead_and_left(np.subtract(other[:2], ego[:2]), ego.yaw)
    stands = abs(other.speed) < STANDS
    if away > 0.0 and (along > SAME_WAY or stands) and ego.speed > other.speed * along:
        came = cut_in(loop, drive, (who, drive.ego), time) if its_turn and not stands else None
        return (Reason.REAR_END if came is None or came.safe else Reason.PRIORITY), entry
    if ego.speed < STANDS:
        return Reason.STANDING, entry
    return (
        Reason.PRIORITY if its_turn and along <= SAME_WAY else Reason.OTHER_RAN_INTO_EGO
    ), entry


def _goes_first(loop: ClosedLoop, drive: Drive, conflict: Conflict, time: float) -> bool:
    """Whether the ego was where its witness goes second before the first one had left.

    Where both drive the same way that is one who is not behind the other; who follows it from the start has nowhere to come in.
    """
    ego, other = state_at(drive, drive.ego, time), state_at(drive, conflict.first, time)
    ahead, _ = ahead_and_left(np.subtract(other[:2], ego[:2]), ego.yaw)
    same_way = math.cos(other.yaw - ego.yaw) > SAME_WAY
    if same_way and float(ahead) >= 0.5 * drive.motion.vehicles[drive.ego].length:
        return False
    if conflict.following:
        return bool(conflict.entry_second > loop.begin + loop.scenario.time[1])
    return (
        float(np.interp(time, drive.motion.time, drive.clock[conflict.first]))
        < conflict.exit_first
    )


def _beside_path(loop: ClosedLoop, drive: Drive, who: int, time: float) -> bool:
    """Whether most of that part of the ego's footprint which touches the other is where its witness' never is."""
    own, its = (
        shapely.Polygon(
            corners(np.array([state_at(drive, n, time)]), vehicle.length, vehicle.width)[0]
        )
        for n, vehicle in ((n, drive.motion.vehicles[n]) for n in (drive.ego, who))
    )
    touching = own.intersection(its.buffer(own.distance(its) + TOUCHING))
    path = loop.world.motion[drive.ego, :, :3]
    beyond = place(
        path[-1:], np.arange(0.0, BEYOND, 1.0), 0.0
    )  # the goal may be passed straight on
    poses = np.concatenate([path, np.column_stack([beyond, np.full(len(beyond), path[-1, 2])])])
    vehicle = drive.motion.vehicles[drive.ego]
    swept = shapely.polygons(corners(poses, vehicle.length, vehicle.width))
    inside = touching.intersection(shapely.union_all(swept[shapely.intersects(swept, touching)]))
    return bool(inside.area < 0.5 * touching.area)


def safe_gap(behind: Floats | float, ahead: Floats | float) -> Floats:
    """Return the gap [m] that RSS asks of two speeds [m/s]: who is behind can stop behind who brakes as hard as it can."""
    stop, its = (
        np.square(behind) / (2.0 * BRAKES_AT_LEAST),
        np.square(ahead) / (2.0 * BRAKES_AT_MOST),
    )
    return np.maximum(np.asarray(behind) * RESPONSE + stop - its, 0.0)


def cut_in(loop: ClosedLoop, drive: Drive, pair: tuple[int, int], time: float) -> CutIn | None:
    """Return how one of a pair last came into the way of the second before a time [s]; None if it was there from the start.

    The second one's way is its certified path, as wide as it is.
    """
    motion, (one, other) = drive.motion, pair
    rows = np.flatnonzero(drive.here[one] & drive.here[other] & (motion.time <= time + 1e-9))
    path = loop.world.motion[other, :, :2]
    if len(rows) == 0 or edge_lengths(path).sum() < STANDS:
        return None
    way, vehicle, its = Curve.through(path), motion.vehicles[one], motion.vehicles[other]
    footprint = corners(
        np.column_stack([motion.position[one], motion.heading[one]])[rows],
        vehicle.length,
        vehicle.width,
    )
    station, aside = (each.reshape(-1, 4) for each in way.project(footprint.reshape(-1, 2)))
    at, _ = way.project(motion.position[other, rows])
    clear = (aside.min(axis=1) > 0.5 * its.width) | (aside.max(axis=1) < -0.5 * its.width)
    before = np.flatnonzero(clear[:-1])  # at the last instant it touches the other or is about to
    if len(before) == 0:
        return None
    since = slice(int(before[-1]) + 1, None)
    gap = (station.min(axis=1) - at - 0.5 * its.length)[since]
    turn = motion.heading[one, rows] - way.at(station.mean(axis=1))[:, 2]
    ahead, behind = (
        (motion.speed[one, rows] * np.cos(turn))[since],
        motion.speed[other, rows][since],
    )
    asked, closing = safe_gap(behind, np.maximum(ahead, 0.0)), float(behind[0] - ahead[0])
    ttc = max(float(gap[0]), 0.0) / closing if closing > 0.0 else None
    least = max(closing, 0.0) / (2.0 * BRAKES_AT_LEAST) + R157_DELAY
    began = float(motion.time[rows[since]][0])
    return CutIn(began, float(gap[0]), float(asked[0]), ttc, least, bool((gap >= asked).any()))
