# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Pictures for RViz and Foxglove: footprints (PolygonStamped) and markers (MarkerArray).

Frame: that of the vehicles. QoS: reliable, transient_local.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np

from msg_conventions.cdr import encode
from msg_conventions.layouts import MARKERS, POLYGON
from msg_conventions.poses import pose_rows
from scenario_gen.numerics import Bools, Floats
from scenario_gen.numerics.curve import Curve
from scenario_gen.types import LaneNetwork, Scenario, tokens, Vehicle
from scenario_gen.types.markings import Marking, markings

MARKER_TYPE = "visualization_msgs/msg/MarkerArray"
FOOTPRINT_TYPE = "geometry_msgs/msg/PolygonStamped"
COLOURS_RGB = (
    (0.12, 0.47, 0.71),
    (0.84, 0.15, 0.16),
    (0.17, 0.63, 0.17),
    (1.0, 0.5, 0.05),
    (0.58, 0.4, 0.74),
    (0.55, 0.34, 0.29),
)
EGO_RGB = (0.06, 0.09, 0.16)
PAINT = {
    Marking.EDGE: (0.15,),
    Marking.LANE: (0.12, 3.0, 4.5),
    Marking.CENTRE: (0.15, 3.0, 1.5),
    Marking.STOP: (0.5,),
    Marking.GIVE_WAY: (0.4, 0.6, 0.4),
    Marking.ARROW: (0.12,),
    Marking.ZEBRA: (0.5,),
    Marking.OBSTACLE: (0.12,),
}
"""The width of a marking, and the lengths of its dashes and gaps [m]."""


class Kind(IntEnum):
    """Types of markers."""

    CUBE = 1
    CYLINDER = 3
    LINE_STRIP = 4
    LINE_LIST = 5


class Action(IntEnum):
    """Actions of markers."""

    ADD = 0
    DELETE_ALL = 3


@dataclass(frozen=True, eq=False)
class Marker:
    """One marker of namespace `name` and id 0.

    Attributes:
        name: namespace.
        kind: its type.
        action: whether it is added or deleted.
        pose: x [m], y [m], yaw [rad].
        scale: length, width, height of a box, or the width of a line first [m].
        colour: red, green, blue, alpha, from 0 to 1.
        points: (P, 2) [m] of lines.
    """

    name: str
    kind: Kind
    action: Action = Action.ADD
    pose: tuple[float, float, float] = (0.0, 0.0, 0.0)
    scale: tuple[float, float, float] = (0.1, 0.0, 0.0)
    colour: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    points: Floats = field(default_factory=lambda: np.zeros((0, 2)))

    def fields(self, frame_id: str, stamp_ns: int) -> dict[str, Any]:
        """Return the fields of `layouts.MARKER`."""
        points = np.column_stack((self.points, np.zeros(len(self.points))))
        given = {
            "stamp": stamp_ns,
            "frame_id": frame_id,
            "points": points,
            "pose": pose_rows(np.array([self.pose])),
        }
        return given | {
            name: getattr(self, name) for name in ("name", "kind", "action", "scale", "colour")
        }


def encode_footprint(vehicle: Vehicle, stamp_ns: int, frame_id: str) -> bytes:
    """Return the footprint in the vehicle's frame.

    Four corners, counter-clockwise from the front left [m].
    """
    x, y = 0.5 * vehicle.length, 0.5 * vehicle.width
    corners = ((x, y, 0.0), (-x, y, 0.0), (-x, -y, 0.0), (x, -y, 0.0))
    return encode(POLYGON, stamp=stamp_ns, frame_id=frame_id, points=corners)


def body(
    name: str,
    vehicle: Vehicle,
    pose: tuple[float, float, float],
    colour: tuple[float, ...],
    alpha: float,
) -> Marker:
    """Return a box for a vehicle at a pose [m, rad], a cylinder for a pedestrian.

    Exposed road users are yellow.
    """
    kind = vehicle.kind
    if kind.width < 1.0 and colour != EGO_RGB:
        colour = (1.0, 0.84, 0.0)
    red, green, blue = colour
    return Marker(
        f"box_{name}",
        Kind.CYLINDER if kind.walks else Kind.CUBE,
        pose=pose,
        scale=(vehicle.length, vehicle.width, kind.height),
        colour=(red, green, blue, alpha),
    )


def scenario_markers(scenario: Scenario, stamp_ns: int) -> bytes:
    """Return a scenario as a MarkerArray that replaces the previous one.

    Each path with its vehicle at the start.
    """
    markers = [_delete_all()]
    names = tokens(scenario.ids)
    for k, (name, vehicle) in enumerate(zip(names, scenario.vehicles, strict=True)):
        first, last = scenario.present[k].tolist()
        colour = COLOURS_RGB[k % len(COLOURS_RGB)]
        path = scenario.position[k, first : last + 1]
        x, y = path[0].tolist()
        markers.append(
            Marker(
                f"path_{name}",
                Kind.LINE_STRIP,
                scale=(0.15, 0.0, 0.0),
                colour=(*colour, 0.6),
                points=path,
            )
        )
        markers.append(body(name, vehicle, (x, y, float(scenario.heading[k, 0])), colour, 0.8))
    return encode_markers(markers, scenario.frame_id, stamp_ns)


def vehicle_markers(
    vehicles: Sequence[Vehicle],
    states: Floats,
    present: Bools,
    ego: int,
    frame_id: str,
    stamp_ns: int,
) -> bytes:
    """Return the present vehicles, states (N, 3+) x, y [m], yaw [rad], as boxes.

    They replace all previous boxes.
    """
    names = tokens(vehicle.id for vehicle in vehicles)
    markers = [_delete_all()]
    for k in np.flatnonzero(present).tolist():
        x, y, yaw = states[k, :3].tolist()
        colour = EGO_RGB if k == ego else COLOURS_RGB[k % len(COLOURS_RGB)]
        markers.append(body(names[k], vehicles[k], (x, y, yaw), colour, 0.9))
    return encode_markers(markers, frame_id, stamp_ns)


def road_markers(network: LaneNetwork | None, frame_id: str, stamp_ns: int) -> bytes:
    """Return the markings of a road's lanes as a MarkerArray that replaces the previous one."""
    markers = [_delete_all()]
    for kind, lines in (markings(network) if network is not None else {}).items():
        width, *dashes = PAINT[kind]
        points = [_segments(line, *dashes) for line in lines]
        if points:
            marker = Marker(
                kind,
                Kind.LINE_LIST,
                scale=(width, 0.0, 0.0),
                colour=(1.0, 1.0, 1.0, 0.9),
                points=np.concatenate(points),
            )
            markers.append(marker)
    return encode_markers(markers, frame_id, stamp_ns)


def _delete_all() -> Marker:
    """Return a marker that deletes all previous ones of its topic."""
    return Marker("", Kind.CUBE, Action.DELETE_ALL, scale=(1.0, 1.0, 1.0))


def _segments(line: Floats, dash: float = 0.0, gap: float = 0.0) -> Floats:
    """Return the ends (2K, 2) [m] of each edge of a line (M, 2), or of each dash along it."""
    if not dash:
        return line[np.repeat(np.arange(len(line)), 2)[1:-1]]
    curve = Curve.through(line)
    begin = np.arange(0.0, curve.length, dash + gap)
    end = np.minimum(begin + dash, curve.length)
    return curve.at(np.column_stack((begin, end)).ravel())[:, :2]


def encode_markers(markers: Sequence[Marker], frame_id: str, stamp_ns: int) -> bytes:
    """Return markers as CDR bytes of a MarkerArray."""
    return encode(MARKERS, markers=[marker.fields(frame_id, stamp_ns) for marker in markers])
