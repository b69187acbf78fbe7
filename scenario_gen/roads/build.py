# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One door to every road: built-in, drawn around the template, or read from a map."""

from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import numpy as np
from scipy.spatial.distance import cdist

from scenario_gen.base.documents import shown
from scenario_gen.base.errors import did_you_mean, InputError, reading, RefusedError
from scenario_gen.base.registry import Registry
from scenario_gen.base.stores import local
from scenario_gen.roads.builtin import draw, draw_corridor, draw_paper, layout_for
from scenario_gen.roads.config import refuse_too_many_cells, RoadConfig
from scenario_gen.roads.junctions import draw_junction, draw_roundabout
from scenario_gen.roads.nav2 import read_map
from scenario_gen.roads.obstacles import read_obstacles, with_obstacles
from scenario_gen.roads.outline import road_of_shape, Shape
from scenario_gen.roads.shaped import bends, draw_along, draw_merge, fitting_width, PLAIN_LINE
from scenario_gen.roads.vector.ground import cells_of
from scenario_gen.roads.vector.read import FORMATS, is_vector_map, read_network, split, vector_road
from scenario_gen.situation import (
    main_line,
    mirrored,
    refuse_reversing,
    refuse_too_large,
    Situation,
    to_frenet,
    traffic_side,
)
from scenario_gen.types import Encounter, LaneNetwork, Note, NoteKind, Road


def build_road(
    name_or_path: str | Shape,
    encounter: Encounter | None = None,
    config: RoadConfig = RoadConfig(),
) -> Road:
    """Return the road `name_or_path`, with the obstacles of `config` drawn into it.

    Args:
        name_or_path: one of `ROADS`, or the path of a nav2 map_server YAML or of a vector map (.osm, .xodr, .xml), of which
            `#box=x0,y0,x1,y1`, `#lanelet=ID` or `#junction=ID` chooses a part; or what is drivable, as an array (H, W) of bool or
            a shapely polygon, as `road_of_shape` takes it.
        encounter: the template, to which built-in roads are sized (None: plain sizes), and for which the best place on a vector
            map is searched; `corridor` cannot do without.
        config: how it is drawn.

    Raises:
        InputError: no such road, a map that cannot be used, or an obstacle that stands nowhere on it.
        RefusedError: `corridor`, and the recorded vehicles overlap so far that they cannot be separated.
    """
    obstacles = read_obstacles(config.obstacles)
    road = (
        _bare_road(name_or_path, encounter, config)
        if isinstance(name_or_path, str)
        else road_of_shape(name_or_path, config)
    )
    return with_obstacles(
        road, obstacles, cells_of(road, road.lanes.others if road.lanes is not None else ())
    )


def road_and_template(
    name_or_path: Road | str, encounter: Encounter, config: RoadConfig = RoadConfig()
) -> tuple[Road, Encounter]:
    """Return the road, and the template as it drives there: mirrored on a map whose traffic keeps to the other side.

    A template in which nobody meets an oncoming vehicle counts as of right-hand traffic.

    Args:
        name_or_path: as `build_road` takes it; a road is returned as it is.
        encounter: the template.
        config: how a road is drawn.

    Raises:
        InputError: as `build_road`.
        RefusedError: likewise, or the encounter is too large, or somebody drives backwards.
    """
    refuse_too_large(encounter)
    refuse_reversing(encounter)
    if isinstance(name_or_path, Road):
        return name_or_path, encounter
    refusal: RefusedError | None = None
    try:
        road = build_road(name_or_path, encounter, config)
    except RefusedError as error:
        if not is_vector_map(name_or_path) or not _differs(
            encounter, read_network(split(name_or_path)[0])
        ):
            raise
        refusal = error
    else:
        if not _on_other_side(encounter, road):
            return road, encounter
    other = mirrored(encounter)
    with suppress(RefusedError):
        there = build_road(name_or_path, other, config)
        if there.lanes is not None and _on_other_side(encounter, there):
            side = there.lanes.traffic_side
            note = Note.of(NoteKind.MIRRORED, road=there.name, side=side)
            return replace(
                there, lanes=replace(there.lanes, notes=(note, *there.lanes.notes))
            ), other
    if refusal is not None:
        raise refusal
    return road, encounter


def _on_other_side(encounter: Encounter, road: Road) -> bool:
    """Whether a road's traffic keeps to the other side than the template's."""
    return road.map_lanes is not None and _differs(encounter, road.map_lanes)


def _differs(encounter: Encounter, network: LaneNetwork) -> bool:
    """Whether the traffic of lanes keeps to the other side of the road than the template's."""
    return network.traffic_side not in ("", traffic_side(encounter) or "right")


class DrawRoad(Protocol):
    """What a road's name stands for: draws the road, for a template if there is one."""

    def __call__(self, name: str, encounter: Encounter | None, config: RoadConfig, /) -> Road:
        """Return the road, without obstacles.

        Args:
            name: by which it was chosen, the name of the road.
            encounter: the template, to which the road is sized; None: in plain sizes.
            config: how roads are drawn; it should keep lane width, resolution and traffic side.

        Raises:
            InputError: it cannot be drawn without a template, or with these parameters.
            RefusedError: it cannot be drawn for this template.
        """
        ...


def _bare_road(name_or_path: str, encounter: Encounter | None, config: RoadConfig) -> Road:
    """The road without its obstacles."""
    if config.paper and name_or_path in BUILT_IN:
        return draw_paper(name_or_path, config)
    if is_vector_map(name_or_path):
        return vector_road(
            name_or_path, None if encounter is None else Situation.of(encounter).drivers, config
        )
    path = Path(name_or_path)
    if path.suffix.lower() in (".yaml", ".yml"):
        with reading(path):
            return read_map(local(path, "a map"), config)
    if name_or_path not in ROADS:
        names, near = ", ".join(ROADS.names()), did_you_mean(name_or_path, ROADS.names())
        kinds = f"a map_server YAML file or a vector map ({', '.join(FORMATS)})"
        part = (
            "; one part behind one # can be named of a vector map alone"
            if "#" in name_or_path
            else ""
        )
        raise InputError(
            f"road {shown(name_or_path, 200)!r} is neither one of {names} nor the path of {kinds}{part}{near}"
        )
    draw_road = ROADS[name_or_path]
    with ROADS.running(name_or_path):
        road = draw_road(name_or_path, encounter, config)
        if not isinstance(road, Road):
            raise TypeError(f"it returned {type(road).__name__}; it must return a Road")
        return (
            road
            if encounter is None or name_or_path not in BUILT_IN
            else _with_room_to_walk(road, encounter, config)
        )


def _with_room_to_walk(road: Road, encounter: Encounter, config: RoadConfig) -> Road:
    """A road whose grid reaches as far beyond what is paved as people walk away from where somebody drives."""
    tracks = Situation.of(encounter).tracks
    walked = [track.poses[:, :2] for track in tracks if track.vehicle.kind.walks]
    driven = [track.poses[:, :2] for track in tracks if not track.vehicle.kind.walks]
    if not walked or not driven:
        return road
    reach = float(cdist(np.concatenate(walked), np.concatenate(driven)).min(axis=1).max())
    more = int(np.ceil(reach / road.resolution))
    height, width = (cells + 2 * more for cells in road.drivable.shape)
    refuse_too_many_cells(road.name, width, height, config)
    return replace(
        road, drivable=np.pad(road.drivable, more), origin=road.origin - more * road.resolution
    )


def draw_main_road(name: str, encounter: Encounter | None, config: RoadConfig) -> Road:
    """A main road and the side arms that the road `name` has: in plain sizes, along the template's bends, or a junction."""
    if encounter is None:
        if name == "curve":
            return draw_along(name, PLAIN_LINE, max(config.lanes, 1), config)
        return draw(name, layout_for(name, None, config), config)
    situation = Situation.of(encounter)
    tracks = situation.drivers
    config = fitting_width(tracks, config)
    try:
        frenet = to_frenet(tracks)
    except RefusedError:  # turns or crossings: a junction's template
        if name in ("t_intersection", "four_way") and not any(
            track.makes_u_turn for track in tracks
        ):
            return draw_junction(name, situation, config)
    else:
        main = main_line(frenet, tracks)
        if bends(name, main):
            return draw_along(name, main, config.lanes or frenet.spread().lanes, config)
    return draw(name, layout_for(name, tracks, config), config, tracks)


CORRIDOR = "corridor"
"""The road that is drawn around what was recorded."""
ROUNDABOUT = "roundabout"
BUILT_IN: dict[str, DrawRoad] = {
    **dict.fromkeys(("straight", "curve", "t_intersection", "four_way"), draw_main_road),
    "merge": draw_merge,
    ROUNDABOUT: draw_roundabout,
}
"""The built-in roads that need no template, by name."""
ROADS = Registry[DrawRoad]("scenario_gen.roads", {**BUILT_IN, CORRIDOR: draw_corridor})
"""All roads that are drawn, by name."""
