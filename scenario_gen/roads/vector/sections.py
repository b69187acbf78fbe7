# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The lane sections of an OpenDRIVE road: the borders of its lanes as cross-sections.

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
from scenario_gen.numerics import Floats, unit_left
from scenario_gen.roads.vector.drafts import Faults, refuse_too_long, refuse_too_many_lanes
from scenario_gen.roads.vector.plan_view import Cubics, cubics, ReferenceLine
from scenario_gen.types import CARS, DRIVERS, LANE_USERS

CROSS_SECTION_STEP_M = 0.5
_MOTORWAY_TYPES = frozenset(
    ("entry", "exit", "onRamp", "offRamp", "connectingRamp", "mwyEntry", "mwyExit", "HOV")
)
CAR_LANE_TYPES = _MOTORWAY_TYPES | {"driving", "slipLane", "bidirectional"}
_USERS_BY_TYPE = {
    **dict.fromkeys(CAR_LANE_TYPES, DRIVERS),
    **dict.fromkeys(_MOTORWAY_TYPES, DRIVERS - {"bicycle"}),
    "biking": frozenset(("bicycle",)),
    "bus": frozenset(("bus",)),
    "sidewalk": frozenset(("pedestrian",)),
    "walking": frozenset(("pedestrian",)),
    "shared": frozenset(("bicycle", "pedestrian")),
}
_SIDES = {1: "left", -1: "right"}
"""By the sign of their lanes' ids."""
_UNSPECIFIC_RESTRICTIONS = frozenset(("none", "simulator", "autonomousTraffic", "throughTraffic"))
_USERS_BY_RESTRICTION = {
    "passengerCar": frozenset(("car", "van")),
    "delivery": frozenset(("van",)),
    "trucks": frozenset(("truck",)),
    **{name: frozenset((name,)) for name in LANE_USERS - CARS - {"van"}},
}

Key = tuple[str, int, int]
"""Road, section, lane."""


@dataclass(frozen=True, eq=False)
class SectionLane:
    """A lane of one section.

    Attributes:
        key: its road, section and id.
        element: of the file.
        s: (M,) [m] of its cross-sections.
        inner: (M, 2) [m] its border towards the centre lane, in the order of s.
        outer: (M, 2) [m] its other border.
        forward: whether it is driven in the direction of growing s.
    """

    key: Key
    element: Element
    s: Floats
    inner: Floats
    outer: Floats
    forward: bool

    @property
    def name(self) -> str:
        """Road, section and id."""
        return ".".join(map(str, self.key))

    @property
    def type(self) -> str:
        """Its type in the file."""
        return str(self.element.get("type", "none"))

    @property
    def is_car_lane(self) -> bool:
        """Whether its type is one for cars."""
        return self.type in CAR_LANE_TYPES

    @property
    def both_ways(self) -> bool:
        """Whether it is driven in both directions."""
        return self.type == "bidirectional" or self.element.get("direction") == "both"

    @cached_property
    def users(self) -> frozenset[str]:
        """The users who may use all of it, by its type and its records of access."""
        users = _USERS_BY_TYPE.get(self.type, frozenset())
        # Records with the same offset and rule belong together.
        records: dict[tuple[str, str], set[str]] = defaultdict(set)
        for access in self.element.findall("access"):
            key = access.get("sOffset", "0"), access.get("rule", "deny")
            nested = [child.get("type") for child in access]  # since version 1.8
            records[key].update(filter(None, [access.get("restriction"), *nested]))
        for (_, rule), restrictions in records.items():
            named = [_USERS_BY_RESTRICTION.get(name, frozenset()) for name in restrictions]
            named_users = frozenset[str]().union(*named)
            if rule == "deny":
                users -= named_users
            elif not restrictions & _UNSPECIFIC_RESTRICTIONS:
                users &= named_users
        return users

    def centre(self, at: int) -> Floats:
        """Return its centre (2,) [m] at lower s (0) or at higher s (1)."""
        return np.asarray((self.outer[-at] + self.inner[-at]) / 2.0)


@dataclass(frozen=True, eq=False)
class LaneSection:
    """A lane section.

    Attributes:
        lanes: its lanes by id.
        signs: of the sides whose lanes it lists: both, or one (`singleSide`).
    """

    lanes: dict[int, SectionLane]
    signs: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class _Stations:
    """The cross-sections of a lane section.

    Attributes:
        s: (M,) [m] along the road.
        end: [m] where the section ends.
        poses: (M, 3) of the reference line.
        centre: (M,) [m] the centre lane's offset to the left.
    """

    s: Floats
    end: float
    poses: Floats
    centre: Floats

    def values(self, records: list[Element]) -> Floats:
        """Return the values (M,) [m] of records that begin at `sOffset` in the section."""
        begin = float(self.s[0])
        return cubics(records, "sOffset").at(self.s - begin, self.end - begin)


@dataclass(frozen=True, eq=False)
class OpenDriveRoad:
    """A road of an OpenDRIVE map.

    Attributes:
        element: of the file.
        id: its id.
        line: its reference line.
        junction: its junction, "" if none.
        left_hand: whether its traffic keeps left.
        elevation: along s [m].
        sections: its lane sections.
    """

    element: Element
    id: str
    line: ReferenceLine
    junction: str
    left_hand: bool
    elevation: Cubics
    sections: list[LaneSection] = field(default_factory=list)

    @property
    def lanes(self) -> Iterator[SectionLane]:
        """All its lanes, section by section."""
        return (lane for section in self.sections for lane in section.lanes.values())

    def next_section(self, section: int, step: int, lane: int) -> int | None:
        """Return the next section after (step 1) or before (-1) one, which lists a lane's side.

        It is None where the road ends.
        """
        k = section + step
        while 0 <= k < len(self.sections):
            if math.copysign(1, lane) in self.sections[k].signs:
                return k
            k += step
        return None


def road_of_sections(
    element: Element, name: str, line: ReferenceLine, faults: Faults
) -> OpenDriveRoad:
    """Return a road with its sections; lanes whose place is not certain become faults.

    Raises:
        InputError: it is broken; names file and line.
    """
    junction = element.get("junction", "-1")
    road = OpenDriveRoad(
        element,
        name,
        line,
        "" if junction == "-1" else junction,
        element.get("rule", "RHT") == "LHT",
        cubics(element.findall("elevationProfile/elevation"), "s"),
    )
    lanes = element.child("lanes")
    centre = cubics(lanes.findall("laneOffset"), "s")
    sections = sorted(lanes.findall("laneSection"), key=lambda section: section.number("s"))
    if not sections:
        raise InputError(f"{lanes.place} has no <laneSection>")
    refuse_too_many_lanes(len(sections), element.file)
    begins = [min(max(section.number("s"), 0.0), line.length) for section in sections]
    road.sections.extend(LaneSection({}, _signs(section)) for section in sections)
    for k, section in enumerate(sections):
        signs_by_end: dict[float, list[int]] = defaultdict(list)
        for sign in road.sections[k].signs:
            following = road.next_section(k, 1, sign)
            signs_by_end[line.length if following is None else begins[following]].append(sign)
        for end, signs in signs_by_end.items():
            s = _stations(line, begins[k], end)
            stations = _Stations(s, end, line.at(s, end), centre.at(s, end))
            for sign in signs:
                lanes_of_side = _lanes_of_side(road, k, section, sign, stations, faults)
                road.sections[k].lanes.update(lanes_of_side)
    return road


def _stations(line: ReferenceLine, begin: float, end: float) -> Floats:
    """Return the arc lengths (M,) [m] of cross-sections, among them the begins of geometries."""
    first = np.searchsorted(line.begin, begin, side="right")
    last = np.searchsorted(line.begin, end)
    count = max(math.ceil((end - begin) / CROSS_SECTION_STEP_M), 1) + 1
    even = np.linspace(begin, max(end, begin + 1e-3), count)
    return np.unique(np.concatenate((even, line.begin[first:last])))


def _signs(section: Element) -> tuple[int, ...]:
    """Return the signs of the sides whose lanes a section lists."""
    single = section.get("singleSide") in ("true", "1")
    return tuple(
        sign for sign, side in _SIDES.items() if not single or section.find(side) is not None
    )


def _lanes_of_side(
    road: OpenDriveRoad,
    number: int,
    section: Element,
    sign: int,
    stations: _Stations,
    faults: Faults,
) -> Iterator[tuple[int, SectionLane]]:
    """Yield the lanes on one side of the road's section with a number, by id."""
    side = section.find(_SIDES[sign])
    elements = [] if side is None else side.findall("lane")
    refuse_too_many_lanes(len(elements), section.file)
    refuse_too_long(len(elements) * len(stations.s), section.file)

    normal = unit_left(stations.poses[:, 2])
    offset = stations.centre
    inner = stations.poses[:, :2] + offset[:, None] * normal
    elements.sort(key=lambda lane: sign * lane.number("id"))
    for count, lane in enumerate(elements, start=1):
        name = int(lane.number("id"))
        if name != sign * count:
            reason = (
                f"{lane.place}: lane {name} is a second one, on the wrong side, or beyond a "
                "missing one"
            )
            faults.add("lane", f"{road.id}.{number}.{name} and those beyond it", reason)
            return
        widths, borders = lane.findall("width"), lane.findall("border")
        if widths:
            offset = offset + sign * np.maximum(stations.values(widths), 0.0)
        elif borders:
            offset = stations.values(borders) + stations.centre
        outer = stations.poses[:, :2] + offset[:, None] * normal
        forward = ((name < 0) != road.left_hand) != (lane.get("direction") == "reversed")
        key = road.id, number, name
        drawn = SectionLane(key, lane, stations.s, inner, outer, forward)
        if drawn.users and not widths and not borders:
            faults.add("lane", drawn.name, f"{lane.place}: it has neither width nor border")
        yield name, drawn
        inner = outer
