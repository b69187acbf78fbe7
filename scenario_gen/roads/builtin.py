# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Roads as large as a recording needs: straight arms at right angles, and the corridor."""

from dataclasses import dataclass, replace

import numpy as np
from shapely.geometry.base import BaseGeometry

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.numerics import Floats, wrap_angle
from scenario_gen.numerics.curve import Curve
from scenario_gen.roads.along import lane_along, sharing_lanes
from scenario_gen.roads.config import RoadConfig
from scenario_gen.roads.drawn import crossing_lane, draw_lanes, draw_plan, middle_stations
from scenario_gen.roads.lights import recorded_rules
from scenario_gen.roads.pavement import (
    ARM_COUNT,
    drivable_width,
    END_ROOM_M,
    JUNCTION_SLACK_M,
    LANE_GAP_M,
    MIN_ARM_M,
    paved,
    SIDE_ARM_YAWS_RAD,
    swept,
)
from scenario_gen.roads.plan import aligned, Arm, Connection, Driven, Plan
from scenario_gen.roads.vector.ground import VERGE_M
from scenario_gen.roads.ways import draw_u_turn
from scenario_gen.situation import pair_crossings, Situation, to_frenet, Track
from scenario_gen.types import (
    DrawnFor,
    Encounter,
    Lane,
    LaneNetwork,
    Road,
    Trailer,
    trailer_poses,
)

_DEFAULT_ARM_M = 60.0  # without a recording
_U_TURN_WIDTH_M = 12.0  # between the lanes of a U-turn
_SAME_DIRECTION_RAD = np.radians(25.0)
_MAX_ROAD_WIDTH_M = 12.0  # of vehicles with the same direction,
_MAX_ONCOMING_DISTANCE_M = 20.0  # and of oncoming ones
_MAX_LANES_COUNT = 3  # per direction, to keep oncoming vehicles as far from each other as recorded
_FOOTPRINT_STEP_M = 0.25


@dataclass(frozen=True)
class Layout:
    """The size of a built-in road.

    Attributes:
        main: [m] from the centre to the ends of the main arms.
        side: [m] from the centre to the ends of the side arms.
        lanes: per direction.
        u_turns: whether there is room for U-turns.
    """

    main: float
    side: float
    lanes: int
    u_turns: bool = False


def draw_layout(
    name: str, layout: Layout, config: RoadConfig, tracks: tuple[Track, ...] = ()
) -> Road:
    """Draw a straight main road from west to east, and the side arms of a road.

    Args:
        name: of a built-in road.
        layout: its size.
        config: lane width, corner radius, resolution, traffic side.
        tracks: of the recording, if there is one.
    """
    sides = SIDE_ARM_YAWS_RAD[: ARM_COUNT[name] - 2]
    arms = [Arm.towards(yaw, layout.main, layout.lanes) for yaw in (np.pi, 0.0)]
    arms += [Arm.towards(yaw, layout.side, layout.lanes) for yaw in sides]
    axis = Curve(np.array([[-layout.main, 0.0, 0.0], [layout.main, 0.0, 0.0]]))
    outermost = layout.lanes - 1
    driven = []
    for k, arm in enumerate(arms[:2] if layout.u_turns else ()):
        entry, leave = (arm.lane(outermost, config, inward=inward) for inward in (True, False))
        route = draw_u_turn(entry, leave, layout.main)
        if route is not None:
            driven.append(Driven(Connection(k, outermost, k, outermost), route, 5.0, 3.5))
    drawn_for = _place_of_u_turn(tracks, outermost, config)
    plan = Plan(arms, axis, driven, drawn_for=drawn_for)
    return draw_plan(plan, name, config, _box(sides, layout, config))


def _box(sides: tuple[float, ...], layout: Layout, config: RoadConfig) -> Floats:
    """Return the box (2, 2) [m] of the grid, with kerbs on cell edges."""
    half = layout.lanes * config.lane_width
    verge = layout.side if config.paper else half + config.cycle_lane + VERGE_M
    south, north = (layout.side if side in sides else verge for side in SIDE_ARM_YAWS_RAD)
    beyond = np.array([layout.main, south]) - half
    low = -half - config.resolution * np.ceil(beyond / config.resolution - 1e-6)
    return np.array([low, [layout.main, north]])


def _place_of_u_turn(
    tracks: tuple[Track, ...], outermost: int, config: RoadConfig
) -> DrawnFor | None:
    """Return where a recording with a U-turn lies.

    The apex of the U-turn is in the middle of the road. The vehicle comes from the first arm's
    outermost lane.
    """
    turner = next((track for track in tracks if track.makes_u_turn), None)
    if turner is None:
        return None
    apex = _middle_of_turn(turner)
    first, second = (0, outermost), (1, outermost)
    lane_of: dict[tuple[int, bool], tuple[int, int]] = {}
    for i, track in enumerate(tracks):
        if track is turner:
            lane_of |= {(i, True): first, (i, False): first}
        elif _shares_lane(turner, track.poses[0], apex, after=False):
            lane_of |= {(i, True): first, (i, False): second}
        elif _shares_lane(turner, track.poses[-1], apex, after=True):
            lane_of |= {(i, True): second, (i, False): first}
    sign = 1.0 if config.traffic_side == "right" else -1.0
    on_road = np.array([(outermost + 0.5) * config.lane_width, 0.0, sign * np.pi / 2.0])
    return aligned(tracks, lane_of, turner.curve.points[apex], on_road)


def _middle_of_turn(track: Track) -> int:
    """Return the index of the path's point at which half of its turn is done."""
    yaw = track.curve.points[:, 2]
    return int(np.argmin(np.abs(yaw - (yaw[0] + yaw[-1]) / 2.0)))


def _shares_lane(turner: Track, pose: Floats, apex: int, *, after: bool) -> bool:
    """Return whether a pose (3,) is in the lane of a turning vehicle, before or after its apex."""
    station, offset = turner.curve.project(pose[None, :2])
    turn = abs(float(wrap_angle(turner.curve.at(station)[0, 2] - pose[2])))
    is_after = station[0] > turner.curve.station[apex]
    return bool(abs(offset[0]) < LANE_GAP_M and turn < _SAME_DIRECTION_RAD and is_after == after)


def draw_paper(name: str, config: RoadConfig) -> Road:
    """Draw the paper's straight lane or T-intersection (IV-B).

    It has 1000 x 1000 cells and one wide lane per direction; lengths are in cells.

    Raises:
        InputError: the road has no paper version.
    """
    if name not in ("straight", "t_intersection"):
        raise InputError(f"road {name} has no paper version; choose straight or t_intersection")
    cells = replace(config, lane_width=100.0, corner_radius=50.0, resolution=1.0)
    return draw_layout(name, Layout(main=500.0, side=500.0, lanes=1), cells)


def layout_for(name: str, tracks: tuple[Track, ...] | None, config: RoadConfig) -> Layout:
    """Return the size of a road on which a recording fits at its own scale."""
    if tracks is None:
        layout = Layout(_DEFAULT_ARM_M, _DEFAULT_ARM_M, 1)
    else:
        try:
            frenet = to_frenet(tracks).spread()
        except RefusedError:  # turns or crossings need a junction
            layout = _layout_of_junction(tracks, config)
        else:
            low, high = frenet.span(tracks)
            main = max((high - low) / 2.0 + END_ROOM_M, MIN_ARM_M)
            layout = Layout(main, MIN_ARM_M, frenet.lanes)
    lanes = config.lanes or layout.lanes
    shortest = 5.0
    if name != "straight":
        shortest += lanes * config.lane_width + config.corner_radius
    return Layout(
        max(config.arm_length or layout.main, shortest),
        max(config.arm_length or layout.side, shortest),
        lanes,
        layout.u_turns,
    )


def junction_centre(tracks: tuple[Track, ...]) -> Floats:
    """Return (2,) [m] the mean of the places where paths cross and turn.

    Without any it is the mean of all recorded positions.
    """
    crossings = list(pair_crossings(tracks))
    points: list[Floats] = []
    for i, track in enumerate(tracks):
        points += [track.curve.at(crossing.first)[:2] for k, _, crossing in crossings if k == i]
        if track.turns and not points:
            points.append(track.curve.points[_middle_of_turn(track), :2])
    if not points:
        points = [track.poses[:, :2].mean(axis=0) for track in tracks]
    return np.asarray(np.mean(points, axis=0))


def _layout_of_junction(tracks: tuple[Track, ...], config: RoadConfig) -> Layout:
    centre = junction_centre(tracks)
    poses = np.concatenate([track.poses[[0, -1]] for track in tracks])
    half = np.repeat([track.vehicle.rear for track in tracks], 2)
    distance = np.hypot(poses[:, 0] - centre[0], poses[:, 1] - centre[1])
    needed = distance + half + END_ROOM_M + JUNCTION_SLACK_M
    sine = np.abs(np.sin(wrap_angle(poses[:, 2] - poses[np.argmax(needed), 2])))
    side = float(needed[sine > np.sin(np.radians(30.0))].max(initial=MIN_ARM_M))
    lanes = _parallel_lanes(tracks, config.lane_width)
    u_turns = any(track.makes_u_turn for track in tracks)
    if u_turns:  # from one outermost lane to the other in a half circle
        lanes = max(lanes, int(np.ceil((_U_TURN_WIDTH_M / config.lane_width + 1.0) / 2.0)))
    return Layout(max(float(needed.max()), MIN_ARM_M), side, lanes, u_turns)


def _parallel_lanes(tracks: tuple[Track, ...], lane_width: float) -> int:
    """Return the lanes per direction that the offsets of starts and ends from other paths need.

    Lanes i and j of the two directions are i + j + 1 lanes from each other.
    """
    lanes = 1
    for k in (0, -1):
        poses = np.stack([track.poses[k] for track in tracks])
        for track in tracks:
            station, offset = track.curve.project(poses[:, :2])
            cosine = np.cos(poses[:, 2] - track.curve.at(station)[:, 2])
            same = (cosine > np.cos(_SAME_DIRECTION_RAD)) & (np.abs(offset) < _MAX_ROAD_WIDTH_M)
            gaps = np.diff(np.sort(offset[same]))
            oncoming = cosine < -np.cos(_SAME_DIRECTION_RAD)
            oncoming &= np.abs(offset) < _MAX_ONCOMING_DISTANCE_M
            between = np.round(np.abs(offset[oncoming]) / lane_width - 1.0).max(initial=0.0)
            needed = min(1 + int(np.ceil(between / 2.0)), _MAX_LANES_COUNT)
            lanes = max(lanes, 1 + int((gaps > LANE_GAP_M).sum()), needed)
    return lanes


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
    widths: dict[str, float] = {}
    trailers: dict[str, Trailer] = {}
    for track in Situation.of(encounter).separation.tracks:
        vehicle = track.vehicle
        reach = config.corridor_margin if track.still else config.corridor_run_out
        path = track.curve.cut(-reach, track.travelled + reach, _FOOTPRINT_STEP_M)
        width = vehicle.width + 2.0 * config.corridor_margin
        widths[vehicle.id] = width
        surface.append(swept(path, vehicle.length, width, vehicle.trailer))
        if not track.still:
            paths[vehicle.id] = path
        if vehicle.trailer is not None:
            trailers[vehicle.id] = vehicle.trailer
    lanes: list[Lane] = []
    for lane_name, sharing in sharing_lanes(paths).items():
        path = paths[lane_name]
        line = path.cut(0.0, path.length, 1.0)
        half = np.full(len(line.points), max(widths[vehicle] for vehicle in sharing) / 2.0)
        for towing in trailers.keys() & set(sharing):
            towed = trailer_poses(line.points, trailers[towing])
            station, offset = line.project(towed[:, :2])
            half += np.interp(line.station, station, np.abs(offset))
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
