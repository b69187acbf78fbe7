# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""From drafts to a lane network: cross-sections, junctions that a map does not name, parts."""

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
import math

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree
import shapely

from scenario_gen.base.errors import InputError
from scenario_gen.numerics import arc_lengths, edge_lengths, Floats, runs
from scenario_gen.roads.vector.drafts import (
    Draft,
    MapLanes,
    MAX_SECTIONS_COUNT,
    refuse_too_long,
    SECTION_LENGTH_M,
)
from scenario_gen.roads.vector.signs import rules_of_pieces, with_rules
from scenario_gen.types import CARS, DRIVERS, Lane, LaneNetwork, LEVEL_SPACING_M, Note, NoteKind

_MIN_BORDER_M = 0.05
_SAME_SHARE_RATIO = 1e-6  # of the length of a border: nearer vertices are one
_CHUNK_ROWS = 64  # lanes whose neighbours are looked up at once
_MAX_COMPARED_COUNT = 400_000  # pairs of lanes with overlapping bounding boxes


def network_of(name: str, map_lanes: MapLanes) -> LaneNetwork:
    """Return the network of a map's lanes; faulty lanes and unknown neighbours are left out.

    Raises:
        InputError: there is no lane for cars; the message has the first fault, if there is one.
    """
    sections = _cross_sections_of(name, map_lanes)
    if not any((draft.users or DRIVERS) & CARS for draft, _, _ in sections.values()):
        raise InputError(map_lanes.faults.first_reason or f"map {name}: no lane for cars")

    index = {lane: k for k, lane in enumerate(sections)}

    def indices(names: Sequence[str]) -> tuple[int, ...]:
        return tuple(dict.fromkeys(index[other] for other in names if other in index))

    lanes = []
    for draft, left, right in sections.values():
        has_height = left.shape[1] == right.shape[1] == 3
        lane = Lane(
            id=draft.id,
            left=left[:, :2],
            right=right[:, :2],
            successors=indices(draft.successors),
            neighbours=indices(draft.neighbours),
            speed_limit=draft.speed_limit,
            junction=draft.junction,
            height=(left[:, 2] + right[:, 2]) / 2.0 if has_height else np.zeros(0),
            users=draft.users,
            crossing=draft.crossing,
        )
        lanes.append(lane)
    network = LaneNetwork(name, (), origin=map_lanes.origin, obstacles=map_lanes.obstacles)
    network = network.with_lanes(lanes)
    network = replace(network, notes=tuple(_notes(network, map_lanes)))
    if not any(lane.junction for lane in network.lanes):
        network = with_junctions(network)
    return with_rules(network, map_lanes.rules)


def _cross_sections_of(name: str, map_lanes: MapLanes) -> dict[str, tuple[Draft, Floats, Floats]]:
    """Return the drafts by their names, with borders (M, 2) or (M, 3) [m] as cross-sections.

    Raises:
        TooLargeError: the lanes are too long.
    """
    sections: dict[str, tuple[Draft, Floats, Floats]] = {}
    total = 0
    for draft in map_lanes.drafts:
        with map_lanes.faults.leaving_out("lane", draft.id):
            if draft.id in sections:
                first = sections[draft.id][0].place
                raise InputError(f"{draft.place}: second lane {draft.id}, first at {first}")
            left, right = draft.left, draft.right
            longest = max(float(edge_lengths(border[:, :2]).sum()) for border in (left, right))
            if not longest <= MAX_SECTIONS_COUNT * SECTION_LENGTH_M:  # true for NaN
                raise InputError(
                    f"{draft.place}: lane {draft.id} has a border of {longest / 1000.0:.3g} km; "
                    "check the coordinates"
                )
            if not draft.paired:
                left, right = cross_sections(left, right, draft.place)
            total += max(len(left), math.ceil(longest / SECTION_LENGTH_M))
            refuse_too_long(total, f"map {name}")
            sections[draft.id] = draft, left, right
    return sections


def _notes(network: LaneNetwork, map_lanes: MapLanes) -> Iterator[Note]:
    yield from map_lanes.notes
    if network.others:
        counts = Counter(user for lane in network.others for user in lane.users)
        listed = ", ".join(f"{user} {count}" for user, count in sorted(counts.items()))
        yield Note.of(NoteKind.OTHER_LANES, count=len(network.others), users=listed)
    if map_lanes.unsupported:
        yield Note.of(NoteKind.UNUSED_LANES, count=map_lanes.unsupported)
    if map_lanes.other_signs:
        yield Note.of(NoteKind.UNREAD_SIGNS, count=map_lanes.other_signs)
    if network.obstacles:
        yield Note.of(NoteKind.MAP_OBSTACLES, count=len(network.obstacles))
    yield from map_lanes.faults.notes()


def cross_sections(left: Floats, right: Floats, place: str) -> tuple[Floats, Floats]:
    """Return two borders (A, 2) and (B, 2) [m] at common shares of their lengths, (M, 2) each.

    All vertices of both are kept. A third column, the height, is interpolated likewise.

    Raises:
        InputError: a border has no length.
    """
    borders, shares, longest = [], [], 0.0
    for side, border in (("left", left), ("right", right)):
        points = border
        if len(border):
            moves = edge_lengths(border[:, :2]) > 1e-6
            points = border[np.concatenate(([True], moves))]
        length = arc_lengths(points[:, :2])
        if length[-1] < _MIN_BORDER_M:
            raise InputError(
                f"{place}: the {side} border with {len(border)} point(s) has no length; a line is "
                "needed"
            )
        borders.append(points)
        shares.append(length / length[-1])
        longest = max(longest, float(length[-1]))
    even = np.linspace(0.0, 1.0, math.ceil(longest / SECTION_LENGTH_M - 1e-6) + 1)
    share = np.unique(np.concatenate((*shares, even)))
    share = share[np.concatenate(([True], np.diff(share) > _SAME_SHARE_RATIO))]
    share[-1] = 1.0
    first, second = (
        np.column_stack([np.interp(share, at, column) for column in points.T])
        for at, points in zip(shares, borders, strict=True)
    )
    return first, second


def with_junctions(network: LaneNetwork) -> LaneNetwork:
    """Return the network with named junctions, for a map that names none.

    Car lanes with crossing centre lines belong to one junction, as do lanes that branch off from
    the same lane as these. Junctions are numbered 1, 2, … in the order of their first lanes.
    """
    pairs = list(crossing_lanes(network))
    crossing = {k for pair in pairs for k in pair}
    for lane in network.lanes:
        inner = [k for k in lane.successors if k in crossing]
        pairs += [(inner[0], k) for k in lane.successors if inner and k not in crossing]
    ends = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
    joined = set(ends.ravel().tolist())
    count = len(network.lanes)
    edges = coo_array((np.ones(len(pairs)), tuple(ends)), (count, count))
    _, part = connected_components(edges, directed=False)
    names: dict[int, str] = {}
    named = []
    for k, lane in enumerate(network.every_lane[:count]):
        junction = ""
        if k in joined:
            junction = names.setdefault(int(part[k]), str(len(names) + 1))
        named.append(replace(lane, junction=junction))
    return network.with_lanes((*named, *network.others))


def crossing_lanes(network: LaneNetwork) -> Iterator[tuple[int, int]]:
    """Yield the pairs of lanes on one level whose centre lines cross between their ends.

    Raises:
        InputError: too many lanes overlap.
    """
    lines = np.array([shapely.LineString(lane.centre) for lane in network.lanes])
    tree, compared = shapely.STRtree(lines), 0
    for k in range(0, len(lines), _CHUNK_ROWS):
        first, second = tree.query(lines[k : k + _CHUNK_ROWS])
        ordered = first + k < second
        first, second = first[ordered] + k, second[ordered]
        compared += len(first)
        if compared > _MAX_COMPARED_COUNT:
            raise InputError(
                f"map {network.name}: more than {_MAX_COMPARED_COUNT} pairs of lanes overlap, as "
                f"at lane {network.lanes[first[0]].id}; check the coordinates"
            )
        shapely.prepare(lines[first])
        crossing = shapely.crosses(lines[first], lines[second])
        pairs = np.column_stack((first[crossing], second[crossing])).tolist()
        for i, j in pairs:
            crossings = shapely.get_coordinates(shapely.intersection(lines[i], lines[j]))
            lane, other = network.lanes[i], network.lanes[j]
            if not network.has_levels or _on_one_level(lane, other, crossings):
                yield i, j


def _on_one_level(lane: Lane, other: Lane, crossings: Floats) -> bool:
    """Return whether two lanes have the same height at a crossing (K, 2) [m], if it is known."""
    a, b = (KDTree(each.centre).query(crossings)[1] for each in (lane, other))
    return not (np.abs(lane.height[a] - other.height[b]) > LEVEL_SPACING_M).all()


@dataclass(frozen=True, eq=False)
class _Piece:
    """A piece of a lane inside a box.

    Attributes:
        lane: index of the lane.
        columns: (M, 5) [m] x, y of the left and right borders, and the height.
        has_begin: whether the lane's begin is in it.
        has_end: whether the lane's end is in it.
    """

    lane: int
    columns: Floats
    has_begin: bool
    has_end: bool


def part_of(network: LaneNetwork, box: Floats, note: Note) -> LaneNetwork:
    """Return the part of a network inside a box (2, 2) [m].

    Lanes are cut where their centre lines leave the box.

    Raises:
        InputError: no lane for cars is in the box.
    """
    pieces = [
        piece
        for k, lane in enumerate(network.every_lane)
        for piece in _pieces_inside(k, lane, box)
    ]
    if not any(piece.lane < len(network.lanes) for piece in pieces):
        corners = ",".join(f"{value:g}" for value in box.ravel())
        raise InputError(f"map {network.name}: no lane in the box {corners}; {extent(network)}")
    begins = {piece.lane: k for k, piece in enumerate(pieces) if piece.has_begin}
    of_lane: dict[int, list[int]] = defaultdict(list)
    for k, piece in enumerate(pieces):
        of_lane[piece.lane].append(k)

    lanes = []
    for piece in pieces:
        lane = network.every_lane[piece.lane]
        successors = [begins[k] for k in lane.successors if k in begins] if piece.has_end else []
        cut = replace(
            lane,
            left=piece.columns[:, :2],
            right=piece.columns[:, 2:4],
            height=piece.columns[:, 4],
            successors=tuple(successors),
            neighbours=tuple(of_lane[k][0] for k in lane.neighbours if k in of_lane),
        )
        lanes.append(cut)
    part = replace(network, rules=()).with_lanes(lanes)
    rules = rules_of_pieces(network.rules, of_lane)
    return replace(part, notes=(*network.notes, note), rules=rules)


def _pieces_inside(k: int, lane: Lane, box: Floats) -> Iterator[_Piece]:
    """Yield the pieces of a lane inside a box (2, 2) [m]."""
    last = len(lane.left) - 1
    columns = np.column_stack((lane.left, lane.right, lane.height)).T
    inside = ((lane.centre >= box[0]) & (lane.centre <= box[1])).all(axis=1)
    for first, stop in runs(inside):
        low = max(first - _share_inside(lane.centre, first, first - 1, box), 0.0)
        high = min(stop - 1 + _share_inside(lane.centre, stop - 1, stop, box), float(last))
        if high - low >= 1e-6:
            vertices = np.arange(math.ceil(low), math.floor(high) + 1)
            at = np.unique(np.concatenate(([low], vertices, [high])))
            cut = [np.interp(at, np.arange(last + 1), column) for column in columns]
            yield _Piece(k, np.column_stack(cut), has_begin=low == 0.0, has_end=high == last)


def _share_inside(points: Floats, inner: int, outer: int, box: Floats) -> float:
    """Return the share inside the box of the edge from a point in it to one outside it."""
    if not 0 <= outer < len(points):
        return 0.0
    step = points[outer] - points[inner]
    border = np.where(step > 0.0, box[1], box[0])
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(step != 0.0, (border - points[inner]) / step, 1.0)
    return float(np.clip(share.min(), 0.0, 1.0))


def extent(network: LaneNetwork) -> str:
    """Return a text on the size of a network, for messages."""
    (x0, y0), (x1, y1) = network.box.tolist()
    return f"its {len(network.lanes)} lanes reach from {x0:.1f},{y0:.1f} to {x1:.1f},{y1:.1f}"


def lane_ends(network: LaneNetwork) -> tuple[Floats, Floats]:
    """Return entries (E, 3) and exits (X, 3) x, y [m], yaw [rad] on the centre lines of lanes."""
    lanes = network.lanes
    entries = [[*lanes[k].centre[0].tolist(), float(lanes[k].yaw[0])] for k in network.entries]
    exits = [[*lanes[k].centre[-1].tolist(), float(lanes[k].yaw[-1])] for k in network.exits]
    return np.array(entries).reshape(-1, 3), np.array(exits).reshape(-1, 3)
