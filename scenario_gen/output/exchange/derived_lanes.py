# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Lanes of a road that has none: along what the scenarios drive, as wide as a lane where the grid leaves room."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from shapely import contains_xy, covers, make_valid, Polygon, polygons, prepare, union_all

from scenario_gen.numerics import Floats, frozen
from scenario_gen.numerics.boxes import corners
from scenario_gen.numerics.curve import Curve
from scenario_gen.output.exchange.lanes import Lane, LaneMap, lanes_of, network_lanes, Strip
from scenario_gen.types import LaneNetwork, Road, Scenario, together

STEP = 1.0  # metres between points of a lane
APART = 0.5  # metres between points of a path that it is laid through
MARGIN = 0.1  # metres between a footprint and its lane's edge
AROUND = 0.5  # metres by which a lane goes on beyond its footprints at least
ACROSS = 0.6  # rad by which a vehicle in a lane may be turned in it
CUT = 5.0  # metres of a path that may lie across all lanes, as where a corner is cut
SAME_LANE, SAME_WAY = 1.0, 0.35  # metres and rad within which a path lies in another one's lane
NEAR = 3  # points of a lane on both sides over which it keeps its widest


def derived_lanes(scenarios: Sequence[Scenario], road: Road | None, lane_width: float, run_out: float) -> LaneMap:
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
    lanes: list[tuple[str, Curve]] = []
    homes: dict[str, int] = {}
    for name in sorted(paths, key=lambda name_of_path: (-paths[name_of_path].length, name_of_path)):
        home = next((k for k, (_, lane) in enumerate(lanes) if _runs_in(paths[name], lane)), None)
        if home is None:
            home = len(lanes)
            lanes.append((name, paths[name]))
        homes[name] = home
    strips = []
    for k, (name, path) in enumerate(lanes):
        members = {member for member, home in homes.items() if home == k}
        strips.append(_lane(f"along vehicle {name}", path, members, scenarios, road, lane_width, run_out))
    origin = "derived: one lane along each path that the scenarios drive; the road itself is a grid without lanes"
    return LaneMap(tuple(strips), (), "right", origin, derived=True)


def with_all_vehicles(lane_map: LaneMap, scenarios: Sequence[Scenario], road: Road, lane_width: float) -> LaneMap:
    """Return a map with a derived lane added along the path of every vehicle that the lanes do not suffice for.

    They do not where a footprint leaves them in some scenario, or where no lane has the vehicle's direction, as of one that turns
    off the road across the others' lanes.
    """
    missing = _not_kept(lanes_of(lane_map), scenarios)
    if not missing:
        return lane_map
    strips = [_lane(f"along vehicle {name}", path, {name}, scenarios, road, lane_width, 0.0) for name, path in missing.items()]
    if lane_map.side == "left":
        strips = [replace(s, offset=s.offset - s.right[0], left=s.right, right=s.left) for s in strips]
    origin = f"{lane_map.origin}, and a derived one along the path of vehicle {', '.join(missing)}, which does not keep to them"
    return replace(lane_map, strips=(*lane_map.strips, *strips), added=len(strips), origin=origin)


def with_network(
    lane_map: LaneMap, network: LaneNetwork, scenarios: Sequence[Scenario], road: Road, lane_width: float
) -> LaneMap:
    """Return derived lanes with the lanes of a vector map beside them, and a derived one for who does not keep to those."""
    own = network_lanes(network)
    missing = _not_kept(own, scenarios)
    strips = [_lane(f"along vehicle {name}", path, {name}, scenarios, road, lane_width, 0.0) for name, path in missing.items()]
    added = lanes_of(replace(lane_map, strips=tuple(strips))) if strips else ()
    lanes = (*own, *(replace(lane, id=len(own) + lane.id) for lane in added))
    origin = f"the lanes of map {network.name}"
    if missing:
        origin += f", and a derived one along the path of vehicle {', '.join(missing)}, which does not keep to them"
    return replace(lane_map, network=lanes, network_origin=origin, vector=network)


def _not_kept(lanes: Sequence[Lane], scenarios: Sequence[Scenario]) -> dict[str, Curve]:
    """Return the paths, by id, of vehicles that leave the lanes or drive across them."""
    area = union_all(make_valid([Polygon(np.concatenate([lane.left, lane.right[::-1]])) for lane in lanes]))
    prepare(area)
    missing: dict[str, Curve] = {}
    for scenario in scenarios:
        for n, vehicle in enumerate(scenario.vehicles):
            if vehicle.id not in missing:
                path = driven_path(scenario, n)
                if not covers(area, polygons(footprints(scenario, n))).all() or _unled(path, lanes) > CUT:
                    missing[vehicle.id] = path
    return missing


def _unled(path: Curve, lanes: Sequence[Lane]) -> float:
    """Return the metres of a path on which no lane has nearly its direction."""
    led = np.zeros(len(path.points), dtype=np.bool_)
    for lane in lanes:
        inside = np.flatnonzero(~led & contains_xy(Polygon(np.concatenate([lane.left, lane.right[::-1]])), path.points[:, :2]))
        if len(inside):
            middle = Curve.through(lane.middle)
            yaw = middle.at(middle.project(path.points[inside, :2])[0])[:, 2]
            led[inside] |= np.cos(path.points[inside, 2] - yaw) > np.cos(ACROSS)
    return float(np.diff(path.station)[~led[1:]].sum())


def footprints(scenario: Scenario, n: int) -> Floats:
    """Return the corners (T, 4, 2) [m] of a vehicle's footprint at every instant at which it is there."""
    there, vehicle = together(scenario.present, n, n), scenario.vehicles[n]
    return corners(np.column_stack((scenario.position[n, there], scenario.heading[n, there])), vehicle.length, vehicle.width)


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
        return Curve(np.column_stack((x + ahead * np.cos(yaw), y + ahead * np.sin(yaw), np.full(2, yaw))))
    return Curve.through(np.array(kept))


def _runs_in(path: Curve, lane: Curve) -> bool:
    """Say whether a path lies in the lane along another one, in the same direction."""
    station, offset = lane.project(path.points[:, :2])
    turn = path.points[:, 2] - lane.at(station)[:, 2]
    return bool((np.abs(offset) < SAME_LANE).all() and (np.cos(turn) > np.cos(SAME_WAY)).all())


def _lane(
    name: str, path: Curve, members: set[str], scenarios: Sequence[Scenario], road: Road | None, lane_width: float, run_out: float
) -> Strip:
    """Return the strip of one lane, which holds every footprint of its members.

    Its edges lie as far from the path on both sides, so that the lane's middle, which planners follow, is as smooth as the path.
    """
    corners = np.concatenate([outline(scenario, n) for scenario in scenarios for n in _rows(scenario, members)])
    station, offset = path.project(corners)
    more = max(run_out, AROUND)
    reference = path.cut(float(station.min()) - more, float(station.max()) + more, STEP)
    room = np.minimum(*(_room(reference, sign, road, lane_width / 2.0, more) for sign in (1.0, -1.0)))
    half = np.maximum(room, widest_near(reference, station - station.min() + more, np.abs(offset) + MARGIN))
    return Strip(name, reference.points, half, 2.0 * half[None], np.zeros((0, len(half))))


def widest_near(line: Curve, station: Floats, wide: Floats) -> Floats:
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
    return np.concatenate([around, 0.5 * (around[:, [1, 3]] + around[:, [0, 2]])], axis=1).reshape(-1, 2)


def _room(reference: Curve, sign: float, road: Road | None, most: float, run_out: float) -> Floats:
    """Return (M,) how far [m] the road is drivable to one side of each point, at most `most`; the run-outs are as wide."""
    wide = np.full(len(reference.points), most)
    if road is None:
        return wide
    distance = np.arange(0.0, most, road.resolution / 2.0)
    station = np.repeat(reference.station[:, None], len(distance), axis=1)
    poses = reference.beside(station, sign * distance[None, :])
    drivable = road.drivable_at(poses[..., :2])
    free = np.logical_and.accumulate(drivable, axis=1).sum(axis=1) * road.resolution / 2.0
    on_run_out = (reference.station < run_out) | (reference.station > reference.length - run_out)
    return np.where(on_run_out, most, np.minimum(free, most))
