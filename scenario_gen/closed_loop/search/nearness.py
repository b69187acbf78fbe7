# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How near two vehicles came to a collision, in time: a figure that goes smoothly to 0 as a collision comes near.

It is by how much one of them would have had to be earlier or later on its way for their footprints to meet. At a crossing that is
the post-encroachment time (Allen, Shin & Cooper 1978), behind another the time gap. Least distances do not do: vehicles that pass
each other in their lanes are always near, and never meet.
"""

import numpy as np

from scenario_gen.numerics import Bools, exact, Floats
from scenario_gen.types import Scenario

FINER = 4  # instants of the other vehicle for one of the ego
APART = 20.0  # s, for two whose ways never meet


def time_apart(motion: Scenario, here: Bools, ego: int, other: int) -> float:
    """Return the time [s] by which a vehicle would have to be shifted to meet another; 0 if they do, APART if that is impossible.

    Args:
        motion: as driven.
        here: (N, T) who is on the scene.
        ego, other: indices.
    """
    mine, its = np.flatnonzero(here[ego]), np.flatnonzero(here[other])
    if len(mine) == 0 or len(its) < 2:
        return APART
    time = motion.time
    fine = np.linspace(time[its[0]], time[its[-1]], FINER * (len(its) - 1) + 1)
    a = np.column_stack([motion.position[ego][mine], motion.heading[ego][mine]])
    columns = (*motion.position[other].T, motion.heading[other])
    b = np.column_stack([np.interp(fine, time[its], column[its]) for column in columns])
    half = [np.array([0.5 * motion.vehicles[k].length, 0.5 * motion.vehicles[k].width]) for k in (ego, other)]
    reach = float(sum(np.sqrt(np.square(one).sum()) for one in half))
    dx, dy = b[None, :, 0] - a[:, None, 0], b[None, :, 1] - a[:, None, 1]
    rows, columns_near = np.nonzero(dx * dx + dy * dy < reach * reach)
    if not len(rows):
        return APART
    meet = _overlap(a[rows], b[columns_near], half[0], half[1])
    apart = np.abs(time[mine][rows] - fine[columns_near])[meet]
    return float(min(apart.min(initial=APART), APART))


def _overlap(a: Floats, b: Floats, half_a: Floats, half_b: Floats) -> Bools:
    """Return whether footprints at poses a (P, 3) and b (P, 3) overlap, by separating axes; half lengths and widths (2,) [m]."""
    delta = b[:, :2] - a[:, :2]
    turn = b[:, 2] - a[:, 2]
    c, s = np.abs(exact.cos(turn)), np.abs(exact.sin(turn))
    meet = np.ones(len(a), dtype=np.bool_)
    for yaw, own, its in ((a[:, 2], half_a, half_b), (b[:, 2], half_b, half_a)):
        cos, sin = exact.cos(yaw), exact.sin(yaw)
        along, across = delta[:, 0] * cos + delta[:, 1] * sin, delta[:, 1] * cos - delta[:, 0] * sin
        meet &= np.abs(along) <= own[0] + its[0] * c + its[1] * s
        meet &= np.abs(across) <= own[1] + its[0] * s + its[1] * c
    return np.asarray(meet)
