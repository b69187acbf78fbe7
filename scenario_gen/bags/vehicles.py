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

Encounters are messages of the topic `tracks` (type TRACKS).
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
import math
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from msg_conventions import layouts, topics, trajectory
from msg_conventions.cdr import decode
from msg_conventions.poses import FRAMES_TYPE, ODOMETRY_TYPE, yaw
from msg_conventions.tracks import decode_tracks, encode_tracks
from scenario_gen.bags.storage.definitions import TRACKED
from scenario_gen.numerics import Floats, Ints

__all__ = ["Samples", "decode_samples", "decode_tracks", "encode_tracks"]

FIX, TWIST, TRACKS = topics.FIX_TYPE, topics.TWIST_TYPE, trajectory.TYPE
ODOMETRY, TRANSFORMS = ODOMETRY_TYPE, FRAMES_TYPE
POSE = "geometry_msgs/msg/PoseStamped"
POSE_WITH_COVARIANCE = "geometry_msgs/msg/PoseWithCovarianceStamped"
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
_POSED = layouts.HEADER | {"pose": layouts.POSE}  # a covariance may follow
_LAYOUTS = {
    FIX: layouts.FIX,
    TWIST: layouts.VELOCITY_STAMPED,
    ODOMETRY: layouts.ODOMETRY,
    POSE: _POSED,
    POSE_WITH_COVARIANCE: _POSED,
    TRANSFORMS: layouts.TRANSFORMS,
    TRACKED: layouts.TRACKED,
}


class _Orientation(IntEnum):
    """Values of orientation_availability."""

    UNAVAILABLE = 0
    SIGN_UNKNOWN = 1


@dataclass(frozen=True, eq=False)
class Samples:
    """The states of one body in F messages of a topic.

    Attributes:
        frame: of the positions, or "".
        child: frame whose pose it is, or the id of a tracked object, or "".
        row: (F,) numbers of the messages.
        stamp_ns: (F,) of their headers, or 0.
        fix: (F, 2) latitude and longitude [degrees], or x and y [m]; NaN without a fix, None of
            TwistStamped.
        heading: (F,) [rad], or NaN.
        height: (F,) [m], or NaN.
        speed: (F,) [m/s]; None if they are not recorded.
        course: (F,) directions of the velocities of TwistStamped in their own frame [rad], or NaN.
        size: (2,) length and width [m], or NaN.
        kind: of a tracked object, or "".
    """

    frame: str
    child: str
    row: Ints
    stamp_ns: Ints
    fix: Floats | None
    heading: Floats
    height: Floats
    speed: Floats | None
    course: Floats
    size: Floats
    kind: str = ""


class _State(NamedTuple):
    """The state of a body in one message; see `Samples`. The pose is (7,), with a quaternion."""

    pose: Sequence[float]
    speed: float = math.nan
    course: float = math.nan
    turn: float = 0.0  # from the pose to the body [rad], NaN without a heading
    size: tuple[float, float] = (math.nan, math.nan)
    kind: str = ""


def decode_samples(data: Sequence[bytes], kind: str, place: Callable[[int], str]) -> list[Samples]:
    """Return the states of each body in messages of a type with vehicles.

    Args:
        data: CDR of the messages.
        kind: their type: FIX, TWIST, ODOMETRY, POSE, POSE_WITH_COVARIANCE, TRANSFORMS or TRACKED.
        place: names the message with a number.

    Raises:
        InputError: one is damaged; names it.
    """
    bodies: dict[tuple[str, str], list[tuple[int, int, _State]]] = {}
    for row, message in enumerate(data):
        decoded = decode(_LAYOUTS[kind], message, f"{place(row)}: not a {kind}")
        if kind == TRACKED:
            entries = [(decoded, entry) for entry in decoded.objects]
        elif kind == TRANSFORMS:
            entries = [(entry, entry) for entry in decoded.transforms]
        else:
            entries = [(decoded, decoded)]
        for header, entry in entries:
            frame, child, state = _state(entry, kind)
            body = (header.frame_id if frame else "", child)
            bodies.setdefault(body, []).append((row, header.stamp, state))
    return [_joined(*body, states, kind) for body, states in bodies.items()]


def _state(entry: Any, kind: str) -> tuple[bool, str, _State]:
    """Return whether positions are in the frame of the header, the body's name, and its state."""
    if kind == FIX:
        latitude, longitude, height = entry.place.tolist()
        if entry.status < 0:
            latitude = longitude = math.nan
        return False, "", _State((latitude, longitude, height, *(math.nan,) * 4))
    if kind == TWIST:
        x, y = entry.twist[:2].tolist()
        speed, course = (x, math.nan) if y == 0.0 else (np.hypot(x, y), np.arctan2(y, x))
        return False, "", _State((math.nan,) * 7, speed, course)
    pose = entry.pose.tolist()
    if kind == TRACKED:
        return True, bytes(entry.id).hex(), _object(entry, pose)
    speed = np.hypot(*entry.twist[:2]) if kind == ODOMETRY else math.nan  # in the body frame
    return True, getattr(entry, "child", ""), _State(pose, speed)


def _joined(
    frame: str, child: str, states: Sequence[tuple[int, int, _State]], kind: str
) -> Samples:
    """Return the states of one body."""
    row, stamp_ns = np.array([state[:2] for state in states], dtype=np.int64).T
    bodies = [body for _, _, body in states]
    poses = np.array([body.pose for body in bodies], dtype=float)
    speed, course, turn = np.array([body[1:4] for body in bodies], dtype=float).T
    return Samples(
        frame,
        child,
        row,
        stamp_ns,
        fix=None if kind == TWIST else poses[:, :2],
        heading=yaw(poses[:, 3:]) + turn,
        height=poses[:, 2],
        speed=speed if kind in (TWIST, ODOMETRY, TRACKED) else None,
        course=course,
        size=np.median([body.size for body in bodies], axis=0),
        kind=Counter(body.kind for body in bodies).most_common(1)[0][0],
    )


def _object(entry: Any, pose: Sequence[float]) -> _State:
    """Return the state of a tracked object."""
    likely = max(entry.classes, key=attrgetter("probability"), default=None)
    label = likely.label if likely is not None else 0
    x, y = entry.twist[:2].tolist()
    turn = 0.0
    if entry.orientation == _Orientation.UNAVAILABLE or (
        entry.orientation == _Orientation.SIGN_UNKNOWN and abs(x) < _MIN_DIRECTION_MPS
    ):
        turn = math.nan
    elif entry.orientation == _Orientation.SIGN_UNKNOWN and x < 0.0:
        turn = math.pi
    length, width, _ = entry.shape.dimensions.tolist()
    kind = KINDS[label] if label < len(KINDS) else KINDS[0]
    return _State(pose, math.hypot(x, y), math.nan, turn, (length, width), kind)
