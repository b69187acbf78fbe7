# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One door to vector maps: `map.osm`, `map.xodr` or `map.xml`, and which part of it, behind a `#`."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from scenario_gen.base.documents import shown
from scenario_gen.base.errors import InputError, of_system, reading
from scenario_gen.base.stores import local
from scenario_gen.base.xml_reader import Element, read_xml, to_number
from scenario_gen.numerics import Floats, frozen
from scenario_gen.roads.config import RoadConfig
from scenario_gen.roads.vector import commonroad, lanelet2, opendrive
from scenario_gen.roads.vector.network import extent, MapLanes, network_of, part_of
from scenario_gen.roads.vector.place import best_part
from scenario_gen.roads.vector.raster import road_of
from scenario_gen.situation import Track
from scenario_gen.types import LaneNetwork, Note, NoteKind, Road


@dataclass(frozen=True)
class MapFormat:
    """A format of vector maps.

    Attributes:
        name: of a file in it, with its article.
        root: the name of its root element.
        lanes_of: finds the lanes below the root.
    """

    name: str
    root: str
    lanes_of: Callable[[Element], MapLanes]


FORMATS = {
    ".osm": MapFormat("a Lanelet2 map", "osm", lanelet2.lanes_of),
    ".xodr": MapFormat("an OpenDRIVE map", "OpenDRIVE", opendrive.lanes_of),
    ".xml": MapFormat("a CommonRoad file", "commonRoad", commonroad.lanes_of),
}
"""By the ending of a file's name."""
PARTS = ("lanelet", "junction", "box")
_AROUND = 40.0  # metres around lanes that are requested
_NAMED = 12  # ids that a message lists


def split(name: str) -> tuple[Path, str]:
    """Return the path and the part of `path#part`; a file whose name has a # stands for itself."""
    path, mark, part = name.rpartition("#")
    if not mark or Path(name).suffix.lower() in FORMATS:
        return Path(name), ""
    return Path(path), part


def is_vector_map(name: str) -> bool:
    """Return whether a road's name is the path of a vector map."""
    return split(name)[0].suffix.lower() in FORMATS


def read_network(path: Path) -> LaneNetwork:
    """Return the lanes of a whole map; of a file that has not changed since, what was read before.

    Raises:
        InputError: it is missing, broken or empty.
    """
    try:
        status = local(path, "a map").stat()
    except (OSError, ValueError) as error:
        raise (
            of_system(error, path)
            if isinstance(error, OSError)
            else InputError(f"map {shown(str(path))!r}: {error}")
        ) from error
    return _read(path, status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=2)
def _read(path: Path, _changed: int, _size: int) -> LaneNetwork:
    form = FORMATS[path.suffix.lower()]
    with reading(path):
        root = read_xml(path, f"map {path}")
        if root.tag != form.root:
            raise InputError(f"{root.place}: the root of {form.name} is <{form.root}>")
        return network_of(path.stem, form.lanes_of(root))


def chosen_lanes(network: LaneNetwork, part: str) -> tuple[int, ...]:
    """Return the lanes that `lanelet=ID` or `junction=ID` names; several ids are separated by commas.

    Raises:
        InputError: an id is not in the map.
    """
    kind, _, ids = part.partition("=")
    chosen: list[int] = []
    for name in (piece.strip() for piece in ids.split(",")):
        own = [lane.id if kind == "lanelet" else lane.junction for lane in network.lanes]
        rows = [k for k, known in enumerate(own) if known and known == name]
        if not rows:
            known = list(dict.fromkeys(value for value in own if value))
            listed = ", ".join(known[:_NAMED]) + (
                f" and {len(known) - _NAMED} more" if len(known) > _NAMED else ""
            )
            faulty = "".join(f"; {note}" for note in network.notes if note.kind is NoteKind.FAULTY)
            raise InputError(
                f"map {network.name} has no {kind} {shown(name, 40)!r} that cars may use; it has {listed or 'none'}{faulty}"
            )
        chosen += rows
    return tuple(dict.fromkeys(chosen))


def box_of(network: LaneNetwork, part: str) -> Floats:
    """Return the box (2, 2) [m], lowest and highest x, y, of `box=x0,y0,x1,y1`.

    Raises:
        InputError: these are not four numbers.
    """
    numbers = part.partition("=")[2].split(",")
    if len(numbers) != 4:
        raise InputError(
            f"map {network.name}: {shown(part, 60)!r}; box=x0,y0,x1,y1 in metres is needed"
        )
    corners = np.array(
        [to_number(number.strip(), f"map {network.name}, {part[:60]}") for number in numbers]
    ).reshape(2, 2)
    box = frozen(np.stack((corners.min(axis=0), corners.max(axis=0))))
    if (box[1] - box[0] < 1.0).any():
        raise InputError(
            f"map {network.name}: the box {shown(part, 60)!r} is less than 1 m wide; {extent(network)}"
        )
    return box


def refuse_unknown_part(name: str, part: str) -> None:
    """Refuse what is no part.

    Raises:
        InputError: it begins with none of `PARTS`.
    """
    if part and part.partition("=")[0] not in PARTS:
        raise InputError(
            f"map {name}: part {shown(part, 40)!r}; choose one of {', '.join(f'#{kind}=…' for kind in PARTS)}"
        )


def vector_road(name: str, tracks: tuple[Track, ...] | None, config: RoadConfig) -> Road:
    """Return the road of a vector map, or of the requested part of it, or else that suits the template best.

    Args:
        name: the path, and behind a `#` box=x0,y0,x1,y1, lanelet=ID or junction=ID (several with commas).
        tracks: of the template; None: the whole map, or what lies around the requested lanes.
        config: cell size, and the most cells.

    Raises:
        InputError: the map cannot be read, or has no such part.
        RefusedError: it is too large to be drawn whole, or has no place for the template.
    """
    path, part = split(name)
    refuse_unknown_part(path.name, part)
    network = read_network(path)
    if config.traffic_rules == "ignored":
        network = replace(network, rules_kept=False)
    lanes = chosen_lanes(network, part) if part and not part.startswith("box=") else None
    if part.startswith("box="):
        box, note = box_of(network, part), Note.of(NoteKind.MAP_PART, part=part)
    elif tracks is not None:
        box, note = best_part(network, tracks, lanes)
    elif lanes:
        points = np.concatenate([network.lanes[k].outline for k in lanes])
        box, note = (
            np.stack((points.min(axis=0) - _AROUND, points.max(axis=0) + _AROUND)),
            Note.of(NoteKind.MAP_AROUND, distance=_AROUND, part=part),
        )
    else:
        return road_of(network, None, config)
    return road_of(part_of(network, box, note), box, config)
