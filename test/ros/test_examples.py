# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The examples for users of nav2 and Autoware: what they publish of a scenario."""

import importlib.util
from pathlib import Path
import shutil
import subprocess
import sys

import numpy as np
import pytest
from support.bag_examples import hand_made_run
from support.message_decoders import decode_frames
from support.skips import NO_COMPILER

from msg_conventions.autoware import OBJECTS
from msg_conventions.roads import decode_map
from scenario_gen.bags.recordings.scenario_decoder import TOPICS
from scenario_gen.bags.recordings.write import result_messages

pytestmark = pytest.mark.dds
EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
STAND_INS = Path(__file__).resolve().parent / "stand_ins"
HEADERS = Path(sys.prefix) / "include"


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


def test_nav2_marks_and_clears_vehicles(load):
    """As its static layer does: each grid replaces the layer, and is as large as the map, or the costmap is resized."""
    module, node = load("nav2_obstacles", "Obstacles")
    sent = []
    node.grid = type("Publisher", (), {"publish": staticmethod(sent.append)})
    node.publish()
    assert not sent, "no map yet"
    (grid,) = [data for topic, data, _ in result_messages(hand_made_run()) if topic == "map"]
    node.receive("map", grid)
    node.publish()
    _, road = decode_map(grid)
    _, shown = decode_map(sent[0])
    assert shown.drivable.shape == road.drivable.shape and shown.frame_id == road.frame_id
    assert (shown.resolution, *shown.origin) == (road.resolution, *road.origin)
    scenario = node.scenario
    last = scenario.time[-1]
    lethal = [module.occupied_cells(scenario, time, road) for time in (0.0, last)]
    for time, cells in zip((0.0, last), lethal, strict=True):
        states = scenario.at(time)
        rows, columns = ((states.position - road.origin) / road.resolution).astype(int).T[::-1]
        assert cells[rows, columns].all()
        area_m2 = cells.sum() * road.resolution**2
        footprints_m2 = sum(vehicle.length * vehicle.width for vehicle in scenario.vehicles)
        assert footprints_m2 < area_m2 < 2.0 * footprints_m2
    assert not (lethal[0] & lethal[1]).any(), "cells are free again when a vehicle has left them"


def test_autoware_gets_objects_frames_and_clock(load):
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


@pytest.mark.skipif(
    not (shutil.which("g++") and (HEADERS / "trajectory_msgs").is_dir()), reason=NO_COMPILER
)
def test_cpp_example_reads_scenarios(tmp_path):
    """Against the genuine headers of the messages; rclcpp, which is not among the wheels, has a stand-in."""
    folders = [f"-I{folder}" for folder in (STAND_INS, *sorted(HEADERS.iterdir()))]
    options = ["-std=c++17", "-Wall", "-Wextra", "-Werror", "-D_GLIBCXX_ASSERTIONS", *folders]
    source = EXAMPLES / "cpp" / "scenario_listener.cpp"
    subprocess.run(["g++", *options, source, "-o", tmp_path / "listener"], check=True)
    ran = subprocess.run([tmp_path / "listener"], capture_output=True, text=True, check=True)
    car = "  1:4.5x1.8:car ends at (0.0, 0.0) m"
    told = ["1 vehicles for 3.0 s in map", car]
    assert ran.stdout.splitlines() == [*told, *told, "    with 7.0 m/s"]
