# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Coordinate frames ⇄ tf2_msgs/TFMessage: `/tf`, of the vehicles that the player moves, and `/tf_static`.

Parent: the frame of the trajectory that is played (`local_enu` of tracks, the road's of scenarios). Child: `vehicle_<id>`, at the
footprint's centre, x ahead. QoS: reliable; /tf volatile, /tf_static transient_local, depth 1.
"""

from collections.abc import Sequence

from msg_conventions.cdr import CdrReader, CdrWriter
from msg_conventions.poses import pose_rows, poses_of
from scenario_gen.numerics import Floats

TYPE = "tf2_msgs/msg/TFMessage"


def encode_frames(poses: Floats, children: Sequence[str], parent: str, stamp_ns: int) -> bytes:
    """Return the frames `children` at `poses` (N, 3) x [m], y [m], yaw [rad] of `parent`, as CDR bytes."""
    writer = CdrWriter().pack("I", len(children))
    for row, child in zip(pose_rows(poses), children, strict=True):
        writer.header(stamp_ns, parent).string(child).pack("d", *row)
    return writer.finish()


def decode_frames(data: bytes, what: str = "tf") -> list[tuple[int, str, str, Floats]]:
    """Return stamp [ns], parent, child and pose (3,) of each transform; z and what is no turn about it are left out.

    Raises:
        InputError: the message is damaged, or a pose is none.
    """
    reader = CdrReader(data, what)
    found = []
    for _ in range(reader.count(72)):
        stamp_ns, parent = reader.header()
        found.append((stamp_ns, parent, reader.string(), poses_of(reader.floats(7)[None], what)[0]))
    return found
