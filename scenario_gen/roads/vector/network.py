# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""From borders to lanes: cross-sections, junctions that a map does not name, and the part of a network inside a box."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
import math
import re

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import distance
import shapely

from scenario_gen.base.errors import InputError
from scenario_gen.base.xml_reader import Element
from scenario_gen.numerics import Bools, Floats, runs
from scenario_gen.numerics.plane import edge_lengths
from scenario_gen.roads.vector.signs import DraftRule, rules_of_pieces, with_rules
from scenario_gen.types import CARS, DRIVERS, Lane, LaneNetwork, LEVEL, Note, NoteKind

_SECTION = 1.0  # metres between cross-sections at most
_SHORTEST = 0.05  # metres of a border
MOST_SECTIONS = 2_000_000  # of a whole map
MOST_LANES = 30_000  # a city of some 1000 km of streets
MOST_LINKS = 100  # of a lane to lanes that follow it, or lie beside it
_NAMED = 5  # faulty elements that a note names
_QUERIED = 64  # lanes whose neighbours are looked up at once
_MOST_COMPARED = 400_000  # pairs of lanes whose boxes meet


class TooLargeError(InputError):
    """A map, or what is joined in it, exceeds a bound."""


@dataclass
class Faults:
    """Elements of a map that cannot be used and are left out, each with its reason.

    Attributes:
        found: kind of the element, its name, and the reason with its place.
    """

    found: list[tuple[str, str, str]] = field(default_factory=list)

    @contextmanager
    def leaving_out(self, kind: str, name: str) -> Iterator[None]:
        """Leave out an element that the body refuses.

        Raises:
            TooLargeError: the body exceeds a bound.
        """
        try:
            yield
        except TooLargeError:
            raise
        except InputError as error:
            self.found.append((kind, name, str(error)))

    def notes(self) -> tuple[Note, ...]:
        """Return a note on each kind of element: how many were left out, which, and why the first one was."""
        kinds = dict.fromkeys(kind for kind, _, _ in self.found)
        notes = []
        for kind in kinds:
            own = [(name, reason) for each, name, reason in self.found if each == kind]
            names = ", ".join(name for name, _ in own[:_NAMED]) + (
                ", …" if len(own) > _NAMED else ""
            )
            notes.append(
                Note.of(
                    NoteKind.FAULTY,
                    count=len(own),
                    elements=f"{kind}s" if len(own) > 1 else kind,
                    names=names,
                    reason=own[0][1],
                )
            )
        return tuple(notes)


@dataclass(frozen=True, eq=False)
class Draft:
    """A lane as a reader finds it; neighbours by id.

    Attributes:
        id: the lane's name.
        left: (A, 2) metres, left border in driving direction; or (A, 3) with its height, NaN where that is not known.
        right: (B, 2) or (B, 3) metres, right border.
        successors: names of lanes.
        beside: names of lanes to which one may change.
        speed_limit: m/s or NaN.
        junction: its junction or "".
        place: file and line, for messages.
        paired: left and right are cross-sections already.
        users, crossing: as of `Lane`.
    """

    id: str
    left: Floats
    right: Floats
    successors: tuple[str, ...]
    beside: tuple[str, ...]
    speed_limit: float
    junction: str
    place: str
    paired: bool = False
    users: frozenset[str] = frozenset()
    crossing: bool = False

    def __post_init__(self) -> None:
        for names, what in ((self.successors, "follow it"), (self.beside, "lie beside it")):
            if len(names) > MOST_LINKS:
                raise TooLargeError(
                    f"{self.place}: lane {self.id}: {len(names)} lanes {what}; at most {MOST_LINKS} are read"
                )


@dataclass(frozen=True)
class MapLanes:
    """What a reader finds in a file.

    Attributes:
        drafts: its lanes.
        notes: how it was read.
        left_out: how many lanes for nobody that is known were passed over.
        faults: what else was left out.
        rules: signs, lights and rights of way.
        other_signs: how many signs and lights mean something else, and are not read.
        origin: as of `LaneNetwork`.
    """

    drafts: Sequence[Draft]
    notes: tuple[Note, ...]
    left_out: int = 0
    faults: Faults = field(default_factory=Faults)
    rules: Sequence[DraftRule] = ()
    other_signs: int = 0
    origin: tuple[float, ...] = ()


def by_id(elements: Iterable[Element], faults: Faults) -> dict[str, Element]:
    """Return elements by their attribute `id`; those without one, and all but the first of an id, are left out."""
    seen: dict[str, Element] = {}
    for element in elements:
        name = element.get("id")
        if name is None:
            faults.found.append((element.tag, "?", f"{element.place} has no attribute id"))
        elif name in seen:
            twice = f"{element.place}: {element.tag} {name} is there twice, first on line {seen[name].sourceline}"
            faults.found.append((element.tag, name, twice))
        else:
            seen[name] = element
    return seen


def refuse_too_many_lanes(count: int, place: str) -> None:
    """Refuse a map, or a part of it, before its lanes are drawn.

    Raises:
        InputError: it has more than `MOST_LANES`.
    """
    if count > MOST_LANES:
        raise TooLargeError(f"{place}: more than {MOST_LANES} lanes; cut the map")


def refuse_too_long(sections: int, place: str) -> None:
    """Refuse a map, or a part of it, before its cross-sections are computed.

    Raises:
        InputError: it has more than `MOST_SECTIONS`.
    """
    if sections > MOST_SECTIONS:
        raise TooLargeError(
            f"{place}: lanes of more than {MOST_SECTIONS} points, about {MOST_SECTIONS * _SECTION / 1000.0:g} km; cut the map"
        )


_UNITS = {
    "km/h": 1.0 / 3.6,
    "kmh": 1.0 / 3.6,
    "kph": 1.0 / 3.6,
    "mph": 0.44704,
    "m/s": 1.0,
    "mps": 1.0,
}


def speed_of(text: str, unit: str) -> float:
    """Return the m/s of a text such as "50", "50 km/h" or "30mph"; NaN if it is none.

    Args:
        text: a number, with or without a unit.
        unit: of a number without one: "km/h", "mph" or "m/s".
    """
    match = re.fullmatch(r"\s*([0-9]+(?:\.[0-9]+)?)\s*([a-zA-Z/]*)\s*", text[:40])
    return float(match[1]) * _UNITS.get(match[2].lower() or unit, math.nan) if match else math.nan


def network_of(name: str, draft_lanes: MapLanes) -> LaneNetwork:
    """Return the network of what a reader found; neighbours that are no lanes, and faulty lanes, are left out.

    Raises:
        InputError: there is no lane for cars; with the first fault, if there is one.
    """
    notes, faults = draft_lanes.notes, draft_lanes.faults
    drawn: dict[str, tuple[Draft, Floats, Floats]] = {}
    total = 0
    for draft in draft_lanes.drafts:
        with faults.leaving_out("lane", draft.id):
            if draft.id in drawn:
                raise InputError(
                    f"{draft.place}: lane {draft.id} is there twice, first at {drawn[draft.id][0].place}"
                )
            left, right = (
                (draft.left, draft.right)
                if draft.paired
                else cross_sections(draft.left, draft.right, draft.place)
            )
            longest = max(float(edge_lengths(border[:, :2]).sum()) for border in (left, right))
            if not longest <= MOST_SECTIONS * _SECTION:  # nor is it NaN
                raise InputError(
                    f"{draft.place}: lane {draft.id} has a border of {longest / 1000.0:.3g} km; check the coordinates"
                )
            total += max(len(left), math.ceil(longest / _SECTION))
            refuse_too_long(total, f"map {name}")
            drawn[draft.id] = draft, left, right
    if not any((draft.users or DRIVERS) & CARS for draft, *_ in drawn.values()):
        raise InputError(
            faults.found[0][2] if faults.found else f"map {name}: no lane that cars may use"
        )
    index = {name: k for k, name in enumerate(drawn)}
    lanes = []
    for draft, left, right in drawn.values():
        after, beside = (
            tuple(dict.fromkeys(index[other] for other in names if other in index))
            for names in (draft.successors, draft.beside)
        )
        height = (
            (left[:, 2] + right[:, 2]) / 2.0
            if left.shape[1] == right.shape[1] == 3
            else np.full(len(left), np.nan)
        )
        borders = left[:, :2], right[:, :2]
        allowed = draft.users, draft.crossing
        lanes.append(
            Lane(
                draft.id,
                *borders,
                after,
                beside,
                draft.speed_limit,
                draft.junction,
                height,
                *allowed,
            )
        )
    network = LaneNetwork(name, (), origin=draft_lanes.origin).with_lanes(lanes)
    if network.others:
        counts = Counter(user for lane in network.others for user in lane.users)
        words = ", ".join(f"{user} {count}" for user, count in sorted(counts.items()))
        notes += (Note.of(NoteKind.OTHER_LANES, count=len(network.others), users=words),)
    if draft_lanes.left_out:
        notes += (Note.of(NoteKind.UNUSED_LANES, count=draft_lanes.left_out),)
    if draft_lanes.other_signs:
        notes += (Note.of(NoteKind.UNREAD_SIGNS, count=draft_lanes.other_signs),)
    notes += faults.notes()
    network = replace(network, notes=notes)
    named = any(lane.junction for lane in network.lanes)
    return with_rules(network if named else with_junctions(network), draft_lanes.rules)


def cross_sections(left: Floats, right: Floats, where: str) -> tuple[Floats, Floats]:
    """Two borders (A, 2) and (B, 2) [m] at common shares of their lengths, (M, 2) each; every vertex of both is kept.

    A third column, their height, goes along.

    Raises:
        InputError: a border has no length.
    """
    borders, shares, longest = [], [], 0.0
    for name, border in (("left", left), ("right", right)):
        points = (
            border[np.concatenate(([True], edge_lengths(border[:, :2]) > 1e-6))]
            if len(border)
            else border
        )
        length = np.concatenate(([0.0], np.cumsum(edge_lengths(points[:, :2]))))
        if length[-1] < _SHORTEST:
            raise InputError(
                f"{where}: the {name} border has {len(border)} point(s) and no length; a line is needed"
            )
        borders.append(points)
        shares.append(length / length[-1])
        longest = max(longest, float(length[-1]))
    if longest > MOST_SECTIONS * _SECTION:
        raise InputError(f"{where}: a border of {longest / 1000.0:.0f} km; check the coordinates")
    even = np.linspace(0.0, 1.0, math.ceil(longest / _SECTION) + 1)
    share = np.unique(np.concatenate((*shares, even)))
    share = share[np.concatenate(([True], np.diff(share) > 1e-9))]
    share[-1] = 1.0
    first, second = (
        np.column_stack([np.interp(share, own, column) for column in points.T])
        for own, points in zip(shares, borders, strict=True)
    )
    return first, second


def with_junctions(network: LaneNetwork) -> LaneNetwork:
    """Name the junctions of a map that names none: car lanes whose middles cross, and those that part from the same, are one.

    They are numbered 1, 2, … in the order of their first lanes.
    """
    pairs = list(crossing_lanes(network))
    crossing = {k for pair in pairs for k in pair}
    for (
        before
    ) in network.lanes:  # who parts from a lane that crosses others turns at the same junction
        inner = [k for k in before.successors if k in crossing]
        pairs += [(inner[0], k) for k in before.successors if inner and k not in crossing]
    joined = {k for pair in pairs for k in pair}
    ends = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
    count = len(network.lanes)
    _, part = connected_components(
        coo_array((np.ones(len(pairs)), tuple(ends)), (count, count)), directed=False
    )
    first: dict[int, str] = {}
    named = [
        replace(
            lane,
            junction=first.setdefault(int(part[k]), str(len(first) + 1)) if k in joined else "",
        )
        for k, lane in enumerate(network.every_lane[:count])
    ]
    return network.with_lanes((*named, *network.others))


def crossing_lanes(network: LaneNetwork) -> Iterator[tuple[int, int]]:
    """Yield the pairs of lanes whose middles cross between their ends, neither above the other.

    Raises:
        InputError: too many of them lie upon each other.
    """
    lines = np.array([shapely.LineString(lane.centre) for lane in network.lanes])
    tree, compared = shapely.STRtree(lines), 0
    for k in range(0, len(lines), _QUERIED):
        first, second = tree.query(lines[k : k + _QUERIED])
        ordered = first + k < second
        first, second = first[ordered] + k, second[ordered]
        compared += len(first)
        if compared > _MOST_COMPARED:
            raise InputError(
                f"map {network.name}: its lanes lie upon each other in more than {_MOST_COMPARED} places, as at lane "
                f"{network.lanes[first[0]].id}; check the coordinates"
            )
        shapely.prepare(lines[first])
        crossing = shapely.crosses(lines[first], lines[second])
        pairs = zip(first[crossing].tolist(), second[crossing].tolist(), strict=True)
        yield from (
            pair
            for pair in pairs
            if not network.has_levels or _on_one_level(*(network.lanes[k] for k in pair))
        )


def _on_one_level(one: Lane, other: Lane) -> bool:
    """Whether two lanes are at one height where their middles are nearest, or a height is not known."""
    a, b = np.unravel_index(
        distance.cdist(one.centre, other.centre).argmin(), (len(one.centre), len(other.centre))
    )
    return not abs(one.height[a] - other.height[b]) > LEVEL


def part_of(network: LaneNetwork, box: Floats, note: Note) -> LaneNetwork:
    """Return the part of a network inside a box (2, 2) [m]: lanes are cut where their centre lines leave it.

    Raises:
        InputError: no lane for cars is in the box.
    """
    pieces: list[
        tuple[int, Floats, bool]
    ] = []  # lane, its borders and height, whether its end is there
    begins: dict[int, int] = {}
    for k, lane in enumerate(network.every_lane):
        last = len(lane.left) - 1
        for first, stop in runs(_inside(lane.centre, box)):
            low = max(first - _cut(lane.centre, first, first - 1, box), 0.0)
            high = min(stop - 1 + _cut(lane.centre, stop - 1, stop, box), float(last))
            if high - low < 1e-6:
                continue
            at = np.unique(
                np.concatenate(([low], np.arange(math.ceil(low), math.floor(high) + 1), [high]))
            )
            columns = np.column_stack((lane.left, lane.right, lane.height)).T
            cut = np.column_stack(
                [np.interp(at, np.arange(last + 1), column) for column in columns]
            )
            if low == 0.0:
                begins[k] = len(pieces)
            pieces.append((k, cut, high == last))
    if not any(k < len(network.lanes) for k, *_ in pieces):
        raise InputError(
            f"map {network.name}: no lane in the box {box[0, 0]:g},{box[0, 1]:g},{box[1, 0]:g},{box[1, 1]:g}; {extent(network)}"
        )
    of_lane: dict[int, list[int]] = {}
    for piece, (k, *_) in enumerate(pieces):
        of_lane.setdefault(k, []).append(piece)
    lanes = []
    for k, cut, has_end in pieces:
        lane = network.every_lane[k]
        after = (
            tuple(begins[other] for other in lane.successors if other in begins) if has_end else ()
        )
        beside = tuple(of_lane[other][0] for other in lane.beside if other in of_lane)
        left, right, height = cut[:, :2], cut[:, 2:4], cut[:, 4]
        lanes.append(
            replace(lane, left=left, right=right, height=height, successors=after, beside=beside)
        )
    part = replace(network, rules=()).with_lanes(lanes)
    return replace(
        part, notes=(*network.notes, note), rules=rules_of_pieces(network.rules, of_lane)
    )


def extent(network: LaneNetwork) -> str:
    """Say how far a network reaches."""
    (x0, y0), (x1, y1) = network.box.tolist()
    return f"its {len(network.lanes)} lanes reach from {x0:.1f},{y0:.1f} to {x1:.1f},{y1:.1f}"


def _inside(points: Floats, box: Floats) -> Bools:
    return np.asarray(((points >= box[0]) & (points <= box[1])).all(axis=1))


def _cut(points: Floats, inner: int, outer: int, box: Floats) -> float:
    """Which share of the edge from point `inner`, in the box, to point `outer`, beyond it, lies in the box."""
    if not 0 <= outer < len(points):
        return 0.0
    step = points[outer] - points[inner]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(
            step > 0.0,
            (box[1] - points[inner]) / step,
            np.where(step < 0.0, (box[0] - points[inner]) / step, 1.0),
        )
    return float(np.clip(share.min(), 0.0, 1.0))


def lane_ends(network: LaneNetwork) -> tuple[Floats, Floats]:
    """Entries (E, 3) and exits (X, 3): x, y [m], yaw [rad] of the centre line at the begin or end of those lanes."""
    lanes = network.lanes
    entries = [[*lanes[k].centre[0].tolist(), float(lanes[k].yaw[0])] for k in network.entries]
    exits = [[*lanes[k].centre[-1].tolist(), float(lanes[k].yaw[-1])] for k in network.exits]
    return np.array(entries).reshape(-1, 3), np.array(exits).reshape(-1, 3)
