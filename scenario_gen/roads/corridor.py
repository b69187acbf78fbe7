# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The corridor: the area that recorded vehicles sweep, in the recording's frame."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from shapely.geometry.base import BaseGeometry

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.numerics import Floats
from scenario_gen.numerics.curve import Curve
from scenario_gen.roads.along import lane_along, sharing_lanes
from scenario_gen.roads.config import RoadConfig
from scenario_gen.roads.drawn import crossing_lane, draw_lanes, middle_stations
from scenario_gen.roads.lights import recorded_rules
from scenario_gen.roads.pavement import drivable_width, paved, swept
from scenario_gen.situation import Situation
from scenario_gen.types import Encounter, Lane, LaneNetwork, Road, trailer_poses, Vehicle

_FOOTPRINT_STEP_M = 0.25


def draw_corridor(name: str, encounter: Encounter | None, config: RoadConfig) -> Road:
    """Draw the corridor of the recorded paths, in the recording's frame.

    The path of every moving vehicle is cleaned, separated from the others, and continued straight
    on by `corridor_run_out` at both ends, where its lane begins and ends. Vehicles in one lane
    share it. A vehicle that stands throughout gets room for its footprint and the margin.

    Raises:
        InputError: there is no recording.
        RefusedError: its vehicles overlap too far to be separated, the grid would be too large, or
            cycle lanes are requested.
    """
    if config.cycle_lane:
        raise RefusedError(f"road {name} has no cycle lanes; unset road.cycle_lane")
    if encounter is None:
        raise InputError(f"road {name} is drawn around a recording; give a log, too")
    surface: list[BaseGeometry] = []
    paths: dict[str, Curve] = {}
    tracks = {track.vehicle.id: track for track in Situation.of(encounter).separation.tracks}
    for name_of_vehicle, track in tracks.items():
        vehicle = track.vehicle
        reach = config.corridor_margin if track.still else config.corridor_run_out
        path = track.curve.cut(-reach, track.travelled + reach, _FOOTPRINT_STEP_M)
        width = vehicle.width + 2.0 * config.corridor_margin
        surface.append(swept(path, vehicle.length, width, vehicle.trailer))
        if not track.still:
            paths[name_of_vehicle] = path
    lanes: list[Lane] = []
    for lane_name, sharing in sharing_lanes(paths).items():
        whole = paths[lane_name]
        ends = np.concatenate([paths[each].points[[0, -1], :2] for each in sharing])
        reached, _ = whole.project(ends)
        line = whole.cut(float(reached.min()), float(reached.max()), 1.0)
        vehicles = [tracks[each].vehicle for each in sharing]
        half = _half_widths(line, vehicles, config.corridor_margin)
        lanes.append(lane_along(f"along vehicle {lane_name}", line, half))
    rules = tuple(recorded_rules(encounter, lanes, config.priority))
    network = LaneNetwork(name, tuple(lanes), rules=rules, drawn=True)
    road = draw_lanes(network, paved(surface, 0.0), config)
    if config.crossing == "none" or road.lanes is None:
        return road

    line = paths[next(iter(sharing_lanes(paths)))]
    stations = middle_stations(line)
    middle = line.cut(*stations, _FOOTPRINT_STEP_M)
    right, left = (
        float(np.median(drivable_width(road.drivable_at, middle, side, 60.0)))
        for side in (-1.0, 1.0)
    )
    crossing = crossing_lane("crossing 1", line, stations, (right, left))
    return replace(road, lanes=road.lanes.with_lanes((*lanes, crossing)))


def _half_widths(line: Curve, vehicles: Sequence[Vehicle], margin: float) -> Floats:
    """Return half the width (M,) [m] that vehicles and their trailers need along a line."""
    width = max(vehicle.width for vehicle in vehicles) + 2.0 * margin
    half = np.full(len(line.points), width / 2.0)
    for trailer in filter(None, (vehicle.trailer for vehicle in vehicles)):
        towed = trailer_poses(line.points, trailer)
        station, offset = line.project(towed[:, :2])
        half += np.interp(line.station, station, np.abs(offset))
    return half
