# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The kind of an encounter: what two drivers do with each other.

All definitions use the whole time in which both vehicles are present. The first one that holds
gives the kind:

- *following*: during at least 70 % of the first and of the last quarter, one vehicle drives on
  the path of the other: within 2.5 m of it, with headings that differ by at most 30°.
- *merging*: the same holds for the last quarter alone.
- *left_turn*: the paths cross at 30° to 150°, and one vehicle turns by 45° or more (in left-hand
  traffic this is a right turn).
- *crossing*: the paths cross at 30° to 150°, and both vehicles drive on.
- *oncoming*: where the vehicles are nearest to each other, their headings differ by 150° or more.
- *other*: none of these, for example side by side in two lanes.

Paths continue straight beyond the recording, because recordings end early.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from scenario_gen.numerics import (
    ahead_and_left,
    angle_between,
    edge_lengths,
    Floats,
    meeting_shares,
    unit,
    wrap_angle,
)
from scenario_gen.numerics.curve import Curve
from scenario_gen.types import Motion, together


class EncounterKind(StrEnum):
    """What two drivers do with each other; see the module for the definitions."""

    CROSSING = "crossing"
    LEFT_TURN = "left_turn"
    MERGING = "merging"
    FOLLOWING = "following"
    ONCOMING = "oncoming"
    OTHER = "other"


@dataclass(frozen=True)
class KindThresholds:
    """Thresholds of the definitions; found with drawn textbook motions and recorded encounters.

    Attributes:
        lane_offset_m: more than the error of a GPS position, less than the width of a lane.
        same_heading_rad: difference of headings below which two vehicles drive the same way.
        opposite_heading_rad: difference of headings above which they drive in opposite ways.
        on_path_share: of a quarter of the time; the rest may be noise.
        turn_rad: a bend of a road turns less during one encounter, a junction turns more.
        path_extension_m: how far a vehicle in a queue continues on its leader's path.
        crossing_extension_m: how far a vehicle may stop before the place where the paths cross.
        path_step_m: distance of the points of a path.
        sample_period_s: all samples give the same kinds as these.
        min_speed_mps: below it a heading is not reliable.
        alone_s: a vehicle that is present for this long without the other one may still turn
            because of it.
    """

    lane_offset_m: float = 2.5
    same_heading_rad: float = np.radians(30.0)
    opposite_heading_rad: float = np.radians(150.0)
    on_path_share: float = 0.7
    turn_rad: float = np.radians(45.0)
    path_extension_m: float = 150.0
    crossing_extension_m: float = 15.0
    path_step_m: float = 4.0
    sample_period_s: float = 0.3
    min_speed_mps: float = 0.5
    alone_s: float = 15.0


THRESHOLDS = KindThresholds()


@dataclass(frozen=True, eq=False)
class _Drive:
    """Positions (T, 2) [m], headings (T,) [rad] and speeds (T,) [m/s] of one vehicle."""

    position: Floats
    heading: Floats
    speed: Floats

    @property
    def turn(self) -> float:
        """How far the heading turns in total [rad], left positive, while the vehicle moves."""
        heading = np.unwrap(self.heading[self.speed > THRESHOLDS.min_speed_mps])
        return float(heading[-1] - heading[0]) if len(heading) else 0.0

    @property
    def path(self) -> Floats:
        """(P, 3) poses of the path, extended straight on at both ends."""
        moved = np.concatenate([[True], edge_lengths(self.position) > 0.0])
        heading = np.unwrap(self.heading[moved])
        curve = Curve(np.column_stack([self.position[moved], heading]))
        extension, step = THRESHOLDS.path_extension_m, THRESHOLDS.path_step_m
        return curve.at(np.arange(step - extension, curve.length + extension, step))

    def share_on(self, path: Floats, quarter: slice) -> float:
        """Return the share of the samples in a quarter that lie on a path (P, 3)."""
        position, heading = self.position[quarter], self.heading[quarter]
        offset = position[:, None] - path[:, :2]
        squares = np.square(offset).sum(axis=2)
        nearest = squares.argmin(axis=1)
        rows = np.arange(len(nearest))
        _, left = ahead_and_left(offset[rows, nearest], path[nearest, 2])
        turned = np.abs(wrap_angle(heading - path[nearest, 2]))
        reach = THRESHOLDS.path_step_m + THRESHOLDS.lane_offset_m
        on_path = (
            (np.abs(left) < THRESHOLDS.lane_offset_m)
            & (turned < THRESHOLDS.same_heading_rad)
            & (squares[rows, nearest] < reach * reach)
        )
        return float(on_path.mean())

    @property
    def edges(self) -> tuple[Floats, Floats, Floats]:
        """Begins (E, 2), vectors (E, 2) and headings (E,) of the edges of the extended path."""
        first, last = unit(self.heading[[0, -1]]) * THRESHOLDS.crossing_extension_m
        position = np.vstack([self.position[0] - first, self.position, self.position[-1] + last])
        heading = np.concatenate([self.heading[:1], self.heading])
        return position[:-1], np.diff(position, axis=0), heading


def kind_of(motion: Motion, a: int, b: int) -> EncounterKind:
    """Return what two vehicles of an encounter or scenario do; the same for (b, a).

    Two vehicles that are never present together give `OTHER`.
    """
    common = together(motion.present, a, b)
    if common.stop - common.start < 2:
        return EncounterKind.OTHER
    period = float(motion.time[1] - motion.time[0])
    stride = max(round(THRESHOLDS.sample_period_s / period), 1)
    rows = slice(common.start, common.stop, stride)
    alone = round(THRESHOLDS.alone_s / period)
    whole = []
    for n in (a, b):
        begin, end = motion.present[n].tolist()
        begin = max(begin, common.start - stride * (alone // stride))
        whole.append(_drive(motion, n, slice(begin, min(end + 1, common.stop + alone), stride)))
    return _kind_of_drives(_drive(motion, a, rows), _drive(motion, b, rows), *whole)


def _drive(motion: Motion, vehicle: int, rows: slice) -> _Drive:
    """Return some samples of a vehicle."""
    return _Drive(
        motion.position[vehicle, rows], motion.heading[vehicle, rows], motion.speed[vehicle, rows]
    )


def _kind_of_drives(
    first: _Drive, second: _Drive, whole_first: _Drive, whole_second: _Drive
) -> EncounterKind:
    """Return the kind of two drives while together, with the samples before and after it."""
    count = max(len(first.speed) // 4, 1)
    path, other_path = first.path, second.path

    def same_way(quarter: slice) -> bool:
        shares = first.share_on(other_path, quarter), second.share_on(path, quarter)
        return max(shares) >= THRESHOLDS.on_path_share

    if same_way(slice(-count, None)):
        return EncounterKind.FOLLOWING if same_way(slice(count)) else EncounterKind.MERGING

    if _paths_cross(whole_first, whole_second):
        turns = max(abs(whole_first.turn), abs(whole_second.turn)) >= THRESHOLDS.turn_rad
        return EncounterKind.LEFT_TURN if turns else EncounterKind.CROSSING

    nearest = np.hypot(*(first.position - second.position).T).argmin()
    turned = abs(angle_between(first.heading[nearest], second.heading[nearest]))
    opposite = turned >= THRESHOLDS.opposite_heading_rad
    return EncounterKind.ONCOMING if opposite else EncounterKind.OTHER


def _paths_cross(first: _Drive, second: _Drive) -> bool:
    """Whether two paths cross, and not nearly parallel to each other."""
    begin, vector, heading = first.edges
    other_begin, other_vector, other_heading = second.edges
    share, other_share, cross = meeting_shares(
        begin[:, None], vector[:, None], other_begin, other_vector
    )
    tolerance = 1e-6  # paths that cross at the end of an edge do so on any processor
    inside = np.abs(share - 0.5) <= 0.5 + tolerance
    other_inside = np.abs(other_share - 0.5) <= 0.5 + tolerance
    angle = np.abs(wrap_angle(heading[:, None] - other_heading))
    oblique = (angle > THRESHOLDS.same_heading_rad) & (angle < THRESHOLDS.opposite_heading_rad)
    return bool((inside & other_inside & oblique & (np.abs(cross) > 0.0)).any())
