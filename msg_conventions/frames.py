# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Coordinate frames ⇄ tf2_msgs/TFMessage: `/tf` for the vehicles of a scenario in motion.

Parent: the road's frame. Child: `vehicle_<id>`, at the footprint's centre, x ahead. QoS: reliable,
volatile, depth 100.
"""

from collections.abc import Sequence

from msg_conventions.cdr import decode, encode
from msg_conventions.layouts import TRANSFORMS
from msg_conventions.poses import pose_rows, poses_of
from scenario_gen.numerics import Floats

TYPE = "tf2_msgs/msg/TFMessage"


def encode_frames(poses: Floats, children: Sequence[str], parent: str, stamp_ns: int) -> bytes:
    """Return frames `children` at `poses` (N, 3) x, y [m], yaw [rad] in `parent` as CDR bytes."""
    rows = zip(pose_rows(poses), children, strict=True)
    header = {"stamp": stamp_ns, "frame_id": parent}
    return encode(
        TRANSFORMS, transforms=[header | {"child": child, "pose": row} for row, child in rows]
    )


def decode_frames(data: bytes, source: str = "tf") -> list[tuple[int, str, str, Floats]]:
    """Return stamp [ns], parent, child and planar pose (3,) of each transform.

    Raises:
        InputError: the message is damaged, or a pose is none.
    """
    return [
        (each.stamp, each.frame_id, each.child, poses_of(each.pose[None], source)[0])
        for each in decode(TRANSFORMS, data, source).transforms
    ]
