# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A recording along one road of a map: following, oncoming, passing, on parallel lanes.

Stations on the recording's reference line (`situation.frenet`) become stations on a chain of
lanes. Its lanes, counted from the driver's left, become lanes next to that chain. So the road may
wind otherwise than the recorded one.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
import math

import numpy as np

from scenario_gen.base.cancelling import stop_if_cancelled
from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Floats, running_sum, wrap_angle
from scenario_gen.numerics.curve import Curve
from scenario_gen.roads.vector.lane_graph import (
    bend_cost,
    LaneChain,
    LaneGraph,
    LanePath,
    lateral_acceleration,
    LEAD_M,
    narrow_cost,
    off_reserved_cost,
    speeding_cost,
)
from scenario_gen.roads.vector.lateral import with_lateral_positions
from scenario_gen.roads.vector.match import lane_change_curve, Match
from scenario_gen.situation import FrenetTracks, to_frenet, Track, turn_of
from scenario_gen.types import LEVEL_SPACING_M

_END_ROOM_M = 1.0  # between a footprint and the end of the road
_TRIED_STREETS_COUNT = 40  # the straightest
_MAX_EXTRA_TURN_RAD = math.radians(60.0)  # less than recorded is fine: it is straightened
_MIN_ONCOMING_DISTANCE_M = 2.2  # between the centres of oncoming lanes
_MAX_ROAD_WIDTH_M = 18.0  # between the outermost lanes
_BEND_RAD_PER_M2 = 0.02  # bending that costs as much as one m²
_PARALLEL_RAD = math.radians(20.0)
_MAX_OFFSET_CHANGE_M = 1.8  # of a lane that is parallel to another


@dataclass(frozen=True, eq=False)
class _ParallelLane:
    """A lane next to an axis.

    Attributes:
        chain: its lanes.
        curve: their centre line.
        offset: [m, left positive] the mean one from the axis.
    """

    chain: LaneChain
    curve: Curve
    offset: float


@dataclass(frozen=True, eq=False)
class _Stretch:
    """A stretch of road on which a recording may lie.

    Attributes:
        graph: of the map.
        chain: the lanes of its axis.
        curve: the centre line of these.
        begin: arc length [m] on the curve at which the stretch begins.
        span: its length [m].
        bend: [rad/m] its mean curvature.
    """

    graph: LaneGraph
    chain: LaneChain
    curve: Curve
    begin: float
    span: float
    bend: float

    @property
    def lead(self) -> float:
        """Length [m] of the axis before the stretch."""
        return min(self.begin, LEAD_M)

    @cached_property
    def axis(self) -> Curve:
        """The centre line with some of it before and after the stretch."""
        last = min(self.begin + self.span + LEAD_M, self.curve.length)
        return self.curve.cut(max(self.begin - LEAD_M, 0.0), last)

    @cached_property
    def lanes(self) -> dict[int, list[_ParallelLane]]:
        """The lanes along (1) and against (-1) the axis, in order from the driver's left."""
        along = sorted(self._parallel_lanes(1), key=lambda lane: -lane.offset)
        against = sorted(self._parallel_lanes(-1), key=lambda lane: lane.offset)
        keeps_left = along and against and against[0].offset < along[0].offset
        if keeps_left:  # lanes count from the dividing line
            along, against = along[::-1], against[::-1]
        return {1: along, -1: against}

    @cached_property
    def _poses(self) -> Floats:
        """(K, 3) of the axis on the stretch, about every ten metres, to compare lanes with."""
        count = max(math.ceil(self.span / 10.0), 1) + 1
        return self.axis.at(np.linspace(self.lead, self.lead + self.span, count))

    def _parallel_lanes(self, sign: int) -> list[_ParallelLane]:
        """Return the lanes that run next to the axis from end to end."""
        lanes: list[_ParallelLane] = []
        for first in self._first_lanes(sign):
            chain = _parallel_chain(self.graph, first, self._poses[::sign], sign)
            before = self.graph.network.predecessors[first]
            if before and before[0] not in chain:
                chain = (before[0], *chain)
            lane = self._parallel_lane(chain, sign)
            if lane is not None and all(abs(lane.offset - each.offset) > 1.0 for each in lanes):
                lanes.append(lane)
        return lanes

    def _first_lanes(self, sign: int) -> list[int]:
        """Return the lanes that pass the begin of the stretch (the end for -1) on its level."""
        graph = self.graph
        start = self._poses[0 if sign > 0 else -1]
        distance = np.hypot(graph.points[:, 0] - start[0], graph.points[:, 1] - start[1])
        on_axis = np.flatnonzero(np.isin(graph.lane_of, self.chain))
        level = graph.height[on_axis[np.argmin(distance[on_axis])]]
        yaw = start[2] + (0.0 if sign > 0 else np.pi)
        near = (
            (distance < _MAX_ROAD_WIDTH_M)
            & (np.abs(wrap_angle(graph.yaws - yaw)) < _PARALLEL_RAD)
            & ~(np.abs(graph.height - level) > LEVEL_SPACING_M)  # true for unknown heights
        )
        return [int(lane) for lane in np.unique(graph.lane_of[near])]

    def _parallel_lane(self, chain: LaneChain, sign: int) -> _ParallelLane | None:
        """Return a chain as a lane next to the axis; None if it does not stay parallel."""
        curve, poses = self.graph.curve(chain), self._poses
        station, _ = curve.project(poses[:, :2])
        if not ((station > -0.1) & (station < curve.length + 0.1)).all():
            return None
        turn = curve.at(station)[:, 2] - poses[:, 2] + (0.0 if sign > 0 else np.pi)
        _, offset = self.axis.project(curve.at(np.clip(station, 0.0, curve.length))[:, :2])
        parallel = (np.abs(wrap_angle(turn)) < _PARALLEL_RAD).all()
        if not parallel or np.ptp(offset) >= _MAX_OFFSET_CHANGE_M:
            return None
        low = max(float(station.min()) - LEAD_M, 0.0)
        high = min(float(station.max()) + LEAD_M, curve.length)
        return _ParallelLane(chain, curve.cut(low, high), float(offset.mean()))


def street_matches(
    graph: LaneGraph, tracks: tuple[Track, ...], lanes: Sequence[int] | None = None
) -> Iterator[Match]:
    """Yield the recording along the straightest stretches of road that have its lanes.

    Args:
        graph: of the map or a part of it.
        tracks: the recording.
        lanes: the axis begins on one of these; None: on any lane.
    """
    try:
        compact = to_frenet(tracks)
    except RefusedError:
        return
    low, high = compact.span(tracks)
    low, high = low - _END_ROOM_M, high + _END_ROOM_M
    stretches = sorted(
        _stretches(graph, high - low, lanes),
        key=lambda stretch: (round(stretch.bend, 4), stretch.chain),
    )[:_TRIED_STREETS_COUNT]
    variants = [compact.spread()]
    if any(compact.between):
        variants.append(compact)
    if compact.swerve.any():  # without room to swerve, the fit says what is lost
        variants.append(replace(compact, swerve=np.zeros_like(compact.swerve)))
    preferences = (True, False) if any(map(graph.reserved_for, tracks)) else (False,)
    for frenet, stretch, prefer_reserved in product(variants, stretches, preferences):
        stop_if_cancelled()
        match = _match_on(stretch, tracks, frenet, low, prefer_reserved=prefer_reserved)
        if match is not None:
            yield match


def _stretches(graph: LaneGraph, span: float, lanes: Sequence[int] | None) -> Iterator[_Stretch]:
    """Yield the straightest stretch of the chain from each lane, if that is long enough."""
    for first in range(len(graph.network.lanes)) if lanes is None else lanes:
        chain = _straight_chain(graph, first, span)
        curve = graph.curve(chain)
        if curve.length < span:
            continue
        begins = np.arange(0.0, curve.length - span + 1e-9, 5.0)
        station = np.arange(0.0, curve.length + 1e-9, 1.0)
        turned = running_sum(np.abs(np.diff(curve.at(station)[:, 2])))
        turned_before = np.interp(begins, station, turned)
        bend = (np.interp(begins + span, station, turned) - turned_before) / span
        k = int(np.argmin(np.round(bend, 6)))
        yield _Stretch(graph, chain, curve, float(begins[k]), span, float(bend[k]))


def _straight_chain(graph: LaneGraph, first: int, span: float) -> LaneChain:
    """Return the chain from a lane that turns least at every fork, as long as needed."""
    chain, length = [first], graph.length[first]
    while length < span + 2.0 * LEAD_M:
        following = graph.successors(chain)
        if not following:
            break
        chain.append(min(following, key=lambda k: (round(_turn_of_lane(graph, k), 3), k)))
        length += graph.length[chain[-1]]
    return tuple(chain)


def _turn_of_lane(graph: LaneGraph, lane: int) -> float:
    """Return the absolute angle [rad] between the first and the last edge of a lane's centre."""
    centre = graph.network.lanes[lane].centre
    first, last = centre[1] - centre[0], centre[-1] - centre[-2]
    cross = first[0] * last[1] - first[1] * last[0]
    return abs(float(np.arctan2(cross, first[0] * last[0] + first[1] * last[1])))


def _match_on(
    stretch: _Stretch,
    tracks: tuple[Track, ...],
    frenet: FrenetTracks,
    low: float,
    *,
    prefer_reserved: bool,
) -> Match | None:
    """Return the recording on a stretch of road; None if lanes are missing.

    Args:
        stretch: the part of the road.
        tracks: the recording.
        frenet: the same in path coordinates.
        low: station [m] of their reference line at which the stretch begins.
        prefer_reserved: whether vehicles with reserved lanes are put onto these.
    """
    paths: list[LanePath] = []
    offsets: dict[int, list[float]] = {1: [], -1: []}
    for i, track in enumerate(tracks):
        sign = int(frenet.direction[i])
        used = _lanes_used(stretch, track, frenet.lane[i], sign, prefer_reserved=prefer_reserved)
        if used is None:
            return None
        offsets[sign] += [lane.offset for lane in used]
        path = _path_along(stretch, track, used, frenet, i, stretch.lead - low)
        if path is None:
            return None
        paths.append(path)
    oncoming = [abs(a - b) for a in offsets[1] for b in offsets[-1]]
    if any(distance < _MIN_ONCOMING_DISTANCE_M for distance in oncoming):
        return None  # one lane for both directions

    paths, missing = with_lateral_positions(stretch.graph, paths, tracks)
    lateral = [
        lateral_acceleration(path, track) for path, track in zip(paths, tracks, strict=True)
    ]
    speeding = speeding_cost(stretch.graph.network, paths, tracks)
    cost = stretch.bend / _BEND_RAD_PER_M2 + speeding + bend_cost(lateral) + narrow_cost(missing)
    forced = max(each.forced for each in lateral)
    off_reserved = off_reserved_cost(stretch.graph, paths, tracks)
    return Match(tuple(paths), cost, "", forced, off_reserved)


def _lanes_used(
    stretch: _Stretch, track: Track, numbers: Floats, sign: int, *, prefer_reserved: bool
) -> tuple[_ParallelLane, _ParallelLane] | None:
    """Return the lanes at the start and the end of a track; None if there are not as many."""
    graph = stretch.graph
    closed = graph.closed_to(track)
    lanes = [lane for lane in stretch.lanes[sign] if closed.isdisjoint(lane.chain)]
    if prefer_reserved:
        reserved = graph.reserved_for(track)
        for lane in lanes:
            if reserved.issuperset(lane.chain):
                return lane, lane
    first, last = (int(number) for number in numbers)
    return (lanes[first], lanes[last]) if max(first, last) < len(lanes) else None


def _path_along(
    stretch: _Stretch,
    track: Track,
    used: tuple[_ParallelLane, _ParallelLane],
    frenet: FrenetTracks,
    i: int,
    shift: float,
) -> LanePath | None:
    """Return the path of vehicle i along the lanes that it uses; None if it has no room there.

    `shift` [m] converts stations of the reference line to arc lengths on the stretch's axis.
    """
    station = shift + frenet.station[i]
    first, last = used
    curve, chain = first.curve, first.chain
    if first is not last:
        k = int(np.argmax(frenet.change[i] >= 0.5))
        changed = lane_change_curve(curve, last.curve, stretch.axis.at(float(station[k]))[:2])
        if changed is None:
            return None
        curve, chain = changed, tuple(dict.fromkeys((*chain, *last.chain)))
    if frenet.swerve[i].any():
        path = _swerving(chain, curve, stretch.axis.at(station)[:, :2], frenet.swerve[i])
    else:
        begin, _ = curve.project(stretch.axis.at(station[:1])[:, :2])
        driven = (station - station[0]) * int(frenet.direction[i])
        progress = np.zeros(len(station)) if track.still else np.maximum.accumulate(driven)
        path = LanePath(chain, curve, float(begin[0]), progress)
    half = track.vehicle.length / 2.0 + _END_ROOM_M / 2.0
    if path.start < half or path.end + half > curve.length:
        return None
    return path if abs(path.turn) <= abs(turn_of(track)) + _MAX_EXTRA_TURN_RAD else None


def _swerving(chain: LaneChain, lane: Curve, places: Floats, swerve: Floats) -> LanePath:
    """Return the path with offsets (T,) [m, left positive] from a lane at places (T, 2) [m]."""
    at = np.maximum.accumulate(lane.project(places)[0])
    s = np.linspace(0.0, lane.length, max(math.ceil(2.0 * lane.length), 1) + 1)
    moves = np.concatenate(([True], np.diff(at) > 0.0))
    curve = Curve.through(lane.at_offset(s, np.interp(s, at[moves], swerve[moves]))[:, :2])
    driven = np.interp(at, s, curve.station)
    return LanePath(chain, curve, float(driven[0]), driven - driven[0])


def _parallel_chain(graph: LaneGraph, first: int, poses: Floats, sign: int) -> LaneChain:
    """Return the chain from a lane that stays nearest to the axis's poses (K, 3), to the last."""
    chain, goal = [first], poses[-1, :2]
    while True:
        centre = graph.network.lanes[chain[-1]].centre
        arrives = float(np.hypot(*(centre - goal).T).min()) < _MAX_ROAD_WIDTH_M
        if len(chain) > 1 and arrives and _passes(centre, poses[-1], sign):
            return tuple(chain)
        following = graph.successors(chain)
        if not following:
            return tuple(chain)
        distances = {
            k: round(_distance(graph.network.lanes[k].centre[-1], poses), 3) for k in following
        }
        chain.append(min(following, key=lambda k: (distances[k], k)))


def _distance(point: Floats, poses: Floats) -> float:
    """Return the distance [m] of a point (2,) from the nearest of some poses (K, 3)."""
    return float(np.hypot(*(poses[:, :2] - point).T).min())


def _passes(centre: Floats, pose: Floats, sign: int) -> bool:
    """Return whether a lane leads more than ten metres beyond a pose, room for a vehicle."""
    ahead = (centre[-1] - pose[:2]) * np.array([np.cos(float(pose[2])), np.sin(float(pose[2]))])
    return bool(sign * float(ahead.sum()) > 10.0)
