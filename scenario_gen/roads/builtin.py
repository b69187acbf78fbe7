# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Roads as large as a template needs: straight arms that meet at right angles; the corridor of its paths."""

from dataclasses import dataclass, replace

import numpy as np
from shapely.geometry.base import BaseGeometry

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.numerics import Floats, wrap_angle
from scenario_gen.numerics.curve import Curve
from scenario_gen.roads.along import lane_along, sharing_lanes
from scenario_gen.roads.config import RoadConfig
from scenario_gen.roads.drawn import (
    across,
    aligned,
    Arm,
    draw_lanes,
    draw_plan,
    Driven,
    half_way,
    Plan,
)
from scenario_gen.roads.pavement import (
    ARM_COUNT,
    drivable_beside,
    LANE_GAP,
    paved,
    ROOM,
    SHORTEST,
    SIDE_ARMS,
    SLACK,
    swept,
)
from scenario_gen.roads.ways import draw_u_turn
from scenario_gen.situation import pair_crossings, Situation, to_frenet, Track
from scenario_gen.types import DrawnFor, Encounter, LaneNetwork, Road

_VERGE = 2.0  # metres of kerb drawn beside a road
_PAPER_LANE = 100.0  # cells
_U_TURN = 12.0  # metres between the lanes of a U-turn
_TURNING = (5.0, 3.5)  # metres, length of who turns round, and the width that it needs
_SAME_WAY = np.radians(25.0)
_WIDEST = 12.0
_ONCOMING = 20.0  # metres sideways within which oncoming vehicles are on the same road
_MOST_LANES = 3  # per direction, for oncoming vehicles to be as far apart as they are
_PLAIN = 60.0  # metres: an arm when there is no template
_STEP = 0.25  # metres between drawn footprints
_WIDEST_CROSSING = 60.0  # metres to one side


@dataclass(frozen=True)
class Layout:
    """Sizes of a built-in road: metres from the centre to the ends of main and side arms, lanes per direction."""

    main: float
    side: float
    lanes: int
    u_turns: bool = False


def draw(name: str, layout: Layout, config: RoadConfig, tracks: tuple[Track, ...] = ()) -> Road:
    """Draw a straight main road from west to east, and the side arms that the road `name` has.

    Args:
        name: of a built-in road.
        layout: its sizes.
        config: lane width, corner radius, resolution, traffic side.
        tracks: of the template, if there is one.
    """
    sides, half, cell = (
        SIDE_ARMS[: ARM_COUNT[name] - 2],
        layout.lanes * config.lane_width,
        config.resolution,
    )
    arms = [Arm.towards(yaw, layout.main, layout.lanes) for yaw in (np.pi, 0.0)]
    arms += [Arm.towards(yaw, layout.side, layout.lanes) for yaw in sides]
    axis = Curve(np.array([[-layout.main, 0.0, 0.0], [layout.main, 0.0, 0.0]]))
    outermost = layout.lanes - 1
    ends = [
        [arm.lane(outermost, config, inward=inward) for inward in (True, False)]
        for arm in arms[:2]
        if layout.u_turns
    ]
    turns = ((k, draw_u_turn(entry, leave, layout.main)) for k, (entry, leave) in enumerate(ends))
    driven = [
        Driven((k, outermost, k, outermost), way, _TURNING[0], _TURNING[1])
        for k, way in turns
        if way is not None
    ]
    verge = layout.side if config.paper else half + config.cycle_lane + _VERGE
    south, north = (layout.side if side in sides else verge for side in SIDE_ARMS)
    low = -half - cell * np.ceil(
        (np.array([layout.main, south]) - half) / cell - 1e-6
    )  # kerbs on cell edges
    aim = _turned_round(tracks, outermost, config)
    return draw_plan(
        Plan(arms, axis, driven, drawn_for=aim),
        name,
        config,
        np.array([low, [layout.main, north]]),
    )


def _turned_round(
    tracks: tuple[Track, ...], outermost: int, config: RoadConfig
) -> DrawnFor | None:
    """Where a template lies of which a vehicle makes a U-turn: in the road's middle, from the first arm's outermost lane."""
    turner = next((track for track in tracks if track.makes_u_turn), None)
    if turner is None:
        return None
    yaw = turner.curve.points[:, 2]
    middle = int(np.argmin(np.abs(yaw - (yaw[0] + yaw[-1]) / 2.0)))
    lane_of = dict[tuple[int, bool], tuple[int, int]]()
    for i, track in enumerate(tracks):
        if track is turner:
            lane_of |= {(i, True): (0, outermost), (i, False): (0, outermost)}
        elif _shares(turner, track.poses[0], middle, last=False):
            lane_of |= {(i, True): (0, outermost), (i, False): (1, outermost)}
        elif _shares(turner, track.poses[-1], middle, last=True):
            lane_of |= {(i, True): (1, outermost), (i, False): (0, outermost)}
    sign = 1.0 if config.traffic_side == "right" else -1.0
    apex = np.array([(outermost + 0.5) * config.lane_width, 0.0, sign * np.pi / 2.0])
    return aligned(tracks, lane_of, turner.curve.points[middle], apex)


def _shares(turner: Track, pose: Floats, middle: int, *, last: bool) -> bool:
    """Whether a pose (3,) lies in the lane by which a vehicle comes that makes a U-turn, or by which it goes (`last`)."""
    station, offset = turner.curve.project(pose[None, :2])
    turned = abs(float(wrap_angle(turner.curve.at(station)[0, 2] - pose[2])))
    return bool(
        abs(offset[0]) < LANE_GAP
        and turned < _SAME_WAY
        and (station[0] > turner.curve.station[middle]) == last
    )


def draw_paper(name: str, config: RoadConfig) -> Road:
    """The paper's straight lane or T-intersection (IV-B): 1000 x 1000 cells, one wide lane per direction, lengths in cells.

    Raises:
        InputError: the road has no paper version.
    """
    if name not in ("straight", "t_intersection"):
        raise InputError(f"road {name} has no paper version; choose straight or t_intersection")
    cells = replace(config, lane_width=_PAPER_LANE, corner_radius=50.0, resolution=1.0)
    return draw(name, Layout(main=500.0, side=500.0, lanes=1), cells)


def layout_for(name: str, tracks: tuple[Track, ...] | None, config: RoadConfig) -> Layout:
    """Size the road `name` so that the template fits at its own scale."""
    if tracks is None:
        layout = Layout(_PLAIN, _PLAIN, 1)
    else:
        try:
            frenet = to_frenet(tracks).spread()
        except RefusedError:  # turns or crossings: a junction's template
            layout = _at_a_junction(tracks, config)
        else:
            low, high = frenet.span(tracks)
            layout = Layout(max((high - low) / 2.0 + ROOM, SHORTEST), SHORTEST, frenet.lanes)
    main, side = (
        (config.arm_length, config.arm_length) if config.arm_length else (layout.main, layout.side)
    )
    lanes = config.lanes or layout.lanes
    mouth = lanes * config.lane_width + config.corner_radius + 5.0 if name != "straight" else 5.0
    return Layout(max(main, mouth), max(side, mouth), lanes, layout.u_turns)


def junction_centre(tracks: tuple[Track, ...]) -> Floats:
    """(2,) [m] the middle of where paths cross and where they turn; of where vehicles are nearest if they do neither."""
    crossings = list(pair_crossings(tracks))
    points: list[Floats] = []
    for i, a in enumerate(tracks):
        points += [a.curve.at(crossing.first)[:2] for k, _, crossing in crossings if k == i]
        if a.turns and not points:
            yaw = a.curve.points[:, 2]
            middle = int(np.argmin(np.abs(yaw - (yaw[0] + yaw[-1]) / 2.0)))
            points.append(a.curve.points[middle, :2])
    if not points:
        points = [track.poses[:, :2].mean(axis=0) for track in tracks]
    return np.asarray(np.mean(points, axis=0))


def _at_a_junction(tracks: tuple[Track, ...], config: RoadConfig) -> Layout:
    centre = junction_centre(tracks)
    poses = np.concatenate([track.poses[[0, -1]] for track in tracks])
    half = np.repeat([track.vehicle.length / 2.0 for track in tracks], 2)
    away = np.hypot(poses[:, 0] - centre[0], poses[:, 1] - centre[1])
    required = away + half + ROOM + SLACK
    across = np.abs(np.sin(wrap_angle(poses[:, 2] - poses[np.argmax(required), 2])))
    side = float(required[across > np.sin(np.radians(30.0))].max(initial=SHORTEST))
    lanes = _parallel_lanes(tracks, config.lane_width)
    turns_round = any(track.makes_u_turn for track in tracks)
    if turns_round:  # from one outermost lane to the other in a half circle
        lanes = max(lanes, int(np.ceil((_U_TURN / config.lane_width + 1.0) / 2.0)))
    return Layout(max(float(required.max()), SHORTEST), side, lanes, turns_round)


def _parallel_lanes(tracks: tuple[Track, ...], lane_width: float) -> int:
    """Lanes per direction for those who come or leave the same way, and for those who come or leave the opposite way.

    By how far beside one's path others start or end; lanes i and j of the two directions are i + j + 1 lanes apart.
    """
    most = 1
    for k in (0, -1):
        poses = np.stack([track.poses[k] for track in tracks])
        for track in tracks:
            station, offset = track.curve.project(poses[:, :2])
            along = np.cos(poses[:, 2] - track.curve.at(station)[:, 2])
            same = (along > np.cos(_SAME_WAY)) & (np.abs(offset) < _WIDEST)
            oncoming = (along < -np.cos(_SAME_WAY)) & (np.abs(offset) < _ONCOMING)
            gaps = np.diff(np.sort(offset[same]))
            between = np.round(np.abs(offset[oncoming]) / lane_width - 1.0).max(initial=0.0)
            most = max(
                most,
                1 + int((gaps > LANE_GAP).sum()),
                min(1 + int(np.ceil(between / 2.0)), _MOST_LANES),
            )
    return most


def draw_corridor(name: str, encounter: Encounter | None, config: RoadConfig) -> Road:
    """Draw the corridor of a template's cleaned and separated paths, in the template's frame.

    Every moving vehicle's path is continued straight on at both ends by `corridor_run_out`; there its lane begins and ends. Who
    drives in another one's lane has none of its own. A vehicle that stands throughout gets the room that its footprint and the
    margin need.

    Raises:
        InputError: there is no template.
        RefusedError: its vehicles overlap so far that they cannot be separated, the grid would be too large, or cycle lanes are
            requested.
    """
    if config.cycle_lane:
        raise RefusedError(
            f"road {name} is drawn without cycle lanes; unset road.cycle_lane, or choose another road"
        )
    if encounter is None:
        raise InputError(f"road {name} is drawn around a recording; give a log too")
    surface, paths, widths = list[BaseGeometry](), dict[str, Curve](), dict[str, float]()
    for track in Situation.of(encounter).separation.tracks:
        reach = config.corridor_margin if track.still else config.corridor_run_out
        path = track.curve.cut(-reach, track.travelled + reach, _STEP)
        widths[track.vehicle.id] = track.vehicle.width + 2.0 * config.corridor_margin
        surface.append(swept(path, track.vehicle.length, widths[track.vehicle.id]))
        if not track.still:
            paths[track.vehicle.id] = path
    shared = sharing_lanes(paths)
    lanes = [
        lane_along(
            f"along vehicle {name}",
            paths[name].cut(0.0, paths[name].length, 1.0),
            max(widths[own] for own in names) / 2.0,
        )
        for name, names in shared.items()
    ]
    road = draw_lanes(LaneNetwork(name, tuple(lanes), drawn=True), paved(surface, 0.0), config)
    if config.crossing == "none" or road.lanes is None:
        return road
    line = paths[next(iter(shared))]
    middle = line.cut(*half_way(line), _STEP)
    right, left = (
        float(np.median(drivable_beside(road.drivable_at, middle, side, _WIDEST_CROSSING)))
        for side in (-1.0, 1.0)
    )
    return replace(
        road,
        lanes=road.lanes.with_lanes(
            (*lanes, across("crossing 1", line, half_way(line), (right, left)))
        ),
    )
