# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Where the paths of two tracks cross, also a little beyond their recorded ends."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from scenario_gen.numerics import Floats
from scenario_gen.numerics.curve import crossings
from scenario_gen.situation.tracks import Track

EXTENSION_M = 15.0  # by which a path is continued
MIN_CROSSING_RAD = np.radians(25.0)
# closer to head-on, the place of a crossing depends on lateral offsets, or on GPS errors
MIN_HEAD_ON_RAD = np.radians(30.0)
NOT_DRIVEN_COST = 10.0  # per metre
DELAY_COST = 0.05  # per sample between the two vehicles
OBLIQUE_COST = 25.0  # of parallel paths


@dataclass(frozen=True)
class PathCrossing:
    """Where two tracks cross.

    Attributes:
        first: arc length [m] on the first track; outside of the path if it lies beyond its ends.
        second: arc length [m] on the second track.
        driven: whether both vehicles drive as far as that.
    """

    first: float
    second: float
    driven: bool


@lru_cache(maxsize=256)
def path_crossing(a: Track, b: Track) -> PathCrossing | None:
    """Return the crossing that both vehicles come closest to reaching; None if there is none.

    Of several, the one that is most perpendicular and closest in time.
    """
    first, second = (
        track.curve.cut(-EXTENSION_M, track.travelled + EXTENSION_M) for track in (a, b)
    )
    stations = crossings(first, second, MIN_CROSSING_RAD) - EXTENSION_M
    angle = a.curve.at(stations[:, 0])[:, 2] - b.curve.at(stations[:, 1])[:, 2]
    is_oblique = np.cos(angle) > -np.cos(MIN_HEAD_ON_RAD)
    stations, angle = stations[is_oblique], angle[is_oblique]
    if len(stations) == 0:
        return None
    missing = _distance_outside(a, stations[:, 0]) + _distance_outside(b, stations[:, 1])
    delay = np.abs(_sample_at(a, stations[:, 0]) - _sample_at(b, stations[:, 1]))
    oblique = OBLIQUE_COST * (1.0 - np.abs(np.sin(angle)))
    best = int(np.argmin(NOT_DRIVEN_COST * missing + DELAY_COST * delay + oblique))
    on_first, on_second = stations[best].tolist()
    return PathCrossing(on_first, on_second, bool(missing[best] == 0.0))


def pair_crossings(tracks: Sequence[Track]) -> Iterator[tuple[int, int, PathCrossing]]:
    """Yield the crossings of all pairs of tracks: higher index, lower index, where they cross."""
    for a, first in enumerate(tracks):
        for b, second in enumerate(tracks[:a]):
            crossing = path_crossing(first, second)
            if crossing is not None:
                yield a, b, crossing


def _distance_outside(track: Track, station: Floats) -> Floats:
    """How far [m] stations lie outside of the driven path."""
    return np.asarray(np.maximum(-station, 0.0) + np.maximum(station - track.travelled, 0.0))


def _sample_at(track: Track, station: Floats) -> Floats:
    """The samples at which stations are reached."""
    return np.asarray(np.searchsorted(track.progress, station), dtype=np.float64)
