# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What ROS lets a user change at a node, each with a real process; docs/interfaces.md has the table of all."""

import pytest
from support.source_files import ROOT

from msg_conventions.cdr import stamp_of

pytestmark = pytest.mark.dds
LOG = ROOT / "examples" / "my_log.csv"


def nodes_of(client):
    return {
        f"{space.rstrip('/')}/{name}"
        for name, space in client.node.get_node_names_and_namespaces()
    }


def test_topics_and_services_are_remapped(start, client):
    client.hear("/lab/tracks")
    remapped = ("tracks:=/lab/tracks", "~/play:=/lab/again", "__node:=logs", "__ns:=/b")
    start("log_player", *(word for rule in remapped for word in ("-r", rule)), log_path=LOG)
    client.wait("/lab/tracks")
    assert "/b/logs" in nodes_of(client)
    services = {name for name, _ in client.node.get_service_names_and_types()}
    assert {"/lab/again", "/b/logs/get_parameters"} <= services and "/b/logs/play" not in services
    assert (
        client.node.count_publishers("/tracks") == client.node.count_publishers("/b/tracks") == 0
    )


def test_rule_for_one_node_spares_others(start, client):
    client.hear("/b/tracks")
    start(
        "suite",
        "--nodes",
        "log_player,segmenter",
        "-r",
        "log_player:tracks:=/b/tracks",
        log_path=LOG,
        road_name="straight",
    )
    client.wait("/b/tracks")
    assert "segmenter" in {
        one.node_name for one in client.node.get_subscriptions_info_by_topic("/tracks")
    }
    assert (
        client.node.count_publishers("/tracks") == 0
        and client.node.count_subscribers("/b/tracks") == 1
    )


def test_simulated_time_and_overridden_qos(start, client):
    """One node has both: the time of /clock in its diagnostics, and the quality that one topic was given."""
    from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
    from rosgraph_msgs.msg import Clock

    client.hear("/diagnostics")
    overrides = {
        "qos_overrides./map.publisher.reliability": "best_effort",
        "qos_overrides./map.publisher.durability": "volatile",
    }
    start("road_server", use_sim_time=True, road_name="straight", **overrides)
    clock, now = client.node.create_publisher(Clock, "/clock", 10), Clock()
    now.clock.sec = 7

    def stamped() -> bool:
        clock.publish(now)
        heard = list(client.heard["/diagnostics"])
        return any(stamp_of(data, "diagnostics") == 7_000_000_000 for data in heard)

    client.until(stamped, "a status at the time of /clock")
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
