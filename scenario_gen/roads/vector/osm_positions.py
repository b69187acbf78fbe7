# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The positions of a Lanelet2 map's nodes: local coordinates, or latitude and longitude."""

from collections.abc import Sequence
from dataclasses import dataclass
import math

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.base.xml_reader import Element, to_number
from scenario_gen.logs import local_frame, middle_of
from scenario_gen.numerics import Floats
from scenario_gen.roads.vector.drafts import Faults
from scenario_gen.roads.vector.osm_tags import tags_of
from scenario_gen.types import Note, NoteKind

_MAX_DISTANCE_M = 50_000.0
"""From the middle of a map in latitude and longitude, as far as the local frame is exact."""
_LOCAL_KEYS = ("local_x", "local_y")


@dataclass(frozen=True)
class Positions:
    """The positions of nodes.

    Attributes:
        metres: (3,) [m] x, y and height by the node's id; NaN for an unknown height.
        note: how they were read.
        origin: latitude and longitude [degrees] of the frame; () with local coordinates.
    """

    metres: dict[str, Floats]
    note: Note
    origin: tuple[float, ...] = ()


def positions_of(nodes: Sequence[Element], central: int, file: str, faults: Faults) -> Positions:
    """Return the positions of nodes.

    Local coordinates are used if most of the first `central` nodes have them; otherwise the local
    frame lies about the middle of these. Nodes with only the other coordinates are faulty.

    Raises:
        InputError: no node has a position, or the nodes are far from each other.
    """
    tags = [tags_of(node) for node in nodes]
    has_local = [each.keys() >= set(_LOCAL_KEYS) for each in tags]
    use_local = has_local[:central].count(True) * 2 > central
    coordinates: dict[str, Floats] = {}
    for node, node_tags, local in zip(nodes, tags, has_local, strict=True):
        name = node.attribute("id")
        with faults.leaving_out("node", name):
            if use_local and not local:
                raise InputError(
                    f"{node.place}: node {name} has no tags local_x and local_y, but "
                    f"{has_local.count(True)} of {len(nodes)} have; two frames cannot be mixed"
                )
            place = _local(node, node_tags) if use_local else _degrees(node)
            coordinates[name] = np.array([*place, _height(node_tags)])
    if not coordinates:
        raise InputError(faults.first_reason or f"{file}: no lanelet for cars has borders")
    if use_local:
        return Positions(coordinates, Note.of(NoteKind.LOCAL_TAGS))
    central_names = {node.attribute("id") for node in nodes[:central]}
    return _projected(coordinates, central_names, file, faults)


def _projected(
    coordinates: dict[str, Floats], central: set[str], file: str, faults: Faults
) -> Positions:
    """Project latitude, longitude [degrees] and height [m] to a frame about the central nodes."""
    degrees = np.array(list(coordinates.values()))
    is_central = np.array([name in central for name in coordinates])
    origin = middle_of(degrees[is_central, :2] if is_central.any() else degrees[:, :2])
    metres = local_frame(degrees[:, 0], degrees[:, 1], origin)
    distance = float(np.hypot(metres[:, 0], metres[:, 1]).max())
    if not distance <= _MAX_DISTANCE_M:
        if faults.first_reason:  # most likely the coordinates are not degrees, but metres
            raise InputError(faults.first_reason)
        raise InputError(
            f"{file}: its nodes are up to {distance / 1000.0:.0f} km from their middle; at most "
            f"{_MAX_DISTANCE_M / 1000.0:g} km are read"
        )
    latitude, longitude = origin
    note = Note.of(NoteKind.PROJECTED, latitude=latitude, longitude=longitude)
    rows = np.column_stack((metres, degrees[:, 2]))
    return Positions(dict(zip(coordinates, rows, strict=True)), note, (latitude, longitude))


def _local(node: Element, tags: dict[str, str]) -> list[float]:
    """Return the local coordinates [m] of a node."""
    return [to_number(tags[key], f"{node.place}, tag {key}") for key in _LOCAL_KEYS]


def _degrees(node: Element) -> list[float]:
    """Return latitude and longitude [degrees] of a node."""
    degrees = []
    for key, limit in (("lat", 90.0), ("lon", 180.0)):
        if not node.get(key, ""):
            raise InputError(
                f"{node.place}: node {node.attribute('id')} has neither tags local_x and local_y "
                "nor lat and lon"
            )
        value = node.number(key)
        if abs(value) > limit:
            raise InputError(
                f"{node.place}: {key} is {value:g}; degrees up to {limit:g} are needed. A map in "
                "metres gives them in tags local_x and local_y"
            )
        degrees.append(value)
    return degrees


def _height(tags: dict[str, str]) -> float:
    """Return the height [m] in a node's tag `ele`, NaN if it has none."""
    try:
        return float(tags.get("ele", "nan"))
    except ValueError:
        return math.nan
