# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Vector maps, `map.osm`, `map.xodr` or `map.xml`, and the part of them behind a `#`."""

from dataclasses import replace
from functools import lru_cache
from itertools import islice
import math
from pathlib import Path

import numpy as np

from scenario_gen.base.documents import shown
from scenario_gen.base.errors import InputError, of_system, reading, RefusedError
from scenario_gen.base.xml_reader import read_xml, to_number
from scenario_gen.numerics import Floats, frozen
from scenario_gen.roads.config import RoadConfig
from scenario_gen.roads.obstacles import with_obstacles
from scenario_gen.roads.vector.ground import road_of
from scenario_gen.roads.vector.network import extent, network_of, part_of
from scenario_gen.roads.vector.place import best_place, places
from scenario_gen.situation import Track
from scenario_gen.types import LaneNetwork, Note, NoteKind, Road

FORMATS = {
    ".osm": ("a Lanelet2 map", "osm"),
    ".xodr": ("an OpenDRIVE map", "OpenDRIVE"),
    ".xml": ("a CommonRoad file", "commonRoad"),
}
"""The name of a file with its article, and its root element, by the suffix of its name."""
PART_KINDS = ("lanelet", "junction", "box")
_MARGIN_M = 40.0  # around requested lanes
_TRIED_PLACES_COUNT = 6  # around which a part is drawn


def split(name: str) -> tuple[Path, str]:
    """Return the path and the part of `path#part`; the name of a file itself may have a #."""
    path, mark, part = name.rpartition("#")
    if not mark or Path(name).suffix.lower() in FORMATS:
        return Path(name), ""
    return Path(path), part


def is_vector_map(name: str) -> bool:
    """Return whether a road's name is the path of a vector map."""
    return split(name)[0].suffix.lower() in FORMATS


def read_network(path: Path) -> LaneNetwork:
    """Return the lanes of a whole map; the last two maps are not read again unless they changed.

    Raises:
        InputError: it is missing, broken or empty.
    """
    try:
        status = path.stat()
    except OSError as error:
        raise of_system(error, path) from error
    except ValueError as error:
        raise InputError(f"map {shown(str(path))!r}: {error}") from error
    return _read(path, status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=2)
def _read(path: Path, _changed: int, _size: int) -> LaneNetwork:
    from scenario_gen.roads.vector import commonroad, lanelet2, opendrive

    suffix = path.suffix.lower()
    name, root_tag = FORMATS[suffix]
    lanes_of = {".osm": lanelet2, ".xodr": opendrive, ".xml": commonroad}[suffix].lanes_of
    with reading(path):
        root = read_xml(path, f"map {path}")
        if root.tag != root_tag:
            raise InputError(f"{root.place}: the root of {name} is <{root_tag}>")
        return network_of(path.stem, lanes_of(root))


def chosen_lanes(network: LaneNetwork, part: str) -> tuple[int, ...]:
    """Return the lanes that `lanelet=ID` or `junction=ID` names; commas separate several ids.

    Raises:
        InputError: an id is not in the map.
    """
    kind, _, names = part.partition("=")
    ids = [lane.id if kind == "lanelet" else lane.junction for lane in network.lanes]
    chosen: list[int] = []
    for name in (piece.strip() for piece in names.split(",")):
        rows = [k for k, known in enumerate(ids) if known and known == name]
        if not rows:
            raise InputError(_unknown_id(network, kind, name, ids))
        chosen += rows
    return tuple(dict.fromkeys(chosen))


def _unknown_id(network: LaneNetwork, kind: str, name: str, ids: list[str]) -> str:
    """Return the message for an id that is not in a map."""
    known = list(dict.fromkeys(each for each in ids if each))
    listed = ", ".join(known[:12]) or "none"
    if len(known) > 12:
        listed += f" and {len(known) - 12} more"
    faulty = [str(note) for note in network.notes if note.kind is NoteKind.FAULTY]
    message = f"map {network.name} has no {kind} {shown(name, 40)!r} for cars; it has {listed}"
    return "; ".join((message, *faulty))


def box_of(network: LaneNetwork, part: str) -> Floats:
    """Return the box (2, 2) [m], lowest and highest x, y, of `box=x0,y0,x1,y1`.

    Raises:
        InputError: it has not four numbers.
    """
    numbers = part.partition("=")[2].split(",")
    if len(numbers) != 4:
        raise InputError(
            f"map {network.name}: {shown(part, 60)!r}; box=x0,y0,x1,y1 in metres is needed"
        )
    where = f"map {network.name}, {part[:60]}"
    corners = np.array([to_number(number.strip(), where) for number in numbers]).reshape(2, 2)
    box = frozen(np.stack((corners.min(axis=0), corners.max(axis=0))))
    if (box[1] - box[0] < 1.0).any():
        raise InputError(
            f"map {network.name}: the box {shown(part, 60)!r} is less than 1 m wide; "
            f"{extent(network)}"
        )
    return box


def vector_road(name: str, tracks: tuple[Track, ...] | None, config: RoadConfig) -> Road:
    """Return the road of a vector map, of a part of it, or of the best place for a recording.

    Args:
        name: the path, and behind a `#` box=x0,y0,x1,y1, lanelet=ID or junction=ID; commas
            separate several ids.
        tracks: of the recording; None: the whole map, or the surroundings of requested lanes.
        config: cell size, and the most cells.

    Raises:
        InputError: the map cannot be read, or has no such part.
        RefusedError: it is too large to be drawn as a whole, or has no place for the recording.
    """
    path, part = split(name)
    kind = part.partition("=")[0]
    if part and kind not in PART_KINDS:
        kinds = ", ".join(f"#{each}=…" for each in PART_KINDS)
        raise InputError(f"map {path.name}: part {shown(part, 40)!r}; choose one of {kinds}")
    network = read_network(path)
    if config.traffic_rules == "ignored":
        network = replace(network, rules_kept=False)
    if kind == "box":
        box = box_of(network, part)
        return _part(network, box, Note.of(NoteKind.MAP_PART, part=part), config)
    lanes = chosen_lanes(network, part) if part else None
    if tracks is not None:
        return _best_part(network, tracks, lanes, config)
    if lanes is None:
        return _with_map_obstacles(road_of(network, None, config))
    points = np.concatenate([network.lanes[k].outline for k in lanes])
    box = np.stack((points.min(axis=0) - _MARGIN_M, points.max(axis=0) + _MARGIN_M))
    return _part(network, box, Note.of(NoteKind.MAP_AROUND, distance=_MARGIN_M, part=part), config)


def _best_part(
    network: LaneNetwork,
    tracks: tuple[Track, ...],
    lanes: tuple[int, ...] | None,
    config: RoadConfig,
) -> Road:
    """Return the road around the best place for a recording, with room for it.

    Raises:
        NoPlaceError: there is no place for it.
    """
    best: Road | None = None
    fewest_losses = math.inf
    refusal: RefusedError | None = None
    for place in islice(places(network, tracks, lanes), _TRIED_PLACES_COUNT):
        road = _part(network, place.box, place.note, config)
        try:
            lost = len(best_place(road, tracks).refused_losses)
        except RefusedError as error:
            refusal = refusal or error
            continue
        if lost < fewest_losses:
            best, fewest_losses = road, lost
        if not lost:
            break
    if best is None:
        assert refusal is not None
        raise refusal
    return best


def _part(network: LaneNetwork, box: Floats, note: Note, config: RoadConfig) -> Road:
    """Return the road of the part of a map in a box (2, 2) [m]."""
    return _with_map_obstacles(road_of(part_of(network, box, note), box, config))


def _with_map_obstacles(road: Road) -> Road:
    """Return a road with the obstacles of its map."""
    assert road.lanes is not None
    others = road.cells_in(road.lanes.others)
    return with_obstacles(road, road.lanes.obstacles, others, elsewhere=True)
