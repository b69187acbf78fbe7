# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Lateral positions in a lane: bicycles near its edge, cars beside them at the recorded offset.

A recording has no lanes. Who was recorded side by side in less than a lane's width shares a lane
on the map, too: least squares keep the recorded offset between the two, as far as the lane is wide
enough for both.
"""

from dataclasses import replace

import numpy as np
from scipy.optimize import lsq_linear

from scenario_gen.numerics import Bools, Floats
from scenario_gen.numerics.curve import Curve
from scenario_gen.roads.vector.lane_graph import LaneGraph
from scenario_gen.roads.vector.lane_path import lane_change_length, LanePath, LIMITS
from scenario_gen.situation import abreast_in_lane, Track

_EDGE_DISTANCE_M = 0.5  # of a bicycle that is free to choose
_MIN_EDGE_DISTANCE_M = 0.4  # of a bicycle that is passed
_MAX_OVER_LINE_M = 0.5  # of a car that makes room
_FREE_WEIGHT = 0.1  # of the usual place, over that of a recorded offset
_LEAST_OFFSET_M = 0.01


def with_lateral_positions(
    graph: LaneGraph, paths: list[LanePath], tracks: tuple[Track, ...]
) -> list[LanePath]:
    """Return lane paths with each vehicle's lateral position in its lane.

    A vehicle that is not beside another one in its lane stays in the lane's middle, a bicycle
    near the edge, unless the lane is reserved for bicycles.
    """
    network = graph.network
    if network.drawn or not any(track.vehicle.kind.lane_user == {"bicycle"} for track in tracks):
        return paths
    side = 1.0 if network.traffic_side == "left" else -1.0
    room = np.array([_half_width(graph, path) for path in paths])
    width = np.array([track.vehicle.width for track in tracks])
    usual = np.zeros(len(tracks))
    limit = np.maximum(room - width / 2.0 + _MAX_OVER_LINE_M, 0.0)
    for n, (path, track) in enumerate(zip(paths, tracks, strict=True)):
        if track.vehicle.kind.lane_user == {"bicycle"}:
            free = room[n] - width[n] / 2.0
            shared = graph.reserved_for(track).isdisjoint(path.lanes)
            usual[n] = side * max(free - _EDGE_DISTANCE_M, 0.0) * shared
            limit[n] = max(free - _MIN_EDGE_DISTANCE_M, 0.0)
    rows, values = [_FREE_WEIGHT * np.eye(len(tracks))], [_FREE_WEIGHT * usual]
    spans: dict[int, Floats] = {}
    for abreast in abreast_in_lane(tracks):
        first, second = abreast.pair
        if _share_lane(paths[first], paths[second], abreast.samples):
            row = np.zeros((1, len(tracks)))
            row[0, [first, second]] = -1.0, 1.0
            rows.append(row)
            values.append(np.array([abreast.offset]))
            spans |= dict(zip(abreast.pair, abreast.spans, strict=True))
    bounds = -limit - 1e-6, limit + 1e-6
    offsets = lsq_linear(np.concatenate(rows), np.concatenate(values), bounds).x
    return [
        _moved(path, float(usual[n]), float(offsets[n]), spans.get(n))
        for n, path in enumerate(paths)
    ]


def _half_width(graph: LaneGraph, path: LanePath) -> float:
    """Return half the width [m] of the lanes of the driven part; a quarter of it is narrower."""
    widths = []
    for k in path.lanes:
        lane = graph.network.lanes[k]
        station, _ = path.curve.project(lane.centre)
        driven = (station > path.start - 1.0) & (station < path.end + 1.0)
        widths.append(np.hypot(*(lane.left - lane.right)[driven].T))
    known = np.concatenate(widths)
    return float(np.percentile(known, 25)) / 2.0 if len(known) else 0.0


def _share_lane(path: LanePath, other: LanePath, samples: Bools) -> bool:
    """Return whether the lanes of two paths are the same at most of some samples."""
    poses = path.curve.at(path.start + path.progress[samples])
    _, offset = other.curve.project(poses[:, :2])
    return float(np.median(np.abs(offset))) < LIMITS.same_lane_m / 2.0


def _moved(path: LanePath, usual: float, offset: float, span: Floats | None) -> LanePath:
    """Return a lane path at a usual offset, and at another one [m, left positive] on a span."""
    if max(abs(usual), abs(offset)) < _LEAST_OFFSET_M:
        return path
    curve, change = path.curve, 0.0 if span is None else offset - usual
    low, high = (0.0, 0.0) if span is None else span + path.start
    outside = np.maximum(low - curve.station, curve.station - high).clip(min=0.0)
    x = np.clip(1.0 - outside / lane_change_length(change), 0.0, 1.0)
    offsets = usual + change * x**3 * (10.0 - 15.0 * x + 6.0 * np.square(x))
    moved = Curve.through(curve.at_offset(curve.station, offsets)[:, :2])
    start, _ = moved.project(curve.at(np.array([path.start]))[:, :2])
    return replace(path, curve=moved, start=float(start[0]))
