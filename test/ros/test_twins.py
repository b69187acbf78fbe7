# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Two nodes that publish the same topics in one namespace: each of them says so, and names the other."""

import pytest
from support.bag_examples import hand_made_run

from msg_conventions.diagnostics import Level
from scenario_gen.bags.recordings.write import result_messages

pytestmark = pytest.mark.dds


def twins_of(client):
    """The newest status about twins, by node."""
    found = {}
    for status in client.statuses():
        node, _, subject = status.name.partition(": ")
        if subject == "twins":
            found[node] = status
    return found


def test_twin_road_servers_name_each_other(start, client):
    client.hear("/diagnostics")
    start("road_server", "-r", "__node:=one", road_name="straight")
    second = start("road_server", "-r", "__node:=two", road_name="straight")
    client.until(lambda: {"/one", "/two"} <= set(twins_of(client)), "both to warn")
    found = twins_of(client)
    assert (
        "/map is also published by /two" in found["/one"].message
        and found["/one"].level is Level.WARN
    )
    assert (
        "/map is also published by /one" in found["/two"].message
        and "another namespace" in found["/two"].message
    )
    second.terminate()
    client.until(
        lambda: twins_of(client)["/one"].level is Level.OK, "the one that is left to be content"
    )


def test_recorder_blames_two_publishers(start, client, tmp_path):
    """Messages of one request, of which a second node of the same topics makes others."""
    start("recorder", bag=tmp_path / "bag")
    client.hear("/diagnostics")
    for name in ("one", "two"):
        start("gp_sampler", "-r", f"__node:={name}")
    client.until(lambda: client.node.count_publishers("/scenarios/info") == 2, "both samplers")
    client.until(lambda: client.node.count_subscribers("/scenarios/info") >= 1, "the recorder")
    run = hand_made_run()
    for topic in ("scenarios", "scenarios/info"):
        client.announce(topic)
    messages = [
        (topic, data)
        for topic, data, _ in result_messages(run)
        if topic in ("scenarios", "scenarios/info")
    ]
    for topic, data in messages[1:]:  # the first is missing
        client.say(topic, data)

    def blamed():
        return [
            status.message
            for status in client.statuses()
            if status.name == "/recorder: losses"
            and "/one and /test_client and /two publish" in status.message
        ]

    client.until(blamed, "the recorder to blame the publishers")
    assert "disk" not in blamed()[-1]
