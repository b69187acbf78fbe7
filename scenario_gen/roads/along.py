# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Lanes along driven paths, for a road without known lanes."""

from collections.abc import Mapping

import numpy as np

from scenario_gen.numerics import Floats
from scenario_gen.numerics.curve import Curve
from scenario_gen.types import Lane

_MAX_LANE_OFFSET_M = 1.0
_MAX_LANE_TURN_RAD = 0.35


def sharing_lanes(paths: Mapping[str, Curve]) -> dict[str, list[str]]:
    """Return the names of the paths in each lane, by the name of the longest one."""
    lanes: dict[str, list[str]] = {}
    for name in sorted(paths, key=lambda name: (-paths[name].length, name)):
        lane = next((other for other in lanes if _runs_in(paths[name], paths[other])), name)
        lanes.setdefault(lane, []).append(name)
    return lanes


def _runs_in(path: Curve, lane: Curve) -> bool:
    """Return whether a path lies in the lane along another one, in the same direction."""
    station, offset = lane.project(path.points[:, :2])
    turn = path.points[:, 2] - lane.at(station)[:, 2]
    in_lane = (np.abs(offset) < _MAX_LANE_OFFSET_M) & (np.cos(turn) > np.cos(_MAX_LANE_TURN_RAD))
    return bool(in_lane.all())


def lane_along(name: str, path: Curve, half_width: Floats | float) -> Lane:
    """Return the lane with half widths (M,) [m], or one for all, along the points of a path."""
    left, right = (path.at_offset(path.station, side * half_width)[:, :2] for side in (1.0, -1.0))
    return Lane(name, left, right)
