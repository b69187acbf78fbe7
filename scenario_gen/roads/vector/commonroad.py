# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""CommonRoad maps: XML of versions 2018b and 2020a, without what moves and planning problems.

Source: CommonRoad's documentation of the XML format, 2018b and 2020a.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
import math

import numpy as np
import shapely

from scenario_gen.base.documents import shown
from scenario_gen.base.errors import InputError
from scenario_gen.base.xml_reader import Element
from scenario_gen.logs.adapters.commonroad import cycle_of, point_of, turns_of
from scenario_gen.numerics import Floats, place
from scenario_gen.roads.vector.drafts import (
    by_id,
    Draft,
    Faults,
    MapLanes,
    refuse_too_many_lanes,
    speed_of,
)
from scenario_gen.roads.vector.signs import DraftRule, is_speed_limit, kind_of_sign
from scenario_gen.types import (
    CARS,
    DRIVERS,
    LANE_USERS,
    Note,
    NoteKind,
    Obstacle,
    RuleKind,
)

_USERS_BY_TYPE = {
    "sidewalk": frozenset(("pedestrian",)),
    "crosswalk": frozenset(("pedestrian",)),
    "bicycleLane": frozenset(("bicycle",)),
    "busLane": frozenset(("bus",)),
    **dict.fromkeys(("shoulder", "parking", "border", "railway", "restricted"), frozenset[str]()),
}
"""Of lanelets, whatever users they name."""
_USERS_BY_NAME = {
    "vehicle": DRIVERS,
    "car": DRIVERS,
    **{name: frozenset((name,)) for name in LANE_USERS - CARS},
}
_MOTORWAY_TYPES = frozenset(("interstate", "highway"))


@dataclass(frozen=True)
class _Map:
    """A CommonRoad map.

    Attributes:
        root: of the file.
        lanelets: by id.
        faults: the elements that are left out.
    """

    root: Element
    lanelets: dict[str, Element]
    faults: Faults

    @classmethod
    def of(cls, root: Element) -> "_Map":
        """Read the lanelets of a map.

        Raises:
            TooLargeError: there are too many.
        """
        faults = Faults()
        lanelets = by_id(root.findall("lanelet"), faults)
        refuse_too_many_lanes(len(lanelets), root.file)
        return cls(root, lanelets, faults)

    @cached_property
    def users(self) -> dict[str, frozenset[str]]:
        """The users of each lanelet that has some."""
        users = {name: _users(lanelet) for name, lanelet in self.lanelets.items()}
        return {name: allowed for name, allowed in users.items() if allowed}

    @cached_property
    def reverse_users(self) -> dict[str, frozenset[str]]:
        """The drivers who may use a lanelet against its direction, if there are some."""
        reverse = {}
        for name, users in self.users.items():
            named = _named_users(_texts(self.lanelets[name], "userBidirectional"))
            if allowed := users & named & DRIVERS:
                reverse[name] = allowed
        return reverse

    @cached_property
    def speed_limits(self) -> dict[str, float]:
        """Speed limits [m/s] by the id of their sign."""
        limits = {}
        for element in self.root.findall("trafficSign/trafficSignElement"):
            name = element.getparent().get("id", "?")
            with self.faults.leaving_out("speed sign", name):
                limit = _speed_limit_of_sign(element)
                if not math.isnan(limit):
                    limits[name] = limit
        return limits

    @cached_property
    def junctions(self) -> dict[str, str]:
        """The intersection of each lanelet that follows one of its incoming lanelets."""
        junctions: dict[str, str] = {}
        tags = ("successorsLeft", "successorsRight", "successorsStraight")
        links = [
            (intersection, link)
            for intersection in self.root.findall("intersection")
            for incoming in intersection.findall("incoming")
            for link in incoming
            if link.tag in tags
        ]
        for intersection, link in links:
            with self.faults.leaving_out("link of an intersection", link.get("ref", "?")):
                name = link.attribute("ref")
                if name not in self.lanelets:
                    raise InputError(f"{link.place}: lanelet {name} is not in the map")
                junctions[name] = intersection.attribute("id")
        return junctions

    def drafts(self) -> Iterator[Draft]:
        """Yield the lanes, and those for both ways once more against their direction."""
        for name in self.users:
            with self.faults.leaving_out("lanelet", name):
                yield from self._drafts_of(name)

    def _drafts_of(self, name: str) -> Iterator[Draft]:
        lanelet = self.lanelets[name]
        left, right = (_points(lanelet.child(tag)) for tag in ("leftBound", "rightBound"))
        successors = tuple(link.attribute("ref") for link in lanelet.findall("successor"))
        for other in successors:
            if other not in self.lanelets:
                reason = f"{lanelet.place}: successor {other} of lanelet {name} is not in the map"
                self.faults.add("link", f"{name} to {other}", reason)
        neighbours = [
            link.attribute("ref")
            for tag in ("adjacentLeft", "adjacentRight")
            for link in lanelet.findall(tag)
            if link.get("drivingDir") == "same"
        ]
        draft = Draft(
            id=name,
            left=left,
            right=right,
            successors=successors,
            neighbours=tuple(neighbours),
            speed_limit=self._speed_limit(lanelet),
            junction=self.junctions.get(name, ""),
            place=lanelet.place,
            users=self.users[name],
            crossing="crosswalk" in _texts(lanelet, "laneletType"),
        )
        yield draft
        if name in self.reverse_users:
            before = [link.attribute("ref") for link in lanelet.findall("predecessor")]
            yield Draft(
                id=f"{name}r",
                left=right[::-1],
                right=left[::-1],
                successors=tuple(f"{other}r" for other in before if other in self.reverse_users),
                speed_limit=draft.speed_limit,
                junction=draft.junction,
                place=lanelet.place,
                users=self.reverse_users[name],
            )

    def _speed_limit(self, lanelet: Element) -> float:
        """Return the speed limit [m/s] of a lanelet, NaN if none is given."""
        limit = lanelet.find("speedLimit")
        if limit is not None:
            return limit.value()
        signs = [link.get("ref") for link in lanelet.findall("trafficSignRef")]
        limits = [self.speed_limits[sign] for sign in signs if sign in self.speed_limits]
        return min(limits, default=math.nan)

    def obstacles(self) -> Iterator[Obstacle]:
        """Yield the static obstacles."""
        roles = ((each, each.find("role")) for each in self.root.findall("obstacle"))
        static = [each for each, role in roles if role is not None and role.content == "static"]
        for obstacle in (*self.root.findall("staticObstacle"), *static):
            with self.faults.leaving_out("static obstacle", obstacle.get("id", "?")):
                yield _obstacle_of(obstacle)

    @cached_property
    def signs_and_lights(self) -> dict[tuple[str, str], DraftRule]:
        """Rules without lanes, by the tag of references to them and their ids."""
        rules: dict[tuple[str, str], DraftRule] = {}
        for sign in self.root.findall("trafficSign"):
            known = [kind for kind in map(kind_of_sign, _sign_names(sign)) if kind is not None]
            name = sign.get("id", "?")
            if known:
                rules["trafficSignRef", name] = DraftRule(name, known[0], ())
        for light in self.root.findall("trafficLight"):
            name, schedule = light.get("id", "?"), None
            with self.faults.leaving_out("traffic light", name):
                if light.find("cycle") is not None:
                    schedule = cycle_of(light, self.root.number("timeStepSize", 0.1))
            kind, turns = RuleKind.TRAFFIC_LIGHT, turns_of(light)
            rules["trafficLightRef", name] = DraftRule(
                name, kind, (), schedule=schedule, turns=turns
            )
        return rules

    def rules(self) -> Iterator[DraftRule]:
        """Yield a rule for each sign and light to which a lanelet for cars refers."""
        for name in (name for name, users in self.users.items() if users & CARS):
            with self.faults.leaving_out("stop line", name):
                yield from self._rules_of(name)

    def _rules_of(self, name: str) -> Iterator[DraftRule]:
        lanelet = self.lanelets[name]
        line = _stop_line(lanelet)
        refs = [
            (tag, link.attribute("ref"))
            for tag in ("trafficSignRef", "trafficLightRef")
            for path in (tag, f"stopLine/{tag}")
            for link in lanelet.findall(path)
        ]
        known = [ref for ref in dict.fromkeys(refs) if ref in self.signs_and_lights]
        for ref in known:
            yield replace(self.signs_and_lights[ref], lanes=(name,), line=line)

    def notes(self) -> Iterator[Note]:
        """Yield the notes on the file."""
        version = self.root.get("commonRoadVersion", "?")
        yield Note.of(NoteKind.COORDINATES, format=f"CommonRoad {version}")
        reference = self.root.find("location/geoTransformation/geoReference")
        if reference is not None:
            text = " ".join(reference.content.split())
            yield Note.of(NoteKind.GEOREFERENCE_IGNORED, reference=text)


def lanes_of(root: Element) -> MapLanes:
    """Return the lanes of a CommonRoad file.

    Raises:
        InputError: it is broken; names file and line.
    """
    commonroad = _Map.of(root)
    signs = root.findall("trafficSign")
    return MapLanes(
        list(commonroad.drafts()),
        tuple(commonroad.notes()),
        unsupported=len(commonroad.lanelets) - len(commonroad.users),
        faults=commonroad.faults,
        rules=list(commonroad.rules()),
        obstacles=tuple(commonroad.obstacles()),
        other_signs=sum(not any(map(_is_known_sign, _sign_names(sign))) for sign in signs),
    )


def _texts(lanelet: Element, tag: str) -> set[str]:
    return {child.content for child in lanelet.findall(tag)}


def _named_users(names: set[str]) -> frozenset[str]:
    """Return the users with some names; `car` means all drivers, unless others are named, too."""
    users = frozenset[str]()
    if "car" in names and names & {"truck", "bus", "motorcycle"}:
        users, names = frozenset((*CARS, "van")), names - CARS
    return users.union(*(_USERS_BY_NAME.get(name, frozenset()) for name in names))


def _users(lanelet: Element) -> frozenset[str]:
    """Return the users of a lanelet by its type, or those that it names.

    All drivers may use it if it names nobody, or only priority vehicles.
    """
    types = _texts(lanelet, "laneletType")
    by_type = [_USERS_BY_TYPE[name] for name in types if name in _USERS_BY_TYPE]
    if by_type:
        return frozenset.intersection(*by_type)
    names = _texts(lanelet, "userOneWay") | _texts(lanelet, "userBidirectional")
    users = _named_users(names) if names - {"priorityVehicle"} else DRIVERS
    return users - {"bicycle"} if types & _MOTORWAY_TYPES else users


def _sign_names(sign: Element) -> list[str]:
    ids = [element.find("trafficSignID") for element in sign.findall("trafficSignElement")]
    return [element.content for element in ids if element is not None]


def _is_known_sign(name: str) -> bool:
    return is_speed_limit(name) or kind_of_sign(name) is not None


def _speed_limit_of_sign(element: Element) -> float:
    """Return the limit [m/s] of an element of a traffic sign, NaN if it is another sign.

    Signs from converters of data sets may have a unit, as in `50kmh`.

    Raises:
        InputError: its value is not a speed.
    """
    kind, value = element.find("trafficSignID"), element.find("additionalValue")
    if kind is None or value is None or not is_speed_limit(kind.content):
        return math.nan
    limit = speed_of(value.content, "m/s")
    if math.isnan(limit):
        raise InputError(f"{value.place}: {shown(value.content, 40)!r} is not a speed")
    return limit


def _stop_line(lanelet: Element) -> Floats:
    """Return the stop line (K, 2) [m] of a lanelet, (0, 2) without one."""
    stop = lanelet.find("stopLine")
    if stop is None or len(stop.findall("point")) < 2:
        return np.zeros((0, 2))
    return _points(stop)[:, :2]


def _points(bound: Element) -> Floats:
    """Return the points (P, 3) [m] of a bound or a line, with NaN for unknown heights."""
    points = []
    for point in bound.findall("point"):
        height = point.find("z")
        z = math.nan if height is None else height.value()
        points.append((point.child("x").value(), point.child("y").value(), z))
    return np.array(points, dtype=np.float64).reshape(-1, 3)


def _obstacle_of(element: Element) -> Obstacle:
    """Return a static obstacle; a polygon counts as the smallest rectangle around it."""
    state = element.child("initialState")
    yaw = state.child("orientation/exact").value()
    pose = np.array([*point_of(state.child("position/point")), yaw])
    centre, turn = np.zeros(2), 0.0
    circle, polygon = element.find("shape/circle/radius"), element.find("shape/polygon")
    if polygon is not None:
        corners = [point_of(point) for point in polygon.findall("point")]
        box = shapely.oriented_envelope(shapely.MultiPoint(corners))
        outline = shapely.get_coordinates(box)
        if len(outline) != 5:
            raise InputError(f"{element.place}: its polygon has no area")
        centre = outline[:4].mean(axis=0)
        ahead, left = outline[1] - outline[0], outline[2] - outline[1]
        turn = float(np.arctan2(ahead[1], ahead[0]))
        size = [float(np.hypot(*ahead)), float(np.hypot(*left))]
    elif circle is not None:
        size = [2.0 * circle.value()] * 2
    else:
        sides = ("shape/rectangle/length", "shape/rectangle/width")
        size = [element.child(side).value() for side in sides]
    x, y = place(pose, *centre.tolist()).tolist()
    return Obstacle(x, y, yaw + turn, *size)
