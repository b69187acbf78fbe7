# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The node `traffic`: a planner over DDS in lock-step, whatever is wrong with its commands, and the verdict."""

from dataclasses import replace
import json
import math
import sys

import numpy as np
import pytest
from support.bag_examples import hand_made_run
from support.message_decoders import decode_frames, decode_state
from support.suite_processes import Client
from typer.testing import CliRunner

from msg_conventions.cdr import encode
from msg_conventions.diagnostics import decode_diagnostics, Level
from msg_conventions.driving import encode_twist
from msg_conventions.layouts import VELOCITY_STAMPED
from msg_conventions.paths import encode_path
from msg_conventions.poses import decode_odometry, encode_odometry
from msg_conventions.roads import decode_map
from msg_conventions.scenario_info import encode_info, request_summary
from scenario_gen.bags.recordings.write import result_messages, write_recording
from scenario_gen.cli.commands import app
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.simulation import ClosedLoop
from scenario_gen.closed_loop.tracking import of_twist
from scenario_gen.closed_loop.verdict import judge
from scenario_gen.ros.common import planner_trials
from scenario_gen.ros.common.driving import decode_command, FIRST_STAMP_NS
from scenario_gen.types import token, with_witness
from scenario_gen.types.scenario import EgoSlot

pytestmark = pytest.mark.dds


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    return write_recording(tmp_path_factory.mktemp("traffic") / "bag", hand_made_run())


@pytest.fixture
def traffic(start, client, bag):
    """A running node in lock-step that this client steers."""

    def run(**parameters):
        process = start("traffic", bag=bag, lock_step=True, **{"follow_on": False, **parameters})
        client.hear("verdicts", "/tf", "/clock", "traffic/local_map", "/diagnostics")
        client.hear("vehicle_1/odom", "vehicle_bus_2/odom")
        for topic in ("ego/cmd_vel", "ego/odom", "ego/path"):
            client.announce(topic)
            client.until(lambda topic=topic: client.node.count_subscribers(topic), topic)
        client.until(lambda: client.node.count_publishers("verdicts"), "verdicts")
        return process

    return run


def step(client):
    from std_srvs.srv import Trigger

    answer = client.call(Trigger, "/traffic/step", Trigger.Request())
    assert answer.success, answer.message
    return json.loads(answer.message)


def drive_to_the_end(client):
    """Command 3 m/s until the drive is over."""
    over = False
    while not over:
        client.say("ego/cmd_vel", encode_twist(3.0, 0.0))
        over = step(client)["over"]


class Slow:
    """The planner: 3 m/s, straight on."""

    def reset(self, task):
        self.step = task.step

    def act(self, seen):
        return of_twist(seen.ego, 3.0, 0.0, self.step)


def test_lock_step_verdict_equals_in_process(traffic, client, tmp_path):
    from std_srvs.srv import Trigger

    traffic(results=tmp_path / "results")
    for _ in range(2):  # and once more after a reset
        drive_to_the_end(client)
        assert not client.call(Trigger, "/traffic/step", Trigger.Request()).success
        assert client.call(Trigger, "/traffic/reset", Trigger.Request()).success
    client.wait("verdicts", 2)
    first, second = (decode_diagnostics(data)[1][0] for data in client.heard["verdicts"])
    assert first == second

    run = hand_made_run()
    loop = ClosedLoop(run.generated.scenarios[0], 0, run.road, ClosedLoopConfig())
    expected = judge(loop, loop.drive(Slow())).document()
    values = {
        key: json.loads(value) for key, value in first.values.items() if key != "first_faults"
    }
    assert values == json.loads(json.dumps(expected))
    assert (tmp_path / "results" / "drives.json").is_file() and (
        tmp_path / "results" / "junit.xml"
    ).is_file()

    told = [decode_odometry(data) for data in client.heard["vehicle_1/odom"][:10]]
    stamps = sorted(
        {stamp for stamp, *_ in told}
    )  # where everyone is at the start may have been told twice
    assert np.diff(stamps).tolist() == [100_000_000] * (len(stamps) - 1) and len(stamps) > 5
    assert all(
        frame == run.road.frame_id and np.isfinite(state).all() for _, frame, _, state in told
    )
    assert {child for _, _, child, _ in decode_frames(client.heard["/tf"][0])} == {
        "vehicle_1",
        "vehicle_bus_2",
    }
    grid = decode_map(client.heard["traffic/local_map"][0])[1]
    assert not grid.drivable.all() and grid.drivable.any()


def test_ego_faults_are_reported(traffic, client):
    from rcl_interfaces.srv import SetParameters
    from rclpy.parameter import Parameter

    process = traffic(patience=60.0)
    far = np.array([1e5, 0.0, 0.0, 0.0])
    frame = hand_made_run().road.frame_id
    wrong = {
        "not finite": ("ego/cmd_vel", encode_twist(float("nan"), 0.0)),
        "jumped": ("ego/odom", encode_odometry(far, 0.0, "base_link", frame, 0)),
        "is not that of the scenario": (
            "ego/odom",
            encode_odometry(far, 0.0, "base_link", "odom", 0),
        ),
        "damaged": ("ego/cmd_vel", encode_twist(1.0, 0.0)[:20]),
        "must ascend": (
            "ego/path",
            encode_path(np.zeros((2, 3)), np.zeros(2, dtype=np.int64), frame, 0),
        ),
    }
    for topic, data in wrong.values():
        client.say(topic, data)
        step(client)
    for data in (encode_twist(1.0, 0.0), encode_twist(2.0, 0.0)):
        client.say("ego/cmd_vel", data)
    client.until(
        lambda: any("2 replies to one state" in status.message for status in client.statuses()),
        "a second reply",
    )
    short = SetParameters.Request(parameters=[Parameter("patience", value=0.1).to_parameter_msg()])
    assert client.call(SetParameters, "/traffic/set_parameters", short).results[0].successful
    for _ in range(9):
        step(client)  # silent
    found = set()

    def all_said():
        for status in client.statuses():
            if status.level is Level.WARN:
                found.update(text for text in (*wrong, "s old") if text in status.message)
        return len(found) >= 3

    client.until(all_said, "faults on /diagnostics")
    assert process.poll() is None
    drive_to_the_end(client)  # a step waits for no silent ego
    client.wait("verdicts")
    values = decode_diagnostics(client.heard["verdicts"][-1])[1][0].values
    assert int(values["faults"]) >= 5
    faults = str(values["first_faults"])
    assert (
        "not finite" in faults and "jumped" in faults and "is not that of the scenario" in faults
    )


@pytest.mark.parametrize(
    ("stamp", "step"),
    [(0, 7), (FIRST_STAMP_NS, 0), (FIRST_STAMP_NS + 300_000_000, 3), (10**18, 7)],
)
def test_stamp_names_the_answered_state(stamp, step):
    run = hand_made_run()
    loop = ClosedLoop(run.generated.scenarios[0], 0, run.road, ClosedLoopConfig())
    data = encode(
        VELOCITY_STAMPED, stamp=stamp, frame_id="base_link", twist=(3.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    )
    assert decode_command("ego/cmd_vel_stamped", data, loop, "vehicle_1", 7).step == step


def test_two_egos_and_late_commands(traffic, client):
    """A second node that commands, and commands whose stamp is old: the drive goes on, and the verdict says both."""
    import rclpy

    from scenario_gen.ros.common.topics import create_publisher

    process = traffic(patience=0.2)
    client.announce("ego/cmd_vel_stamped")
    client.until(
        lambda: client.node.count_subscribers("ego/cmd_vel_stamped") >= 1, "ego/cmd_vel_stamped"
    )
    other = rclpy.create_node("second_planner", context=client.node.context)
    try:
        publisher = create_publisher(other, "ego/cmd_vel")
        client.until(
            lambda: (
                client.node.count_publishers("ego/cmd_vel") >= 2
                and publisher.get_subscription_count() >= 1
            ),
            "both",
        )
        for _ in range(12):
            client.say("ego/cmd_vel", encode_twist(3.0, 0.0))
            step(client)
    finally:
        other.destroy_node()
    ahead = (3.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    stale = encode(
        VELOCITY_STAMPED, stamp=FIRST_STAMP_NS, frame_id="base_link", twist=ahead
    )  # of the drive's begin
    for _ in range(12):
        client.say("ego/cmd_vel_stamped", stale)
        step(client)
    drive_to_the_end(client)
    values = decode_diagnostics(client.wait("verdicts")[-1])[1][0].values
    faults = str(values["first_faults"])
    assert "several egos" in faults and "second_planner" in faults and int(values["faults"]) > 20
    client.until(
        lambda: any(b"s old" in data for data in client.heard["/diagnostics"]),
        "the late command on /diagnostics",
    )
    assert process.poll() is None


@pytest.fixture
def sampler(domain):
    """A client under the name of the node that may publish the ego's goal beside traffic."""
    made = Client(domain, "gp_sampler")
    yield made
    made.close()


def test_live_scenarios_use_their_road(start, client, sampler):
    """What gp_sampler publishes, in any order; neither requests from before the start nor cancelled ones."""
    from std_srvs.srv import Trigger

    run = hand_made_run()
    slot = EgoSlot(run.encounter.vehicles[1], np.zeros(4), np.ones(4))
    parted = tuple(with_witness(one, 1) for one in run.generated.scenarios)
    live = replace(run, generated=replace(run.generated, scenarios=parted, ego=slot))
    topics = ("map", "scenarios/info", "scenarios", "ego/witness")

    def publish(request):
        for wanted in topics:  # entries before scenarios, witnesses last
            for topic, data, _ in result_messages(live, request):
                if topic == wanted:
                    client.say(topic, data)

    publish("old")
    start("traffic", lock_step=True)
    for topic in topics:
        client.until(lambda topic=topic: client.node.count_subscribers(topic) >= 1, topic)
    client.hear("ego/goal", "traffic/local_map", "verdicts", "/diagnostics")
    publish("trial")
    publish("stopped")
    cancelled = request_summary(live.generated, "stopped", 1, 0, cancelled=True)
    client.say("scenarios/info", encode_info(cancelled))
    _, _, child, goal = decode_state(client.wait("ego/goal")[0])
    witness = parted[0].reference_drive
    assert child == f"vehicle_{token(slot.vehicle.id)}"
    assert goal[:2] == pytest.approx(witness.position[0, -1])
    client.announce("ego/cmd_vel")
    sampler.announce("ego/goal")
    client.until(lambda: client.node.count_subscribers("ego/cmd_vel") >= 1, "ego/cmd_vel")
    drive_to_the_end(client)
    client.wait("traffic/local_map")
    driven = [decode_diagnostics(client.wait("verdicts")[0])[1][0].subject]
    while (answer := client.call(Trigger, "/traffic/next", Trigger.Request())).success:
        driven.append(answer.message)
    assert driven == [f"scenario trial {scenario.index}" for scenario in parted]


class ByPlace:
    """The planner: a speed that depends on where it is, so that an answer to another odometry than the last one shows."""

    def reset(self, task):
        self.step = task.step

    def act(self, seen):
        return of_twist(seen.ego, 3.0 + math.sin(seen.ego.x), 0.0, self.step)


PLANNER = """
import math
from pathlib import Path
import subprocess
import sys
import time

import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry

rclpy.init()
node = rclpy.create_node("by_place")
command = node.create_publisher(Twist, "ego/cmd_vel", 10)


def act(heard, left=[int(sys.argv[2])]):
    left[0] -= 1
    if left[0] < 0:
        return
    time.sleep(float(sys.argv[3]) if sys.argv[3:] else 0.0)
    twist = Twist()
    twist.linear.x = 3.0 + math.sin(heard.pose.pose.position.x)
    command.publish(twist)
    if sys.argv[4:]:
        twist.linear.x = 0.0
        command.publish(twist)


node.create_subscription(Odometry, sys.argv[1], act, 10)
rclpy.spin(node)
"""


def test_planner_node_verdicts_equal_in_process(bag, tmp_path, monkeypatch):
    """`scenario-gen drive --ros`: any node that answers its odometry with a command; what it is not is said."""
    program = tmp_path / "by_place.py"
    program.write_text(PLANNER)
    words = ["drive", str(bag), "--count", "2", "--set", "bars.goals=0.0"]
    words += [
        word
        for bar in ("collisions", "at_fault", "off_road", "faults")
        for word in ("--set", f"bars.{bar}=1.0")
    ]
    words += ["--set", "bars.progress=0.0", "--workers", "1"]
    command = f"{sys.executable} {program} vehicle_1/odom"
    for out, more in (
        ("over_dds", ["--ros", "--planner", f"{command} 1000000"]),
        ("twice", ["--ros", "--planner", f"{command} 1000000 0 twice", "--count", "1"]),
        ("in_process", ["--planner", "test_traffic:ByPlace"]),
    ):
        told = CliRunner().invoke(app, [*words, "--out", str(tmp_path / out), *more])
        assert told.exit_code == 0, told.output
    over_dds, in_process = (
        json.loads((tmp_path / out / "drives.json").read_text())
        for out in ("over_dds", "in_process")
    )
    assert over_dds["drives"] == in_process["drives"] and len(in_process["drives"]) == 2
    twice = json.loads((tmp_path / "twice" / "drives.json").read_text())
    assert all(drive["faults"] > 0 for drive in twice["drives"])
    assert any("replies to one state" in note for note in twice["notes"])
    monkeypatch.setattr(planner_trials, "SILENCE_TIMEOUT_S", 1.0)
    for planner, more, said in (
        (f"{sys.executable} -c 'print(7)'", (), "ended with code 0; its last output: 7"),
        ("no_such_program", (), "No such"),
        (f"{command} 9", (), "has sent no command for 1 s: it hangs"),
        (
            f"{command} 1000000 0.05",
            ("--set", "drive_time=0.1"),
            "did not finish in 0.1 s",
        ),
    ):
        refused = CliRunner().invoke(
            app, [*words, "--out", str(tmp_path / "none"), "--ros", "--planner", planner, *more]
        )
        assert said in str(refused.exception), refused.output
