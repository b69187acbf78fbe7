# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Lanelet2 maps (.osm), of Lanelet2 itself and in Autoware's dialect.

Source: Lanelet2's documents on primitives, tagging and the routing graph (LaneletAndAreaTagging, LinestringTagging), and
Autoware's on `local_x`, `local_y`, `turn_direction` and `intersection_area`.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
import math
from pathlib import Path
import re

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.base.markup import Element, finite, read_xml
from scenario_gen.logs import local_frame
from scenario_gen.numerics import exact, Floats
from scenario_gen.roads.vector.network import Draft, network_of, refuse_too_long, refuse_too_many_lanes
from scenario_gen.types import LaneNetwork

_FOR_CARS = ("road", "highway", "play_street", "exit")  # subtypes that cars may use, if no participant is named
_KMH = 1.0 / 3.6
_LIMITS = {  # m/s by subtype and location, where no sign says: Lanelet2's German traffic rules
    ("road", "urban"): 50.0 * _KMH,
    ("road", "nonurban"): 100.0 * _KMH,
    ("highway", "urban"): 130.0 * _KMH,
    ("highway", "nonurban"): 130.0 * _KMH,
    ("play_street", "urban"): 7.0 * _KMH,
}
_UNITS = {"": _KMH, "km/h": _KMH, "kmh": _KMH, "mph": 0.44704, "m/s": 1.0, "mps": 1.0}
_FARTHEST = 50_000.0  # metres from the middle of a map in latitude and longitude, as far as the local frame is exact
_CHANGE = {"dashed": (True, True), "dashed_solid": (True, False), "solid_dashed": (False, True)}  # from its left, from its right


@dataclass(frozen=True, eq=False)
class _Border:
    """A way of the map, in the direction in which a lanelet has it."""

    way: Element
    nodes: tuple[str, ...]
    points: Floats
    forth: bool = True

    def turned(self) -> "_Border":
        return replace(self, nodes=self.nodes[::-1], points=self.points[::-1], forth=not self.forth)


@dataclass(frozen=True, eq=False)
class _Lanelet:
    name: str
    relation: Element
    tags: dict[str, str]
    left: _Border
    right: _Border

    def turned(self) -> "_Lanelet":
        """The same lanelet driven the other way."""
        return replace(self, name=f"{self.name}r", left=self.right.turned(), right=self.left.turned())


def read_lanelet2(path: Path) -> LaneNetwork:
    """Return the lanes of a Lanelet2 map.

    Positions are those of the tags `local_x` and `local_y` if all nodes of lanelets have them, else those of latitude and
    longitude in the local frame (`geodesy`) about their middle.

    Raises:
        InputError: it is broken, has no usable coordinates, or no lanelet for cars; names file and line.
    """
    root = read_xml(path, f"map {path}")
    if root.tag != "osm":
        raise InputError(f"{root.place}: the root of a Lanelet2 map is <osm>")
    nodes, ways = _by_id(root, "node"), _by_id(root, "way")
    relations = _by_id(root, "relation")
    chosen, left_out = [], 0
    for relation in relations.values():
        tags = _tags(relation)
        if tags.get("type") == "lanelet":
            if _for_cars(tags):
                chosen.append((relation, tags))
            else:
                left_out += 1
    if not chosen:
        raise InputError(f"map {path}: none of its {left_out} lanelets is for cars")
    refuse_too_many_lanes(len(chosen), root.file)
    used = {ref: ways[ref] for relation, _ in chosen for ref in _refs(relation, ways)}
    refuse_too_long(sum(len(ways[ref].children) for relation, _ in chosen for ref in _refs(relation, ways)), root.file)
    positions, note = _positions({n: nodes for way in used.values() for n in _nodes(way, nodes)}, nodes, path)
    lanelets = []
    for relation, tags in chosen:
        lanelet = _lanelet(relation, tags, ways, nodes, positions)
        lanelets.append(lanelet)
        if tags.get("one_way") in ("no", "false"):
            lanelets.append(lanelet.turned())
    limits = {relation.get("id"): _sign_limit(relation, ways) for relation in relations.values()}
    notes = [f"Lanelet2: {note}"]
    if left_out:
        notes.append(f"{left_out} lanelets are for others than cars and were left out")
    return network_of(path.stem, list(_drafts(lanelets, limits)), notes)


def _by_id(root: Element, tag: str) -> dict[str, Element]:
    found: dict[str, Element] = {}
    for element in root.all(tag):
        name = element.get("id")
        if name in found:
            raise InputError(f"{element.place}: {tag} {name} is there twice, first on line {found[name].line}")
        if element.attributes.get("action") != "delete":  # as editors mark it
            found[name] = element
    return found


def _tags(element: Element) -> dict[str, str]:
    return {tag.get("k"): tag.get("v") for tag in element.all("tag")}


def _for_cars(tags: dict[str, str]) -> bool:
    """Whether cars may use a lanelet: by its participants, or else by its subtype."""
    named = {key.removeprefix("participant:"): value for key, value in tags.items() if key.startswith("participant:")}
    for key in ("vehicle:car", "vehicle"):
        if key in named:
            return named[key] in ("yes", "true")
    return not named and tags.get("subtype", "road") in _FOR_CARS


def _refs(relation: Element, ways: dict[str, Element]) -> list[str]:
    """The ways of the left and the right border.

    Raises:
        InputError: there is not one of each, or it is not in the map.
    """
    found = []
    for role in ("left", "right"):
        members = [member for member in relation.all("member") if member.attributes.get("role") == role]
        if len(members) != 1:
            raise InputError(
                f"{relation.place}: lanelet {relation.get('id')} has {len(members)} members with role {role}; one is needed"
            )
        ref = members[0].get("ref")
        if ref not in ways:
            raise InputError(f"{members[0].place}: way {ref} is not in the map")
        found.append(ref)
    return found


def _nodes(way: Element, nodes: dict[str, Element]) -> list[str]:
    refs = [nd.get("ref") for nd in way.all("nd")]
    for ref in refs:
        if ref not in nodes:
            raise InputError(f"{way.place}: way {way.get('id')} goes through node {ref}, which is not in the map")
    if len(refs) < 2:
        raise InputError(f"{way.place}: way {way.get('id')} has {len(refs)} node(s); two are needed")
    return refs


def _positions(used: "dict[str, object]", nodes: dict[str, Element], path: Path) -> tuple[dict[str, Floats], str]:
    """Metres of each used node, and a sentence on how they were found.

    Raises:
        InputError: a node has neither local coordinates nor a latitude and longitude, or they are far apart.
    """
    tags = {name: _tags(nodes[name]) for name in used}
    local = [name for name in used if {"local_x", "local_y"} <= tags[name].keys()]
    if local and len(local) < len(used):
        lacking = next(name for name in used if name not in set(local))
        raise InputError(
            f"{nodes[lacking].place}: node {lacking} has no tags local_x and local_y, but {len(local)} of {len(used)} have; "
            "two frames cannot be mixed"
        )
    if local:
        where = {
            name: np.array([finite(tags[name][key], f"{nodes[name].place}, tag {key}") for key in ("local_x", "local_y")])
            for name in used
        }
        return where, "coordinates are the tags local_x and local_y, in metres"
    degrees = np.empty((len(used), 2))
    for row, name in enumerate(used):
        node = nodes[name]
        for column, (key, most) in enumerate((("lat", 90.0), ("lon", 180.0))):
            if not node.attributes.get(key, ""):
                raise InputError(f"{node.place}: node {name} has neither tags local_x and local_y nor lat and lon")
            degrees[row, column] = node.number(key)
            if abs(degrees[row, column]) > most:
                raise InputError(
                    f"{node.place}: {key} is {degrees[row, column]:g}; degrees up to {most:g} are needed. A map in metres gives "
                    "them in tags local_x and local_y"
                )
    middle = np.round((degrees.min(axis=0) + degrees.max(axis=0)) / 2.0, 7)
    origin = (float(middle[0]), float(middle[1]))
    metres = local_frame(degrees[:, 0], degrees[:, 1], origin)
    size = float(exact.hypot(*metres.T).max())
    if not size <= _FARTHEST:
        raise InputError(
            f"map {path}: its nodes are up to {size / 1000.0:.0f} km from their middle; at most {_FARTHEST / 1000.0:g} are read"
        )
    note = f"latitude and longitude in metres east and north of {origin[0]:.7f}, {origin[1]:.7f} (azimuthal equidistant, WGS84)"
    return dict(zip(used, metres, strict=True)), note


def _lanelet(
    relation: Element, tags: dict[str, str], ways: dict[str, Element], nodes: dict[str, Element], positions: dict[str, Floats]
) -> _Lanelet:
    """A lanelet whose borders both go its way.

    A file may have them either way round: they are turned so that begin lies at begin, and left is on the left.
    """
    borders = []
    for ref in _refs(relation, ways):
        names = tuple(_nodes(ways[ref], nodes))
        borders.append(_Border(ways[ref], names, np.array([positions[name] for name in names])))
    left, right = borders
    a, b, c, d = left.points[0], left.points[-1], right.points[0], right.points[-1]
    straight = float(exact.hypot(*(a - c)) + exact.hypot(*(b - d)))
    if float(exact.hypot(*(a - d)) + exact.hypot(*(b - c))) < straight:
        right = right.turned()
    ring = np.concatenate((left.points, right.points[::-1]))
    after = np.roll(ring, -1, axis=0)
    if float((ring[:, 0] * after[:, 1] - ring[:, 1] * after[:, 0]).sum()) > 0.0:  # counter-clockwise: left lies on the right
        left, right = left.turned(), right.turned()
    return _Lanelet(relation.get("id"), relation, tags, left, right)


def _drafts(lanelets: list[_Lanelet], limits: dict[str, float]) -> Iterator[Draft]:
    """Lanelets with what the routing graph says: a lane follows where both borders go on, from the same two nodes."""
    begins: dict[tuple[str, str], list[str]] = {}
    on_left: dict[tuple[str, bool], list[str]] = {}  # way and direction -> lanelets of which it is the left border
    on_right: dict[tuple[str, bool], list[str]] = {}
    for lanelet in lanelets:
        begins.setdefault((lanelet.left.nodes[0], lanelet.right.nodes[0]), []).append(lanelet.name)
        on_left.setdefault((lanelet.left.way.get("id"), lanelet.left.forth), []).append(lanelet.name)
        on_right.setdefault((lanelet.right.way.get("id"), lanelet.right.forth), []).append(lanelet.name)
    for lanelet in lanelets:
        left, right = lanelet.left, lanelet.right
        beside = []
        if _may_change(right, to_right=True):
            beside += on_left.get((right.way.get("id"), right.forth), [])
        if _may_change(left, to_right=False):
            beside += on_right.get((left.way.get("id"), left.forth), [])
        after = begins.get((left.nodes[-1], right.nodes[-1]), [])
        own = lanelet.name.removesuffix("r")
        yield Draft(
            id=lanelet.name,
            left=left.points,
            right=right.points,
            successors=tuple(name for name in after if name.removesuffix("r") != own),
            beside=tuple(beside),
            speed_limit=_speed_limit(lanelet, limits),
            junction=lanelet.tags.get("intersection_area", ""),
            place=lanelet.relation.place,
        )


def _may_change(border: _Border, *, to_right: bool) -> bool:
    """Whether traffic may cross a border, which its lane has on the side to which it goes."""
    tags = _tags(border.way)
    for key in (f"lane_change:{'right' if to_right else 'left'}", "lane_change"):
        if key in tags:
            return tags[key] in ("yes", "true")
    if tags.get("type") not in ("line_thin", "line_thick"):
        return False
    from_left, from_right = _CHANGE.get(tags.get("subtype", ""), (False, False))
    if not border.forth:
        from_left, from_right = from_right, from_left
    return from_left if to_right else from_right


def _speed(text: str) -> float:
    """Metres per second of a text such as "50", "50 km/h" or "30 mph"; NaN if it is none."""
    found = re.fullmatch(r"\s*([0-9]+(?:\.[0-9]+)?)\s*([a-zA-Z/]*)\s*", text[:40])
    return float(found[1]) * _UNITS.get(found[2].lower(), math.nan) if found else math.nan


def _sign_limit(relation: Element, ways: dict[str, Element]) -> float:
    """The limit [m/s] that a regulatory element sets, by its `sign_type` or its signs' subtypes (de274-50), NaN if none."""
    tags = _tags(relation)
    if tags.get("type") != "regulatory_element" or tags.get("subtype") != "speed_limit":
        return math.nan
    texts = [tags.get("sign_type", ""), tags.get("speed_limit", "")]
    texts += [
        _tags(ways[member.get("ref")]).get("subtype", "")
        for member in relation.all("member")
        if member.attributes.get("ref") in ways
    ]
    for text in texts:
        sign = re.fullmatch(r"(?:de)?274(?:\.1)?-([0-9]+)", text)
        speed = float(sign[1]) * _KMH if sign else _speed(text)
        if not math.isnan(speed):
            return speed
    return math.nan


def _speed_limit(lanelet: _Lanelet, limits: dict[str, float]) -> float:
    own = _speed(lanelet.tags.get("speed_limit", ""))
    if not math.isnan(own):
        return own
    members = [member.attributes.get("ref", "") for member in lanelet.relation.all("member")]
    signed = [limits[ref] for ref in members if not math.isnan(limits.get(ref, math.nan))]
    usual = _LIMITS.get((lanelet.tags.get("subtype", "road"), lanelet.tags.get("location", "urban")), math.nan)
    return min(signed, default=usual)
