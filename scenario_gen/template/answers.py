# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How a reaction shows in a motion, recorded or generated: when a yielder leaves, how far behind its leader a follower drives."""

from typing import Protocol

import numpy as np

from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.plane import ahead_and_left
from scenario_gen.template.interaction import Conflict, find_conflicts, WAIT_SPEED
from scenario_gen.types import once_per_object, Vehicle

SLOWEST = 2.0  # m/s, below which a time gap says nothing


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
    """Return the conflict of two vehicles of a motion; None without one."""
    return _conflicts(motion).get((min(a, b), max(a, b)))


@once_per_object
def _conflicts(motion: Motion) -> dict[tuple[int, int], Conflict]:
    """Return the conflict of each pair of vehicles that has one."""
    found = find_conflicts(motion.vehicles, motion.time, motion.position, motion.heading, motion.present)
    return {(min(one.first, one.second), max(one.first, one.second)): one for one in found}


def departure(motion: Motion, who: int, entry: float) -> float:
    """Return when [s] a vehicle leaves before it enters somewhere at `entry` [s].

    That is when its speed rises above 0.5 m/s and stays there, or, if it never is so slow, when it is slowest. A vehicle that is
    faster throughout and slowest at once is one that nothing is seen of: it left when it came. Who stands at the very place, or
    in it, leaves when that stand ends.
    """
    first = int(motion.present[who, 0])
    last = max(int(np.searchsorted(motion.time, entry + 1e-9)), first + 1)
    later = motion.speed[who, last : int(motion.present[who, 1]) + 1]
    if motion.speed[who, last - 1] < WAIT_SPEED and len(later):  # it stands where the area begins
        last += int(np.argmax(later >= WAIT_SPEED)) + 1 if (later >= WAIT_SPEED).any() else len(later)
    speed, time = motion.speed[who, first:last], motion.time[first:last]
    slow = np.flatnonzero(speed < WAIT_SPEED)
    if len(slow) == 0:
        return float(time[int(np.argmin(speed))])
    k = int(slow[-1])
    if k + 1 == len(speed):
        return float(time[k])
    share = (WAIT_SPEED - speed[k]) / (speed[k + 1] - speed[k])
    return float(time[k] + share * (time[k + 1] - time[k]))


def lag_behind(motion: Motion, conflict: Conflict) -> float:
    """Return by how much [s] the second one of a conflict leaves later than the first one has cleared the shared area."""
    return departure(motion, conflict.second, conflict.entry_second) - conflict.exit_first


def time_gaps(motion: Motion, who: int, whom: int) -> Floats:
    """Return the time gaps (k,) [s], centre to centre, of a vehicle that drives (2 m/s or more) behind another one."""
    (a, b), (c, d) = motion.present[[who, whom]].tolist()
    at = slice(max(a, c), min(b, d) + 1)
    speed = motion.speed[who, at]
    between = motion.position[whom, at] - motion.position[who, at]
    along, _ = ahead_and_left(between, motion.heading[who, at])
    apart = np.sqrt(np.square(between).sum(axis=1))
    drives = (speed > SLOWEST) & (along > 0.5 * apart)
    return np.asarray(apart[drives] / speed[drives])
