# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Tracks of vehicles in an hour of messages, and the meetings of two vehicles.

Vehicles that share an id are separated, and outliers are left out.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.ndimage import maximum_filter1d, median_filter, minimum_filter1d

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

MAX_SPEED_MPS = 35.0  # the distance driven in a bin widens the cells
LATITUDE_M = 110_574.0  # length of a degree of latitude, at least
LONGITUDE_M = 111_320.0  # length of a degree of longitude at the equator
MICROSECOND_S = 1e-6
MAX_SENDERS_COUNT = 64  # vehicles that share an id in an hour
OUTLIER_M = 15.0  # from the median of five messages, beyond the distance driven meanwhile
MAX_OUTLIER_GAP_S = 2.0
SENDER_RADIUS_M = 20.0  # within which the next message of a vehicle is, beyond its driving
SENDER_SPEED_RATIO = 1.5  # of its speed
MIN_SENDER_SPEED_MPS = 5.0
MAX_SENDER_GAP_S = 600.0


@dataclass(frozen=True, eq=False)
class Motion:
    """A vehicle's positions (T, 2) [m] and speeds (T,) [m/s]."""

    position: Floats
    speed: Floats


@dataclass(frozen=True, eq=False)
class Track:
    """Messages (M,) of a vehicle by time: t [µs since 2004], degrees, m/s, rad from east."""

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


def tracks_of(rows: Mapping[str, Any]) -> dict[int, Track]:
    """Return the tracks of vehicles, without outliers.

    Args:
        rows: (M,) by column, ordered by vehicle and time, one for each stamp; heading in degrees
            clockwise from north.
    """
    tracks = {}
    for begin, end in runs_of(rows["device"]):
        sent = {name: values[begin:end] for name, values in rows.items()}
        index = np.flatnonzero(~_outliers(sent))
        if len(index) > 1:
            name = int(sent["device"][0])
            heading = np.pi / 2.0 - sent["heading"].astype(np.float64) * (np.pi / 180.0)
            values = sent["t"], sent["lat"], sent["lon"], sent["speed"].astype(np.float64), heading
            tracks[name] = Track(name, *(each[index] for each in values))
    return tracks


def _outliers(sent: Mapping[str, Any]) -> Bools:
    """(M,) whether a vehicle's message lies far from the median of the five messages around it."""
    latest, earliest = (
        limit(sent["t"], 5, mode="nearest") for limit in (maximum_filter1d, minimum_filter1d)
    )
    seconds = np.minimum((latest - earliest) * MICROSECOND_S, MAX_OUTLIER_GAP_S)
    east = LONGITUDE_M * np.cos(sent["lat"] * (np.pi / 180.0))
    is_outlier = np.zeros(len(seconds), dtype=bool)
    for name, metres in (("lat", LATITUDE_M), ("lon", east)):
        median = median_filter(sent[name], 5, mode="nearest")
        distance = np.abs(sent[name] - median) * metres
        is_outlier |= ~(distance < OUTLIER_M + MAX_SPEED_MPS * seconds)
    return is_outlier


def meetings(
    a: Track, b: Track, span: tuple[int, int], config: CorpusConfig
) -> list[dict[str, Any]]:
    """Return the meetings of two vehicles within a span of time [µs since 2004], as table rows.

    In a meeting both are near each other for long enough, one of them moves, and they interact.
    """
    period = round(config.log.period / MICROSECOND_S)
    first = -(-max(span[0], int(a.t[0]), int(b.t[0])) // period)
    last = min(span[1], int(a.t[-1]), int(b.t[-1])) // period + 1
    if last - first < shortest(config.log):
        return []
    stamps = np.arange(first, last) * period
    inside = np.flatnonzero((a.t >= stamps[0]) & (a.t <= stamps[-1]))
    if len(inside) == 0:
        inside = np.array([0])
    origin = float(a.lat[inside].mean()), float(a.lon[inside].mean())
    motion_a, present_a = _motion_at(a, stamps, origin, config)
    motion_b, present_b = _motion_at(b, stamps, origin, config)
    distance = np.hypot(*(motion_a.position - motion_b.position).T)
    both = present_a & present_b
    rows = []
    for low, high in runs(
        both & (distance < config.log.proximity), ticks(OUT_OF_RANGE_S, config.log)
    ):
        for begin, end in _windows(first + low, first + high, config):
            if end - begin < shortest(config.log):
                continue
            index = np.flatnonzero(both[begin - first : end - first]) + begin - first
            facts = _interaction(motion_a, motion_b, index, config)
            if facts is not None:
                rows.append({
                    "a": a.device,
                    "b": b.device,
                    "start": begin * period,
                    "end": (end - 1) * period,
                    "distance": float(distance[index].min()),
                    "lat": origin[0],
                    "lon": origin[1],
                    **facts,
                })  # fmt: skip
    return rows


def _interaction(
    a: Motion, b: Motion, index: Ints, config: CorpusConfig
) -> dict[str, float] | None:
    """Return gap and travel [m] of two vehicles at some samples; None if they do not interact."""
    longest = max(float(motion.speed[index].sum()) for motion in (a, b))
    travel = longest * config.log.period
    if travel < config.log.travel:
        return None
    gap, _, _ = space_time_gap(a.position[index], b.position[index], config.log.period)
    return None if gap > config.interaction else {"gap": gap, "travel": travel}


def _windows(first: int, last: int, config: CorpusConfig) -> list[tuple[int, int]]:
    """Cut as `logs.groups.windows` does, at multiples of `max_duration`, in ticks since 2004."""
    longest = ticks(config.log.max_duration, config.log)
    base = max(first // longest - 1, 0) * longest
    cuts = windows(first - base, last - base, config.log)
    return [(begin + base, end + base) for begin, end in cuts]


def _motion_at(
    track: Track, stamps: Ints, origin: tuple[float, float], config: CorpusConfig
) -> tuple[Motion, Bools]:
    """A vehicle's motion at stamps (T,) [µs], and whether it is present.

    It is present between messages with gaps that are short enough.
    """
    low, high = np.searchsorted(track.t, [stamps[0], stamps[-1]])
    rows = slice(max(int(low) - 1, 0), int(high) + 1)
    t = track.t[rows]
    north, east = metres_per_degree(origin)
    seconds, times = (t - stamps[0]) * MICROSECOND_S, (stamps - stamps[0]) * MICROSECOND_S
    x = np.interp(times, seconds, (track.lon[rows] - origin[1]) * east)
    y = np.interp(times, seconds, (track.lat[rows] - origin[0]) * north)
    after = np.clip(np.searchsorted(t, stamps), 1, len(t) - 1)
    longest = config.log.longest_gap / MICROSECOND_S + 1.0
    is_present = (stamps >= t[0]) & (stamps <= t[-1]) & (t[after] - t[after - 1] <= longest)
    speed = np.interp(times, seconds, track.speed[rows])
    return Motion(np.stack([x, y], axis=1), speed), np.asarray(is_present)


def separate_senders(t: Ints, lat: Floats, lon: Floats, speed: Floats) -> Ints:
    """Return (M,) which of the vehicles with one id sent each message: 0, 1, … by first message.

    A message belongs to the nearest vehicle that can have driven there since its last message.

    Args:
        t: (M,) µs, ascending.
        lat: (M,) degrees.
        lon: (M,) degrees.
        speed: (M,) m/s.
    """
    sender = np.zeros(len(t), dtype=np.int64)
    east = np.cos(float(lat.mean()) * np.pi / 180.0) * LONGITUDE_M
    _separate_senders(
        np.asarray(t, dtype=np.int64),
        lat * LATITUDE_M,
        lon * east,
        np.asarray(speed, dtype=np.float64),
        np.zeros((MAX_SENDERS_COUNT, 4)),
        sender,
    )
    return sender


@kernel(I1, F1, F1, F1, OUT2, OUTI1)
def _separate_senders(
    t: Ints, north: Floats, east: Floats, speed: Floats, latest: Floats, sender: Ints
) -> None:
    """Fill `sender`; `latest` (V, 4) has the latest t, north, east, speed of each vehicle.

    The last vehicle gets all messages that remain.
    """
    count = 0
    for k in range(len(t)):
        best, nearest = -1, np.inf
        for n in range(count):
            seconds = (t[k] - latest[n, 0]) * MICROSECOND_S
            distance = max(abs(north[k] - latest[n, 1]), abs(east[k] - latest[n, 2]))
            fastest = max(speed[k], latest[n, 3], MIN_SENDER_SPEED_MPS)
            reach = SENDER_RADIUS_M + SENDER_SPEED_RATIO * fastest * seconds
            if distance < min(nearest, reach) and seconds < MAX_SENDER_GAP_S:
                best, nearest = n, distance
        if best < 0:
            best = min(count, len(latest) - 1)
            count = best + 1
        latest[best, 0] = t[k]
        latest[best, 1] = north[k]
        latest[best, 2] = east[k]
        latest[best, 3] = speed[k]
        sender[k] = best
