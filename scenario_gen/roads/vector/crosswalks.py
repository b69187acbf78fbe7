# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Crosswalks of OpenDRIVE, which are objects beside its lanes.

Source: ASAM OpenDRIVE 1.8, chapter "Objects" (outlines, cornerLocal, cornerRoad).
"""

from collections.abc import Iterator
import math

import numpy as np
import shapely

from scenario_gen.base.errors import InputError
from scenario_gen.base.xml_reader import Element
from scenario_gen.numerics import Floats
from scenario_gen.numerics.boxes import corners
from scenario_gen.numerics.plane import ahead_and_left, place, unit_left
from scenario_gen.roads.vector.network import Draft, Faults
from scenario_gen.roads.vector.sections import OpenDriveRoad

_USERS = frozenset(("pedestrian",))
_LEAST_AREA = 0.1  # m²


def crosswalks(road: OpenDriveRoad, faults: Faults) -> Iterator[Draft]:
    """Yield the crosswalks of a road, from its right to its left, named crosswalk road.object."""
    objects = (
        element for group in road.element.findall("objects") for element in group.findall("object")
    )
    for element in (element for element in objects if element.get("type") == "crosswalk"):
        name = f"crosswalk {road.id}.{element.get('id', '?')}"
        with faults.leaving_out("crosswalk", name):
            (pose,) = _poses(road, np.array([[element.number("s"), element.number("t")]]))
            ring = _outline(road, element, pose)
            ring = ring[:-1] if np.allclose(ring[0], ring[-1]) else ring
            if len(ring) < 4 or shapely.Polygon(ring).area < _LEAST_AREA:
                raise InputError(
                    f"{element.place}: {name} has no area; an outline of 4 corners, or length and width, are needed"
                )
            left, right = (
                border + pose[:2] for border in _borders(ring - pose[:2], float(pose[2]))
            )
            yield Draft(
                name, left, right, (), (), math.nan, "", element.place, users=_USERS, crossing=True
            )


def _borders(ring: Floats, yaw: float) -> list[Floats]:
    """The left and the right border of an outline (P, 2) [m] about a place of a road with a direction [rad].

    They join the edge that lies farthest to the right of the road to the one farthest to the left.
    """
    _, left = ahead_and_left(ring + np.roll(ring, -1, axis=0), yaw)
    ring = np.roll(ring, -1 - int(np.argmin(left)), axis=0)
    last = int(np.argmax(np.roll(left, -1 - int(np.argmin(left))))) + 1
    sides = [ring[:last], ring[last:][::-1]]
    return sorted(sides, key=lambda side: float(ahead_and_left(side, yaw)[0].mean()))


def _poses(road: OpenDriveRoad, places: Floats) -> Floats:
    """Poses (P, 3) x, y [m], yaw [rad] of places (P, 2) s, t [m] of a road."""
    order = np.argsort(places[:, 0], kind="stable")
    poses = np.empty((len(places), 3))
    poses[order] = road.line.at(places[order, 0], road.line.length)
    poses[:, :2] += places[:, 1:] * unit_left(poses[:, 2])
    return poses


def _outline(road: OpenDriveRoad, element: Element, pose: Floats) -> Floats:
    """The corners (P, 2) [m] of an object, whose place has a pose (3,) along the road."""
    own = pose + np.array([0.0, 0.0, element.number("hdg", 0.0)])
    outline = next(
        (
            outline
            for holder in (element, *element.findall("outlines"))
            for outline in holder.findall("outline")
        ),
        None,
    )
    if outline is None:
        return np.asarray(corners(own[None], element.number("length"), element.number("width"))[0])
    local = np.array(
        [(corner.number("u"), corner.number("v")) for corner in outline.findall("cornerLocal")]
    )
    if len(local):
        return np.asarray(place(own, local[:, 0], local[:, 1]))
    places = [(corner.number("s"), corner.number("t")) for corner in outline.findall("cornerRoad")]
    return np.asarray(_poses(road, np.array(places).reshape(-1, 2))[:, :2])
