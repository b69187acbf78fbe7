# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The crosswalks of an OpenDRIVE map, which are objects next to its lanes.

Source: ASAM OpenDRIVE 1.8, chapter "Objects" (outlines, cornerLocal, cornerRoad).
"""

from collections.abc import Iterator

import numpy as np
import shapely

from scenario_gen.base.errors import InputError
from scenario_gen.base.xml_reader import Element
from scenario_gen.numerics import ahead_and_left, Floats, place, unit_left
from scenario_gen.numerics.boxes import corners
from scenario_gen.roads.vector.drafts import Draft, Faults
from scenario_gen.roads.vector.sections import OpenDriveRoad

_MIN_AREA_M2 = 0.1


def crosswalks(road: OpenDriveRoad, faults: Faults) -> Iterator[Draft]:
    """Yield the crosswalks of a road, from its right to its left, named crosswalk road.object."""
    for element in road.element.findall("objects/object[@type='crosswalk']"):
        name = f"crosswalk {road.id}.{element.get('id', '?')}"
        with faults.leaving_out("crosswalk", name):
            (pose,) = _poses(road, np.array([[element.number("s"), element.number("t")]]))
            ring = _outline(road, element, pose)
            if np.allclose(ring[0], ring[-1]):
                ring = ring[:-1]
            if len(ring) < 4 or shapely.Polygon(ring).area < _MIN_AREA_M2:
                raise InputError(
                    f"{element.place}: {name} has no area; an outline with four corners, or "
                    "length and width, are needed"
                )
            left, right = _borders(ring - pose[:2], float(pose[2]))
            yield Draft(
                id=name,
                left=left + pose[:2],
                right=right + pose[:2],
                place=element.place,
                users=frozenset(("pedestrian",)),
                crossing=True,
            )


def _borders(ring: Floats, yaw: float) -> list[Floats]:
    """Return the left and the right border of an outline (P, 2) [m] about a place on a road.

    They join the outline's rightmost edge, seen in the road's direction [rad], to its leftmost.
    """
    _, left = ahead_and_left(ring + np.roll(ring, -1, axis=0), yaw)
    rightmost = int(np.argmin(left))
    ring = np.roll(ring, -1 - rightmost, axis=0)
    last = int(np.argmax(np.roll(left, -1 - rightmost))) + 1
    sides = [ring[:last], ring[last:][::-1]]
    return sorted(sides, key=lambda side: float(ahead_and_left(side, yaw)[0].mean()))


def _poses(road: OpenDriveRoad, places: Floats) -> Floats:
    """Return poses (P, 3) x, y [m], yaw [rad] at places (P, 2) s, t [m] of a road."""
    order = np.argsort(places[:, 0], kind="stable")
    poses = np.empty((len(places), 3))
    poses[order] = road.line.at(places[order, 0], road.line.length)
    poses[:, :2] += places[:, 1:] * unit_left(poses[:, 2])
    return poses


def _outline(road: OpenDriveRoad, element: Element, pose: Floats) -> Floats:
    """Return the corners (P, 2) [m] of an object, whose place has a pose (3,) along the road."""
    turned = pose + np.array([0.0, 0.0, element.number("hdg", 0.0)])
    outline = element.first_of("outline", "outlines/outline")
    if outline is None:
        size = element.number("length"), element.number("width")
        return np.asarray(corners(turned[None], *size)[0])
    local = [(corner.number("u"), corner.number("v")) for corner in outline.findall("cornerLocal")]
    if local:
        return np.asarray(place(turned, *np.array(local).T))
    places = [(corner.number("s"), corner.number("t")) for corner in outline.findall("cornerRoad")]
    return np.asarray(_poses(road, np.array(places).reshape(-1, 2))[:, :2])
