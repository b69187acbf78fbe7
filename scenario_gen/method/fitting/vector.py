# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Placing a template on the lanes of a vector map: each vehicle along a chain of lanes, in their direction."""

import math

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.fitting.config import FittingConfig
from scenario_gen.method.fitting.kept import keeps_conflicts
from scenario_gen.method.fitting.placement import max_repair, Placement, SCALES, separated
from scenario_gen.roads import Course, placements, tracks_on
from scenario_gen.template import Track
from scenario_gen.types import LaneNetwork, Road

_TRIED, _MORE = 12, 40  # placements that are looked at cell by cell; of those that lose a conflict, more


def place_on_lanes(tracks: tuple[Track, ...], road: Road, config: FittingConfig) -> Placement:
    """Lay a template on a road's lanes at the best place where all have room and meet as in the template.

    Where no place keeps every conflict, the best of those that lose one.

    Raises:
        RefusedError: there is none; says why not.
    """
    network = road.map_lanes
    if network is None:
        raise RefusedError(f"road {road.name} has no lanes")
    reason, fallback = "", None
    scales = list(filter(config.accepts, SCALES))
    for tried, (match, scale) in enumerate(placements(network, tracks, scales=scales)):
        if tried >= (_TRIED if fallback is None else _MORE):
            break
        notes = [*network.notes, *(_note(c, t, network) for c, t in zip(match.courses, tracks, strict=True))]
        if scale != 1.0:
            notes.append(f"scaled by {scale:g} to fit the lanes")
        placement = Placement.of(tracks_on(match, tracks, scale), scale, notes, map(_manoeuvre, match.courses))
        try:
            placement = separated(placement, config, sideways=0.0)
            max_repair(placement.tracks, road, config.max_move)
        except RefusedError as error:
            reason = reason or str(error)
            continue
        if keeps_conflicts(tracks, placement.tracks):
            return placement
        fallback = fallback or placement
    if fallback is not None:
        return fallback
    raise RefusedError(f"the template does not fit the lanes of road {road.name}: {reason}")


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
