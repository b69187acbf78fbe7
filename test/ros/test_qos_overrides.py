# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The quality of service of what nodes publish can be overridden, as in any ROS 2 node."""

import pytest

pytestmark = pytest.mark.dds


def test_the_quality_of_a_topic_is_overridden_and_that_of_others_is_not(start, client):
    from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

    overrides = {
        "qos_overrides./map.publisher.reliability": "best_effort",
        "qos_overrides./map.publisher.durability": "volatile",
    }
    start("road_server", road_name="straight", **overrides)
    for topic in ("/map", "/road/lanes"):
        client.until(lambda topic=topic: client.node.count_publishers(topic), topic)
    offered = {
        topic: client.node.get_publishers_info_by_topic(topic)[0].qos_profile
        for topic in ("/map", "/road/lanes")
    }
    assert offered["/map"].reliability is ReliabilityPolicy.BEST_EFFORT
    assert offered["/map"].durability is DurabilityPolicy.VOLATILE
    assert offered["/road/lanes"].reliability is ReliabilityPolicy.RELIABLE
    assert offered["/road/lanes"].durability is DurabilityPolicy.TRANSIENT_LOCAL
