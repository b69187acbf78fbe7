# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""visualization_msgs/Marker, written field by field: lines, boxes and texts that RViz and Foxglove draw."""

from dataclasses import dataclass, field

import numpy as np

from msg_conventions.cdr import CdrWriter
from msg_conventions.poses import pose_rows
from scenario_gen.numerics import Floats

TYPE = "visualization_msgs/msg/Marker"
ARRAY_TYPE = "visualization_msgs/msg/MarkerArray"
CUBE, LINE_STRIP, LINE_LIST, TEXT = 1, 4, 5, 9  # types; a text faces who looks, its scale's last number is its height
ADD, DELETE, DELETE_ALL = 0, 2, 3  # actions


@dataclass(frozen=True, eq=False)
class Marker:
    """One marker of namespace `name` and id 0.

    Attributes:
        name: namespace.
        kind: type.
        action: what to do with it.
        pose: x [m], y [m], yaw [rad].
        scale: length, width, height of a box, or the width of a line first [m].
        colour: red, green, blue, alpha, from 0 to 1.
        points: (P, 2) [m] of lines.
        text: of a text; of others for programs.
    """

    name: str
    kind: int
    action: int = ADD
    pose: tuple[float, float, float] = (0.0, 0.0, 0.0)
    scale: tuple[float, float, float] = (0.1, 0.0, 0.0)
    colour: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    points: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    text: str = ""

    def write(self, writer: CdrWriter, frame_id: str, stamp_ns: int) -> CdrWriter:
        """Append the marker to a message."""
        writer.header(stamp_ns, frame_id).string(self.name).pack("i", 0, self.kind, self.action)
        writer.pack("d", *pose_rows(np.array([self.pose]))[0], *self.scale)
        writer.pack("f", *self.colour).stamp(0).pack("B", 0).pack("I", len(self.points))  # lifetime, frame_locked
        if len(self.points):
            writer.align(8).raw(np.column_stack((self.points, np.zeros(len(self.points)))).tobytes())
        writer.pack("I", 0)  # colours
        writer.string("").header(0, "").string("").pack("I", 0)  # texture: resource, image header, format, bytes
        writer.pack("I", 0)  # uv coordinates
        return writer.string(self.text).string("").string("").pack("I", 0).pack("B", 0)  # mesh: resource, file, bytes
