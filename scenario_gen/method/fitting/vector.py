# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Placing a template on the lanes of a road: each vehicle along a chain of lanes, in their direction."""

from dataclasses import replace
from itertools import combinations
import math

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.fitting.config import FittingConfig
from scenario_gen.method.fitting.kept import find_unused, keeps_conflicts, refuse_lost_turns
from scenario_gen.method.fitting.placement import check_scale, max_repair, Placement, SCALES, separated
from scenario_gen.numerics import frozen
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.plane import edge_lengths
from scenario_gen.roads import Course, placements, tracks_on, ways_through
from scenario_gen.template import to_frenet, Track
from scenario_gen.types import LaneNetwork, Road

_END_ROOM = 1.0  # metres kept between a footprint and the end of the road
_APART = 1.0  # metres sideways within which two vehicles are in one lane
_TRIED, _MORE = 12, 40  # placements that are looked at cell by cell; of those that lose a conflict, more


def place_along_road(tracks: tuple[Track, ...], road: Road, config: FittingConfig) -> Placement:
    """Lay a template that needs no junction on the lanes of a road that was drawn; one that is too long is scaled.

    Raises:
        RefusedError: it turns or crosses, or the road has no two lanes where it needs them, or as `place_on_lanes`.
    """
    frenet, scale = to_frenet(tracks), 1.0
    low, high = frenet.span(tracks)
    lanes = _lanes_of(road).lanes
    ways = [way.length for way in ways_through(road).values()] or [float(edge_lengths(lane.centre).sum()) for lane in lanes]
    size = max(ways)
    if high - low > size - 2.0 * _END_ROOM:
        cars = max(track.vehicle.length for track in tracks)
        scale = (size - 2.0 * _END_ROOM - cars) / (high - low - cars)
        check_scale(scale, f"the template is {high - low:.0f} m long, road {road.name} {size:.0f} m: it", config)
        tracks = tuple(_scaled(track, scale) for track in tracks)
    placement = place_on_lanes(tracks, road, config)
    for (i, one), (j, other) in combinations(enumerate(placement.tracks), 2):
        for end, sample, word in ((0, 0, "start"), (1, -1, "end")):
            _, aside = one.curve.project(other.poses[sample : sample + 1 or None, :2])
            if (
                frenet.direction[i] == frenet.direction[j]
                and frenet.lane[i, end] != frenet.lane[j, end]
                and abs(aside[0]) < _APART
            ):
                ids = f"{one.vehicle.id} and {other.vehicle.id}"
                raise RefusedError(f"vehicles {ids} {word} in two lanes of the template, and road {road.name} has one there")
    notes = placement.notes if scale == 1.0 else (f"scaled by {scale:.3f} to fit the road's length", *placement.notes)
    return replace(placement, scale=placement.scale * scale, notes=notes)


def _scaled(track: Track, scale: float) -> Track:
    """A track of which all distances are so many times what they are."""
    points = track.curve.points * np.array([scale, scale, 1.0])
    return replace(track, curve=Curve(points), progress=frozen(track.progress * scale))


def place_on_lanes(tracks: tuple[Track, ...], road: Road, config: FittingConfig) -> Placement:
    """Lay a template on a road's lanes at the best place where all have room and meet as in the template.

    Where no place keeps every conflict, the best of those that lose one.

    Raises:
        RefusedError: there is none; says why not.
    """
    network = _lanes_of(road)
    own = tracks if network.drawn else ()
    reason, fallback = "", None
    scales = list(filter(config.accepts, SCALES))
    for tried, (match, scale) in enumerate(placements(network, tracks, scales=scales)):
        if tried >= (_TRIED if fallback is None else _MORE):
            break
        notes = [*network.notes, *(_note(c, t, network) for c, t in zip(match.courses, tracks, strict=True))]
        if scale != 1.0:
            notes.append(f"scaled by {scale:g} to fit the lanes")
        placement = Placement.of(tracks_on(match, tracks), scale, notes, map(_manoeuvre, match.courses))
        try:
            if network.drawn:
                refuse_lost_turns(tracks, placement.tracks, road.name)
            placement = separated(placement, config, sideways=0.0, own=own)
            max_repair(placement.tracks, road, config.max_move)
        except RefusedError as error:
            reason = reason or str(error)
            continue
        placement = replace(placement, unused=find_unused(road, (k for course in match.courses for k in course.lanes)))
        if keeps_conflicts(tracks, placement.tracks):
            return placement
        fallback = fallback or placement
    if fallback is not None:
        return fallback
    raise RefusedError(f"the template does not fit the lanes of road {road.name}: {reason}")


def _lanes_of(road: Road) -> LaneNetwork:
    if road.lanes is None:
        raise RefusedError(f"road {road.name} has no lanes; choose another way of placing (fitting.placement)")
    return road.lanes


def _manoeuvre(course: Course) -> str:
    yaw = course.curve.at(np.array([course.start, course.end]))[:, 2]
    turn = float(yaw[1] - yaw[0])
    return "straight" if abs(turn) < math.radians(20.0) else "left" if turn > 0.0 else "right"


def _note(course: Course, track: Track, network: LaneNetwork) -> str:
    """Which lanes a vehicle drives, and how fast against their limit."""
    lanes = ", ".join(network.lanes[k].id for k in course.lanes)
    limit = max((network.lanes[k].speed_limit for k in course.lanes), default=math.nan)
    fastest = float(track.speed.max())
    speed = f"; its {fastest:.1f} m/s are more than their limit of {limit:.1f} m/s" if fastest > limit + 0.5 else ""
    return f"vehicle {track.vehicle.id} drives on lanes {lanes}{speed}"
