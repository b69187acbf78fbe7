# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Placing a template on the lanes of a road: each vehicle along a chain of lanes, in their direction."""

from dataclasses import replace
import math

import numpy as np
from scipy.spatial.distance import cdist

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.fitting.config import FittingConfig
from scenario_gen.method.fitting.kept import find_losses, find_unused, refused_losses
from scenario_gen.method.fitting.placement import (
    check_scale,
    max_repair,
    Placement,
    SCALES,
    separated,
)
from scenario_gen.numerics import frozen
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.plane import ahead_and_left, place
from scenario_gen.roads import Course, placements, tracks_on, users_of, ways_through
from scenario_gen.situation import (
    describe_turn,
    drivers_of,
    MAX_TURN_CHANGE_RAD,
    to_frenet,
    Track,
    turn_of,
)
from scenario_gen.types import (
    LaneNetwork,
    lanes_for,
    Note,
    NoteKind,
    Road,
)

_END_ROOM = 1.0  # metres kept between a footprint and the end of the road
_ROUNDING = 1e-3  # metres that a shortened template is shorter than it might be: which side it rounds to depends on the CPU
_ASTRAY = 0.3  # metres that a footprint may be from room on the best place
_TRIED, _MORE = (
    12,
    40,
)  # placements that are looked at cell by cell; where something is lost on all of these, more


def place_on_lanes(tracks: tuple[Track, ...], road: Road, config: FittingConfig) -> Placement:
    """Lay a template on a road's lanes at the best place where all have room: where nothing of its encounter is lost, or least.

    One that is longer than a drawn road is scaled. Who walks stays beside the driver that comes nearest.

    Raises:
        RefusedError: there is none; the message says what stands against the attempt that came farthest.
    """
    drivers = drivers_of(tracks)
    network = lanes_for(_lanes_of(road), users_of(drivers))
    own = tracks if network.drawn else ()
    reason, best = "", None
    if drivers[0].vehicle.kind.walks:
        raise RefusedError(
            f"no recorded vehicle drives, so the encounter cannot be laid on the lanes of road {road.name}"
        )
    if network.drawn:
        _refuse_turns(drivers, road)
    shortened = _shortened(drivers, road, config) if network.drawn else 1.0
    laid = drivers if shortened == 1.0 else tuple(_scaled(track, shortened) for track in drivers)
    scales = list(filter(config.accepts, SCALES)) if shortened == 1.0 else [1.0]
    for tried, (match, scale) in enumerate(placements(network, laid, scales=scales)):
        if tried >= (_TRIED if best is None else _MORE):
            break
        notes = [
            *network.notes,
            *(_note(c, t, network) for c, t in zip(match.courses, drivers, strict=True)),
        ]
        if scale * shortened != 1.0:
            notes.append(Note.of(NoteKind.SCALED, scale=scale * shortened))
        placement = Placement.of(
            _with_walkers(tracks, drivers, tracks_on(match, laid)), scale * shortened, notes
        )
        try:
            placement = separated(placement, config, sideways=0.0, own=own)
            astray = max_repair(placement.tracks, road, config.max_move) > _ASTRAY
        except RefusedError as error:
            reason = reason or str(error)
            continue
        lost = find_losses(tracks, placement.tracks)
        lacks = len(refused_losses(lost, config.allow)), astray
        if best is None or lacks < best[0]:
            unused = find_unused(network, (k for course in match.courses for k in course.lanes))
            best = lacks, replace(placement, unused=unused)
        if not any(lacks):
            break
    if best is None:
        raise RefusedError(f"the recording does not fit the lanes of road {road.name}: {reason}")
    return best[1]


def _with_walkers(
    tracks: tuple[Track, ...], drivers: tuple[Track, ...], placed: tuple[Track, ...]
) -> tuple[Track, ...]:
    """All tracks on the road: drivers as they are placed, who walks as before beside the driver that comes nearest."""
    where = dict(zip((track.vehicle.id for track in drivers), placed, strict=True))
    return tuple(
        where.get(track.vehicle.id) or _beside_nearest(track, drivers, placed) for track in tracks
    )


def _beside_nearest(track: Track, drivers: tuple[Track, ...], placed: tuple[Track, ...]) -> Track:
    """The track of who walks, moved as that driver is moved where its path comes nearest."""
    points = track.curve.points
    away = [cdist(points[:, :2], driver.poses[:, :2]) for driver in drivers]
    n = int(np.argmin([float(each.min()) for each in away]))
    k = int(np.argmin(away[n].min(axis=0)))
    before, after = drivers[n].poses[k], placed[n].poses[k]
    moved = place(after, *ahead_and_left(points[:, :2] - before[:2], before[2]))
    return replace(
        track, curve=Curve(np.column_stack((moved, points[:, 2] + after[2] - before[2])))
    )


def _refuse_turns(tracks: tuple[Track, ...], road: Road) -> None:
    """Refuse a template of which a vehicle turns as no way of a drawn road does, or that needs a junction where that has none.

    Raises:
        RefusedError: it does.
    """
    if not any(lane.junction for lane in _lanes_of(road).lanes):
        to_frenet(tracks)
    yaws = [way.points[:, 2] for way in _ways(road)]
    left = max(float((yaw - np.minimum.accumulate(yaw)).max()) for yaw in yaws)
    right = max(float((np.maximum.accumulate(yaw) - yaw).max()) for yaw in yaws)
    for track in tracks:
        if not -right - MAX_TURN_CHANGE_RAD <= turn_of(track) <= left + MAX_TURN_CHANGE_RAD:
            raise RefusedError(
                f"vehicle {track.vehicle.id} {describe_turn(turn_of(track))}: road {road.name} has no lanes for that"
            )


def _shortened(tracks: tuple[Track, ...], road: Road, config: FittingConfig) -> float:
    """The scale at which a template that drives along one road is no longer than the longest way of a drawn road, 1 at most."""
    try:
        low, high = to_frenet(tracks).span(tracks)
    except RefusedError:  # turns or crossings
        return 1.0
    size = max(way.length for way in _ways(road))
    if high - low <= size - 2.0 * _END_ROOM:
        return 1.0
    cars = max(track.vehicle.length for track in tracks)
    scale = (size - 2.0 * _END_ROOM - _ROUNDING - cars) / (high - low - cars)
    check_scale(
        scale,
        f"the recording is {high - low:.0f} m long, road {road.name} {size:.0f} m: it",
        config,
    )
    return scale


def _ways(road: Road) -> list[Curve]:
    """The ways through a drawn road; of one without a junction its lanes."""
    return list(ways_through(road).values()) or [
        Curve.through(lane.centre) for lane in _lanes_of(road).lanes
    ]


def _scaled(track: Track, scale: float) -> Track:
    """A track of which all distances are so many times what they are."""
    points = track.curve.points * np.array([scale, scale, 1.0])
    return replace(track, curve=Curve(points), progress=frozen(track.progress * scale))


def _lanes_of(road: Road) -> LaneNetwork:
    if road.lanes is None:
        raise RefusedError(f"road {road.name} has no lanes; choose another fitting.placement")
    return road.lanes


def _note(course: Course, track: Track, network: LaneNetwork) -> Note:
    """Which lanes a vehicle drives, and how fast against their limit."""
    lanes = ", ".join(network.lanes[k].id for k in course.lanes)
    limit = max((network.lanes[k].speed_limit for k in course.lanes), default=math.nan)
    fastest = float(track.speed.max())
    speed = (
        f"; its {fastest:.1f} m/s exceed their limit of {limit:.1f} m/s"
        if fastest > limit + 0.5
        else ""
    )
    return Note.of(NoteKind.ON_LANES, vehicle=track.vehicle.id, lanes=f"{lanes}{speed}")
