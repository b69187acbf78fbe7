# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Lanes along paths that are driven, for a road of which no lanes are known."""

from collections.abc import Mapping

import numpy as np

from scenario_gen.numerics import Floats
from scenario_gen.numerics.curve import Curve
from scenario_gen.types import Lane

_SAME_LANE, _SAME_WAY = 1.0, 0.35  # metres and rad within which a path lies in another one's lane


def sharing_lanes(paths: Mapping[str, Curve]) -> dict[str, list[str]]:
    """Return the names of the paths that share a lane, by the longest of them, along which it lies."""
    shared: dict[str, list[str]] = {}
    for name in sorted(paths, key=lambda name: (-paths[name].length, name)):
        home = next((other for other in shared if _runs_in(paths[name], paths[other])), name)
        shared.setdefault(home, []).append(name)
    return shared


def _runs_in(path: Curve, lane: Curve) -> bool:
    """Say whether a path lies in the lane along another one, in the same direction."""
    station, offset = lane.project(path.points[:, :2])
    turn = path.points[:, 2] - lane.at(station)[:, 2]
    return bool((np.abs(offset) < _SAME_LANE).all() and (np.cos(turn) > np.cos(_SAME_WAY)).all())


def lane_along(name: str, path: Curve, half: Floats | float) -> Lane:
    """Return the lane that reaches `half` metres, (M,) or one number, to both sides of the points of a path."""
    left, right = (path.beside(path.station, sign * half)[:, :2] for sign in (1.0, -1.0))
    return Lane(name, left, right)
