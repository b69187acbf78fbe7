# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The lanes that are exported: those of the road, and derived ones along what is driven, as wide as the grid leaves room."""

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

STEP = 1.0  # metres between points of a lane
APART = 0.5  # metres between points of a path that it is laid through
MARGIN = 0.1  # metres between a footprint and its lane's edge
AROUND = 0.5  # metres by which a lane goes on beyond its footprints at least
ACROSS = 0.6  # rad by which a vehicle in a lane may be turned in it
SEAM_M = (
    0.1  # half of what may be open between two lanes of a map that follow or adjoin each other
)
CUT = 5.0  # metres of a path that may lie across all lanes, as where a corner is cut
NEAR = 3  # points of a lane on both sides over which it keeps its widest


def lane_map_of(
    road: Road | None, scenarios: Sequence[Scenario], lane_width: float, run_out: float
) -> LaneMap:
    """Return the lanes of a road, and derived ones for those who do not keep to them; derived ones alone where it has none.

    A vehicle does not where a footprint leaves them in some scenario, or where no lane has its direction, as of one that turns
    off the road across the others' lanes.

    Args:
        road: as the bag has it; None if it has none.
        scenarios: all of the case.
        lane_width: metres, of lanes that are derived.
        run_out: metres by which lanes are continued straight on; those of a vector map are not.
    """
    if road is None or road.lanes is None:
        return derived_lanes(scenarios, road, lane_width, run_out)
    drawn = road.lanes.drawn
    network = with_run_out(road.lanes.whole, run_out) if drawn else road.lanes.whole
    missing = _not_kept(network, scenarios)
    added = [
        _lane(f"along vehicle {name}", path, {name}, scenarios, road, lane_width, 0.0)
        for name, path in missing.items()
    ]
    origin = f"the true lanes of {network.name}" if drawn else f"the lanes of map {network.name}"
    if missing:
        origin += f", and a derived one along the path of vehicle {', '.join(missing)}, which does not keep to them"
    return LaneMap(replace(network, lanes=(*network.lanes, *added)), len(added), origin)


def derived_lanes(
    scenarios: Sequence[Scenario], road: Road | None, lane_width: float, run_out: float
) -> LaneMap:
    """Return one lane along each path that is driven, continued straight on at both ends.

    Args:
        scenarios: of one template on one road, with the same vehicles or fewer; all footprints lie in the lanes.
        road: whose cells limit a lane's width; None: nothing is known of it.
        lane_width: metres, where the road is wide enough.
        run_out: metres by which a lane goes on beyond the first and the last footprint.
    """
    paths: dict[str, Curve] = {}
    for scenario in scenarios:
        for n, vehicle in enumerate(scenario.vehicles):
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
    return LaneMap(LaneNetwork("derived", tuple(derived)), len(derived), origin)


def area_of(network: LaneNetwork) -> BaseGeometry:
    """Return all that lies in lanes."""
    return union_all(make_valid(_outlines(network)))


def _outlines(network: LaneNetwork) -> list[Polygon]:
    return [Polygon(lane.outline) for lane in network.lanes]


def _not_kept(network: LaneNetwork, scenarios: Sequence[Scenario]) -> dict[str, Curve]:
    """Return the paths, by id, of vehicles that leave the lanes or drive across them."""
    area = area_of(network).buffer(SEAM_M, join_style="mitre").buffer(-SEAM_M, join_style="mitre")
    prepare(area)
    outlines = _outlines(network)
    missing: dict[str, Curve] = {}
    for scenario in scenarios:
        for n, vehicle in enumerate(scenario.vehicles):
            if vehicle.id not in missing:
                path = driven_path(scenario, n)
                if (
                    not covers(area, polygons(footprints(scenario, n))).all()
                    or _unled(path, network, outlines) > CUT
                ):
                    missing[vehicle.id] = path
    return missing


def _unled(path: Curve, network: LaneNetwork, outlines: Sequence[Polygon]) -> float:
    """Return the metres of a path on which no lane, of these outlines, has nearly its direction."""
    led = np.zeros(len(path.points), dtype=np.bool_)
    for lane, outline in zip(network.lanes, outlines, strict=True):
        inside = np.flatnonzero(~led & contains_xy(outline, path.points[:, :2]))
        if len(inside):
            middle = Curve.through(lane.centre)
            yaw = middle.at(middle.project(path.points[inside, :2])[0])[:, 2]
            led[inside] |= np.cos(path.points[inside, 2] - yaw) > np.cos(ACROSS)
    return float(np.diff(path.station)[~led[1:]].sum())


def footprints(scenario: Scenario, n: int) -> Floats:
    """Return the corners (T, 4, 2) [m] of a vehicle's footprint at every instant at which it is there."""
    there, vehicle = together(scenario.present, n, n), scenario.vehicles[n]
    return corners(
        np.column_stack((scenario.position[n, there], scenario.heading[n, there])),
        vehicle.length,
        vehicle.width,
    )


def driven_path(scenario: Scenario, n: int) -> Curve:
    """Return the path of a vehicle, points `STEP` apart; of one that stands throughout, a metre ahead of it."""
    first, last = scenario.present[n].tolist()
    xy = scenario.position[n, first : last + 1]
    kept = [xy[0]]
    for point in xy[1:]:
        if float(np.hypot(*(point - kept[-1]))) >= APART:
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
    """Return a lane that holds every footprint of its members.

    Its edges lie as far from the path on both sides, so that the lane's middle, which planners follow, is as smooth as the path.
    """
    corners = np.concatenate(
        [outline(scenario, n) for scenario in scenarios for n in _rows(scenario, members)]
    )
    station, offset = path.project(corners)
    more = max(run_out, AROUND)
    reference = path.cut(float(station.min()) - more, float(station.max()) + more, STEP)
    room = np.minimum(
        *(_room(reference, sign, road, lane_width / 2.0, more) for sign in (1.0, -1.0))
    )
    half = np.maximum(
        room, _widest_near(reference, station - station.min() + more, np.abs(offset) + MARGIN)
    )
    return lane_along(name, reference, half)


def _widest_near(line: Curve, station: Floats, wide: Floats) -> Floats:
    """Return (M,) for each point of a line the largest of distances (P,) [m] at stations (P,) [m] within `NEAR` points of it."""
    widest = np.zeros(len(line.points))
    at = np.clip(np.searchsorted(line.station, station), 1, len(line.points) - 1)
    np.maximum.at(widest, at, wide)
    np.maximum.at(widest, at - 1, wide)
    padded = np.pad(widest, NEAR)
    return frozen(np.max([padded[k : k + len(widest)] for k in range(2 * NEAR + 1)], axis=0))


def _rows(scenario: Scenario, members: set[str]) -> list[int]:
    return [n for n, vehicle in enumerate(scenario.vehicles) if vehicle.id in members]


def outline(scenario: Scenario, n: int) -> Floats:
    """Return points (P, 2) [m] of the outline of a vehicle's footprint at every instant: corners and middles of sides."""
    around = footprints(scenario, n)
    return np.concatenate([around, 0.5 * (around[:, [1, 3]] + around[:, [0, 2]])], axis=1).reshape(
        -1, 2
    )


def _room(reference: Curve, sign: float, road: Road | None, most: float, run_out: float) -> Floats:
    """Return (M,) how far [m] the road is drivable to one side of each point, at most `most`; the run-outs are as wide."""
    if road is None:
        return np.full(len(reference.points), most)
    on_run_out = (reference.station < run_out) | (reference.station > reference.length - run_out)
    return np.where(
        on_run_out,
        most,
        drivable_width(road.drivable_at, reference, sign, most, road.resolution / 2.0),
    )
