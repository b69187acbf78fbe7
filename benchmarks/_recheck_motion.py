# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Conservative advancement over many motions at once: a step is as long as the distance left, divided by the fastest approach.

Written for the independent re-check; it shares no line with the checker. Motions are those that `Scenario` defines: position the
cubic Hermite interpolant, heading linear between samples. A vehicle that comes or goes within a scenario drove on an arc before
and drives on along one afterwards.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from scenario_gen.numerics.arrays import Bools, Floats, Ints
from scenario_gen.types.scenario import Scenario

RESOLUTION = 1e-3  # s, the shortest step
SLOT = 1e3  # s, longer than any scenario: lane n has the times n * SLOT ...
WAY = 2e4  # m, longer than any way
ROUNDING = 1e-9  # s, instants are whole nanoseconds
TOUCH = 1e-6  # m, a footprint is shrunk by this before it is compared with the road, whose edge it may touch


@dataclass(frozen=True, eq=False)
class Lanes:
    """L motions of one footprint each, their samples end to end.

    Attributes:
        key: (S,) time of each sample plus its lane's slot, ascending.
        begin, end: (L,) s, from when to when the vehicle is there.
        pose: (S, 3) x, y, yaw; velocity: (S, 2) m/s.
        half: (L, 2) half lengths and widths [m].
    """

    key: Floats
    begin: Floats
    end: Floats
    pose: Floats
    velocity: Floats
    half: Floats

    @classmethod
    def of(cls, scenarios: Sequence[Scenario], margin: float = 0.0) -> "Lanes":
        """All vehicles of all scenarios, scenario by scenario; each is there for `margin` [s] longer, up to an instant."""
        key: list[Floats] = []
        there: list[tuple[float, float]] = []
        pose, velocity, half = [], [], []
        for s in scenarios:
            for n, vehicle in enumerate(s.vehicles):
                key.append(s.time + SLOT * len(there))
                came, went = s.time[s.present[n]]
                before, after = (
                    s.time[s.time <= came - margin + ROUNDING],
                    s.time[s.time >= went + margin - ROUNDING],
                )
                there.append(
                    (
                        float(np.append(s.time[0], before)[-1]),
                        float(np.append(after, s.time[-1])[0]),
                    )
                )
                pose.append(_driven_on(s, n))
                yaw = pose[-1][:, 2]
                velocity.append(s.speed[n][:, None] * np.column_stack([np.cos(yaw), np.sin(yaw)]))
                half.append((0.5 * vehicle.length, 0.5 * vehicle.width))
        begin, end = np.array(there).T
        return cls(
            np.concatenate(key),
            begin,
            end,
            np.concatenate(pose),
            np.concatenate(velocity),
            np.array(half),
        )

    def _interval(self, lane: Ints, time: Floats) -> tuple[Ints, Floats, Floats]:
        """First sample of the interval that holds each time, its length [s], and the share of it that has passed."""
        k = (
            np.searchsorted(
                self.key, lane * SLOT + np.minimum(time, self.end[lane] - 1e-9), side="right"
            )
            - 1
        )
        h = self.key[k + 1] - self.key[k]
        return k, h, (lane * SLOT + time - self.key[k]) / h

    def poses(self, lane: Ints, time: Floats) -> Floats:
        """Poses (M, 3) of lanes (M,) at times (M,)."""
        k, h, u = self._interval(lane, time)
        u, h = u[:, None], h[:, None]
        p, q, v, w = self.pose[k, :2], self.pose[k + 1, :2], self.velocity[k], self.velocity[k + 1]
        basis = (
            (1.0 + 2.0 * u) * (1.0 - u) ** 2,
            u * (1.0 - u) ** 2,
            u * u * (3.0 - 2.0 * u),
            u * u * (u - 1.0),
        )
        xy = basis[0] * p + h * basis[1] * v + basis[2] * q + h * basis[3] * w
        yaw = (1.0 - u[:, 0]) * self.pose[k, 2] + u[:, 0] * self.pose[k + 1, 2]
        return np.column_stack([xy, yaw])

    def boxes(self, lane: Ints, time: Floats, shrink: float = 0.0) -> Any:
        """Footprints (M,) as polygons."""
        return boxes_at(self.poses(lane, time), self.half[lane] - shrink)

    def hodograph(self) -> Floats:
        """(S - 1, 3, 2): the velocity between two samples lies in the hull of these three; the last of a lane means nothing."""
        h = np.diff(self.key)[:, None]
        mean = np.diff(self.pose[:, :2], axis=0) / h
        v, w = self.velocity[:-1], self.velocity[1:]
        return np.stack([v, 3.0 * mean - v - w, w], axis=1)

    def turning(self) -> Floats:
        """(S - 1,) rad/s."""
        return np.asarray(np.abs(np.diff(self.pose[:, 2])) / np.diff(self.key))


def _driven_on(s: Scenario, n: int) -> Floats:
    """Poses (T, 3) of a vehicle; outside of its presence it keeps the speed and the rate of turn of its first or last step."""
    first, last = s.present[n].tolist()
    pose = np.column_stack([s.position[n], s.heading[n]])
    for end, inner, beyond in (
        (first, first + 1, slice(first)),
        (last, last - 1, slice(last + 1, None)),
    ):
        since = s.time[beyond] - s.time[end]
        rate = (pose[inner, 2] - pose[end, 2]) / (s.time[inner] - s.time[end])
        turned = (
            np.expm1(1j * rate * since) / (1j * rate) if rate else since
        )  # the integral of exp(i rate t)
        way = s.speed[n, end] * np.exp(1j * pose[end, 2]) * turned
        pose[beyond] = pose[end] + np.column_stack([way.real, way.imag, rate * since])
    return pose


def boxes_at(poses: Floats, half: Floats) -> Any:
    """Polygons (M,) of footprints at poses (M, 3) with half sizes (M, 2)."""
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    ahead = np.column_stack([cos, sin]) * half[:, :1]
    aside = np.column_stack([-sin, cos]) * half[:, 1:]
    corners = (
        np.stack([ahead + aside, aside - ahead, -ahead - aside, ahead - aside], axis=1)
        + poses[:, None, :2]
    )
    return shapely.polygons(corners)


@dataclass(frozen=True, eq=False)
class Paces:
    """How fast each of L tasks may come nearer: the bound is constant between the knots.

    Attributes:
        key: (S,) s, as in `Lanes`; reach: (S,) m, the integral of the bound since the task's start plus its slot.
    """

    key: Floats
    reach: Floats

    @classmethod
    def of(cls, key: Floats, bound: Floats) -> "Paces":
        """From knots (S,) and bounds (S - 1,) [m/s] between them; between two tasks a bound counts for nothing."""
        step = np.diff(key) * (bound + 1e-9)
        jump = np.floor(key[1:] / SLOT) != np.floor(key[:-1] / SLOT)
        step[jump] = 0.0
        total = np.concatenate([[0.0], np.cumsum(step)])
        first = np.concatenate([[0], np.flatnonzero(jump) + 1])
        task = np.concatenate([[0], np.cumsum(jump)])
        return cls(key, total - total[first][task] + WAY * task)

    def after(self, task: Ints, time: Floats, distance: Floats, end: Floats) -> Floats:
        """The time until which nothing can have come nearer by `distance` [m]."""
        now = np.interp(task * SLOT + time, self.key, self.reach)
        later = (
            np.interp(np.minimum(now + distance, WAY * (task + 0.99)), self.reach, self.key)
            - task * SLOT
        )
        past = np.searchsorted(self.reach, now + distance, side="right")
        beyond = (past >= len(self.reach)) | (
            np.floor(self.reach[np.minimum(past, len(self.reach) - 1)] / WAY) != task
        )
        return np.where(beyond, end + 1.0, later)


def advance(
    begin: Floats,
    end: Floats,
    paces: Paces,
    distance: Callable[[Ints, Floats], tuple[Floats, Bools]],
) -> tuple[Bools, int]:
    """Advance tasks from `begin` to `end` (L,) [s].

    Args:
        begin: where each starts; one that starts after its end has nothing to look at.
        end: where each is done.
        paces: bounds of approach.
        distance: of tasks (M,) at times (M,): metres left, and whether there is a violation at that very instant.

    Returns:
        (L,) True where a violation was found, and the number of instants looked at.
    """
    bad, time, open_, looked = (
        np.zeros(len(end), dtype=np.bool_),
        begin.copy(),
        np.flatnonzero(begin <= end),
        0,
    )
    while len(open_):
        left, violated = distance(open_, time[open_])
        looked += len(open_)
        bad[open_] |= violated
        here = time[open_]
        then = np.maximum(
            paces.after(open_, here, left * (1.0 - 1e-9), end[open_]), here + RESOLUTION
        )
        time[open_] = np.where(here < end[open_], np.minimum(then, end[open_]), np.inf)
        open_ = open_[np.isfinite(time[open_]) & ~bad[open_]]
    return bad, looked
