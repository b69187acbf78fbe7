# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""OpenDRIVE 1.7: a lane map as a road network. A strip is a road, a way through the junction a connecting road.

The inertial frame is the scenarios' frame, x east, y north. A straight piece of a reference line is a `line`, another one a
`paramPoly3` that meets positions and headings of two points (cubic Hermite, so the line has no kink); widths and the lane offset
are linear between points. The date is that of the template's stamp.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, UTC
from itertools import groupby, pairwise

import numpy as np

from scenario_gen.numerics import Floats, wrap_angle
from scenario_gen.numerics.plane import angle_between
from scenario_gen.output.exchange.lanes import LaneMap
from scenario_gen.output.exchange.xml import add, comment, Element, serialized
from scenario_gen.types import Lane

ROADS, JUNCTION = 1, 1000  # ids: of the first road, and of the junction
STRAIGHT = 1e-7  # rad by which the headings of a straight piece may differ
GOES_ON = 1e-5  # metres by which a width or an offset may differ from its linear piece
_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(5)  # on [-1, 1]


@dataclass(frozen=True, eq=False)
class _Strip:
    """Lanes side by side, as a road of OpenDRIVE.

    Attributes:
        lanes: the lanes on the "right" of the reference line and on the "left", from the middle outwards.
        reference: (M, 3) x [m], y [m], yaw [rad, unwrapped].
        offset: metres by which the line between left and right lanes lies to the left of the reference line.
        widths: (L, M) metres, of the lanes of each side.
    """

    lanes: dict[str, tuple[int, ...]]
    reference: Floats
    offset: Floats
    widths: dict[str, Floats]

    @classmethod
    def of(cls, lane_map: LaneMap, along: tuple[int, ...], against: tuple[int, ...]) -> "_Strip":
        """Return a strip about the line between its directions, or the middle of its only lane; it runs as `along` does."""
        lanes, right = lane_map.network.lanes, lane_map.side == "right"
        first = lanes[along[0]]
        across = first.left - first.right
        yaw = np.unwrap(np.arctan2(-across[:, 0], across[:, 1]))
        widths = [np.stack([_width(lanes[k]) for k in side]) if side else np.zeros((0, len(yaw))) for side in (along, against)]
        alone = len(along) + len(against) == 1
        line = first.centre if alone else first.left if right else first.right
        offset = (0.5 if right else -0.5) * widths[0][0] if alone else np.zeros(len(yaw))
        order = ("right", "left") if right else ("left", "right")
        sides = (widths[0], widths[1][:, ::-1])
        named = dict(zip(order, sides, strict=True))
        return cls(dict(zip(order, (along, against), strict=True)), np.column_stack((line, yaw)), offset, named)


def _width(lane: Lane) -> Floats:
    return np.asarray(np.hypot(*(lane.left - lane.right).T))


Place = tuple[int, str, int]
"""A road, a side of it and a lane's place there, from the middle outwards."""


def write_opendrive(lane_map: LaneMap, name: str, start_ns: int) -> bytes:
    """Return a lane map as the bytes of an OpenDRIVE file.

    Args:
        lane_map: all lanes; in the junction of a drawn road each joins one lane to one.
        name: of the network, for people.
        start_ns: stamp whose day is the file's date.
    """
    root = Element("OpenDRIVE")
    (west, south), (east, north) = lane_map.network.box.tolist()
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
    strips = [_Strip.of(lane_map, *strip) for strip in lane_map.strips]
    places = {k: (n, side, m) for n, strip in enumerate(strips) for side, ks in strip.lanes.items() for m, k in enumerate(ks)}
    joints: dict[int, tuple[Place, Place, Place]] = {}  # by road: the lane before, its own, the lane after
    for k, lane in enumerate(lane_map.network.lanes):
        if lane_map.turn(k):
            joints[places[k][0]] = places[lane_map.network.predecessors[k][0]], places[k], places[lane.successors[0]]
    arms = {place[0] for joint in joints.values() for place in (joint[0], joint[2])}
    for n, strip in enumerate(strips):
        _road(root, lane_map, n, strip, joints.get(n), leads_on=n in arms)
    if joints:
        _junction(root, joints)
    return serialized(root)


def lane_id(side: str, place: int) -> int:
    """Return OpenDRIVE's id of a lane: negative on the right of the reference line, positive on the left, from 1 outwards."""
    return (place + 1) * (-1 if side == "right" else 1)


def _road(
    root: Element, lane_map: LaneMap, n: int, strip: _Strip, joint: tuple[Place, Place, Place] | None, *, leads_on: bool
) -> None:
    """Append a road; `joint` says what it connects, None if it is no way through the junction."""
    pieces = list(_pieces(strip.reference))
    station = np.concatenate([[0.0], np.cumsum([piece[0] for piece in pieces])])
    rule = "RHT" if lane_map.side == "right" else "LHT"
    junction = -1 if joint is None else JUNCTION
    name = ", ".join(lane_map.network.lanes[k].id for side in strip.lanes.values() for k in side)
    road = add(root, "road", name=name, length=float(station[-1]), id=ROADS + n, junction=junction, rule=rule)
    link = add(road, "link")
    if joint is not None:
        add(link, "predecessor", elementType="road", elementId=ROADS + joint[0][0], contactPoint="end")
        add(link, "successor", elementType="road", elementId=ROADS + joint[2][0], contactPoint="end")
    elif leads_on:
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
    ends = (None, None) if joint is None else (lane_id(*joint[0][1:]), lane_id(*joint[2][1:]))
    for side in ("left", "center", "right"):
        if side == "center":
            _lane(add(section, side), 0, "none", [], (None, None))
        elif len(strip.lanes[side]):
            parent, order = add(section, side), range(len(strip.lanes[side]))
            for place in order if side == "right" else order[::-1]:  # from left to right
                _lane(parent, lane_id(side, place), "driving", list(_linear(station, strip.widths[side][place])), ends)


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


def _junction(root: Element, joints: Mapping[int, tuple[Place, Place, Place]]) -> None:
    junction = add(root, "junction", name="junction", id=JUNCTION, type="default")
    for k, (start, by, _) in enumerate(joints.values()):
        roads = {"incomingRoad": ROADS + start[0], "connectingRoad": ROADS + by[0]}
        connection = add(junction, "connection", id=k, **roads, contactPoint="start")
        add(connection, "laneLink", **{"from": lane_id(*start[1:]), "to": lane_id(*by[1:])})


Curve3 = tuple[float, ...]  # aU … dU, aV … dV, in the piece's own frame


def _pieces(reference: Floats) -> Iterator[tuple[float, Curve3 | None]]:
    """Yield length [m] and curve of each piece between two points of a reference line (M, 3); None is a straight line."""
    for (x0, y0, yaw0), (x1, y1, yaw1) in pairwise(reference):
        cos, sin = float(np.cos(yaw0)), float(np.sin(yaw0))
        u = float((x1 - x0) * cos + (y1 - y0) * sin)
        v = float((y1 - y0) * cos - (x1 - x0) * sin)
        turn = angle_between(yaw1, yaw0)
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
