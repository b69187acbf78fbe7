# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The lanes of a map prepared for placing recordings: lane paths, nearby lanes, distances."""

from collections.abc import Collection, Iterator, Sequence
from functools import cached_property, lru_cache
import math

import numpy as np
from scipy.spatial import KDTree

from scenario_gen.numerics import Bools, Floats, wrap_angle
from scenario_gen.numerics.curve import crossings, Curve
from scenario_gen.numerics.plane import ahead_and_left, edge_lengths
from scenario_gen.roads.vector.lane_field import LaneField
from scenario_gen.roads.vector.network import crossing_lanes
from scenario_gen.situation import Track
from scenario_gen.types import CARS, LaneNetwork

LEAD_M = 25.0
"""Of lanes before and after the driven part of a lane path."""
LaneChain = tuple[int, ...]
"""Indices of lanes, each a successor of the one before."""

_MAX_START_DISTANCE_M = 8.0  # between a vehicle's start and the lane on which its chain begins
_MAX_START_TURN_RAD = math.radians(60.0)
_POINT_SPACING_M = 0.5  # of a lane path
_SMOOTHING_POINTS = 3  # to each side of a point that is averaged: polylines have corners
_MIN_CROSSING_ANGLE_RAD = math.radians(15.0)


class LaneGraph:
    """The lanes of a network: how they are connected, and where they are.

    Attributes:
        network: the lanes.
        length: [m] of each lane.
        points: (P, 2) [m] on the centre lines of all lanes.
        yaws: (P,) [rad] directions of the lanes at these points.
        height: (P,) [m], NaN where it is not known.
        half_width: (P,) [m] of the lanes at these points.
        lane_of: (P,) the lane that each point is on.
    """

    def __init__(self, network: LaneNetwork) -> None:
        lanes = network.lanes
        self.network = network
        self.length = [float(edge_lengths(lane.centre).sum()) for lane in lanes]
        self.points = np.concatenate([lane.centre[:-1] for lane in lanes])
        self.yaws = np.concatenate([lane.yaw for lane in lanes])
        self.height = np.concatenate([lane.height[:-1] for lane in lanes])
        borders = np.concatenate([(lane.left - lane.right)[:-1] for lane in lanes])
        self.half_width = np.hypot(*borders.T) / 2.0
        self.lane_of = np.repeat(np.arange(len(lanes)), [len(lane.yaw) for lane in lanes])
        self._curves: dict[LaneChain, Curve] = {}
        self._closed: dict[frozenset[str], frozenset[int]] = {}

    @cached_property
    def field(self) -> LaneField:
        """The distance of every pose on the map from the nearest lane of its direction."""
        return LaneField.of(self.network)

    @cached_property
    def crossings(self) -> tuple[Floats, Floats]:
        """Points (C, 2) [m] where two lanes cross, and the directions (C, 2) [rad] of both lanes.

        Each crossing is listed in both orders of its lanes.
        """
        points, yaws = [np.zeros((0, 2))], [np.zeros((0, 2))]
        pairs = {(min(pair), max(pair)) for pair in crossing_lanes(self.network)}
        for pair in sorted(pairs):
            curve, other = (Curve.through(self.network.lanes[k].centre) for k in pair)
            for station, on_other in crossings(curve, other, _MIN_CROSSING_ANGLE_RAD).tolist():
                first, second = curve.at(station), other.at(on_other)
                points += [first[None, :2], first[None, :2]]
                yaws += [np.array([[first[2], second[2]]]), np.array([[second[2], first[2]]])]
        return np.concatenate(points), np.concatenate(yaws)

    @cached_property
    def _nearest(self) -> KDTree:
        """The points for queries of the nearest one."""
        return KDTree(self.points)

    def covers(self, places: Floats) -> Bools:
        """Return whether each place (M, 2) [m] lies in the lane with the nearest centre line."""
        k = self._nearest.query(places)[1]
        _, left = ahead_and_left(places - self.points[k], self.yaws[k])
        return np.asarray(np.abs(left) <= self.half_width[k])

    def curve(self, chain: LaneChain) -> Curve:
        """Return the smoothed centre line of a chain of lanes."""
        if chain not in self._curves:
            centres = [self.network.lanes[k].centre for k in chain]
            self._curves[chain] = _smooth_curve(np.concatenate(centres))
        return self._curves[chain]

    def successors(self, chain: Sequence[int]) -> list[int]:
        """Return the lanes that follow a chain and are not part of it."""
        return [k for k in self.network.lanes[chain[-1]].successors if k not in chain]

    def closed_to(self, track: Track) -> frozenset[int]:
        """Return the lanes that a vehicle may not use."""
        users = track.vehicle.kind.lane_user
        if users not in self._closed:
            self._closed[users] = self._lanes_closed_to(users)
        return self._closed[users]

    def reserved_for(self, track: Track) -> frozenset[int]:
        """Return the lanes that a vehicle may use and cars may not."""
        if CARS not in self._closed:
            self._closed[CARS] = self._lanes_closed_to(CARS)
        return self._closed[CARS] - self.closed_to(track)

    def _lanes_closed_to(self, users: frozenset[str]) -> frozenset[int]:
        lanes = enumerate(self.network.lanes)
        return frozenset(k for k, lane in lanes if not lane.open_to(users))

    def near(self, pose: Floats) -> list[int]:
        """Return the lanes that pass a pose (3,) x, y [m], yaw [rad] in about its direction.

        The nearest lane is first.
        """
        distance = np.hypot(self.points[:, 0] - pose[0], self.points[:, 1] - pose[1])
        turn = np.abs(wrap_angle(self.yaws - pose[2]))
        fits = (distance <= _MAX_START_DISTANCE_M) & (turn <= _MAX_START_TURN_RAD)
        nearest: dict[int, float] = {}
        for k in np.flatnonzero(fits).tolist():
            lane = int(self.lane_of[k])
            nearest[lane] = min(nearest.get(lane, math.inf), round(float(distance[k]), 6))
        return sorted(nearest, key=lambda lane: (nearest[lane], lane))

    def chains_from(
        self, first: int, travelled: float, closed: Collection[int] = ()
    ) -> Iterator[LaneChain]:
        """Yield the chains of open lanes through a lane.

        Each begins `LEAD_M` before the lane, if lanes lead there, and goes on until its end or for
        what is travelled [m] and `LEAD_M`.
        """
        lead = self._lead_to(first, closed)
        enough = travelled + self.length[first] + LEAD_M
        unfinished: list[tuple[LaneChain, float]] = [((first,), self.length[first])]
        for _ in range(48):
            if not unfinished:
                break
            chain, length = unfinished.pop(0)
            following = [k for k in self.successors(chain) if k not in closed]
            if not following or length > enough:
                yield tuple(k for k in lead if k not in chain) + chain
            else:
                unfinished += [((*chain, k), length + self.length[k]) for k in following]

    def _lead_to(self, first: int, closed: Collection[int]) -> LaneChain:
        """Return the open lanes of about `LEAD_M` that lead to a lane."""
        lead: LaneChain = ()
        length, lane = 0.0, first
        while length < LEAD_M:
            before = [k for k in self.network.predecessors[lane] if k not in closed]
            if not before or before[0] in lead or before[0] == first:
                break
            lane = before[0]
            lead = (lane, *lead)
            length += self.length[lane]
        return lead


@lru_cache(maxsize=4)
def lane_graph(network: LaneNetwork, users: frozenset[str] = CARS) -> LaneGraph:
    """Return the graph of the lanes that cars or some users may use; the last four are kept."""
    return LaneGraph(network.for_users(users))


def _smooth_curve(points: Floats) -> Curve:
    """Return the curve through moving averages of a polyline (M, 2) [m]; its ends do not move."""
    polyline = Curve.through(points)
    even = polyline.cut(0.0, polyline.length, _POINT_SPACING_M).points[:, :2]
    index = np.arange(len(even))
    # Towards the ends the window shrinks on both sides.
    room = np.minimum(index, index[::-1])[:, None]
    offset = np.arange(-_SMOOTHING_POINTS, _SMOOTHING_POINTS + 1)
    return Curve.through(even[index[:, None] + np.clip(offset, -room, room)].mean(axis=1))
