# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The non-reactive baseline: it follows its path, slows in bends, and ignores others.

Planners are compared with it; the figure `baseline_margin` is the time by which it would miss the
others.
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
_STATION_STEP_M = 0.5  # its desired speed is constant on each step


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


def baseline_margin(motion: Motion, a: int, b: int) -> float:
    """Return the least time shift [s] with which vehicle a, as the baseline, meets b.

    0: it would meet b. At most MAX_SHIFT_S.
    """
    present = motion.present_slice(a)
    position, speed = motion.position[a, present], motion.speed[a, present]
    position = position[np.concatenate([[True], edge_lengths(position) > 1e-3])]
    if len(position) < 3:
        return MAX_SHIFT_S
    route = Curve.through(position)
    stops = bool(speed[-1] < STANDSTILL_MPS)
    wanted = wanted_speeds(
        route,
        np.arange(0.0, route.length + _STATION_STEP_M, _STATION_STEP_M),
        float(speed.max()),
        stops=stops,
    ).tolist()
    stations, now, dt = [0.0], float(speed[0]), motion.dt
    while stations[-1] < route.length and len(stations) < motion.speed.shape[1]:
        after = max(
            now + free_acceleration(now, wanted[int(stations[-1] / _STATION_STEP_M)]) * dt, 0.0
        )
        stations.append(stations[-1] + 0.5 * (now + after) * dt)
        now = after
    poses = np.column_stack(
        [motion.time[present.start] + dt * np.arange(len(stations)), route.at(np.array(stations))]
    )
    return poses_time_shift(
        poses,
        timed_poses(motion, motion.is_present[b], b),
        (motion.vehicles[a], motion.vehicles[b]),
    )
