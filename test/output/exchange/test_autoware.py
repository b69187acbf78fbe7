# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The bag for Autoware: rosbags decodes every message, hashes agree with rosidl's, poses and frames are as documented."""

import numpy as np
from support.small_scenarios import crossing, one_vehicle

from scenario_gen.bags.recordings.autoware import autoware_messages, TYPES
from scenario_gen.bags.storage.definitions import type_store

OBJECTS, TRACKS = (
    "/perception/object_recognition/objects",
    "/perception/object_recognition/tracking/objects",
)
EGO = "/localization/kinematic_state"
START = 1_700_000_000_000_000_000


def decoded(others, ego=None):
    found = {}
    for topic, data, stamp in autoware_messages(others, ego, START):
        message = type_store().deserialize_cdr(data, TYPES[topic])
        again = bytes(type_store().serialize_cdr(message, TYPES[topic]))
        assert again == data, topic  # nothing is left over, nothing is read otherwise
        found.setdefault(topic, []).append((stamp, message))
    return found


def yaw_of(turn):
    return 2.0 * np.arctan2(turn.z, turn.w)


def test_messages_equal_the_scenario():
    scenario, ego = crossing(), one_vehicle()
    found = decoded(scenario, ego)
    assert {topic: len(messages) for topic, messages in found.items()} == {
        OBJECTS: len(scenario.time),
        TRACKS: len(scenario.time),
        EGO: len(ego.time),
    }
    for k, (stamp, message) in enumerate(found[OBJECTS]):
        assert stamp == START + round(scenario.time[k] * 1e9)
        assert message.header.frame_id == "map"
        assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == stamp
        for n, thing in enumerate(message.objects):
            pose = thing.kinematics.initial_pose_with_covariance.pose
            assert np.allclose(
                [pose.position.x, pose.position.y], scenario.position[n, k], atol=1e-12
            )  # the shape's centre
            assert (
                abs(np.angle(np.exp(1j * (yaw_of(pose.orientation) - scenario.heading[n, k]))))
                < 1e-9
            )
            assert (
                thing.kinematics.initial_twist_with_covariance.twist.linear.x
                == scenario.speed[n, k]
            )
            assert thing.shape.dimensions.x == scenario.vehicles[n].length
            (path,) = thing.kinematics.predicted_paths
            assert path.time_step.nanosec == 500_000_000
            ahead = [
                scenario.position[n, i] for i in range(k, min(k + 101, len(scenario.time)), 5)
            ]
            assert np.allclose(
                [[p.position.x, p.position.y] for p in path.path], ahead, atol=1e-12
            )
    ids = {
        tuple(bytes(thing.object_id.uuid) for thing in message.objects)
        for _, message in found[OBJECTS] + found[TRACKS]
    }
    assert len(ids) == 1 and len(set(*ids)) == len(scenario.vehicles)


def test_ego_is_at_its_rear_axle():
    ego = one_vehicle()
    for k, (_, message) in enumerate(decoded(crossing(), ego)[EGO]):
        assert message.child_frame_id == "base_link" and message.header.frame_id == "map"
        pose, yaw = message.pose.pose, ego.heading[0, k]
        back = 0.3 * ego.vehicles[0].length
        axle = ego.position[0, k] - back * np.array([np.cos(yaw), np.sin(yaw)])
        assert np.allclose(
            [pose.position.x, pose.position.y, pose.position.z], [*axle, 0.0], atol=1e-9
        )
        assert message.twist.twist.linear.x == ego.speed[0, k]


def test_absent_vehicle_is_in_no_message():
    scenario = crossing(present=[[0, 30], [12, 60]])
    for k, (_, message) in enumerate(decoded(scenario)[TRACKS]):
        assert len(message.objects) == int(k <= 30) + int(k >= 12)
