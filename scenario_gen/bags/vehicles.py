# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Vehicles in the messages of others, of either byte order: fixes, twists and odometry of one, tracked objects of many.

TrackedObjects of Autoware's perception (autoware_perception_msgs) are read as follows:

| quantity | field | unit |
|---|---|---|
| stamp, frame | header | |
| id | objects[].object_id | UUID, written as hexadecimal digits |
| class | objects[].classification[]: the label with the highest probability | |
| position, heading | objects[].kinematics.pose_with_covariance.pose: the middle of the shape | m |
| speed | objects[].kinematics.twist_with_covariance.twist.linear, in the object's own frame | m/s |
| length, width | objects[].shape.dimensions.x, y | m |
"""

from dataclasses import dataclass
import math
from typing import Any

import numpy as np

from msg_conventions import odometry, topics, tracks, trajectory
from msg_conventions.streams import speed_of
from msg_conventions.yaw import yaw
from scenario_gen.bags.storage.definitions import TRACKED, type_store
from scenario_gen.base.errors import guarded
from scenario_gen.types import Encounter

FIX, TWIST, ODOMETRY, TRACKS = topics.FIX_TYPE, topics.TWIST_TYPE, odometry.TYPE, trajectory.TYPE
KINDS = (
    "unknown",
    "car",
    "truck",
    "bus",
    "trailer",
    "motorcycle",
    "bicycle",
    "pedestrian",
)  # by label
UNAVAILABLE, SIGN_UNKNOWN = 0, 1  # of orientation_availability
_SLOW = 0.5  # m/s: below, a velocity does not tell which way an object faces


@dataclass(frozen=True)
class Sample:
    """The state of one vehicle in one message.

    Attributes:
        stamp_ns: of its header, 0 if that bears none.
        position: latitude and longitude [degrees], or x and y [m]; NaN where there is no fix, None of a TwistStamped.
        heading: rad; NaN if it is not given.
        speed: m/s; None if it is not given.
        frame: of the position, "" if it is not given.
    """

    stamp_ns: int
    position: tuple[float, float] | None = None
    heading: float = math.nan
    speed: float | None = None
    frame: str = ""


@dataclass(frozen=True)
class TrackedObject:
    """One object of a perception: position [m], heading [rad] or NaN, speed [m/s], length and width [m]."""

    id: str
    kind: str
    position: tuple[float, float]
    heading: float
    speed: float
    size: tuple[float, float]


def decode_sample(data: bytes, kind: str, what: str) -> Sample:
    """Return the state in a message of type FIX, TWIST or ODOMETRY.

    Raises:
        InputError: naming `what`, it is damaged.
    """
    message, stamp = _decode(data, kind, what)
    if kind == FIX:
        known = message.status.status >= 0
        return Sample(
            stamp, (message.latitude, message.longitude) if known else (math.nan, math.nan)
        )
    if kind == TWIST:
        return Sample(stamp, speed=speed_of(message.twist.linear.x, message.twist.linear.y))
    pose, linear = message.pose.pose, message.twist.twist.linear  # the speed is in the body frame
    return Sample(
        stamp,
        (pose.position.x, pose.position.y),
        _heading(pose),
        np.hypot(linear.x, linear.y),
        message.header.frame_id,
    )


def decode_tracks(data: bytes, what: str) -> Encounter:
    """Return the encounter in a message of type TRACKS.

    Raises:
        InputError: naming `what`, it is damaged, or no encounter.
    """
    return tracks.decode_tracks(data, what)


def decode_tracked(data: bytes, what: str) -> tuple[int, str, list[TrackedObject]]:
    """Return stamp [ns], frame and objects of a message of type TRACKED.

    Raises:
        InputError: naming `what`, it is damaged.
    """
    message, stamp = _decode(data, TRACKED, what)
    return stamp, message.header.frame_id, [_object(entry) for entry in message.objects]


def _decode(data: bytes, kind: str, what: str) -> tuple[Any, int]:
    """Return a message and the stamp [ns] of its header."""
    store = type_store()
    with guarded(f"{what}: not a {kind}"):
        message = store.deserialize_cdr(data, kind)
    return message, message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def _heading(pose: Any) -> float:
    turn = pose.orientation
    return float(yaw(np.array([turn.x, turn.y, turn.z, turn.w])))


def _object(entry: Any) -> TrackedObject:
    best = max(
        entry.classification, key=lambda candidate: float(candidate.probability), default=None
    )
    label = int(best.label) if best is not None else 0
    kinematics = entry.kinematics
    pose, linear = (
        kinematics.pose_with_covariance.pose,
        kinematics.twist_with_covariance.twist.linear,
    )
    heading = _heading(pose)
    known = int(kinematics.orientation_availability)
    if known == UNAVAILABLE or (known == SIGN_UNKNOWN and abs(linear.x) < _SLOW):
        heading = math.nan
    elif known == SIGN_UNKNOWN and linear.x < 0.0:
        heading += math.pi
    return TrackedObject(
        id=bytes(np.asarray(entry.object_id.uuid, dtype=np.uint8)).hex(),
        kind=KINDS[label] if label < len(KINDS) else KINDS[0],
        position=(float(pose.position.x), float(pose.position.y)),
        heading=heading,
        speed=np.hypot(float(linear.x), float(linear.y)),
        size=(float(entry.shape.dimensions.x), float(entry.shape.dimensions.y)),
    )
