# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""OpenDRIVE maps (.xodr), 1.4 to 1.8: lanes along reference lines, linked from road to road and through junctions.

A lane is named road.section.lane, e.g. 5.0.-1. Elevation and superelevation are left out: the road is seen from above.
Source: ASAM OpenDRIVE 1.8, chapters "Roads", "Lanes" and "Junctions".
"""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
import math

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.base.markup import Element
from scenario_gen.numerics import Floats
from scenario_gen.numerics.plane import unit_left
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
from scenario_gen.roads.vector.plan_view import Cubics, cubics, reference_line, ReferenceLine
from scenario_gen.roads.vector.signs import DraftRule, kind_of_sign
from scenario_gen.types import RuleKind

_FOR_CARS = frozenset(
    ("driving", "entry", "exit", "onRamp", "offRamp", "connectingRamp", "slipLane", "bidirectional", "mwyEntry", "mwyExit", "HOV")
)
_SPEEDS = {"m/s": 1.0, "km/h": 1.0 / 3.6, "mph": 0.44704}
_STEP = 0.5  # metres between cross-sections
_LINKED = 3.0  # metres between the ends of lanes that are linked, at most
_READ = ("294", "274", "1000002", "1000003")  # stop lines and speed limits; lights and crossings of pedestrians
_STOP_LINE = "294"  # type of a signal that is a line on the ground
_LIGHTS = ("1000001", "1000009", "1000010", "1000011", "1000012")  # for vehicles
_SIGNED = 15.0  # metres between a sign and its stop line, at most
_MARKED = ("solid", "solid solid", "curb", "grass", "botts dots")  # road marks that are not crossed

Key = tuple[str, int, int]  # road, section, lane
End = tuple[Key, int]  # a lane and 0 for its end at lower s, 1 for that at higher s


@dataclass(frozen=True, eq=False)
class _Lane:
    """A lane of one section.

    Attributes:
        key: its road, section and id.
        element: of the file.
        inner: (M, 2) [m] its border towards the centre lane, in the order of s.
        outer: (M, 2) [m] the other one.
        forth: whether it is driven in the direction of growing s.
    """

    key: Key
    element: Element
    inner: Floats
    outer: Floats
    forth: bool

    @property
    def name(self) -> str:
        """Road, section and id."""
        return ".".join(map(str, self.key))

    @property
    def kind(self) -> str:
        """Its type."""
        return self.element.attributes.get("type", "none")

    def middle(self, at: int) -> Floats:
        """(2,) [m] its middle at lower s (0) or at higher s (1)."""
        return np.asarray((self.outer[-at] + self.inner[-at]) / 2.0)


@dataclass(frozen=True, eq=False)
class _Section:
    """A lane section: s of its cross-sections (M,) and its lanes by id."""

    s: Floats
    lanes: dict[int, _Lane]


@dataclass(frozen=True, eq=False)
class _Road:
    element: Element
    id: str
    junction: str
    left_hand: bool
    sections: list[_Section] = field(default_factory=list)


def lanes_of(root: Element) -> MapLanes:
    """Return the lanes of an OpenDRIVE map.

    Raises:
        InputError: it is broken or has no road; names file and line.
    """
    header = root.one("header")
    version = ".".join(header.attributes.get(name, "?") for name in ("revMajor", "revMinor"))
    roads: dict[str, _Road] = {}
    total, lanes, points = 0.0, 0, 0
    faults = Faults()
    for name, element in by_id(root.all("road"), faults).items():
        with faults.leaving_out("road", name):
            line = reference_line(element)
            total += line.length
            if total > MOST_SECTIONS * _STEP:
                raise TooLargeError(f"{element.place}: roads of more than {MOST_SECTIONS * _STEP / 1000.0:g} km; cut the map")
            roads[name] = _road(element, name, line)
        if name not in roads:
            continue
        lanes += sum(len(section.lanes) for section in roads[name].sections)
        refuse_too_many_lanes(lanes, root.file)
        points += sum(len(section.lanes) * len(section.s) for section in roads[name].sections)
        refuse_too_long(points, root.file)
    if not roads:
        raise InputError(faults.found[0][2] if faults.found else f"{root.file}: no <road>")
    joints = _Joints(roads, faults)
    for road in roads.values():
        joints.along(road)
    for junction in root.all("junction"):
        joints.through(junction)
    notes = (f"OpenDRIVE {version}: {_projection(header)}", *joints.notes())
    rules = [*_signal_rules(roads, faults), *_priorities(root, roads)]
    signals = [signal for road in roads.values() for group in road.element.all("signals") for signal in group.all("signal")]
    others = [signal for signal in signals if signal.attributes.get("type") not in _READ and not _kind_of_signal(signal)]
    return MapLanes(list(_drafts(roads, joints)), notes, faults=faults, rules=rules, other_signs=len(others))


def _signal_rules(roads: dict[str, _Road], faults: Faults) -> Iterator[DraftRule]:
    """Yield the rules of signals: where they stand, and where roads refer to them."""
    kinds: dict[str, RuleKind] = {}
    placed: list[tuple[_Road, Element]] = []
    for road in roads.values():
        for group in road.element.all("signals"):
            placed += [(road, element) for tag in ("signal", "signalReference") for element in group.all(tag)]
    for _, signal in placed:
        kind = _kind_of_signal(signal)
        if signal.tag == "signal" and kind is not None:
            kinds[signal.attributes.get("id", "?")] = kind
    stop_lines = [(road, element) for road, element in placed if element.attributes.get("type") == _STOP_LINE]
    for road, element in placed:
        name = element.attributes.get("id", "?")
        if name not in kinds:
            continue
        with faults.leaving_out("signal", name):
            s = element.number("s")
            lines = [other.number("s") for own, other in stop_lines if own is road and _same_way(element, other)]
            nearest = min(lines, key=lambda at: abs(at - s), default=math.inf)
            if abs(nearest - s) <= _SIGNED:
                s = nearest
            for lane in _lanes_under(road, element, s):
                yield DraftRule(name, kinds[name], (lane.name,), line=_across(road, lane, s))


def _kind_of_signal(signal: Element) -> RuleKind | None:
    if signal.attributes.get("dynamic") == "yes":
        return RuleKind.TRAFFIC_LIGHT if signal.attributes.get("type") in _LIGHTS else None
    return kind_of_sign(signal.attributes.get("type", ""))


def _same_way(a: Element, b: Element) -> bool:
    """Whether two signals are for traffic of the same direction."""
    return "none" in (ways := {signal.attributes.get("orientation", "none") for signal in (a, b)}) or len(ways) == 1


def _lanes_under(road: _Road, signal: Element, s: float) -> Iterator[_Lane]:
    """The lanes for whose traffic a signal is, of the section at s."""
    sections = [section for section in road.sections if section.s[0] - 1e-6 <= s <= section.s[-1] + 1e-6]
    bounds = [(int(v.number("fromLane")), int(v.number("toLane"))) for v in signal.all("validity")]
    way = signal.attributes.get("orientation", "none")
    for number, lane in sections[0].lanes.items() if sections else ():
        valid = not bounds or any(min(pair) <= number <= max(pair) for pair in bounds)
        if valid and lane.kind in _FOR_CARS and (way == "none" or lane.forth == (way == "+")):
            yield lane


def _across(road: _Road, lane: _Lane, s: float) -> Floats:
    """(2, 2) [m] the cross-section of a lane at s."""
    at = road.sections[lane.key[1]].s
    return np.array([[np.interp(s, at, border[:, axis]) for axis in (0, 1)] for border in (lane.inner, lane.outer)])


def _priorities(root: Element, roads: dict[str, _Road]) -> Iterator[DraftRule]:
    """Yield the priorities of junctions between roads: traffic of the low one gives way."""
    for junction in root.all("junction"):
        for priority in junction.all("priority"):
            high, low = (roads.get(priority.attributes.get(name, "")) for name in ("high", "low"))
            if high is not None and low is not None:
                first, last = (
                    tuple(lane.name for section in road.sections for lane in section.lanes.values()) for road in (high, low)
                )
                yield DraftRule(f"junction {junction.attributes.get('id', '?')}", RuleKind.GIVE_WAY, last, first)


def _projection(header: Element) -> str:
    reference = header.first("geoReference")
    text = " ".join(reference.text.split()) if reference is not None else ""
    stated = f"geoReference {text} is stated, not applied" if text else "no geoReference"
    offset = header.first("offset")
    moved = "" if offset is None else f", offset x {offset.number('x', 0.0):g}, y {offset.number('y', 0.0):g} not applied"
    return f"coordinates as they stand, in metres; {stated}{moved}"


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
        even = np.linspace(begin, max(end, begin + 1e-3), max(math.ceil((end - begin) / _STEP), 1) + 1)
        s = np.unique(np.concatenate((even, breaks)))
        road.sections.append(_Section(s, dict(_lanes(road, section, s, line.at(s), offset))))
    return road


def _lanes(road: _Road, section: Element, s: Floats, poses: Floats, offset: Cubics) -> Iterator[tuple[int, _Lane]]:
    """The lanes of a section that has its cross-sections at s (M,), where the reference line has these poses (M, 3)."""
    normal, centre = unit_left(poses[:, 2]), offset.at(s)
    begin = s[0]
    for side, sign in (("left", 1), ("right", -1)):
        group = section.first(side)
        across, inner = centre, poses[:, :2] + centre[:, None] * normal
        elements = group.all("lane") if group else []
        refuse_too_many_lanes(len(elements), section.file)
        refuse_too_long(len(elements) * len(s), section.file)
        for count, lane in enumerate(sorted(elements, key=lambda lane: sign * _lane_id(lane, sign)), 1):
            name = _lane_id(lane, sign)
            if name != sign * count:
                raise InputError(f"{lane.place}: lane {name} is there twice, or those between it and the centre are missing")
            if lane.all("width"):
                across = across + sign * np.maximum(cubics(lane.all("width"), "sOffset").at(s - begin), 0.0)
            elif lane.all("border"):
                across = cubics(lane.all("border"), "sOffset").at(s - begin) + centre
            outer = poses[:, :2] + across[:, None] * normal
            forth = ((name < 0) != road.left_hand) != (lane.attributes.get("direction") == "reversed")
            yield name, _Lane((road.id, len(road.sections), name), lane, inner, outer, forth)
            inner = outer


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

    def __init__(self, roads: dict[str, _Road], faults: Faults) -> None:
        self.roads = roads
        self.faults = faults
        self.of: dict[End, list[End]] = defaultdict(list)
        self.apart: list[str] = []  # places of links that join lanes whose ends are apart

    def notes(self) -> list[str]:
        """Say what was not believed."""
        if not self.apart:
            return []
        return [
            f"{len(self.apart)} links join lanes whose ends are more than {_LINKED:g} m apart and were left out, first at "
            f"{self.apart[0]}"
        ]

    def lane(self, key: Key) -> _Lane | None:
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
                    raise TooLargeError(f"{place}: more than {MOST_LINKS} lanes are joined to lane {lane.name}")

    def along(self, road: _Road) -> None:
        """Join a road's sections, and it to the roads before and after it."""
        for k, section in enumerate(road.sections):
            for lane in section.lanes.values():
                for tag, at in (("predecessor", 0), ("successor", 1)):
                    beyond = k + (1 if at else -1)
                    for link in [child for group in lane.element.all("link") for child in group.all(tag)]:
                        with self.faults.leaving_out("link", f"{tag} of lane {lane.name}"):
                            other = int(link.number("id"))
                            if 0 <= beyond < len(road.sections):
                                self.join((lane.key, at), ((road.id, beyond, other), 1 - at), link.place)
                            else:
                                self._to_road(road, (lane.key, at), tag, other)

    def _to_road(self, road: _Road, end: End, tag: str, lane: int) -> None:
        link = road.element.first("link", tag)
        if link is None or link.attributes.get("elementType") != "road":
            return
        other = self.road(link, "elementId")
        self.join(end, self.end_of(other, link.attributes.get("contactPoint", "start"), lane), link.place)

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
            with self.faults.leaving_out("connection", connection.attributes.get("id", "?")):
                self._through(connection)

    def _through(self, connection: Element) -> None:
        name = "connectingRoad" if "connectingRoad" in connection.attributes else "linkedRoad"
        if "incomingRoad" not in connection.attributes or name not in connection.attributes:
            return  # a virtual connection
        incoming, connecting = self.road(connection, "incomingRoad"), self.road(connection, name)
        contact = connection.attributes.get("contactPoint", "start")
        for link in connection.all("laneLink"):
            target = self.end_of(connecting, contact, int(link.number("to")))
            goal = self.lane(target[0])
            if goal is None:
                continue
            distance = {}  # the incoming road may touch the junction with either end
            for side in ("start", "end"):
                source = self.end_of(incoming, side, int(link.number("from")))
                lane = self.lane(source[0])
                if lane is not None:
                    distance[source] = float(np.hypot(*(lane.middle(source[1]) - goal.middle(target[1]))))
            if distance:
                self.join(min(distance, key=distance.__getitem__), target, link.place)


def _drafts(roads: dict[str, _Road], joints: _Joints) -> Iterator[Draft]:
    for road in roads.values():
        for section in road.sections:
            for lane in section.lanes.values():
                wide = float(np.hypot(*(lane.outer - lane.inner).T).max()) >= 0.1
                if lane.kind not in _FOR_CARS or not wide:
                    continue
                yield _draft(road, section, lane, joints, along=lane.forth)
                if lane.kind == "bidirectional":
                    yield _draft(road, section, lane, joints, along=not lane.forth)


def _draft(road: _Road, section: _Section, lane: _Lane, joints: _Joints, *, along: bool) -> Draft:
    """A lane driven along s or against it; against its own direction its name ends with "r"."""
    number = lane.key[2]
    left, right = (lane.inner, lane.outer) if number < 0 else (lane.outer, lane.inner)
    if not along:
        left, right = right[::-1], left[::-1]
    after = []
    for key, at in joints.of[lane.key, 1 if along else 0]:
        target = joints.lane(key)
        assert target is not None
        enters = target.forth == (at == 0)
        if enters or target.kind == "bidirectional":
            after.append(target.name + ("" if enters else "r"))
    beside = []
    for other in (number - 1, number + 1):
        neighbour = section.lanes.get(other)
        if neighbour is not None and neighbour.forth == along and _crossable(lane if abs(other) > abs(number) else neighbour):
            beside.append(neighbour.name)
    limit = math.nan
    with joints.faults.leaving_out("speed limit", lane.name):
        limit = _speed_limit(road, lane.element, float(section.s[0]))
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
    )


def _crossable(lane: _Lane) -> bool:
    """Whether a lane's outer mark may be crossed."""
    marks = lane.element.all("roadMark")
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
