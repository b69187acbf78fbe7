# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The time by which two vehicles missed a collision; it falls smoothly to 0.

It is by how much one of them would have had to be earlier or later on its way for their footprints
to meet. At a crossing that is the post-encroachment time (Allen, Shin & Cooper 1978), behind
another the time gap. Least distances do not do: vehicles that pass each other in their lanes are
always near, and never meet.
"""

import numpy as np

from scenario_gen.numerics import Bools, Floats
from scenario_gen.numerics.boxes import boxes_meet, fill_box
from scenario_gen.numerics.kernels import F2, kernel, OUT1
from scenario_gen.types import Motion, Vehicle

FINER = 4  # instants of the other vehicle for one of the ego
MAX_SHIFT_S = 5.0  # s, at most: what is farther apart, or never meets, is all the same


def min_time_shift(motion: Motion, here: Bools, ego: int, other: int) -> float:
    """Return the least time shift [s] with which a vehicle would meet another, at most MAX_SHIFT_S.

    Args:
        motion: as driven.
        here: (N, T) who is on the scene.
        ego: index.
        other: index.
    """
    mine = np.flatnonzero(here[ego])
    poses = np.column_stack([motion.time[mine], motion.poses[ego, mine]])
    return poses_time_shift(
        poses,
        timed_poses(motion, here[other], other),
        (motion.vehicles[ego], motion.vehicles[other]),
    )


def timed_poses(motion: Motion, here: Bools, n: int) -> Floats:
    """Return (R, 4) time [s], x, y [m], yaw [rad] while a vehicle is here (T,), FINER as dense."""
    its = np.flatnonzero(here)
    if len(its) < 2:
        return np.empty((0, 4))
    fine = np.linspace(motion.time[its[0]], motion.time[its[-1]], FINER * (len(its) - 1) + 1)
    return np.column_stack([fine, motion.of_vehicles([n]).at(fine).poses[0]])


def poses_time_shift(a: Floats, b: Floats, vehicles: tuple[Vehicle, Vehicle]) -> float:
    """Return the least time difference [s] of overlapping footprints, at most MAX_SHIFT_S.

    Args:
        a: (S, 4) time [s], x, y [m], yaw [rad] of one.
        b: (R, 4) likewise, of the other.
        vehicles: whose footprints these are.
    """
    out = np.array([MAX_SHIFT_S])
    if len(a) and len(b):
        _lower_to_shift(a, b, np.array([vehicle.half for vehicle in vehicles]), out)
    return float(out[0])


@kernel(F2, F2, F2, OUT1)
def _lower_to_shift(a: Floats, b: Floats, half: Floats, out: Floats) -> None:
    """Lower `out` (1,) to the least difference of times [s] at which footprints overlap.

    Args:
        a: (S, 4) time [s], x, y [m], yaw [rad] of one.
        b: (R, 4) likewise, of the other.
        half: (2, 2) half lengths and widths [m].
        out: (1,) seconds, at first the greatest that counts.
    """
    count = b.shape[0]
    farthest = 0.0  # that the other moves from one of its instants to the next
    for k in range(1, count):
        farthest = max(
            farthest, np.sqrt((b[k, 1] - b[k - 1, 1]) ** 2 + (b[k, 2] - b[k - 1, 2]) ** 2)
        )
    reach = np.sqrt(half[0, 0] ** 2 + half[0, 1] ** 2) + np.sqrt(half[1, 0] ** 2 + half[1, 1] ** 2)
    box, its = np.empty(7), np.empty(7)
    for i in range(a.shape[0]):
        fill_box(a[i, 1], a[i, 2], a[i, 3], half[0, 0], half[0, 1], box)
        k = 0
        while k < count:
            away = np.sqrt((a[i, 1] - b[k, 1]) ** 2 + (a[i, 2] - b[k, 2]) ** 2) - reach
            if away > 0.0:  # it cannot be there before it has moved so far
                k = count if farthest == 0.0 else k + max(int(away / farthest), 1)
                continue
            apart = abs(a[i, 0] - b[k, 0])
            if apart < out[0]:
                fill_box(b[k, 1], b[k, 2], b[k, 3], half[1, 0], half[1, 1], its)
                if boxes_meet(box, its):
                    out[0] = apart
            k += 1
