# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Roads by name or path: built-in, drawn around a recording, or read from a map."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import numpy as np
from scipy.spatial.distance import cdist

from scenario_gen.base.documents import shown
from scenario_gen.base.errors import did_you_mean, InputError, reading, RefusedError
from scenario_gen.base.registry import Registry
from scenario_gen.numerics import Floats
from scenario_gen.roads.config import refuse_too_many_cells, RoadConfig
from scenario_gen.roads.corridor import draw_corridor
from scenario_gen.roads.junctions import draw_junction, draw_roundabout
from scenario_gen.roads.lights import LIT
from scenario_gen.roads.obstacles import parked_cars, read_obstacles, with_obstacles
from scenario_gen.roads.outline import road_of_shape, Shape
from scenario_gen.roads.pavement import ARM_COUNT
from scenario_gen.roads.shaped import draw_along, draw_merge, fitting_width, main_shape
from scenario_gen.roads.vector.place import windows_on_lanes
from scenario_gen.roads.vector.read import FORMATS, is_vector_map, read_network, split, vector_road
from scenario_gen.situation import (
    mirrored,
    refuse_reversing,
    refuse_too_large,
    Situation,
    traffic_side,
)
from scenario_gen.types import Encounter, LaneNetwork, Note, NoteKind, Road


def build_road(
    name_or_path: str | Path | Shape,
    encounter: Encounter | None = None,
    config: RoadConfig = RoadConfig(),
) -> Road:
    """Return a road, with the obstacles of `config` drawn into it.

    Args:
        name_or_path: one of `ROADS`; or the path of a nav2 map_server YAML or of a vector map
            (.osm, .xodr, .xml), of which `#box=x0,y0,x1,y1`, `#lanelet=ID` or `#junction=ID`
            chooses a part; or drivable space as an array (H, W) of bool or a shapely polygon,
            see `road_of_shape`.
        encounter: the recording. Built-in roads are sized for it, and the best place for it on a
            vector map is searched; `corridor` needs one.
        config: how the road is drawn.

    Raises:
        InputError: there is no such road, a map cannot be used, or an obstacle is not on it.
        RefusedError: the road cannot be drawn for the recording; for `corridor`, because the
            recorded vehicles overlap too far to be separated; an obstacle is not on the part of
            a vector map.

    Examples:
        >>> from scenario_gen import build_road
        >>> build_road("straight")
        Road('straight', 124.2 x 11 m)
    """
    obstacles = read_obstacles(config.obstacles)
    if isinstance(name_or_path, (str, Path)):
        road = _road_without_obstacles(str(name_or_path), encounter, config)
        network = _vector_network(str(name_or_path)) or road.lanes
    else:
        road = road_of_shape(name_or_path, config)
        network = road.lanes
    other_lanes = road.lanes.others if road.lanes is not None else ()
    others = road.cells_in(other_lanes)
    road = with_obstacles(road, obstacles, others)
    cars = parked_cars(network, config.parked)
    parked = with_obstacles(road, cars, others, elsewhere=True)
    if cars and parked.obstacles == road.obstacles:
        raise RefusedError(
            f"no car of road.parked stands on road {road.name!r}; choose other lanes, or another "
            "part of the map"
        )
    return parked


def road_and_template(
    name_or_path: Road | Path | str, encounter: Encounter, config: RoadConfig = RoadConfig()
) -> tuple[Road, Encounter]:
    """Return a road, and the recording as it is driven there.

    It is mirrored on a map whose traffic drives on the other side. A recording without oncoming
    vehicles counts as right-hand traffic.

    Args:
        name_or_path: as in `build_road`; a road is returned unchanged.
        encounter: the recording.
        config: how a road is drawn.

    Raises:
        InputError: as in `build_road`.
        RefusedError: as in `build_road`; or the encounter is too large, or a vehicle drives
            backwards.
    """
    refuse_too_large(encounter)
    refuse_reversing(encounter)
    if isinstance(name_or_path, Road):
        return name_or_path, encounter
    network = _vector_network(str(name_or_path))
    if network is None or not _drives_on_other_side(encounter, network):
        return build_road(name_or_path, encounter, config), encounter
    other = mirrored(encounter)
    try:
        road = build_road(name_or_path, other, config)
    except RefusedError:
        return build_road(name_or_path, encounter, config), encounter
    assert road.lanes is not None
    note = Note.of(NoteKind.MIRRORED, road=road.name, side=network.traffic_side)
    return replace(road, lanes=replace(road.lanes, notes=(note, *road.lanes.notes))), other


def windows_on_map(name_or_path: Road | Path | str, encounter: Encounter) -> Iterator[Floats]:
    """Yield windows (N, 2) [s] in which a recording is on lanes of a map, the best place first.

    There are none for another road, and where the lanes are long enough.
    """
    network = None if isinstance(name_or_path, Road) else _vector_network(str(name_or_path))
    if network is None:
        return
    if _drives_on_other_side(encounter, network):
        encounter = mirrored(encounter)
    yield from windows_on_lanes(network, Situation.of(encounter).tracks)


def _vector_network(name: str) -> LaneNetwork | None:
    """Return the lanes of a vector map; None for another road."""
    return read_network(split(name)[0]) if is_vector_map(name) else None


def _drives_on_other_side(encounter: Encounter, network: LaneNetwork) -> bool:
    """Return whether the recorded traffic drives on the other side than that of a network."""
    return network.traffic_side not in ("", traffic_side(encounter) or "right")


class DrawRoad(Protocol):
    """Draws the road of a name."""

    def __call__(self, name: str, encounter: Encounter | None, config: RoadConfig, /) -> Road:
        """Return the road, without obstacles.

        Args:
            name: by which it was chosen, the name of the road.
            encounter: the recording that it is sized for; None: plain sizes.
            config: how roads are drawn; lane width, resolution and traffic side should be used.

        Raises:
            InputError: it cannot be drawn without a recording, or with these parameters.
            RefusedError: it cannot be drawn for this recording.
        """
        ...


def _road_without_obstacles(
    name_or_path: str, encounter: Encounter | None, config: RoadConfig
) -> Road:
    if is_vector_map(name_or_path):
        tracks = None if encounter is None else Situation.of(encounter).tracks
        return vector_road(name_or_path, tracks, config)
    path = Path(name_or_path)
    if path.suffix.lower() in (".yaml", ".yml"):
        from scenario_gen.roads.nav2 import read_map

        with reading(path):
            return read_map(path, config)
    if name_or_path not in ROADS:
        raise InputError(_unknown_road(name_or_path))
    draw_road = ROADS[name_or_path]
    with ROADS.running(name_or_path):
        road = draw_road(name_or_path, encounter, config)
        if not isinstance(road, Road):
            raise TypeError(f"it returned {type(road).__name__}; it must return a Road")
        if encounter is None or name_or_path not in BUILT_IN:
            return road
        return _with_room_to_walk(road, encounter, config)


def _unknown_road(name: str) -> str:
    """Return the message for a road that does not exist."""
    names, suffixes = ", ".join(ROADS.names()), ", ".join(FORMATS)
    message = (
        f"road {shown(name, 200)!r} is neither one of {names} nor the path of a map_server YAML "
        f"file or a vector map ({suffixes})"
    )
    if "#" in name:
        message += "; only a vector map has parts, one behind one #"
    return message + did_you_mean(name, ROADS.names())


def _with_room_to_walk(road: Road, encounter: Encounter, config: RoadConfig) -> Road:
    """Return a road whose grid is extended by the distance of pedestrians from drivers."""
    tracks = Situation.of(encounter).tracks
    walked = [track.poses[:, :2] for track in tracks if track.vehicle.kind.walks]
    driven = [track.poses[:, :2] for track in tracks if not track.vehicle.kind.walks]
    if not walked or not driven:
        return road
    distances = cdist(np.concatenate(walked), np.concatenate(driven))
    margin = int(np.ceil(float(distances.min(axis=1).max()) / road.resolution))
    height, width = (cells + 2 * margin for cells in road.drivable.shape)
    refuse_too_many_cells(road.name, width, height, config)
    return replace(
        road,
        drivable=np.pad(road.drivable, margin),
        origin=road.origin - margin * road.resolution,
    )


def draw_main_road(name: str, encounter: Encounter | None, config: RoadConfig) -> Road:
    """Draw a main road with the side arms that a road has.

    Without a recording it has plain sizes. With one, it follows the recorded bends, or is a
    junction with the recorded arms.
    """
    if encounter is None:
        shape, lanes = main_shape(name, (), config)
        return draw_along(name, shape, config.lanes or lanes, config)
    situation = Situation.of(encounter)
    tracks = situation.drivers
    config = fitting_width(tracks, config)
    is_junction = ARM_COUNT[name] > 2
    if is_junction and config.priority in LIT and encounter.lights:
        return draw_junction(name, situation, config)
    try:
        shape, lanes = main_shape(name, tracks, config)
    except RefusedError:  # turns or crossings need a junction
        if is_junction or any(track.makes_u_turn for track in tracks):
            return draw_junction(name, situation, config)
        raise
    return draw_along(name, shape, config.lanes or lanes, config)


CORRIDOR = "corridor"
"""The road that is drawn around the recorded paths."""
ROUNDABOUT = "roundabout"
BUILT_IN: dict[str, DrawRoad] = {
    **dict.fromkeys(("straight", "curve", "t_intersection", "four_way"), draw_main_road),
    "merge": draw_merge,
    ROUNDABOUT: draw_roundabout,
}
"""The built-in roads that need no recording, by name."""
ROADS = Registry[DrawRoad]("scenario_gen.roads", {**BUILT_IN, CORRIDOR: draw_corridor})
"""All roads that are drawn, by name."""
