# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Our bytes are those of rclpy and of rosbags, and decode there to the same values.

Fast CDR leaves padding bytes uninitialised, so rclpy's bytes are compared after rosbags has put zeros there.
"""

from dataclasses import replace
import importlib
import subprocess
import sys

import numpy as np
import pytest
from rosbags.typesys import get_typestore, Stores
from support.message_examples import encounter, route, scenario, segmentation

from msg_conventions import (
    changepoints,
    diagnostics,
    documents,
    ego,
    paths,
    pictures,
    poses,
    roads,
    scenario_info,
    scenarios,
    tracks,
    trajectory,
)
from scenario_gen.types import Note, NoteKind, Vehicle
from scenario_gen.types.lanes import Lane, LaneNetwork
from scenario_gen.types.road import Road
from scenario_gen.types.scenario import BoundaryStates

STORE = get_typestore(Stores.ROS2_JAZZY)
ANCHORS = [5_000_000_000, 6_100_000_000, 7_000_000_000, 7_000_000_001, 9_000_000_000]


def _messages():
    for seed, frame in ((1, "map"), (2, "m"), (3, "longer"), (4, "framexx")):
        n = 2 + seed % 3
        template, parts = encounter(seed, n), segmentation(seed, k=seed - 1)
        yield trajectory.TYPE, tracks.encode_tracks(template)
        yield trajectory.TYPE, changepoints.encode_changepoints(template, parts)
        yield changepoints.POSTERIOR_TYPE, changepoints.encode_posterior(template, parts)
        yield trajectory.TYPE, scenarios.encode_scenario(scenario(seed, n), 17)
        state = np.array([1.5, -2.5, 3.0, 8.25])
        yield poses.ODOMETRY_TYPE, ego.encode_state(state, f"vehicle_{'x' * seed}", frame, 17)
        yield paths.TYPE, paths.encode_route(route(seed), ANCHORS, frame)
        yield paths.TYPE, paths.encode_path(np.zeros((seed - 1, 3)), np.arange(seed - 1), frame, 3)
        ends = np.array([[1.0, 2.0, 3.0]] * (seed - 1)).reshape(-1, 3)
        road = Road("r", np.eye(seed, dtype=bool), 0.1, np.ones(2), ends, ends, frame)
        yield roads.MAP_TYPE, roads.encode_map(road, 5)
        border = np.column_stack((np.arange(seed + 1.0), np.zeros(seed + 1)))
        network = LaneNetwork(
            "m",
            (Lane("7", border + 1.0, border, (0,), (), 8.5 * seed, "j" * seed),),
            (Note.of(NoteKind.TEXT, text="née"),),
        )
        described = replace(road, lanes=network if seed > 1 else None)
        yield documents.TYPE, roads.encode_description(described, b"", 5)
        yield roads.POSES_TYPE, roads.encode_poses(road.entries, frame, 5)
        sent = scenario(seed)
        asked = BoundaryStates(np.zeros((2, 4)), np.ones((2, 4)))
        entry = scenario_info.scenario_entry(sent, b"", frame, template=sent.vehicles, asked=asked)
        yield documents.TYPE, scenario_info.encode_info(entry)
        status = diagnostics.Status("/n" * seed, diagnostics.Level.OK, frame, {frame: "é" * seed})
        yield diagnostics.TYPE, diagnostics.encode_diagnostics([status] * (seed - 1), 1)
        yield pictures.FOOTPRINT_TYPE, pictures.encode_footprint(Vehicle("a"), 3, frame)
        yield pictures.MARKER_TYPE, pictures.scenario_markers(scenario(seed), 3)


MESSAGES = list(_messages())


@pytest.mark.parametrize(
    ("kind", "data"), MESSAGES, ids=[f"{k}-{kind}" for k, (kind, _) in enumerate(MESSAGES)]
)
def test_bytes_equal_rosbags_and_rclpy(kind, data):
    from rclpy.serialization import deserialize_message, serialize_message

    package, _, name = kind.split("/")
    kind_class = getattr(importlib.import_module(f"{package}.msg"), name)
    theirs = bytes(serialize_message(deserialize_message(data, kind_class)))
    assert len(theirs) == len(data)
    for encoded in (data, theirs):
        assert bytes(STORE.serialize_cdr(STORE.deserialize_cdr(encoded, kind), kind)) == data


def test_consumer_reads_what_the_convention_says():
    """Read with rclpy, by the words of docs/interfaces.md alone."""
    from rclpy.serialization import deserialize_message
    from trajectory_msgs.msg import MultiDOFJointTrajectory

    sent = scenario(1)
    message = deserialize_message(
        scenarios.encode_scenario(sent, 1_500_000_000), MultiDOFJointTrajectory
    )
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (1, 500_000_000)
    assert message.header.frame_id == sent.frame_id
    assert message.joint_names[1] == f"v1:4.8x{sent.vehicles[1].width!r}"
    point = message.points[23]
    assert (point.time_from_start.sec, point.time_from_start.nanosec) == (2, 300_000_000)
    pose = point.transforms[1]
    assert (pose.translation.x, pose.translation.y, pose.translation.z) == (
        *sent.position[1, 23],
        0.0,
    )
    assert 2.0 * np.arctan2(pose.rotation.z, pose.rotation.w) % (2 * np.pi) == pytest.approx(
        sent.heading[1, 23] % (2 * np.pi)
    )
    assert point.velocities[1].linear.x == sent.speed[1, 23]
    assert point.accelerations[1].linear.x == sent.acceleration[1, 23]


def test_the_conventions_need_no_ros():
    code = (
        "import sys, msg_conventions.topics, scenario_gen.bags.recordings.write; "
        "found = [m for m in sys.modules if m.split('.')[0] in ('rclpy', 'nav_msgs', 'trajectory_msgs')]; "
        "sys.exit(str(found) if found else 0)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_messages_without_velocities_are_read():
    """Another publisher may leave velocities and accelerations out."""
    from geometry_msgs.msg import Transform
    from rclpy.serialization import serialize_message
    from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

    message = MultiDOFJointTrajectory(joint_names=["a", "b"])
    message.header.frame_id = "local_enu"
    for k in range(3):
        point = MultiDOFJointTrajectoryPoint(transforms=[Transform(), Transform()])
        point.transforms[1].translation.x = float(k)
        point.time_from_start.nanosec = k * 100_000_000
        message.points.append(point)
    got = tracks.decode_tracks(bytes(serialize_message(message)))
    assert got.position[1, :, 0].tolist() == [0.0, 1.0, 2.0]
    assert (got.speed == 0.0).all()
    assert got.vehicles[0].length == 4.8
