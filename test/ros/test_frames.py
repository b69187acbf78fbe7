# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Frames on /tf, as other libraries read them, and nodes where tf2_msgs is not installed."""

import numpy as np
from rosbags.typesys import get_typestore, Stores
from support.message_decoders import decode_frames

from msg_conventions.poses import encode_frames, FRAMES_TYPE

STORE = get_typestore(Stores.ROS2_JAZZY)


def test_frames_equal_those_of_rosbags():
    poses = np.array([[1.5, -2.25, 0.5], [3.0, 4.0, -3.0]])
    data = encode_frames(poses, ["vehicle_1", "vehicle_long_2"], "map", 17)
    assert (
        bytes(STORE.serialize_cdr(STORE.deserialize_cdr(data, FRAMES_TYPE), FRAMES_TYPE)) == data
    )
    found = decode_frames(data)
    assert [one[:3] for one in found] == [(17, "map", "vehicle_1"), (17, "map", "vehicle_long_2")]
    assert np.allclose([one[3] for one in found], poses, rtol=0.0, atol=1e-12)
