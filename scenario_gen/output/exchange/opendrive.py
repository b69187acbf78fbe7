# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""OpenDRIVE 1.7: a lane map as a road network.

A strip of a drawn road is a road, and every lane of a map. A lane through a junction from one lane to one other is a connecting
road; where lanes part or meet otherwise there is a direct junction.

The inertial frame is the scenarios' frame, x east, y north. A straight piece of a reference line is a `line`, another one a
`paramPoly3` that meets positions and headings of two points (cubic Hermite, so the line has no kink); widths and the lane offset
are linear between points. The date is that of the template's stamp.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
import math
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from scenario_gen.numerics import Floats, wrap_angle
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.plane import ahead_and_left, angle_between, edge_lengths, unit_left
from scenario_gen.output.exchange.lanes import LaneMap, SIGN_IDS
from scenario_gen.output.exchange.xml import add, comment, date_of, Element, serialized
from scenario_gen.types import CARS, DRIVERS, Lane, LaneNetwork

ROADS, JUNCTION = 1, 1000  # ids: of the first road, and of the first junction
SHORTEST = 1e-6  # metres between two points of a reference line
STRAIGHT = 1e-7  # rad by which the headings of a straight piece may differ
GOES_ON = 1e-5  # metres by which a width or an offset may differ from its linear piece
_LANE_TYPES = {  # and whom they are for, of those that drive
    "sidewalk": frozenset[str](), "biking": frozenset(("bicycle",)), "bus": frozenset(("bus",)),
}  # fmt: skip
_RESTRICTIONS = {"car": "passengerCar", "van": "delivery"}
_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(5)  # on [-1, 1]


class _Place(NamedTuple):
    """Where a lane is: a road, the side of it, from the middle outwards which lane, and whether it runs as the road does."""

    road: int
    side: str
    number: int
    along: bool

    @property
    def lane_id(self) -> int:
        """OpenDRIVE's id of the lane: negative on the right of the reference line, positive on the left, from 1 outwards."""
        return (self.number + 1) * (-1 if self.side == "right" else 1)

    def contact(self, *, end: bool) -> str:
        """Which end of its road the lane's end, or its begin, is."""
        return "end" if end == self.along else "start"


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
        order = ("right", "left") if right else ("left", "right")
        named = dict(zip(order, (along, against), strict=True))
        first = lanes[along[0]]
        if len(along) + len(against) == 1:
            apart = np.concatenate(([True], edge_lengths(first.centre) > SHORTEST))
            line = Curve.through(first.centre[apart]).points
            width = np.abs(((first.left - first.right)[apart] * unit_left(line[:, 2])).sum(axis=1))
            offset = (0.5 if right else -0.5) * width
            return cls(
                named,
                line,
                offset,
                dict(zip(order, (width[None], np.zeros((0, len(width)))), strict=True)),
            )
        across = first.left - first.right
        yaw = np.unwrap(np.arctan2(-across[:, 0], across[:, 1]))
        widths = [
            np.stack([_width(lanes[k]) for k in side]) if side else np.zeros((0, len(yaw)))
            for side in (along, against)
        ]
        reference = np.column_stack((first.left if right else first.right, yaw))
        return cls(
            named,
            reference,
            np.zeros(len(yaw)),
            dict(zip(order, (widths[0], widths[1][:, ::-1]), strict=True)),
        )


def _width(lane: Lane) -> Floats:
    return np.asarray(np.hypot(*(lane.left - lane.right).T))


def connecting(network: LaneNetwork) -> dict[int, str]:
    """Return the lanes that can be connecting roads, with their junctions.

    Each joins one lane to one other, and all that part or meet with it are such lanes of the same junction.
    """
    before, lanes = network.predecessors, network.lanes
    ways = {
        k: lane.junction
        for k, lane in enumerate(lanes)
        if lane.junction and len(before[k]) == len(lane.successors) == 1
    }
    while True:
        mixed = [
            k
            for k, junction in ways.items()
            if before[k][0] in ways
            or lanes[k].successors[0] in ways
            or any(
                ways.get(n) != junction
                for n in (*lanes[before[k][0]].successors, *before[lanes[k].successors[0]])
            )
        ]
        if not mixed:
            return ways
        for k in mixed:
            del ways[k]


def _with_crossings_alone(network: LaneNetwork) -> LaneNetwork:
    """Return a network in which crossings, that are objects beside the lanes, lead nowhere and nothing leads there."""
    links = [
        () if lane.crossing else [k for k in lane.successors if not network.lanes[k].crossing]
        for lane in network.lanes
    ]
    return replace(
        network,
        lanes=tuple(
            replace(lane, successors=tuple(own))
            for lane, own in zip(network.lanes, links, strict=True)
        ),
    )


class _Network:
    """The roads of a lane map, and how their lanes are joined.

    Attributes:
        strips: the roads.
        places: of each lane.
        users: of each lane.
        crossings: of each road, the lanes that are crossings of it.
        ways: the lanes that are connecting roads, with their junctions.
        ends: of a road's end ("start" or "end") the attributes of its link.
        beyond: of a lane's end (True) or begin the id of the lane that it joins on another road.
        connections: of each junction: which lane leads into which, and what the second one's road is called.
    """

    def __init__(self, lane_map: LaneMap) -> None:
        network = _with_crossings_alone(lane_map.network)
        strips = lane_map.strips
        self.strips = [_Strip.of(lane_map, *strip) for strip in strips]
        self.places = {
            k: _Place(n, side, m, k in strips[n][0])
            for n, strip in enumerate(self.strips)
            for side, lanes in strip.lanes.items()
            for m, k in enumerate(lanes)
        }
        self.users = [lane.users for lane in network.lanes]
        self.crossings: dict[int, list[int]] = defaultdict(list)
        for k, lane in enumerate(network.lanes):
            if lane.crossing:
                middle = lane.outline.mean(axis=0)
                away = [
                    float(np.hypot(*(strip.reference[:, :2] - middle).T).min())
                    for strip in self.strips
                ]
                self.crossings[int(np.argmin(away))].append(k)
        self.ways = connecting(network)
        self.ends: dict[tuple[int, str], dict[str, str | float]] = {}
        self.beyond: dict[tuple[int, bool], int] = {}
        self.connections: dict[int, list[tuple[int, int, str]]] = {}
        self.numbers = {
            name: JUNCTION + n for n, name in enumerate(dict.fromkeys(self.ways.values()))
        }
        direct = []
        for k, goal in [
            (k, goal) for k, lane in enumerate(network.lanes) for goal in lane.successors
        ]:
            if goal in self.ways:
                self._connect(k, goal, self.numbers[self.ways[goal]], "connectingRoad")
            elif k in self.ways:
                self._join(k, goal)
                self._lead(goal, self.numbers[self.ways[k]], end=False)
            elif len(network.lanes[k].successors) == len(network.predecessors[goal]) == 1:
                self._join(k, goal)
                self._join(goal, k, end=False)
            else:
                direct.append((k, goal))
        if direct:
            count, ends = (
                len(network.lanes),
                np.array(direct).T + np.array([[0], [len(network.lanes)]]),
            )
            _, part = connected_components(
                coo_array((np.ones(len(direct)), tuple(ends)), (2 * count, 2 * count)),
                directed=False,
            )
            for k, goal in direct:
                number = JUNCTION + len(self.numbers) + int(part[k])
                self._connect(k, goal, number, "linkedRoad")

    def _connect(self, k: int, goal: int, number: int, kind: str) -> None:
        """Note that a lane leads into another one in a junction."""
        self.connections.setdefault(number, []).append((k, goal, kind))
        self._lead(k, number, end=True)
        if kind == "linkedRoad":
            self._lead(goal, number, end=False)
        else:
            self._join(goal, k, end=False)

    def _lead(self, k: int, number: int, *, end: bool) -> None:
        """Note that a lane's end, or its begin, lies at a junction."""
        place = self.places[k]
        self.ends[place.road, place.contact(end=end)] = {
            "elementType": "junction",
            "elementId": number,
        }

    def _join(self, k: int, other: int, *, end: bool = True) -> None:
        """Note that a lane's end, or its begin, lies at another one's begin or end."""
        place, there = self.places[k], self.places[other]
        link: dict[str, str | float] = {
            "elementType": "road",
            "elementId": ROADS + there.road,
            "contactPoint": there.contact(end=not end),
        }
        self.ends[place.road, place.contact(end=end)] = link
        self.beyond[k, end] = there.lane_id


def write_opendrive(lane_map: LaneMap, name: str, start_ns: int) -> bytes:
    """Return a lane map as the bytes of an OpenDRIVE file.

    Args:
        lane_map: all lanes.
        name: of the network, for people.
        start_ns: stamp whose day is the file's date.
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
    network = _Network(lane_map)
    for n in range(len(network.strips)):
        _road(root, lane_map, network, n)
    for number, connections in network.connections.items():
        _junction(root, network, number, connections)
    return serialized(root)


def _road(root: Element, lane_map: LaneMap, network: _Network, n: int) -> None:
    strip, lanes = network.strips[n], lane_map.network.lanes
    pieces = list(_pieces(strip.reference))
    station = np.concatenate([[0.0], np.cumsum([piece[0] for piece in pieces])])
    members = [k for side in strip.lanes.values() for k in side]
    junction = next((network.numbers[network.ways[k]] for k in members if k in network.ways), -1)
    rule = "RHT" if lane_map.side == "right" else "LHT"
    name = ", ".join(lanes[k].id for k in members)
    road = add(
        root,
        "road",
        name=name,
        length=float(station[-1]),
        id=ROADS + n,
        junction=junction,
        rule=rule,
    )
    link = add(road, "link")
    for tag, contact in (("predecessor", "start"), ("successor", "end")):
        if (n, contact) in network.ends:
            add(link, tag, **network.ends[n, contact])
    limit = max(lanes[k].speed_limit for k in members)
    speed: dict[str, str | float] = (
        {"max": "no limit"} if math.isnan(limit) else {"max": limit, "unit": "m/s"}
    )
    add(add(road, "type", s=0.0, type="town"), "speed", **speed)
    view = add(road, "planView")
    for s, x, y, yaw, length, curve in _merged(strip.reference, pieces, station):
        geometry = add(view, "geometry", s=s, x=x, y=y, hdg=yaw, length=length)
        if curve is None:
            add(geometry, "line")
        else:
            names = ("aU", "bU", "cU", "dU", "aV", "bV", "cV", "dV")
            add(
                geometry, "paramPoly3", **dict(zip(names, curve, strict=True)), pRange="normalized"
            )
    group = add(road, "lanes")
    for s, value, slope in _linear(station, strip.offset):
        add(group, "laneOffset", s=s, a=value, b=slope, c=0.0, d=0.0)
    section = add(group, "laneSection", s=0.0)
    for side in ("left", "center", "right"):
        if side == "center":
            add(add(add(section, side), "lane", id=0, type="none", level="false"), "link")
        elif len(strip.lanes[side]):
            parent, order = add(section, side), range(len(strip.lanes[side]))
            for m in order if side == "right" else order[::-1]:  # from left to right
                _lane(
                    parent, network, strip.lanes[side][m], _linear(station, strip.widths[side][m])
                )
    if network.crossings[n]:
        _crosswalks(
            add(road, "objects"), lane_map.network, strip.reference, station, network.crossings[n]
        )
    _signals(road, lane_map.network, strip, station, network.places)


def _lane(
    parent: Element, network: _Network, k: int, widths: Iterable[tuple[float, float, float]]
) -> None:
    place = network.places[k]
    users = network.users[k] or DRIVERS
    lane = add(parent, "lane", id=place.lane_id, type=_lane_type(users), level="false")
    link = add(lane, "link")
    for tag, end in (("predecessor", not place.along), ("successor", place.along)):
        if (k, end) in network.beyond:
            add(link, tag, id=network.beyond[k, end])
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
    """Return the type of a lane, by who may use it."""
    return next((kind for kind, own in _LANE_TYPES.items() if users & DRIVERS <= own), "driving")


def _crosswalks(
    road: Element, network: LaneNetwork, reference: Floats, station: Floats, own: Sequence[int]
) -> None:
    """Append the crossings that lie at a road, as objects with an outline in their own frame."""
    for k in own:
        lane = network.lanes[k]
        n = int(np.argmin(np.hypot(*(reference[:, :2] - lane.outline.mean(axis=0)).T)))
        ahead, left = ahead_and_left(lane.outline - reference[n, :2], float(reference[n, 2]))
        t = float(left.mean())
        walk = add(
            road, "object", id=k, type="crosswalk", name=lane.id, s=float(station[n]), t=t, zOffset=0.0, orientation="none",
            hdg=0.0, pitch=0.0, roll=0.0, length=float(np.ptp(ahead)), width=float(np.ptp(left)), height=0.0,
        )  # fmt: skip
        outline = add(add(walk, "outlines"), "outline", id=0, closed="true")
        for u, v in zip(ahead.tolist(), (left - t).tolist(), strict=True):
            add(outline, "cornerLocal", u=u, v=v, z=0.0, height=0.0)


def _signals(
    road: Element,
    network: LaneNetwork,
    strip: _Strip,
    station: Floats,
    places: Mapping[int, _Place],
) -> None:
    """Append the signs for the traffic of a road, where their stop lines are, or at its end."""
    members, group = [k for side in strip.lanes.values() for k in side], None
    for n, rule in enumerate(network.rules, 1):
        own = [places[k] for k in members if k in rule.lanes]
        if not own or rule.kind not in SIGN_IDS:
            continue
        group = add(road, "signals") if group is None else group
        at = (
            rule.line.mean(axis=0)
            if len(rule.line)
            else strip.reference[-1 if own[0].along else 0, :2]
        )
        s = float(station[int(np.argmin(np.hypot(*(strip.reference[:, :2] - at).T)))])
        sign = {
            "type": SIGN_IDS[rule.kind],
            "subtype": "-1",
            "country": "DE",
            "name": rule.id,
            "dynamic": "no",
        }
        heading = {"orientation": "+" if own[0].along else "-", "zOffset": 2.0}
        signal = add(group, "signal", id=f"{n}.{own[0].road}", s=s, t=0.0, **sign, **heading)
        numbers = [place.lane_id for place in own]
        add(signal, "validity", fromLane=min(numbers), toLane=max(numbers))


def _junction(
    root: Element, network: _Network, number: int, connections: Sequence[tuple[int, int, str]]
) -> None:
    kind = "default" if connections[0][2] == "connectingRoad" else "direct"
    junction = add(root, "junction", name=f"junction {number}", id=number, type=kind)
    for n, (k, goal, tag) in enumerate(connections):
        start, by = network.places[k], network.places[goal]
        roads = {"incomingRoad": ROADS + start.road, tag: ROADS + by.road}
        connection = add(junction, "connection", id=n, **roads, contactPoint=by.contact(end=False))
        add(connection, "laneLink", **{"from": start.lane_id, "to": by.lane_id})


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
    for (s, end), (value, goal) in zip(
        pairwise(station.tolist()), pairwise(values.tolist()), strict=True
    ):
        if last is not None:
            begin, first, slope = last
            if all(
                abs(first + slope * (at - begin) - true) < GOES_ON
                for at, true in ((s, value), (end, goal))
            ):
                continue
        last = s, value, (goal - value) / (end - s)
        yield last
