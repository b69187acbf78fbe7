# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The smallest time shift after which two vehicles would collide; 0 if they do.

It is the time by which one of them would have to be earlier or later on its path for their
footprints to meet. At a crossing that is the post-encroachment time (Allen, Shin & Cooper 1978),
behind another vehicle the time gap. The minimum distance is no substitute: vehicles that pass each
other in their lanes are always near, and never meet.

The non-reactive baseline, with which planners are compared, follows its path, slows in bends, and
ignores others. The figure `blind_margin` is the time by which vehicles at constant speeds would
miss the others.
"""

import numpy as np

from scenario_gen.numerics import Bools, edge_lengths, Floats
from scenario_gen.numerics.boxes import boxes_meet, fill_box
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.kernels import F2, kernel, OUT1
from scenario_gen.types import Motion, Vehicle

DENSITY_FACTOR = 4  # poses of the other vehicle for one pose of the ego
MAX_SHIFT_S = 5.0  # larger shifts, and vehicles that never meet, are equally uncritical


def min_time_shift(motion: Motion, is_present: Bools, ego: int, other: int) -> float:
    """Return the least time shift [s] of a vehicle to meet another, at most MAX_SHIFT_S.

    Args:
        motion: as driven.
        is_present: (N, T) whether each vehicle is on the scene.
        ego: index.
        other: index.
    """
    samples = np.flatnonzero(is_present[ego])
    poses = np.column_stack([motion.time[samples], motion.poses[ego, samples]])
    vehicles = (motion.vehicles[ego], motion.vehicles[other])
    return poses_time_shift(poses, timed_poses(motion, is_present[other], other), vehicles)


def timed_poses(motion: Motion, is_present: Bools, n: int) -> Floats:
    """Return (R, 4) time [s], x, y [m], yaw [rad] of a vehicle while it is present (T,).

    There are DENSITY_FACTOR poses for each sampling period.
    """
    samples = np.flatnonzero(is_present)
    if len(samples) < 2:
        return np.empty((0, 4))
    first, last = motion.time[samples[[0, -1]]]
    time = np.linspace(first, last, DENSITY_FACTOR * (len(samples) - 1) + 1)
    return np.column_stack([time, motion.of_vehicles([n]).at(time).poses[0]])


def poses_time_shift(a: Floats, b: Floats, vehicles: tuple[Vehicle, Vehicle]) -> float:
    """Return the least time difference [s] of overlapping footprints, at most MAX_SHIFT_S.

    Args:
        a: (S, 4) time [s], x, y [m], yaw [rad] of the first vehicle.
        b: (R, 4) the same of the second vehicle.
        vehicles: the two vehicles.
    """
    out = np.array([MAX_SHIFT_S])
    if len(a) and len(b):
        _lower_to_shift(a, b, np.array([vehicle.half for vehicle in vehicles]), out)
    return float(out[0])


@kernel(inline=True)
def _distance(a: Floats, b: Floats) -> float:
    """Return the distance [m] of two poses (4,) with times."""
    return float(np.sqrt((a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2))


@kernel(inline=True)
def _overlaps(b: Floats, half: Floats, boxes: Floats) -> bool:
    """Return whether the second vehicle at a pose (4,) overlaps the first, which is `boxes[0]`."""
    fill_box(b[1], b[2], b[3], half[1, 0], half[1, 1], boxes[1])
    return boxes_meet(boxes[0], boxes[1])


@kernel(F2, F2, F2, OUT1, on_demand=True)
def _lower_to_shift(a: Floats, b: Floats, half: Floats, out: Floats) -> None:
    """Lower `out` (1,) to the least difference of times [s] at which footprints overlap.

    Args:
        a: (S, 4) time [s], x, y [m], yaw [rad] of the first vehicle.
        b: (R, 4) the same of the second vehicle.
        half: (2, 2) half lengths and widths [m].
        out: (1,) seconds, at first the greatest that counts.
    """
    count = b.shape[0]
    longest_step = 0.0  # of the second vehicle between two of its poses
    for k in range(1, count):
        longest_step = max(longest_step, _distance(b[k], b[k - 1]))
    reach = np.sqrt(half[0, 0] ** 2 + half[0, 1] ** 2) + np.sqrt(half[1, 0] ** 2 + half[1, 1] ** 2)
    boxes = np.empty((2, 7))
    for i in range(a.shape[0]):
        fill_box(a[i, 1], a[i, 2], a[i, 3], half[0, 0], half[0, 1], boxes[0])
        k = 0
        while k < count:
            clearance = _distance(a[i], b[k]) - reach
            shift = abs(a[i, 0] - b[k, 0])
            if clearance > 0.0:  # skip the poses at which it cannot be near enough
                k = count if longest_step == 0.0 else k + max(int(clearance / longest_step), 1)
                continue
            if shift < out[0] and _overlaps(b[k], half, boxes):
                out[0] = shift
            k += 1


MAX_ACCELERATION_MPS2 = 2.5
MAX_BRAKING_MPS2 = 2.5
MAX_LATERAL_MPS2 = 2.5  # in bends
STANDSTILL_MPS = 0.5  # a vehicle with a lower last speed stops at its end
_PREVIEW_M = np.arange(0.0, 21.0, 4.0)  # distances ahead at which it looks for bends
BLIND_SPEEDS_MPS = (3.0, 4.5, 7.0, 14.0)  # of `blind_margin`


def wanted_speeds(route: Curve, station: Floats, top: float, *, stops: bool) -> Floats:
    """Return desired speeds (S,) [m/s] at stations (S,) [m]: `top`, less in bends and at stops."""
    bend = (
        np.abs(np.diff(route.at(station[:, None] + _PREVIEW_M)[..., 2], axis=1)).max(axis=1)
        / _PREVIEW_M[1]
    )
    wanted = np.minimum(top, np.sqrt(MAX_LATERAL_MPS2 / np.maximum(bend, 1e-6)))
    if stops:
        wanted = np.minimum(
            wanted, np.sqrt(2.0 * MAX_BRAKING_MPS2 * np.maximum(route.length - station, 0.0)) + 0.3
        )
    return np.asarray(wanted)


def free_acceleration(speed: float, wanted: float, most: float) -> float:
    """Return the free-road acceleration [m/s²] towards a desired speed (IDM), braking softly."""
    over = speed / max(wanted, 0.1)
    return max(most * (1.0 - over * over), -MAX_BRAKING_MPS2)


def blind_margin(motion: Motion, a: int, b: int) -> float:
    """Return the mean time shift [s] with which vehicle a, at constant speeds, meets b.

    The speeds are BLIND_SPEEDS_MPS, reached with 2.5 m/s². 0: it would meet b at each of them. At
    most MAX_SHIFT_S.
    """
    present = motion.present_slice(a)
    position, speed = motion.position[a, present], float(motion.speed[a, present.start])
    position = position[np.concatenate([[True], edge_lengths(position) > 1e-3])]
    if len(position) < 3:
        return MAX_SHIFT_S
    route = Curve.through(position)
    time = motion.dt * np.arange(motion.speed.shape[1])
    other = timed_poses(motion, motion.is_present[b], b)
    vehicles = (motion.vehicles[a], motion.vehicles[b])
    shifts = []
    for blind_speed in BLIND_SPEEDS_MPS:
        change = np.minimum(time, abs(blind_speed - speed) / MAX_ACCELERATION_MPS2)
        gained = np.sign(blind_speed - speed) * MAX_ACCELERATION_MPS2 * change
        stations = speed * time + gained * (time - 0.5 * change)
        stations = stations[stations < route.length]
        times = motion.time[present.start] + time[: len(stations)]
        poses = np.column_stack([times, route.at(stations)])
        shifts.append(poses_time_shift(poses, other, vehicles))
    return float(np.mean(shifts))
