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

from collections.abc import Iterator, Sequence
from itertools import groupby, pairwise
from typing import Any, NamedTuple

import numpy as np

from scenario_gen.numerics import ahead_and_left, angle_between, Floats, running_sum
from scenario_gen.numerics.curve import Curve
from scenario_gen.output.exchange.lanes import LaneMap, SIGN_IDS
from scenario_gen.output.exchange.opendrive_network import Place, RoadNetwork
from scenario_gen.output.exchange.xml import date_of, rendered
from scenario_gen.types import CARS, DRIVERS, OBSTACLE_HEIGHT_M, RuleKind, TrafficRule

_SIGNALS = {**SIGN_IDS, RuleKind.TRAFFIC_LIGHT: "1000001"}
"""Types of signals; that of a light is OpenDRIVE's."""
STRAIGHT_TOLERANCE_RAD = 1e-7  # heading change of a straight piece
STOP_LINE_M = 0.5  # thickness
LINEAR_TOLERANCE_M = 1e-4  # deviation of a width or an offset from its linear piece
_LANE_TYPES = {  # with the drivers that may use them
    "sidewalk": frozenset[str](),
    "biking": frozenset(("bicycle",)),
    "bus": frozenset(("bus",)),
}
_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(5)  # on [-1, 1]


def write_opendrive(lane_map: LaneMap, name: str, start_ns: int) -> bytes:
    """Return a lane map as the bytes of an OpenDRIVE file.

    Args:
        lane_map: all lanes.
        name: name of the network, for people.
        start_ns: stamp [ns] whose day is the file's date.
    """
    network = RoadNetwork(lane_map)
    return rendered(
        "opendrive.xml.j2",
        name=name,
        date=date_of(start_ns),
        box=lane_map.network.box.tolist(),
        lane_map=lane_map,
        network=network,
        roads=[_road(network, n) for n in range(len(network.strips))],
        cars=CARS,
        drivers=DRIVERS,
        lane_type=_lane_type,
    )


def _road(network: RoadNetwork, n: int) -> dict[str, Any]:
    """Return the facts of road `n`: links, geometry, lanes, objects and signals."""
    strip, lanes = network.strips[n], network.network.lanes
    pieces = list(_pieces(strip.reference))
    station = running_sum([piece[0] for piece in pieces])
    members = [k for side in strip.lanes.values() for k in side]
    junctions = [network.connecting[k] for k in members if k in network.connecting]
    ends = (("predecessor", "start"), ("successor", "end"))
    line = _Line(Curve(strip.reference), station)
    return {
        "name": ", ".join(lanes[k].id for k in members),
        "length": float(station[-1]),
        "junction": network.numbers[junctions[0]] if junctions else -1,
        "links": [
            (tag, network.road_links[n, end])
            for tag, end in ends
            if (n, end) in network.road_links
        ],
        "limit": max(lanes[k].speed_limit for k in members),
        "pieces": list(_merged(strip.reference, pieces, station)),
        "offset": _linear(station, strip.offset),
        "lanes": {
            side: [
                (k, _linear(station, widths))
                for k, widths in zip(strip.lanes[side], strip.widths[side], strict=True)
            ]
            for side in ("left", "right")
        },
        "objects": [
            *_crosswalks(network, n, station),
            *_obstacles(network, n, line),
            *_stop_lines(network, members, line),
        ],
        "signals": list(_signals(network, members, line)),
    }


class _Line(NamedTuple):
    """The reference line of a road, and (K,) the arc lengths [m] of its points in the file."""

    curve: Curve
    station: Floats

    def s(self, along: float) -> float:
        """Return the arc length in the file at an arc length of the curve [m]."""
        return float(np.interp(along, self.curve.station, self.station))


def _lane_type(users: frozenset[str]) -> str:
    """Return the type of a lane, from its users."""
    for kind, drivers in _LANE_TYPES.items():
        if users & DRIVERS <= drivers:
            return kind
    return "driving"


def _crosswalks(network: RoadNetwork, n: int, station: Floats) -> Iterator[dict[str, Any]]:
    """Yield the crossings of a road as objects, with an outline in the object's frame."""
    reference = network.strips[n].reference
    for k in network.crossings[n]:
        lane = network.network.lanes[k]
        nearest = int(np.argmin(np.hypot(*(reference[:, :2] - lane.outline.mean(axis=0)).T)))
        pose = reference[nearest]
        ahead, left = ahead_and_left(lane.outline - pose[:2], float(pose[2]))
        t = float(left.mean())
        size = (float(np.ptp(ahead)), float(np.ptp(left)), 0.0)
        walk = _object(k, "crosswalk", lane.id, (float(station[nearest]), t, 0.0), size)
        yield walk | {"outline": list(zip(ahead.tolist(), (left - t).tolist(), strict=True))}


def _obstacles(network: RoadNetwork, n: int, line: _Line) -> Iterator[dict[str, Any]]:
    """Yield the obstacles that are nearest to a road as objects."""
    for number in network.obstacles[n]:
        obstacle = network.network.obstacles[number]
        along, left = line.curve.project(np.array([obstacle[:2]]))
        turn = angle_between(obstacle.yaw, float(line.curve.at(along)[0, 2]))
        yield _object(
            len(network.network.lanes) + number,
            "obstacle",
            "parked car" if obstacle.is_car else "obstacle",
            (line.s(along[0]), float(left[0]), turn),
            (obstacle.length, obstacle.width, OBSTACLE_HEIGHT_M),
        )


def _stop_lines(
    network: RoadNetwork, members: Sequence[int], line: _Line
) -> Iterator[dict[str, Any]]:
    """Yield the stop lines of the signs and lights of a road as objects."""
    first = len(network.network.lanes) + len(network.network.obstacles)
    for number, rule in enumerate(network.network.rules):
        if len(rule.line) and set(members) & set(rule.lanes):
            along, left = line.curve.project(rule.line[[0, -1]])
            place = (line.s(along.mean()), float(left.mean()), 0.0)
            size = (STOP_LINE_M, abs(float(left[1] - left[0])), 0.0)
            yield _object(first + number, "roadMark", "stop line", place, size)


def _object(
    number: int,
    kind: str,
    name: str,
    place: tuple[float, float, float],
    size: tuple[float, float, float],
) -> dict[str, Any]:
    """Return an object at s, t [m] and a heading [rad], with length, width and height [m]."""
    placed = dict(zip(("s", "t", "hdg", "length", "width", "height"), place + size, strict=True))
    return {"id": number, "type": kind, "name": name, "outline": (), **placed}


def _signals(
    network: RoadNetwork, members: Sequence[int], line: _Line
) -> Iterator[dict[str, Any]]:
    """Yield the signs and lights of a road at their stop lines, or else at its end."""
    for number, rule in enumerate(network.network.rules):
        lanes = [network.places[k] for k in members if k in rule.lanes]
        if lanes and rule.kind in _SIGNALS:
            yield _signal(number, rule, lanes, line)


def _signal(number: int, rule: TrafficRule, lanes: Sequence[Place], line: _Line) -> dict[str, Any]:
    """Return the sign or light of the rule with a number for some lanes of a road."""
    first = lanes[0]
    position = line.curve.points[-1 if first.along else 0, :2]
    if len(rule.line):
        position = rule.line.mean(axis=0)
    (along,) = line.curve.project(position[None])[0]
    signal = {
        "id": _signal_id(number, first),
        "s": line.s(along),
        "type": _SIGNALS[rule.kind],
        "name": rule.id,
        "along": first.along,
        "lanes": [place.lane_id for place in lanes],
        "pose": None,
    }
    if rule.kind is RuleKind.TRAFFIC_LIGHT:
        yaw = float(line.curve.at(along)[2]) + (0.0 if first.along else np.pi)
        signal["pose"] = (*position.tolist(), yaw)
    return signal


def _signal_id(rule: int, place: Place) -> str:
    """Return the id of the signal of a rule on the road of a lane."""
    return f"{rule + 1}.{place.road}"


def signal_ids(lane_map: LaneMap, rule: int) -> list[str]:
    """Return the ids of the signals of a rule, one for each of its roads."""
    places = RoadNetwork(lane_map).places
    lanes = lane_map.network.rules[rule].lanes
    return list(dict.fromkeys(_signal_id(rule, places[k]) for k in lanes if k in places))


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
