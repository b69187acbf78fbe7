# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Placing a recording on the lanes of a road: each vehicle follows a chain of lanes."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
import math

import numpy as np
from scipy.spatial.distance import cdist

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.fitting.config import FittingConfig
from scenario_gen.method.fitting.losses import find_losses, find_unused, refused_losses
from scenario_gen.method.fitting.placement import (
    check_scale,
    max_repair,
    Placement,
    separated,
    TRIED_SCALES_RATIO,
)
from scenario_gen.numerics import frozen
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.plane import ahead_and_left, place
from scenario_gen.roads import (
    lane_graph,
    LaneGraph,
    LanePath,
    placements,
    tracks_on,
    users_of,
    ways_through,
)
from scenario_gen.situation import (
    describe_turn,
    drivers_of,
    MAX_TURN_CHANGE_RAD,
    to_frenet,
    Track,
    turn_of,
)
from scenario_gen.types import LaneNetwork, Note, NoteKind, Road

_END_ROOM_M = 1.0  # between a footprint and the end of the road
_ROUNDING_M = 1e-3  # by which a shortened recording is shorter, so that no CPU rounds it too long
_MAX_REPAIR_M = 0.3  # of a placement that is used at once
_TRIED_PLACEMENTS_COUNT = 12
_TRIED_WITH_LOSSES_COUNT = 40  # if all placements so far lose something


def place_on_lanes(tracks: tuple[Track, ...], road: Road, config: FittingConfig) -> Placement:
    """Place a recording on a road's lanes at the best place with room for all vehicles.

    The best place loses nothing of the encounter, or least. A recording that is longer than a
    drawn road is scaled. Pedestrians stay next to the driver that comes nearest to them.

    Raises:
        RefusedError: there is no place; the message has the reason of the best attempt.
    """
    drivers = drivers_of(tracks)
    graph = lane_graph(_lanes_of(road), users_of(drivers))
    if drivers[0].vehicle.kind.walks:
        raise RefusedError(
            "no recorded vehicle drives, so the encounter cannot be placed on the lanes of road "
            f"{road.name}"
        )
    reason, fewest_losses, best = "", math.inf, None
    for tried, placed in enumerate(_placements(tracks, drivers, road, graph, config)):
        if tried >= (_TRIED_PLACEMENTS_COUNT if best is None else _TRIED_WITH_LOSSES_COUNT):
            break
        try:
            placement = separated(
                placed, config, sideways=0.0, recorded=tracks if graph.network.drawn else ()
            )
            repair = max_repair(placement.tracks, road, config.max_move)
        except RefusedError as error:
            reason = reason or str(error)
            continue
        losses = refused_losses(find_losses(tracks, placement.tracks), config.allow)
        rank = len(losses) + 0.5 * (repair > _MAX_REPAIR_M)
        if rank < fewest_losses:
            fewest_losses, best = rank, placement
        if rank == 0.0:
            break
    if best is None:
        raise RefusedError(f"the recording does not fit the lanes of road {road.name}: {reason}")
    return best


@dataclass(frozen=True)
class _Scale:
    """The scale s of eq 9 of a recording that is shortened to a drawn road, and further scales."""

    shortened: float
    tried: tuple[float, ...]

    @classmethod
    def of(cls, drivers: tuple[Track, ...], road: Road, config: FittingConfig) -> "_Scale":
        """Return the scales that are tried."""
        shortened = 1.0
        if _lanes_of(road).drawn:
            _refuse_turns(drivers, road)
            shortened = _shortened(drivers, road, config)
        if shortened != 1.0:
            return cls(shortened, (1.0,))
        return cls(1.0, tuple(filter(config.accepts, TRIED_SCALES_RATIO)))


def _placements(
    tracks: tuple[Track, ...],
    drivers: tuple[Track, ...],
    road: Road,
    graph: LaneGraph,
    config: FittingConfig,
) -> Iterator[Placement]:
    """Yield the placements of all tracks on the lanes, the best first."""
    scale = _Scale.of(drivers, road, config)
    recorded = drivers
    if scale.shortened != 1.0:
        recorded = tuple(_scaled(track, scale.shortened) for track in drivers)
    network = graph.network
    for match, further in placements(graph, recorded, scales=scale.tried):
        total = scale.shortened * further
        notes = [*network.notes]
        notes += [_note(p, t, network) for p, t in zip(match.paths, drivers, strict=True)]
        if total != 1.0:
            notes.append(Note.of(NoteKind.SCALED, scale=total))
        all_tracks = _with_pedestrians(tracks, drivers, tracks_on(match, recorded))
        placement = Placement.of(all_tracks, total, notes)
        used = [k for path in match.paths for k in path.lanes]
        yield replace(placement, unused=find_unused(network, used))


def _with_pedestrians(
    tracks: tuple[Track, ...], drivers: tuple[Track, ...], placed: tuple[Track, ...]
) -> tuple[Track, ...]:
    """Return all tracks on the road: the placed drivers, and pedestrians next to them."""
    placed_of = {track.vehicle.id: track for track in placed}
    return tuple(
        placed_of.get(track.vehicle.id) or _moved_with_nearest(track, drivers, placed)
        for track in tracks
    )


def _moved_with_nearest(
    track: Track, drivers: tuple[Track, ...], placed: tuple[Track, ...]
) -> Track:
    """Return a pedestrian's track, moved like the nearest driver where it comes nearest."""
    points = track.curve.points
    distances = [cdist(points[:, :2], driver.poses[:, :2]) for driver in drivers]
    n = int(np.argmin([float(each.min()) for each in distances]))
    k = int(np.argmin(distances[n].min(axis=0)))
    before, after = drivers[n].poses[k], placed[n].poses[k]
    moved = place(after, *ahead_and_left(points[:, :2] - before[:2], before[2]))
    yaw = points[:, 2] + after[2] - before[2]
    return replace(track, curve=Curve(np.column_stack((moved, yaw))))


def _refuse_turns(tracks: tuple[Track, ...], road: Road) -> None:
    """Refuse turns that no route through a drawn road has.

    Raises:
        RefusedError: a vehicle turns so, or the recording needs a junction and the road has none.
    """
    if not any(lane.junction for lane in _lanes_of(road).lanes):
        to_frenet(tracks)
    yaws = [route.points[:, 2] for route in _routes(road)]
    left = max(float((yaw - np.minimum.accumulate(yaw)).max()) for yaw in yaws)
    right = max(float((np.maximum.accumulate(yaw) - yaw).max()) for yaw in yaws)
    for track in tracks:
        if not -right - MAX_TURN_CHANGE_RAD <= turn_of(track) <= left + MAX_TURN_CHANGE_RAD:
            turns = f"vehicle {track.vehicle.id} {describe_turn(turn_of(track))}"
            raise RefusedError(f"{turns}: road {road.name} has no lanes for that")


def _shortened(tracks: tuple[Track, ...], road: Road, config: FittingConfig) -> float:
    """Return the scale, at most 1, at which a recording along one road fits a drawn road.

    Raises:
        RefusedError: it is out of range.
    """
    try:
        low, high = to_frenet(tracks).span(tracks)
    except RefusedError:  # turns or crossings
        return 1.0
    road_length = max(route.length for route in _routes(road))
    free_length = road_length - 2.0 * _END_ROOM_M
    if high - low <= free_length:
        return 1.0
    longest = max(track.vehicle.length for track in tracks)
    scale = (free_length - _ROUNDING_M - longest) / (high - low - longest)
    subject = f"the recording is {high - low:.0f} m long, road {road.name} {road_length:.0f} m: it"
    check_scale(scale, subject, config)
    return scale


def _routes(road: Road) -> list[Curve]:
    """Return the routes through a drawn road; without a junction these are its lanes."""
    routes = list(ways_through(road).values())
    return routes or [Curve.through(lane.centre) for lane in _lanes_of(road).lanes]


def _scaled(track: Track, scale: float) -> Track:
    """Return a track with all distances multiplied by a scale."""
    points = track.curve.points * np.array([scale, scale, 1.0])
    return replace(track, curve=Curve(points), progress=frozen(track.progress * scale))


def _lanes_of(road: Road) -> LaneNetwork:
    if road.lanes is None:
        raise RefusedError(f"road {road.name} has no lanes; choose another fitting.placement")
    return road.lanes


def _note(path: LanePath, track: Track, network: LaneNetwork) -> Note:
    """Return the note on the lanes of a vehicle, and on a speed above their limit."""
    lanes = ", ".join(network.lanes[k].id for k in path.lanes)
    limit = max((network.lanes[k].speed_limit for k in path.lanes), default=math.nan)
    fastest = float(track.speed.max())
    if fastest > limit + 0.5:
        lanes += f"; its {fastest:.1f} m/s exceed their limit of {limit:.1f} m/s"
    return Note.of(NoteKind.ON_LANES, vehicle=track.vehicle.id, lanes=lanes)
