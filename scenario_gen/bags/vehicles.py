# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Vehicles in messages of other programs: fixes, twists, odometry, poses, and tracked objects.

TrackedObjects of Autoware's perception (autoware_perception_msgs):

| quantity | field | unit |
|---|---|---|
| stamp, frame | header | |
| id | objects[].object_id | UUID, written as hexadecimal digits |
| class | objects[].classification[]: the most probable label | |
| position, heading | objects[].kinematics.pose_with_covariance.pose: the shape's centre | m |
| speed | objects[].kinematics.twist_with_covariance.twist.linear, in its frame | m/s |
| length, width | objects[].shape.dimensions.x, y | m |
"""

from dataclasses import dataclass
from enum import IntEnum
import math
from operator import attrgetter
from typing import Any

import numpy as np

from msg_conventions import odometry, topics, tracks, trajectory
from msg_conventions.streams import speed_of
from msg_conventions.yaw import yaw
from scenario_gen.bags.storage.definitions import TRACKED, type_store
from scenario_gen.base.errors import guarded
from scenario_gen.types import Encounter

FIX, TWIST, ODOMETRY, TRACKS = topics.FIX_TYPE, topics.TWIST_TYPE, odometry.TYPE, trajectory.TYPE
POSE = "geometry_msgs/msg/PoseStamped"
POSE_WITH_COVARIANCE = "geometry_msgs/msg/PoseWithCovarianceStamped"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
KINDS = [
    "unknown",
    "car",
    "truck",
    "bus",
    "trailer",
    "motorcycle",
    "bicycle",
    "pedestrian",
]  # by label
_MIN_DIRECTION_MPS = 0.5  # a slower velocity does not show which way an object faces


class _Orientation(IntEnum):
    """Values of orientation_availability."""

    UNAVAILABLE = 0
    SIGN_UNKNOWN = 1


@dataclass(frozen=True)
class Sample:
    """The state of one vehicle in one message.

    Attributes:
        stamp_ns: of its header, or 0.
        position: latitude and longitude [degrees], or x and y [m]; NaN without a fix, None of a
            TwistStamped.
        heading: [rad], or NaN.
        height: [m], or NaN.
        speed: [m/s], or None.
        course: direction of the velocity of a TwistStamped in its own frame [rad], or NaN.
        frame: of the position, or "".
        child: frame whose pose it is, or "".
    """

    stamp_ns: int
    position: tuple[float, float] | None = None
    heading: float = math.nan
    height: float = math.nan
    speed: float | None = None
    course: float = math.nan
    frame: str = ""
    child: str = ""


@dataclass(frozen=True)
class TrackedObject:
    """A tracked object: position [m], heading [rad] or NaN, speed [m/s], length and width [m]."""

    id: str
    kind: str
    position: tuple[float, float]
    heading: float
    height: float
    speed: float
    size: tuple[float, float]


def decode_samples(data: bytes, kind: str, place: str) -> list[Sample]:
    """Return the states in a message of any type of `decode_sample`, or TRANSFORMS.

    Raises:
        InputError: it is damaged; names `place`.
    """
    if kind != TRANSFORMS:
        return [decode_sample(data, kind, place)]
    with guarded(f"{place}: not a {kind}"):
        message = type_store().deserialize_cdr(data, kind)
    return [
        Sample(
            entry.header.stamp.sec * 10**9 + entry.header.stamp.nanosec,
            (entry.transform.translation.x, entry.transform.translation.y),
            _yaw(entry.transform.rotation),
            entry.transform.translation.z,
            frame=entry.header.frame_id,
            child=entry.child_frame_id,
        )
        for entry in message.transforms
    ]


def decode_sample(data: bytes, kind: str, place: str) -> Sample:
    """Return the state in a message of type FIX, TWIST, ODOMETRY, POSE or POSE_WITH_COVARIANCE.

    Raises:
        InputError: it is damaged; names `place`.
    """
    message, stamp = _decode(data, kind, place)
    if kind == FIX:
        has_fix = message.status.status >= 0
        position = (message.latitude, message.longitude) if has_fix else (math.nan, math.nan)
        return Sample(stamp, position, height=message.altitude)
    if kind == TWIST:
        linear = message.twist.linear
        course = math.atan2(linear.y, linear.x) if linear.y else math.nan
        return Sample(stamp, speed=speed_of(linear.x, linear.y), course=course)
    pose = message.pose if kind == POSE else message.pose.pose
    if kind in (POSE, POSE_WITH_COVARIANCE):
        position = (pose.position.x, pose.position.y)
        return Sample(
            stamp, position, _heading(pose), pose.position.z, frame=message.header.frame_id
        )
    linear = message.twist.twist.linear  # in the body frame
    return Sample(
        stamp,
        (pose.position.x, pose.position.y),
        _heading(pose),
        pose.position.z,
        np.hypot(linear.x, linear.y),
        frame=message.header.frame_id,
        child=message.child_frame_id,
    )


def decode_tracks(data: bytes, place: str) -> Encounter:
    """Return the encounter in a message of type TRACKS.

    Raises:
        InputError: it is damaged, or not an encounter; names `place`.
    """
    return tracks.decode_tracks(data, place)


def decode_tracked(data: bytes, place: str) -> tuple[int, str, list[TrackedObject]]:
    """Return stamp [ns], frame and objects of a message of type TRACKED.

    Raises:
        InputError: it is damaged; names `place`.
    """
    message, stamp = _decode(data, TRACKED, place)
    return stamp, message.header.frame_id, [_object(entry) for entry in message.objects]


def _decode(data: bytes, kind: str, place: str) -> tuple[Any, int]:
    """Return a message and the stamp [ns] of its header."""
    store = type_store()
    with guarded(f"{place}: not a {kind}"):
        message = store.deserialize_cdr(data, kind)
    return message, message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def _heading(pose: Any) -> float:
    return _yaw(pose.orientation)


def _yaw(turn: Any) -> float:
    return float(yaw(np.array([turn.x, turn.y, turn.z, turn.w])))


def _object(entry: Any) -> TrackedObject:
    likely = max(entry.classification, key=attrgetter("probability"), default=None)
    label = int(likely.label) if likely is not None else 0
    pose = entry.kinematics.pose_with_covariance.pose
    linear = entry.kinematics.twist_with_covariance.twist.linear
    heading = _heading(pose)
    orientation = int(entry.kinematics.orientation_availability)
    if orientation == _Orientation.UNAVAILABLE or (
        orientation == _Orientation.SIGN_UNKNOWN and abs(linear.x) < _MIN_DIRECTION_MPS
    ):
        heading = math.nan
    elif orientation == _Orientation.SIGN_UNKNOWN and linear.x < 0.0:
        heading += math.pi
    return TrackedObject(
        id=bytes(np.asarray(entry.object_id.uuid, dtype=np.uint8)).hex(),
        kind=KINDS[label] if label < len(KINDS) else KINDS[0],
        position=(float(pose.position.x), float(pose.position.y)),
        heading=heading,
        height=float(pose.position.z),
        speed=np.hypot(float(linear.x), float(linear.y)),
        size=(float(entry.shape.dimensions.x), float(entry.shape.dimensions.y)),
    )
