# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Route ⇄ `vehicle_<id>/route`, and plain paths (nav_msgs/Path).

Frame: the road's. `header.stamp`: the template's. A pose's stamp is the planned time: the
template's stamp at every anchor (start, changepoints, end), between anchors in proportion to arc
length. Equal consecutive poses are a dwell.
QoS: reliable, transient_local, depth 1. Arc length is not in the message; it is the sum of the
chords.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from msg_conventions import layouts
from msg_conventions.cdr import CdrReader, encode, HEADER
from msg_conventions.poses import poses_of
from msg_conventions.yaw import half_angle
from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Floats, Ints, NS_PER_S
from scenario_gen.numerics.plane import arc_lengths
from scenario_gen.types import Route

TYPE = "nav_msgs/msg/Path"
BEGIN = layouts.HEADER | {"count": "u4"}  # of poses


def encode_path(poses: Floats, stamps_ns: Ints, frame_id: str, stamp_ns: int) -> bytes:
    """Return (M, 3) x, y, yaw with their (M,) stamps as CDR bytes of a nav_msgs/Path.

    Raises:
        InputError: a value is not finite, or a stamp is no ROS time.
    """
    count = len(poses)
    if not count:
        return encode(BEGIN, stamp=stamp_ns, frame_id=frame_id)
    if not np.isfinite(poses).all():
        raise InputError("a path with a value that is not finite cannot be sent")
    seconds, nanoseconds = np.divmod(stamps_ns, NS_PER_S)
    if np.abs(seconds).max() >= 2**31:
        raise InputError(
            f"a path of stamp {stamp_ns} ns cannot be sent: a stamp does not fit a ROS time "
            "(until 2038)"
        )
    text = frame_id.encode() + b"\x00"
    begin = encode(BEGIN, stamp=stamp_ns, frame_id=frame_id, count=count)
    rows = np.zeros(count, dtype=_pose_type(len(text)))
    rows["sec"] = seconds
    rows["nanosec"] = nanoseconds
    rows["size"] = len(text)
    rows["frame"] = text
    pose = rows["pose"]
    pose[:, :2] = poses[:, :2]
    pose[:, 5], pose[:, 6] = half_angle(poses[:, 2])
    body = rows.tobytes()
    used = 12 + len(text)
    gap = (
        -(len(begin) - len(HEADER) + used) % 8
    )  # before the first pose, which may begin amid 8 bytes
    return b"".join((begin, body[:used], bytes(gap), body[used + -used % 8 :]))


@lru_cache(maxsize=16)
def _pose_type(size: int) -> np.dtype[np.void]:
    """Return the layout of a pose in a frame of `size` bytes.

    The pose begins and ends at a multiple of 8 bytes.
    """
    frame = size + -(12 + size) % 8
    return np.dtype(
        [
            ("sec", "<i4"),
            ("nanosec", "<u4"),
            ("size", "<u4"),
            ("frame", f"S{frame}"),
            ("pose", "<f8", (7,)),
        ]
    )


def decode_path(data: bytes, source: str = "path") -> tuple[int, str, Floats, Ints]:
    """Return stamp [ns], frame, poses (M, 3) and their stamps (M,) [ns].

    Raises:
        InputError: the message is damaged, or a pose is in another frame than the path.
    """
    stamp_ns, frame_id, stamps, frames, rows = read_path(data, source, framed=True)
    for k, frame in enumerate(frames):
        if frame not in (frame_id, ""):
            raise InputError(f"{source}: pose {k} is in frame {frame!r}, the path in {frame_id!r}")
    return stamp_ns, frame_id, poses_of(rows, source), stamps


def read_path(
    data: bytes, source: str, *, framed: bool = False
) -> tuple[int, str, Ints, list[str], Floats]:
    """Return stamp [ns] and frame, and each pose's stamp [ns], frame and wire row (7,).

    `framed` as in `decode`.

    Raises:
        InputError: the message is damaged.
    """
    reader = CdrReader(data, source)
    head = reader.fields(layouts.HEADER, framed=framed)
    count = reader.count(68)
    rows, stamps, frames = np.zeros((count, 7)), np.zeros(count, dtype=np.int64), []
    for k in range(count):
        stamps[k] = reader.stamp()
        frames.append(reader.string())
        rows[k] = reader.array("<f8", 7, 8)
    return head.stamp, head.frame_id, stamps, frames, rows


def encode_route(route: Route, anchors_ns: Sequence[int], frame_id: str) -> bytes:
    """Return the route as CDR bytes.

    `anchors_ns` (K + 2,) are the template's stamps at the anchors, the first its own.
    """
    index = [int(route.anchor[0])]
    stamps = [anchors_ns[0]]
    for k in range(1, len(route.anchor)):
        first, last = int(route.anchor[k - 1]), int(route.anchor[k])
        inner = np.arange(first + 1, last)
        span = route.length[last] - route.length[first]
        share = np.zeros(len(inner))
        if span > 0.0:
            share = (route.length[inner] - route.length[first]) / span
        duration = anchors_ns[k] - anchors_ns[k - 1]
        elapsed = np.clip(np.rint(share * duration).astype(np.int64), 1, duration - 1)
        index += [*inner.tolist(), last]
        stamps += [*(elapsed + anchors_ns[k - 1]).tolist(), anchors_ns[k]]
    stamps_ns = np.array(stamps, dtype=np.int64)
    return encode_path(route.points[index], stamps_ns, frame_id, anchors_ns[0])


def decode_route(
    data: bytes, anchors_ns: Sequence[int], source: str = "route"
) -> tuple[str, Route]:
    """Return the frame and the route.

    Raises:
        InputError: the message is damaged, bears another stamp, or has no pose at an anchor's
            stamp.
    """
    stamp_ns, frame_id, poses, stamps = decode_path(data, source)
    if stamp_ns != anchors_ns[0]:
        raise InputError(
            f"{source}: stamp {stamp_ns} ns is not that of the recording ({anchors_ns[0]} ns)"
        )
    if len(poses) == 0:
        raise InputError(f"{source}: the path holds no poses")
    if (np.diff(stamps) < 0).any():
        bad = int(np.argmax(np.diff(stamps) < 0))
        raise InputError(
            f"{source}: pose {bad + 1} bears an earlier stamp than pose {bad}; planned times must "
            "not decrease"
        )
    moved = np.concatenate([[True], (np.diff(poses, axis=0) != 0.0).any(axis=1)])
    at = np.searchsorted(stamps, anchors_ns)
    missing = (at >= len(stamps)) | (stamps[np.minimum(at, len(stamps) - 1)] != anchors_ns)
    if missing.any():
        raise InputError(
            f"{source}: no pose bears the stamp of changepoint {int(np.argmax(missing))}; every "
            "changepoint needs one"
        )
    points = poses[moved]
    return frame_id, Route(
        points=points, anchor=(np.cumsum(moved) - 1)[at], length=arc_lengths(points[:, :2])
    )
