# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The non-reactive baseline: it follows its path, slows in bends, and ignores others.

Planners are compared with it; the figure `blind_margin` is the time by which vehicles at constant
speeds would miss the others.
"""

import numpy as np

from scenario_gen.method.evaluation.time_shift import MAX_SHIFT_S, poses_time_shift, timed_poses
from scenario_gen.numerics import Floats
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.plane import edge_lengths
from scenario_gen.types import Motion

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


def free_acceleration(speed: float, wanted: float, most: float = MAX_ACCELERATION_MPS2) -> float:
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
