# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Lanes as other formats want them: strips of neighbouring lanes along a reference line, and how they join."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from scenario_gen.numerics import Floats, frozen
from scenario_gen.numerics.plane import unit_left
from scenario_gen.types import LaneNetwork

DECIMALS = 6
"""Of the metres of a lane's edges: rounded, lanes that follow or lie beside each other have the very same points there."""

OVERLAP = 2e-5  # metres


@dataclass(frozen=True, eq=False)
class Strip:
    """Neighbouring lanes along a reference line, as a road of OpenDRIVE: lanes on the right of it, and on the left.

    Attributes:
        name: for people.
        reference: (M, 3) x [m], y [m], yaw [rad, unwrapped] of the reference line; no two points equal.
        offset: (M,) metres by which the line between left and right lanes lies to the left of the reference line.
        right: (R, M) widths [m] of the lanes on the right, from that line outwards.
        left: (L, M) widths [m] of the lanes on the left, likewise.
    """

    name: str
    reference: Floats
    offset: Floats
    right: Floats
    left: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "reference", frozen(self.reference))
        count = len(self.reference)
        object.__setattr__(self, "offset", frozen(np.broadcast_to(self.offset, count)))
        for side in ("right", "left"):
            object.__setattr__(self, side, frozen(np.reshape(getattr(self, side), (-1, count))))

    def beside(self, distance: Floats) -> Floats:
        """Return points (M, 2) at distances (M,) [m] to the left of the reference line."""
        return np.asarray(self.reference[:, :2] + distance[:, None] * unit_left(self.reference[:, 2]))

    def edges(self, side: str) -> Floats:
        """Return the edges (L, M, 2) [m] of one side's L - 1 lanes, "right" or "left", from the middle outwards."""
        sign = -1.0 if side == "right" else 1.0
        widths = getattr(self, side)
        beside = np.concatenate([self.offset[None], self.offset + sign * np.cumsum(widths, axis=0)])
        return frozen(np.round(np.stack([self.beside(row) for row in beside]), DECIMALS))


@dataclass(frozen=True)
class Joint:
    """A way through the junction, one lane wide.

    Attributes:
        by: index of its strip.
        start, goal: indices of the strips from whose end and to whose end it leads.
        turn: "left", "straight" or "right".
        from_lane, to_lane: places of the lanes that it joins, from the middle outwards.
    """

    by: int
    start: int
    goal: int
    turn: str
    from_lane: int
    to_lane: int


@dataclass(frozen=True, eq=False)
class LaneMap:
    """All lanes of a road.

    Attributes:
        strips: those that are not in `joints` run from where traffic comes in to the junction, if there is one.
        joints: the ways through the junction.
        side: of traffic, "right" or "left": on that side of a strip's middle lanes run with the reference line.
        origin: what the lanes are: true ones of a road, or derived from what; for people.
        derived: whether they are derived.
        added: how many strips at the end are derived, among true ones.
        network: the lanes of a vector map, in place of those of the strips where a format has lanes alone; () for other roads.
        network_origin: what those are.
        vector: the map whose lanes these are: lane k of it has the id k + 1.
    """

    strips: tuple[Strip, ...]
    joints: tuple[Joint, ...]
    side: str
    origin: str
    derived: bool
    added: int = 0
    network: tuple["Lane", ...] = ()
    network_origin: str = ""
    vector: LaneNetwork | None = None

    def is_derived(self, strip: int) -> bool:
        """Whether the strip of an index is derived."""
        return self.derived or strip >= len(self.strips) - self.added

    @property
    def along(self) -> str:
        """The side of a strip whose lanes run along its reference line."""
        return self.side

    @property
    def against(self) -> str:
        """The side of a strip whose lanes run against its reference line."""
        return "left" if self.side == "right" else "right"


@dataclass(frozen=True, eq=False)
class Lane:
    """One lane in its own direction of travel.

    Attributes:
        id: from 1.
        strip: index of its strip.
        side, place: of the strip, and the lane's place on it from the middle outwards.
        left, right: (M, 2) its bounds [m], point by point opposite each other.
        successors, predecessors: ids.
        left_of, right_of: id of the lane beside it and whether that has the same direction; None if there is none.
        turn: "left", "straight" or "right" through a junction; "" elsewhere.
        derived: whether it is along what is driven, and no lane of the road.
    """

    id: int
    strip: int
    side: str
    place: int
    left: Floats
    right: Floats
    successors: tuple[int, ...]
    predecessors: tuple[int, ...]
    left_of: tuple[int, bool] | None
    right_of: tuple[int, bool] | None
    turn: str
    derived: bool

    @property
    def middle(self) -> Floats:
        """(M, 2) the lane's middle [m]."""
        return (self.left + self.right) / 2.0


Place = tuple[int, str, int]  # strip, side, place


def lanes_of(lane_map: LaneMap) -> tuple[Lane, ...]:
    """Return every lane of a map, joined as its strips are."""
    places = list(_places(lane_map))
    number = {place: k + 1 for k, place in enumerate(places)}
    after: dict[Place, list[int]] = {place: [] for place in places}
    before: dict[Place, list[int]] = {place: [] for place in places}
    turns = {joint.by: joint.turn for joint in lane_map.joints}
    for joint in lane_map.joints:
        for from_lane, to_lane in pairwise(joined(lane_map, joint)):
            after[from_lane].append(number[to_lane])
            before[to_lane].append(number[from_lane])
    lanes = []
    for place in places:
        strip, side, k = place
        edges = lane_map.strips[strip].edges(side)[k : k + 2]
        if side == lane_map.against:
            edges = edges[:, ::-1]
        if strip in turns:
            edges = _overlapping(edges)
        inner, outer = edges if lane_map.side == "right" else edges[::-1]
        across = number.get((strip, lane_map.against if side == lane_map.along else lane_map.along, 0))
        inward = (number[strip, side, k - 1], True) if k else (across, False) if across else None
        further = number.get((strip, side, k + 1))
        outward = (further, True) if further else None
        left_of, right_of = (inward, outward) if lane_map.side == "right" else (outward, inward)
        lanes.append(
            Lane(
                id=number[place],
                strip=strip,
                side=side,
                place=k,
                left=frozen(inner),
                right=frozen(outer),
                successors=tuple(sorted(after[place])),
                predecessors=tuple(sorted(before[place])),
                left_of=left_of,
                right_of=right_of,
                turn=turns.get(strip, ""),
                derived=lane_map.is_derived(strip),
            )
        )
    return tuple(lanes)


def network_lanes(network: LaneNetwork) -> tuple[Lane, ...]:
    """Return the lanes of a vector map, numbered from 1 in their order; those beside them to which one may change."""
    lanes = []
    for k, lane in enumerate(network.lanes):
        sides: dict[str, tuple[int, bool]] = {}
        across = lane.left[0] - lane.right[0]
        for other in lane.beside:
            gap = network.lanes[other].centre - lane.centre[0]
            nearest = gap[int(np.argmin(np.square(gap).sum(axis=1)))]
            sides["left" if float((nearest * across).sum()) > 0.0 else "right"] = (other + 1, True)
        lanes.append(
            Lane(
                id=k + 1,
                strip=-1,
                side="",
                place=0,
                left=lane.left,
                right=lane.right,
                successors=tuple(sorted(other + 1 for other in lane.successors)),
                predecessors=tuple(sorted(other + 1 for other in network.predecessors[k])),
                left_of=sides.get("left"),
                right_of=sides.get("right"),
                turn="",
                derived=False,
            )
        )
    return tuple(lanes)


def _overlapping(edges: Floats) -> Floats:
    """Return edges (2, M, 2) [m] that reach `OVERLAP` farther at both ends: else roundings would be gaps between lanes."""
    result = edges.copy()
    for end, next_to in ((0, 1), (-1, -2)):
        step = result[:, end] - result[:, next_to]
        result[:, end] += OVERLAP * step / np.hypot(step[:, 0], step[:, 1])[:, None]
    return result


def joined(lane_map: LaneMap, joint: Joint) -> tuple[Place, Place, Place]:
    """Return the lane that a way through the junction comes from, its own, and the one that it leads to."""
    along, against = lane_map.along, lane_map.against
    return (joint.start, along, joint.from_lane), (joint.by, along, 0), (joint.goal, against, joint.to_lane)


def _places(lane_map: LaneMap) -> Iterator[Place]:
    for k, strip in enumerate(lane_map.strips):
        for side in ("right", "left"):
            for place in range(len(getattr(strip, side))):
                yield k, side, place
