# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""OpenDRIVE maps (.xodr), 1.4 to 1.8: lanes along reference lines, linked from road to road and through junctions.

A lane is named road.section.lane, e.g. 5.0.-1. Elevation and superelevation are left out: the road is seen from above.
Source: ASAM OpenDRIVE 1.8, chapters "Roads", "Lanes" and "Junctions".
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
import math
from pathlib import Path

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.base.markup import Element, read_xml
from scenario_gen.numerics import exact, Floats
from scenario_gen.roads.vector.network import Draft, MOST_LINKS, MOST_SECTIONS, network_of, refuse_too_long, refuse_too_many_lanes
from scenario_gen.roads.vector.plan_view import Cubics, cubics, reference_line, ReferenceLine
from scenario_gen.types import LaneNetwork

_FOR_CARS = frozenset(
    ("driving", "entry", "exit", "onRamp", "offRamp", "connectingRamp", "slipLane", "bidirectional", "mwyEntry", "mwyExit", "HOV")
)
_SPEEDS = {"m/s": 1.0, "km/h": 1.0 / 3.6, "mph": 0.44704}
_STEP = 0.5  # metres between cross-sections
_LINKED = 3.0  # metres between the ends of lanes that are linked, at most
_MARKED = ("solid", "solid solid", "curb", "grass", "botts dots")  # road marks that are not crossed

Key = tuple[str, int, int]  # road, section, lane
End = tuple[Key, int]  # a lane and 0 for its end at lower s, 1 for that at higher s


@dataclass(frozen=True, eq=False)
class _Section:
    """A lane section: its cross-sections and its lanes, by id."""

    s: Floats
    lanes: dict[int, Element]
    edges: dict[int, Floats]  # by lane, its outer border (M, 2); 0: the centre lane


@dataclass(frozen=True, eq=False)
class _Road:
    element: Element
    id: str
    junction: str
    left_hand: bool
    sections: list[_Section] = field(default_factory=list)


def read_opendrive(path: Path) -> LaneNetwork:
    """Return the lanes of an OpenDRIVE map.

    Raises:
        InputError: it is broken or holds no lane that cars may use; names file and line.
    """
    root = read_xml(path, f"map {path}")
    if root.tag != "OpenDRIVE":
        raise InputError(f"{root.place}: the root of an OpenDRIVE map is <OpenDRIVE>")
    header = root.one("header")
    notes = [
        f"OpenDRIVE {header.attributes.get('revMajor', '?')}.{header.attributes.get('revMinor', '?')}: {_projection(header)}"
    ]
    roads: dict[str, _Road] = {}
    total, lanes, points = 0.0, 0, 0
    for element in root.all("road"):
        name = element.get("id")
        if name in roads:
            raise InputError(f"{element.place}: road {name} is there twice, first on line {roads[name].element.line}")
        line = reference_line(element)
        total += line.length
        if total > MOST_SECTIONS * _STEP:
            raise InputError(f"{element.place}: roads of more than {MOST_SECTIONS * _STEP / 1000.0:g} km; cut the map")
        roads[name] = _road(element, name, line)
        lanes += sum(len(section.lanes) for section in roads[name].sections)
        refuse_too_many_lanes(lanes, root.file)
        points += sum(len(section.lanes) * len(section.s) for section in roads[name].sections)
        refuse_too_long(points, root.file)
    if not roads:
        raise InputError(f"map {path}: no <road>")
    joints = _Joints(roads)
    for road in roads.values():
        joints.along(road)
    for junction in root.all("junction"):
        joints.through(junction)
    notes += joints.notes()
    return network_of(path.stem, list(_drafts(roads, joints)), notes)


def _projection(header: Element) -> str:
    reference = header.first("geoReference")
    text = " ".join(reference.text.split()) if reference is not None else ""
    offset = header.first("offset")
    moved = "" if offset is None else f", offset x {offset.number('x', 0.0):g}, y {offset.number('y', 0.0):g} not applied"
    return (
        "coordinates as they stand, in metres; "
        + (f"geoReference {text} is stated, not applied" if text else "no geoReference")
        + moved
    )


def _road(element: Element, name: str, line: ReferenceLine) -> _Road:
    junction = element.attributes.get("junction", "-1")
    road = _Road(element, name, "" if junction == "-1" else junction, element.attributes.get("rule", "RHT") == "LHT")
    lanes = element.one("lanes")
    offset = cubics(lanes.all("laneOffset"), "s")
    sections = sorted(lanes.all("laneSection"), key=lambda section: section.number("s"))
    if not sections:
        raise InputError(f"{lanes.place} has no <laneSection>")
    refuse_too_many_lanes(len(sections), element.file)
    begins = [min(max(section.number("s"), 0.0), line.length) for section in sections]
    for section, begin, end in zip(sections, begins, [*begins[1:], line.length], strict=True):
        breaks = line.begin[np.searchsorted(line.begin, begin, side="right") : np.searchsorted(line.begin, end)]
        s = np.unique(
            np.concatenate((np.linspace(begin, max(end, begin + 1e-3), max(math.ceil((end - begin) / _STEP), 1) + 1), breaks))
        )
        road.sections.append(_section(section, begin, s, line.at(s), offset))
    return road


def _section(section: Element, begin: float, s: Floats, poses: Floats, offset: Cubics) -> _Section:
    normal = np.column_stack((-exact.sin(poses[:, 2]), exact.cos(poses[:, 2])))
    lanes: dict[int, Element] = {}
    edges: dict[int, Floats] = {}
    middle = offset.at(s)
    edges[0] = poses[:, :2] + middle[:, None] * normal
    for side, sign in (("left", 1), ("right", -1)):
        group = section.first(side)
        across = middle
        known = group.all("lane") if group else []
        refuse_too_many_lanes(len(known), section.file)
        refuse_too_long(len(known) * len(s), section.file)
        for count, lane in enumerate(sorted(known, key=lambda lane: sign * _lane_id(lane, sign)), 1):
            name = _lane_id(lane, sign)
            if name != sign * count:
                raise InputError(f"{lane.place}: lane {name} is there twice, or those between it and the centre are missing")
            lanes[name] = lane
            if lane.all("width"):
                across = across + sign * np.maximum(cubics(lane.all("width"), "sOffset").at(s - begin), 0.0)
            elif lane.all("border"):
                across = cubics(lane.all("border"), "sOffset").at(s - begin) + middle
            edges[name] = poses[:, :2] + across[:, None] * normal
    return _Section(s, lanes, edges)


def _lane_id(lane: Element, sign: int) -> int:
    try:
        number = int(lane.get("id"))
    except ValueError:
        number = 0
    if number * sign <= 0:
        raise InputError(
            f"{lane.place}: id {lane.get('id')[:20]!r}; whole numbers {'above' if sign > 0 else 'below'} 0 are needed here"
        )
    return number


class _Joints:
    """Which ends of lanes are joined: by links between sections and roads, and by the connections of junctions."""

    def __init__(self, roads: dict[str, _Road]) -> None:
        self.roads = roads
        self.of: dict[End, list[End]] = {}
        self.apart = 0
        self.first = ""

    def notes(self) -> list[str]:
        """Say what was not believed."""
        if not self.apart:
            return []
        return [
            f"{self.apart} links join lanes whose ends are more than {_LINKED:g} m apart and were left out, first at {self.first}"
        ]

    def point(self, end: End) -> Floats:
        """(2,) [m] the middle of a lane at one of its ends."""
        (road, section, lane), at = end
        edges = self.roads[road].sections[section].edges
        inner = lane - (1 if lane > 0 else -1)
        k = -1 if at else 0
        return np.asarray((edges[lane][k] + edges[inner][k]) / 2.0)

    def known(self, end: End) -> bool:
        """Whether there is such a lane."""
        (road, section, lane), _ = end
        return lane in self.roads[road].sections[section].lanes

    def join(self, a: End, b: End, place: str) -> None:
        """Join two ends, if they are there and near each other."""
        if not (self.known(a) and self.known(b)):
            return
        if float(exact.hypot(*(self.point(a) - self.point(b)))) > _LINKED:
            self.apart += 1
            self.first = self.first or place
            return
        for one, other in ((a, b), (b, a)):
            if other not in self.of.setdefault(one, []):
                self.of[one].append(other)
                if len(self.of[one]) > MOST_LINKS:
                    raise InputError(f"{place}: more than {MOST_LINKS} lanes are joined to lane {_name(one[0])}")

    def along(self, road: _Road) -> None:
        """Join a road's sections, and it to the roads before and after it."""
        last = len(road.sections) - 1
        for k, section in enumerate(road.sections):
            for name, lane in section.lanes.items():
                for tag, at in (("predecessor", 0), ("successor", 1)):
                    for link in [found for group in lane.all("link") for found in group.all(tag)]:
                        other = int(link.number("id"))
                        end: End = ((road.id, k, name), at)
                        if 0 <= k + (1 if at else -1) <= last:
                            self.join(end, ((road.id, k + (1 if at else -1), other), 1 - at), link.place)
                        else:
                            self._to_road(road, end, tag, other)

    def _to_road(self, road: _Road, end: End, tag: str, lane: int) -> None:
        link = road.element.first("link", tag)
        if link is None or link.attributes.get("elementType") != "road":
            return
        other = self.road(link, "elementId")
        contact = link.attributes.get("contactPoint", "start")
        self.join(end, self.end_of(other, contact, lane), link.place)

    def road(self, link: Element, name: str) -> _Road:
        """The road that an attribute names.

        Raises:
            InputError: there is none of that id.
        """
        if link.get(name) not in self.roads:
            raise InputError(f"{link.place}: road {link.get(name)[:40]!r} is not in the map")
        return self.roads[link.get(name)]

    @staticmethod
    def end_of(road: _Road, contact: str, lane: int) -> End:
        """The end of a lane at a road's start or end."""
        at = 1 if contact == "end" else 0
        return (road.id, len(road.sections) - 1 if at else 0, lane), at

    def through(self, junction: Element) -> None:
        """Join incoming lanes to those of the connecting roads."""
        for connection in junction.all("connection"):
            name = "connectingRoad" if "connectingRoad" in connection.attributes else "linkedRoad"
            if "incomingRoad" not in connection.attributes or name not in connection.attributes:
                continue  # a virtual connection
            incoming, connecting = self.road(connection, "incomingRoad"), self.road(connection, name)
            contact = connection.attributes.get("contactPoint", "start")
            for link in connection.all("laneLink"):
                target = self.end_of(connecting, contact, int(link.number("to")))
                sources = [self.end_of(incoming, side, int(link.number("from"))) for side in ("start", "end")]
                there = [source for source in sources if self.known(source)]
                if there and self.known(target):  # the incoming road may touch the junction with either end
                    goal = self.point(target)
                    self.join(min(there, key=lambda end: float(exact.hypot(*(self.point(end) - goal)))), target, link.place)


def _drafts(roads: dict[str, _Road], joints: _Joints) -> Iterator[Draft]:
    for road in roads.values():
        for k, section in enumerate(road.sections):
            for name, lane in section.lanes.items():
                if lane.attributes.get("type", "none") not in _FOR_CARS:
                    continue
                inner = name - (1 if name > 0 else -1)
                if float(exact.hypot(*(section.edges[name] - section.edges[inner]).T).max()) < 0.1:
                    continue  # a lane that has no width
                forth = _forth(road, lane, name)
                for along in (forth, not forth) if lane.attributes.get("type") == "bidirectional" else (forth,):
                    yield _draft(road, k, name, joints, along=along, second=along != forth)


def _forth(road: _Road, lane: Element, name: int) -> bool:
    """Whether a lane is driven in the direction of growing s."""
    forth = (name < 0) != road.left_hand
    return forth != (lane.attributes.get("direction") == "reversed")


def _name(key: Key) -> str:
    return f"{key[0]}.{key[1]}.{key[2]}"


def _draft(road: _Road, k: int, name: int, joints: _Joints, *, along: bool, second: bool) -> Draft:
    section, key = road.sections[k], (road.id, k, name)
    lane = section.lanes[name]
    inner = name - (1 if name > 0 else -1)
    left, right = (section.edges[inner], section.edges[name]) if name < 0 else (section.edges[name], section.edges[inner])
    if not along:
        left, right = right[::-1], left[::-1]
    after = []
    for (other_road, other_section, other), at in joints.of.get((key, 1 if along else 0), []):
        target = joints.roads[other_road]
        element = target.sections[other_section].lanes[other]
        enters = _forth(target, element, other) == (at == 0)
        if element.attributes.get("type") == "bidirectional":
            after.append(_name((other_road, other_section, other)) + ("" if enters else "r"))
        elif enters:
            after.append(_name((other_road, other_section, other)))
    beside = []
    for other in (name - 1, name + 1):
        mark = lane if abs(other) > abs(name) else section.lanes.get(other)
        if (
            other in section.lanes
            and mark is not None
            and _forth(road, section.lanes[other], other) == along
            and _crossable(mark)
        ):
            beside.append(_name((road.id, k, other)))
    return Draft(
        id=_name(key) + ("r" if second else ""),
        left=left,
        right=right,
        successors=tuple(after),
        beside=tuple(beside),
        speed_limit=_speed_limit(road, lane, float(section.s[0])),
        junction=road.junction,
        place=lane.place,
        paired=True,
    )


def _crossable(lane: Element) -> bool:
    """Whether a lane's outer mark may be crossed."""
    marks = lane.all("roadMark")
    return not any(mark.attributes.get("laneChange") == "none" or mark.attributes.get("type") in _MARKED for mark in marks)


def _speed_limit(road: _Road, lane: Element, s: float) -> float:
    """m/s: the lane's own first limit, else that of the road's type at s."""
    records = lane.all("speed")
    if not records:
        types = [kind for kind in road.element.all("type") if kind.number("s", 0.0) <= s + 1e-6]
        records = types[-1].all("speed") if types else []
    if not records or records[0].attributes.get("max") in ("no limit", "undefined", None):
        return math.nan
    unit = records[0].attributes.get("unit", "m/s")
    if unit not in _SPEEDS:
        raise InputError(f"{records[0].place}: unit {unit[:20]!r}; one of {', '.join(_SPEEDS)} is needed")
    limit = records[0].number("max")
    return limit * _SPEEDS[unit] if limit > 0.0 else math.nan
