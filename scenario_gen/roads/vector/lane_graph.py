# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Lanes of a network as a graph, and the paths through it."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
import math
from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from scenario_gen.numerics import ahead_and_left, Bools, edge_lengths, Floats, wrap_angle
from scenario_gen.numerics.curve import crossings, Curve
from scenario_gen.roads.vector.lane_field import LaneField
from scenario_gen.roads.vector.network import crossing_lanes
from scenario_gen.situation import Track
from scenario_gen.types import CARS, LaneNetwork

LEAD_M = 25.0
"""Of lanes before and after the driven part of a lane path."""
LaneChain = tuple[int, ...]
"""Indices of lanes, each a successor of the one before."""

_MAX_NEAR_M = 8.0  # between a pose of a vehicle and a lane that it may be on
_MAX_NEAR_TURN_RAD = math.radians(60.0)
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

    def closed_to(self, users: frozenset[str]) -> frozenset[int]:
        """Return the lanes that some users may not use."""
        if users not in self._closed:
            lanes = enumerate(self.network.lanes)
            self._closed[users] = frozenset(k for k, lane in lanes if not lane.open_to(users))
        return self._closed[users]

    def reserved_for(self, track: Track) -> frozenset[int]:
        """Return the lanes that a vehicle may use and cars may not."""
        return self.closed_to(CARS) - self.closed_to(track.vehicle.kind.lane_user)

    def near(self, pose: Floats) -> list[int]:
        """Return the lanes that pass a pose (3,) x, y [m], yaw [rad] in about its direction.

        The nearest lane is first.
        """
        close = np.array(self._nearest.query_ball_point(pose[:2], _MAX_NEAR_M), dtype=np.int64)
        close = close[np.abs(wrap_angle(self.yaws[close] - pose[2])) <= _MAX_NEAR_TURN_RAD]
        distance = np.hypot(*(self.points[close] - pose[:2]).T)
        nearest: dict[int, float] = {}
        for lane, metres in zip(self.lane_of[close].tolist(), distance.tolist(), strict=True):
            nearest[lane] = min(nearest.get(lane, math.inf), round(metres, 6))
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


@dataclass(frozen=True)
class MatchCosts:
    """The costs of differences between a recording and its lanes."""

    max_squared_distance_m2: float = 100.0  # so that one far pose does not decide
    yaw_m2: float = 20.0  # per unit of 1 - cos: 60° count as 3 m
    turn_m2_per_rad2: float = 40.0  # of the turn from start to end
    not_reserved_m2: float = 25.0  # for a bicycle beside its cycle lane
    lost_crossing_m2: float = 6.0  # paths that would cross beyond their recorded ends
    lost_driven_crossing_m2: float = 18.0
    speeding_m2_per_mps2: float = 0.1  # (m/s)² above the speed limit
    lateral_m2_per_mps2: float = 1.0  # m/s² above `comfortable_lateral_mps2`
    comfortable_lateral_mps2: float = 3.0
    max_lateral_excess_mps2: float = 10.0  # that costs
    lane_change_gain_m2: float = 1.5  # that justifies a lane change
    narrow_m2_per_m: float = 30.0  # of side distance for which a lane is too narrow,
    max_missing_m: float = 0.5  # up to this


@dataclass(frozen=True)
class StartWeights:
    """The weights of the equations for the starts, in units of 1/m."""

    placement: float = 0.5  # stay where the rigid placement puts the vehicle
    beyond_crossing: float = 0.25  # keep the distance to a crossing beyond the recorded ends
    driven_crossing: float = 1.0
    met_crossing: float = 3.0  # a crossing at which the two vehicles meet
    gap: float = 2.0  # keep the gap to a vehicle in the same lane
    stop_line: float = 4.0  # stop before the line
    turn: float = 20.0  # turn as far as recorded


@dataclass(frozen=True)
class MatchLimits:
    """Where two things count as the same, and what cars can drive."""

    chains: int = 96  # tried for a vehicle: recorded maps have at most 15
    changing_chains: int = 4  # the best, between which lane changes are tried
    noticeable_turn_error_rad: float = math.radians(12.0)  # from which another start is tried
    crossing_angle_rad: float = math.radians(15.0)  # less is a merge
    same_lane_m: float = 2.0  # sideways
    end_room_m: float = 1.0  # between a footprint and the end of the lanes
    before_stop_line_m: float = 0.7
    past_stop_line_m: float = 6.0  # a stop within this distance is a stop at the line
    lane_change_curvature_per_m: float = 0.02
    braking_mps2: float = 4.0  # before a bend
    accelerating_mps2: float = 2.5  # after a bend
    grip_mps2: float = 9.0  # more lateral acceleration is impossible for cars


COSTS = MatchCosts()
WEIGHTS = StartWeights()
LIMITS = MatchLimits()
STEP_M = 0.5


@dataclass(frozen=True, eq=False)
class LanePath:
    """The path of one vehicle along lanes.

    Attributes:
        lanes: the chain of lanes.
        curve: their centre line around the driven part.
        start: arc length [m] on the curve at which the recording begins.
        progress: (T,) [m] from there at each recorded sample.
    """

    lanes: LaneChain
    curve: Curve
    start: float
    progress: Floats

    @property
    def end(self) -> float:
        """Arc length [m] on the curve at which the recording ends."""
        return self.start + float(self.progress[-1])

    @property
    def turn(self) -> float:
        """How far [rad, left positive] it turns."""
        start, end = self.curve.at(np.array([self.start, self.end]))[:, 2]
        return float(end - start)


class LateralAcceleration(NamedTuple):
    """The largest lateral acceleration [m/s²], v² times curvature, of a vehicle on its lane path.

    Attributes:
        recorded: at the recorded speeds.
        forced: at the lowest speeds that the recorded ones at both ends allow. A bend may be
            driven more slowly than recorded, the ends may not.
    """

    recorded: float
    forced: float


def lane_change_length(width: float) -> float:
    """Return the length [m] of a change by a width [m] with the curvature of a lane change.

    The largest second derivative of the blend x³(10 - 15x + 6x²) is 5.7735.
    """
    return math.sqrt(max(abs(width), 0.1) * 5.7735 / LIMITS.lane_change_curvature_per_m)


def off_reserved_cost(
    graph: LaneGraph, paths: Sequence[LanePath], tracks: Sequence[Track]
) -> float:
    """Return the cost [m²] of vehicles with reserved lanes that do not follow them."""
    off = 0
    for path, track in zip(paths, tracks, strict=True):
        reserved = graph.reserved_for(track)
        off += bool(reserved) and reserved.isdisjoint(path.lanes)
    return COSTS.not_reserved_m2 * off / len(tracks)


def lateral_acceleration(path: LanePath, track: Track) -> LateralAcceleration:
    """Return the largest lateral accelerations [m/s²] of a vehicle on its lane path."""
    driven = float(path.progress[-1])
    if track.still or driven < STEP_M:
        return LateralAcceleration(0.0, 0.0)
    at = np.linspace(0.0, driven, max(math.ceil(driven), 1) + 1)
    turned = np.abs(np.diff(path.curve.at(path.start + at)[:, 2]))
    curvature = turned / np.diff(at)
    middle = (at[1:] + at[:-1]) / 2.0
    speed = track.speed * (driven / float(track.progress[-1]))
    recorded = np.square(np.interp(middle, path.progress, speed))
    first, last = float(np.square(speed[0])), float(np.square(speed[-1]))
    lowest = np.maximum(
        first - 2.0 * LIMITS.braking_mps2 * middle,
        last - 2.0 * LIMITS.accelerating_mps2 * (driven - middle),
    ).clip(min=0.0)
    return LateralAcceleration(
        float((curvature * recorded).max()), float((curvature * lowest).max())
    )


def bend_cost(lateral: Sequence[LateralAcceleration]) -> float:
    """Return the cost [m²] of bends that the recorded speeds make uncomfortable."""
    excess = np.array([each.recorded for each in lateral]) - COSTS.comfortable_lateral_mps2
    capped = np.clip(excess, 0.0, COSTS.max_lateral_excess_mps2)
    return COSTS.lateral_m2_per_mps2 * float(np.mean(capped))


def narrow_cost(missing: float) -> float:
    """Return the cost [m²] of lanes that are too narrow for a recorded side distance by some m."""
    return COSTS.narrow_m2_per_m * min(missing, COSTS.max_missing_m)


def speeding_cost(
    network: LaneNetwork, paths: Sequence[LanePath], tracks: Sequence[Track]
) -> float:
    """Return the cost [m²] of vehicles that are faster than the highest limit of their lanes."""
    excess = []
    for path, track in zip(paths, tracks, strict=True):
        limit = max((network.lanes[k].speed_limit for k in path.lanes), default=math.nan)
        excess.append(max(float(track.speed.max()) - limit, 0.0) if limit > 0.0 else 0.0)
    return COSTS.speeding_m2_per_mps2 * float(np.mean(np.square(excess)))
