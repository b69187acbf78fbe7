# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Tracks of vehicles in an hour of messages: those that share an id told apart, outliers left out, and when two meet."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from scenario_gen.corpus.config import CorpusConfig
from scenario_gen.logs import (
    metres_per_degree,
    OUT_OF_RANGE_S,
    shortest,
    space_time_gap,
    ticks,
    windows,
)
from scenario_gen.numerics import Bools, Floats, Ints, runs
from scenario_gen.numerics.kernels import F1, I1, kernel, OUT2, OUTI1

FASTEST_MPS = 35.0  # m/s: what a vehicle drives in a bin widens the cells
METRES = 110_574.0  # of a degree of latitude, at the least
NORTH = 111_120.0  # m of one, within 0.5 % of it anywhere
LONGITUDE = 111_320.0  # m of a degree of longitude at the equator
MAX_SAME = 64  # vehicles that share an id in an hour
OUTLIER_M = 15.0  # m from the median of five messages, beyond what is driven meanwhile: further is no position


@dataclass(frozen=True, eq=False)
class Motion:
    """A vehicle's positions (T, 2) [m] and speeds (T,) [m/s]."""

    position: Floats
    speed: Floats


@dataclass(frozen=True, eq=False)
class Track:
    """A vehicle's messages (M,) in order of time, one for each stamp: t [µs since 2004], degrees, m/s, rad from east."""

    device: int
    t: Ints
    lat: Floats
    lon: Floats
    speed: Floats
    heading: Floats


def runs_of(values: Ints) -> list[tuple[int, int]]:
    """Return begin and end (exclusive) of each run of equal values (M,)."""
    edges = [0, *(np.flatnonzero(np.diff(values)) + 1).tolist(), len(values)]
    return list(pairwise(edges)) if len(values) else []


def tracks_of(rows: dict[str, Any]) -> dict[int, Track]:
    """Return the vehicles' tracks without what lies far from the messages about it.

    Args:
        rows: (M,) by column, in order of vehicle and time, one for each stamp; heading in degrees clockwise from north.
    """
    device, t = rows["device"], rows["t"]
    own = runs_of(device)
    if not own:
        return {}
    lengths = np.array([last - first for first, last in own])
    first, last = (np.repeat(np.array(ends), lengths) for ends in zip(*own, strict=True))
    at = np.arange(len(t))
    around = [np.clip(at + k, first, last - 1) for k in (-2, -1, 0, 1, 2)]
    seconds = np.minimum((t[around[4]] - t[around[0]]) * 1e-6, 2.0)
    good = np.ones(len(t), dtype=bool)
    wide = LONGITUDE * np.cos(rows["lat"] * (np.pi / 180.0))
    for name, metres in (("lat", METRES), ("lon", wide)):
        middle = np.sort([rows[name][index] for index in around], axis=0)[2]
        good &= np.abs(rows[name] - middle) * metres < OUTLIER_M + FASTEST_MPS * seconds
    heading = np.pi / 2.0 - rows["heading"].astype(np.float64) * (np.pi / 180.0)
    speed = rows["speed"].astype(np.float64)
    found = {}
    for begin, end in own:
        kept = np.flatnonzero(good[begin:end]) + begin
        if len(kept) > 1:
            found[int(device[begin])] = Track(
                int(device[begin]),
                t[kept],
                rows["lat"][kept],
                rows["lon"][kept],
                speed[kept],
                heading[kept],
            )
    return found


def meetings(
    a: Track, b: Track, span: tuple[int, int], config: CorpusConfig
) -> list[dict[str, Any]]:
    """Return the meetings of two vehicles within a span of time [µs since 2004], each as a row of the table.

    Both near each other for long enough, one of them moves, and they have to do with each other.
    """
    period = round(config.log.period * 1e6)
    first, last = (
        -(-max(span[0], int(a.t[0]), int(b.t[0])) // period),
        min(span[1], int(a.t[-1]), int(b.t[-1])) // period + 1,
    )
    if last - first < shortest(config.log):
        return []
    at = np.arange(first, last) * period
    inside = (a.t >= at[0]) & (a.t <= at[-1])
    origin = (
        (float(a.lat[inside].mean()), float(a.lon[inside].mean()))
        if inside.any()
        else (float(a.lat[0]), float(a.lon[0]))
    )
    one, other = (_at(track, at, origin, config) for track in (a, b))
    apart = np.hypot(*(one[0].position - other[0].position).T)
    near = one[1] & other[1] & (apart < config.log.proximity)
    found = []
    for low, high in runs(near, ticks(OUT_OF_RANGE_S, config.log)):
        for begin, end in _windows(first + low, first + high, config):
            if end - begin < shortest(config.log):
                continue
            there = (
                np.flatnonzero(
                    one[1][begin - first : end - first] & other[1][begin - first : end - first]
                )
                + begin
                - first
            )
            p, q = (Motion(m.position[there], m.speed[there]) for m, _ in (one, other))
            travel = max(float(m.speed.sum()) for m in (p, q)) * config.log.period
            if travel < config.log.travel:
                continue
            gap, _, _ = space_time_gap(p.position, q.position, config.log.period)
            if gap > config.interaction:
                continue
            found.append({
                "a": a.device, "b": b.device, "start": begin * period, "end": (end - 1) * period, "gap": gap,
                "distance": float(apart[there].min()), "travel": travel, "lat": origin[0], "lon": origin[1],
            })  # fmt: skip
    return found


def _windows(first: int, last: int, config: CorpusConfig) -> list[tuple[int, int]]:
    """Cut as `logs.groups.windows` does, at whole multiples of `max_duration`, of ticks that count from 2004."""
    longest = ticks(config.log.max_duration, config.log)
    base = max(first // longest - 1, 0) * longest
    return [
        (begin + base, end + base) for begin, end in windows(first - base, last - base, config.log)
    ]


def _at(
    track: Track, at: Ints, origin: tuple[float, float], config: CorpusConfig
) -> tuple[Motion, Bools]:
    """A vehicle's motion at stamps (T,) [µs], and whether it is there: between messages no further apart than gaps may be."""
    low, high = np.searchsorted(track.t, [at[0], at[-1]])
    own = slice(max(int(low) - 1, 0), int(high) + 1)
    t = track.t[own]
    north, east = metres_per_degree(origin)
    place = np.stack(
        [(track.lon[own] - origin[1]) * east, (track.lat[own] - origin[0]) * north], axis=1
    )
    seconds, when = (t - at[0]) * 1e-6, (at - at[0]) * 1e-6
    position = np.stack(
        [np.interp(when, seconds, place[:, 0]), np.interp(when, seconds, place[:, 1])], axis=1
    )
    after = np.clip(np.searchsorted(t, at), 1, len(t) - 1)
    there: Bools = (
        (at >= t[0])
        & (at <= t[-1])
        & (t[after] - t[after - 1] <= config.log.longest_gap * 1e6 + 1.0)
    )
    return Motion(position, np.interp(when, seconds, track.speed[own])), there


def tell_apart(t: Ints, lat: Floats, lon: Floats, speed: Floats) -> Ints:
    """Return (M,) which of the vehicles that share an id sent each message: 0, 1, …, in order of their first.

    A message belongs to the vehicle that could have driven there from its message before, the nearest such.

    Args:
        t: (M,) µs, ascending.
        lat: (M,) degrees.
        lon: (M,) degrees.
        speed: (M,) m/s.
    """
    who = np.zeros(len(t), dtype=np.int64)
    wide = np.cos(float(lat.mean()) * np.pi / 180.0) * LONGITUDE
    _tell_apart(
        np.asarray(t, dtype=np.int64),
        lat * METRES,
        lon * wide,
        np.asarray(speed, dtype=np.float64),
        np.zeros((MAX_SAME, 4)),
        who,
    )
    return who


@kernel(I1, F1, F1, F1, OUT2, OUTI1)
def _tell_apart(
    t: Ints, north: Floats, east: Floats, speed: Floats, places: Floats, who: Ints
) -> None:
    """`places` (V, 4) takes the last message of each vehicle: t, north, east, speed; the last one takes whoever is left."""
    count = 0
    for k in range(len(t)):
        best, nearest = -1, np.inf
        for n in range(count):
            seconds = (t[k] - places[n, 0]) * 1e-6
            away = max(abs(north[k] - places[n, 1]), abs(east[k] - places[n, 2]))
            if (
                away < nearest
                and seconds < 600.0
                and away < 20.0 + 1.5 * max(speed[k], places[n, 3], 5.0) * seconds
            ):
                best, nearest = n, away
        if best < 0:
            best = min(count, len(places) - 1)
            count = best + 1
        places[best, 0] = t[k]
        places[best, 1] = north[k]
        places[best, 2] = east[k]
        places[best, 3] = speed[k]
        who[k] = best
