# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""OpenDRIVE 1.7: a lane map as a road network.

Each strip of a drawn road, and each lane of a map, becomes a road. A lane through a junction that
joins one lane to one other lane becomes a connecting road; all other splits and merges become
direct junctions.

The inertial frame is the frame of the scenarios, x east, y north. A straight piece of a reference
line is a `line`; any other piece is a `paramPoly3` that interpolates the positions and headings of
two points (cubic Hermite, without kinks). Widths and lane offsets are linear between points. The
date is the date of the template's stamp.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby, pairwise
import math
from typing import NamedTuple

import numpy as np

from scenario_gen.numerics import Floats, running_sum
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.plane import ahead_and_left, angle_between
from scenario_gen.output.exchange.lanes import LaneMap, SIGN_IDS
from scenario_gen.output.exchange.opendrive_network import (
    FIRST_ROAD_ID,
    Place,
    RoadNetwork,
    Strip,
)
from scenario_gen.output.exchange.xml import add, comment, date_of, Element, serialized
from scenario_gen.types import CARS, DRIVERS, LaneNetwork, OBSTACLE_HEIGHT_M, RuleKind, TrafficRule

_SIGNALS = {**SIGN_IDS, RuleKind.TRAFFIC_LIGHT: "1000001"}
"""Types of signals; that of a light is OpenDRIVE's."""
STRAIGHT_TOLERANCE_RAD = 1e-7  # heading change of a straight piece
STOP_LINE_M = 0.5  # thickness
LINEAR_TOLERANCE_M = 1e-5  # deviation of a width or an offset from its linear piece
_LANE_TYPES = {  # with the drivers that may use them
    "sidewalk": frozenset[str](),
    "biking": frozenset(("bicycle",)),
    "bus": frozenset(("bus",)),
}
_RESTRICTIONS = {"car": "passengerCar", "van": "delivery"}
_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(5)  # on [-1, 1]


def write_opendrive(lane_map: LaneMap, name: str, start_ns: int) -> bytes:
    """Return a lane map as the bytes of an OpenDRIVE file.

    Args:
        lane_map: all lanes.
        name: name of the network, for people.
        start_ns: stamp [ns] whose day is the file's date.
    """
    root = Element("OpenDRIVE")
    (west, south), (east, north) = lane_map.network.box.tolist()
    about = {
        "revMajor": "1",
        "revMinor": "7",
        "name": name,
        "version": "1.00",
        "date": date_of(start_ns),
    }
    add(
        root,
        "header",
        **about,
        north=north,
        south=south,
        east=east,
        west=west,
        vendor="scenario_gen",
    )
    comment(root, f"lanes: {lane_map.origin}")
    network = RoadNetwork(lane_map)
    for n in range(len(network.strips)):
        _road(root, lane_map, network, n)
    for number, connections in network.connections.items():
        _junction(root, network, number, connections)
    return serialized(root)


def _road(root: Element, lane_map: LaneMap, network: RoadNetwork, n: int) -> None:
    """Append road `n` with its links, geometry, lanes, crossings and signs."""
    strip, lanes = network.strips[n], lane_map.network.lanes
    pieces = list(_pieces(strip.reference))
    station = running_sum([piece[0] for piece in pieces])
    members = [k for side in strip.lanes.values() for k in side]
    connecting_lanes = [k for k in members if k in network.connecting]
    junction = -1
    if connecting_lanes:
        junction = network.numbers[network.connecting[connecting_lanes[0]]]
    rule = "RHT" if lane_map.side == "right" else "LHT"
    name = ", ".join(lanes[k].id for k in members)
    road = add(
        root,
        "road",
        name=name,
        length=float(station[-1]),
        id=FIRST_ROAD_ID + n,
        junction=junction,
        rule=rule,
    )
    link = add(road, "link")
    for tag, contact in (("predecessor", "start"), ("successor", "end")):
        if (n, contact) in network.road_links:
            add(link, tag, **network.road_links[n, contact])
    limit = max(lanes[k].speed_limit for k in members)
    speed: dict[str, str | float] = (
        {"max": "no limit"} if math.isnan(limit) else {"max": limit, "unit": "m/s"}
    )
    add(add(road, "type", s=0.0, type="town"), "speed", **speed)
    view = add(road, "planView")
    for geometry in _merged(strip.reference, pieces, station):
        _geometry(view, geometry)
    _lane_section(road, network, strip, station)
    lines = _stop_lines(network, n, station)
    if objects := [*_crosswalks(network, n, station), *_obstacles(network, n, station), *lines]:
        add(road, "objects").extend(objects)
    _signals(road, lane_map.network, strip, station, network.places)


def _geometry(view: Element, piece: "_Geometry") -> None:
    """Append a piece of a reference line: a line, or a parametric cubic."""
    geometry = add(
        view, "geometry", s=piece.s, x=piece.x, y=piece.y, hdg=piece.yaw, length=piece.length
    )
    if piece.curve is None:
        add(geometry, "line")
        return
    names = ("aU", "bU", "cU", "dU", "aV", "bV", "cV", "dV")
    coefficients = dict(zip(names, piece.curve, strict=True))
    add(geometry, "paramPoly3", **coefficients, pRange="normalized")


def _lane_section(road: Element, network: RoadNetwork, strip: Strip, station: Floats) -> None:
    """Append the lane offset and the lanes of a road, from left to right."""
    group = add(road, "lanes")
    for s, value, slope in _linear(station, strip.offset):
        add(group, "laneOffset", s=s, a=value, b=slope, c=0.0, d=0.0)
    section = add(group, "laneSection", s=0.0)
    for side in ("left", "center", "right"):
        if side == "center":
            add(add(add(section, side), "lane", id=0, type="none", level="false"), "link")
        elif len(strip.lanes[side]):
            parent = add(section, side)
            order = range(len(strip.lanes[side]))
            for m in order if side == "right" else order[::-1]:
                widths = _linear(station, strip.widths[side][m])
                _lane(parent, network, strip.lanes[side][m], widths)


def _lane(
    parent: Element, network: RoadNetwork, k: int, widths: Iterable[tuple[float, float, float]]
) -> None:
    """Append lane `k` with its links, widths and users."""
    place = network.places[k]
    users = network.users[k] or DRIVERS
    lane = add(parent, "lane", id=place.lane_id, type=_lane_type(users), level="false")
    link = add(lane, "link")
    for tag, end in (("predecessor", not place.along), ("successor", place.along)):
        if (k, end) in network.lane_links:
            add(link, tag, id=network.lane_links[k, end])
    for s, value, slope in widths:
        add(lane, "width", sOffset=s, a=value, b=slope, c=0.0, d=0.0)
    if _lane_type(users) == "driving":
        for user in sorted(DRIVERS - users if users >= CARS else users):
            add(
                lane,
                "access",
                sOffset=0.0,
                rule="deny" if users >= CARS else "allow",
                restriction=_RESTRICTIONS.get(user, user),
            )


def _lane_type(users: frozenset[str]) -> str:
    """Return the type of a lane, from its users."""
    for kind, drivers in _LANE_TYPES.items():
        if users & DRIVERS <= drivers:
            return kind
    return "driving"


def _crosswalks(network: RoadNetwork, n: int, station: Floats) -> Iterator[Element]:
    """Yield the crossings of a road as objects, with an outline in the object's frame."""
    reference = network.strips[n].reference
    for k in network.crossings[n]:
        lane = network.network.lanes[k]
        nearest = int(np.argmin(np.hypot(*(reference[:, :2] - lane.outline.mean(axis=0)).T)))
        pose = reference[nearest]
        ahead, left = ahead_and_left(lane.outline - pose[:2], float(pose[2]))
        t = float(left.mean())
        size = {"length": float(np.ptp(ahead)), "width": float(np.ptp(left)), "height": 0.0}
        walk = _object(k, "crosswalk", lane.id, s=float(station[nearest]), t=t, hdg=0.0, **size)
        outline = add(walk, "outlines/outline", id=0, closed="true")
        for u, v in zip(ahead.tolist(), (left - t).tolist(), strict=True):
            add(outline, "cornerLocal", u=u, v=v, z=0.0, height=0.0)
        yield walk


def _obstacles(network: RoadNetwork, n: int, station: Floats) -> Iterator[Element]:
    """Yield the obstacles that are nearest to a road as objects."""
    curve = Curve(network.strips[n].reference)
    for number in network.obstacles[n]:
        obstacle = network.network.obstacles[number]
        along, left = curve.project(np.array([obstacle[:2]]))
        yield _object(
            len(network.network.lanes) + number,
            "obstacle",
            "parked car" if obstacle.is_car else "obstacle",
            s=float(np.interp(along[0], curve.station, station)),
            t=float(left[0]),
            hdg=angle_between(obstacle.yaw, float(curve.at(along)[0, 2])),
            length=obstacle.length,
            width=obstacle.width,
            height=OBSTACLE_HEIGHT_M,
        )


def _stop_lines(network: RoadNetwork, n: int, station: Floats) -> Iterator[Element]:
    """Yield the stop lines of the signs and lights of a road as objects."""
    strip = network.strips[n]
    members = {k for side in strip.lanes.values() for k in side}
    curve = Curve(strip.reference)
    first = len(network.network.lanes) + len(network.network.obstacles)
    for number, rule in enumerate(network.network.rules):
        if len(rule.line) and members & set(rule.lanes):
            along, left = curve.project(rule.line[[0, -1]])
            size = {"length": STOP_LINE_M, "width": abs(float(left[1] - left[0])), "height": 0.0}
            yield _object(
                first + number,
                "roadMark",
                "stop line",
                s=float(np.interp(along.mean(), curve.station, station)),
                t=float(left.mean()),
                hdg=0.0,
                **size,
            )


def _object(number: int, kind: str, name: str, **attributes: float) -> Element:
    """Return an object that stands on the ground."""
    about = {"type": kind, "name": name, "orientation": "none"}
    upright = {"zOffset": 0.0, "pitch": 0.0, "roll": 0.0}
    return add(Element("objects"), "object", id=number, **about, **upright, **attributes)


def _signals(
    road: Element,
    network: LaneNetwork,
    strip: Strip,
    station: Floats,
    places: Mapping[int, Place],
) -> None:
    """Append the signs and lights of a road at their stop lines, or else at its end."""
    members = [k for side in strip.lanes.values() for k in side]
    curve = Curve(strip.reference)
    for n, rule in enumerate(network.rules):
        lanes = [places[k] for k in members if k in rule.lanes]
        if lanes and rule.kind in _SIGNALS:
            group = road.find("signals")
            group = add(road, "signals") if group is None else group
            _signal(group, n, rule, lanes, curve, station)


def _signal(
    group: Element,
    number: int,
    rule: TrafficRule,
    lanes: Sequence[Place],
    curve: Curve,
    station: Floats,
) -> None:
    """Append the sign or light of a rule for some lanes of a road.

    Args:
        group: the signals of the road.
        number: of the rule.
        rule: the rule.
        lanes: the lanes.
        curve: reference line of the road.
        station: (K,) [m] arc lengths in the file of the points of `curve`.
    """
    first = lanes[0]
    position = curve.points[-1 if first.along else 0, :2]
    if len(rule.line):
        position = rule.line.mean(axis=0)
    (along,) = curve.project(position[None])[0]
    is_light = rule.kind is RuleKind.TRAFFIC_LIGHT
    signal = add(
        group,
        "signal",
        id=_signal_id(number, first),
        s=float(np.interp(along, curve.station, station)),
        t=0.0,
        type=_SIGNALS[rule.kind],
        subtype="-1",
        country="OpenDRIVE" if is_light else "DE",
        name=rule.id,
        dynamic="yes" if is_light else "no",
        orientation="+" if first.along else "-",
        zOffset=2.0,
    )
    numbers = [place.lane_id for place in lanes]
    add(signal, "validity", fromLane=min(numbers), toLane=max(numbers))
    if is_light:
        yaw = float(curve.at(along)[2]) + (0.0 if first.along else np.pi)
        x, y = position.tolist()
        add(signal, "positionInertial", x=x, y=y, z=2.0, hdg=yaw, pitch=0.0, roll=0.0)


def _signal_id(rule: int, place: Place) -> str:
    """Return the id of the signal of a rule on the road of a lane."""
    return f"{rule + 1}.{place.road}"


def signal_ids(lane_map: LaneMap, rule: int) -> list[str]:
    """Return the ids of the signals of a rule, one for each of its roads."""
    places = RoadNetwork(lane_map).places
    lanes = lane_map.network.rules[rule].lanes
    return list(dict.fromkeys(_signal_id(rule, places[k]) for k in lanes if k in places))


def _junction(
    root: Element, network: RoadNetwork, number: int, connections: Sequence[tuple[int, int, str]]
) -> None:
    """Append a junction with its connections and lane links."""
    kind = "default" if connections[0][2] == "connectingRoad" else "direct"
    junction = add(root, "junction", name=f"junction {number}", id=number, type=kind)
    for n, (k, goal, tag) in enumerate(connections):
        start = network.places[k]
        end = network.places[goal]
        roads = {"incomingRoad": FIRST_ROAD_ID + start.road, tag: FIRST_ROAD_ID + end.road}
        contact = end.contact(end=False)
        connection = add(junction, "connection", id=n, **roads, contactPoint=contact)
        add(connection, "laneLink", **{"from": start.lane_id, "to": end.lane_id})


Curve3 = tuple[float, ...]  # aU … dU, aV … dV, in the frame of the piece


class _Geometry(NamedTuple):
    """A piece of a reference line: its start, length [m] and curve; None is a straight line."""

    s: float
    x: float
    y: float
    yaw: float
    length: float
    curve: Curve3 | None


def _pieces(reference: Floats) -> Iterator[tuple[float, Curve3 | None]]:
    """Yield the length [m] and curve of each piece of a reference line (M, 3).

    The curve of a straight piece is None.
    """
    for (x0, y0, yaw0), (x1, y1, yaw1) in pairwise(reference):
        cos, sin = float(np.cos(yaw0)), float(np.sin(yaw0))
        u = float((x1 - x0) * cos + (y1 - y0) * sin)
        v = float((y1 - y0) * cos - (x1 - x0) * sin)
        turn = angle_between(yaw1, yaw0)
        chord = float(np.hypot(u, v))
        if abs(turn) < STRAIGHT_TOLERANCE_RAD and abs(v) < STRAIGHT_TOLERANCE_RAD * chord:
            yield chord, None
            continue
        half = turn / 2.0
        reach = (
            chord if abs(half) < 1e-6 else chord * half / float(np.sin(half))
        )  # that of a circle's arc
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
) -> Iterator[_Geometry]:
    """Yield the pieces of a reference line; consecutive straight pieces are merged."""
    for straight, run in groupby(range(len(pieces)), lambda k: pieces[k][1] is None):
        members = list(run)
        for group in [members] if straight else [[k] for k in members]:
            first, last = group[0], group[-1]
            x, y, yaw = reference[first].tolist()
            yield _Geometry(
                float(station[first]),
                x,
                y,
                angle_between(yaw, 0.0),
                float(station[last + 1] - station[first]),
                pieces[first][1],
            )


def _linear(station: Floats, values: Floats) -> Iterator[tuple[float, float, float]]:
    """Yield station, value and slope of each piece of a piecewise linear function.

    A piece that continues the previous one is merged with it.
    """
    last = None
    for (s, end), (value, goal) in zip(
        pairwise(station.tolist()), pairwise(values.tolist()), strict=True
    ):
        if last is not None:
            begin, first, slope = last
            if all(
                abs(first + slope * (x - begin) - y) < LINEAR_TOLERANCE_M
                for x, y in ((s, value), (end, goal))
            ):
                continue
        last = s, value, (goal - value) / (end - s)
        yield last
