# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Frames on /tf, as other libraries read them, and nodes where tf2_msgs is not installed."""

import signal

import numpy as np
import pytest
from rosbags.typesys import get_typestore, Stores

from msg_conventions.frames import decode_frames, encode_frames, TYPE

STORE = get_typestore(Stores.ROS2_JAZZY)


def test_bytes_are_those_of_rosbags_and_are_read_back():
    poses = np.array([[1.5, -2.25, 0.5], [3.0, 4.0, -3.0]])
    data = encode_frames(poses, ["vehicle_1", "vehicle_long_2"], "map", 17)
    assert bytes(STORE.serialize_cdr(STORE.deserialize_cdr(data, TYPE), TYPE)) == data
    found = decode_frames(data)
    assert [one[:3] for one in found] == [(17, "map", "vehicle_1"), (17, "map", "vehicle_long_2")]
    assert np.allclose([one[3] for one in found], poses, rtol=0.0, atol=1e-12)


@pytest.mark.dds
def test_without_tf2_msgs_the_nodes_work_and_say_so(start, client):
    for node in ("preview", "traffic"):
        process = start(node, without_tf2=True)
        client.until(
            lambda node=node: (node, "/") in client.node.get_node_names_and_namespaces(), node
        )
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=180.0)
        assert process.returncode == 0 and output.count("no frames are published on /tf:") == 1, (
            output
        )
        assert "tf2_msgs" in output and "Traceback" not in output
