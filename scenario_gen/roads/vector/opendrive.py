# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""OpenDRIVE maps (.xodr), 1.4 to 1.8: lanes along reference lines, linked from road to road and through junctions.

A lane is named road.section.lane, e.g. 5.0.-1. The road is seen from above; its elevation says which lanes can meet.
Source: ASAM OpenDRIVE 1.8, chapters "Roads", "Lanes" and "Junctions".
"""

from collections import defaultdict
from collections.abc import Iterator
import math
import re

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.base.xml_reader import Element
from scenario_gen.numerics import Floats
from scenario_gen.roads.vector.crosswalks import crosswalks
from scenario_gen.roads.vector.network import (
    by_id,
    Draft,
    Faults,
    MapLanes,
    MOST_LINKS,
    MOST_SECTIONS,
    refuse_too_long,
    refuse_too_many_lanes,
    TooLargeError,
)
from scenario_gen.roads.vector.plan_view import reference_line
from scenario_gen.roads.vector.sections import (
    FOR_CARS,
    Key,
    LaneSection,
    OpenDriveRoad,
    road_of_sections,
    SectionLane,
    STEP,
)
from scenario_gen.roads.vector.signs import DraftRule, is_speed_limit, kind_of_sign
from scenario_gen.types import (
    DRIVERS,
    Note,
    NoteKind,
    RuleKind,
)

_SPEEDS = {"m/s": 1.0, "km/h": 1.0 / 3.6, "mph": 0.44704}
_LINKED = 3.0  # metres between the ends of lanes that are linked, at most
_READ = ("1000002", "1000003")  # lights and crossings of pedestrians
_STOP_LINE = "294"  # type of a signal that is a line on the ground
_LIGHTS = ("1000001", "1000009", "1000010", "1000011", "1000012")  # for vehicles
_SIGNED = 15.0  # metres between a sign and its stop line, at most
_MARKED = (
    "solid",
    "solid solid",
    "curb",
    "grass",
    "botts dots",
)  # road marks that are not crossed

End = tuple[Key, int]  # a lane and 0 for its end at lower s, 1 for that at higher s


def lanes_of(root: Element) -> MapLanes:
    """Return the lanes of an OpenDRIVE map.

    Raises:
        InputError: it is broken or has no road; names file and line.
    """
    header = root.child("header")
    version = ".".join(header.get(name, "?") for name in ("revMajor", "revMinor"))
    roads: dict[str, OpenDriveRoad] = {}
    total, lanes, points = 0.0, 0, 0
    faults = Faults()
    for name, element in by_id(root.findall("road"), faults).items():
        with faults.leaving_out("road", name):
            line = reference_line(element)
            total += line.length
            if total > MOST_SECTIONS * STEP:
                raise TooLargeError(
                    f"{element.place}: roads of more than {MOST_SECTIONS * STEP / 1000.0:g} km; cut the map"
                )
            roads[name] = road_of_sections(element, name, line)
        if name not in roads:
            continue
        lanes += sum(len(section.lanes) for section in roads[name].sections)
        refuse_too_many_lanes(lanes, root.file)
        points += sum(
            len(lane.s) for section in roads[name].sections for lane in section.lanes.values()
        )
        refuse_too_long(points, root.file)
    if not roads:
        raise InputError(faults.found[0][2] if faults.found else f"{root.file}: no <road>")
    joints = _Joints(roads, faults)
    for road in roads.values():
        joints.along(road)
    for junction in root.findall("junction"):
        joints.through(junction)
    notes = (*_coordinate_notes(header, version), *joints.notes())
    rules = [*_signal_rules(roads, faults), *_priorities(root, roads)]
    signals = [
        signal
        for road in roads.values()
        for group in road.element.findall("signals")
        for signal in group.findall("signal")
    ]
    others = [signal for signal in signals if not (_is_read(signal) or _kind_of_signal(signal))]
    lanes_found = [
        lane
        for road in roads.values()
        for section in road.sections
        for lane in section.lanes.values()
    ]
    barred = [lane for lane in lanes_found if lane.kind in FOR_CARS and not lane.users]
    drafts = [
        *_drafts(roads, joints),
        *(draft for road in roads.values() for draft in crosswalks(road, faults)),
    ]
    refuse_too_many_lanes(len(drafts), root.file)
    return MapLanes(drafts, notes, len(barred), faults, rules, len(others))


def _signal_rules(roads: dict[str, OpenDriveRoad], faults: Faults) -> Iterator[DraftRule]:
    """Yield the rules of signals: where they stand, and where roads refer to them."""
    kinds: dict[str, RuleKind] = {}
    placed: list[tuple[OpenDriveRoad, Element]] = []
    for road in roads.values():
        for group in road.element.findall("signals"):
            placed += [
                (road, element)
                for tag in ("signal", "signalReference")
                for element in group.findall(tag)
            ]
    for _, signal in placed:
        kind = _kind_of_signal(signal)
        if signal.tag == "signal" and kind is not None:
            kinds[signal.get("id", "?")] = kind
    stop_lines = [(road, element) for road, element in placed if _is_stop_line(element)]
    for road in roads.values():
        objects = (
            element
            for group in road.element.findall("objects")
            for element in group.findall("object")
        )
        stop_lines += [(road, element) for element in objects if _is_stop_line(element)]
    for road, element in placed:
        name = element.get("id", "?")
        if name not in kinds:
            continue
        with faults.leaving_out("signal", name):
            s = element.number("s")
            lines = [
                other.number("s")
                for own, other in stop_lines
                if own is road and _same_way(element, other)
            ]
            nearest = min(lines, key=lambda at: abs(at - s), default=math.inf)
            if abs(nearest - s) <= _SIGNED:
                s = nearest
            for lane in _lanes_under(road, element, s):
                yield DraftRule(name, kinds[name], (lane.name,), line=_across(lane, s))


def _kind_of_signal(signal: Element) -> RuleKind | None:
    if signal.get("dynamic") == "yes":
        return RuleKind.TRAFFIC_LIGHT if signal.get("type") in _LIGHTS else None
    return kind_of_sign(*_sign(signal))


def _sign(signal: Element) -> tuple[str, str, str]:
    """The number of a signal's sign, the subtype behind it, and the country whose number it is."""
    number, subtype, country = (signal.get(name, "") for name in ("type", "subtype", "country"))
    return number, subtype, country


def _is_stop_line(element: Element) -> bool:
    """Whether a signal or an object is a line at which one stops; some tools give it no type but a name."""
    name = re.sub("[^a-z]", "", element.get("name", "").lower())
    return element.get("type") == _STOP_LINE or name.startswith("stopline")


def _is_read(signal: Element) -> bool:
    """Whether a signal is read that is no rule: a line, a speed limit, what is for pedestrians."""
    return signal.get("type") in _READ or _is_stop_line(signal) or is_speed_limit(*_sign(signal))


def _same_way(a: Element, b: Element) -> bool:
    """Whether two signals are for traffic of the same direction."""
    return (
        "none" in (ways := {signal.get("orientation", "none") for signal in (a, b)})
        or len(ways) == 1
    )


def _lanes_under(road: OpenDriveRoad, signal: Element, s: float) -> Iterator[SectionLane]:
    """The lanes for whose traffic a signal is, of the section at s."""
    first: dict[bool, int] = {}  # section at s, by side
    bounds = [
        (int(v.number("fromLane")), int(v.number("toLane"))) for v in signal.findall("validity")
    ]
    way = signal.get("orientation", "none")
    for lane in (lane for section in road.sections for lane in section.lanes.values()):
        _, section, number = lane.key
        if (
            not lane.s[0] - 1e-6 <= s <= lane.s[-1] + 1e-6
            or first.setdefault(number > 0, section) != section
        ):
            continue
        valid = not bounds or any(min(pair) <= number <= max(pair) for pair in bounds)
        if valid and lane.kind in FOR_CARS and (way == "none" or lane.forth == (way == "+")):
            yield lane


def _across(lane: SectionLane, s: float) -> Floats:
    """(2, 2) [m] the cross-section of a lane at s."""
    return np.array(
        [
            [np.interp(s, lane.s, border[:, axis]) for axis in (0, 1)]
            for border in (lane.inner, lane.outer)
        ]
    )


def _priorities(root: Element, roads: dict[str, OpenDriveRoad]) -> Iterator[DraftRule]:
    """Yield the priorities of junctions between roads: traffic of the low one gives way."""
    for junction in root.findall("junction"):
        for priority in junction.findall("priority"):
            high, low = (roads.get(priority.get(name, "")) for name in ("high", "low"))
            if high is not None and low is not None:
                first, last = (
                    tuple(
                        lane.name for section in road.sections for lane in section.lanes.values()
                    )
                    for road in (high, low)
                )
                yield DraftRule(
                    f"junction {junction.get('id', '?')}",
                    RuleKind.GIVE_WAY,
                    last,
                    first,
                )


def _coordinate_notes(header: Element, version: str) -> list[Note]:
    """Return notes on the coordinates of a map, and on the parts of its header that are ignored."""
    notes = [Note.of(NoteKind.COORDINATES, format=f"OpenDRIVE {version}")]
    reference = header.find("geoReference")
    text = " ".join(reference.content.split()) if reference is not None else ""
    if text:
        notes.append(Note.of(NoteKind.GEOREFERENCE_IGNORED, reference=text))
    offset = header.find("offset")
    if offset is not None:
        x, y = (offset.number(axis, 0.0) for axis in "xy")
        notes.append(Note.of(NoteKind.OFFSET_IGNORED, x=x, y=y))
    return notes


class _Joints:
    """Which ends of lanes are joined: by links between sections and roads, and by the connections of junctions."""

    def __init__(self, roads: dict[str, OpenDriveRoad], faults: Faults) -> None:
        self.roads = roads
        self.faults = faults
        self.of: dict[End, list[End]] = defaultdict(list)
        self.apart: list[str] = []  # places of links that join lanes whose ends are apart

    def notes(self) -> list[Note]:
        """Return a note on links that were left out."""
        if not self.apart:
            return []
        return [
            Note.of(
                NoteKind.LINKS_LEFT_OUT,
                count=len(self.apart),
                distance=_LINKED,
                place=self.apart[0],
            )
        ]

    def lane(self, key: Key) -> SectionLane | None:
        """The lane of a key; None if there is none."""
        road, section, lane = key
        return self.roads[road].sections[section].lanes.get(lane)

    def join(self, a: End, b: End, place: str) -> None:
        """Join two ends, if they are there and near each other."""
        first, second = self.lane(a[0]), self.lane(b[0])
        if first is None or second is None:
            return
        if float(np.hypot(*(first.middle(a[1]) - second.middle(b[1])))) > _LINKED:
            self.apart.append(place)
            return
        for lane, end, other in ((first, a, b), (second, b, a)):
            if other not in self.of[end]:
                self.of[end].append(other)
                if len(self.of[end]) > MOST_LINKS:
                    raise TooLargeError(
                        f"{place}: more than {MOST_LINKS} lanes are joined to lane {lane.name}"
                    )

    def along(self, road: OpenDriveRoad) -> None:
        """Join a road's sections, and it to the roads before and after it."""
        for k, section in enumerate(road.sections):
            for lane in section.lanes.values():
                for tag, at in (("predecessor", 0), ("successor", 1)):
                    beyond = road.beyond(k, 1 if at else -1, lane.key[2])
                    for link in [
                        child
                        for group in lane.element.findall("link")
                        for child in group.findall(tag)
                    ]:
                        with self.faults.leaving_out("link", f"{tag} of lane {lane.name}"):
                            other = int(link.number("id"))
                            if beyond is not None:
                                self.join(
                                    (lane.key, at), ((road.id, beyond, other), 1 - at), link.place
                                )
                            else:
                                self._to_road(road, (lane.key, at), tag, other)

    def _to_road(self, road: OpenDriveRoad, end: End, tag: str, lane: int) -> None:
        link = road.element.find(f"link/{tag}")
        if link is None or link.get("elementType") != "road":
            return
        other = self.road(link, "elementId")
        self.join(end, self.end_of(other, link.get("contactPoint", "start"), lane), link.place)

    def road(self, link: Element, name: str) -> OpenDriveRoad:
        """The road that an attribute names.

        Raises:
            InputError: there is none of that id.
        """
        if link.attribute(name) not in self.roads:
            raise InputError(f"{link.place}: road {link.attribute(name)[:40]!r} is not in the map")
        return self.roads[link.attribute(name)]

    @staticmethod
    def end_of(road: OpenDriveRoad, contact: str, lane: int) -> End:
        """The end of a lane at a road's start or end."""
        at = 1 if contact == "end" else 0
        section = road.beyond(len(road.sections), -1, lane) if at else road.beyond(-1, 1, lane)
        return (road.id, section or 0, lane), at

    def through(self, junction: Element) -> None:
        """Join incoming lanes to those of the connecting roads."""
        for connection in junction.findall("connection"):
            with self.faults.leaving_out("connection", connection.get("id", "?")):
                self._through(connection)

    def _through(self, connection: Element) -> None:
        name = "connectingRoad" if "connectingRoad" in connection.attrib else "linkedRoad"
        if "incomingRoad" not in connection.attrib or name not in connection.attrib:
            return  # a virtual connection
        incoming, connecting = self.road(connection, "incomingRoad"), self.road(connection, name)
        contact = connection.get("contactPoint", "start")
        for link in connection.findall("laneLink"):
            target = self.end_of(connecting, contact, int(link.number("to")))
            goal = self.lane(target[0])
            if goal is None:
                continue
            distance = {}  # the incoming road may touch the junction with either end
            for side in ("start", "end"):
                source = self.end_of(incoming, side, int(link.number("from")))
                lane = self.lane(source[0])
                if lane is not None:
                    distance[source] = float(
                        np.hypot(*(lane.middle(source[1]) - goal.middle(target[1])))
                    )
            if distance:
                self.join(min(distance, key=distance.__getitem__), target, link.place)


def _drafts(roads: dict[str, OpenDriveRoad], joints: _Joints) -> Iterator[Draft]:
    for road in roads.values():
        for section in road.sections:
            for lane in section.lanes.values():
                wide = float(np.hypot(*(lane.outer - lane.inner).T).max()) >= 0.1
                if not lane.users or not wide:
                    continue
                yield _draft(road, section, lane, joints, along=lane.forth)
                if lane.both_ways and lane.users & DRIVERS:
                    yield _draft(road, section, lane, joints, along=not lane.forth)


def _draft(
    road: OpenDriveRoad, section: LaneSection, lane: SectionLane, joints: _Joints, *, along: bool
) -> Draft:
    """A lane driven along s or against it; against its own direction its name ends with "r"."""
    number = lane.key[2]
    height = road.elevation.at(lane.s, float(lane.s[-1]))
    inner, outer = (np.column_stack((border, height)) for border in (lane.inner, lane.outer))
    left, right = (inner, outer) if number < 0 else (outer, inner)
    if not along:
        left, right = right[::-1], left[::-1]
    after = []
    for key, at in joints.of[lane.key, 1 if along else 0]:
        target = joints.lane(key)
        assert target is not None
        enters = target.forth == (at == 0)
        if enters or target.both_ways:
            after.append(target.name + ("" if enters else "r"))
    beside = []
    for other in (number - 1, number + 1):
        neighbour = section.lanes.get(other)
        outwards = abs(other) > abs(number)
        if (
            neighbour is not None
            and neighbour.forth == along
            and _may_cross(lane if outwards else neighbour, outwards=outwards)
        ):
            beside.append(neighbour.name)
    limit = math.nan
    with joints.faults.leaving_out("speed limit", lane.name):
        limit = _speed_limit(road, lane.element, float(lane.s[0]))
    return Draft(
        id=lane.name + ("" if along == lane.forth else "r"),
        left=left,
        right=right,
        successors=tuple(after),
        beside=tuple(beside),
        speed_limit=limit,
        junction=road.junction,
        place=lane.element.place,
        paired=True,
        users=lane.users,
    )


def _may_cross(lane: SectionLane, *, outwards: bool) -> bool:
    """Whether traffic may cross a lane's outer mark, from the lane outwards or into it."""
    against = "decrease" if outwards == (lane.key[2] > 0) else "increase"
    not_crossed = (
        *_MARKED,
        "solid broken" if outwards else "broken solid",
    )  # its inner line is named first
    marks = [mark.attrib for mark in lane.element.findall("roadMark")]
    return not any(
        mark.get("laneChange") in ("none", against) or mark.get("type") in not_crossed
        for mark in marks
    )


def _speed_limit(road: OpenDriveRoad, lane: Element, s: float) -> float:
    """m/s: the lane's own first limit, else that of the road's type at s."""
    records = lane.findall("speed")
    if not records:
        types = [
            kind for kind in road.element.findall("type") if kind.number("s", 0.0) <= s + 1e-6
        ]
        records = types[-1].findall("speed") if types else []
    if not records or records[0].get("max") in ("no limit", "undefined", None):
        return math.nan
    unit = records[0].get("unit", "m/s")
    if unit not in _SPEEDS:
        raise InputError(
            f"{records[0].place}: unit {unit[:20]!r}; one of {', '.join(_SPEEDS)} is needed"
        )
    limit = records[0].number("max")
    return limit * _SPEEDS[unit] if limit > 0.0 else math.nan
