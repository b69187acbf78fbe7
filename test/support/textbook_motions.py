# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Drawn motions of two vehicles whose reaction anybody would name, and of two that only look alike or are far apart.

Speeds, gaps, lags, noise of positions and speeds, dropouts and the order of the vehicles vary with the seed.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy import ndimage, spatial

from scenario_gen.numerics.boxes import corners
from scenario_gen.numerics.curve import Curve
from scenario_gen.types import Encounter, Vehicle

DT, LENGTH, WIDTH = 0.1, 4.6, 1.85
Drive = tuple[np.ndarray, np.ndarray]  # (T, 3) poses, (T,) m/s


@dataclass(frozen=True)
class Labelled:
    """An encounter of two, and (who, whom) of the reaction in it; None: there is none."""

    kind: str
    encounter: Encounter
    edge: tuple[int, int] | None


def line(*points: tuple[float, float]) -> Curve:
    """A way through points, its corners rounded."""
    xy = (
        Curve.through(np.array(points, dtype=float))
        .cut(0.0, float(np.hypot(*np.diff(points, axis=0).T).sum()), 0.5)
        .points[:, :2]
    )
    return Curve.through(ndimage.gaussian_filter1d(xy, 6.0, axis=0, mode="nearest"))


def wander(rng: np.random.Generator, count: int, mean: float, sigma: float = 0.5) -> np.ndarray:
    """A speed that varies over some seconds."""
    noise = ndimage.gaussian_filter1d(rng.standard_normal(count + 100), 20.0)[50:-50]
    return np.maximum(mean + sigma * noise / noise.std(), 0.0)


def ramps(count: int, *knots: tuple[float, float]) -> np.ndarray:
    """Speeds through (s, m/s), rounded over .6 s."""
    time, speed = np.array(knots).T
    return np.asarray(
        ndimage.uniform_filter1d(np.interp(np.arange(count) * DT, time, speed), 7, mode="nearest")
    )


def driven(path: Curve, speed: np.ndarray, at: float, station: float) -> Drive:
    """The drive that is at a station [m] of the path at a time [s]."""
    s = np.concatenate([[0.0], np.cumsum(0.5 * DT * (speed[1:] + speed[:-1]))])
    return path.at(s + station - np.interp(at, np.arange(len(s)) * DT, s)), speed


@lru_cache
def inside(path: Curve, other: Curve) -> tuple[float, float]:
    """The stations at which a footprint on a path enters and leaves the way that the other one's sweeps."""
    stations = np.arange(0.0, path.length, 0.25)
    boxes = corners(path.at(stations), LENGTH, WIDTH)
    sides = np.roll(boxes, 1, axis=1) - boxes
    edges = np.concatenate(
        [boxes + share * sides for share in np.linspace(0.0, 0.9, 6)], axis=1
    ).reshape(-1, 2)
    points = spatial.KDTree(other.at(np.arange(0.0, other.length, 0.25))[:, :2])
    rows = np.flatnonzero(
        points.query(edges)[0].reshape(len(stations), -1).min(axis=1) < 0.5 * WIDTH
    )
    return float(stations[rows[0]]), float(stations[rows[-1]])


EAST, WEST = line((-150.0, 0.0), (150.0, 0.0)), line((150.0, 3.5), (-150.0, 3.5))
NORTH = line((1.75, -120.0), (1.75, 120.0))
LEFT = line((-120.0, 0.0), (4.0, 0.0), (4.0, 120.0))
RIGHT = line((2.0, -120.0), (2.0, 0.0), (150.0, 0.0))
RAMP = line((-150.0, -9.0), (-20.0, -9.0), (20.0, 0.0), (150.0, 0.0))
NARROW = line((150.0, 3.2), (30.0, 3.2), (12.0, 0.3), (-12.0, 0.3), (-30.0, 3.2), (-150.0, 3.2))
U_TURN = line((-120.0, 0.0), (4.0, 0.0), (4.0, 3.5), (-120.0, 3.5))
_RING = 16.0 * np.array(
    [(float(np.cos(a)), float(np.sin(a))) for a in np.linspace(-1.2 * np.pi, 0.4 * np.pi, 60)]
)
RING = Curve.through(_RING)
ENTRY = Curve.through(np.concatenate([[(2.0, -90.0), (2.0, -40.0), (3.0, -25.0)], _RING[30:]]))


def yields(
    rng: np.random.Generator,
    first: Curve,
    second: Curve,
    low: float,
    *,
    merges: bool = False,
    cruise: bool = False,
) -> Drive:
    """The second one slows to `low` [m/s] and enters behind the first."""
    count = int(rng.integers(110, 220))
    speed, clear = rng.uniform(6.0, 14.0), rng.uniform(0.45, 0.65) * count * DT
    if first is RING:
        speed = rng.uniform(5.0, 8.0)
    enters = inside(second, first)[0]
    leaves = inside(first, second)[1]
    if merges:
        front = second.at(enters + 0.5 * LENGTH)[None, :2]
        leaves = float(first.project(front)[0][0]) + 0.5 * LENGTH
    gap = rng.uniform(0.4, 2.5) if low > 1.5 or merges else rng.uniform(0.6, 4.5)
    v0, v1 = rng.uniform(7.0, 13.0), speed if merges else rng.uniform(5.0, 10.0)
    go = clear + gap - (rng.uniform(0.3, 1.5) if low > 1.5 else rng.uniform(0.8, 2.2))
    slow = go - (0.0 if low > 1.5 else rng.uniform(1.0, 4.0))
    knots = (
        (0.0, v0),
        (slow - max(v0 - low, 0.0) / rng.uniform(1.2, 2.8), v0),
        (slow, low),
        (go, low),
    )
    own = ramps(count, *knots, (go + abs(v1 - low) / rng.uniform(1.2, 2.4), v1))
    if cruise:
        own = wander(rng, count, v0, 0.15)
    return driven(first, wander(rng, count, speed, 0.3), clear, leaves), driven(
        second, own, clear + gap, enters
    )


def behind(rng: np.random.Generator, speed: np.ndarray, gap: float, own: float) -> np.ndarray:
    """The speed of a driver (IDM, with a reaction time) who starts `gap` [m] behind one with this speed."""
    headway, late = rng.uniform(0.9, 1.8), round(rng.uniform(0.4, 1.0) / DT)
    ahead = np.concatenate([[gap], gap + np.cumsum(DT * speed[:-1])])
    s, v = np.zeros(len(speed)), np.full(len(speed), own)
    for k in range(len(speed) - 1):
        j = max(k - late, 0)
        want = 2.5 + max(v[j] * headway + v[j] * (v[j] - speed[j]) / 3.5, 0.0)
        force = 1.5 * (1.0 - (v[j] / 16.0) ** 4 - (want / max(ahead[j] - s[j], 0.5)) ** 2)
        v[k + 1] = max(v[k] + DT * min(max(force, -5.0), 1.8), 0.0)
        s[k + 1] = s[k] + 0.5 * DT * (v[k] + v[k + 1])
    return v


def follows(rng: np.random.Generator, leader: np.ndarray, gap: float, own: float) -> Drive:
    """One behind another in a lane."""
    at = -100.0 if leader.max() > 0.0 else 0.0
    return driven(EAST, leader, 0.0, 150.0 + at), driven(
        EAST, behind(rng, leader, gap, own), 0.0, 150.0 + at - LENGTH - gap
    )


def _steady(rng: np.random.Generator) -> Drive:
    v = rng.uniform(7.0, 14.0)
    return follows(
        rng,
        wander(rng, int(rng.integers(80, 200)), v, rng.uniform(0.2, 1.5)),
        v * rng.uniform(0.9, 3.5) + 2.5,
        v,
    )


def _stops(rng: np.random.Generator) -> Drive:
    v, stop = rng.uniform(8.0, 14.0), rng.uniform(5.0, 8.0)
    return follows(
        rng,
        ramps(150, (0.0, v), (stop - v / 2.0, v), (stop, 0.0)),
        v * rng.uniform(1.2, 2.2) + 2.5,
        v,
    )


def _queue(rng: np.random.Generator) -> Drive:
    v = rng.uniform(8.0, 13.0)
    return follows(rng, np.zeros(140), rng.uniform(45.0, 70.0), v)


def _cut_in(rng: np.random.Generator) -> Drive:
    v, own = rng.uniform(10.0, 13.0), rng.uniform(13.0, 16.0)
    lane = line((-150.0, 3.5), (-40.0, 3.5), (-10.0, 0.0), (150.0, 0.0))
    gap = rng.uniform(8.0, 16.0)
    speed = np.where(np.arange(130) < 50, own, behind(rng, np.full(130, v), gap, own))
    late = behind(rng, np.full(80, v), gap, own)
    speed = np.concatenate([np.full(50, own), late])
    return driven(lane, np.full(130, v), 5.0, lane.length - 165.0), driven(
        EAST, speed, 5.0, 135.0 - LENGTH - gap
    )


def _stands_in_the_way(rng: np.random.Generator) -> Drive:
    """The first one backs out of a side road, stands, drives off; the other waits for it, then comes behind."""
    begin, back, stand = rng.uniform(0.0, 2.0), rng.uniform(5.5, 7.0), rng.uniform(0.5, 2.0)
    out = ramps(
        160,
        (0.0, 0.0),
        (begin, 0.0),
        (begin + 1.5, 1.6),
        (begin + back - 1.0, 1.6),
        (begin + back, 0.0),
    )  # 8.5 m
    off = begin + back + stand
    on = ramps(160, (0.0, 0.0), (off, 0.0), (off + 6.0, 9.0))
    share = np.cumsum(out) / out.sum()
    path = Curve.through(np.array([(0.0, -9.0), (-0.2, -5.0), (-1.5, -2.0), (-4.5, 0.0)]))
    poses = path.at(path.length * share)
    poses[:, 2] = -0.5 * np.pi * (1.0 - share)
    poses[:, 0] += np.cumsum(DT * on)
    place = rng.uniform(-22.0, -14.0)
    own = ramps(
        160,
        (0.0, 9.0),
        (begin + 1.0, 9.0),
        (begin + 1.0 + 9.0 / 2.0, 0.0),
        (off + rng.uniform(0.8, 2.0), 0.0),
        (off + 7.0, 8.0),
    )
    return (poses, out + on), driven(EAST, own, off, 150.0 + place)


def _apart(
    first: Curve, second: Curve, low: float, gaps: tuple[float, float]
) -> Callable[[np.random.Generator], Drive]:
    """Two at a crossing who know nothing of each other: the second slows to `low` for a reason of its own."""

    def drawn(rng: np.random.Generator) -> Drive:
        count, clear = 220, rng.uniform(3.0, 6.0)
        enters, leaves = inside(second, first)[0], inside(first, second)[1]
        come, v0 = clear + rng.uniform(*gaps), rng.uniform(8.0, 12.0)
        slow = come - (rng.uniform(0.5, 1.0) if low else rng.uniform(1.5, 2.5))
        own = wander(rng, count, v0)
        if low < 5.0:
            knots = (
                (slow - (0.0 if low else rng.uniform(1.0, 2.5)), low),
                (slow, low),
                (slow + 4.0, v0),
            )
            own = ramps(count, (0.0, v0), (knots[0][0] - (v0 - low) / 2.0, v0), *knots)
        return driven(first, wander(rng, count, rng.uniform(7.0, 14.0)), clear, leaves), driven(
            second, own, come, enters
        )

    return drawn


def _far_behind(rng: np.random.Generator) -> Drive:
    v, count = rng.uniform(8.0, 13.0), int(rng.integers(100, 200))
    gap = v * rng.uniform(5.5, 8.0)
    return driven(EAST, wander(rng, count, v + 0.5), 0.0, 60.0 + gap), driven(
        EAST, wander(rng, count, v - 0.5), 0.0, 60.0
    )


def _by_chance(rng: np.random.Generator) -> Drive:
    """In one lane, each at its own speed, some seconds apart."""
    v, count = rng.uniform(8.0, 13.0), 100
    gap = v * rng.uniform(2.0, 6.0)
    return driven(EAST, wander(rng, count, v + 0.2), 0.0, 60.0 + gap), driven(
        EAST, wander(rng, count, v - 0.2), 0.0, 60.0
    )


def _beside(rng: np.random.Generator) -> Drive:
    """In two lanes, both stop at the same line, or both drive."""
    v, stop = rng.uniform(8.0, 13.0), rng.uniform(6.0, 9.0)
    same = rng.random() < 0.5
    own, other = (
        ramps(140, (0.0, v), (stop + off - v / 2.0, v), (stop + off, 0.0))
        if same
        else wander(rng, 140, v)
        for off in (0.0, 0.8)
    )
    return driven(EAST, own, 0.0, 80.0 + rng.uniform(5.0, 30.0)), driven(
        line((-150.0, -3.5), (150.0, -3.5)), other, 0.0, 80.0
    )


def _oncoming(rng: np.random.Generator) -> Drive:
    v, stop = rng.uniform(8.0, 13.0), rng.uniform(5.0, 8.0)
    own = ramps(
        140, (0.0, v), (stop - v / 2.0, v), (stop, 0.0), (stop + 3.0, 0.0), (stop + 7.0, v)
    )
    return driven(EAST, own, stop, 140.0), driven(
        WEST, own if rng.random() < 0.5 else wander(rng, 140, v), stop, 140.0
    )


def _meets_closely(rng: np.random.Generator) -> Drive:
    """Where two that come towards each other hardly pass, the one slows until the other has passed."""
    v, at = rng.uniform(7.0, 11.0), rng.uniform(6.0, 8.0)
    low = v * rng.uniform(0.1, 0.35)
    own = ramps(
        140,
        (0.0, v),
        (at - 1.5 - (v - low) / 2.0, v),
        (at - 1.5, low),
        (at + 0.5, low),
        (at + 4.0, v),
    )
    return driven(line((150.0, 2.3), (-150.0, 2.3)), wander(rng, 140, v, 0.3), at, 140.0), driven(
        EAST, own, at, 155.0
    )


REACTIONS: dict[str, Callable[[np.random.Generator], Drive]] = {
    "follows": _steady,
    "stops behind a stopping leader": _stops,
    "comes to a queue": _queue,
    "cut in": _cut_in,
    "stands in the way": _stands_in_the_way,
    "crossing, stops": lambda rng: yields(rng, EAST, NORTH, 0.0),
    "crossing, rolls": lambda rng: yields(rng, EAST, NORTH, rng.uniform(2.0, 5.0)),
    "crossing, creeps": lambda rng: yields(rng, EAST, NORTH, rng.uniform(0.4, 1.2)),
    "crossing, passes close behind": lambda rng: yields(rng, EAST, NORTH, 2.0, cruise=True),
    "left turn before oncoming, stops": lambda rng: yields(rng, WEST, LEFT, 0.0),
    "left turn before oncoming, rolls": lambda rng: yields(rng, WEST, LEFT, rng.uniform(2.0, 4.0)),
    "U-turn": lambda rng: yields(rng, WEST, U_TURN, rng.uniform(0.0, 2.0), merges=True),
    "merges": lambda rng: yields(rng, EAST, RAMP, rng.uniform(5.0, 7.0), merges=True),
    "right turn into a stream": lambda rng: yields(
        rng, EAST, RIGHT, rng.choice([0.0, 3.0]), merges=True
    ),
    "roundabout entry": lambda rng: yields(rng, RING, ENTRY, rng.choice([0.0, 3.0]), merges=True),
    "meets another one closely": _meets_closely,
    "narrow place": lambda rng: yields(rng, EAST, NARROW, rng.choice([0.0, 1.0])),
}
"""The second drive reacts to the first."""

NOTHING: dict[str, Callable[[np.random.Generator], Drive]] = {
    "crossing, long after": _apart(EAST, NORTH, 9.0, (6.5, 13.0)),
    "crossing, long after, slows": _apart(EAST, NORTH, 3.0, (6.5, 13.0)),
    "left turn long after": _apart(WEST, LEFT, 3.0, (6.5, 13.0)),
    "stop sign": _apart(EAST, NORTH, 0.0, (7.0, 13.0)),
    "crossing, some time after": _apart(EAST, NORTH, 9.0, (4.5, 8.0)),
    "crossing, by chance": _apart(EAST, NORTH, 9.0, (0.5, 9.0)),
    "left turn, by chance": _apart(WEST, LEFT, 3.0, (0.5, 9.0)),
    "in a lane, by chance": _by_chance,
    "far behind": _far_behind,
    "beside": _beside,
    "oncoming": _oncoming,
}


CHANCE = ("crossing, by chance", "left turn, by chance", "in a lane, by chance")
"""Near each other, though neither knows of the other: what confidence is not 1 for."""


def labelled(kind: str, seed: int) -> Labelled:
    """Draw a motion of a kind."""
    rng = np.random.default_rng([seed, *kind.encode()])
    drives = (REACTIONS.get(kind) or NOTHING[kind])(rng)
    swap = bool(rng.random() < 0.5)
    rows = []
    for poses, driven_at in reversed(drives) if swap else drives:
        count = len(driven_at)
        noise = rng.choice([0.0, 0.1, 0.3])
        xy = (
            poses[:, :2]
            + noise
            * ndimage.gaussian_filter1d(rng.standard_normal((count, 2)), 10.0, axis=0)
            * 4.0
        )
        speed = np.maximum(
            driven_at
            + rng.choice([0.0, 0.1])
            * ndimage.gaussian_filter1d(rng.standard_normal(count), 2.0)
            * 2.0,
            0.0,
        )
        speed[speed < 0.05] = 0.0
        if rng.random() < 0.3:  # a dropout, filled in
            first = int(rng.integers(5, count - 25))
            last = first + int(rng.integers(5, 15))
            for array in (xy[:, 0], xy[:, 1], speed):
                array[first:last] = np.linspace(array[first], array[last], last - first)
        rows.append((xy, np.unwrap(poses[:, 2]), speed))
    position, heading, speeds = (np.stack(part) for part in zip(*rows, strict=True))
    vehicles = tuple(Vehicle(str(n), LENGTH, WIDTH) for n in (1, 2))
    encounter = Encounter.sampled(vehicles, 0.1, position, heading, speeds, f"{kind} {seed}")
    return Labelled(kind, encounter, None if kind in NOTHING else (0, 1) if swap else (1, 0))
