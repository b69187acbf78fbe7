# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The built-in roads: how large each must be for a template, how it is drawn, and the corridor around a template's own paths."""

from dataclasses import dataclass, replace

import numpy as np
from PIL import Image, ImageDraw

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Bools, exact, Floats, wrap_angle
from scenario_gen.roads.config import refuse_too_many_cells, RoadConfig
from scenario_gen.template import FrenetTracks, path_crossing, to_frenet, Track
from scenario_gen.types import Road

_VERGE = 2.0  # metres of kerb drawn beside a road
_PAPER_LANE = 100.0  # cells
_ARMS = {
    "straight": ("west", "east"),
    "curve": ("west", "east"),
    "t_intersection": ("west", "east", "south"),
    "four_way": ("west", "east", "south", "north"),
    "merge": ("west", "east"),
    "roundabout": ("west", "east", "south", "north"),
}
_OUTWARD = {"west": np.pi, "east": 0.0, "south": -np.pi / 2.0, "north": np.pi / 2.0}

BUILT_IN = tuple(_ARMS)


@dataclass(frozen=True)
class Layout:
    """Sizes of a built-in road: metres from the centre to the ends of main and side arms, lanes per direction."""

    main: float
    side: float
    lanes: int


def draw(name: str, layout: Layout, config: RoadConfig) -> Road:
    """Draw a built-in road.

    Args:
        name: one of `BUILT_IN`.
        layout: its sizes.
        config: lane width, corner radius, resolution, traffic side.
    """
    arms = _ARMS[name]
    half = layout.lanes * config.lane_width
    reach = {arm: layout.main if arm in ("west", "east") else layout.side for arm in arms}
    verge = layout.side if config.paper else half + _VERGE
    cell = config.resolution
    low = -half - cell * np.ceil(
        (np.array([reach["west"], reach.get("south", verge)]) - half) / cell - 1e-6
    )  # kerbs on cell edges
    high = np.array([reach["east"], reach.get("north", verge)])
    cells = np.ceil((high - low) / cell - 1e-6).astype(np.int64)
    refuse_too_many_cells(name, int(cells[0]), int(cells[1]), config)
    x = low[0] + (np.arange(cells[0]) + 0.5) * cell
    y = low[1] + (np.arange(cells[1]) + 0.5) * cell
    drivable = np.repeat(np.abs(y)[:, None] < half, len(x), axis=1)
    for arm in arms:
        if arm in ("south", "north"):
            sign = -1.0 if arm == "south" else 1.0
            drivable |= (np.abs(x)[None, :] < half) & (sign * y[:, None] > 0.0)
            for side in (-1.0, 1.0):
                drivable |= _corner(side * x[None, :] - half, sign * y[:, None] - half, config.corner_radius)
    poses = [_lane_ends(arm, reach[arm], layout.lanes, config) for arm in arms]
    shift = np.array([-low[0], -low[1], 0.0])
    return Road(
        name=name,
        drivable=drivable,
        resolution=config.resolution,
        origin=np.zeros(2),
        entries=np.concatenate([entries for entries, _ in poses]) + shift,
        exits=np.concatenate([exits for _, exits in poses]) + shift,
    )


def _corner(u: Floats, v: Floats, radius: float) -> Bools:
    """Cells of the rounded corner between two kerbs, u and v metres beyond each of them."""
    inside = (u >= 0.0) & (v >= 0.0) & (u < radius) & (v < radius)
    return np.asarray(inside & (exact.hypot(u - radius, v - radius) > radius))


def _lane_ends(arm: str, reach: float, lanes: int, config: RoadConfig) -> tuple[Floats, Floats]:
    """Entries (lanes, 3) and exits (lanes, 3) of one arm, from the middle of the road outwards."""
    outward = _OUTWARD[arm]
    along = np.array([exact.cos(outward), exact.sin(outward)])
    right = np.array([along[1], -along[0]]) * (1.0 if config.traffic_side == "right" else -1.0)
    offsets = (np.arange(lanes) + 0.5)[:, None] * config.lane_width * right
    entries = np.column_stack((along * reach - offsets, np.full(lanes, outward + np.pi)))
    exits = np.column_stack((along * reach + offsets, np.full(lanes, outward)))
    return entries, exits


def draw_paper(name: str, config: RoadConfig) -> Road:
    """The paper's straight lane or T-intersection (IV-B): 1000 x 1000 cells, one wide lane per direction, lengths in cells."""
    cells = replace(config, lane_width=_PAPER_LANE, corner_radius=50.0, resolution=1.0)
    return draw(name, Layout(main=500.0, side=500.0, lanes=1), cells)


_ROOM = 6.0  # metres kept free behind the first and before the last footprint
_SLACK = 12.0  # metres by which a junction's geometry may differ from the template's
_SHORTEST = 30.0
_U_TURN = 12.0  # metres between the lanes of a U-turn
_SAME_WAY = np.radians(25.0)
_LANE_GAP = 2.0  # metres sideways that make another lane
_WIDEST = 12.0
_ONCOMING = 20.0  # metres sideways within which oncoming vehicles are on the same road
_MOST_LANES = 3  # per direction, for oncoming vehicles to be as far apart as they are
_PLAIN = 60.0  # metres: an arm when there is no template


def layout_for(name: str, tracks: tuple[Track, ...] | None, config: RoadConfig) -> Layout:
    """Size the road `name` so that the template fits at its own scale."""
    if tracks is None:
        layout = Layout(_PLAIN, _PLAIN, 1)
    else:
        try:
            layout = _along_a_road(tracks, to_frenet(tracks).spread())
        except RefusedError:  # turns or crossings: a junction's template
            layout = _at_a_junction(tracks, config)
    main, side = (config.arm_length, config.arm_length) if config.arm_length else (layout.main, layout.side)
    lanes = config.lanes or layout.lanes
    mouth = lanes * config.lane_width + config.corner_radius + 5.0 if name != "straight" else 5.0
    return Layout(max(main, mouth), max(side, mouth), lanes)


def _along_a_road(tracks: tuple[Track, ...], frenet: FrenetTracks) -> Layout:
    half = np.array([track.vehicle.length for track in tracks]) / 2.0
    span = float((frenet.station.max(axis=1) + half).max() - (frenet.station.min(axis=1) - half).min())
    return Layout(max(span / 2.0 + _ROOM, _SHORTEST), _SHORTEST, frenet.lanes)


def junction_centre(tracks: tuple[Track, ...]) -> Floats:
    """(2,) [m] the middle of where paths cross and where they turn; of where vehicles are nearest if they do neither."""
    points = []
    for i, a in enumerate(tracks):
        for b in tracks[:i]:
            crossing = path_crossing(a, b)
            if crossing is not None:
                points.append(a.curve.at(crossing.first)[:2])
        if a.turns and not points:
            yaw = a.curve.points[:, 2]
            middle = int(np.argmin(np.abs(yaw - (yaw[0] + yaw[-1]) / 2.0)))
            points.append(a.curve.points[middle, :2])
    if not points:
        points = [track.poses[:, :2].mean(axis=0) for track in tracks]
    return np.asarray(np.mean(points, axis=0))


def _at_a_junction(tracks: tuple[Track, ...], config: RoadConfig) -> Layout:
    centre = junction_centre(tracks)
    needs, yaws = [], []
    for track in tracks:
        for k in (0, -1):
            pose = track.poses[k]
            away = float(exact.hypot(*(pose[:2] - centre)))
            needs.append(away + track.vehicle.length / 2.0 + _ROOM + _SLACK)
            yaws.append(float(pose[2]))
    main_yaw = yaws[int(np.argmax(needs))]
    across = np.abs(exact.sin(wrap_angle(np.array(yaws) - main_yaw)))
    need = np.array(needs)
    main = float(need.max())
    side = max(float(need[across > exact.sin(np.radians(30.0))].max(initial=_SHORTEST)), _SHORTEST)
    lanes = _parallel_lanes(tracks, config.lane_width)
    if any(track.makes_u_turn for track in tracks):  # from one outermost lane to the other in a half circle
        lanes = max(lanes, int(np.ceil((_U_TURN / config.lane_width + 1.0) / 2.0)))
    return Layout(max(main, _SHORTEST), side, lanes)


def _parallel_lanes(tracks: tuple[Track, ...], lane_width: float) -> int:
    """Lanes per direction for those who come or leave the same way, and for those who come or leave the opposite way.

    By how far beside one's path others start or end; lanes i and j of the two directions are i + j + 1 lanes apart.
    """
    most = 1
    for k in (0, -1):
        poses = np.stack([track.poses[k] for track in tracks])
        for track in tracks:
            station, offset = track.curve.project(poses[:, :2])
            same = (exact.cos(poses[:, 2] - track.curve.at(station)[:, 2]) > exact.cos(_SAME_WAY)) & (np.abs(offset) < _WIDEST)
            gaps = np.diff(np.sort(offset[same]))
            most = max(most, 1 + int((gaps > _LANE_GAP).sum()))
            oncoming = (exact.cos(poses[:, 2] - track.curve.at(station)[:, 2]) < -exact.cos(_SAME_WAY)) & (
                np.abs(offset) < _ONCOMING
            )
            between = np.round(np.abs(offset[oncoming]) / lane_width - 1.0).max(initial=0.0)
            most = max(most, min(1 + int(np.ceil(between / 2.0)), _MOST_LANES))
    return most


_STEP = 0.25  # metres between drawn footprints
_BORDER = 2.0  # metres of wall around the grid


def draw_corridor(tracks: tuple[Track, ...], config: RoadConfig) -> Road:
    """Draw the corridor of cleaned and separated tracks.

    Every moving vehicle's path is continued straight on at both ends by `corridor_run_out`; entries and exits stand there.
    A vehicle that stands throughout gets the room that its footprint and the margin need.
    """
    margin, run_out = config.corridor_margin, config.corridor_run_out
    outlines, entries, exits = [], [], []
    for track in tracks:
        reach = margin if track.still else run_out
        start, end = -reach, track.travelled + reach
        count = int(np.ceil((end - start) / _STEP)) + 1
        poses = track.curve.at(np.linspace(start, end, count))
        length, width = track.vehicle.length, track.vehicle.width + 2.0 * margin
        outlines.append(_corners(poses, length, width))
        if not track.still:
            entries.append(poses[0])
            exits.append(poses[-1])
    everything = np.concatenate([corners.reshape(-1, 2) for corners in outlines])
    low = np.floor(everything.min(axis=0) - _BORDER)
    size = np.ceil((everything.max(axis=0) + _BORDER - low) / config.resolution).astype(int)
    refuse_too_many_cells("corridor", int(size[0]), int(size[1]), config)
    image = Image.new("1", (int(size[0]), int(size[1])))
    brush = ImageDraw.Draw(image)
    for corners in outlines:
        for quad in (corners - low) / config.resolution - 0.5:  # PIL's integers are cell centres
            brush.polygon([(float(x), float(y)) for x, y in quad], fill=1)
    return Road(
        name="corridor",
        drivable=np.asarray(image, dtype=np.bool_),
        resolution=config.resolution,
        origin=low,
        entries=np.array(entries),
        exits=np.array(exits),
    )


def _corners(poses: Floats, length: float, width: float) -> Floats:
    """(M, 4, 2) corners of footprints at (M, 3) poses."""
    cos, sin = exact.cos(poses[:, 2])[:, None], exact.sin(poses[:, 2])[:, None]
    u = np.array([1.0, -1.0, -1.0, 1.0]) * length / 2.0
    v = np.array([1.0, 1.0, -1.0, -1.0]) * width / 2.0
    return np.stack((poses[:, :1] + u * cos - v * sin, poses[:, 1:2] + u * sin + v * cos), axis=-1)
