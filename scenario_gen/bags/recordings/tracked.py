# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Tracked objects of Autoware's perception (autoware_perception_msgs/TrackedObjects), decoded by rosbags.

| quantity | field | unit |
|---|---|---|
| stamp, frame | header | |
| id | objects[].object_id | UUID, written as hexadecimal digits |
| class | objects[].classification[]: the label with the highest probability | |
| position, heading | objects[].kinematics.pose_with_covariance.pose: the middle of the shape | m |
| speed | objects[].kinematics.twist_with_covariance.twist.linear, in the object's own frame | m/s |
| length, width | objects[].shape.dimensions.x, y | m |

Source: the .msg files of autoware_perception_msgs (autowarefoundation/autoware_msgs), given below.
"""

from dataclasses import dataclass
from functools import cache
import math
from typing import Any

import numpy as np

from msg_conventions.yaw import yaw
from scenario_gen.base.errors import guarded
from scenario_gen.numerics import exact

TRACKED = "autoware_perception_msgs/msg/TrackedObjects"
LABELS = ("unknown", "car", "truck", "bus", "trailer", "motorcycle", "bicycle", "pedestrian")
VEHICLES = ("car", "truck", "bus", "trailer")
UNAVAILABLE, SIGN_UNKNOWN = 0, 1  # of orientation_availability
_SLOW = 0.5  # m/s: below, a velocity does not tell which way an object faces

DEFINITIONS = {
    "unique_identifier_msgs/msg/UUID": "uint8[16] uuid\n",
    "autoware_perception_msgs/msg/ObjectClassification": "uint8 label\nfloat32 probability\n",
    "autoware_perception_msgs/msg/Shape": "uint8 type\ngeometry_msgs/Polygon footprint\ngeometry_msgs/Vector3 dimensions\n",
    "autoware_perception_msgs/msg/TrackedObjectKinematics": (
        "geometry_msgs/PoseWithCovariance pose_with_covariance\ngeometry_msgs/TwistWithCovariance twist_with_covariance\n"
        "geometry_msgs/AccelWithCovariance acceleration_with_covariance\nuint8 orientation_availability\nbool is_stationary\n"
    ),
    "autoware_perception_msgs/msg/TrackedObject": (
        "unique_identifier_msgs/UUID object_id\nfloat32 existence_probability\n"
        "autoware_perception_msgs/ObjectClassification[] classification\n"
        "autoware_perception_msgs/TrackedObjectKinematics kinematics\nautoware_perception_msgs/Shape shape\n"
    ),
    TRACKED: "std_msgs/Header header\nautoware_perception_msgs/TrackedObject[] objects\n",
}


@dataclass(frozen=True)
class Tracked:
    """One object: position [m], heading [rad] or NaN, speed [m/s], length and width [m] as said."""

    id: str
    kind: str
    position: tuple[float, float]
    heading: float
    speed: float
    size: tuple[float, float]


@cache
def store() -> Any:
    """Return rosbags' types of Jazzy and those of this message."""
    from rosbags.typesys import get_types_from_msg, get_typestore, Stores

    types = get_typestore(Stores.ROS2_JAZZY)
    found: dict[str, Any] = {}
    for name, text in DEFINITIONS.items():
        if name not in types.types:
            found |= get_types_from_msg(text, name)
    types.register(found)
    return types


def decode_tracked(data: bytes, what: str) -> tuple[int, str, list[Tracked]]:
    """Return stamp [ns], frame and objects of a message.

    Raises:
        InputError: naming `what`, it is damaged.
    """
    with guarded(f"{what}: not a {TRACKED}"):
        message = store().deserialize_cdr(data, TRACKED)
    stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
    return stamp, message.header.frame_id, [_tracked(thing) for thing in message.objects]


def _tracked(thing: Any) -> Tracked:
    best = max(thing.classification, key=lambda one: float(one.probability), default=None)
    label = int(best.label) if best is not None else 0
    kinematics = thing.kinematics
    pose, linear = kinematics.pose_with_covariance.pose, kinematics.twist_with_covariance.twist.linear
    turn = pose.orientation
    heading = float(yaw(np.array([turn.x, turn.y, turn.z, turn.w])))
    known = int(kinematics.orientation_availability)
    if known == UNAVAILABLE or (known == SIGN_UNKNOWN and abs(linear.x) < _SLOW):
        heading = math.nan
    elif known == SIGN_UNKNOWN and linear.x < 0.0:
        heading += math.pi
    return Tracked(
        id=bytes(np.asarray(thing.object_id.uuid, dtype=np.uint8)).hex(),
        kind=LABELS[label] if label < len(LABELS) else LABELS[0],
        position=(float(pose.position.x), float(pose.position.y)),
        heading=heading,
        speed=exact.hypot(float(linear.x), float(linear.y)),
        size=(float(thing.shape.dimensions.x), float(thing.shape.dimensions.y)),
    )
