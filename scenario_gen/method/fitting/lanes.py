# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Placing a template along a road's lanes: following, oncoming, passing, changing lanes, on a line that bends as its own.

Eq 9 in path coordinates is one-dimensional: stations on the template's reference line, times s, are stations on the lane.
All vehicles share one map, so the gaps between them survive.
"""

from dataclasses import dataclass, replace

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.fitting.config import FittingConfig
from scenario_gen.method.fitting.kept import find_unused, refuse_lost_turns
from scenario_gen.method.fitting.placement import check_scale, Placement, separated, share_with_room
from scenario_gen.numerics import Floats, frozen, wrap_angle
from scenario_gen.numerics.curve import Curve
from scenario_gen.roads import arms_of, footprint_fits, line_between, relative, reverse
from scenario_gen.template import FrenetTracks, main_line, MainLine, manoeuvre_of, to_frenet, Track, turn_of
from scenario_gen.types import Road

_COLLINEAR = 0.3  # metres
_PARALLEL = np.radians(2.0)
_END_ROOM = 1.0  # metres kept between a footprint and the end of the road
_SHIFT_CURVATURE = 0.08  # 1/m, sharpest change of lanes


@dataclass(frozen=True, eq=False)
class _Axis:
    """A road through the map: its dividing line, its lanes, and where on the line the template's main line begins.

    `ahead` and `against` are the offsets [m, left positive] of the lanes along and against the line, each from its driver's
    left to the right. `begin` is None where the template may stand anywhere along it.
    """

    line: Curve
    ahead: Floats
    against: Floats
    begin: float | None = None


def place_along_lanes(tracks: tuple[Track, ...], road: Road, config: FittingConfig) -> Placement:
    """Place a template that needs no junction on a road that has its lanes and bends as its own, or else on a straight one.

    Raises:
        RefusedError: it turns or crosses, or the road has too few lanes, is too short, or bends otherwise.
    """
    compact = to_frenet(tracks)
    reasons: list[str] = []
    for axes in (_bent_axes(road, main_line(compact, tracks)), _straight_axes(road, tracks)):
        for frenet in (compact.spread(), compact):
            needed = {sign: int(frenet.lane[frenet.direction == sign].max(initial=-1)) + 1 for sign in (1, -1)}
            fitting = [axis for axis in axes if len(axis.ahead) >= needed[1] and len(axis.against) >= needed[-1]]
            if fitting:
                break
        if not fitting:
            counts = "; ".join(f"{len(a.ahead)} and {len(a.against)}" for a in axes)
            if counts:
                reasons.append(
                    f"road {road.name} has no way through with the lanes that the template needs "
                    f"({needed[1]} one way, {needed[-1]} the other; found: {counts})"
                )
            continue
        for axis in sorted(fitting, key=lambda a: -round(a.line.length, 1)):
            try:
                return _on_axis(tracks, frenet, axis, road, config)
            except RefusedError as error:
                reasons.append(str(error))
    raise RefusedError(
        reasons[0] if reasons else f"road {road.name} has no straight way through, and none that bends as the template's"
    )


def _on_axis(tracks: tuple[Track, ...], frenet: FrenetTracks, axis: _Axis, road: Road, config: FittingConfig) -> Placement:
    main = main_line(frenet, tracks)
    scale = 1.0
    if axis.begin is not None:
        along = axis.begin + np.interp(frenet.station, main.station, main.at)
    else:
        low, high = main.station[[0, -1]].tolist()
        if high - low > axis.line.length - 2.0 * _END_ROOM:
            cars = max(track.vehicle.length for track in tracks)
            scale = (axis.line.length - 2.0 * _END_ROOM - cars) / (high - low - cars)
            check_scale(scale, f"the template is {high - low:.0f} m long, road {road.name} {axis.line.length:.0f} m: it", config)
        along = axis.line.length / 2.0 + scale * (frenet.station - (low + high) / 2.0)
    placed = tuple(_placed_track(track, i, frenet, axis, along[i]) for i, track in enumerate(tracks))
    refuse_lost_turns(tracks, placed, road.name)
    if axis.begin is not None:
        for track in placed:
            if share_with_room(road, track) < 1.0:
                raise RefusedError(f"vehicle {track.vehicle.id} has no room everywhere on the bent way through road {road.name}")
    notes = tuple(_note(track, i, frenet) for i, track in enumerate(tracks))
    if scale != 1.0:
        notes = (f"scaled by {scale:.3f} to fit the road's length", *notes)
    placement = Placement.of(placed, scale, notes, (manoeuvre_of(turn_of(track)) for track in placed))
    unused = find_unused(road, [axis.line.points[k] for k in (0, -1)])
    return separated(replace(placement, unused=unused), config, sideways=0.0, own=tracks)


def _note(track: Track, i: int, frenet: FrenetTracks) -> str:
    way = "along" if frenet.direction[i] > 0 else "against"
    start, end = frenet.lane[i]
    lane = f"in lane {start}" if start == end else f"changing from lane {start} to lane {end}"
    return f"vehicle {track.vehicle.id} drives {way} the main direction {lane} (counted from its left)"


def _straight_axes(road: Road, tracks: tuple[Track, ...]) -> list[_Axis]:
    """Straight ways from an entry to an exit, those that are parallel gathered into one road."""
    length, width = max(t.vehicle.length for t in tracks), max(t.vehicle.width for t in tracks)
    through: list[tuple[Floats, float]] = []
    for entry in road.entries:
        for leave in road.exits:
            ahead, aside = relative(entry, leave[:2])
            straight = abs(wrap_angle(np.asarray(leave[2] - entry[2]))) < _PARALLEL
            if straight and ahead > 2.0 * length and abs(aside) < _COLLINEAR:
                line = Curve(np.array([entry, [*leave[:2], entry[2]]])).cut(length / 2.0 + 0.5, ahead - length / 2.0 - 0.5)
                if footprint_fits(road, line.points, length, width).all():
                    through.append((entry, ahead))
    axes: list[_Axis] = []
    for entry, size in through:
        if any(_belongs(entry, axis) for axis in axes):
            continue
        yaw = float(entry[2])
        normal = np.array([-np.sin(yaw), np.cos(yaw)])
        ahead_lanes, against = [], []
        for other, _ in through:
            turned = abs(float(wrap_angle(np.asarray(other[2] - yaw))))
            offset = float((other[:2] - entry[:2]) @ normal)
            if turned < _PARALLEL:
                ahead_lanes.append(offset)
            elif turned > np.pi - _PARALLEL:
                against.append(offset)
        end = entry + size * np.array([np.cos(yaw), np.sin(yaw), 0.0])
        axes.append(_Axis(Curve(np.stack((entry, end))), frozen(sorted(ahead_lanes, reverse=True)), frozen(sorted(against))))
    return axes


def _belongs(entry: Floats, axis: _Axis) -> bool:
    turned = abs(float(wrap_angle(np.asarray(entry[2] - axis.line.points[0, 2]))))
    return bool(turned < _PARALLEL or turned > np.pi - _PARALLEL)


def _bent_axes(road: Road, main: MainLine) -> list[_Axis]:
    """Ways between two arms of the road that bend as the template's main line does (for a straight one: by up to 25°)."""
    axes = []
    arms = arms_of(road)
    for a in arms:
        for b in arms:
            entry, leave = reverse(a.pose), b.pose
            if a is b or (main.straight and abs(wrap_angle(np.asarray(leave[2] - entry[2]))) < _PARALLEL):
                continue
            line = line_between(main.shape, entry, leave)
            if line is not None:
                ahead = [-k for k in a.inward if np.abs(b.outward - -k).min(initial=np.inf) < _COLLINEAR]
                against = [k for k in b.inward if np.abs(-a.outward - k).min(initial=np.inf) < _COLLINEAR]
                axes.append(_Axis(line[0], frozen(sorted(ahead, reverse=True)), frozen(sorted(against)), line[1]))
    return axes


def _placed_track(track: Track, i: int, frenet: FrenetTracks, axis: _Axis, along: Floats) -> Track:
    """One vehicle in its lane, given where along the axis it is at each sample."""
    sign = int(frenet.direction[i])
    lanes = axis.ahead if sign > 0 else axis.against
    start, end = float(lanes[frenet.lane[i, 0]]), float(lanes[frenet.lane[i, 1]])
    driven = sign * (along - along[0])
    s = np.arange(0.0, max(driven[-1], 1.0) + 1.0, 0.5)
    aside = start + (end - start) * _blend(driven, frenet.change[i], s, abs(end - start))
    curve = Curve.through(axis.line.beside(along[0] + sign * s, aside)[:, :2])
    progress = np.zeros_like(along) if track.still else np.interp(driven, s, curve.station)
    return replace(track, curve=curve, progress=frozen(progress))


def _blend(driven: Floats, change: Floats, s: Floats, width: float) -> Floats:
    """A smooth change of lanes, 0 to 1 along `s`, where the template makes it (between 10 and 90 % done)."""
    if change[-1] <= 0.0:
        return np.zeros_like(s)
    first, last = (float(driven[np.argmax(change >= level)]) for level in (0.1, 0.9))
    reach = max((last - first) / 0.5, np.sqrt(width * 5.7735 / _SHIFT_CURVATURE), 1.0)
    middle = np.clip((first + last) / 2.0, min(reach / 2.0, s[-1] / 2.0), max(s[-1] - reach / 2.0, s[-1] / 2.0))
    x = np.clip((s - middle) / min(reach, s[-1]) + 0.5, 0.0, 1.0)
    return np.asarray(x**3 * (10.0 - 15.0 * x + 6.0 * np.square(x)))
