# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Placing a recording on the lanes of a road: each vehicle follows a chain of lanes."""

from dataclasses import replace
import math

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.fitting.config import FittingConfig
from scenario_gen.method.fitting.losses import find_unused
from scenario_gen.method.fitting.placement import Placement
from scenario_gen.roads import best_place, lane_graph, LanePath, users_of
from scenario_gen.situation import drivers_of, Track
from scenario_gen.types import LaneNetwork, Note, NoteKind, Road


def place_on_lanes(tracks: tuple[Track, ...], road: Road, config: FittingConfig) -> Placement:
    """Place a recording on a road's lanes at the best place with room for all vehicles.

    Raises:
        RefusedError: there is no place; the message has the reason of the best attempt.
    """
    drivers = drivers_of(tracks)
    if road.lanes is None:
        raise RefusedError(f"road {road.name} has no lanes; choose another fitting.placement")
    if drivers[0].vehicle.kind.walks:
        raise RefusedError(
            "no recorded vehicle drives, so the encounter cannot be placed on the lanes of road "
            f"{road.name}"
        )
    network = lane_graph(road.lanes, users_of(drivers)).network
    place = best_place(road, tracks, config.place_limits)
    paths = place.match.paths
    notes = [*network.notes]
    notes += [_note(path, track, network) for path, track in zip(paths, drivers, strict=True)]
    if place.scale != 1.0:
        notes.append(Note.of(NoteKind.SCALED, scale=place.scale))
    placement = Placement.separated(place.separation, place.scale, notes)
    return replace(placement, unused=find_unused(network, [k for p in paths for k in p.lanes]))


def _note(path: LanePath, track: Track, network: LaneNetwork) -> Note:
    """Return the note on the lanes of a vehicle, and on a speed above their limit."""
    lanes = ", ".join(network.lanes[k].id for k in path.lanes)
    limit = max((network.lanes[k].speed_limit for k in path.lanes), default=math.nan)
    fastest = float(track.speed.max())
    if fastest > limit + 0.5:
        lanes += f"; its {fastest:.1f} m/s exceed their limit of {limit:.1f} m/s"
    return Note.of(NoteKind.ON_LANES, vehicle=track.vehicle.id, lanes=lanes)
