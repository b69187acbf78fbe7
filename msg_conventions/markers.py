# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""visualization_msgs/Marker: lines and boxes for RViz and Foxglove."""

from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np

from msg_conventions.poses import pose_rows
from scenario_gen.numerics import Floats

TYPE = "visualization_msgs/msg/Marker"
ARRAY_TYPE = "visualization_msgs/msg/MarkerArray"


class Kind(IntEnum):
    """Types of markers."""

    CUBE = 1
    CYLINDER = 3
    LINE_STRIP = 4
    LINE_LIST = 5


class Action(IntEnum):
    """Actions of markers."""

    ADD = 0
    DELETE = 2
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
