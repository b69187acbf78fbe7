# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""No scenario is lost on the way, not in a large request nor for one that hangs; and what is lost is said everywhere."""

import os
from pathlib import Path
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from support.bag_examples import bag_topics
from support.lengths import LONG
from support.suite_processes import Processes, RESOURCES
from typer.testing import CliRunner
import yaml

from msg_conventions.diagnostics import encode_diagnostics, Level, Status
from msg_conventions.scenario_info import (
    decode_info,
    encode_info,
    RequestSummary,
    scenario_entry,
    ScenarioEntry,
)
from msg_conventions.scenarios import digest, encode_scenario
from scenario_gen.bags.storage.bag import read_messages
from scenario_gen.bags.storage.config import BagConfig
from scenario_gen.base.errors import InputError
from scenario_gen.cli.commands import app
from scenario_gen.types import Vehicle
from scenario_gen.types.scenario import BoundaryStates, Scenario

pytestmark = pytest.mark.dds
MANY = 10_000 if LONG else 1100  # more than publishers remember
HANGING = """
import scenario_gen.ros.nodes
import rclpy
from std_msgs.msg import String
rclpy.init()
node = rclpy.create_node("hanging")
node.create_subscription(String, "/hang", lambda _: None, 10, raw=True)
rclpy.spin(node)
"""


def test_a_large_request_arrives_whole(tmp_path, domain, client):
    bag = tmp_path / "bag"
    nodes = {
        "recorder": ["-p", f"bag:={bag}", "-p", "compress:=false"],
        "gp_sampler": ["-p", "generate_on_input:=false"],
        "planner": [],
        "segmenter": [],
        "road_server": ["-p", "road_name:=straight", "-p", "wait_for_tracks:=true"],
        "log_player": ["-p", f"log_path:={RESOURCES / 'synthetic_c'}"],
    }
    client.hear("/diagnostics")
    suite = Processes(tmp_path, domain, nodes)
    try:
        client.until(lambda: client.generate(count=1).successful, "the sampler's inputs")
        answer = client.generate(count=MANY, seed=3)
        assert answer.successful and f"{MANY} of {MANY} scenarios" in answer.reason, answer.reason
        assert not [s.message for s in client.statuses() if "pace of" in s.name], "nobody hangs"
        client.until(
            lambda: client.counted("/scenarios/info") >= MANY + 2,
            "the recorder to have all",
            600.0,
        )
        assert not [
            s.message
            for s in client.statuses()
            if s.name == "/recorder: losses" and "lost" in s.message
        ]
    finally:
        assert suite.end() == dict.fromkeys(nodes, 0)
    (scenarios,) = [topic for topic in bag_topics(bag) if topic.name == "/scenarios"]
    assert scenarios.count == MANY + 1
    messages = read_messages(
        bag, lambda topic: topic in ("/scenarios", "/scenarios/info"), BagConfig(most_bytes=2**40)
    )
    came, told = set(), []
    for message in messages:
        if message.topic == "/scenarios":
            came.add(digest(message.data))
        else:
            told.append(decode_info(message.data))
    told = [info for info in told if isinstance(info, ScenarioEntry)]
    assert {entry.sha256 for entry in told} == came
    assert len({entry.index for entry in told if entry.seed == 3}) == MANY


def test_hanging_subscriber_is_waited_for_briefly(domain, client):
    """It is said once, what it may lack is said when it goes on, and others are waited for again then."""
    from rclpy.duration import Duration
    from std_msgs.msg import String

    from msg_conventions.cdr import encode
    from scenario_gen.ros.common.topics import Pace

    depth = 5
    publisher, told = client.node.create_publisher(String, "/hang", depth), []
    pace = Pace(publisher, 120.0, told.append)
    hanging = subprocess.Popen(
        [sys.executable, "-c", HANGING], env=os.environ | {"ROS_DOMAIN_ID": str(domain)}
    )
    try:
        client.until(
            lambda: publisher.get_subscription_count() == 1, "the subscriber that will hang"
        )

        def publish() -> None:
            pace.wait(lambda: False)
            publisher.publish(encode({"data": "string"}, data="x"))

        seconds = []
        for _ in range(6):
            begun = time.monotonic()
            for _ in range(depth):
                publish()
            seconds.append(time.monotonic() - begun)
        assert told == []
        assert min(seconds[1:]) < 1.5, "it answers at once, not at the next heartbeat of DDS"
        client.until(
            lambda: publisher.wait_for_all_acked(Duration()), "what it acknowledges while it runs"
        )
        hanging.send_signal(signal.SIGSTOP)
        pace = Pace(publisher, 0.5, told.append)
        for _ in range(20):  # seconds before DDS gives it up by itself
            publish()
        assert told == [0]
        hanging.send_signal(signal.SIGCONT)
        client.until(
            lambda: publisher.wait_for_all_acked(Duration()),
            "what it acknowledges when it goes on",
        )
        publish()
        first, second = told
        assert first == 0 and 10 <= second <= 20
    finally:
        hanging.kill()
        hanging.wait()


def _scenario(k: int) -> Scenario:
    """A car that drives straight on; its message has 0.2 MB."""
    clock = np.arange(1400) * 0.1
    place = np.stack([clock * 10.0 + k, 0.0 * clock], axis=-1)[None]
    speed = np.full((1, len(clock)), 10.0)
    return Scenario(
        (Vehicle("car"),), clock, place, 0.0 * speed, speed, 0.0 * speed, seed=1, index=k
    )


def test_loss_is_reported_everywhere(client, start, tmp_path):
    """A publisher that waits for nobody, and a recorder that sleeps meanwhile."""
    count, bag = 200 if LONG else 60, tmp_path / "bag"
    client.hear("/diagnostics")
    client.announce("/scenarios/info")
    from rclpy.qos import QoSProfile
    from trajectory_msgs.msg import MultiDOFJointTrajectory

    hasty = client.node.create_publisher(
        MultiDOFJointTrajectory, "/scenarios", QoSProfile(depth=2)
    )
    recorder = start("recorder", bag=bag)
    client.until(lambda: hasty.get_subscription_count() == 1, "a subscriber of /scenarios")
    client.until(
        lambda: client.node.count_subscribers("/scenarios/info") == 1,
        "a subscriber of /scenarios/info",
    )

    def publish(k: int) -> None:
        scenario = _scenario(k)
        data = encode_scenario(scenario, 0)
        hasty.publish(data)
        asked = BoundaryStates(np.zeros((1, 4)), np.zeros((1, 4)))
        entry = scenario_entry(scenario, data, "1", template=scenario.vehicles, asked=asked)
        client.say("/scenarios/info", encode_info(entry))

    publish(0)
    client.until(lambda: client.counted("/scenarios") == 1, "the first scenario in the bag")
    recorder.send_signal(signal.SIGSTOP)
    for k in range(1, count):
        publish(k)
    recorder.send_signal(signal.SIGCONT)
    publish(count)
    closing = RequestSummary(0, {}, "1", 1, *[count + 1] * 3)
    client.say("/scenarios/info", encode_info(closing))

    def told() -> str:
        losses = [
            s.values
            for s in client.statuses()
            if s.name == "/recorder: losses" and s.level is Level.WARN
        ]
        words = [values.get("/scenarios", "") for values in losses]
        return next((said for said in words if "lost" in said and "are missing" in said), "")

    client.until(told, "the recorder's warning")
    recorder.send_signal(signal.SIGINT)
    output, _ = recorder.communicate(timeout=180.0)
    assert recorder.returncode == 0 and "Traceback" not in output, output
    there = len([message for message in read_messages(bag) if message.topic == "/scenarios"])
    sentence = (
        f"request 1: {there} of {count + 1} scenarios are there, {count + 1 - there} are missing"
    )
    assert 0 < there < count
    assert f"{count + 1 - there} lost" in told() and sentence in told()
    assert sentence in output
    info = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert info["custom_data"]["scenario_gen.lost:/scenarios"] == told()
    answer = CliRunner().invoke(app, ["evaluate", str(bag)])
    assert sentence in answer.output.replace("\n", " ") and "by its recorder" in answer.output, (
        answer.output
    )


def test_killed_recorder_keeps_earlier_messages(client, start, tmp_path):
    """Far less than a chunk, and then nothing: it is on the disk all the same."""
    bag = tmp_path / "bag"
    client.hear("/diagnostics")
    recorder = start("recorder", bag=bag)
    client.until(
        lambda: any(s.name == "/recorder: recorded" for s in client.statuses()), "the recorder"
    )
    client.announce("/report")
    client.until(lambda: client.node.count_subscribers("/report") == 1, "a subscriber")
    data = encode_diagnostics([Status("/evaluator: row", Level.OK, "")], 0)
    client.say("/report", data)
    client.until(lambda: client.counted("/report") == 1, "the message in the bag")
    client.until(lambda: _saved(bag, data), "the message on the disk")
    recorder.kill()
    recorder.wait()
    assert _saved(bag, data)


def _saved(bag: Path, data: bytes) -> bool:
    try:
        return data in [message.data for message in read_messages(bag)]
    except InputError:  # no chunk is on the disk
        return False
