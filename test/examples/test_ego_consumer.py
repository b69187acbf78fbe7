# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The example drives among the vehicles of the node `traffic`, and stops for what is in its way."""

import importlib.util
import math
import os
from pathlib import Path
import signal
import subprocess
import sys

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples" / "ego_consumer.py"
ROUTE = np.column_stack([np.arange(0.0, 60.0, 0.5), np.zeros(120), np.zeros(120)])


@pytest.fixture(scope="module")
def example():
    import scenario_gen.ros.nodes  # noqa: F401  (what the wheels need)

    specification = importlib.util.spec_from_file_location("ego_consumer", EXAMPLE)
    module = importlib.util.module_from_spec(specification)
    sys.modules["ego_consumer"] = module
    specification.loader.exec_module(module)
    return module


def grid_with_car(x):
    """Cells of 0.5 m from (-10, -10), with a car across the route at x."""
    cells = np.zeros((40, 120), dtype=np.int8)
    cells[16:24, int((x + 10.0) * 2) : int((x + 12.0) * 2)] = 100
    return cells, np.array([-10.0, -10.0]), 0.5


def test_it_stops_before_what_is_in_its_way_and_steers_back_to_its_route(example):
    assert example.free_way(*grid_with_car(30.0), ROUTE, 0) == pytest.approx(30.0, abs=0.5)
    assert example.free_way(*grid_with_car(45.0), ROUTE[:20], 0) == math.inf
    x, speed = 0.0, 8.0
    for _ in range(200):
        wanted, _ = example.decide(np.array([x, 0.0, 0.0]), speed, ROUTE, grid_with_car(30.0), 8.0)
        speed = min(max(wanted, speed - 0.9), speed + 0.4)
        x += 0.1 * speed
    assert speed < 0.1 and 20.0 < x + example.FRONT < 30.0
    _, right = example.decide(np.array([10.0, 1.0, 0.0]), 5.0, ROUTE, None, 8.0)
    _, left = example.decide(np.array([10.0, -1.0, 0.0]), 5.0, ROUTE, None, 8.0)
    assert right < 0.0 < left


@pytest.mark.dds
def test_it_drives_a_scenario_in_lock_step(tmp_path):
    from support.node_server import start_nodes
    from support.suite_processes import Client, RESOURCES

    from msg_conventions.diagnostics import decode_diagnostics
    from scenario_gen import generate, read_log
    from scenario_gen.bags.recordings.write import write_recording
    from scenario_gen.base.ros_domain import free_domain

    (encounter,) = read_log(RESOURCES / "synthetic_c").encounters
    bag = write_recording(tmp_path / "bag", generate(encounter, "straight", count=1, seed=7))
    with free_domain() as domain:
        traffic = start_nodes(
            "traffic",
            "--ros-args",
            "-p",
            f"bag:={bag}",
            "-p",
            "lock_step:=true",
            ROS_DOMAIN_ID=str(domain),
        )
        command = [
            sys.executable,
            str(EXAMPLE),
            "--ros-args",
            "-p",
            "speed:=10.0",
            "-p",
            "lock_step:=true",
        ]
        ego = subprocess.Popen(
            command,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=os.environ | {"ROS_DOMAIN_ID": str(domain)},
        )
        client = Client(domain)
        try:
            client.hear("verdicts")
            (status,) = decode_diagnostics(client.wait("verdicts")[0])[1]
        finally:
            client.close()
            ego.send_signal(signal.SIGINT)
            output, _ = ego.communicate(timeout=180.0)
            print(output)  # pytest shows it where the test fails
            traffic.kill()
            traffic.communicate()
    assert status.values["collision"] == "null" and float(status.values["progress"]) > 0.5, status
    assert "Traceback" not in output, output
    assert ego.returncode == 0
