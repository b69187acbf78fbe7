# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""CommonRoad maps, XML of versions 2018b and 2020a; its obstacles and planning problems are passed over.

Source: CommonRoad's documentation of the XML format, 2018b and 2020a.
"""

from collections.abc import Iterator
from dataclasses import replace
import math

import numpy as np

from scenario_gen.base.documents import shown
from scenario_gen.base.errors import InputError
from scenario_gen.base.xml_reader import Element
from scenario_gen.numerics import Floats
from scenario_gen.roads.vector.network import (
    by_id,
    Draft,
    Faults,
    MapLanes,
    refuse_too_many_lanes,
    speed_of,
)
from scenario_gen.roads.vector.signs import DraftRule, kind_of_sign
from scenario_gen.types import (
    CARS,
    DRIVERS,
    LANE_USERS,
    Note,
    NoteKind,
    RuleKind,
)

_BY_TYPE = {  # of a lanelet: who may use it, whatever users it names
    "sidewalk": frozenset(("pedestrian",)), "crosswalk": frozenset(("pedestrian",)), "bicycleLane": frozenset(("bicycle",)),
    "busLane": frozenset(("bus",)),
    **dict.fromkeys(("shoulder", "parking", "border", "railway", "restricted"), frozenset[str]()),
}  # fmt: skip
_USERS = {
    "vehicle": DRIVERS,
    "car": DRIVERS,
    **{name: frozenset((name,)) for name in LANE_USERS - CARS},
}
_MOTORWAYS = frozenset(
    ("interstate", "highway")
)  # types of lanelets on which nobody rides a bicycle
_MAX_SPEED = ("274", "274.1", "R2-1", "maxSpeed")  # names and national numbers of the sign


def lanes_of(root: Element) -> MapLanes:
    """Return the lanes of a CommonRoad file.

    Raises:
        InputError: it is broken; names file and line.
    """
    faults = Faults()
    lanelets = by_id(root.findall("lanelet"), faults)
    refuse_too_many_lanes(len(lanelets), root.file)
    limits = _speed_signs(root, faults)
    junctions = _junctions(root, set(lanelets), faults)
    users = {name: own for name, lanelet in lanelets.items() if (own := _users(lanelet))}
    back = {
        name: own & _named(_texts(lanelets[name], "userBidirectional")) & DRIVERS
        for name, own in users.items()
    }
    both_ways = {name for name, own in back.items() if own}
    drafts = []
    for name, lanelet in ((name, lanelets[name]) for name in users):
        with faults.leaving_out("lanelet", name):
            left, right = (_points(lanelet.child(tag)) for tag in ("leftBound", "rightBound"))
            successors = tuple(after.attribute("ref") for after in lanelet.findall("successor"))
            for unknown in (after for after in successors if after not in lanelets):
                reason = f"{lanelet.place}: lanelet {name} leads to lanelet {unknown}, which is not there"
                faults.found.append(("link", f"{name} to {unknown}", reason))
            beside = tuple(
                side.attribute("ref")
                for tag in ("adjacentLeft", "adjacentRight")
                for side in lanelet.findall(tag)
                if side.get("drivingDir") == "same"
            )
            limit, junction = _speed_limit(lanelet, limits), junctions.get(name, "")
            draft = Draft(
                name,
                left,
                right,
                successors,
                beside,
                limit,
                junction,
                lanelet.place,
                users=users[name],
            )
            drafts.append(replace(draft, crossing="crosswalk" in _texts(lanelet, "laneletType")))
            if name in both_ways:
                before = tuple(
                    f"{other.attribute('ref')}r"
                    for other in lanelet.findall("predecessor")
                    if other.attribute("ref") in both_ways
                )
                borders = right[::-1], left[::-1]
                drafts.append(
                    Draft(
                        f"{name}r",
                        *borders,
                        before,
                        (),
                        limit,
                        junction,
                        lanelet.place,
                        users=back[name],
                    )
                )
    version = root.get("commonRoadVersion", "?")
    coordinates = Note.of(NoteKind.COORDINATES, format=f"CommonRoad {version}")
    notes = (coordinates, *_georeference(root))
    rules = list(
        _rules(root, {name: lanelets[name] for name, own in users.items() if own & CARS}, faults)
    )
    others = [
        sign for sign in root.findall("trafficSign") if not any(map(_means, _sign_names(sign)))
    ]
    return MapLanes(drafts, notes, len(lanelets) - len(users), faults, rules, len(others))


def _texts(lanelet: Element, tag: str) -> set[str]:
    return {child.content for child in lanelet.findall(tag)}


def _named(names: set[str]) -> frozenset[str]:
    """Who may use a lanelet whose users have some names; `car` opens it to all that drive, unless others are named."""
    alone = "car" in names and names & {"truck", "bus", "motorcycle"}
    own, others = (frozenset((*CARS, "van")), names - CARS) if alone else (frozenset[str](), names)
    return own.union(*(_USERS.get(name, frozenset()) for name in others))


def _users(lanelet: Element) -> frozenset[str]:
    """Who may use a lanelet: as its type says, else who is named; all that drive where nobody is, or only who has priority."""
    kinds, names = (
        _texts(lanelet, "laneletType"),
        _texts(lanelet, "userOneWay") | _texts(lanelet, "userBidirectional"),
    )
    typed = [_BY_TYPE[kind] for kind in kinds if kind in _BY_TYPE]
    if typed:
        return frozenset.intersection(*typed)
    users = _named(names) if names - {"priorityVehicle"} else DRIVERS
    return users - {"bicycle"} if kinds & _MOTORWAYS else users


def _sign_names(sign: Element) -> list[str]:
    ids = [element.find("trafficSignID") for element in sign.findall("trafficSignElement")]
    return [element.content for element in ids if element is not None]


def _means(name: str) -> bool:
    """Whether a sign is read."""
    return name in _MAX_SPEED or kind_of_sign(name) is not None


def _rules(root: Element, lanelets: dict[str, Element], faults: Faults) -> Iterator[DraftRule]:
    """Yield the rules of the signs and lights to which lanelets refer, one for each lanelet."""
    kinds: dict[tuple[str, str], RuleKind] = {}
    for sign in root.findall("trafficSign"):
        known = [kind for kind in map(kind_of_sign, _sign_names(sign)) if kind is not None]
        if known:
            kinds["trafficSignRef", sign.get("id", "?")] = known[0]
    for light in root.findall("trafficLight"):
        kinds["trafficLightRef", light.get("id", "?")] = RuleKind.TRAFFIC_LIGHT
    for name, lanelet in lanelets.items():
        with faults.leaving_out("stop line", name):
            stop = lanelet.find("stopLine")
            holders = [lanelet] if stop is None else [lanelet, stop]
            line = (
                _points(stop)[:, :2]
                if stop is not None and len(stop.findall("point")) > 1
                else np.zeros((0, 2))
            )
            refs = dict.fromkeys(
                (tag, ref.attribute("ref"))
                for tag, _ in kinds
                for holder in holders
                for ref in holder.findall(tag)
            )
            for ref in refs:
                if ref in kinds:
                    yield DraftRule(ref[1], kinds[ref], (name,), line=line)


def _georeference(root: Element) -> list[Note]:
    reference = root.find("location/geoTransformation/geoReference")
    if reference is None:
        return []
    text = " ".join(reference.content.split())
    return [Note.of(NoteKind.GEOREFERENCE_IGNORED, reference=text)]


def _points(bound: Element) -> Floats:
    """Points (P, 3) [m] of a bound or a line, with their height, NaN where it is not given."""
    heights = [(point, point.find("z")) for point in bound.findall("point")]
    points = [
        (p.child("x").value(), p.child("y").value(), math.nan if z is None else z.value())
        for p, z in heights
    ]
    return np.array(points, dtype=np.float64).reshape(-1, 3)


def _speed_signs(root: Element, faults: Faults) -> dict[str, float]:
    """Speed limits [m/s] by the id of their sign; those of converters of data sets may have a unit: `50kmh`."""
    limits = {}
    for sign in root.findall("trafficSign"):
        for element in sign.findall("trafficSignElement"):
            kind, value = element.find("trafficSignID"), element.find("additionalValue")
            if kind is not None and value is not None and kind.content in _MAX_SPEED:
                with faults.leaving_out("speed sign", sign.get("id", "?")):
                    limit = speed_of(value.content, "m/s")
                    if math.isnan(limit):
                        raise InputError(
                            f"{value.place}: {shown(value.content, 40)!r} is no speed"
                        )
                    limits[sign.attribute("id")] = limit
    return limits


def _speed_limit(lanelet: Element, signs: dict[str, float]) -> float:
    own = lanelet.find("speedLimit")
    if own is not None:
        return own.value()
    return min(
        (
            signs[ref.attribute("ref")]
            for ref in lanelet.findall("trafficSignRef")
            if ref.get("ref") in signs
        ),
        default=math.nan,
    )


def _junctions(root: Element, known: set[str], faults: Faults) -> dict[str, str]:
    """The intersection of each lanelet that lies in one: those that follow its incoming lanelets."""
    junctions: dict[str, str] = {}
    for intersection in root.findall("intersection"):
        for incoming in intersection.findall("incoming"):
            for tag in ("successorsLeft", "successorsRight", "successorsStraight"):
                for ref in incoming.findall(tag):
                    with faults.leaving_out("link of an intersection", ref.get("ref", "?")):
                        if ref.attribute("ref") not in known:
                            raise InputError(
                                f"{ref.place}: lanelet {ref.attribute('ref')} is not there"
                            )
                        junctions[ref.attribute("ref")] = intersection.attribute("id")
    return junctions
