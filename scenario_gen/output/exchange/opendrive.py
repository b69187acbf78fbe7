# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""OpenDRIVE 1.7: a lane map as a road network. A strip is a road, a way through the junction a connecting road.

The inertial frame is the scenarios' frame, x east, y north. A straight piece of a reference line is a `line`, another one a
`paramPoly3` that meets positions and headings of two points (cubic Hermite, so the line has no kink); widths and the lane offset
are linear between points. The date is that of the template's stamp.
"""

from collections.abc import Iterator, Sequence
from datetime import datetime, UTC
from itertools import groupby, pairwise

import numpy as np

from scenario_gen.numerics import Floats, wrap_angle
from scenario_gen.output.exchange.lanes import joined, Joint, LaneMap, Strip
from scenario_gen.output.exchange.xml import add, comment, Element, serialized

ROADS, JUNCTION = 1, 1000  # ids: of the first road, and of the junction
STRAIGHT = 1e-7  # rad by which the headings of a straight piece may differ
GOES_ON = 1e-5  # metres by which a width or an offset may differ from its linear piece
_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(5)  # on [-1, 1]


def write_opendrive(lane_map: LaneMap, name: str, start_ns: int) -> bytes:
    """Return a lane map as the bytes of an OpenDRIVE file.

    Args:
        lane_map: all lanes.
        name: of the network, for people.
        start_ns: stamp whose day is the file's date.
    """
    root = Element("OpenDRIVE")
    everything = np.concatenate([strip.edges(side).reshape(-1, 2) for strip in lane_map.strips for side in ("right", "left")])
    (west, south), (east, north) = everything.min(axis=0).tolist(), everything.max(axis=0).tolist()
    date = datetime.fromtimestamp(start_ns // 10**9, UTC).strftime("%Y-%m-%dT%H:%M:%S")
    add(
        root,
        "header",
        revMajor="1",
        revMinor="7",
        name=name,
        version="1.00",
        date=date,
        north=north,
        south=south,
        east=east,
        west=west,
        vendor="scenario_gen",
    )
    comment(root, f"lanes: {lane_map.origin}")
    joints = {joint.by: joint for joint in lane_map.joints}
    for k, strip in enumerate(lane_map.strips):
        _road(root, lane_map, k, strip, joints.get(k))
    if lane_map.joints:
        _junction(root, lane_map)
    return serialized(root)


def lane_id(side: str, place: int) -> int:
    """Return OpenDRIVE's id of a lane: negative on the right of the reference line, positive on the left, from 1 outwards."""
    return (place + 1) * (-1 if side == "right" else 1)


def _road(root: Element, lane_map: LaneMap, k: int, strip: Strip, joint: Joint | None) -> None:
    """Append a road; `joint` says what it connects, None if it is no way through the junction."""
    pieces = list(_pieces(strip.reference))
    station = np.concatenate([[0.0], np.cumsum([piece[0] for piece in pieces])])
    rule = "RHT" if lane_map.side == "right" else "LHT"
    junction = -1 if joint is None else JUNCTION
    road = add(root, "road", name=strip.name, length=float(station[-1]), id=ROADS + k, junction=junction, rule=rule)
    link = add(road, "link")
    if joint is not None:
        add(link, "predecessor", elementType="road", elementId=ROADS + joint.start, contactPoint="end")
        add(link, "successor", elementType="road", elementId=ROADS + joint.goal, contactPoint="end")
    elif lane_map.joints and not lane_map.is_derived(k):
        add(link, "successor", elementType="junction", elementId=JUNCTION)
    add(add(road, "type", s=0.0, type="town"), "speed", max="no limit")
    view = add(road, "planView")
    for s, x, y, yaw, length, curve in _merged(strip.reference, pieces, station):
        geometry = add(view, "geometry", s=s, x=x, y=y, hdg=yaw, length=length)
        if curve is None:
            add(geometry, "line")
        else:
            names = ("aU", "bU", "cU", "dU", "aV", "bV", "cV", "dV")
            add(geometry, "paramPoly3", **dict(zip(names, curve, strict=True)), pRange="normalized")
    lanes = add(road, "lanes")
    for s, value, slope in _linear(station, strip.offset):
        add(lanes, "laneOffset", s=s, a=value, b=slope, c=0.0, d=0.0)
    section = add(lanes, "laneSection", s=0.0)
    for side in ("left", "center", "right"):
        widths: Floats = np.zeros((0, 0)) if side == "center" else getattr(strip, side)
        if side == "center":
            _lane(add(section, side), 0, "none", [], (None, None))
        elif len(widths):
            parent = add(section, side)
            order = range(len(widths)) if side == "right" else range(len(widths) - 1, -1, -1)  # from left to right
            for place in order:
                ends = _lane_links(lane_map, joint, side, place)
                _lane(parent, lane_id(side, place), "driving", list(_linear(station, widths[place])), ends)


def _lane_links(lane_map: LaneMap, joint: Joint | None, side: str, place: int) -> tuple[int | None, int | None]:
    """Return the ids of the lanes before and after a lane of a connecting road."""
    if joint is None:
        return None, None
    start, by, goal = joined(lane_map, joint)
    return (lane_id(*start[1:]), lane_id(*goal[1:])) if by[1:] == (side, place) else (None, None)


def _lane(
    parent: Element, number: int, kind: str, widths: Sequence[tuple[float, float, float]], ends: tuple[int | None, int | None]
) -> None:
    lane = add(parent, "lane", id=number, type=kind, level="false")
    link = add(lane, "link")
    for tag, other in zip(("predecessor", "successor"), ends, strict=True):
        if other is not None:
            add(link, tag, id=other)
    for s, value, slope in widths:
        add(lane, "width", sOffset=s, a=value, b=slope, c=0.0, d=0.0)


def _junction(root: Element, lane_map: LaneMap) -> None:
    junction = add(root, "junction", name="junction", id=JUNCTION, type="default")
    for k, joint in enumerate(lane_map.joints):
        connection = add(
            junction,
            "connection",
            id=k,
            incomingRoad=ROADS + joint.start,
            connectingRoad=ROADS + joint.by,
            contactPoint="start",
        )
        start, by, _ = joined(lane_map, joint)
        add(connection, "laneLink", **{"from": lane_id(*start[1:]), "to": lane_id(*by[1:])})


Curve3 = tuple[float, ...]  # aU … dU, aV … dV, in the piece's own frame


def _pieces(reference: Floats) -> Iterator[tuple[float, Curve3 | None]]:
    """Yield length [m] and curve of each piece between two points of a reference line (M, 3); None is a straight line."""
    for (x0, y0, yaw0), (x1, y1, yaw1) in pairwise(reference):
        cos, sin = float(np.cos(yaw0)), float(np.sin(yaw0))
        u = float((x1 - x0) * cos + (y1 - y0) * sin)
        v = float((y1 - y0) * cos - (x1 - x0) * sin)
        turn = float(wrap_angle(np.asarray(yaw1 - yaw0)))
        chord = float(np.hypot(u, v))
        if abs(turn) < STRAIGHT and abs(v) < STRAIGHT * chord:
            yield chord, None
            continue
        half = turn / 2.0
        reach = chord if abs(half) < 1e-6 else chord * half / float(np.sin(half))  # that of a circle's arc
        end_u, end_v = reach * float(np.cos(turn)), reach * float(np.sin(turn))
        curve = (
            0.0, reach, 3.0 * u - 2.0 * reach - end_u, -2.0 * u + reach + end_u,
            0.0, 0.0, 3.0 * v - end_v, -2.0 * v + end_v,
        )  # fmt: skip
        yield _length(curve), curve


def _length(curve: Curve3) -> float:
    """Return the length [m] of a cubic for p from 0 to 1."""
    p = 0.5 * (_GAUSS + 1.0)
    du = curve[1] + 2.0 * curve[2] * p + 3.0 * curve[3] * p * p
    dv = curve[5] + 2.0 * curve[6] * p + 3.0 * curve[7] * p * p
    return float(0.5 * _WEIGHTS @ np.hypot(du, dv))


def _merged(
    reference: Floats, pieces: Sequence[tuple[float, Curve3 | None]], station: Floats
) -> Iterator[tuple[float, float, float, float, float, Curve3 | None]]:
    """Yield s, x, y, yaw, length and curve of each geometry: neighbouring straight pieces are one."""
    for straight, run in groupby(range(len(pieces)), lambda k: pieces[k][1] is None):
        members = list(run)
        for group in [members] if straight else [[k] for k in members]:
            first, last = group[0], group[-1]
            x, y, yaw = reference[first].tolist()
            yield (
                float(station[first]),
                x,
                y,
                float(wrap_angle(np.asarray(yaw))),
                float(station[last + 1] - station[first]),
                pieces[first][1],
            )


def _linear(station: Floats, values: Floats) -> Iterator[tuple[float, float, float]]:
    """Yield station, value and slope of each piece of a piecewise linear function; one that goes on as the last is part of it."""
    last = None
    for (s, end), (value, goal) in zip(pairwise(station.tolist()), pairwise(values.tolist()), strict=True):
        if last is not None:
            begin, first, slope = last
            if all(abs(first + slope * (at - begin) - true) < GOES_ON for at, true in ((s, value), (end, goal))):
                continue
        last = s, value, (goal - value) / (end - s)
        yield last
