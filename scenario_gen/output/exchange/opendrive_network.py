# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The roads and junctions of OpenDRIVE that a lane map becomes."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from scenario_gen.numerics import edge_lengths, Floats, unit_left
from scenario_gen.numerics.curve import Curve
from scenario_gen.output.exchange.lanes import LaneMap
from scenario_gen.types import LaneNetwork

FIRST_ROAD_ID = 1  # also in the template
FIRST_JUNCTION_ID = 1000
MIN_POINT_SPACING_M = 1e-6  # between two points of a reference line


class Place(NamedTuple):
    """The place of a lane in a road: its side, its number from the road centre outwards.

    `along` says whether the lane has the direction of the road's reference line.
    """

    road: int
    side: str
    number: int
    along: bool

    @property
    def lane_id(self) -> int:
        """The lane's id in OpenDRIVE: ±1, ±2, … outwards, negative on the right."""
        return (self.number + 1) * (-1 if self.side == "right" else 1)

    def contact(self, *, end: bool) -> str:
        """Return the end of the road, "start" or "end", at which the lane ends (or begins)."""
        return "end" if end == self.along else "start"


@dataclass(frozen=True, eq=False)
class Strip:
    """Adjacent lanes that form one road of OpenDRIVE.

    Attributes:
        lanes: the lanes on the "right" and "left" of the reference line, from the centre outwards.
        reference: (M, 3) x [m], y [m], yaw [rad, unwrapped].
        offset: (M,) offset [m] to the left from the reference line to the line between left and
            right lanes.
        widths: (L, M) widths [m] of the lanes on each side.
    """

    lanes: dict[str, tuple[int, ...]]
    reference: Floats
    offset: Floats
    widths: dict[str, Floats]

    @classmethod
    def of(cls, lane_map: LaneMap, along: tuple[int, ...], against: tuple[int, ...]) -> "Strip":
        """Return a strip with the direction of the lanes `along`.

        Its reference line separates the two directions; a single lane's is the lane centre.
        """
        lanes, right = lane_map.network.lanes, lane_map.side == "right"
        order = ("right", "left") if right else ("left", "right")
        named = dict(zip(order, (along, against), strict=True))
        first = lanes[along[0]]
        if len(along) + len(against) == 1:
            distinct = np.concatenate(([True], edge_lengths(first.centre) > MIN_POINT_SPACING_M))
            line = Curve.through(first.centre[distinct]).points
            across = (first.left - first.right)[distinct]
            width = np.abs((across * unit_left(line[:, 2])).sum(axis=1))
            offset = (0.5 if right else -0.5) * width
            return cls(
                named,
                line,
                offset,
                dict(zip(order, (width[None], np.zeros((0, len(width)))), strict=True)),
            )
        across = first.left - first.right
        yaw = np.unwrap(np.arctan2(-across[:, 0], across[:, 1]))
        widths = [
            np.stack([lanes[k].width for k in side]) if side else np.zeros((0, len(yaw)))
            for side in (along, against)
        ]
        reference = np.column_stack((first.left if right else first.right, yaw))
        return cls(
            named,
            reference,
            np.zeros(len(yaw)),
            dict(zip(order, (widths[0], widths[1][:, ::-1]), strict=True)),
        )


def connecting(network: LaneNetwork) -> dict[int, str]:
    """Return the lanes that can be connecting roads, with their junctions.

    Each of them joins one lane to one other lane, and all lanes with which it shares a
    predecessor or a successor are connecting lanes of the same junction.
    """
    before, lanes = network.predecessors, network.lanes
    ways = {
        k: lane.junction
        for k, lane in enumerate(lanes)
        if lane.junction and len(before[k]) == len(lane.successors) == 1
    }
    while True:
        mixed = [
            k
            for k, junction in ways.items()
            if before[k][0] in ways
            or lanes[k].successors[0] in ways
            or any(
                ways.get(n) != junction
                for n in (*lanes[before[k][0]].successors, *before[lanes[k].successors[0]])
            )
        ]
        if not mixed:
            return ways
        for k in mixed:
            del ways[k]


def _with_crossings_alone(network: LaneNetwork) -> LaneNetwork:
    """Return a network without links from and to crossings: OpenDRIVE has them as objects."""
    links = [
        () if lane.crossing else [k for k in lane.successors if not network.lanes[k].crossing]
        for lane in network.lanes
    ]
    return replace(
        network,
        lanes=tuple(
            replace(lane, successors=tuple(successors))
            for lane, successors in zip(network.lanes, links, strict=True)
        ),
    )


class RoadNetwork:
    """The roads of a lane map and the links between their lanes.

    Attributes:
        network: the lanes.
        strips: the roads.
        places: the place of each lane.
        crossings: the crossings of each road, as indices of lanes.
        obstacles: indices of the obstacles of each road.
        connecting: the lanes that are connecting roads, with their junctions.
        numbers: the id of each named junction.
        road_links: attributes of the link at a road's "start" or "end".
        lane_links: id of the lane on another road that a lane joins at its end (True) or begin.
        connections: of each junction, pairs of lanes and the tag of the second lane's road.
    """

    def __init__(self, lane_map: LaneMap) -> None:
        network = _with_crossings_alone(lane_map.network)
        strips = lane_map.strips
        self.network = lane_map.network
        self.strips = [Strip.of(lane_map, *strip) for strip in strips]
        self.places = {
            k: Place(n, side, m, k in strips[n][0])
            for n, strip in enumerate(self.strips)
            for side, lanes in strip.lanes.items()
            for m, k in enumerate(lanes)
        }
        crossings = {k: lane.outline for k, lane in enumerate(network.lanes) if lane.crossing}
        self.crossings = self._by_road(crossings)
        obstacles = {k: obstacle.outline for k, obstacle in enumerate(network.obstacles)}
        self.obstacles = self._by_road(obstacles)
        self.connecting = connecting(network)
        self.road_links: dict[tuple[int, str], dict[str, str | float]] = {}
        self.lane_links: dict[tuple[int, bool], int] = {}
        self.connections: dict[int, list[tuple[int, int, str]]] = {}
        junctions = dict.fromkeys(self.connecting.values())
        self.numbers = {name: FIRST_JUNCTION_ID + n for n, name in enumerate(junctions)}
        self._link_lanes(network)

    def _by_road(self, outlines: Mapping[int, Floats]) -> dict[int, list[int]]:
        """Return which outlines (M, 2) are nearest to each road."""
        nearest: dict[int, list[int]] = defaultdict(list)
        for k, outline in outlines.items():
            centre = outline.mean(axis=0)
            distances = [
                float(np.hypot(*(strip.reference[:, :2] - centre).T).min())
                for strip in self.strips
            ]
            nearest[int(np.argmin(distances))].append(k)
        return nearest

    def _link_lanes(self, network: LaneNetwork) -> None:
        """Link each lane to its successors: by a connecting road, directly, or in a junction."""
        direct = []
        lanes = network.lanes
        links = [(k, goal) for k, lane in enumerate(lanes) for goal in lane.successors]
        for k, goal in links:
            if goal in self.connecting:
                self._connect(k, goal, self.numbers[self.connecting[goal]], "connectingRoad")
            elif k in self.connecting:
                self._join(k, goal)
                self._link_to_junction(goal, self.numbers[self.connecting[k]], end=False)
            elif len(lanes[k].successors) == len(network.predecessors[goal]) == 1:
                self._join(k, goal)
                self._join(goal, k, end=False)
            else:
                direct.append((k, goal))
        if direct:
            self._add_direct_junctions(direct, len(lanes))

    def _add_direct_junctions(self, links: Sequence[tuple[int, int]], n_lanes: int) -> None:
        """Add a direct junction for each connected set of links between lanes."""
        ends = np.array(links).T + np.array([[0], [n_lanes]])
        graph = coo_array((np.ones(len(links)), tuple(ends)), (2 * n_lanes, 2 * n_lanes))
        _, component = connected_components(graph, directed=False)
        for k, goal in links:
            number = FIRST_JUNCTION_ID + len(self.numbers) + int(component[k])
            self._connect(k, goal, number, "linkedRoad")

    def _connect(self, k: int, goal: int, number: int, kind: str) -> None:
        """Connect a lane to its successor in a junction."""
        self.connections.setdefault(number, []).append((k, goal, kind))
        self._link_to_junction(k, number, end=True)
        if kind == "linkedRoad":
            self._link_to_junction(goal, number, end=False)
        else:
            self._join(goal, k, end=False)

    def _link_to_junction(self, k: int, number: int, *, end: bool) -> None:
        """Link the road of a lane to the junction at the lane's end (or begin)."""
        place = self.places[k]
        self.road_links[place.road, place.contact(end=end)] = {
            "elementType": "junction",
            "elementId": number,
        }

    def _join(self, k: int, other: int, *, end: bool = True) -> None:
        """Link a lane's end (or begin) to the begin (or end) of another lane."""
        place = self.places[k]
        joined = self.places[other]
        self.road_links[place.road, place.contact(end=end)] = {
            "elementType": "road",
            "elementId": FIRST_ROAD_ID + joined.road,
            "contactPoint": joined.contact(end=not end),
        }
        self.lane_links[k, end] = joined.lane_id
