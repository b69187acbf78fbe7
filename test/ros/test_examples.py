# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The examples for users of nav2 and Autoware: what they publish of a scenario."""

import importlib.util
from pathlib import Path
import subprocess
import sys

import numpy as np
import pytest
from support.bag_examples import hand_made_run

from msg_conventions.autoware import OBJECTS
from msg_conventions.frames import decode_frames
from scenario_gen.bags.recordings.scenario_decoder import TOPICS
from scenario_gen.bags.recordings.write import result_messages

pytestmark = pytest.mark.dds
EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@pytest.fixture
def load(domain, monkeypatch):
    """What imports an example and gives its node, without timers, and the messages of a scenario."""
    import rclpy

    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    rclpy.init(args=[])

    def run(name, node, **replaced):
        specification = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
        module = importlib.util.module_from_spec(specification)
        specification.loader.exec_module(module)
        for key, value in replaced.items():
            setattr(module, key, value)
        made = getattr(module, node)()
        for topic, data, _ in result_messages(hand_made_run()):
            if topic in TOPICS:
                made.receive(topic, data)
        return module, made

    yield run
    rclpy.try_shutdown()


def test_nav2_sees_the_footprints_of_a_scenario(load):
    module, node = load("nav2_obstacles", "Obstacles")
    sent = []
    node.cloud = type("Publisher", (), {"publish": staticmethod(sent.append)})
    node.publish()
    (message,) = sent
    points = np.frombuffer(bytes(message.data), dtype="<f4").reshape(-1, 3)
    assert message.header.frame_id == node.scenario.frame_id and len(points) == message.width > 100
    states = node.scenario.at(2.0)
    points = module.footprint_points(node.scenario, 2.0)[:, :2]
    reach = [np.hypot(vehicle.length, vehicle.width) / 2 for vehicle in node.scenario.vehicles]
    distance = np.linalg.norm(points[:, None] - states.position, axis=-1)
    assert (distance <= np.array(reach) + 1e-6).any(axis=1).all()


def test_autoware_gets_objects_frames_and_a_clock_that_goes_on(load):
    sent = []
    _, node = load(
        "autoware_objects",
        "AutowareObjects",
        create_publisher=lambda _, topic: topic,
        create_frames_publisher=lambda _: "/tf",
        publish=lambda _, topic, data: sent.append((topic, data)),
    )
    count = len(node.encoder.time_ns)
    for _ in range(2 * count):
        node.step()
    assert [topic for topic, _ in sent[:3]] == ["/clock", "/tf", OBJECTS]
    stamps = [decode_frames(data)[0][0] for topic, data in sent if topic == "/tf"]
    assert set(np.diff(stamps)) == {100_000_000}


def test_without_the_messages_of_autoware_its_example_says_so():
    command = [sys.executable, EXAMPLES / "autoware_objects.py"]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ran.stderr.splitlines()[-1].startswith("skipped: message type autoware_perception_msgs")
