# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Conflicts: the swept footprints of two vehicles intersect; the order is that of first entry.

The conflict area of vehicles a and b is the intersection of their swept footprints. A footprint of
a lies in the sweep of a, so a is inside the area exactly while its footprint meets the sweep of b.
Therefore two box tests replace polygon clipping.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from weakref import WeakKeyDictionary

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Bools, Floats, Ints
from scenario_gen.numerics.boxes import Box, box_gap
from scenario_gen.numerics.kernels import F1, F2, F3, I2, kernel, OUT2
from scenario_gen.situation.tracks import Track
from scenario_gen.types import Motion

POSE_STEP_M = 1.0  # longest distance between two neighbouring poses of a sweep
POSE_TURN_RAD = 0.1  # largest turn between them
STANDSTILL_STEP_M = 0.01  # samples that move less add nothing to a sweep
BLOCK_POSES = 16  # poses that share one bounding circle
CONTACT_DEPTH_M = 1e-6  # footprints that meet less deeply only touch
BISECTION_STEPS = 10  # to find when a footprint enters the conflict area
SAME_WAY_RAD = 0.5  # largest difference of headings on a shared path
FOLLOWING_LENGTHS = 3.0  # vehicle lengths of shared path from which on a conflict is following

HalfSize = tuple[float, float]  # half length, half width [m] of a footprint


@dataclass(frozen=True)
class Conflict:
    """The swept footprints of two vehicles intersect: crossing, merging or following.

    Attributes:
        first: index of the vehicle that enters the conflict area first; of followers the leader.
        second: index of the other vehicle.
        following: whether they share a long part of their paths.
        entry_first: when [s] the first one enters the conflict area.
        exit_first: when [s] the first one has left it.
        entry_second: when [s] the second one enters.
        exit_second: when [s] the second one has left it.
    """

    first: int
    second: int
    following: bool
    entry_first: float
    exit_first: float
    entry_second: float
    exit_second: float

    @property
    def pair(self) -> tuple[int, int]:
        """Its vehicles, the lower index first."""
        return min(self.first, self.second), max(self.first, self.second)

    @property
    def encroachment(self) -> float:
        """Post-encroachment time [s]: from the exit of the first to the entry of the second."""
        return self.entry_second - self.exit_first

    @property
    def arrival_gap(self) -> float:
        """From the entry of the first to the entry of the second [s]."""
        return self.entry_second - self.entry_first


# A scenario is checked, measured and evaluated: its conflicts are known as long as it exists.
_conflicts_of: WeakKeyDictionary[Motion, tuple[Conflict, ...]] = WeakKeyDictionary()
PairConflicts = Mapping[tuple[int, int], Conflict]  # by vehicles, the lower index first


def find_conflicts(
    motion: Motion, pairs: Iterable[tuple[int, int]] | None = None
) -> tuple[Conflict, ...]:
    """Return one conflict per pair of vehicles whose swept footprints intersect, ordered by pair.

    By default, `pairs` are all pairs. Between samples position and heading are linear. If two
    vehicles enter at the same instant (both are inside from the start), the order along the shared
    path counts, else the index.
    """
    if pairs is not None:
        return _conflicts(motion, pairs)
    if motion not in _conflicts_of:
        _conflicts_of[motion] = _conflicts(motion, combinations(range(len(motion.vehicles)), 2))
    return _conflicts_of[motion]


def _conflicts(motion: Motion, pairs: Iterable[tuple[int, int]]) -> tuple[Conflict, ...]:
    """Return the conflicts of some pairs."""
    chosen = np.array(sorted({(min(pair), max(pair)) for pair in pairs}), dtype=np.int64)
    half = np.array([vehicle.half for vehicle in motion.vehicles])
    conflicts = np.empty((len(chosen), 8))
    _fill_conflicts(
        motion.time,
        motion.position,
        motion.heading,
        motion.present,
        half,
        chosen.reshape(-1, 2),
        conflicts,
    )
    return tuple(
        Conflict(int(first), int(second), bool(following), *times)
        for exists, first, second, following, *times in conflicts.tolist()
        if exists
    )


def conflict_of(motion: Motion, a: int, b: int) -> Conflict | None:
    """Return the conflict between two vehicles of a motion; None if they have none."""
    return next(iter(find_conflicts(motion, [(a, b)])), None)


def conflicts_by_pair(conflicts: Iterable[Conflict]) -> PairConflicts:
    """Return conflicts by their vehicles, the lower index first."""
    return {conflict.pair: conflict for conflict in conflicts}


def track_conflicts(tracks: Sequence[Track]) -> PairConflicts:
    """Return the conflicts between tracks by their vehicles, the lower index first."""
    poses = np.stack([track.poses for track in tracks])
    motion = Motion.sampled(
        tuple(track.vehicle for track in tracks),
        tracks[0].dt,
        poses[..., :2],
        poses[..., 2],
        np.stack([track.speed for track in tracks]),
        present=np.stack([track.present for track in tracks]),
    )
    return conflicts_by_pair(find_conflicts(motion))


def required_orders(conflicts: Sequence[Conflict], order: str) -> tuple[int | None, ...]:
    """Return which vehicle must go first at each conflict of the recording; None where any may.

    Args:
        conflicts: of the recording.
        order: "keep": as recorded; "free": any; "swap": the other one at the closest crossing or
            merging (least post-encroachment time), any at others; followers still follow.

    Raises:
        RefusedError: "swap" is requested and no paths cross or merge.
    """
    if order == "keep":
        return tuple(conflict.first for conflict in conflicts)
    if order == "free":
        return (None,) * len(conflicts)
    closest = closest_crossing(conflicts)
    if closest is None:
        raise RefusedError(
            "order: no recorded vehicle crosses another one's path or merges into it,"
            " so no order can be swapped"
        )
    following = [conflict.first if conflict.following else None for conflict in conflicts]
    return tuple(
        closest.second if conflict is closest else first
        for conflict, first in zip(conflicts, following, strict=True)
    )


def closest_crossing(conflicts: Sequence[Conflict]) -> Conflict | None:
    """Return the crossing or merging with the least post-encroachment time; None without one."""
    crossing = [conflict for conflict in conflicts if not conflict.following]
    return min(crossing, key=lambda conflict: conflict.encroachment, default=None)


@kernel(inline=True)
def _step_counts(position: Floats, heading: Floats) -> Ints:
    """(T,) into how many steps the motion from the last used sample to each sample is divided.

    0: the sample is not used, since the vehicle stands around it.
    """
    count = position.shape[0]
    steps = np.ones(count, dtype=np.int64)
    last = 0
    for k in range(1, count):
        moved = np.hypot(position[k, 0] - position[last, 0], position[k, 1] - position[last, 1])
        turned = abs(heading[k] - heading[last])
        if k < count - 1:
            next_moved = np.hypot(
                position[k + 1, 0] - position[last, 0], position[k + 1, 1] - position[last, 1]
            )
            next_turned = abs(heading[k + 1] - heading[last])
            if max(moved, next_moved, turned, next_turned) < STANDSTILL_STEP_M:
                steps[k] = 0
                continue
        steps[k] = max(1, int(np.ceil(max(moved / POSE_STEP_M, turned / POSE_TURN_RAD))))
        last = k
    return steps


@kernel(inline=True)
def _sweep_poses(time: Floats, position: Floats, heading: Floats) -> Floats:
    """Poses (M, 5) t, x, y, cos, sin of a sweep."""
    steps = _step_counts(position, heading)
    poses = np.empty((steps.sum(), 5))
    m, last = 0, 0
    for k in range(time.shape[0]):
        for s in range(1, steps[k] + 1):
            w = s / steps[k]
            yaw = (1.0 - w) * heading[last] + w * heading[k]
            poses[m, 0] = (1.0 - w) * time[last] + w * time[k]
            poses[m, 1] = (1.0 - w) * position[last, 0] + w * position[k, 0]
            poses[m, 2] = (1.0 - w) * position[last, 1] + w * position[k, 1]
            poses[m, 3] = np.cos(yaw)
            poses[m, 4] = np.sin(yaw)
            m += 1
        if steps[k]:
            last = k
    return poses


@kernel(inline=True)
def _block_circles(poses: Floats) -> Floats:
    """Circles (B, 3) x, y, r around the centres of each block of poses."""
    count = poses.shape[0]
    n = (count + BLOCK_POSES - 1) // BLOCK_POSES
    circles = np.empty((n, 3))
    for b in range(n):
        first, last = b * BLOCK_POSES, min(count, (b + 1) * BLOCK_POSES)
        x = 0.5 * (poses[first, 1] + poses[last - 1, 1])
        y = 0.5 * (poses[first, 2] + poses[last - 1, 2])
        radius = 0.0
        for i in range(first, last):
            radius = max(radius, np.hypot(poses[i, 1] - x, poses[i, 2] - y))
        circles[b, 0] = x
        circles[b, 1] = y
        circles[b, 2] = radius
    return circles


@kernel(inline=True)
def _boxes_meet(a: Floats, half_a: HalfSize, b: Floats, half_b: HalfSize) -> bool:
    """True if two boxes at poses (t, x, y, cos, sin) overlap by more than CONTACT_DEPTH_M."""
    box_a = Box(a[1], a[2], a[3], a[4], half_a[0], half_a[1])
    box_b = Box(b[1], b[2], b[3], b[4], half_b[0], half_b[1])
    return box_gap(box_a, box_b) < -CONTACT_DEPTH_M


@kernel(inline=True)
def _meets_sweep(
    pose: Floats, half: HalfSize, poses: Floats, circles: Floats, other: HalfSize
) -> bool:
    """True if the box at `pose` (t, x, y, cos, sin) meets any box of the sweep `poses`."""
    x, y = pose[1], pose[2]
    reach = np.hypot(half[0], half[1]) + np.hypot(other[0], other[1])
    for b in range(circles.shape[0]):
        dx, dy, r = circles[b, 0] - x, circles[b, 1] - y, circles[b, 2] + reach
        if dx * dx + dy * dy >= r * r:
            continue
        for i in range(b * BLOCK_POSES, min(poses.shape[0], (b + 1) * BLOCK_POSES)):
            dx, dy = poses[i, 1] - x, poses[i, 2] - y
            if dx * dx + dy * dy < reach * reach and _boxes_meet(pose, half, poses[i], other):
                return True
    return False


@kernel(inline=True)
def _crossing_time(
    outer: Floats,
    inner: Floats,
    half: HalfSize,
    poses: Floats,
    circles: Floats,
    other: HalfSize,
) -> float:
    """When the box begins or ceases to meet the sweep, between two poses, by bisection."""
    outside, inside, pose = 0.0, 1.0, np.empty(5)
    for _ in range(BISECTION_STEPS):
        w = 0.5 * (outside + inside)
        for i in range(5):
            pose[i] = (1.0 - w) * outer[i] + w * inner[i]
        norm = np.hypot(pose[3], pose[4])
        pose[3], pose[4] = pose[3] / norm, pose[4] / norm
        if _meets_sweep(pose, half, poses, circles, other):
            inside = w
        else:
            outside = w
    return float((1.0 - inside) * outer[0] + inside * inner[0])


@kernel(inline=True)
def _near_blocks(circles: Floats, others: Floats, reach: float) -> Bools:
    """Return (B,) which blocks of poses come within `reach` [m] of any block of others."""
    near = np.zeros(circles.shape[0], dtype=np.bool_)
    for a in range(circles.shape[0]):
        for b in range(others.shape[0]):
            dx, dy = circles[a, 0] - others[b, 0], circles[a, 1] - others[b, 1]
            r = circles[a, 2] + others[b, 2] + reach
            near[a] |= dx * dx + dy * dy < r * r
    return near


@kernel(inline=True)
def _occupancy(
    vehicle: Floats,
    half: HalfSize,
    near: Bools,
    poses: Floats,
    circles: Floats,
    other: HalfSize,
) -> tuple[float, float]:
    """(first entry, last exit) [s] of a vehicle into a sweep; entry inf if they never meet."""
    count = vehicle.shape[0]
    first = 0
    while first < count and not (
        near[first // BLOCK_POSES] and _meets_sweep(vehicle[first], half, poses, circles, other)
    ):
        first += 1
    if first == count:
        return np.inf, -np.inf
    last = count - 1
    while not (
        near[last // BLOCK_POSES] and _meets_sweep(vehicle[last], half, poses, circles, other)
    ):
        last -= 1
    entry, leave = vehicle[first, 0], vehicle[last, 0]
    if first > 0:
        entry = _crossing_time(vehicle[first - 1], vehicle[first], half, poses, circles, other)
    if last < count - 1:
        leave = _crossing_time(vehicle[last + 1], vehicle[last], half, poses, circles, other)
    return entry, leave


@kernel(inline=True)
def _nearest_pose(pose: Floats, poses: Floats, circles: Floats, guess: int, reach: float) -> int:
    """Index of the pose nearest to another one within `reach` [m]; -1 if there is none.

    A good `guess` leaves few blocks to search.
    """
    nearest, index = reach * reach, -1
    distance = (poses[guess, 1] - pose[1]) ** 2 + (poses[guess, 2] - pose[2]) ** 2
    if distance < nearest:
        nearest, index = distance, guess
    for b in range(circles.shape[0]):
        dx, dy = circles[b, 0] - pose[1], circles[b, 1] - pose[2]
        if dx * dx + dy * dy >= (circles[b, 2] + np.sqrt(nearest)) ** 2:
            continue
        for j in range(b * BLOCK_POSES, min(poses.shape[0], (b + 1) * BLOCK_POSES)):
            distance = (poses[j, 1] - pose[1]) ** 2 + (poses[j, 2] - pose[2]) ** 2
            if distance < nearest:
                nearest, index = distance, j
    return index


@kernel(inline=True)
def _shared_path(
    a: Floats, near_a: Bools, b: Floats, circles_b: Floats, half_a: HalfSize, half_b: HalfSize
) -> tuple[float, float]:
    """(metres of a's path shared with b, the part on which a came first minus the other part)."""
    shared, lead, last = 0.0, 0.0, 0
    reach = np.hypot(half_a[0] + half_b[0], half_a[1] + half_b[1])
    for i in range(1, a.shape[0]):
        step = np.hypot(a[i, 1] - a[i - 1, 1], a[i, 2] - a[i - 1, 2])
        if step == 0.0:
            continue
        near = -1
        if near_a[i // BLOCK_POSES]:
            near = _nearest_pose(a[i], b, circles_b, last, reach)
        last = max(near, 0)
        if near < 0 or a[i, 3] * b[near, 3] + a[i, 4] * b[near, 4] < np.cos(SAME_WAY_RAD):
            continue
        if _boxes_meet(a[i], half_a, b[near], half_b):
            shared += step
            lead += step * np.sign(b[near, 0] - a[i, 0])
    return shared, lead


@kernel(inline=True)
def _fill_conflict(
    a: Floats,
    circles_a: Floats,
    half_a: HalfSize,
    b: Floats,
    circles_b: Floats,
    half_b: HalfSize,
    out: Floats,
) -> None:
    """Fill the row (8,) of a pair, as `_fill_conflicts`."""
    reach = np.hypot(half_a[0], half_a[1]) + np.hypot(half_b[0], half_b[1]) + CONTACT_DEPTH_M
    near_a = _near_blocks(circles_a, circles_b, reach)
    near_b = _near_blocks(circles_b, circles_a, reach)
    entry_a, exit_a = _occupancy(a, half_a, near_a, b, circles_b, half_b)
    entry_b, exit_b = _occupancy(b, half_b, near_b, a, circles_a, half_a)
    if not (np.isfinite(entry_a) and np.isfinite(entry_b)):
        return
    shared, lead = _shared_path(a, near_a, b, circles_b, half_a, half_b)
    following = shared >= FOLLOWING_LENGTHS * 2.0 * max(half_a[0], half_b[0])
    a_first = entry_a <= entry_b
    if (following or entry_a == entry_b) and lead != 0.0:
        a_first = lead > 0.0
    out[0] = 1.0
    out[3] = 1.0 if following else 0.0
    out[4], out[5], out[6], out[7] = entry_a, exit_a, entry_b, exit_b
    if not a_first:
        out[1], out[2] = out[2], out[1]
        out[4], out[5], out[6], out[7] = entry_b, exit_b, entry_a, exit_a


@kernel(F1, F3, F2, I2, F2, I2, OUT2)
def _fill_conflicts(
    time: Floats,
    position: Floats,
    heading: Floats,
    present: Ints,
    half: Floats,
    pairs: Ints,
    out: Floats,
) -> None:
    """Fill `out` (P, 8) with the conflicts of pairs.

    Args:
        time: (T,) seconds.
        position: (N, T, 2) metres.
        heading: (N, T) rad.
        present: (N, 2) first and last sample of each vehicle.
        half: (N, 2) half length and half width [m].
        pairs: (P, 2) vehicles.
        out: exists (the rest is not defined otherwise), first, second, following, entry and exit
            of the first, entry and exit of the second [s].
    """
    used = np.zeros(len(half), dtype=np.bool_)
    for k in range(len(pairs)):
        used[pairs[k, 0]], used[pairs[k, 1]] = True, True
    sweeps = []
    for n in range(len(half)):
        begin = present[n, 0]
        end = present[n, 1] + 1 if used[n] else begin
        poses = _sweep_poses(time[begin:end], position[n, begin:end], heading[n, begin:end])
        sweeps.append((poses, _block_circles(poses), (half[n, 0], half[n, 1])))
    for k in range(len(pairs)):
        a, b = pairs[k, 0], pairs[k, 1]
        out[k, 0], out[k, 1], out[k, 2] = 0.0, a, b
        poses_a, circles_a, half_a = sweeps[a]
        poses_b, circles_b, half_b = sweeps[b]
        _fill_conflict(poses_a, circles_a, half_a, poses_b, circles_b, half_b, out[k])
