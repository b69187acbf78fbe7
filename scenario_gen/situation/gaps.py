# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Gaps in time and space that show how drivers react, in recorded and in generated motions."""

from collections.abc import Mapping, Sequence
from itertools import permutations
import math

import numpy as np

from scenario_gen.numerics import Bools, Floats, Ints
from scenario_gen.numerics.boxes import footprint_gaps
from scenario_gen.numerics.kernels import B, F2, F3, I, I2, kernel, OUTB2
from scenario_gen.numerics.rounding import ROUNDING_M, ROUNDING_S
from scenario_gen.situation.conflicts import Conflict
from scenario_gen.types import Motion

MAX_FOLLOWING_M = 60.0  # a leader is nearer
HALF_LANE_M = 2.2  # a follower is nearer to its leader's path
MAX_HEADING_DIFFERENCE_RAD = 0.5  # between a follower and its leader
PATH_SAMPLE_PERIOD_S = 0.5
MERGE_CLEARANCE_M = 0.5  # between a merging vehicle and the place that the other one leaves
MIN_HEADWAY_SPEED_MPS = 2.0  # below it, a time gap has no meaning

LaneGaps = Mapping[tuple[int, int], tuple[Floats, Floats]]  # see `lane_gaps`


def departure(motion: Motion, n: int, entry: float) -> float:
    """Return when [s] a vehicle departs before it enters an area at `entry` [s].

    This is when its speed last rises above 0.5 m/s (on foot 0.2 m/s), or, if it is never so slow,
    when it is slowest. A vehicle that stands at the edge of the area, or inside, departs when that
    standstill ends.
    """
    threshold = motion.vehicles[n].kind.waits_below
    first, present_until = motion.present[n].tolist()
    last = max(int(np.searchsorted(motion.time, entry + ROUNDING_S)), first + 1)
    later = motion.speed[n, last : present_until + 1]
    if motion.speed[n, last - 1] < threshold and len(later):
        moves = later >= threshold
        last += int(np.argmax(moves)) + 1 if moves.any() else len(later)

    speed, time = motion.speed[n, first:last], motion.time[first:last]
    slow = np.flatnonzero(speed < threshold)
    if len(slow) == 0:
        return float(time[int(np.argmin(speed))])
    k = int(slow[-1])
    if k + 1 == len(speed):
        return float(time[k])
    share = (threshold - speed[k]) / (speed[k + 1] - speed[k])
    return float(time[k] + share * (time[k + 1] - time[k]))


def passing(motion: Motion, conflict: Conflict, *, merges: bool) -> tuple[float, float]:
    """Return when [s] the first vehicle clears the conflict area, and when the second one enters.

    If the second one merges, it shares only the place where it enters, since the first one drives
    on in front of it.
    """
    enters = conflict.entry_second
    if not merges:
        return conflict.exit_first, enters
    first, second = conflict.first, conflict.second
    poses = np.column_stack([motion.position[first], motion.heading[first]])
    columns = (*motion.position[second].T, motion.heading[second])
    place = np.array([np.interp(enters, motion.time, column) for column in columns])
    gap, _ = footprint_gaps(
        motion.vehicles[first].half,
        poses,
        motion.vehicles[second].half,
        np.tile(place, (len(poses), 1)),
    )
    begin, end = motion.present[first].tolist()
    present_gap = gap[begin : end + 1]
    is_near = present_gap < max(MERGE_CLEARANCE_M, float(present_gap.min()) + ROUNDING_M)
    k = begin + int(np.flatnonzero(is_near)[-1])
    after = min(k + 1, end)
    share = 0.0
    if gap[after] > MERGE_CLEARANCE_M > gap[k]:
        share = (MERGE_CLEARANCE_M - gap[k]) / (gap[after] - gap[k])
    return float(motion.time[k] + share * (motion.time[after] - motion.time[k])), enters


def encroachment(motion: Motion, conflict: Conflict) -> float:
    """Return the post-encroachment time [s]: from the first one's exit to the second one's entry.

    Negative if both were inside the conflict area. In a merge that is the place where the second
    one enters. NaN if the first one is on the shared path from the start: the second one follows.
    """
    first_time = motion.time[motion.present[conflict.first, 0]]
    if conflict.following and conflict.entry_first <= first_time:
        return math.nan
    clears, enters = passing(motion, conflict, merges=conflict.following)
    return enters - clears


def is_behind(motion: Motion, follower: int, leader: int) -> Bools:
    """(T,) whether a vehicle drives behind another one on the same way, within 60 m.

    It is straight behind the other one, drives where that one was before, or the other one is
    where it will be.
    """
    return np.asarray(_behind(motion, [(follower, leader)], only_alike=False)[0])


def _behind(motion: Motion, pairs: Sequence[tuple[int, int]], *, only_alike: bool) -> Bools:
    """Return (P, T) whether followers are behind leaders, see `is_behind`.

    Args:
        motion: the vehicles.
        pairs: P times follower and leader.
        only_alike: False where their headings differ.
    """
    behind = np.zeros((len(pairs), len(motion.time)), dtype=np.bool_)
    step = max(round(PATH_SAMPLE_PERIOD_S / motion.dt), 1)
    rows = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    poses = motion.position, motion.heading
    _fill_behind(*poses, motion.present, rows, step, only_alike, behind)
    return behind


@kernel(F3, F2, I2, I2, I, B, OUTB2)
def _fill_behind(
    position: Floats,
    heading: Floats,
    present: Ints,
    pairs: Ints,
    step: int,
    only_alike: bool,
    out: Bools,
) -> None:
    """Fill `out` (P, T), as `_behind`."""
    for k in range(len(pairs)):
        follower, leader = pairs[k, 0], pairs[k, 1]
        path, yaw = position[follower], heading[follower]
        leader_path, leader_yaw = position[leader], heading[leader]
        first = max(present[follower, 0], present[leader, 0])
        last = min(present[follower, 1], present[leader, 1])
        for t in range(first, last + 1):
            if only_alike and not _is_alike(yaw[t], leader_yaw[t]):
                continue
            dx, dy = leader_path[t, 0] - path[t, 0], leader_path[t, 1] - path[t, 1]
            if np.sqrt(dx * dx + dy * dy) >= MAX_FOLLOWING_M:
                continue
            cos, sin = np.cos(yaw[t]), np.sin(yaw[t])
            is_straight = dx * cos + dy * sin > 0.0 and abs(dy * cos - dx * sin) < HALF_LANE_M
            out[k, t] = (
                (is_straight and _is_alike(leader_yaw[t], yaw[t]))
                or _nearest_in(leader_path, leader_yaw, path[t], yaw[t], step, 0, t - step)
                or _nearest_in(
                    path, yaw, leader_path[t], leader_yaw[t], step, t + step + 1, len(path)
                )
            )


@kernel(inline=True)
def _is_alike(heading: float, other: float) -> bool:
    """Return whether two headings [rad] differ little."""
    difference = abs(heading - other)
    if difference < 5.0 and abs(difference - MAX_HEADING_DIFFERENCE_RAD) > 0.1:
        return difference < MAX_HEADING_DIFFERENCE_RAD  # a remainder would take most of the time
    return abs((heading - other + np.pi) % (2.0 * np.pi) - np.pi) < MAX_HEADING_DIFFERENCE_RAD


@kernel(inline=True)
def _nearest_in(
    path: Floats, heading: Floats, place: Floats, yaw: float, step: int, begin: int, end: int
) -> bool:
    """Return whether the sample of a path (T, 2) nearest to a pose is near, and in a range.

    The path is compared at every `step`-th sample, and of equal distances the first one counts.
    """
    least, nearest = np.inf, -1
    for k in range(-(-begin // step) * step, end, step):
        square = _square(path[k], place)
        if square < least:
            least, nearest = square, k
    if np.sqrt(least) >= HALF_LANE_M or not _is_alike(heading[nearest], yaw):
        return False
    for k in range(0, len(path), step):
        square = _square(path[k], place)
        if square < least or (square == least and k < nearest):
            return False
    return True


@kernel(inline=True)
def _square(place: Floats, other: Floats) -> float:
    """Return the squared distance [m²] of two places (2,)."""
    dx, dy = place[0] - other[0], place[1] - other[1]
    return float(dx * dx + dy * dy)


def bumper_gaps(motion: Motion, follower: int, leader: int) -> Floats:
    """(T,) metres from the front bumper of a vehicle to the rear bumper of another one ahead."""
    between = motion.position[leader] - motion.position[follower]
    lengths = motion.vehicles[follower].half[0] + motion.vehicles[leader].rear
    return np.asarray(np.sqrt(np.square(between).sum(axis=1)) - lengths)


def lane_gaps(motion: Motion) -> LaneGaps:
    """Return speeds (k,) [m/s] and bumper-to-bumper gaps (k,) [m] per (follower, leader)."""
    pairs = list(permutations(range(len(motion.vehicles)), 2))
    gaps = {}
    for (follower, leader), rows in zip(
        pairs, _behind(motion, pairs, only_alike=True), strict=True
    ):
        if rows.any():
            speed = motion.speed[follower, rows]
            gaps[follower, leader] = speed, bumper_gaps(motion, follower, leader)[rows]
    return gaps


def time_gaps(gaps: LaneGaps, follower: int, leader: int) -> Floats:
    """Return the time gaps (k,) [s], bumper to bumper, at speeds of 2 m/s or more."""
    speed, gap = gaps.get((follower, leader), (np.zeros(0), np.zeros(0)))
    drives = speed > MIN_HEADWAY_SPEED_MPS
    return np.asarray(gap[drives] / speed[drives])
