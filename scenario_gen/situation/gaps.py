# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How a reaction shows in a motion, recorded or generated: when one passes behind another, how near one drives behind another."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import permutations
from typing import Protocol

import numpy as np
from scipy.spatial import distance

from scenario_gen.numerics import Bools, Floats, Ints, wrap_angle
from scenario_gen.numerics.boxes import footprint_gaps
from scenario_gen.numerics.plane import ahead_and_left
from scenario_gen.situation.interaction import Conflict, find_conflicts
from scenario_gen.situation.tracks import Track
from scenario_gen.types import together, Vehicle

FAR = 60.0  # m, within which one follows
LANE = 2.2  # m, to the side of the other's path
ALIKE = 0.5  # rad, of two headings on one way
_LEFT = 0.5  # m, by which one that merges keeps away from the place that the other one leaves
SLOWEST = 2.0  # m/s, below which a time gap says nothing


LaneGaps = Mapping[tuple[int, int], tuple[Floats, Floats]]  # see `lane_gaps`
Meetings = Mapping[tuple[int, int], Conflict]  # by vehicles, the lower index first


class Motion(Protocol):
    """What encounters and scenarios have in common."""

    @property
    def vehicles(self) -> tuple[Vehicle, ...]:
        """N identities and footprints."""

    @property
    def time(self) -> Floats:
        """(T,) seconds."""

    @property
    def position(self) -> Floats:
        """(N, T, 2) metres."""

    @property
    def heading(self) -> Floats:
        """(N, T) rad."""

    @property
    def speed(self) -> Floats:
        """(N, T) m/s."""

    @property
    def present(self) -> Ints:
        """(N, 2) first and last sample of each."""


def conflict_of(motion: Motion, a: int, b: int) -> Conflict | None:
    """Return the conflict between two vehicles of a motion; None if they have none.

    For more than one pair `conflicts_in` is faster.
    """
    pair = [min(a, b), max(a, b)]
    vehicles = (motion.vehicles[pair[0]], motion.vehicles[pair[1]])
    conflicts = find_conflicts(
        vehicles,
        motion.time,
        motion.position[pair],
        motion.heading[pair],
        motion.present[pair],
    )
    if not conflicts:
        return None
    (conflict,) = conflicts
    return replace(conflict, first=pair[conflict.first], second=pair[conflict.second])


def conflicts_in(motion: Motion) -> tuple[Conflict, ...]:
    """Return the conflicts of a motion, as `find_conflicts` does."""
    return find_conflicts(
        motion.vehicles, motion.time, motion.position, motion.heading, motion.present
    )


def conflicts_by_pair(conflicts: Iterable[Conflict]) -> dict[tuple[int, int], Conflict]:
    """Return conflicts by their vehicles, the lower index first."""
    return {conflict.pair: conflict for conflict in conflicts}


def meetings(tracks: Sequence[Track]) -> Meetings:
    """Return the conflicts of some tracks by their vehicles, the lower index first."""
    poses = np.stack([track.poses for track in tracks])
    present = np.stack([track.present for track in tracks])
    time = np.arange(poses.shape[1], dtype=np.float64) * tracks[0].dt
    vehicles = tuple(track.vehicle for track in tracks)
    return conflicts_by_pair(
        find_conflicts(vehicles, time, poses[..., :2], poses[..., 2], present)
    )


def departure(motion: Motion, who: int, entry: float) -> float:
    """Return when [s] a vehicle leaves before it enters somewhere at `entry` [s].

    That is when its speed rises above 0.5 m/s (on foot 0.2 m/s) and stays there, or, if it never is so slow, when it is slowest.
    A vehicle that is faster throughout and slowest at once is one that nothing is seen of: it left when it came. Who stands at
    the very place, or in it, leaves when that stand ends.
    """
    first, least = int(motion.present[who, 0]), motion.vehicles[who].kind.waits_below
    last = max(int(np.searchsorted(motion.time, entry + 1e-9)), first + 1)
    later = motion.speed[who, last : int(motion.present[who, 1]) + 1]
    if motion.speed[who, last - 1] < least and len(later):  # it stands where the area begins
        last += int(np.argmax(later >= least)) + 1 if (later >= least).any() else len(later)
    speed, time = motion.speed[who, first:last], motion.time[first:last]
    slow = np.flatnonzero(speed < least)
    if len(slow) == 0:
        return float(time[int(np.argmin(speed))])
    k = int(slow[-1])
    if k + 1 == len(speed):
        return float(time[k])
    share = (least - speed[k]) / (speed[k + 1] - speed[k])
    return float(time[k] + share * (time[k + 1] - time[k]))


def lag_behind(motion: Motion, conflict: Conflict) -> float:
    """Return by how much [s] the second one of a conflict leaves later than the first one has cleared the shared area."""
    return departure(motion, conflict.second, conflict.entry_second) - conflict.exit_first


def passing(motion: Motion, conflict: Conflict, *, merges: bool) -> tuple[float, float]:
    """Return when [s] the first one of a conflict clears, and when the second one enters.

    What they share is what both sweep; of one that merges the place where it enters, for the other one goes on before it.
    """
    enters = conflict.entry_second
    if not merges:
        return conflict.exit_first, enters
    first, second = conflict.first, conflict.second
    poses, place = (
        np.column_stack([motion.position[n], motion.heading[n]]) for n in (first, second)
    )
    place = np.repeat(
        [[np.interp(enters, motion.time, column) for column in place.T]], len(poses), axis=0
    )
    gap, _ = footprint_gaps(
        motion.vehicles[first].half, poses, motion.vehicles[second].half, place
    )
    came, goes = motion.present[first].tolist()
    near = came + np.flatnonzero(
        gap[came : goes + 1] < max(_LEFT, float(gap[came : goes + 1].min()) + 1e-9)
    )
    k, last = int(near[-1]), min(int(near[-1]) + 1, goes)
    share = (_LEFT - gap[k]) / (gap[last] - gap[k]) if gap[last] > _LEFT > gap[k] else 0.0
    return float(motion.time[k] + share * (motion.time[last] - motion.time[k])), enters


def is_behind(motion: Motion, who: int, whom: int) -> Bools:
    """(T,) whether one drives behind the other on the same way, within 60 m: where that one was, or straight behind it."""
    a, b = motion.position[who], motion.position[whom]
    yaw_a, yaw_b = motion.heading[who], motion.heading[whom]
    both = np.zeros(len(a), dtype=np.bool_)
    both[together(motion.present, who, whom)] = True
    between = b - a
    along, across = ahead_and_left(between, yaw_a)
    alike = np.abs(wrap_angle(yaw_b - yaw_a)) < ALIKE
    behind = (along > 0.0) & (np.abs(across) < LANE) & alike
    step = max(round(0.5 / float(motion.time[1] - motion.time[0])), 1)
    now = np.arange(len(a))
    for mine, yaw, path, path_yaw, sign in ((a, yaw_a, b, yaw_b, -1), (b, yaw_b, a, yaw_a, 1)):
        rows = np.arange(0, len(path), step)  # where the other was before; where this one will be
        square = distance.cdist(mine, path[rows], "sqeuclidean")
        nearest = np.argmin(square, axis=1)
        near = (np.sqrt(square[now, nearest]) < LANE) & (
            np.abs(wrap_angle(path_yaw[rows[nearest]] - yaw)) < ALIKE
        )
        behind = behind | (near & (sign * (rows[nearest] - now) > step))
    return np.asarray(behind & both & (np.sqrt(np.square(between).sum(axis=1)) < FAR))


def bumper_gaps(motion: Motion, who: int, whom: int) -> Floats:
    """(T,) metres from the front bumper of one to the rear one of another that it drives behind."""
    apart = np.sqrt(np.square(motion.position[whom] - motion.position[who]).sum(axis=1))
    return np.asarray(apart - 0.5 * (motion.vehicles[who].length + motion.vehicles[whom].length))


def lane_gaps(motion: Motion) -> LaneGaps:
    """Return (who, whom): speeds (k,) [m/s] and gaps (k,) [m], bumper to bumper, of all who drive behind another one."""
    found = {}
    for who, whom in permutations(range(len(motion.vehicles)), 2):
        alike = np.abs(wrap_angle(motion.heading[who] - motion.heading[whom])) < ALIKE
        at = alike & is_behind(motion, who, whom) if alike.any() else alike
        if at.any():
            found[who, whom] = motion.speed[who, at], bumper_gaps(motion, who, whom)[at]
    return found


def time_gaps(gaps: LaneGaps, who: int, whom: int) -> Floats:
    """Return the time gaps (k,) [s], bumper to bumper, of a vehicle that drives (2 m/s or more) behind another one."""
    speed, gap = gaps.get((who, whom), (np.zeros(0), np.zeros(0)))
    drives = speed > SLOWEST
    return np.asarray(gap[drives] / speed[drives])
