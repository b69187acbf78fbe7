# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Lateral positions in a lane: bicycles near its edge, cars beside them at the recorded offset.

A recording has no lanes. Who was recorded side by side in less than a lane's width shares a lane
on the road, too: least squares keep the recorded offset between the two, as far as there is room.
In a narrow lane the bicycle rides along the edge line, and the car drives partly on the next lane.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
import math

import numpy as np
from scipy.optimize import lsq_linear

from scenario_gen.numerics import Floats
from scenario_gen.numerics.curve import Curve
from scenario_gen.roads.vector.lane_graph import lane_change_length, LaneGraph, LanePath
from scenario_gen.situation import Abreast, abreast_in_lane, Track
from scenario_gen.types import Vehicle


@dataclass(frozen=True)
class _Limits:
    """Lateral positions that drivers choose."""

    usual_edge_m: float = 0.5  # between a bicycle that is free to choose and the lane's edge
    min_edge_m: float = 0.15  # between a bicycle that shares the lane and its edge
    over_line_m: float = 0.85  # farther, onto the next lane; there remains room for another car
    free_weight: float = 0.1  # of the usual place, over that of a recorded offset
    side_by_side_m: float = 4.5  # between the lanes of two road users side by side
    step_m: float = 2.0  # between places at which the room is looked up


_LIMITS = _Limits()


def with_lateral_positions(
    graph: LaneGraph, paths: list[LanePath], tracks: tuple[Track, ...]
) -> tuple[list[LanePath], float]:
    """Return lane paths with each vehicle's lateral position, and the missing side distance [m].

    A vehicle that is not beside another one in its lane stays in the lane's middle, on a map a
    bicycle near the edge, unless the lane is reserved for bicycles.
    """
    pairs = [(each, _offset_between(paths, each)) for each in abreast_in_lane(tracks)]
    pairs = [(each, gap) for each, gap in pairs if abs(gap) < _LIMITS.side_by_side_m]
    spans = {n: each.spans[k] for each, _ in pairs for k, n in enumerate(each.pair)}
    usual, limits = _rooms(graph, paths, tracks, spans)
    if not limits.any():
        return paths, 0.0
    offsets, missing = _solved(pairs, usual, limits)
    moved = [
        _moved(graph, path, track.vehicle, float(offsets[n]), spans.get(n))
        for n, (path, track) in enumerate(zip(paths, tracks, strict=True))
    ]
    return moved, missing


def _rooms(
    graph: LaneGraph,
    paths: list[LanePath],
    tracks: tuple[Track, ...],
    spans: Mapping[int, Floats],
) -> tuple[Floats, Floats]:
    """Return usual offsets (N,) and the room (2, N) to the right and to the left of lanes [m].

    Vehicles that keep to the middle of their lane have none.
    """
    usual, limits = np.zeros(len(tracks)), np.zeros((2, len(tracks)))
    for n, (path, track) in enumerate(zip(paths, tracks, strict=True)):
        is_free = graph.network.drawn or track.vehicle.kind.lane_user != {"bicycle"}
        if n in spans or not is_free:
            half_width = _half_width(graph, path)
            usual[n] = 0.0 if is_free else _usual_offset(graph, path, track, half_width)
            limits[:, n] = _room(graph, path, track, half_width, spans.get(n))
    return usual, limits


def _solved(
    pairs: list[tuple[Abreast, float]], usual: Floats, limits: Floats
) -> tuple[Floats, float]:
    """Return offsets (N,) [m] from lanes, and the largest error [m] of the recorded distances.

    Args:
        pairs: side by side, with the offset [m] between their lanes.
        usual: (N,) [m] offsets of vehicles that are free to choose.
        limits: (2, N) [m] room to the right and to the left.
    """
    count = len(usual)
    matrix = np.concatenate((_LIMITS.free_weight * np.eye(count), np.zeros((len(pairs), count))))
    wanted = np.concatenate((_LIMITS.free_weight * usual, np.zeros(len(pairs))))
    for row, (each, gap) in enumerate(pairs, start=count):
        matrix[row, each.pair] = -1.0, 1.0
        wanted[row] = each.offset - gap
    offsets = lsq_linear(matrix, wanted, (-limits[0] - 1e-6, limits[1] + 1e-6)).x
    return offsets, float(np.abs(matrix @ offsets - wanted)[count:].max(initial=0.0))


def _offset_between(paths: list[LanePath], abreast: Abreast) -> float:
    """Return how far [m, left positive] the lanes of the second are from those of the first."""
    first, second = (paths[n] for n in abreast.pair)
    poses = second.curve.at(second.start + second.progress[abreast.samples])
    _, offset = first.curve.project(poses[:, :2])
    return float(np.median(offset))


def _half_width(graph: LaneGraph, path: LanePath) -> float:
    """Return half the width [m] of the lanes of the driven part; a quarter of it is narrower."""
    on_path = np.isin(graph.lane_of, path.lanes)
    station, _ = path.curve.project(graph.points[on_path])
    driven = (station > path.start - 1.0) & (station < path.end + 1.0)
    half_widths = graph.half_width[on_path][driven]
    return float(np.percentile(half_widths, 25)) if len(half_widths) else 0.0


def _usual_offset(graph: LaneGraph, path: LanePath, track: Track, half_width: float) -> float:
    """Return the usual place [m, left positive] of a bicycle that is free to choose."""
    if not graph.reserved_for(track).isdisjoint(path.lanes):
        return 0.0
    side = 1.0 if graph.network.traffic_side == "left" else -1.0
    return side * max(half_width - track.vehicle.width / 2.0 - _LIMITS.usual_edge_m, 0.0)


def _room(
    graph: LaneGraph, path: LanePath, track: Track, half_width: float, span: Floats | None
) -> tuple[float, float]:
    """Return how far [m] a vehicle may drive to the right and to the left of its lane's middle.

    A narrow one stays in its lane on the whole path; a wide one may use the next lane on the span.
    """
    side = track.vehicle.width / 2.0 + _LIMITS.min_edge_m
    low, high = 0.0, half_width - side
    first, last = path.start, path.end
    if not track.vehicle.is_narrow and span is not None:
        low, high = max(high, 0.0), high + _LIMITS.over_line_m
        first, last = span + path.start
    stations = np.linspace(first, last, int((last - first) / _LIMITS.step_m) + 2)
    room = []
    for sign in (-1.0, 1.0):
        offset = high
        while offset > low:
            places = path.curve.at_offset(stations, sign * (offset + side))[:, :2]
            if graph.covers(places).all():
                break
            offset -= 0.1
        room.append(max(offset, low))
    return room[0], room[1]


def _moved(
    graph: LaneGraph, path: LanePath, vehicle: Vehicle, offset: float, span: Floats | None
) -> LanePath:
    """Return a lane path at an offset [m, left positive]; of a wide vehicle only on a span.

    It changes its offset as gently as its lanes allow.
    """
    if abs(offset) < 0.01:
        return path
    curve, offsets = path.curve, np.full(len(path.curve.station), offset)
    if not vehicle.is_narrow and span is not None:
        low, high = span + path.start
        outside = np.maximum(low - curve.station, curve.station - high).clip(min=0.0)
        driven = (curve.station > path.start) & (curve.station < path.end)
        for shortening in (1.0, 2.0, 3.0):
            x = np.clip(1.0 - outside * shortening / lane_change_length(offset), 0.0, 1.0)
            offsets = offset * x**3 * (10.0 - 15.0 * x + 6.0 * np.square(x))
            side = offsets + math.copysign(vehicle.width / 2.0, offset)
            if graph.covers(curve.at_offset(curve.station, side)[driven, :2]).all():
                break
    moved = Curve.through(curve.at_offset(curve.station, offsets)[:, :2])
    start, _ = moved.project(curve.at(np.array([path.start]))[:, :2])
    return replace(path, curve=moved, start=float(start[0]))
