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
from types import SimpleNamespace

import numpy as np

from msg_conventions.cdr import encode
from msg_conventions.layouts import PATH
from msg_conventions.poses import pose_rows, poses_of
from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Floats, Ints
from scenario_gen.types import Route

TYPE = "nav_msgs/msg/Path"


def encode_path(poses: Floats, stamps_ns: Ints, frame_id: str, stamp_ns: int) -> bytes:
    """Return (M, 3) x, y, yaw with their (M,) stamps as CDR bytes of a nav_msgs/Path.

    Raises:
        InputError: a value is not finite, or a stamp is no ROS time.
    """
    if not np.isfinite(poses).all():
        raise InputError("a path with a value that is not finite cannot be sent")
    stamped = [
        {"stamp": stamp, "frame_id": frame_id, "pose": row}
        for stamp, row in zip(stamps_ns.tolist(), pose_rows(poses), strict=True)
    ]
    return encode(PATH, stamp=stamp_ns, frame_id=frame_id, poses=stamped)


def timed_poses(path: SimpleNamespace, source: str) -> tuple[Floats, Ints]:
    """Return the poses (M, 3) of a decoded path, and their stamps (M,) [ns].

    Raises:
        InputError: a value is not finite, or a pose has no rotation.
    """
    rows = np.array([pose.pose for pose in path.poses]).reshape(-1, 7)
    stamps = np.array([pose.stamp for pose in path.poses], dtype=np.int64)
    return poses_of(rows, source), stamps


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
