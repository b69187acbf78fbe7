# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Lanelet2 maps (.osm), of Lanelet2 itself and in Autoware's dialect.

Source: Lanelet2's documents on primitives, tagging and the routing graph (LaneletAndAreaTagging, LinestringTagging), and
Autoware's on `local_x`, `local_y`, `turn_direction` and `intersection_area`.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
import math
import re

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.base.xml_reader import Element, to_number
from scenario_gen.logs import local_frame, middle_of
from scenario_gen.numerics import Floats
from scenario_gen.roads.vector.network import (
    by_id,
    Draft,
    Faults,
    MapLanes,
    refuse_too_long,
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

_BY_SUBTYPE = {  # who may use a lanelet, if no participant is named
    "road": DRIVERS, "play_street": LANE_USERS, "exit": LANE_USERS, "highway": DRIVERS - {"bicycle"},
    "bus_lane": frozenset(("bus",)), "bicycle_lane": frozenset(("bicycle",)), "walkway": frozenset(("pedestrian",)),
    "shared_walkway": frozenset(("bicycle", "pedestrian")), "crosswalk": frozenset(("pedestrian",)),
    "stairs": frozenset(("pedestrian",)),
}  # fmt: skip
_KMH = 1.0 / 3.6
_LIMITS = {  # m/s by subtype and location, where no sign says: Lanelet2's German traffic rules
    ("road", "urban"): 50.0 * _KMH,
    ("road", "nonurban"): 100.0 * _KMH,
    ("highway", "urban"): 130.0 * _KMH,
    ("highway", "nonurban"): 130.0 * _KMH,
    ("play_street", "urban"): 7.0 * _KMH,
}
_FARTHEST = 50_000.0  # metres from the middle of a map in latitude and longitude, as far as the local frame is exact
_CHANGE = {
    "dashed": (True, True),
    "dashed_solid": (True, False),
    "solid_dashed": (False, True),
}  # from its left, from its right


@dataclass(frozen=True, eq=False)
class _Border:
    """A way of the map, in the direction in which a lanelet has it."""

    way: Element
    nodes: tuple[str, ...]
    points: Floats
    forth: bool = True

    @property
    def key(self) -> tuple[str, bool]:
        """Its way and the direction."""
        return self.way.attribute("id"), self.forth

    def turned(self) -> "_Border":
        return replace(
            self, nodes=self.nodes[::-1], points=self.points[::-1], forth=not self.forth
        )


@dataclass(frozen=True, eq=False)
class _Lanelet:
    name: str
    relation: Element
    tags: dict[str, str]
    left: _Border
    right: _Border

    def turned(self) -> "_Lanelet":
        """The same lanelet driven the other way."""
        return replace(
            self, name=f"{self.name}r", left=self.right.turned(), right=self.left.turned()
        )


def lanes_of(root: Element) -> MapLanes:
    """Return the lanes of a Lanelet2 map.

    Positions are those of the tags `local_x` and `local_y` if all nodes of lanelets have them, else those of latitude and
    longitude in the local frame (`geodesy`) about their middle.

    Raises:
        InputError: it is broken, has no usable coordinates, or no lanelet for cars; names file and line.
    """
    faults = Faults()
    nodes, ways, relations = (  # without what editors have marked as deleted
        by_id(
            (element for element in root.findall(tag) if element.get("action") != "delete"),
            faults,
        )
        for tag in ("node", "way", "relation")
    )
    tagged = [(relation, _tags(relation)) for relation in relations.values()]
    lanelets = [(relation, tags) for relation, tags in tagged if tags.get("type") == "lanelet"]
    used_by = [(relation, tags) for relation, tags in lanelets if _users(tags)]
    for_cars = [(relation, tags) for relation, tags in used_by if _users(tags) & CARS]
    if not for_cars:
        raise InputError(f"{root.file}: none of its {len(lanelets)} lanelets is for cars")
    refuse_too_many_lanes(len(used_by), root.file)
    sides: dict[str, list[str]] = {}
    for relation, _ in used_by:
        with faults.leaving_out("lanelet", relation.attribute("id")):
            refs = _refs(relation, ways)
            for ref in refs:
                _nodes(ways[ref], nodes)
            sides[relation.attribute("id")] = refs
    used = [ref for refs in sides.values() for ref in refs]
    refuse_too_long(sum(len(ways[ref]) for ref in used), root.file)
    names = {ref: _nodes(ways[ref], nodes) for ref in used}
    signed, lines = list(_regulations(tagged, for_cars, ways)), {}
    for ref in dict.fromkeys(chain(*(refs for _, refs in signed))):
        with faults.leaving_out("stop line", ref):
            lines[ref] = _nodes(ways[ref], nodes)
    of_cars = {ref for relation, _ in for_cars for ref in sides.get(relation.attribute("id"), ())}
    about = dict.fromkeys(
        chain(*(own for ref, own in names.items() if ref in of_cars), *lines.values())
    )
    all_names = about | dict.fromkeys(chain(*names.values()))
    positions, note, origin = _positions(
        [nodes[name] for name in all_names], len(about), root.file, faults
    )
    drawn = []
    for relation, tags in used_by:
        if relation.attribute("id") not in sides:
            continue
        with faults.leaving_out("lanelet", relation.attribute("id")):
            borders = [
                _border(ways[ref], names[ref], positions)
                for ref in sides[relation.attribute("id")]
            ]
            lanelet = _lanelet(relation, tags, borders)
            drawn.append(lanelet)
            if _is_for_both_ways(tags):
                drawn.append(lanelet.turned())
    limits = {
        relation.attribute("id"): _sign_limit(relation, tags, ways) for relation, tags in tagged
    }
    at = {
        ref: np.array([positions[name][:2] for name in own])
        for ref, own in lines.items()
        if all(name in positions for name in own)
    }
    rules = [
        replace(rule, line=line)
        for rule, refs in signed
        for line in [at[ref] for ref in refs if ref in at] or [rule.line]
    ]
    elements = [
        (relation, tags) for relation, tags in tagged if tags.get("type") == "regulatory_element"
    ]
    others = [
        relation
        for relation, tags in elements
        if tags.get("subtype") != "speed_limit" and not _kind(relation, tags, ways)
    ]
    left_out = len(lanelets) - len(used_by)
    return MapLanes(
        list(_drafts(drawn, limits)),
        (note,),
        left_out,
        faults,
        rules,
        len(others),
        origin,
    )


def _regulations(
    relations: Sequence[tuple[Element, dict[str, str]]],
    lanelets: Sequence[tuple[Element, dict[str, str]]],
    ways: dict[str, Element],
) -> Iterator[tuple[DraftRule, list[str]]]:
    """Yield the rules of regulatory elements, without their lines, and the ways that are these."""
    under: dict[str, list[str]] = defaultdict(list)
    for lanelet, _ in lanelets:
        for ref in _members(lanelet, "regulatory_element"):
            under[ref].append(lanelet.attribute("id"))
    for relation, tags in relations:
        name, kind = relation.get("id", "?"), _kind(relation, tags, ways)
        if kind is None:
            continue
        lanes = tuple(_members(relation, "yield")) or tuple(under[name])
        role = "refers" if tags.get("subtype") == "road_marking" else "ref_line"
        lines = [ref for ref in _members(relation, role) if ref in ways]
        yield DraftRule(name, kind, lanes, tuple(_members(relation, "right_of_way"))), lines


def _members(relation: Element, role: str) -> list[str]:
    members = (member.attrib for member in relation.findall("member"))
    return [own.get("ref", "") for own in members if own.get("role") == role]


def _kind(relation: Element, tags: dict[str, str], ways: dict[str, Element]) -> RuleKind | None:
    """What a regulatory element means for traffic; None if it is none that is known."""
    if tags.get("type") != "regulatory_element":
        return None
    referred = [_tags(ways[ref]) for ref in _members(relation, "refers") if ref in ways]
    signs = [own.get("subtype", "") for own in referred]
    kinds = [
        kind for kind in map(kind_of_sign, (tags.get("sign_type", ""), *signs)) if kind is not None
    ]
    match tags.get("subtype"):
        case "traffic_light":
            return RuleKind.TRAFFIC_LIGHT
        case "all_way_stop":
            return RuleKind.STOP
        case "right_of_way":
            return RuleKind.STOP if RuleKind.STOP in kinds else RuleKind.GIVE_WAY
        case "traffic_sign":
            return kinds[0] if kinds else None
        case "road_marking" if any(
            own.get("type") == "stop_line" for own in referred
        ):  # Autoware's
            return RuleKind.STOP
    return None


def _border(way: Element, names: Sequence[str], positions: Mapping[str, Floats]) -> _Border:
    """A way as a border.

    Raises:
        InputError: the position of one of its nodes is not known.
    """
    for name in names:
        if name not in positions:
            raise InputError(
                f"{way.place}: way {way.attribute('id')} goes through node {name}, whose position is faulty"
            )
    return _Border(way, tuple(names), np.array([positions[name] for name in names]))


def _tags(element: Element) -> dict[str, str]:
    return {tag.attribute("k"): tag.attribute("v") for tag in element.findall("tag")}


def _first(tags: dict[str, str], keys: Sequence[str]) -> str | None:
    """The value of the first of some tags that is there."""
    return next((tags[key] for key in keys if key in tags), None)


def _users(tags: dict[str, str]) -> frozenset[str]:
    """Who may use a lanelet: its participants, or else those of its subtype.

    Where vehicles are named and bicycles are not, as in Autoware's maps, these follow the subtype.
    """
    usual = _BY_SUBTYPE.get(tags.get("subtype", "road"), frozenset())
    if not any(key.startswith("participant:") for key in tags):
        return usual
    keys: dict[str, tuple[str, ...]] = {
        user: (f"participant:vehicle:{'car' if user == 'van' else user}", "participant:vehicle")
        for user in DRIVERS
    }
    keys["bicycle"] = (
        "participant:bicycle",
        *(("participant:vehicle",) if "bicycle" in usual else ()),
    )
    keys["pedestrian"] = ("participant:pedestrian",)
    return frozenset(user for user, own in keys.items() if _first(tags, own) in ("yes", "true"))


def _is_for_both_ways(tags: dict[str, str]) -> bool:
    """Whether those who drive may use a lanelet in both directions."""
    kinds = ("vehicle:car", "vehicle") if _users(tags) & CARS else ("bicycle",)
    one_way = _first(tags, (*(f"one_way:{kind}" for kind in kinds), "one_way"))
    return bool(_users(tags) & DRIVERS) and one_way in ("no", "false")


def _refs(relation: Element, ways: dict[str, Element]) -> list[str]:
    """The ways of the left and the right border.

    Raises:
        InputError: there is not one of each, or it is not in the map.
    """
    refs = []
    for role in ("left", "right"):
        members = [member for member in relation.findall("member") if member.get("role") == role]
        if len(members) != 1:
            raise InputError(
                f"{relation.place}: lanelet {relation.attribute('id')} has {len(members)} members with role {role}; one is needed"
            )
        ref = members[0].attribute("ref")
        if ref not in ways:
            raise InputError(f"{members[0].place}: way {ref} is not in the map")
        refs.append(ref)
    return refs


def _nodes(way: Element, nodes: dict[str, Element]) -> list[str]:
    refs = [nd.attribute("ref") for nd in way.findall("nd")]
    for ref in refs:
        if ref not in nodes:
            raise InputError(
                f"{way.place}: way {way.attribute('id')} goes through node {ref}, which is not in the map"
            )
    if len(refs) < 2:
        raise InputError(
            f"{way.place}: way {way.attribute('id')} has {len(refs)} node(s); two are needed"
        )
    return refs


def _positions(
    nodes: list[Element], count: int, file: str, faults: Faults
) -> tuple[dict[str, Floats], Note, tuple[float, ...]]:
    """Metres (3,) of each node by its id, x, y and its height; a note on how they were found; the origin in degrees.

    Local coordinates are taken if most of the first `count` nodes have them, about whose middle the local frame lies else; nodes
    of the other frame are faulty.

    Raises:
        InputError: no node has a position, or the nodes are far apart.
    """
    ids, tags = [node.attribute("id") for node in nodes], [_tags(node) for node in nodes]
    has_local = [{"local_x", "local_y"} <= own.keys() for own in tags]
    local = has_local[:count].count(True) * 2 > count
    found: dict[str, Floats] = {}
    for node, name, own, has in zip(nodes, ids, tags, has_local, strict=True):
        with faults.leaving_out("node", name):
            if local and not has:
                raise InputError(
                    f"{node.place}: node {name} has no tags local_x and local_y, but {has_local.count(True)} of {len(nodes)} "
                    "have; two frames cannot be mixed"
                )
            if local:
                place = [
                    to_number(own[key], f"{node.place}, tag {key}")
                    for key in ("local_x", "local_y")
                ]
            else:
                place = [
                    _degrees(node, key, most) for key, most in (("lat", 90.0), ("lon", 180.0))
                ]
            found[name] = np.array([*place, _height(own)])
    if not found:
        raise InputError(
            faults.found[0][2] if faults.found else f"{file}: no lanelet for cars has borders"
        )
    if local:
        return found, Note.of(NoteKind.LOCAL_TAGS), ()
    degrees = np.array(list(found.values()))
    about = np.isin(list(found), ids[:count])
    latitude, longitude = middle_of(degrees[about, :2] if about.any() else degrees[:, :2])
    metres = local_frame(degrees[:, 0], degrees[:, 1], (latitude, longitude))
    size = float(np.hypot(metres[:, 0], metres[:, 1]).max())
    if not size <= _FARTHEST:
        if faults.found:  # degrees that are none: most likely metres
            raise InputError(faults.found[0][2])
        raise InputError(
            f"{file}: its nodes are up to {size / 1000.0:.0f} km from their middle; at most {_FARTHEST / 1000.0:g} are read"
        )
    note = Note.of(NoteKind.PROJECTED, latitude=latitude, longitude=longitude)
    return (
        dict(zip(found, np.column_stack((metres, degrees[:, 2])), strict=True)),
        note,
        (latitude, longitude),
    )


def _height(tags: dict[str, str]) -> float:
    """The height [m] that a node's tag `ele` says, NaN if it does not."""
    try:
        return float(tags.get("ele", "nan"))
    except ValueError:
        return math.nan


def _degrees(node: Element, key: str, most: float) -> float:
    """A node's latitude or longitude."""
    if not node.get(key, ""):
        raise InputError(
            f"{node.place}: node {node.attribute('id')} has neither tags local_x and local_y nor lat and lon"
        )
    value = node.number(key)
    if abs(value) > most:
        raise InputError(
            f"{node.place}: {key} is {value:g}; degrees up to {most:g} are needed. A map in metres gives them in tags local_x "
            "and local_y"
        )
    return value


def _lanelet(relation: Element, tags: dict[str, str], borders: Sequence[_Border]) -> _Lanelet:
    """A lanelet whose borders both go its way.

    A file may have them either way round: they are turned so that begin lies at begin, and left is on the left.
    """
    left, right = borders
    a, b, c, d = left.points[0, :2], left.points[-1, :2], right.points[0, :2], right.points[-1, :2]
    straight = float(np.hypot(*(a - c)) + np.hypot(*(b - d)))
    if float(np.hypot(*(a - d)) + np.hypot(*(b - c))) < straight:
        right = right.turned()
    ring = np.concatenate((left.points, right.points[::-1]))
    after = np.roll(ring, -1, axis=0)
    if (
        float((ring[:, 0] * after[:, 1] - ring[:, 1] * after[:, 0]).sum()) > 0.0
    ):  # counter-clockwise: left lies on the right
        left, right = left.turned(), right.turned()
    return _Lanelet(relation.attribute("id"), relation, tags, left, right)


def _drafts(lanelets: list[_Lanelet], limits: dict[str, float]) -> Iterator[Draft]:
    """Lanelets with what the routing graph says: a lane follows where both borders go on, from the same two nodes."""
    begins: dict[tuple[str, str], list[str]] = defaultdict(list)
    on_left: dict[tuple[str, bool], list[str]] = defaultdict(
        list
    )  # border -> lanelets that have it on their left
    on_right: dict[tuple[str, bool], list[str]] = defaultdict(list)
    for lanelet in lanelets:
        begins[lanelet.left.nodes[0], lanelet.right.nodes[0]].append(lanelet.name)
        on_left[lanelet.left.key].append(lanelet.name)
        on_right[lanelet.right.key].append(lanelet.name)
    for lanelet in lanelets:
        left, right = lanelet.left, lanelet.right
        beside = []
        if _may_change(right, to_right=True):
            beside += on_left[right.key]
        if _may_change(left, to_right=False):
            beside += on_right[left.key]
        after = begins[left.nodes[-1], right.nodes[-1]]
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
            users=_users(lanelet.tags),
            crossing=lanelet.tags.get("subtype") == "crosswalk",
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


def _sign_limit(relation: Element, tags: dict[str, str], ways: dict[str, Element]) -> float:
    """The limit [m/s] that a regulatory element sets, by its `sign_type` or its signs' subtypes (de274-50), NaN if none."""
    if tags.get("type") != "regulatory_element" or tags.get("subtype") != "speed_limit":
        return math.nan
    texts = [tags.get("sign_type", ""), tags.get("speed_limit", "")]
    signs = [
        ways[member.attribute("ref")]
        for member in relation.findall("member")
        if member.get("ref") in ways
    ]
    for text in (*texts, *(_tags(sign).get("subtype", "") for sign in signs)):
        sign = re.fullmatch(r"(?:de)?274(?:\.1)?-([0-9]+)", text)
        speed = float(sign[1]) * _KMH if sign else speed_of(text, "km/h")
        if not math.isnan(speed):
            return speed
    return math.nan


def _speed_limit(lanelet: _Lanelet, limits: dict[str, float]) -> float:
    own = speed_of(lanelet.tags.get("speed_limit", ""), "km/h")
    if not math.isnan(own):
        return own
    members = [member.get("ref", "") for member in lanelet.relation.findall("member")]
    signed = [limits[ref] for ref in members if not math.isnan(limits.get(ref, math.nan))]
    usual = _LIMITS.get(
        (lanelet.tags.get("subtype", "road"), lanelet.tags.get("location", "urban")), math.nan
    )
    return min(signed, default=usual)
