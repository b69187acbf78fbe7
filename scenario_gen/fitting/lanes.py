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

"""Placing a template along a road's lanes: following, oncoming, passing, changing lanes, on a line laid out straight.

Eq 9 in path coordinates is one-dimensional: stations on the template's reference line, times s, are stations on the lane.
All vehicles share one map, so the gaps between them survive.
"""

from dataclasses import dataclass, replace

import numpy as np

from scenario_gen import exact
from scenario_gen.arrays import Floats, frozen, wrap_angle
from scenario_gen.curve import Curve
from scenario_gen.errors import RefusedError
from scenario_gen.fitting.config import FittingConfig
from scenario_gen.fitting.placement import check_scale, Placement, separated
from scenario_gen.roads.clearance import footprint_fits
from scenario_gen.template.frenet import FrenetTracks, to_frenet
from scenario_gen.template.tracks import Track
from scenario_gen.types.road import Road

_COLLINEAR = 0.3  # metres
_PARALLEL = np.radians(2.0)
_END_ROOM = 1.0  # metres kept between a footprint and the end of the road
_SHIFT_CURVATURE = 0.08  # 1/m, sharpest change of lanes


@dataclass(frozen=True, eq=False)
class _Axis:
    """A straight road through the map: where it begins, its yaw and length, and its lanes.

    `ahead` and `against` are the offsets [m, left positive] of the lanes along and against the yaw, each from its driver's
    left to the right.
    """

    begin: Floats
    yaw: float
    length: float
    ahead: Floats
    against: Floats


def place_along_lanes(tracks: tuple[Track, ...], road: Road, config: FittingConfig) -> Placement:
    """Place a template that needs no junction on the longest straight road that has its lanes.

    Raises:
        RefusedError: it turns or crosses, or the road has too few lanes or is too short.
    """
    axes = _axes(road, tracks)
    compact = to_frenet(tracks)
    for frenet in (compact.spread(), compact):
        needed = {sign: int(frenet.lane[frenet.direction == sign].max(initial=-1)) + 1 for sign in (1, -1)}
        fitting = [axis for axis in axes if len(axis.ahead) >= needed[1] and len(axis.against) >= needed[-1]]
        if fitting:
            break
    if not fitting:
        found = "; ".join(f"{len(a.ahead)} and {len(a.against)}" for a in axes) or "none"
        raise RefusedError(
            f"road {road.name} has no straight way through with the lanes that the template needs "
            f"({needed[1]} one way, {needed[-1]} the other; found: {found})"
        )
    axis = max(fitting, key=lambda a: round(a.length, 1))
    half = np.array([[track.vehicle.length / 2.0] for track in tracks])
    low, high = float((frenet.station - half).min()), float((frenet.station + half).max())
    centre, scale = (low + high) / 2.0, 1.0
    if high - low > axis.length - 2.0 * _END_ROOM:
        cars = float(2.0 * half.max())
        scale = (axis.length - 2.0 * _END_ROOM - cars) / (high - low - cars)
        check_scale(scale, f"the template is {high - low:.0f} m long, road {road.name} {axis.length:.0f} m: it", config)
    placed = tuple(_placed_track(track, i, frenet, axis, centre, scale) for i, track in enumerate(tracks))
    manoeuvres = tuple("wait" if track.still else "straight" for track in tracks)
    notes = tuple(_note(track, i, frenet) for i, track in enumerate(tracks))
    if scale != 1.0:
        notes = (f"scaled by {scale:.3f} to fit the road's length", *notes)
    placement = Placement(placed, frozen(np.full(len(tracks), scale)), manoeuvres, frozen(np.zeros(len(tracks))), notes)
    return separated(placement, config, sideways=0.0)


def _note(track: Track, i: int, frenet: FrenetTracks) -> str:
    way = "along" if frenet.direction[i] > 0 else "against"
    start, end = frenet.lane[i]
    lane = f"in lane {start}" if start == end else f"changing from lane {start} to lane {end}"
    return f"vehicle {track.vehicle.id} drives {way} the main direction {lane} (counted from its left)"


def _axes(road: Road, tracks: tuple[Track, ...]) -> list[_Axis]:
    """Straight ways from an entry to an exit, those that are parallel gathered into one road."""
    length, width = max(t.vehicle.length for t in tracks), max(t.vehicle.width for t in tracks)
    through: list[tuple[Floats, float]] = []
    for entry in road.entries:
        for leave in road.exits:
            d = leave[:2] - entry[:2]
            cos, sin = exact.cos(entry[2]), exact.sin(entry[2])
            ahead, aside = d[0] * cos + d[1] * sin, d[1] * cos - d[0] * sin
            straight = abs(wrap_angle(np.asarray(leave[2] - entry[2]))) < _PARALLEL
            if straight and ahead > 2.0 * length and abs(aside) < _COLLINEAR:
                line = Curve(np.array([entry, [*leave[:2], entry[2]]])).cut(length / 2.0 + 0.5, ahead - length / 2.0 - 0.5)
                if footprint_fits(road, line.points, length, width).all():
                    through.append((entry, float(ahead)))
    axes: list[_Axis] = []
    for entry, size in through:
        if any(_belongs(entry, axis) for axis in axes):
            continue
        yaw = float(entry[2])
        normal = np.array([-exact.sin(yaw), exact.cos(yaw)])
        ahead, against = [], []
        for other, _ in through:
            turned = abs(float(wrap_angle(np.asarray(other[2] - yaw))))
            offset = float(exact.matmul(other[:2] - entry[:2], normal))
            if turned < _PARALLEL:
                ahead.append(offset)
            elif turned > np.pi - _PARALLEL:
                against.append(offset)
        axes.append(_Axis(entry[:2], yaw, size, frozen(sorted(ahead, reverse=True)), frozen(sorted(against))))
    return axes


def _belongs(entry: Floats, axis: _Axis) -> bool:
    turned = abs(float(wrap_angle(np.asarray(entry[2] - axis.yaw))))
    return bool(turned < _PARALLEL or turned > np.pi - _PARALLEL)


def _placed_track(track: Track, i: int, frenet: FrenetTracks, axis: _Axis, centre: float, scale: float) -> Track:
    """One vehicle in its lane."""
    sign = int(frenet.direction[i])
    along = axis.length / 2.0 + scale * (frenet.station[i] - centre)  # metres from the axis' beginning
    lanes = axis.ahead if sign > 0 else axis.against
    start, end = float(lanes[frenet.lane[i, 0]]), float(lanes[frenet.lane[i, 1]])
    along = along if sign > 0 else axis.length - along  # metres driven since the beginning of its own lane
    begin = axis.begin if sign > 0 else axis.begin + axis.length * np.array([exact.cos(axis.yaw), exact.sin(axis.yaw)])
    yaw = axis.yaw if sign > 0 else axis.yaw + np.pi
    s = np.arange(0.0, max(along[-1] - along[0], 1.0) + 1.0, 0.5)
    aside = start + (end - start) * _blend(along - along[0], frenet.change[i], s, abs(end - start))
    x = along[0] + s
    xy = begin + np.outer(x, [exact.cos(yaw), exact.sin(yaw)]) + np.outer(aside, [-exact.sin(axis.yaw), exact.cos(axis.yaw)])
    curve = Curve.through(xy)
    progress = np.zeros_like(along) if track.still else np.interp(along - along[0], s, curve.station)
    return replace(track, curve=curve, progress=frozen(progress))


def _blend(driven: Floats, change: Floats, s: Floats, width: float) -> Floats:
    """A smooth change of lanes, 0 to 1 along `s`, where the template makes it (between 10 and 90 % done)."""
    if change[-1] <= 0.0:
        return np.zeros_like(s)
    first, last = (float(driven[np.argmax(change >= level)]) for level in (0.1, 0.9))
    reach = max((last - first) / 0.5, np.sqrt(width * 5.7735 / _SHIFT_CURVATURE), 1.0)
    middle = np.clip((first + last) / 2.0, min(reach / 2.0, s[-1] / 2.0), max(s[-1] - reach / 2.0, s[-1] / 2.0))
    x = np.clip((s - middle) / min(reach, s[-1]) + 0.5, 0.0, 1.0)
    return np.asarray(exact.power(x, 3) * (10.0 - 15.0 * x + 6.0 * np.square(x)))
