# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""OpenDRIVE maps (.xodr), versions 1.4 to 1.8: lanes along reference lines, linked to each other.

A lane is named road.section.lane, e.g. 5.0.-1. The road is seen from above; its elevation
decides which lanes can meet.

Source: ASAM OpenDRIVE 1.8, chapters "Roads", "Lanes" and "Junctions".
"""

from collections import defaultdict
from collections.abc import Iterator
import math
from typing import NamedTuple

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.base.xml_reader import Element
from scenario_gen.roads.vector.crosswalks import crosswalks
from scenario_gen.roads.vector.drafts import (
    by_id,
    Draft,
    Faults,
    MapLanes,
    MAX_LINKS_COUNT,
    MAX_SECTIONS_COUNT,
    MPS_PER_UNIT,
    refuse_too_long,
    refuse_too_many_lanes,
    TooLargeError,
)
from scenario_gen.roads.vector.opendrive_signals import other_signals, priorities, signal_rules
from scenario_gen.roads.vector.plan_view import reference_line
from scenario_gen.roads.vector.sections import (
    CROSS_SECTION_STEP_M,
    Key,
    LaneSection,
    OpenDriveRoad,
    road_of_sections,
    SectionLane,
)
from scenario_gen.types import DRIVERS, Note, NoteKind

_MAX_LINK_GAP_M = 3.0  # between the ends of linked lanes
_UNCROSSED_MARKS = frozenset(("solid", "solid solid", "curb", "grass", "botts dots"))


def lanes_of(root: Element) -> MapLanes:
    """Return the lanes of an OpenDRIVE map.

    Raises:
        InputError: it is broken or has no road; names file and line.
    """
    faults = Faults()
    roads = _roads(root, faults)
    if not roads:
        raise InputError(faults.first_reason or f"{root.file}: no <road>")
    links = LaneLinks(roads, faults)
    for road in roads.values():
        links.add_road(road)
    for connection in root.findall("junction/connection"):
        with faults.leaving_out("connection", connection.get("id", "?")):
            links.add_connection(connection)

    drafts = [*_drafts(roads, links)]
    for road in roads.values():
        drafts += crosswalks(road, faults)
    refuse_too_many_lanes(len(drafts), root.file)
    lanes = [lane for road in roads.values() for lane in road.lanes]
    return MapLanes(
        drafts,
        tuple(_coordinate_notes(root)),
        unsupported=sum(lane.is_car_lane and not lane.users for lane in lanes),
        faults=faults,
        rules=[*signal_rules(roads, faults), *priorities(root, roads)],
        other_signs=other_signals(roads),
    )


def _roads(root: Element, faults: Faults) -> dict[str, OpenDriveRoad]:
    """Return the roads of a map by their ids, without the faulty ones.

    Raises:
        TooLargeError: they are too many or too long.
    """
    roads: dict[str, OpenDriveRoad] = {}
    length, point_count = 0.0, 0
    max_length = MAX_SECTIONS_COUNT * CROSS_SECTION_STEP_M
    for name, element in by_id(root.findall("road"), faults).items():
        with faults.leaving_out("road", name):
            line = reference_line(element)
            length += line.length
            if length > max_length:
                km = max_length / 1000.0
                raise TooLargeError(f"{element.place}: more than {km:g} km of roads; cut the map")
            road = road_of_sections(element, name, line, faults)
            point_count += sum(len(lane.s) for lane in road.lanes)
            refuse_too_long(point_count, root.file)
            roads[name] = road
    return roads


def _coordinate_notes(root: Element) -> Iterator[Note]:
    """Yield notes on the coordinates of a map, and on ignored parts of its header."""
    header = root.find("header")
    if header is None:
        yield Note.of(NoteKind.COORDINATES, format="OpenDRIVE without <header>")
        return
    version = ".".join(header.get(name, "?") for name in ("revMajor", "revMinor"))
    yield Note.of(NoteKind.COORDINATES, format=f"OpenDRIVE {version}")
    reference = header.find("geoReference")
    text = " ".join(reference.content.split()) if reference is not None else ""
    if text:
        yield Note.of(NoteKind.GEOREFERENCE_IGNORED, reference=text)
    offset = header.find("offset")
    if offset is not None:
        x, y = offset.number("x", 0.0), offset.number("y", 0.0)
        yield Note.of(NoteKind.OFFSET_IGNORED, x=x, y=y)


class LaneEnd(NamedTuple):
    """A lane and its end: 0 at lower s, 1 at higher s."""

    key: Key
    at: int


class LaneLinks:
    """The links between the ends of lanes: within roads, between roads and through junctions."""

    def __init__(self, roads: dict[str, OpenDriveRoad], faults: Faults) -> None:
        self.faults = faults
        self._roads = roads
        self._linked: dict[LaneEnd, list[LaneEnd]] = defaultdict(list)

    def lane(self, key: Key) -> SectionLane | None:
        """Return the lane with a key, if there is one."""
        road, section, lane = key
        return self._roads[road].sections[section].lanes.get(lane)

    def linked_to(self, end: LaneEnd) -> Iterator[tuple[SectionLane, int]]:
        """Yield the lanes that are linked to an end, and which of their ends."""
        for key, at in self._linked[end]:
            lane = self.lane(key)
            assert lane is not None
            yield lane, at

    def add_road(self, road: OpenDriveRoad) -> None:
        """Link a road's sections to each other, and the road to those before and after it."""
        for lane in road.lanes:
            links = [*lane.element.findall("link/predecessor")]
            links += lane.element.findall("link/successor")
            for link in links:
                with self.faults.leaving_out("link", f"{link.tag} of lane {lane.name}"):
                    self._add_link(road, lane, link)

    def _add_link(self, road: OpenDriveRoad, lane: SectionLane, link: Element) -> None:
        """Link a lane to the one that its predecessor or successor element names."""
        at = 1 if link.tag == "successor" else 0
        _, section, number = lane.key
        other = int(link.number("id"))
        end = LaneEnd(lane.key, at)
        next_section = road.next_section(section, 1 if at else -1, number)
        if next_section is not None:
            self._join(end, LaneEnd((road.id, next_section, other), 1 - at), link.place)
            return
        road_link = road.element.find(f"link/{link.tag}")
        if road_link is not None and road_link.get("elementType") == "road":
            target = self._road(road_link, "elementId")
            contact = road_link.get("contactPoint", "start")
            self._join(end, _lane_end(target, contact, other), road_link.place)

    def add_connection(self, connection: Element) -> None:
        """Link the lanes of an incoming road of a junction to those of a connecting road."""
        name = "connectingRoad" if "connectingRoad" in connection.attrib else "linkedRoad"
        if "incomingRoad" not in connection.attrib or name not in connection.attrib:
            return  # a virtual connection
        incoming = self._road(connection, "incomingRoad")
        connecting = self._road(connection, name)
        contact = connection.get("contactPoint", "start")
        for link in connection.findall("laneLink"):
            target = _lane_end(connecting, contact, int(link.number("to")))
            # The incoming road may touch the junction with either end.
            number = int(link.number("from"))
            sources = [_lane_end(incoming, side, number) for side in ("start", "end")]
            known = [source for source in sources if self.lane(source.key) is not None]
            if known and self.lane(target.key) is not None:
                source = min(known, key=lambda source: self._gap(source, target))
                self._join(source, target, link.place)

    def _road(self, link: Element, name: str) -> OpenDriveRoad:
        """Return the road that an attribute names.

        Raises:
            InputError: there is no such road.
        """
        road = link.attribute(name)
        if road not in self._roads:
            raise InputError(f"{link.place}: road {road[:40]!r} is not in the map")
        return self._roads[road]

    def _gap(self, a: LaneEnd, b: LaneEnd) -> float:
        """Return the distance [m] between two ends of lanes that exist."""
        first, second = self.lane(a.key), self.lane(b.key)
        assert first is not None and second is not None
        return float(np.hypot(*(first.centre(a.at) - second.centre(b.at))))

    def _join(self, a: LaneEnd, b: LaneEnd, place: str) -> None:
        """Link two ends if they exist and are near each other."""
        if self.lane(a.key) is None or self.lane(b.key) is None:
            return
        if self._gap(a, b) > _MAX_LINK_GAP_M:
            names = (".".join(map(str, end.key)) for end in (a, b))
            reason = f"{place}: their ends are more than {_MAX_LINK_GAP_M:g} m from each other"
            self.faults.add("link", " to ".join(names), reason)
            return
        for end, other in ((a, b), (b, a)):
            if other not in self._linked[end]:
                self._linked[end].append(other)
                if len(self._linked[end]) > MAX_LINKS_COUNT:
                    name = ".".join(map(str, end.key))
                    raise TooLargeError(
                        f"{place}: more than {MAX_LINKS_COUNT} lanes are linked to lane {name}"
                    )


def _lane_end(road: OpenDriveRoad, contact: str, lane: int) -> LaneEnd:
    """Return the end of a lane at a road's start or end."""
    outside, step, at = (len(road.sections), -1, 1) if contact == "end" else (-1, 1, 0)
    section = road.next_section(outside, step, lane)
    return LaneEnd((road.id, section or 0, lane), at)


def _drafts(roads: dict[str, OpenDriveRoad], links: LaneLinks) -> Iterator[Draft]:
    """Yield all lanes with users, and lanes for both ways once for each."""
    lanes = [(road, lane) for road in roads.values() for lane in road.lanes]
    for road, lane in lanes:
        width = float(np.hypot(*(lane.outer - lane.inner).T).max())
        if lane.users and width >= 0.1:
            yield _draft(road, lane, links, along_s=lane.forward)
            if lane.both_ways and lane.users & DRIVERS:
                yield _draft(road, lane, links, along_s=not lane.forward)


def _draft(road: OpenDriveRoad, lane: SectionLane, links: LaneLinks, *, along_s: bool) -> Draft:
    """Return a lane driven along s or not; against its own direction its name ends in "r"."""
    height = road.elevation.at(lane.s, float(lane.s[-1]))
    inner, outer = (np.column_stack((border, height)) for border in (lane.inner, lane.outer))
    left, right = (inner, outer) if lane.key[2] < 0 else (outer, inner)
    if not along_s:
        left, right = right[::-1], left[::-1]
    successors = []
    for target, at in links.linked_to(LaneEnd(lane.key, 1 if along_s else 0)):
        enters = target.forward == (at == 0)
        if enters or target.both_ways:
            successors.append(target.name + ("" if enters else "r"))
    limit = math.nan
    with links.faults.leaving_out("speed limit", lane.name):
        limit = _speed_limit(road, lane.element, float(lane.s[0]))
    return Draft(
        id=lane.name + ("" if along_s == lane.forward else "r"),
        left=left,
        right=right,
        successors=tuple(successors),
        neighbours=tuple(_neighbours(road.sections[lane.key[1]], lane, along_s=along_s)),
        speed_limit=limit,
        junction=road.junction,
        place=lane.element.place,
        paired=True,
        users=lane.users,
    )


def _neighbours(section: LaneSection, lane: SectionLane, *, along_s: bool) -> Iterator[str]:
    """Yield the names of lanes with the same direction to which traffic may change."""
    number = lane.key[2]
    for other in (number - 1, number + 1):
        neighbour = section.lanes.get(other)
        if neighbour is not None and neighbour.forward == along_s:
            outwards = abs(other) > abs(number)
            if _may_cross(lane if outwards else neighbour, outwards=outwards):
                yield neighbour.name


def _may_cross(lane: SectionLane, *, outwards: bool) -> bool:
    """Return whether traffic may cross a lane's outer mark, out of the lane or into it."""
    forbidden_change = "decrease" if outwards == (lane.key[2] > 0) else "increase"
    one_sided = "solid broken" if outwards else "broken solid"  # the inner line is named first
    for mark in lane.element.findall("roadMark"):
        if mark.get("laneChange") in ("none", forbidden_change):
            return False
        if mark.get("type") == one_sided or mark.get("type") in _UNCROSSED_MARKS:
            return False
    return True


def _speed_limit(road: OpenDriveRoad, lane: Element, s: float) -> float:
    """Return [m/s] the lane's own first limit, or that of the road's type at s; NaN if none."""
    records = lane.findall("speed")
    if not records:
        types = [
            kind for kind in road.element.findall("type") if kind.number("s", 0.0) <= s + 1e-6
        ]
        records = types[-1].findall("speed") if types else []
    if not records or records[0].get("max") in ("no limit", "undefined", None):
        return math.nan
    unit = records[0].get("unit", "m/s")
    if unit not in MPS_PER_UNIT:
        units = ", ".join(MPS_PER_UNIT)
        raise InputError(f"{records[0].place}: unit {unit[:20]!r}; choose one of {units}")
    limit = records[0].number("max")
    return limit * MPS_PER_UNIT[unit] if limit > 0.0 else math.nan
