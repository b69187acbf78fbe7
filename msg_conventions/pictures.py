# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What RViz and Foxglove draw: footprints (geometry_msgs/PolygonStamped) and markers (visualization_msgs/MarkerArray).

Only for looking at; nothing is read back but the footprint. Frame: that of the vehicles drawn. QoS: reliable, transient_local.
"""

import numpy as np

from msg_conventions.cdr import CdrReader, CdrWriter
from msg_conventions.roads import pose_rows
from scenario_gen.numerics import Floats
from scenario_gen.types import Scenario, tokens, Vehicle

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


def scenario_markers(scenario: Scenario, stamp_ns: int) -> bytes:
    """Return one scenario as a MarkerArray that replaces the one before: a line along each path, a box where it begins."""
    names = tokens(vehicle.id for vehicle in scenario.vehicles)
    writer = CdrWriter().pack("I", 1 + 2 * len(names))

    def add(
        namespace: str,
        kind: int,
        scale: tuple[float, ...] = (0.1, 0.0, 0.0),
        colour: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0),
        pose: tuple[float, ...] = (0.0, 0.0, 0.0),
        *,
        action: int = 0,
        points: Floats | None = None,
    ) -> None:
        writer.header(stamp_ns, scenario.frame_id).string(namespace).pack("i", 0, kind, action)
        writer.pack("d", *pose_rows(np.array([pose]))[0]).pack("d", *scale)
        writer.pack("f", *colour).stamp(0).pack("B", 0)
        writer.pack("I", 0 if points is None else len(points))
        if points is not None:
            writer.align(8).raw(np.column_stack([points, np.zeros(len(points))]).tobytes())
        writer.pack("I", 0)  # colours
        writer.string("").header(0, "").string("").pack("I", 0)  # texture: resource, image header, format, bytes
        writer.pack("I", 0)  # uv coordinates
        writer.string("").string("").string("").pack("I", 0)  # text; mesh resource; mesh file: name and bytes
        writer.pack("B", 0)

    add("", 0, action=DELETE_ALL)
    for k, (name, vehicle) in enumerate(zip(names, scenario.vehicles, strict=True)):
        first, last = scenario.present[k].tolist()
        colour, path = COLOURS[k % len(COLOURS)], scenario.position[k, first : last + 1]
        start = (*path[0].tolist(), float(scenario.heading[k, 0]))
        add(f"path_{name}", LINE_STRIP, (0.15, 0.0, 0.0), (*colour, 0.6), points=path)
        add(f"box_{name}", CUBE, (vehicle.length, vehicle.width, 1.5), (*colour, 0.8), start)
    return writer.finish()
