# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Two nodes that publish the same topics in one namespace: the recorder, which lacks messages, names them."""

import pytest
from support.bag_examples import hand_made_run

from scenario_gen.bags.recordings.write import result_messages

pytestmark = pytest.mark.dds


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
