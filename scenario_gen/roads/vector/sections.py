# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The lane sections of an OpenDRIVE road: the borders of its lanes, cross-section by cross-section.

Source: ASAM OpenDRIVE 1.8, chapter "Lanes".
"""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
import math

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.base.xml_reader import Element
from scenario_gen.numerics import Floats
from scenario_gen.numerics.plane import unit_left
from scenario_gen.roads.vector.network import refuse_too_long, refuse_too_many_lanes
from scenario_gen.roads.vector.plan_view import Cubics, cubics, ReferenceLine
from scenario_gen.types import CARS, DRIVERS, LANE_USERS

FOR_CARS = frozenset(
    (
        "driving",
        "entry",
        "exit",
        "onRamp",
        "offRamp",
        "connectingRamp",
        "slipLane",
        "bidirectional",
        "mwyEntry",
        "mwyExit",
        "HOV",
    )
)
_BY_KIND = {
    **dict.fromkeys(FOR_CARS, DRIVERS), "biking": frozenset(("bicycle",)), "bus": frozenset(("bus",)),
    "sidewalk": frozenset(("pedestrian",)), "walking": frozenset(("pedestrian",)), "shared": frozenset(("bicycle", "pedestrian")),
}  # fmt: skip
_MOTORWAYS = frozenset(
    ("entry", "exit", "onRamp", "offRamp", "connectingRamp", "mwyEntry", "mwyExit", "HOV")
)
STEP = 0.5  # metres between cross-sections
_SIDES = (("left", 1), ("right", -1))  # and the sign of their lanes' ids
_ANYBODY = frozenset(
    ("none", "simulator", "autonomousTraffic", "throughTraffic")
)  # restrictions that name no type
_RESTRICTED = {  # whom a restriction of access names
    "passengerCar": frozenset(("car", "van")), "delivery": frozenset(("van",)), "trucks": frozenset(("truck",)),
    **{name: frozenset((name,)) for name in LANE_USERS - CARS - {"van"}},
}  # fmt: skip

Key = tuple[str, int, int]  # road, section, lane


@dataclass(frozen=True, eq=False)
class SectionLane:
    """A lane of one section.

    Attributes:
        key: its road, section and id.
        element: of the file.
        s: (M,) [m] of its cross-sections.
        inner: (M, 2) [m] its border towards the centre lane, in the order of s.
        outer: (M, 2) [m] the other one.
        forth: whether it is driven in the direction of growing s.
    """

    key: Key
    element: Element
    s: Floats
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
        return str(self.element.get("type", "none"))

    @property
    def both_ways(self) -> bool:
        """Whether it is driven in both directions."""
        return self.kind == "bidirectional" or self.element.get("direction") == "both"

    @cached_property
    def users(self) -> frozenset[str]:
        """Who may use all of it, by its type and its records of access."""
        users = _BY_KIND.get(self.kind, frozenset()) - (
            frozenset(("bicycle",)) if self.kind in _MOTORWAYS else frozenset()
        )
        records: dict[tuple[str, str], set[str]] = defaultdict(
            set
        )  # who may, or may not, from some sOffset on
        for access in self.element.findall("access"):
            names = [
                access.get("restriction"),
                *(own.get("type") for own in access),
            ]  # before, in 1.8
            records[access.get("sOffset", "0"), access.get("rule", "deny")].update(
                filter(None, names)
            )
        for (_, rule), restricted in records.items():
            named = frozenset[str]().union(
                *(_RESTRICTED.get(name, frozenset()) for name in restricted)
            )
            users = (
                users - named
                if rule == "deny"
                else users
                if restricted & _ANYBODY
                else users & named
            )
        return users

    def middle(self, at: int) -> Floats:
        """(2,) [m] its middle at lower s (0) or at higher s (1)."""
        return np.asarray((self.outer[-at] + self.inner[-at]) / 2.0)


@dataclass(frozen=True, eq=False)
class LaneSection:
    """A lane section: its lanes by id, and the signs of the sides whose lanes it lists: both, or one (`singleSide`)."""

    lanes: dict[int, SectionLane]
    signs: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class _Stations:
    """Where a section has its cross-sections.

    Attributes:
        s: (M,) [m] along the road.
        end: metres at which the section ends.
        poses: (M, 3) of the reference line.
        centre: (M,) [m] to its left, where the centre lane lies.
    """

    s: Floats
    end: float
    poses: Floats
    centre: Floats


@dataclass(frozen=True, eq=False)
class OpenDriveRoad:
    """A road: its element, id, line and junction, the side on which one drives, its height along s, its lane sections."""

    element: Element
    id: str
    line: ReferenceLine
    junction: str
    left_hand: bool
    elevation: Cubics
    sections: list[LaneSection] = field(default_factory=list)

    def beyond(self, section: int, step: int, lane: int) -> int | None:
        """The next section after (step 1) or before (-1) one that lists the lanes of a lane's side; None: the road ends."""
        k = section + step
        while 0 <= k < len(self.sections):
            if math.copysign(1, lane) in self.sections[k].signs:
                return k
            k += step
        return None


def road_of_sections(element: Element, name: str, line: ReferenceLine) -> OpenDriveRoad:
    """Return a road with its sections.

    Raises:
        InputError: it is broken; names file and line.
    """
    junction = element.get("junction", "-1")
    elevation = element.find("elevationProfile")
    road = OpenDriveRoad(
        element,
        name,
        line,
        "" if junction == "-1" else junction,
        element.get("rule", "RHT") == "LHT",
        cubics(elevation.findall("elevation") if elevation is not None else [], "s"),
    )
    lanes = element.child("lanes")
    offset = cubics(lanes.findall("laneOffset"), "s")
    sections = sorted(lanes.findall("laneSection"), key=lambda section: section.number("s"))
    if not sections:
        raise InputError(f"{lanes.place} has no <laneSection>")
    refuse_too_many_lanes(len(sections), element.file)
    begins = [min(max(section.number("s"), 0.0), line.length) for section in sections]
    road.sections.extend(LaneSection({}, _signs(section)) for section in sections)
    for k, (section, begin) in enumerate(zip(sections, begins, strict=True)):
        after = {sign: road.beyond(k, 1, sign) for sign in road.sections[k].signs}
        ends = {
            sign: line.length if other is None else begins[other] for sign, other in after.items()
        }
        for end in dict.fromkeys(ends.values()):
            breaks = line.begin[
                np.searchsorted(line.begin, begin, side="right") : np.searchsorted(line.begin, end)
            ]
            even = np.linspace(
                begin, max(end, begin + 1e-3), max(math.ceil((end - begin) / STEP), 1) + 1
            )
            s = np.unique(np.concatenate((even, breaks)))
            stations = _Stations(s, end, line.at(s, end), offset.at(s, end))
            for sign in (sign for sign in ends if ends[sign] == end):
                road.sections[k].lanes.update(_lanes(road, k, section, sign, stations))
    return road


def _signs(section: Element) -> tuple[int, ...]:
    """The signs of the sides whose lanes a section lists: those that it has if it is for a single side, else both."""
    single = section.get("singleSide") in ("true", "1")
    return tuple(sign for side, sign in _SIDES if not single or section.find(side) is not None)


def _lanes(
    road: OpenDriveRoad, number: int, section: Element, sign: int, stations: _Stations
) -> Iterator[tuple[int, SectionLane]]:
    """The lanes of one side of a section, with the section's number in the road, by id."""
    s, begin, end = stations.s, float(stations.s[0]), stations.end
    normal, across = unit_left(stations.poses[:, 2]), stations.centre
    inner = stations.poses[:, :2] + across[:, None] * normal
    elements = [
        lane
        for side, own in _SIDES
        if own == sign
        for group in section.findall(side)[:1]
        for lane in group.findall("lane")
    ]
    refuse_too_many_lanes(len(elements), section.file)
    refuse_too_long(len(elements) * len(s), section.file)
    for count, lane in enumerate(
        sorted(elements, key=lambda lane: sign * _lane_id(lane, sign)), 1
    ):
        name = _lane_id(lane, sign)
        if name != sign * count:
            raise InputError(
                f"{lane.place}: lane {name} is there twice, or those between it and the centre are missing"
            )
        if lane.findall("width"):
            width = cubics(lane.findall("width"), "sOffset").at(s - begin, end - begin)
            across = across + sign * np.maximum(width, 0.0)
        elif lane.findall("border"):
            across = (
                cubics(lane.findall("border"), "sOffset").at(s - begin, end - begin)
                + stations.centre
            )
        outer = stations.poses[:, :2] + across[:, None] * normal
        forth = ((name < 0) != road.left_hand) != (lane.get("direction") == "reversed")
        yield name, SectionLane((road.id, number, name), lane, s, inner, outer, forth)
        inner = outer


def _lane_id(lane: Element, sign: int) -> int:
    try:
        number = int(lane.attribute("id"))
    except ValueError:
        number = 0
    if number * sign <= 0:
        raise InputError(
            f"{lane.place}: id {lane.attribute('id')[:20]!r}; whole numbers {'above' if sign > 0 else 'below'} 0 are needed here"
        )
    return number
