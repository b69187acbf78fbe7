# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Lanelet2 maps (.osm), in the original format and in Autoware's dialect.

Source: Lanelet2's documents on primitives, tagging and the routing graph (LaneletAndAreaTagging,
LinestringTagging), and Autoware's on `local_x`, `local_y`, `turn_direction` and
`intersection_area`.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
import math
import re

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.base.xml_reader import Element
from scenario_gen.numerics import Floats
from scenario_gen.roads.vector.drafts import (
    by_id,
    Draft,
    Faults,
    MapLanes,
    MPS_PER_UNIT,
    refuse_too_long,
    refuse_too_many_lanes,
    speed_of,
)
from scenario_gen.roads.vector.osm_positions import Positions, positions_of
from scenario_gen.roads.vector.osm_tags import tags_of, users_of_tags, value_of_first
from scenario_gen.roads.vector.signs import DraftRule, kind_of_sign
from scenario_gen.types import CARS, DRIVERS, RuleKind

_DEFAULT_LIMITS_KMH = {
    ("road", "urban"): 50.0,
    ("road", "nonurban"): 100.0,
    ("highway", "urban"): 130.0,
    ("highway", "nonurban"): 130.0,
    ("play_street", "urban"): 7.0,
}
"""By subtype and location: Lanelet2's German traffic rules."""
_CHANGES_BY_SUBTYPE = {
    "dashed": (True, True),
    "dashed_solid": (True, False),
    "solid_dashed": (False, True),
}
"""Whether traffic may cross a line from its left, and from its right."""


@dataclass(frozen=True, eq=False)
class _Border:
    """A way of the map, in the direction in which a lanelet uses it."""

    way: Element
    nodes: tuple[str, ...]
    points: Floats
    forward: bool = True

    @property
    def key(self) -> tuple[str, bool]:
        """Its way and the direction."""
        return self.way.attribute("id"), self.forward

    def turned(self) -> "_Border":
        return replace(
            self, nodes=self.nodes[::-1], points=self.points[::-1], forward=not self.forward
        )

    def may_change(self, *, to_right: bool) -> bool:
        """Return whether traffic may cross it, to the right or to the left."""
        tags = tags_of(self.way)
        side = "right" if to_right else "left"
        explicit = value_of_first(tags, (f"lane_change:{side}", "lane_change"))
        if explicit is not None:
            return explicit in ("yes", "true")
        if tags.get("type") not in ("line_thin", "line_thick"):
            return False
        from_left, from_right = _CHANGES_BY_SUBTYPE.get(tags.get("subtype", ""), (False, False))
        return from_left if to_right == self.forward else from_right


class _Relation:
    """A relation of the map with its tags."""

    def __init__(self, element: Element) -> None:
        self.element = element
        self.id = element.attribute("id")
        self.tags = tags_of(element)

    @property
    def is_lanelet(self) -> bool:
        return self.tags.get("type") == "lanelet"

    @cached_property
    def users(self) -> frozenset[str]:
        """The users of a lanelet."""
        return users_of_tags(self.tags)

    @property
    def both_ways(self) -> bool:
        """Whether drivers may use a lanelet in both directions."""
        kinds = ("vehicle:car", "vehicle") if self.users & CARS else ("bicycle",)
        keys = [*(f"one_way:{kind}" for kind in kinds), "one_way"]
        one_way = value_of_first(self.tags, keys)
        return bool(self.users & DRIVERS) and one_way in ("no", "false")

    def members(self, role: str) -> list[str]:
        """Return the ids of its members with a role."""
        members = self.element.findall("member")
        return [member.get("ref", "") for member in members if member.get("role") == role]


@dataclass(frozen=True, eq=False)
class _Lanelet:
    """A lanelet, in the direction in which it is driven."""

    name: str
    relation: _Relation
    left: _Border
    right: _Border

    @classmethod
    def of(cls, relation: _Relation, left: _Border, right: _Border) -> "_Lanelet":
        """Return a lanelet whose borders both have its direction.

        In a file they may have either one. They are turned so that their begins are next to each
        other, and that left is on the left.
        """
        a, b = left.points[[0, -1], :2]
        c, d = right.points[[0, -1], :2]
        straight = float(np.hypot(*(a - c)) + np.hypot(*(b - d)))
        crossed = float(np.hypot(*(a - d)) + np.hypot(*(b - c)))
        if crossed < straight:
            right = right.turned()
        x, y = np.concatenate((left.points, right.points[::-1]))[:, :2].T
        doubled_area = float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())
        if doubled_area > 0.0:  # counter-clockwise: left is on the right
            left, right = left.turned(), right.turned()
        return cls(relation.id, relation, left, right)

    def turned(self) -> "_Lanelet":
        """Return the same lanelet driven the other way."""
        return replace(
            self, name=f"{self.name}r", left=self.right.turned(), right=self.left.turned()
        )


@dataclass(frozen=True)
class _Regulation:
    """The rule of a regulatory element, without its line, and the ways that may be its lines."""

    rule: DraftRule
    ways: tuple[str, ...]


@dataclass(frozen=True)
class LaneletMap:
    """The elements of a map that no editor has marked as deleted.

    Attributes:
        file: for messages.
        nodes: by id.
        ways: by id.
        relations: with their tags.
        faults: the elements that are left out.
    """

    file: str
    nodes: dict[str, Element]
    ways: dict[str, Element]
    relations: list[_Relation]
    faults: Faults

    @classmethod
    def parse(cls, root: Element) -> "LaneletMap":
        """Return the elements of a map.

        Raises:
            InputError: it has no lanelet for cars, or too many lanelets.
        """
        faults = Faults()
        nodes, ways, relations = (
            by_id((each for each in root.findall(tag) if each.get("action") != "delete"), faults)
            for tag in ("node", "way", "relation")
        )
        parsed = cls(root.file, nodes, ways, [*map(_Relation, relations.values())], faults)
        if not parsed.car_lanelets:
            raise InputError(
                f"{root.file}: none of its {parsed.lanelet_count} lanelets is for cars"
            )
        refuse_too_many_lanes(len(parsed.lanelets), root.file)
        return parsed

    @cached_property
    def lanelet_count(self) -> int:
        """How many lanelets the file has, with or without users."""
        return sum(relation.is_lanelet for relation in self.relations)

    @cached_property
    def lanelets(self) -> list[_Relation]:
        """The lanelets with users."""
        return [each for each in self.relations if each.is_lanelet and each.users]

    @cached_property
    def car_lanelets(self) -> list[_Relation]:
        """The lanelets for cars."""
        return [lanelet for lanelet in self.lanelets if lanelet.users & CARS]

    @cached_property
    def borders(self) -> dict[str, tuple[str, str]]:
        """The ways of the left and the right border of each lanelet, without faulty ones."""
        borders = {}
        for lanelet in self.lanelets:
            with self.faults.leaving_out("lanelet", lanelet.id):
                left, right = self._way_of(lanelet, "left"), self._way_of(lanelet, "right")
                self._nodes_of(left)
                self._nodes_of(right)
                borders[lanelet.id] = left, right
        return borders

    @cached_property
    def regulations(self) -> list[_Regulation]:
        """The rules for lanelets that cars use."""
        lanelets_of: dict[str, list[str]] = defaultdict(list)
        for lanelet in self.car_lanelets:
            for ref in lanelet.members("regulatory_element"):
                lanelets_of[ref].append(lanelet.id)
        regulations = []
        for element in self.relations:
            kind = self._rule_kind(element)
            if kind is not None:
                lanes = element.members("yield") or lanelets_of[element.id]
                over = tuple(element.members("right_of_way"))
                role = "refers" if element.tags.get("subtype") == "road_marking" else "ref_line"
                ways = [ref for ref in element.members(role) if ref in self.ways]
                rule = DraftRule(element.id, kind, tuple(lanes), over)
                regulations.append(_Regulation(rule, tuple(ways)))
        return regulations

    @cached_property
    def stop_lines(self) -> dict[str, list[str]]:
        """The nodes of the ways that may be stop lines, without faulty ones."""
        lines = {}
        refs = [ref for regulation in self.regulations for ref in regulation.ways]
        for ref in dict.fromkeys(refs):
            with self.faults.leaving_out("stop line", ref):
                lines[ref] = self._nodes_of(ref)
        return lines

    @cached_property
    def positions(self) -> Positions:
        """The positions of all nodes of borders and stop lines.

        Raises:
            InputError: they have none, or the borders are too long.
        """
        refs = [ref for pair in self.borders.values() for ref in pair]
        refuse_too_long(sum(len(self.ways[ref]) for ref in refs), self.file)
        for_cars = {ref for each in self.car_lanelets for ref in self.borders.get(each.id, ())}
        nodes_of = {ref: self._nodes_of(ref) for ref in refs}
        of_cars = [nodes for ref, nodes in nodes_of.items() if ref in for_cars]
        # Both are in the order of the file.
        central = dict.fromkeys(chain(*of_cars, *self.stop_lines.values()))
        used = dict.fromkeys(chain(central, *nodes_of.values()))
        elements = [self.nodes[name] for name in used]
        return positions_of(elements, len(central), self.file, self.faults)

    def drafts(self) -> Iterator[Draft]:
        """Yield the lanes, and those for both ways once for each."""
        directed = []
        for relation in (each for each in self.lanelets if each.id in self.borders):
            with self.faults.leaving_out("lanelet", relation.id):
                left, right = map(self._border, self.borders[relation.id])
                lanelet = _Lanelet.of(relation, left, right)
                directed.append(lanelet)
                if relation.both_ways:
                    directed.append(lanelet.turned())
        limits = {relation.id: self._sign_limit(relation) for relation in self.relations}
        return _drafts(directed, limits)

    def rules(self) -> Iterator[DraftRule]:
        """Yield the rules with their lines."""
        known = self.positions.metres
        for regulation in self.regulations:
            lines = [self.stop_lines[ref] for ref in regulation.ways if ref in self.stop_lines]
            lines = [nodes for nodes in lines if known.keys() >= set(nodes)]
            for nodes in lines:
                points = np.array([known[name][:2] for name in nodes])
                yield replace(regulation.rule, line=points)
            if not lines:
                yield regulation.rule

    def other_signs(self) -> int:
        """Return how many regulatory elements have another meaning."""
        return sum(
            relation.tags.get("type") == "regulatory_element"
            and relation.tags.get("subtype") != "speed_limit"
            and self._rule_kind(relation) is None
            for relation in self.relations
        )

    def _way_of(self, lanelet: _Relation, role: str) -> str:
        """Return the way of a lanelet's border.

        Raises:
            InputError: there is not exactly one, or it is not in the map.
        """
        refs, where = lanelet.members(role), lanelet.element.place
        if len(refs) != 1:
            raise InputError(
                f"{where}: lanelet {lanelet.id} has {len(refs)} members with role {role}; one is "
                "needed"
            )
        if refs[0] not in self.ways:
            raise InputError(f"{where}: way {refs[0]} is not in the map")
        return refs[0]

    def _nodes_of(self, ref: str) -> list[str]:
        """Return the nodes of a way.

        Raises:
            InputError: one is not in the map, or there are less than two.
        """
        way = self.ways[ref]
        nodes = [nd.attribute("ref") for nd in way.findall("nd")]
        for name in nodes:
            if name not in self.nodes:
                raise InputError(f"{way.place}: node {name} of way {ref} is not in the map")
        if len(nodes) < 2:
            raise InputError(f"{way.place}: way {ref} has {len(nodes)} node(s); two are needed")
        return nodes

    def _border(self, ref: str) -> _Border:
        """Return a way as a border.

        Raises:
            InputError: the position of one of its nodes is not known.
        """
        way, nodes = self.ways[ref], self._nodes_of(ref)
        metres = self.positions.metres
        for name in nodes:
            if name not in metres:
                raise InputError(
                    f"{way.place}: the position of node {name} in way {ref} is faulty"
                )
        return _Border(way, tuple(nodes), np.array([metres[name] for name in nodes]))

    def _rule_kind(self, relation: _Relation) -> RuleKind | None:
        """Return the meaning of a regulatory element; None if it is not known."""
        tags = relation.tags
        if tags.get("type") != "regulatory_element":
            return None
        refs = relation.members("refers")
        referred = [tags_of(self.ways[ref]) for ref in refs if ref in self.ways]
        signs = [tags.get("sign_type", ""), *(each.get("subtype", "") for each in referred)]
        kinds = [kind for kind in map(kind_of_sign, signs) if kind is not None]
        is_stop_line = any(each.get("type") == "stop_line" for each in referred)
        match tags.get("subtype"):
            case "traffic_light":
                return RuleKind.TRAFFIC_LIGHT
            case "all_way_stop":
                return RuleKind.STOP
            case "right_of_way":
                return RuleKind.STOP if RuleKind.STOP in kinds else RuleKind.GIVE_WAY
            case "traffic_sign":
                return next(iter(kinds), None)
            case "road_marking" if is_stop_line:  # Autoware's
                return RuleKind.STOP
        return None

    def _sign_limit(self, relation: _Relation) -> float:
        """Return the limit [m/s] that a regulatory element sets, NaN if none.

        It is given by its `sign_type`, or by the subtypes of its signs (de274-50).
        """
        tags = relation.tags
        if tags.get("type") != "regulatory_element" or tags.get("subtype") != "speed_limit":
            return math.nan
        refs = [member.get("ref") for member in relation.element.findall("member")]
        signs = [tags_of(self.ways[ref]) for ref in refs if ref in self.ways]
        texts = [tags.get("sign_type", ""), tags.get("speed_limit", "")]
        for text in (*texts, *(sign.get("subtype", "") for sign in signs)):
            sign_name = re.fullmatch(r"(?:de)?274(?:\.1)?-([0-9]+)", text)
            limit = speed_of(sign_name[1] if sign_name else text, "km/h")
            if not math.isnan(limit):
                return limit
        return math.nan


def lanes_of(root: Element) -> MapLanes:
    """Return the lanes of a Lanelet2 map.

    Positions are the tags `local_x` and `local_y` if most nodes of lanelets have them; otherwise
    latitude and longitude are projected to the local frame about their middle.

    Raises:
        InputError: it is broken, has no usable coordinates, or no lanelet for cars; names file
            and line.
    """
    lanelet_map = LaneletMap.parse(root)
    positions = lanelet_map.positions
    return MapLanes(
        list(lanelet_map.drafts()),
        (positions.note,),
        unsupported=lanelet_map.lanelet_count - len(lanelet_map.lanelets),
        faults=lanelet_map.faults,
        rules=list(lanelet_map.rules()),
        other_signs=lanelet_map.other_signs(),
        origin=positions.origin,
    )


def _drafts(lanelets: Sequence[_Lanelet], limits: dict[str, float]) -> Iterator[Draft]:
    """Yield lanelets with the links of the routing graph.

    A lane follows another if both of its borders begin at the nodes where the other's end.
    """
    by_first_nodes: dict[tuple[str, str], list[_Lanelet]] = defaultdict(list)
    by_left: dict[tuple[str, bool], list[str]] = defaultdict(list)
    by_right: dict[tuple[str, bool], list[str]] = defaultdict(list)
    for lanelet in lanelets:
        by_first_nodes[lanelet.left.nodes[0], lanelet.right.nodes[0]].append(lanelet)
        by_left[lanelet.left.key].append(lanelet.name)
        by_right[lanelet.right.key].append(lanelet.name)
    for lanelet in lanelets:
        left, right = lanelet.left, lanelet.right
        following = by_first_nodes[left.nodes[-1], right.nodes[-1]]
        neighbours = []
        if right.may_change(to_right=True):
            neighbours += by_left[right.key]
        if left.may_change(to_right=False):
            neighbours += by_right[left.key]
        relation = lanelet.relation
        yield Draft(
            id=lanelet.name,
            left=left.points,
            right=right.points,
            successors=tuple(other.name for other in following if other.relation is not relation),
            neighbours=tuple(neighbours),
            speed_limit=_speed_limit(relation, limits),
            junction=relation.tags.get("intersection_area", ""),
            place=relation.element.place,
            users=relation.users,
            crossing=relation.tags.get("subtype") == "crosswalk",
        )


def _speed_limit(lanelet: _Relation, limits: dict[str, float]) -> float:
    """Return the speed limit [m/s] of a lanelet by its tag, its signs, or the default, or NaN."""
    limit = speed_of(lanelet.tags.get("speed_limit", ""), "km/h")
    if not math.isnan(limit):
        return limit
    refs = [member.get("ref", "") for member in lanelet.element.findall("member")]
    signed = [limits[ref] for ref in refs if not math.isnan(limits.get(ref, math.nan))]
    place = lanelet.tags.get("subtype", "road"), lanelet.tags.get("location", "urban")
    default = _DEFAULT_LIMITS_KMH.get(place, math.nan) * MPS_PER_UNIT["km/h"]
    return min(signed, default=default)
