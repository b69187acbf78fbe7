# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What RViz and Foxglove draw: footprints (geometry_msgs/PolygonStamped) and markers (visualization_msgs/MarkerArray).

Only for looking at; nothing is read back but the footprint. Frame: that of the vehicles drawn. QoS: reliable, transient_local.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from msg_conventions.cdr import CdrReader, CdrWriter
from msg_conventions.roads import pose_rows
from scenario_gen.arrays import Floats
from scenario_gen.types.encounter import Vehicle
from scenario_gen.types.names import tokens
from scenario_gen.types.scenario import Scenario

FOOTPRINT_TYPE = "geometry_msgs/msg/PolygonStamped"
MARKERS_TYPE = "visualization_msgs/msg/MarkerArray"
CUBE, LINE_STRIP, DELETE_ALL = 1, 4, 3
COLOURS = ((0.12, 0.47, 0.71), (0.84, 0.15, 0.16), (0.17, 0.63, 0.17), (1.0, 0.5, 0.05), (0.58, 0.4, 0.74), (0.55, 0.34, 0.29))


def encode_footprint(vehicle: Vehicle, stamp_ns: int, frame_id: str) -> bytes:
    """Return the footprint in the vehicle's own frame: four corners, counter-clockwise from front left, metres, float32."""
    x, y = 0.5 * vehicle.length, 0.5 * vehicle.width
    writer = CdrWriter().header(stamp_ns, frame_id).pack("I", 4)
    return writer.pack("f", x, y, 0.0, -x, y, 0.0, -x, -y, 0.0, x, -y, 0.0).finish()


def decode_footprint(data: bytes, what: str = "footprint") -> Floats:
    """Return corners (n, 2) [m].

    Raises:
        InputError: the message is damaged.
    """
    reader = CdrReader(data, what)
    reader.header()
    count = reader.count()
    return reader.array("<f4", 3 * count, 4).reshape(count, 3)[:, :2].astype(np.float64)


@dataclass(frozen=True)
class Marker:
    """One visualization_msgs/Marker: a box at `pose`, or a line through `points` (M, 2+)."""

    namespace: str
    id: int
    kind: int
    pose: tuple[float, float, float] = (0.0, 0.0, 0.0)
    scale: tuple[float, float, float] = (0.1, 0.0, 0.0)
    colour: tuple[float, float, float] = (1.0, 1.0, 1.0)
    alpha: float = 1.0
    points: Floats | None = None
    text: str = ""


def encode_markers(markers: Sequence[Marker], stamp_ns: int, frame_id: str, *, clear: bool = True) -> bytes:
    """Return a MarkerArray as CDR bytes; `clear` first deletes what was drawn before."""
    writer = CdrWriter().pack("I", len(markers) + clear)
    if clear:
        _marker(writer, Marker("", 0, 0), stamp_ns, frame_id, action=DELETE_ALL)
    for marker in markers:
        _marker(writer, marker, stamp_ns, frame_id, action=0)
    return writer.finish()


def _marker(writer: CdrWriter, marker: Marker, stamp_ns: int, frame_id: str, *, action: int) -> None:
    writer.header(stamp_ns, frame_id).string(marker.namespace).pack("i", marker.id, marker.kind, action)
    writer.pack("d", *pose_rows(np.array([marker.pose]))[0]).pack("d", *marker.scale)
    writer.pack("f", *marker.colour, marker.alpha).stamp(0).pack("B", 0)
    points = np.zeros((0, 2)) if marker.points is None else marker.points
    writer.pack("I", len(points))
    if len(points):
        writer.align(8).raw(np.column_stack([points[:, :2], np.zeros(len(points))]).tobytes())
    writer.pack("I", 0)  # colours
    writer.string("").header(0, "").string("").pack("I", 0)  # texture: resource, image header, format, bytes
    writer.pack("I", 0)  # uv coordinates
    writer.string(marker.text).string("").string("").pack("I", 0)  # mesh resource; mesh file: name and bytes
    writer.pack("B", 0)


def scenario_markers(scenario: Scenario, stamp_ns: int) -> bytes:
    """Return one scenario as a MarkerArray: a line along each path, a box at its start."""
    names = tokens(vehicle.id for vehicle in scenario.vehicles)
    markers: list[Marker] = []
    for k, (name, vehicle) in enumerate(zip(names, scenario.vehicles, strict=True)):
        colour = COLOURS[k % len(COLOURS)]
        x, y = scenario.position[k, 0]
        size = (vehicle.length, vehicle.width, 1.5)
        markers += [
            Marker(f"path_{name}", 0, LINE_STRIP, scale=(0.15, 0.0, 0.0), colour=colour, alpha=0.6, points=scenario.position[k]),
            Marker(f"box_{name}", 0, CUBE, (float(x), float(y), float(scenario.heading[k, 0])), size, colour, 0.8),
        ]
    return encode_markers(markers, stamp_ns, scenario.frame_id)
