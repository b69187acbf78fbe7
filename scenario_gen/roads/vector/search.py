# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The best rigid placements of a recording on a whole map: its paths lie along lanes.

Every placement that puts one of a few recorded poses onto a lane is tried. Its cost is the mean
squared distance of the recorded poses from the nearest lane of their direction. The best ones are
refined.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
import math

import numpy as np

from scenario_gen.base.cancelling import stop_if_cancelled
from scenario_gen.numerics import Floats, wrap_angle
from scenario_gen.numerics.pattern_search import pattern_search
from scenario_gen.numerics.plane import place
from scenario_gen.roads.vector.lane_field import lane_sections, LaneField
from scenario_gen.roads.vector.lane_graph import LaneGraph
from scenario_gen.situation import pair_crossings, Track

_KEPT_CANDIDATES = 60
_MIN_DISTANCE_M = 15.0  # between placements that count as different,
_MIN_TURN_RAD = math.radians(30.0)  # unless one is turned by this
_MAX_CROSSING_ANGLE_ERROR_RAD = math.radians(50.0)
_CHUNK_POSES = 2_000_000  # looked up at once


@dataclass(frozen=True)
class RigidPlacement:
    """Where the recording's own frame lies on a map.

    Attributes:
        cost: [m²] mean squared distance of the recorded poses from lanes of their direction.
        x: [m].
        y: [m].
        yaw: [rad].
    """

    cost: float
    x: float
    y: float
    yaw: float

    def apply(self, points: Floats) -> Floats:
        """Return recorded points (P, 2) [m] on the map."""
        return place(np.array([self.x, self.y, self.yaw]), *points.T)


@dataclass(frozen=True, eq=False)
class _RecordedPoses:
    """Poses along all recorded paths.

    Attributes:
        poses: (P, 3) x, y [m], yaw [rad].
        weight: (P,) with sum one; all vehicles have the same share.
    """

    poses: Floats
    weight: Floats

    @classmethod
    def of(cls, tracks: tuple[Track, ...]) -> "_RecordedPoses":
        """Return a pose every two metres, at most 40 of each path."""
        poses, weight = [], []
        for track in tracks:
            count = 1 if track.still else min(max(math.ceil(track.travelled / 2.0), 1) + 1, 40)
            poses.append(track.curve.at(np.linspace(0.0, track.travelled, count)))
            weight.append(np.full(count, 1.0 / (count * len(tracks))))
        return cls(np.concatenate(poses), np.concatenate(weight))

    @property
    def centre(self) -> Floats:
        """(2,) [m] mean of the poses."""
        return np.asarray(self.poses[:, :2].mean(axis=0))

    def costs(self, field: LaneField, frames: Floats) -> Floats:
        """Return the costs (M,) [m²] of frames (M, 3) x, y [m], yaw [rad] on the map."""
        step = max(_CHUNK_POSES // len(self.poses), 1)
        parts = []
        for first in range(0, len(frames), step):
            squared = field.squared(frames[first : first + step], self.poses)
            parts.append((squared * self.weight).sum(axis=1))
        return np.concatenate([np.zeros(0), *parts])

    def refined(self, field: LaneField, rows: Floats) -> Floats:
        """Return the best rows near some, by moves and turns about the recording's centre.

        Rows (M, 4) are cost [m²], x, y [m], yaw [rad].
        """
        centre = self.centre
        local = _RecordedPoses(self.poses - np.array([*centre, 0.0]), self.weight)
        states, costs = pattern_search(
            lambda frames: local.costs(field, frames),
            np.column_stack((place(rows[:, 1:], *centre), rows[:, 3])),
            np.array([2.0, 2.0, math.radians(4.0)]),
            0.2,
        )
        return np.column_stack((costs, _frames_onto(centre, states[:, :2], states[:, 2])))


def rigid_placements(
    graph: LaneGraph, tracks: tuple[Track, ...], lanes: Sequence[int] | None = None
) -> list[RigidPlacement]:
    """Return the best placements, the best first, no two of which are nearly the same.

    Args:
        graph: of a whole map.
        tracks: of all recorded vehicles.
        lanes: a vehicle is put onto one of these; None: onto any lane.
    """
    field, recorded = graph.field, _RecordedPoses.of(tracks)
    chosen = graph.network.lanes if lanes is None else [graph.network.lanes[k] for k in lanes]
    points, yaws = lane_sections(chosen, every=2)
    candidates = []
    for anchor in _anchors(tracks):
        frames = _frames_onto(anchor[:2], points, yaws - anchor[2])
        cost = recorded.costs(field, frames)
        stop_if_cancelled()
        best = np.argsort(np.round(cost, 9), kind="stable")[: 4 * _KEPT_CANDIDATES]
        candidates.append(np.column_stack((cost, frames))[best])
    coarse = _distinct(np.concatenate(candidates), recorded.centre)
    return _placements(_distinct(recorded.refined(field, coarse), recorded.centre))


def crossing_placements(graph: LaneGraph, tracks: tuple[Track, ...]) -> list[RigidPlacement]:
    """Return the placements that put recorded crossings onto crossings of lanes, the best first.

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
    moved = np.concatenate(frames)
    if not len(moved):
        return []
    recorded = _RecordedPoses.of(tracks)
    rows = np.column_stack((recorded.costs(graph.field, moved), moved))
    return _placements(_distinct(rows, recorded.centre))


def placement_at(graph: LaneGraph, tracks: tuple[Track, ...], frame: Floats) -> RigidPlacement:
    """Return the placement of the recording's frame at (3,) x, y [m], yaw [rad], with its cost."""
    (cost,) = _RecordedPoses.of(tracks).costs(graph.field, frame[None]).tolist()
    return RigidPlacement(cost, *frame.tolist())


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


def _placements(rows: Floats) -> list[RigidPlacement]:
    """Return the placements of rows (M, 4) cost [m²], x, y [m], yaw [rad]."""
    return [RigidPlacement(*row) for row in rows.tolist()]


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
