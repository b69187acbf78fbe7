# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Hypotheses on where a recording may lie on a map: approximate poses of its vehicles.

A rigid one moves the recording as one piece. All that put one of a few recorded poses onto a lane
are tried, and the best ones are refined; others put recorded crossings onto crossings of lanes.
A recording along one road (`situation.frenet`) is also bent along the lanes of other roads.
The cost is the mean squared distance of the poses from the nearest lanes of their direction.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice, product
import math

import numpy as np

from scenario_gen.base.cancelling import stop_if_cancelled
from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Bools, Floats, place, wrap_angle
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.pattern_search import pattern_search
from scenario_gen.roads.vector.lane_field import lane_sections, LaneField
from scenario_gen.roads.vector.lane_graph import LaneChain, LaneGraph, LEAD_M
from scenario_gen.situation import FrenetTracks, main_line, pair_crossings, to_frenet, Track

POSE_COUNT = 24  # along each recorded path
_KEPT_CANDIDATES = 60
_MIN_DISTANCE_M = 15.0  # between placements that count as different,
_MIN_TURN_RAD = math.radians(30.0)  # unless one is turned by this
_MAX_CROSSING_ANGLE_ERROR_RAD = math.radians(50.0)
_CHUNK_POSES = 2_000_000  # looked up at once
_END_ROOM_M = 1.5  # between a footprint and the end of a street
_ROUNDING_M = 1e-3  # by which a scaled recording is shorter, so that no CPU rounds it too long
_TRIED_STREETS_COUNT = 40  # those that bend most like the recording
_BEND_RAD_PER_M2 = 0.02  # bending that costs as much as one m²
_LEFT_OUT_M2 = 1.0  # of lanes between the directions, or of swerves


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """Approximate poses of N recorded vehicles on a map.

    Attributes:
        cost: [m²] mean squared distance of the poses from lanes of their direction, and `extra`.
        poses: (N, POSE_COUNT, 3) at equal steps along the recorded paths.
        scale: s of eq 9 for which they hold.
        extra: [m²] further cost: a street bends otherwise than the recorded one, or lanes between
            the directions or swerves are left out.
        swerve: (N, T) [m, left positive] recorded offsets from the lanes; None: there are none.
        ends: ids of the lanes by which each vehicle enters and leaves, "" for any; () for all.
        may_begin_before: whether a vehicle may begin before the first lane on its way.
    """

    cost: float
    poses: Floats
    scale: float = 1.0
    extra: float = 0.0
    swerve: Floats | None = None
    ends: tuple[tuple[str, str], ...] = ()
    may_begin_before: bool = False


def recorded_poses(tracks: Sequence[Track]) -> Floats:
    """Return poses (N, POSE_COUNT, 3) at equal steps along all recorded paths."""
    return np.stack(
        [track.curve.at(np.linspace(0.0, track.travelled, POSE_COUNT)) for track in tracks]
    )


def _costs(field: LaneField, poses: Floats, frames: Floats) -> Floats:
    """Return the costs (M,) [m²] of poses (P, 3) in frames (M, 3) on the map."""
    step = max(_CHUNK_POSES // len(poses), 1)
    parts = [
        field.squared(frames[first : first + step], poses).mean(axis=1)
        for first in range(0, len(frames), step)
    ]
    return np.concatenate([np.zeros(0), *parts])


def rigid_hypotheses(
    graph: LaneGraph, tracks: tuple[Track, ...], lanes: Sequence[int] | None = None
) -> list[Hypothesis]:
    """Return the best rigid ones, the best first, no two of which are nearly the same.

    Args:
        graph: of a whole map.
        tracks: of all recorded vehicles.
        lanes: a vehicle is put onto one of these; None: onto any lane.
    """
    field, poses = graph.field, recorded_poses(tracks)
    flat = poses.reshape(-1, 3)
    centre = flat[:, :2].mean(axis=0)
    chosen = graph.network.lanes if lanes is None else [graph.network.lanes[k] for k in lanes]
    points, yaws = lane_sections(chosen, every=2)
    candidates = []
    for anchor in _anchors(tracks):
        frames = _frames_onto(anchor[:2], points, yaws - anchor[2])
        cost = _costs(field, flat, frames)
        stop_if_cancelled()
        best = np.argsort(np.round(cost, 9), kind="stable")[: 4 * _KEPT_CANDIDATES]
        candidates.append(np.column_stack((cost, frames))[best])
    coarse = _distinct(np.concatenate(candidates), centre)

    # Moves and turns are about the recording's centre.
    states, costs = pattern_search(
        partial(_costs, field, flat - np.array([*centre, 0.0])),
        np.column_stack((place(coarse[:, 1:], *centre), coarse[:, 3])),
        np.array([2.0, 2.0, math.radians(4.0)]),
        0.2,
    )
    refined = np.column_stack((costs, _frames_onto(centre, states[:, :2], states[:, 2])))
    return _moved(_distinct(refined, centre), poses)


def crossing_hypotheses(graph: LaneGraph, tracks: tuple[Track, ...]) -> list[Hypothesis]:
    """Return the rigid ones that put recorded crossings onto crossings of lanes, the best first.

    Lanes that are wider than the recorded ones shift the paths against each other, so such a place
    need not be among those that resemble all paths most.
    """
    point, yaw = graph.crossings
    frames = [np.zeros((0, 3))]
    for a, b, crossing in islice(pair_crossings(tracks), 3):
        first, second = tracks[a].curve.at(crossing.first), tracks[b].curve.at(crossing.second)
        turn = wrap_angle(yaw - np.array([first[2], second[2]]))
        error = wrap_angle(turn[:, 1] - turn[:, 0])
        alike = np.abs(error) <= _MAX_CROSSING_ANGLE_ERROR_RAD
        mean_turn = turn[alike, 0] + error[alike] / 2.0
        frames.append(_frames_onto(first[:2], point[alike], mean_turn))
    moved, poses = np.concatenate(frames), recorded_poses(tracks)
    flat = poses.reshape(-1, 3)
    rows = np.column_stack((_costs(graph.field, flat, moved), moved))
    return _moved(_distinct(rows, flat[:, :2].mean(axis=0)), poses)


def hypothesis_at(graph: LaneGraph, tracks: tuple[Track, ...], frame: Floats) -> Hypothesis:
    """Return the one with the recording's frame at (3,) x, y [m], yaw [rad]."""
    poses = recorded_poses(tracks)
    cost = _costs(graph.field, poses.reshape(-1, 3), frame[None])
    (only,) = _moved(np.concatenate((cost, frame))[None], poses)
    return only


def _moved(rows: Floats, poses: Floats) -> list[Hypothesis]:
    """Return the rigid ones of rows (M, 4) cost [m²], x, y [m], yaw [rad]."""
    hypotheses = []
    for cost, *frame in rows.tolist():
        points = place(np.array(frame), poses[..., 0], poses[..., 1])
        yaw = poses[..., 2:] + frame[2]
        hypotheses.append(Hypothesis(cost, np.concatenate((points, yaw), axis=-1)))
    return hypotheses


def _frames_onto(point: Floats, places: Floats, turn: Floats) -> Floats:
    """Return the frames (M, 3), turned by (M,) [rad], that put a point (2,) onto places (M, 2)."""
    return np.column_stack((place(np.column_stack((places, turn)), -point[0], -point[1]), turn))


def _anchors(tracks: tuple[Track, ...]) -> list[Floats]:
    """Return the recorded poses that are put onto lanes.

    They are the crossings of paths, and the begin, middle and end of the two longest paths.
    """
    anchors: list[Floats] = []
    for a, b, crossing in islice(pair_crossings(tracks), 2):
        anchors += [tracks[a].curve.at(crossing.first), tracks[b].curve.at(crossing.second)]
    for track in sorted(tracks, key=lambda track: -track.travelled)[:2]:
        anchors += [track.curve.at(share * track.travelled) for share in (0.05, 0.5, 0.95)]
    return anchors


def _distinct(rows: Floats, centre: Floats) -> Floats:
    """Return the best of those rows (M, 4) that are nearly the same, the best first."""
    cost, x, y, yaw = rows.T
    # Rounding makes the order the same on every CPU.
    order = np.lexsort((np.round(y, 3), np.round(x, 3), np.round(yaw, 6), np.round(cost, 6)))
    places = place(rows[:, 1:], *centre)
    kept: list[int] = []
    while len(order) and len(kept) < _KEPT_CANDIDATES:
        best = order[0]
        kept.append(best)
        offset = np.abs(places[order] - places[best]).max(axis=1)
        turn = np.abs(wrap_angle(yaw[order] - yaw[best]))
        order = order[(offset >= _MIN_DISTANCE_M) | (turn >= _MIN_TURN_RAD)]
    return rows[kept]


@dataclass(frozen=True, eq=False)
class _Profile:
    """A recording along one road, in lanes to the left of the road's dividing line.

    Attributes:
        station: (N, POSE_COUNT) [m] of centres, from where the longest vehicle could be first.
        lanes: (N, POSE_COUNT) lanes [lane widths, left positive] from the dividing line.
        against: (N,) whether a vehicle drives against the road's direction.
        swerve: (N, T) [m, left positive] from the lanes; None: there are none.
        extra: [m²] cost of what it leaves out.
    """

    station: Floats
    lanes: Floats
    against: Bools
    swerve: Floats | None
    extra: float = 0.0

    @classmethod
    def of(cls, tracks: tuple[Track, ...], frenet: FrenetTracks, between: int) -> "_Profile":
        """Return the profile with some lanes between the two directions."""
        against = frenet.direction < 0
        side = 1.0  # on which oncoming vehicles pass
        if against.any():
            middle = frenet.offset.mean(axis=1)
            side = math.copysign(1.0, middle[against].mean() - middle[~against].mean())
        low = frenet.span(tracks)[0] + _half_length(tracks)
        station, lanes = [], []
        for i, track in enumerate(tracks):
            same_way = frenet.lane[against == against[i]]
            first, last = frenet.lane[i] if side > 0.0 else same_way.max() - frenet.lane[i]
            done = np.linspace(0.0, track.travelled, POSE_COUNT)
            change = np.interp(done, track.progress, frenet.change[i])
            number = 0.5 + first + (last - first) * change
            lanes.append(side * (number + between if against[i] else -number))
            station.append(np.interp(done, track.progress, frenet.station[i]) - low)
        swerve = frenet.swerve if frenet.swerve.any() else None
        return cls(np.stack(station), np.stack(lanes), against, swerve)


@dataclass(frozen=True, eq=False)
class _Stretch:
    """A stretch of road for a recording: lanes, their centre line, and the stretch's begin on it.

    Attributes:
        chain: the lanes.
        curve: their centre line.
        begin: [m] arc length of the first centre.
        scale: at which the recording is as long.
        bend: [rad/m] by which it bends otherwise than the recording.
    """

    chain: LaneChain
    curve: Curve
    begin: float
    scale: float
    bend: float


def street_hypotheses(
    graph: LaneGraph,
    tracks: tuple[Track, ...],
    lanes: Sequence[int] | None,
    min_scale: float,
) -> list[Hypothesis]:
    """Return those that bend a recording along the lanes of a road, the best first.

    Args:
        graph: of the map or a part of it.
        tracks: the recording; there are none if it needs a junction.
        lanes: the road begins on one of these; None: on any lane.
        min_scale: the smallest s of eq 9, for roads that are too short.

    Raises:
        RefusedError: all roads are too short.
    """
    try:
        frenet = to_frenet(tracks)
    except RefusedError:
        return []
    profiles = [_Profile.of(tracks, frenet, sum(frenet.between))]
    if any(frenet.between):
        profiles.append(replace(_Profile.of(tracks, frenet, 0), extra=_LEFT_OUT_M2))
    profiles += [
        replace(each, swerve=None, extra=each.extra + _LEFT_OUT_M2)
        for each in profiles
        if each.swerve is not None
    ]
    hypotheses = []
    for stretch, profile in product(_stretches(graph, tracks, frenet, lanes, min_scale), profiles):
        along = profile.lanes[~profile.against]
        for axis in np.unique(np.round(along, 6)[:, [0, -1]]).tolist():
            stop_if_cancelled()
            hypotheses.append(_bent(graph, stretch, profile, axis))
    return sorted(hypotheses, key=lambda each: round(each.cost, 3))


def _bent(graph: LaneGraph, stretch: _Stretch, profile: _Profile, axis: float) -> Hypothesis:
    """Return a recording along a stretch whose lane is `axis` lanes left of the dividing line."""
    width = 2.0 * float(graph.half_width[np.isin(graph.lane_of, stretch.chain)].mean())
    station = stretch.begin + stretch.scale * profile.station
    poses = stretch.curve.at_offset(station, width * (profile.lanes - axis))
    poses[profile.against, :, 2] += np.pi
    extra = stretch.bend / _BEND_RAD_PER_M2 + profile.extra
    (cost,) = _costs(graph.field, poses.reshape(-1, 3), np.zeros((1, 3))).tolist()
    return Hypothesis(cost + extra, poses, stretch.scale, extra, profile.swerve)


def _stretches(
    graph: LaneGraph,
    tracks: tuple[Track, ...],
    frenet: FrenetTracks,
    lanes: Sequence[int] | None,
    min_scale: float,
) -> list[_Stretch]:
    """Return the stretches of the chains from some lanes that bend most like a recording."""
    low, high = frenet.span(tracks)
    needed = high - low + 2.0 * _END_ROOM_M
    room = _half_length(tracks) + _END_ROOM_M
    fixed = 2.0 * room + _ROUNDING_M
    shape = main_line(frenet, tracks).shape
    yaw = shape.at(np.arange(room - _END_ROOM_M, high - low - room, 1.0))[:, 2]
    longest = 0.0
    stretches: list[list[_Stretch]] = []
    for first in range(len(graph.network.lanes)) if lanes is None else lanes:
        chain = _straight_chain(graph, first, needed)
        curve = graph.curve(chain)
        longest = max(longest, curve.length)
        scale = min((curve.length - fixed) / (needed - fixed), 1.0)
        if curve.length >= needed:
            scale = 1.0
        if scale >= min_scale:
            stretches.append(_best_stretches(chain, curve, yaw, scale, room))
    if not stretches:
        scale = (longest - fixed) / (needed - fixed)
        raise RefusedError(
            f"the recording is {high - low:.0f} m long, the longest road {longest:.0f} m: it "
            f"would need scale {max(scale, 0.0):.2f}; at least {min_scale:g} is accepted"
        )
    stretches.sort(key=lambda alike: (round(alike[0].bend, 4), alike[0].chain))
    return [each for alike in stretches[:_TRIED_STREETS_COUNT] for each in alike]


def _best_stretches(
    chain: LaneChain, curve: Curve, yaw: Floats, scale: float, room: float
) -> list[_Stretch]:
    """Return the stretches of a chain that bend most like a line with yaws (S,) every metre.

    They leave some room [m] at both ends. Of several that bend alike there are the first and the
    one in their middle, which has room for paths that are longer than the line.
    """
    along = scale * np.arange(len(yaw))
    begins = room + np.arange(0.0, max(curve.length - along[-1] - 2.0 * room, 0.0) + 1e-9, 5.0)
    other = curve.at(begins[:, None] + along)[..., 2] - yaw
    bend = np.abs(np.diff(other, axis=1)).sum(axis=1) / along[-1]
    alike = np.flatnonzero(np.round(bend, 6) == np.round(bend, 6).min())
    chosen = dict.fromkeys((int(alike[0]), int(alike[len(alike) // 2])))
    return [_Stretch(chain, curve, float(begins[k]), scale, float(bend[k])) for k in chosen]


def _half_length(tracks: Sequence[Track]) -> float:
    """Return how far [m] the longest vehicle reaches from its centre."""
    return max(track.vehicle.rear for track in tracks)


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
    yaw = graph.network.lanes[lane].yaw
    return abs(float(wrap_angle(yaw[-1] - yaw[0])))
