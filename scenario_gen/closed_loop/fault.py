# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Whose fault a contact with the ego was.

The others keep their certified paths and speeds, and their order among themselves. A contact is
therefore the fault of the vehicle that was at a place, or at a time, where the certificate does
not have it. The order of the ego and another vehicle is that of the drive: an ego that lets the
other one go first has lost its turn. `RULES` lists the reasons; the first one that applies is the
reason of the contact. Without a reason that acquits the ego, the contact counts as its fault.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
import math
from typing import NamedTuple

import numpy as np
import shapely

from scenario_gen.closed_loop.drive import Drive
from scenario_gen.closed_loop.simulation import ClosedLoop, PAST_GOAL_M
from scenario_gen.numerics import ahead_and_left, Bools, edge_lengths, Floats, Ints, place
from scenario_gen.numerics.boxes import corners
from scenario_gen.numerics.curve import Curve
from scenario_gen.situation import Conflict
from scenario_gen.types import Vehicle

STANDSTILL_MPS = 0.5
SAME_DIRECTION_RATIO = 0.7  # least cosine of the angle between two headings of one direction
CONTACT_MARGIN_M = 0.02  # the part of the ego within this of the other is the place of the contact
PATH_MARGIN_M = 0.2  # an ego that is less far beside its reference path is on it
MAX_DELAY_S = 0.5  # an ego that is later than its reference drive by more can lose its turn
# Responsibility-sensitive safety (Shalev-Shwartz, Shammah & Shashua 2017), equation 2.
# The vehicle behind does not accelerate during its response.
RSS_RESPONSE_S = 1.0
REAR_BRAKING_MPS2 = 6.0  # as UN Regulation 157 assumes
LEAD_BRAKING_MPS2 = 9.0  # the limit of a vehicle body
R157_DELAY_S = 0.35  # UN Regulation 157, 5.2.5.3: least TTC = Δv / (2 · 6 m/s²) + 0.35 s


class Reason(StrEnum):
    """The reason of a contact."""

    JUMP = "jump"  # the ego had been at a place that no vehicle can reach in a step
    REVERSING = "reversing"  # the ego drove backwards, or had just done so
    OUT_OF_ORDER = "out_of_order"  # the ego entered when it was the other one's turn
    HEAD_ON = "head_on"  # the ego was off its reference path, against the other's direction
    OUT_OF_PATH = "out_of_path"  # the ego was off its reference path otherwise
    CUT_IN = "cut_in"  # the ego entered beside or ahead of the other one, without the safe gap
    REAR_END = "rear_end"  # the ego hit a vehicle that stood or drove ahead of it
    STANDING = "standing"  # the ego stood, on its path and in its turn
    PRIORITY = "priority"  # the ego goes first by the certificate
    OTHER_RAN_INTO_EGO = "other_ran_into_ego"  # the other one drove into the ego from behind
    UNDECIDED = "undecided"  # none of these

    @property
    def at_fault(self) -> bool:
        """Whether it counts as the ego's fault."""
        return self not in (Reason.STANDING, Reason.PRIORITY, Reason.OTHER_RAN_INTO_EGO)


class VehicleState(NamedTuple):
    """The state of a vehicle: x, y [m], yaw [rad], speed [m/s], negative if it reverses."""

    x: float
    y: float
    yaw: float
    speed: float


@dataclass(frozen=True)
class CutIn:
    """A vehicle entering the path of another one ahead of it.

    Attributes:
        time: when it entered [s].
        gap: bumper-to-bumper gap at that time [m]; negative if it entered beside the other.
        safe_gap: gap that RSS requires at their speeds at that time [m].
        ttc: time to collision at that time [s]; None if the gap did not close.
        least_ttc: least time to collision for which UN R157 expects a reaction [s].
        safe: whether the gap was ever as large as RSS requires from then on.
    """

    time: float
    gap: float
    safe_gap: float
    ttc: float | None
    least_ttc: float
    safe: bool


def state_at(drive: Drive, vehicle: int, time: float) -> VehicleState:
    """Return the state of a vehicle at a time [s]."""
    motion = drive.motion
    states = motion.at(time)
    x, y, yaw = states.poses[vehicle].tolist()
    speed = float(states.speed[vehicle])
    k = min(int(np.searchsorted(motion.time, time, side="right")), len(motion.time) - 1)
    step = motion.position[vehicle, k] - motion.position[vehicle, max(k - 1, 0)]
    moved = float(ahead_and_left(step, yaw)[0])
    if moved < -1e-6:
        speed = min(speed, moved / motion.dt)
    return VehicleState(x, y, yaw, speed)


@dataclass(frozen=True, eq=False)
class Contact:
    """The contact of the ego with another vehicle.

    Attributes:
        loop: the closed loop that was driven.
        drive: the drive.
        other: index of the other vehicle.
        time: of the contact [s].
    """

    loop: ClosedLoop
    drive: Drive
    other: int
    time: float

    @cached_property
    def ego_state(self) -> VehicleState:
        """The state of the ego."""
        return state_at(self.drive, self.drive.ego, self.time)

    @cached_property
    def other_state(self) -> VehicleState:
        """The state of the other vehicle."""
        return state_at(self.drive, self.other, self.time)

    @cached_property
    def conflict(self) -> Conflict | None:
        """Their conflict in the certified scenario."""
        return self.loop.conflicts.get(self.other)

    @cached_property
    def direction_ratio(self) -> float:
        """Cosine of the angle between their headings."""
        return math.cos(self.other_state.yaw - self.ego_state.yaw)

    @property
    def same_direction(self) -> bool:
        """Whether they drive in the same direction."""
        return self.direction_ratio > SAME_DIRECTION_RATIO

    @property
    def other_stands(self) -> bool:
        """Whether the other vehicle stands."""
        return abs(self.other_state.speed) < STANDSTILL_MPS

    @cached_property
    def distance_ahead(self) -> float:
        """Distance [m] from the ego's centre to the other one's, along the ego's heading."""
        offset = np.subtract(self.other_state[:2], self.ego_state[:2])
        return float(ahead_and_left(offset, self.ego_state.yaw)[0])

    @cached_property
    def cut_in(self) -> CutIn | None:
        """The ego's entry into the other one's path, if both drove in the same direction."""
        if not self.same_direction:
            return None
        return find_cut_in(self.loop, self.drive, (self.drive.ego, self.other), self.time)

    @property
    def entered_ahead(self) -> bool:
        """Whether the ego entered the other one's path ahead of it."""
        return self.cut_in is not None and self.cut_in.gap > 0.0

    @cached_property
    def before(self) -> Bools:
        """Which instants (T,) of the drive are not after the contact."""
        return np.asarray(self.drive.motion.time <= self.time + 1e-9)

    @cached_property
    def response(self) -> Ints:
        """Instants (K,) before the contact from which on the other one could no longer stop."""
        left = self.time - self.drive.motion.time
        stopping = RSS_RESPONSE_S + self.drive.motion.speed[self.other] / REAR_BRAKING_MPS2
        return np.flatnonzero(self.before & (left <= stopping))

    @cached_property
    def reference(self) -> Floats:
        """Poses (P, 3) x, y [m], yaw [rad] of the ego's reference drive, and straight on."""
        path = self.loop.world.motion[self.drive.ego, :, :3]
        beyond = place(path[-1:], np.arange(0.0, PAST_GOAL_M, 1.0), 0.0)
        straight = np.column_stack([beyond, np.full(len(beyond), path[-1, 2])])
        return np.concatenate([path, straight])

    def _nearest_reference(self, poses: Floats) -> tuple[Floats, Bools]:
        """Return the poses (K, 3) of the reference drive nearest to poses (K, 3).

        Returns:
            They, and which poses (K,) are across the reference drive.
        """
        offset = poses[:, None, :2] - self.reference[:, :2]
        nearest = self.reference[np.hypot(offset[..., 0], offset[..., 1]).argmin(axis=1)]
        return nearest, np.cos(poses[:, 2] - nearest[:, 2]) < SAME_DIRECTION_RATIO

    @cached_property
    def off_path(self) -> bool:
        """Whether the touching part of the ego is mostly where its reference drive never is.

        The ego is beside its path then by PATH_MARGIN_M at least, or across it. Without a conflict
        the reference drive is never at the place of the contact.
        """
        drive = self.drive
        pose = np.array(self.ego_state[:3])
        (nearest,), is_across = self._nearest_reference(pose[None])
        if is_across:
            return True
        if abs(ahead_and_left(nearest[:2] - pose[:2], nearest[2])[1]) < PATH_MARGIN_M:
            return False
        if self.conflict is None:
            return True
        ego, other = drive.motion.vehicles[drive.ego], drive.motion.vehicles[self.other]
        own_box = _footprint(self.ego_state, ego)
        other_box = _footprint(self.other_state, other)
        reach = own_box.distance(other_box) + CONTACT_MARGIN_M
        touching = own_box.intersection(other_box.buffer(reach))
        swept = shapely.polygons(corners(self.reference, ego.length, ego.width))
        near = swept[shapely.intersects(swept, touching)]
        inside = touching.intersection(shapely.union_all(near))
        return bool(inside.area < 0.5 * touching.area)

    @cached_property
    def lost_turn(self) -> bool:
        """Whether the ego, which goes first by the certificate, has let the other one go first.

        The ego was late, and could still stop before the conflict area when the other one could no
        longer stop comfortably.
        """
        conflict, ego = self.conflict, self.drive.ego
        if conflict is None or conflict.first != ego:
            return False
        comfortable = float(self.loop.traits.braking[conflict.second])
        instant = self._commitment(conflict.second, conflict.entry_second, comfortable)
        if instant is None:
            return False
        ego_instant = self._commitment(ego, conflict.entry_first, REAR_BRAKING_MPS2)
        if ego_instant is not None and ego_instant <= instant:
            return False
        time = self.loop.begin + self.drive.motion.time[instant]
        return bool(self.drive.clock[ego, instant] < time - MAX_DELAY_S)

    def _commitment(self, vehicle: int, clock: float, braking: float) -> int | None:
        """Return the instant from which on a vehicle could not stop where its clock is `clock`.

        It brakes by `braking` [m/s²]. None if it could stop until the contact.
        """
        drive, loop = self.drive, self.loop
        rows = np.flatnonzero(self.before)
        area = loop.driven_distance(vehicle, np.array([clock]))
        way = area - loop.driven_distance(vehicle, drive.clock[vehicle, rows])
        speed = drive.motion.speed[vehicle, rows]
        able = np.flatnonzero(way > braking_distance(speed, braking))
        instant = int(able[-1]) + 1 if len(able) else 0
        return instant if instant < len(rows) else None

    def ego_has_turn(self) -> bool:
        """Whether the ego goes first at the conflict, is on its path and has not lost its turn."""
        return (
            self.conflict is not None
            and self.conflict.first == self.drive.ego
            and not self.off_path
            and not self.lost_turn
        )

    def follows_jump(self) -> bool:
        """Whether the ego had jumped before."""
        return bool(self.before[list(self.drive.jumps)].any())

    def ego_reverses(self) -> bool:
        """Whether the ego drove backwards."""
        return self.ego_state.speed < 0.0

    def ego_entered_early(self) -> bool:
        """Whether the ego entered the conflict area in the other one's turn, before that one left.

        Where both drive in the same direction, an ego behind the other one did not enter early.
        """
        conflict = self.conflict
        if conflict is None:
            return False
        half_length = 0.5 * self.drive.motion.vehicles[self.drive.ego].length
        if self.same_direction and self.distance_ahead >= half_length:
            return False
        if conflict.first == self.drive.ego:
            return self.lost_turn and self._moved_into(conflict.entry_first)
        if conflict.following:  # a follower from the start on has no place to enter
            return bool(conflict.entry_second > self.loop.begin + self.loop.scenario.time[1])
        clock = np.interp(self.time, self.drive.motion.time, self.drive.clock[conflict.first])
        return bool(clock < conflict.exit_first)

    def _moved_into(self, clock: float) -> bool:
        """Whether the ego moves, or entered the area at a clock [s] and moved in the response."""
        if not self.ego_stands():
            return True
        drive, ego = self.drive, self.drive.ego
        moved = (drive.motion.speed[ego, self.response] >= STANDSTILL_MPS).any()
        return bool(moved and (self.before & (drive.clock[ego] >= clock)).any())

    def is_head_on(self) -> bool:
        """Whether the ego was off its path, against the other one's direction."""
        return self.off_path and self.direction_ratio < -SAME_DIRECTION_RATIO

    def ego_left_path(self) -> bool:
        """Whether the ego was off its path, and not because it moved into a gap."""
        moves = self.ego_state.speed >= STANDSTILL_MPS
        return self.off_path and not (self.entered_ahead and moves)

    def ego_cut_in(self) -> bool:
        """Whether the ego cut in, ahead or beside, without a safe gap, and it was not its turn."""
        if self.cut_in is None or self.cut_in.safe or self.ego_has_turn():
            return False
        vehicles = self.drive.motion.vehicles
        return self.cut_in.gap > -(vehicles[self.drive.ego].length + vehicles[self.other].length)

    def ego_closed_gap(self) -> bool:
        """Whether the ego drove into the vehicle ahead of it."""
        if self.distance_ahead <= 0.0 or not (self.same_direction or self.other_stands):
            return False
        return self.ego_state.speed > self.other_state.speed * self.direction_ratio

    def ego_hit_rear(self) -> bool:
        """Whether the ego drove into a vehicle ahead that had not cut in on it."""
        return self.ego_closed_gap() and not self._other_cut_in()

    def ego_had_reversed(self) -> bool:
        """Whether the ego drove backwards when the other one could no longer stop."""
        motion, ego = self.drive.motion, self.drive.ego
        step = np.diff(motion.position[ego], axis=0, prepend=motion.position[ego, :1])
        moved = ahead_and_left(step, motion.heading[ego])[0][self.response]
        return bool((moved < -STANDSTILL_MPS * motion.dt).any())

    def ego_had_turned(self) -> bool:
        """Whether the ego was across its path when the other one could no longer stop."""
        poses = self.drive.motion.poses[self.drive.ego, self.response]
        return bool(self._nearest_reference(poses)[1].any())

    def _other_cut_in(self) -> bool:
        """Whether the other one cut in on the ego without a safe gap in the ego's turn."""
        if not self.ego_has_turn() or self.other_stands:
            return False
        entry = find_cut_in(self.loop, self.drive, (self.other, self.drive.ego), self.time)
        return entry is not None and not entry.safe

    def ego_stands(self) -> bool:
        """Whether the ego stood."""
        return self.ego_state.speed < STANDSTILL_MPS

    def other_hit_rear(self) -> bool:
        """Whether the other one drove into the ego from behind."""
        return self.same_direction and self.distance_ahead < 0.0


RULES: tuple[tuple[Reason, Callable[[Contact], bool]], ...] = (
    (Reason.JUMP, Contact.follows_jump),
    (Reason.REVERSING, Contact.ego_reverses),
    (Reason.OUT_OF_ORDER, Contact.ego_entered_early),
    (Reason.HEAD_ON, Contact.is_head_on),
    (Reason.OUT_OF_PATH, Contact.ego_left_path),
    (Reason.CUT_IN, Contact.ego_cut_in),
    (Reason.REAR_END, Contact.ego_hit_rear),
    (Reason.REVERSING, Contact.ego_had_reversed),
    (Reason.OUT_OF_PATH, Contact.ego_had_turned),
    (Reason.PRIORITY, Contact.ego_closed_gap),  # the other one had cut in
    (Reason.STANDING, Contact.ego_stands),
    (Reason.OTHER_RAN_INTO_EGO, Contact.other_hit_rear),
    (Reason.PRIORITY, Contact.ego_has_turn),
)
"""Reasons and their conditions; the first one that holds is the reason of a contact.

Where none holds, the contact is undecided.
"""


def reason_of(contact: Contact) -> Reason:
    """Return the reason of a contact."""
    return next((reason for reason, holds in RULES if holds(contact)), Reason.UNDECIDED)


def _footprint(state: VehicleState, vehicle: Vehicle) -> shapely.Polygon:
    return shapely.Polygon(corners(np.array([state]), vehicle.length, vehicle.width)[0])


def safe_gap(behind: Floats | float, ahead: Floats | float) -> Floats:
    """Return the gap [m] that RSS requires at the speeds [m/s] of the vehicles behind and ahead.

    The vehicle behind can then stop behind one that brakes as hard as it can.
    """
    lead_stopping = np.square(ahead) / (2.0 * LEAD_BRAKING_MPS2)
    stopping = np.asarray(behind) * RSS_RESPONSE_S + braking_distance(behind)
    return np.maximum(stopping - lead_stopping, 0.0)


def braking_distance(speed: Floats | float, braking: float = REAR_BRAKING_MPS2) -> Floats:
    """Return the distance [m] in which a vehicle at a speed [m/s] stops by a braking [m/s²]."""
    return np.square(speed) / (2.0 * braking)


def find_cut_in(
    loop: ClosedLoop, drive: Drive, pair: tuple[int, int], time: float
) -> CutIn | None:
    """Return how vehicle `pair[0]` last entered the path of `pair[1]` before a time [s].

    The path is the certified one, as wide as its vehicle. None if the vehicle was there from the
    start.
    """
    motion, (entering, other) = drive.motion, pair
    present = drive.present[entering] & drive.present[other] & (motion.time <= time + 1e-9)
    rows = np.flatnonzero(present)
    points = loop.world.motion[other, :, :2]
    if len(rows) == 0 or edge_lengths(points).sum() < STANDSTILL_MPS:
        return None
    path = Curve.through(points)
    vehicle, other_vehicle = motion.vehicles[entering], motion.vehicles[other]
    footprints = corners(motion.poses[entering, rows], vehicle.length, vehicle.width)
    station, offset = (values.reshape(-1, 4) for values in path.project(footprints.reshape(-1, 2)))
    first = _entry(offset, 0.5 * other_vehicle.width)
    if first is None:
        return None
    inside: Ints = rows[first:]
    station = station[first:]
    other_station, _ = path.project(motion.position[other, inside])
    gap = station.min(axis=1) - other_station - 0.5 * other_vehicle.length
    turn = motion.heading[entering, inside] - path.at(station.mean(axis=1))[:, 2]
    speed_along = motion.speed[entering, inside] * np.cos(turn)
    other_speed = motion.speed[other, inside]
    required = safe_gap(other_speed, np.maximum(speed_along, 0.0))
    closing = float(other_speed[0] - speed_along[0])
    return CutIn(
        time=float(motion.time[inside[0]]),
        gap=float(gap[0]),
        safe_gap=float(required[0]),
        ttc=max(float(gap[0]), 0.0) / closing if closing > 0.0 else None,
        least_ttc=max(closing, 0.0) / (2.0 * REAR_BRAKING_MPS2) + R157_DELAY_S,
        safe=bool((gap >= required).any()),
    )


def _entry(offset: Floats, half_width: float) -> int | None:
    """Return the first row from which a footprint stays inside a path.

    `offset` (M, 4) are the offsets [m] of its corners from the centre line.
    The last row does not count: there the footprint touches the other vehicle. None if it was
    always inside.
    """
    clear: Bools = (offset.min(axis=1) > half_width) | (offset.max(axis=1) < -half_width)
    outside = np.flatnonzero(clear[:-1])
    return int(outside[-1]) + 1 if len(outside) else None
