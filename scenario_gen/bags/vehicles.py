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

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
import math
from operator import attrgetter
import struct
from typing import Any, NamedTuple

import numpy as np

from msg_conventions import odometry, topics, tracks, trajectory
from msg_conventions.yaw import yaw
from scenario_gen.bags.storage.definitions import TRACKED, type_store
from scenario_gen.base.errors import guarded, InputError
from scenario_gen.numerics import Floats, Ints
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


class _Layout(NamedTuple):
    """How a message with a header ends: its strings, and a part of a fixed length in bytes."""

    n_strings: int
    size: int


_LAYOUTS = {
    FIX: _Layout(1, 8 * 12 + 1),  # place, covariance and its type; before them the status
    TWIST: _Layout(1, 8 * 6),
    ODOMETRY: _Layout(2, 8 * (7 + 36 + 6 + 36)),
    POSE: _Layout(1, 8 * 7),
    POSE_WITH_COVARIANCE: _Layout(1, 8 * (7 + 36)),
}
_HEAD_BYTES = 4  # of CDR: byte order and options; alignment counts from here
_STAMP_BYTES = 8
_BEFORE_LINEAR_COUNT = 7 + 36  # doubles before the linear velocity of an Odometry


def decode_samples(data: Sequence[bytes], kind: str, place: Callable[[int], str]) -> list[Samples]:
    """Return the states of each body in messages of a type with vehicles.

    Args:
        data: CDR of the messages.
        kind: their type: FIX, TWIST, ODOMETRY, POSE, POSE_WITH_COVARIANCE, TRANSFORMS or TRACKED.
        place: names the message with a number.

    Raises:
        InputError: one is damaged; names it.
    """
    if kind not in _LAYOUTS:
        return _varying(data, kind, place)
    size = _LAYOUTS[kind].size
    groups: dict[tuple[int, bytes, bytes], list[int]] = {}
    for row, message in enumerate(data):
        begin = _HEAD_BYTES + (len(message) - _HEAD_BYTES - size) // 8 * 8
        head = message[_HEAD_BYTES + _STAMP_BYTES : max(begin, 0)]
        groups.setdefault((begin, message[:2], head), []).append(row)
    return [_samples(data, rows, kind, begin, place) for (begin, _, _), rows in groups.items()]


def _samples(
    data: Sequence[bytes], rows: list[int], kind: str, begin: int, place: Callable[[int], str]
) -> Samples:
    """Return the states in messages whose texts are the same and whose doubles begin at a byte.

    Raises:
        InputError: they are damaged.
    """
    first = data[rows[0]]
    order = "<" if first[1:2] == b"\1" else ">"

    def numbers(type_of: str, start: int, count: int) -> Any:
        dtype = np.dtype(order + type_of)
        end = start + count * dtype.itemsize
        parts = b"".join([data[row][start:end] for row in rows])
        return np.frombuffer(parts, dtype).reshape(-1, count).astype(float)

    with guarded(f"{place(rows[0])}: not a {kind}", struct.error, UnicodeDecodeError):
        texts, end = _texts(first, order, _LAYOUTS[kind].n_strings)
    behind = end
    if kind == FIX:  # a status of one byte, and an aligned service of two
        behind += 3 + (end + 1) % 2
    if begin != behind + (_HEAD_BYTES - behind) % 8:
        raise InputError(f"{place(rows[0])}: not a {kind}")
    n = len(rows)
    unknown = np.full(n, np.nan)
    heading = course = height = unknown
    fix = speed = None
    if kind == FIX:
        is_fixed = int.from_bytes(first[end : end + 1], signed=True) >= 0
        places = numbers("f8", begin, 3)
        fix, height = np.where(is_fixed, places[:, :2], np.nan), places[:, 2]
    elif kind == TWIST:
        x, y = numbers("f8", begin, 2).T
        speed = np.where(y == 0.0, x, np.hypot(x, y))
        course = np.where(y == 0.0, np.nan, np.arctan2(y, x))
    else:
        pose = numbers("f8", begin, 7)
        fix, height, heading = pose[:, :2], pose[:, 2], yaw(pose[:, 3:])
    if kind == ODOMETRY:
        speed = np.hypot(
            *numbers("f8", begin + 8 * _BEFORE_LINEAR_COUNT, 2).T
        )  # in the body frame
    seconds = numbers("i4", _HEAD_BYTES, 1).astype(np.int64)
    nanoseconds = numbers("u4", _HEAD_BYTES + 4, 1).astype(np.int64)
    return Samples(
        frame=texts[0] if kind not in (FIX, TWIST) else "",
        child=texts[1] if len(texts) > 1 else "",
        row=np.array(rows, dtype=np.int64),
        stamp_ns=(seconds * 10**9 + nanoseconds)[:, 0],
        fix=fix,
        heading=heading,
        height=height,
        speed=speed,
        course=course,
        size=np.full(2, np.nan),
    )


def _texts(message: bytes, order: str, count: int) -> tuple[list[str], int]:
    """Return the first texts after a stamp, and the byte behind them.

    Raises:
        struct.error: the message is shorter.
        UnicodeDecodeError: a text is damaged.
    """
    end = _HEAD_BYTES + _STAMP_BYTES
    texts = []
    for _ in range(count):
        end += -end % 4
        (length,) = struct.unpack_from(f"{order}I", message, end)
        texts.append(message[end + 4 : end + 3 + length].decode())
        end += 4 + length
    return texts, end


class _State(NamedTuple):
    """The state of a body in one message; see `Samples`."""

    row: int
    stamp_ns: int
    x: float
    y: float
    heading: float
    height: float
    speed: float = math.nan
    length: float = math.nan
    width: float = math.nan


def _varying(data: Sequence[bytes], kind: str, place: Callable[[int], str]) -> list[Samples]:
    """Return the states of each body in messages with lists of bodies.

    Raises:
        InputError: one is damaged; names it.
    """
    store = type_store()
    states: dict[tuple[str, str], list[_State]] = {}
    labels: dict[tuple[str, str], list[str]] = {}
    for row, message in enumerate(data):
        with guarded(f"{place(row)}: not a {kind}"):
            decoded = store.deserialize_cdr(message, kind)
        for entry in decoded.objects if kind == TRACKED else decoded.transforms:
            header = decoded.header if kind == TRACKED else entry.header
            stamp_ns = header.stamp.sec * 10**9 + header.stamp.nanosec
            if kind == TRACKED:
                child, label, values = _object(entry)
                labels.setdefault((header.frame_id, child), []).append(label)
            else:
                child, moved = entry.child_frame_id, entry.transform.translation
                values = (moved.x, moved.y, _yaw(entry.transform.rotation), moved.z)
            states.setdefault((header.frame_id, child), []).append(_State(row, stamp_ns, *values))
    return [
        _joined(*body, entries, kind == TRACKED, labels.get(body, [""]))
        for body, entries in states.items()
    ]


def _joined(
    frame: str, child: str, states: Sequence[_State], has_speed: bool, labels: Sequence[str]
) -> Samples:
    """Return the states of one body."""
    values = np.array([state[2:] for state in states], dtype=float)
    return Samples(
        frame,
        child,
        row=np.array([state.row for state in states], dtype=np.int64),
        stamp_ns=np.array([state.stamp_ns for state in states], dtype=np.int64),
        fix=values[:, :2],
        heading=values[:, 2],
        height=values[:, 3],
        speed=values[:, 4] if has_speed else None,
        course=np.full(len(values), np.nan),
        size=np.median(values[:, 5:], axis=0),
        kind=max(labels, key=labels.count),
    )


def decode_tracks(data: bytes, place: str) -> Encounter:
    """Return the encounter in a message of type TRACKS.

    Raises:
        InputError: it is damaged, or not an encounter; names `place`.
    """
    return tracks.decode_tracks(data, place)


def _yaw(turn: Any) -> float:
    return float(yaw(np.array([turn.x, turn.y, turn.z, turn.w])))


def _object(entry: Any) -> tuple[str, str, tuple[float, ...]]:
    """Return id, kind, and x, y, heading, height, speed, length and width of a tracked object."""
    likely = max(entry.classification, key=attrgetter("probability"), default=None)
    label = int(likely.label) if likely is not None else 0
    pose = entry.kinematics.pose_with_covariance.pose
    linear = entry.kinematics.twist_with_covariance.twist.linear
    heading = _yaw(pose.orientation)
    orientation = int(entry.kinematics.orientation_availability)
    if orientation == _Orientation.UNAVAILABLE or (
        orientation == _Orientation.SIGN_UNKNOWN and abs(linear.x) < _MIN_DIRECTION_MPS
    ):
        heading = math.nan
    elif orientation == _Orientation.SIGN_UNKNOWN and linear.x < 0.0:
        heading += math.pi
    name = bytes(np.asarray(entry.object_id.uuid, dtype=np.uint8)).hex()
    kind = KINDS[label] if label < len(KINDS) else KINDS[0]
    size = entry.shape.dimensions
    speed = math.hypot(linear.x, linear.y)
    state = (pose.position.x, pose.position.y, heading, pose.position.z, speed, size.x, size.y)
    return name, kind, state
