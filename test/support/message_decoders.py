# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Decoders of messages that the product only encodes."""

from msg_conventions.cdr import decode
from msg_conventions.layouts import TRANSFORMS
from msg_conventions.poses import decode_odometry, poses_of
from scenario_gen.numerics import Floats


def decode_frames(data: bytes, source: str = "tf") -> list[tuple[int, str, str, Floats]]:
    """Return stamp [ns], parent, child and planar pose (3,) of each transform.

    Raises:
        InputError: the message is damaged, or a pose is none.
    """
    return [
        (each.stamp, each.frame_id, each.child, poses_of(each.pose[None], source)[0])
        for each in decode(TRANSFORMS, data, source).transforms
    ]


def decode_state(data: bytes, source: str = "state") -> tuple[int, str, str, Floats]:
    """Return stamp [ns], frame, child frame and the state (4,).

    Raises:
        InputError: the message is damaged, or a value is not finite.
    """
    stamp_ns, frame_id, child, state = decode_odometry(data, source)
    return stamp_ns, frame_id, child, state[:4]
