# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What drivers do to each other: waits, conflicts, and who goes first.

A *wait* is a smoothed speed below 0.5 m/s (on foot 0.2 m/s) for at least 1 s.
A *conflict* is where the swept footprints of two vehicles'
paths intersect; its order is that of first entry into the shared area, in following the order along the route.

The shared area of vehicles a and b is the intersection of their swept footprints. A footprint of a lies in a's own sweep,
so a is inside the shared area exactly while its footprint meets the sweep of b: two box tests replace polygon clipping.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy import ndimage

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Floats, Ints, runs
from scenario_gen.numerics.boxes import Box, box_gap
from scenario_gen.numerics.kernels import F1, F2, kernel, OUT1
from scenario_gen.types import (
    ALWAYS,
    CAR,
    Encounter,
    Vehicle,
    VEHICLE_TYPES,
)

WAIT_SPEED = VEHICLE_TYPES.built_in[CAR].waits_below  # m/s
WAIT_DURATION = 1.0  # s
WAIT_SMOOTHING = 0.5  # s, width of the centred moving mean
STAND_SPEED = (
    0.1  # m/s; a wait in which the vehicle is never so slow for `WAIT_DURATION` is a creeping one
)

POSE_STEP = 1.0  # m, longest distance between two neighbouring poses of a sweep
POSE_TURN = 0.1  # rad, largest turn between them
STAND_STEP = (
    0.01  # m, a sample that moves less than this from its neighbours adds nothing to the sweep
)
BLOCK = 16  # poses that share one bounding circle
DEPTH = 1e-6  # m, footprints that meet less deeply only touch

Size = tuple[float, float]  # half length, half width [m] of a footprint
_Sweep = tuple[Floats, Floats, Floats]  # poses and circles as of `_swept`, length and width [m]

FOLLOWING_ANGLE = 0.5  # rad, largest difference of heading of two vehicles on the same path
FOLLOWING_LENGTHS = 3.0  # a shared path longer than this many vehicle lengths is following


@dataclass(frozen=True)
class Wait:
    """Vehicle `vehicle` waits from `start` to `end` [s]: smoothed speed below that at which its type waits for at least 1 s.

    It `moves_slowly` if it does not stand (at most 0.1 m/s) for 1 s of that.
    """

    vehicle: int
    start: float
    end: float
    moves_slowly: bool = False


@dataclass(frozen=True)
class Conflict:
    """The swept footprints of two vehicles' paths intersect (crossing, merging, following).

    `first` and `second` are vehicle indices in order of entry into the shared area (in following: leader, follower);
    `entry_first`, `entry_second` the times [s] of entry, `exit_first` when the first one has left it.
    """

    first: int
    second: int
    following: bool
    entry_first: float
    exit_first: float
    entry_second: float

    @property
    def pair(self) -> tuple[int, int]:
        """Its vehicles, the lower index first."""
        return min(self.first, self.second), max(self.first, self.second)

    @property
    def encroachment(self) -> float:
        """Post-encroachment time [s]: from the first one's exit to the second one's entry."""
        return self.entry_second - self.exit_first

    @property
    def arrival_gap(self) -> float:
        """From the first one's entry to the second one's [s]."""
        return self.entry_second - self.entry_first


def find_waits(encounter: Encounter) -> tuple[Wait, ...]:
    """Return the waits of every vehicle, in order of vehicle and time.

    The speed is smoothed by a centred moving mean over 0.5 s (an odd number of samples; the end samples are repeated).
    """
    width = 2 * round(0.5 * WAIT_SMOOTHING / encounter.dt) + 1
    smooth = ndimage.uniform_filter1d(
        encounter.speed, width, mode="nearest"
    )  # outside of its presence a speed is held
    time = encounter.time
    return tuple(
        Wait(
            vehicle,
            float(time[a]),
            float(time[b - 1]),
            _moves_slowly(encounter.speed[vehicle, a:b], time[a:b]),
        )
        for vehicle, (speed, there) in enumerate(zip(smooth, encounter.is_present, strict=True))
        for a, b in runs((speed < encounter.vehicles[vehicle].kind.waits_below) & there)
        if time[b - 1] - time[a] >= WAIT_DURATION - 1e-9
    )


def _moves_slowly(speed: Floats, time: Floats) -> bool:
    """Whether the vehicle does not stand for long enough between the first and the last sample in which it does."""
    stands = time[speed <= STAND_SPEED]
    return len(stands) == 0 or bool(stands[-1] - stands[0] < WAIT_DURATION - 1e-9)


def find_conflicts(
    vehicles: tuple[Vehicle, ...],
    time: Floats,
    position: Floats,
    heading: Floats,
    present: Ints = ALWAYS,
) -> tuple[Conflict, ...]:
    """Return one conflict per pair of vehicles whose swept footprints intersect, ordered by pair.

    Between samples both position and heading are linear. Two vehicles that enter at the same instant (both are inside
    the shared area from the start) are ordered along what they share of the route, else by index.

    Args:
        vehicles: N footprints.
        time: (T,) seconds.
        position: (N, T, 2) metres.
        heading: (N, T) rad.
        present: (N, 2) first and last sample of each vehicle; default: everybody throughout.
    """
    spans = (
        [slice(first, last + 1) for first, last in present.tolist()]
        if len(present)
        else [slice(None)] * len(vehicles)
    )
    sweeps = [_swept(time[own], position[n, own], heading[n, own]) for n, own in enumerate(spans)]
    sizes = [np.array((vehicle.length, vehicle.width)) for vehicle in vehicles]
    pairs = combinations(range(len(vehicles)), 2)
    conflicts = (
        _pair_conflict(a, b, (*sweeps[a], sizes[a]), (*sweeps[b], sizes[b])) for a, b in pairs
    )
    return tuple(conflict for conflict in conflicts if conflict is not None)


def required_orders(conflicts: Sequence[Conflict], order: str) -> tuple[int | None, ...]:
    """Return who must go first at each of the template's conflicts, by vehicle index; None where anyone may.

    Args:
        conflicts: of the template.
        order: "keep": as in the template; "free": anyone; "swap": the other one at the closest crossing or merging (least
            post-encroachment time), anyone at other ones, and who follows still follows.

    Raises:
        RefusedError: "swap" is requested and nobody crosses anybody's path.
    """
    if order == "keep":
        return tuple(conflict.first for conflict in conflicts)
    if order == "free":
        return (None,) * len(conflicts)
    closest = closest_crossing(conflicts)
    if closest is None:
        raise RefusedError(
            "order: no recorded vehicle crosses another one's path or merges into it, so no order can be swapped"
        )
    return tuple(c.second if c is closest else c.first if c.following else None for c in conflicts)


def closest_crossing(conflicts: Sequence[Conflict]) -> Conflict | None:
    """Return the crossing or merging conflict with the least post-encroachment time; None without one."""
    crossing = [conflict for conflict in conflicts if not conflict.following]
    return min(crossing, key=lambda conflict: conflict.encroachment, default=None)


def _pair_conflict(a: int, b: int, sweep_a: _Sweep, sweep_b: _Sweep) -> Conflict | None:
    """Return the conflict of vehicles a < b, or None if their swept footprints are apart."""
    out = np.empty(7)
    _conflict(*sweep_a, *sweep_b, out)
    exists, a_first, following, *times = out.tolist()
    if not exists:
        return None
    entry_a, exit_a, entry_b, exit_b = times
    if a_first:
        return Conflict(a, b, bool(following), entry_a, exit_a, entry_b)
    return Conflict(b, a, bool(following), entry_b, exit_b, entry_a)


@kernel(inline=True)
def _sweep(time: Floats, position: Floats, heading: Floats) -> Floats:
    """Poses (M, 5) t, x, y, cos, sin of a sweep: samples in which a vehicle stands dropped, long steps divided."""
    t = time.shape[0]
    keep = np.ones(
        t, dtype=np.int64
    )  # number of steps from the last kept sample to this one; 0: not kept
    total, last = 1, 0
    for k in range(1, t):
        if k < t - 1:
            here = np.hypot(position[k, 0] - position[last, 0], position[k, 1] - position[last, 1])
            there = np.hypot(
                position[k + 1, 0] - position[last, 0], position[k + 1, 1] - position[last, 1]
            )
            turn = max(abs(heading[k] - heading[last]), abs(heading[k + 1] - heading[last]))
            if max(here, there) < STAND_STEP and turn < STAND_STEP:
                keep[k] = 0
                continue
        moved = np.hypot(position[k, 0] - position[last, 0], position[k, 1] - position[last, 1])
        keep[k] = max(
            1, int(np.ceil(max(moved / POSE_STEP, abs(heading[k] - heading[last]) / POSE_TURN)))
        )
        total += keep[k]
        last = k
    poses = np.empty((total, 5))
    m, last = 0, 0
    for k in range(t):
        steps = keep[k]
        for s in range(1, steps + 1):
            w = s / steps
            yaw = (1.0 - w) * heading[last] + w * heading[k]
            poses[m, 0] = (1.0 - w) * time[last] + w * time[k]
            poses[m, 1] = (1.0 - w) * position[last, 0] + w * position[k, 0]
            poses[m, 2] = (1.0 - w) * position[last, 1] + w * position[k, 1]
            poses[m, 3], poses[m, 4] = np.cos(yaw), np.sin(yaw)
            m += 1
        if steps:
            last = k
    return poses


@kernel(inline=True)
def _block_circles(poses: Floats) -> Floats:
    """Circles (B, 3) x, y, r around the centres of each BLOCK of poses."""
    m = poses.shape[0]
    n = (m + BLOCK - 1) // BLOCK
    circles = np.empty((n, 3))
    for b in range(n):
        lo, hi = b * BLOCK, min(m, (b + 1) * BLOCK)
        x, y, radius = (
            0.5 * (poses[lo, 1] + poses[hi - 1, 1]),
            0.5 * (poses[lo, 2] + poses[hi - 1, 2]),
            0.0,
        )
        for i in range(lo, hi):
            radius = max(radius, np.hypot(poses[i, 1] - x, poses[i, 2] - y))
        circles[b, 0], circles[b, 1], circles[b, 2] = x, y, radius
    return circles


@kernel(inline=True)
def _boxes_meet(a: Floats, half_a: Size, b: Floats, half_b: Size) -> bool:
    """True if two boxes at poses (t, x, y, cos, sin) overlap by more than DEPTH."""
    one, other = (
        Box(a[1], a[2], a[3], a[4], half_a[0], half_a[1]),
        Box(b[1], b[2], b[3], b[4], half_b[0], half_b[1]),
    )
    return box_gap(one, other) < -DEPTH


@kernel(inline=True)
def _meets_sweep(pose: Floats, half: Size, poses: Floats, circles: Floats, other: Size) -> bool:
    """True if the box at `pose` (t, x, y, cos, sin) meets any box of the sweep `poses`."""
    x, y = pose[1], pose[2]
    reach = np.hypot(half[0], half[1]) + np.hypot(other[0], other[1])
    for b in range(circles.shape[0]):
        dx, dy, r = circles[b, 0] - x, circles[b, 1] - y, circles[b, 2] + reach
        if dx * dx + dy * dy >= r * r:
            continue
        for i in range(b * BLOCK, min(poses.shape[0], (b + 1) * BLOCK)):
            dx, dy = poses[i, 1] - x, poses[i, 2] - y
            if dx * dx + dy * dy < reach * reach and _boxes_meet(pose, half, poses[i], other):
                return True
    return False


@kernel(inline=True)
def _crossing_time(
    out_pose: Floats, in_pose: Floats, half: Size, poses: Floats, circles: Floats, other: Size
) -> float:
    """Time between two neighbouring poses at which the box begins (or ends) to meet the sweep, by bisection."""
    outside, inside, pose = 0.0, 1.0, np.empty(5)
    for _ in range(10):
        w = 0.5 * (outside + inside)
        for i in range(5):
            pose[i] = (1.0 - w) * out_pose[i] + w * in_pose[i]
        norm = np.hypot(pose[3], pose[4])
        pose[3], pose[4] = pose[3] / norm, pose[4] / norm
        if _meets_sweep(pose, half, poses, circles, other):
            inside = w
        else:
            outside = w
    return float((1.0 - inside) * out_pose[0] + inside * in_pose[0])


@kernel(inline=True)
def _occupancy(
    mine: Floats, half: Size, poses: Floats, circles: Floats, other: Size
) -> tuple[float, float]:
    """(first entry, last exit) [s] of a vehicle's poses `mine` into the sweep `poses`; entry is inf if they never meet."""
    m = mine.shape[0]
    first = 0
    while first < m and not _meets_sweep(mine[first], half, poses, circles, other):
        first += 1
    if first == m:
        return np.inf, -np.inf
    last = m - 1
    while not _meets_sweep(mine[last], half, poses, circles, other):
        last -= 1
    entry, leave = mine[first, 0], mine[last, 0]
    if first > 0:
        entry = _crossing_time(mine[first - 1], mine[first], half, poses, circles, other)
    if last < m - 1:
        leave = _crossing_time(mine[last + 1], mine[last], half, poses, circles, other)
    return entry, leave


@kernel(inline=True)
def _shared_path(
    a: Floats, b: Floats, circles_b: Floats, half_a: Size, half_b: Size
) -> tuple[float, float]:
    """(metres of a's path shared with b in the same direction, metres of it on which a came first minus second)."""
    shared, lead, last = 0.0, 0.0, 0
    reach = np.hypot(half_a[0] + half_b[0], half_a[1] + half_b[1])
    for i in range(1, a.shape[0]):
        step = np.hypot(a[i, 1] - a[i - 1, 1], a[i, 2] - a[i - 1, 2])
        if step == 0.0:
            continue
        near, nearest = -1, reach * reach
        distance = (b[last, 1] - a[i, 1]) ** 2 + (
            b[last, 2] - a[i, 2]
        ) ** 2  # a good first guess leaves few to look at
        if distance < nearest:
            near, nearest = last, distance
        for c in range(circles_b.shape[0]):
            dx, dy = circles_b[c, 0] - a[i, 1], circles_b[c, 1] - a[i, 2]
            if dx * dx + dy * dy >= (circles_b[c, 2] + np.sqrt(nearest)) ** 2:
                continue
            for j in range(c * BLOCK, min(b.shape[0], (c + 1) * BLOCK)):
                distance = (b[j, 1] - a[i, 1]) ** 2 + (b[j, 2] - a[i, 2]) ** 2
                if distance < nearest:
                    near, nearest = j, distance
        last = max(near, 0)
        if near < 0 or a[i, 3] * b[near, 3] + a[i, 4] * b[near, 4] < np.cos(FOLLOWING_ANGLE):
            continue
        if _boxes_meet(a[i], half_a, b[near], half_b):
            shared += step
            lead += step * np.sign(b[near, 0] - a[i, 0])
    return shared, lead


@kernel(F1, F2, F1)
def _swept(time: Floats, position: Floats, heading: Floats) -> tuple[Floats, Floats]:
    """Return the poses (M, 5) of a sweep, and the circles (B, 3) around its blocks."""
    poses = _sweep(time, position, heading)
    return poses, _block_circles(poses)


@kernel(F2, F2, F1, F2, F2, F1, OUT1)
def _conflict(
    a: Floats, circles_a: Floats, size_a: Floats, b: Floats, circles_b: Floats, size_b: Floats, out: Floats
) -> None:  # fmt: skip
    """Fill `out`: exists, a first, following, entry and exit of a, entry and exit of b (7,); poses and circles as of `_swept`."""
    out[0] = 0.0
    half_a, half_b = (0.5 * size_a[0], 0.5 * size_a[1]), (0.5 * size_b[0], 0.5 * size_b[1])
    entry_a, exit_a = _occupancy(a, half_a, b, circles_b, half_b)
    entry_b, exit_b = _occupancy(b, half_b, a, circles_a, half_a)
    if not (np.isfinite(entry_a) and np.isfinite(entry_b)):
        return
    shared, lead = _shared_path(a, b, circles_b, half_a, half_b)
    following = shared >= FOLLOWING_LENGTHS * max(size_a[0], size_b[0])
    a_first = (
        lead > 0.0 if (following or entry_a == entry_b) and lead != 0.0 else entry_a <= entry_b
    )
    out[0], out[1], out[2] = 1.0, 1.0 if a_first else 0.0, 1.0 if following else 0.0
    out[3], out[4], out[5], out[6] = entry_a, exit_a, entry_b, exit_b
