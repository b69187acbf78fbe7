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
from scenario_gen.numerics.kernels import F1, F2, kernel, OUTB1

KINDS = ("following", "merging", "turning", "crossing", "opposing", "other")
BESIDE, ALIKE = 2.5, np.radians(30.0)  # m, rad: on the same path
MOSTLY = 0.7
TURNS, AGAINST = np.radians(45.0), np.radians(150.0)
BEYOND = 150.0  # m by which a path goes on at both ends
STEP = 4.0  # m between the points of a path
MOVES = 0.5  # m/s below which a heading tells nothing new
PARALLEL = 1e-12  # m²: of two steps of ways that meet nowhere
MEETS = 1e-6  # of a step: ways that cross in the end of one cross, whatever is rounded
EVERY = 0.3  # s between the samples that are compared


@dataclass(frozen=True, eq=False)
class Motion:
    """A vehicle's position (T, 2) [m], heading (T,) [rad] and speed (T,) [m/s]."""

    position: Floats
    heading: Floats
    speed: Floats

    def part(self, own: slice) -> "Motion":
        """Return a part of the samples."""
        return Motion(self.position[own], self.heading[own], self.speed[own])

    def every(self, step: int) -> "Motion":
        """Return each `step`-th sample."""
        return Motion(self.position[::step], self.heading[::step], self.speed[::step])


def kind_of(a: Motion, b: Motion, dt: float) -> str:
    """Return the kind of what two vehicles do, by the definitions above; the same for (b, a).

    Args:
        a: (T,) samples while the two are near each other.
        b: (T,) samples at the same times.
        dt: s between two samples.
    """
    one, other = (motion.every(max(round(EVERY / dt), 1)) for motion in (a, b))
    path, others = path_of(one), path_of(other)
    quarter = max(len(one.speed) // 4, 1)
    early, late = (
        max(float(_on_path(motion.part(own), way).mean()) for motion, way in ((one, others), (other, path)))
        for own in (slice(None, quarter), slice(-quarter, None))
    )
    if late >= MOSTLY:
        return "following" if early >= MOSTLY else "merging"
    if max(abs(turned(one)), abs(turned(other))) >= TURNS:
        return "turning"
    if _intersect(one.position, one.heading, other.position, other.heading):
        return "crossing"
    apart = np.hypot(*(one.position - other.position).T)
    nearest = int(apart.argmin())
    if abs(float(wrap_angle(one.heading[nearest : nearest + 1] - other.heading[nearest : nearest + 1])[0])) >= AGAINST:
        return "opposing"
    return "other"


def turned(motion: Motion) -> float:
    """Return how far a vehicle's heading turns in all [rad], left positive, while it moves."""
    heading = unwrapped(motion.heading[motion.speed > MOVES])
    return float(heading[-1] - heading[0]) if len(heading) else 0.0


def unwrapped(heading: Floats) -> Floats:
    """Return headings (T,) [rad] without jumps, as `numpy.unwrap` does, if there are any: to look is faster."""
    return np.unwrap(heading) if (np.abs(heading[1:] - heading[:-1]) > np.pi).any() else heading


def path_of(motion: Motion) -> tuple[Floats, Floats]:
    """Return points (P, 2) [m] of a path, 4 m apart, with a straight at both ends, and its heading (P,) [rad] there."""
    moved = np.concatenate([[True], np.hypot(*np.diff(motion.position, axis=0).T) > 0.0])
    places = motion.position[moved]
    driven = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(places, axis=0).T))])
    at = np.arange(0.0, float(driven[-1]) + STEP, STEP)
    heading = unwrapped(motion.heading[moved])
    middle = np.stack([np.interp(at, driven, places[:, 0]), np.interp(at, driven, places[:, 1])], axis=1)
    facing = np.interp(at, driven, heading)
    out = np.arange(STEP, BEYOND, STEP)[:, None]
    before = middle[0] - out[::-1] * np.array([np.cos(float(facing[0])), np.sin(float(facing[0]))])
    after = middle[-1] + out * np.array([np.cos(float(facing[-1])), np.sin(float(facing[-1]))])
    ends = np.full(len(out), facing[0]), np.full(len(out), facing[-1])
    return np.vstack([before, middle, after]), np.concatenate([ends[0], facing, ends[1]])


def _on_path(motion: Motion, path: tuple[Floats, Floats]) -> Bools:
    """(T,) whether a vehicle is beside no path but on this one, and drives along it."""
    found = np.zeros(len(motion.heading), dtype=bool)
    _mark_on_path(motion.position, motion.heading, *path, found)
    return found


@kernel(inline=True)
def _wrapped(angle: float) -> float:
    """As `wrap_angle`."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


@kernel(F2, F1, F2, F1, OUTB1)
def _mark_on_path(position: Floats, heading: Floats, points: Floats, facing: Floats, found: Bools) -> None:
    for k in range(len(position)):
        nearest, least = 0, np.inf
        for n in range(len(points)):
            x, y = position[k, 0] - points[n, 0], position[k, 1] - points[n, 1]
            if x * x + y * y < least:
                nearest, least = n, x * x + y * y
        along = facing[nearest]
        x, y = position[k, 0] - points[nearest, 0], position[k, 1] - points[nearest, 1]
        beside = abs(y * np.cos(along) - x * np.sin(along)) < BESIDE
        reach = STEP + BESIDE
        found[k] = beside and abs(_wrapped(heading[k] - along)) < ALIKE and least < reach * reach


@kernel(F2, F1, F2, F1)
def _intersect(one: Floats, heading: Floats, other: Floats, others: Floats) -> bool:
    """Whether the ways driven, (T, 2) with headings (T,) and (S, 2) with (S,), cross each other at 30° to 150°."""
    for i in range(len(one) - 1):
        rx, ry = one[i + 1, 0] - one[i, 0], one[i + 1, 1] - one[i, 1]
        for j in range(len(other) - 1):
            sx, sy = other[j + 1, 0] - other[j, 0], other[j + 1, 1] - other[j, 1]
            denominator = rx * sy - ry * sx
            if abs(denominator) < PARALLEL:
                continue
            x, y = other[j, 0] - one[i, 0], other[j, 1] - one[i, 1]
            t, u = (x * sy - y * sx) / denominator, (x * ry - y * rx) / denominator
            if min(t, u) >= -MEETS and max(t, u) <= 1.0 + MEETS:
                angle = abs(_wrapped(heading[i] - others[j]))
                if ALIKE < angle < AGAINST:
                    return True
    return False
