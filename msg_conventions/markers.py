# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""visualization_msgs/Marker, lines, boxes and texts that RViz and Foxglove draw."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from msg_conventions.poses import pose_rows
from scenario_gen.numerics import Floats

TYPE = "visualization_msgs/msg/Marker"
ARRAY_TYPE = "visualization_msgs/msg/MarkerArray"
CUBE, CYLINDER, LINE_STRIP, LINE_LIST, TEXT = (
    1,
    3,
    4,
    5,
    9,
)  # types; a text faces who looks, its scale ends in its height
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

    def fields(self, frame_id: str, stamp_ns: int) -> dict[str, Any]:
        """Return the marker's fields, as `layouts.MARKER` has them."""
        points = np.column_stack((self.points, np.zeros(len(self.points))))
        given = {
            "stamp": stamp_ns,
            "frame_id": frame_id,
            "points": points,
            "pose": pose_rows(np.array([self.pose])),
        }
        return given | {
            name: getattr(self, name)
            for name in ("name", "kind", "action", "scale", "colour", "text")
        }
