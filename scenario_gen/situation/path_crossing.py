# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Where two tracks cross: the point at which their paths cross, also a little beyond their recorded ends."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from scenario_gen.numerics import Floats
from scenario_gen.numerics.curve import crossings
from scenario_gen.situation.tracks import Track

_BEYOND = 15.0  # metres by which a path is continued to look for a crossing
_ANGLE = np.radians(25.0)
_HEAD_ON = np.radians(
    30.0
)  # nearer to head-on than this, a crossing is a matter of lateral offset (or of GPS)


@dataclass(frozen=True)
class PathCrossing:
    """Where two tracks cross.

    Attributes:
        first: arc length [m] on the first track; below 0 or above the path's length if it lies beyond.
        second: likewise on the second one.
        driven: whether both vehicles drive as far as that.
    """

    first: float
    second: float
    driven: bool


def path_crossing(a: Track, b: Track) -> PathCrossing | None:
    """The crossing that both come nearest to reaching (of several, the squarest and nearest in time), or None."""
    first, second = (track.curve.cut(-_BEYOND, track.travelled + _BEYOND) for track in (a, b))
    places = crossings(first, second, _ANGLE) - _BEYOND
    angle = a.curve.at(places[:, 0])[:, 2] - b.curve.at(places[:, 1])[:, 2]
    aslant = np.cos(angle) > -np.cos(_HEAD_ON)
    places, angle = places[aslant], angle[aslant]
    if len(places) == 0:
        return None
    short = _outside(places[:, 0], a.travelled) + _outside(places[:, 1], b.travelled)
    lag = np.abs(_sample(a, places[:, 0]) - _sample(b, places[:, 1]))
    best = int(np.argmin(short * 10.0 + lag * 0.05 + 25.0 * (1.0 - np.abs(np.sin(angle)))))
    return PathCrossing(float(places[best, 0]), float(places[best, 1]), bool(short[best] == 0.0))


def pair_crossings(tracks: Sequence[Track]) -> Iterator[tuple[int, int, PathCrossing]]:
    """Yield the crossings of all pairs of tracks: the index of the first, the lower one of the second, where they cross."""
    for a, first in enumerate(tracks):
        for b, second in enumerate(tracks[:a]):
            crossing = path_crossing(first, second)
            if crossing is not None:
                yield a, b, crossing


def _outside(station: Floats, length: float) -> Floats:
    return np.asarray(np.maximum(-station, 0.0) + np.maximum(station - length, 0.0))


def _sample(track: Track, station: Floats) -> Floats:
    return np.asarray(np.searchsorted(track.progress, station), dtype=np.float64)
