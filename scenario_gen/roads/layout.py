# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""How large a built-in road must be for a template."""

import numpy as np

from scenario_gen import exact
from scenario_gen.arrays import Floats, wrap_angle
from scenario_gen.errors import RefusedError
from scenario_gen.roads.builtin import Layout
from scenario_gen.roads.config import RoadConfig
from scenario_gen.roads.meeting import meeting
from scenario_gen.roads.tracks import Track
from scenario_gen.roads.unrolled import unroll, Unrolled

_ROOM = 6.0  # metres kept free behind the first and before the last footprint
_SLACK = 12.0  # metres by which a junction's geometry may differ from the template's
_SHORTEST = 30.0
_U_TURN = 12.0  # metres between the lanes of a U-turn
_SAME_WAY = np.radians(25.0)
_LANE_GAP = 2.0  # metres sideways that make another lane
_WIDEST = 12.0
_ONCOMING = 20.0  # metres sideways within which oncoming vehicles are on the same road
_MOST_LANES = 3  # per direction, for oncoming vehicles to be as far apart as they are
_PLAIN = 60.0  # metres: an arm when there is no template


def layout_for(name: str, tracks: tuple[Track, ...] | None, config: RoadConfig) -> Layout:
    """Size the road `name` so that the template fits at its own scale."""
    if tracks is None:
        layout = Layout(_PLAIN, _PLAIN, 1)
    else:
        try:
            layout = _along_a_road(tracks, unroll(tracks).spread())
        except RefusedError:  # turns or crossings: a junction's template
            layout = _at_a_junction(tracks, config)
    main, side = (config.arm_length, config.arm_length) if config.arm_length else (layout.main, layout.side)
    lanes = config.lanes or layout.lanes
    mouth = lanes * config.lane_width + config.corner_radius + 5.0 if name != "straight" else 5.0
    return Layout(max(main, mouth), max(side, mouth), lanes)


def _along_a_road(tracks: tuple[Track, ...], unrolled: Unrolled) -> Layout:
    half = np.array([track.vehicle.length for track in tracks]) / 2.0
    span = float((unrolled.station.max(axis=1) + half).max() - (unrolled.station.min(axis=1) - half).min())
    return Layout(max(span / 2.0 + _ROOM, _SHORTEST), _SHORTEST, unrolled.lanes)


def junction_centre(tracks: tuple[Track, ...]) -> Floats:
    """(2,) the middle of where paths cross and where they turn; of where vehicles are nearest if they do neither."""
    points = []
    for i, a in enumerate(tracks):
        for b in tracks[:i]:
            met = meeting(a, b)
            if met is not None:
                points.append(a.curve.at(met.first)[:2])
        if a.turns and not points:
            yaw = a.curve.points[:, 2]
            middle = int(np.argmin(np.abs(yaw - (yaw[0] + yaw[-1]) / 2.0)))
            points.append(a.curve.points[middle, :2])
    if not points:
        points = [track.poses[:, :2].mean(axis=0) for track in tracks]
    return np.asarray(np.mean(points, axis=0))


def _at_a_junction(tracks: tuple[Track, ...], config: RoadConfig) -> Layout:
    centre = junction_centre(tracks)
    needs, yaws = [], []
    for track in tracks:
        for k in (0, -1):
            pose = track.poses[k]
            away = float(exact.hypot(*(pose[:2] - centre)))
            needs.append(away + track.vehicle.length / 2.0 + _ROOM + _SLACK)
            yaws.append(float(pose[2]))
    main_yaw = yaws[int(np.argmax(needs))]
    across = np.abs(exact.sin(wrap_angle(np.array(yaws) - main_yaw)))
    need = np.array(needs)
    main = float(need.max())
    side = max(float(need[across > exact.sin(np.radians(30.0))].max(initial=_SHORTEST)), _SHORTEST)
    lanes = _parallel_lanes(tracks, config.lane_width)
    if any(track.makes_u_turn for track in tracks):  # from one outermost lane to the other in a half circle
        lanes = max(lanes, int(np.ceil((_U_TURN / config.lane_width + 1.0) / 2.0)))
    return Layout(max(main, _SHORTEST), side, lanes)


def _parallel_lanes(tracks: tuple[Track, ...], lane_width: float) -> int:
    """Lanes per direction for those who come or leave the same way, and for those who come or leave the opposite way.

    By how far beside one's path others start or end; lanes i and j of the two directions are i + j + 1 lanes apart.
    """
    most = 1
    for k in (0, -1):
        poses = np.stack([track.poses[k] for track in tracks])
        for track in tracks:
            station, offset = track.curve.project(poses[:, :2])
            same = (exact.cos(poses[:, 2] - track.curve.at(station)[:, 2]) > exact.cos(_SAME_WAY)) & (np.abs(offset) < _WIDEST)
            gaps = np.diff(np.sort(offset[same]))
            most = max(most, 1 + int((gaps > _LANE_GAP).sum()))
            oncoming = (exact.cos(poses[:, 2] - track.curve.at(station)[:, 2]) < -exact.cos(_SAME_WAY)) & (
                np.abs(offset) < _ONCOMING
            )
            between = np.round(np.abs(offset[oncoming]) / lane_width - 1.0).max(initial=0.0)
            most = max(most, min(1 + int(np.ceil(between / 2.0)), _MOST_LANES))
    return most
