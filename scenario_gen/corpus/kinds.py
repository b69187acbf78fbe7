# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What two vehicles have to do with each other: following, merging, turning, crossing, opposing.

All from two tracks (T, 2) on one clock while both are near each other. The first definition that holds gives the kind:

- *following*: for at least 70 % of the first and of the last quarter of the time one drives on the other's path: within 2.5 m of
  it, headings within 30°. A path goes on straight at both ends.
- *merging*: so in the last quarter, and less in the first.
- *turning*: one of them turns by 45° or more.
- *crossing*: neither turns and their paths intersect at 30° to 150°.
- *opposing*: where they are nearest to each other their headings differ by 150° or more.
- *other*: none of these, e.g. side by side in two lanes.
"""

from dataclasses import dataclass

import numpy as np

from scenario_gen.numerics import Bools, Floats, wrap_angle
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.plane import ahead_and_left, angle_between, edge_lengths, meeting_shares

KINDS = ("following", "merging", "turning", "crossing", "opposing", "other")
BESIDE, ALIKE = 2.5, np.radians(30.0)  # m, rad: on the same path
MOSTLY = 0.7
TURNS, AGAINST = np.radians(45.0), np.radians(150.0)
BEYOND_M = 150.0  # m by which a path goes on at both ends
STEP_M = 4.0  # m between the points of a path
MOVES_MPS = 0.5  # m/s below which a heading tells nothing new
PARALLEL = 1e-12  # m²: of two steps of ways that meet nowhere
MEETS = 1e-6  # of a step: ways that cross in the end of one cross, whatever is rounded
EVERY_S = 0.3  # s between the samples that are compared


@dataclass(frozen=True, eq=False)
class Motion:
    """A vehicle's position (T, 2) [m], heading (T,) [rad] and speed (T,) [m/s]."""

    position: Floats
    heading: Floats
    speed: Floats

    def part(self, own: slice) -> "Motion":
        """Return a part of the samples."""
        return Motion(self.position[own], self.heading[own], self.speed[own])


def kind_of(a: Motion, b: Motion, dt: float) -> str:
    """Return the kind of what two vehicles do, by the definitions above; the same for (b, a).

    Args:
        a: (T,) samples while the two are near each other.
        b: (T,) samples at the same times.
        dt: s between two samples.
    """
    one, other = (motion.part(slice(None, None, max(round(EVERY_S / dt), 1))) for motion in (a, b))
    path, others = path_of(one), path_of(other)
    quarter = max(len(one.speed) // 4, 1)
    early, late = (
        max(
            float(_on_path(motion.part(own), way).mean())
            for motion, way in ((one, others), (other, path))
        )
        for own in (slice(None, quarter), slice(-quarter, None))
    )
    if late >= MOSTLY:
        return "following" if early >= MOSTLY else "merging"
    if max(abs(turned(one)), abs(turned(other))) >= TURNS:
        return "turning"
    if _intersect(one, other):
        return "crossing"
    nearest = np.hypot(*(one.position - other.position).T).argmin()
    return (
        "opposing"
        if abs(angle_between(one.heading[nearest], other.heading[nearest])) >= AGAINST
        else "other"
    )


def turned(motion: Motion) -> float:
    """Return how far a vehicle's heading turns in all [rad], left positive, while it moves."""
    heading = unwrapped(motion.heading[motion.speed > MOVES_MPS])
    return float(heading[-1] - heading[0]) if len(heading) else 0.0


def unwrapped(heading: Floats) -> Floats:
    """Return headings (T,) [rad] without jumps, as `numpy.unwrap` does, if there are any: to look is faster."""
    return np.unwrap(heading) if (np.abs(heading[1:] - heading[:-1]) > np.pi).any() else heading


def path_of(motion: Motion) -> Floats:
    """Return poses (P, 3) x, y [m], yaw [rad] of a path, 4 m apart, with a straight at both ends."""
    moved = np.concatenate([[True], edge_lengths(motion.position) > 0.0])
    curve = Curve(np.column_stack([motion.position[moved], unwrapped(motion.heading[moved])]))
    return curve.at(np.arange(STEP_M - BEYOND_M, curve.length + BEYOND_M, STEP_M))


def _on_path(motion: Motion, path: Floats) -> Bools:
    """(T,) whether a vehicle is beside no path but on this one, and drives along it."""
    away = motion.position[:, None] - path[:, :2]
    squares = np.square(away).sum(axis=2)
    nearest = squares.argmin(axis=1)
    at = np.arange(len(nearest))
    _, left = ahead_and_left(away[at, nearest], path[nearest, 2])
    alike = np.abs(wrap_angle(motion.heading - path[nearest, 2])) < ALIKE
    return np.asarray(
        (np.abs(left) < BESIDE) & alike & (squares[at, nearest] < (STEP_M + BESIDE) ** 2)
    )


def _intersect(one: Motion, other: Motion) -> bool:
    """Whether the ways driven cross each other at 30° to 150°."""
    (p, u), (q, v) = (
        (motion.position[:-1], np.diff(motion.position, axis=0)) for motion in (one, other)
    )
    t, s, cross = meeting_shares(p[:, None], u[:, None], q, v)
    meet = (
        (np.abs(cross) >= PARALLEL)
        & (np.abs(t - 0.5) <= 0.5 + MEETS)
        & (np.abs(s - 0.5) <= 0.5 + MEETS)
    )
    angle = np.abs(wrap_angle(one.heading[:-1, None] - other.heading[:-1]))
    return bool((meet & (angle > ALIKE) & (angle < AGAINST)).any())
