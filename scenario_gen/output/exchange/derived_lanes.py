# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Lanes for export: the lanes of the road, and lanes derived from driven paths."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from shapely import contains_xy, covers, make_valid, Polygon, polygons, prepare, union_all
from shapely.geometry.base import BaseGeometry

from scenario_gen.numerics import Floats, frozen
from scenario_gen.numerics.boxes import corners
from scenario_gen.numerics.curve import Curve
from scenario_gen.output.exchange.lanes import LaneMap, with_run_out
from scenario_gen.roads import drivable_width, lane_along, sharing_lanes
from scenario_gen.types import Lane, LaneNetwork, Road, Scenario, together

LANE_POINT_SPACING_M = 1.0
MIN_PATH_POINT_SPACING_M = 0.5  # of the driven path that a lane follows
FOOTPRINT_MARGIN_M = 0.1  # between a footprint and the lane boundary
MIN_EXTENSION_M = 0.5  # of a lane beyond its first and last footprint
MAX_LANE_HEADING_ERROR_RAD = 0.6  # of a vehicle that follows a lane
SEAM_M = 0.1  # half of the largest gap between adjacent lanes of a map
MAX_UNGUIDED_M = 5.0  # of a path against the direction of all lanes, as in a cut corner
WIDENING_POINTS = 3  # neighbours on both sides over which a lane has its largest width


def lane_map_of(
    road: Road | None, scenarios: Sequence[Scenario], lane_width: float, run_out: float
) -> LaneMap:
    """Return the lanes of a road, and derived lanes for vehicles that leave them.

    A vehicle leaves the lanes if a footprint does in any scenario, or if no lane has the direction
    of its path, as when it turns off the road across other lanes. A road without lanes has derived
    lanes only.

    Args:
        road: the road in the bag; None if it has none.
        scenarios: all scenarios of the case.
        lane_width: width [m] of derived lanes.
        run_out: straight extension of lanes [m]; lanes of a vector map are not extended.
    """
    if road is None or road.lanes is None:
        return derived_lanes(scenarios, road, lane_width, run_out)
    drawn = road.lanes.drawn
    network = with_run_out(road.lanes.whole, run_out) if drawn else road.lanes.whole
    missing = _paths_off_lanes(network, scenarios)
    added = [
        _lane(f"along vehicle {name}", path, {name}, scenarios, road, lane_width, 0.0)
        for name, path in missing.items()
    ]
    origin = f"the true lanes of {network.name}" if drawn else f"the lanes of map {network.name}"
    if missing:
        origin += (
            f", and a derived one along the path of vehicle {', '.join(missing)}, which does not "
            "keep to them"
        )
    return LaneMap(replace(network, lanes=(*network.lanes, *added)), len(added), origin)


def derived_lanes(
    scenarios: Sequence[Scenario], road: Road | None, lane_width: float, run_out: float
) -> LaneMap:
    """Return one lane along each driven path, extended straight at both ends; none for walkers.

    Args:
        scenarios: scenarios from one template on one road; the lanes contain all footprints.
        road: the road whose cells limit the width of lanes; None if it is unknown.
        lane_width: width [m] where the road is wide enough.
        run_out: extension [m] of a lane beyond the first and the last footprint.
    """
    paths: dict[str, Curve] = {}
    for scenario in scenarios:
        drive = any(not vehicle.kind.walks for vehicle in scenario.vehicles)
        for n, vehicle in enumerate(scenario.vehicles):
            if not (drive and vehicle.kind.walks):  # who walks needs no lane
                paths.setdefault(vehicle.id, driven_path(scenario, n))
    derived = [
        _lane(
            f"along vehicle {name}",
            paths[name],
            set(members),
            scenarios,
            road,
            lane_width,
            run_out,
        )
        for name, members in sharing_lanes(paths).items()
    ]
    known = road is not None and road.lanes is not None
    why = (
        "--map writes those of the road's map"
        if known
        else "the road itself is a grid without lanes"
    )
    origin = f"derived: one lane along each path that the scenarios drive; {why}"
    obstacles = road.obstacles if road is not None else ()
    network = LaneNetwork("derived", tuple(derived), obstacles=obstacles)
    return LaneMap(network, len(derived), origin)


def area_of(network: LaneNetwork) -> BaseGeometry:
    """Return the union of all lanes."""
    return union_all(make_valid(_outlines(network)))


def _outlines(network: LaneNetwork) -> list[Polygon]:
    return [Polygon(lane.outline) for lane in network.lanes]


def _paths_off_lanes(network: LaneNetwork, scenarios: Sequence[Scenario]) -> dict[str, Curve]:
    """Return the paths, by id, of vehicles that leave the lanes or drive across them."""
    area = area_of(network).buffer(SEAM_M, join_style="mitre").buffer(-SEAM_M, join_style="mitre")
    prepare(area)
    outlines = _outlines(network)
    missing: dict[str, Curve] = {}
    for scenario in scenarios:
        for n, vehicle in enumerate(scenario.vehicles):
            if vehicle.id in missing or vehicle.kind.walks:
                continue
            path = driven_path(scenario, n)
            is_inside = covers(area, polygons(footprints(scenario, n))).all()
            if not is_inside or _unguided_length(path, network, outlines) > MAX_UNGUIDED_M:
                missing[vehicle.id] = path
    return missing


def _unguided_length(path: Curve, network: LaneNetwork, outlines: Sequence[Polygon]) -> float:
    """Return the length [m] of a path on which no lane has nearly its direction."""
    guided = np.zeros(len(path.points), dtype=np.bool_)
    for lane, outline in zip(network.lanes, outlines, strict=True):
        inside = np.flatnonzero(~guided & contains_xy(outline, path.points[:, :2]))
        if len(inside):
            middle = Curve.through(lane.centre)
            yaw = middle.at(middle.project(path.points[inside, :2])[0])[:, 2]
            error = path.points[inside, 2] - yaw
            guided[inside] |= np.cos(error) > np.cos(MAX_LANE_HEADING_ERROR_RAD)
    return float(np.diff(path.station)[~guided[1:]].sum())


def footprints(scenario: Scenario, n: int) -> Floats:
    """Return the corners (T, 4, 2) [m] of a vehicle's footprint while it is present."""
    vehicle = scenario.vehicles[n]
    present = together(scenario.present, n, n)
    poses = np.column_stack((scenario.position[n, present], scenario.heading[n, present]))
    return corners(poses, vehicle.length, vehicle.width)


def driven_path(scenario: Scenario, n: int) -> Curve:
    """Return the path of a vehicle; for a stationary vehicle, one metre straight ahead of it."""
    first, last = scenario.present[n].tolist()
    xy = scenario.position[n, first : last + 1]
    kept = [xy[0]]
    for point in xy[1:]:
        if float(np.hypot(*(point - kept[-1]))) >= MIN_PATH_POINT_SPACING_M:
            kept.append(point)
    if len(kept) < 3:
        (x, y), yaw = xy[0].tolist(), float(scenario.heading[n, first])
        ahead = np.array([0.0, 1.0])
        return Curve(
            np.column_stack((x + ahead * np.cos(yaw), y + ahead * np.sin(yaw), np.full(2, yaw)))
        )
    return Curve.through(np.array(kept))


def _lane(
    name: str,
    path: Curve,
    members: set[str],
    scenarios: Sequence[Scenario],
    road: Road | None,
    lane_width: float,
    run_out: float,
) -> Lane:
    """Return a lane that contains every footprint of its members.

    Both boundaries have the same distance from the path, so that the lane centre, which planners
    follow, is as smooth as the path.
    """
    corners = np.concatenate(
        [outline(scenario, n) for scenario in scenarios for n in _rows(scenario, members)]
    )
    station, offset = path.project(corners)
    more = max(run_out, MIN_EXTENSION_M)
    reference = path.cut(
        float(station.min()) - more, float(station.max()) + more, LANE_POINT_SPACING_M
    )
    room = np.minimum(
        *(_room(reference, sign, road, lane_width / 2.0, more) for sign in (1.0, -1.0))
    )
    half = np.maximum(
        room,
        _widest_near(
            reference, station - station.min() + more, np.abs(offset) + FOOTPRINT_MARGIN_M
        ),
    )
    return lane_along(name, reference, half)


def _widest_near(line: Curve, station: Floats, wide: Floats) -> Floats:
    """Return the largest of the distances `wide` [m] near each of the M points of a line.

    A distance is near a point if its station lies within `WIDENING_POINTS` points of it.
    """
    widest = np.zeros(len(line.points))
    at = np.clip(np.searchsorted(line.station, station), 1, len(line.points) - 1)
    np.maximum.at(widest, at, wide)
    np.maximum.at(widest, at - 1, wide)
    padded = np.pad(widest, WIDENING_POINTS)
    shifts = range(2 * WIDENING_POINTS + 1)
    return frozen(np.max([padded[k : k + len(widest)] for k in shifts], axis=0))


def _rows(scenario: Scenario, members: set[str]) -> list[int]:
    return [n for n, vehicle in enumerate(scenario.vehicles) if vehicle.id in members]


def outline(scenario: Scenario, n: int) -> Floats:
    """Return the corners and side centres (P, 2) [m] of a vehicle's footprint at all instants."""
    around = footprints(scenario, n)
    return np.concatenate([around, 0.5 * (around[:, [1, 3]] + around[:, [0, 2]])], axis=1).reshape(
        -1, 2
    )


def _room(reference: Curve, sign: float, road: Road | None, most: float, run_out: float) -> Floats:
    """Return the drivable width [m] at one side of each point, at most `most`; shape (M,).

    The run-outs have the width `most`.
    """
    if road is None:
        return np.full(len(reference.points), most)
    on_run_out = (reference.station < run_out) | (reference.station > reference.length - run_out)
    return np.where(
        on_run_out,
        most,
        drivable_width(road.drivable_at, reference, sign, most, road.resolution / 2.0),
    )
