# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Every executable ends without a traceback, whenever it is asked to."""

import os
import signal
import subprocess
import sys
import time

import pytest
from support.suite_processes import RESOURCES

from scenario_gen.bags.storage.bag import read_messages

pytestmark = pytest.mark.dds


ENDS = {
    "once": (signal.SIGINT,),
    "twice": (signal.SIGINT, signal.SIGINT),
    "terminated": (signal.SIGTERM,),
}


def test_a_recorder_closes_its_bag(start, tmp_path):
    """Three recorders of one player, each ended in its own way."""
    player = start("player", bag=RESOURCES / "synthetic_c", rate=50.0, loop=True)
    recording = {"topics": "/?vehicle_.*", "compress": False}
    recorders = {
        name: start("recorder", "-r", f"__node:={name}", bag=tmp_path / name, **recording)
        for name in ENDS
    }
    deadline = time.monotonic() + 180.0
    files = [tmp_path / name / f"{name}_0.mcap" for name in ENDS]
    while not all(file.is_file() and file.stat().st_size > 100_000 for file in files):
        assert time.monotonic() < deadline, "nothing was recorded"
        time.sleep(0.1)
    for name, signals in ENDS.items():
        for number in signals:
            recorders[name].send_signal(number)
            time.sleep(0.05)
    for process in recorders.values():
        output, _ = process.communicate(timeout=180.0)
        assert process.returncode == 0 and "Traceback" not in output, output
    player.terminate()
    output, _ = player.communicate(timeout=180.0)
    assert "Traceback" not in output, output
    for name in ENDS:
        assert len(list(read_messages(tmp_path / name))) > 100


def test_ctrl_c_while_the_libraries_load(domain):
    command = [sys.executable, "-m", "scenario_gen.ros.common.start", "gp_sampler"]
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=os.environ | {"ROS_DOMAIN_ID": str(domain), "PYTHONUNBUFFERED": "1"},
    )
    time.sleep(0.7)
    process.send_signal(signal.SIGINT)
    output, _ = process.communicate(timeout=180.0)
    assert "Traceback" not in output
    assert process.returncode == 0


STUCK = """
import ctypes
import sys
from scenario_gen.ros.common import process
from rclpy.node import Node
process.NODE_END_S = 1.0
class Stuck(Node):
    def __init__(self, namespace):
        super().__init__("stuck", namespace=namespace)
    def autostart(self):
        print("ready", flush=True)
    def close(self):
        print("closed")
        hold("close")
    def destroy_node(self):
        hold("destroy_node")
def hold(place):
    if place == sys.argv[1]:
        ctypes.PyDLL(None).sleep(600)
process.run_nodes([Stuck], ["stuck"])
"""


@pytest.mark.parametrize("place", ["destroy_node", pytest.param("close", marks=pytest.mark.long)])
def test_stuck_node_ends_all_the_same(domain, place):
    """Where it was stuck is said."""
    environment = os.environ | {"ROS_DOMAIN_ID": str(domain)}
    process = subprocess.Popen(
        [sys.executable, "-c", STUCK, place],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=environment,
    )
    try:
        assert process.stdout is not None and process.stdout.readline() == "ready\n"
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=180.0)
    finally:
        process.kill()
    assert process.returncode == 1
    assert "Timeout" in output and f"in {place}" in output, output


def test_bad_start_is_one_message(start, tmp_path):
    (tmp_path / "text.mcap").write_text("no bag")
    for node, parameters, words in (
        ("road_server", {"road.lane_width": -1.0}, "lane_width"),
        ("player", {"bag": tmp_path / "text.mcap"}, "text.mcap"),
        ("recorder", {"bag": tmp_path}, "exists"),
    ):
        process = start(node, **parameters)
        output, _ = process.communicate(timeout=180.0)
        assert process.returncode == 2
        assert words in output
        assert "Traceback" not in output, output
