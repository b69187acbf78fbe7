# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Where two tracks cross: the point at which their paths cross, also a little beyond their recorded ends."""

from dataclasses import dataclass

import numpy as np

from scenario_gen.numerics import exact, Floats
from scenario_gen.numerics.curve import crossings
from scenario_gen.template.tracks import Track

_BEYOND = 15.0  # metres by which a path is continued to look for a crossing
_ANGLE = np.radians(25.0)
_HEAD_ON = np.radians(30.0)  # nearer to head-on than this, a crossing is a matter of lateral offset (or of GPS)


@dataclass(frozen=True)
class PathCrossing:
    """Arc lengths [m] on the first and on the second track at which they cross; below 0 or above the path's length if beyond."""

    first: float
    second: float


def path_crossing(a: Track, b: Track) -> PathCrossing | None:
    """The crossing that both come nearest to reaching (of several, the squarest and nearest in time), or None."""
    one, two = (t.curve.cut(-_BEYOND, t.travelled + _BEYOND) for t in (a, b))
    found = crossings(one, two, _ANGLE) - _BEYOND
    angle = a.curve.at(found[:, 0])[:, 2] - b.curve.at(found[:, 1])[:, 2]
    found, angle = found[exact.cos(angle) > -exact.cos(_HEAD_ON)], angle[exact.cos(angle) > -exact.cos(_HEAD_ON)]
    if len(found) == 0:
        return None
    short = _outside(found[:, 0], a.travelled) + _outside(found[:, 1], b.travelled)
    lag = np.abs(_sample(a, found[:, 0]) - _sample(b, found[:, 1]))
    best = int(np.argmin(short * 10.0 + lag * 0.05 + 25.0 * (1.0 - np.abs(exact.sin(angle)))))
    return PathCrossing(float(found[best, 0]), float(found[best, 1]))


def _outside(station: Floats, length: float) -> Floats:
    return np.asarray(np.maximum(-station, 0.0) + np.maximum(station - length, 0.0))


def _sample(track: Track, station: Floats) -> Floats:
    return np.asarray(np.searchsorted(track.progress, station), dtype=np.float64)
