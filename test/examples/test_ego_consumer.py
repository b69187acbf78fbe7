# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The example drives among real scenarios of the real suite, and its geometry is right."""

import importlib.util
import math
import os
from pathlib import Path
import signal
import subprocess
import sys

import numpy as np
import pytest
from shapely import affinity
from shapely.geometry import box

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "test" / "nodes"))
EXAMPLE = ROOT / "examples" / "ego_consumer.py"
SIZE = np.array((4.8, 1.9))


@pytest.fixture(scope="module")
def example():
    import scenario_gen.nodes  # noqa: F401  (what the wheels need)

    specification = importlib.util.spec_from_file_location("ego_consumer", EXAMPLE)
    module = importlib.util.module_from_spec(specification)
    sys.modules["ego_consumer"] = module
    specification.loader.exec_module(module)
    return module


def rectangle(pose, size):
    flat = box(-0.5 * size[0], -0.5 * size[1], 0.5 * size[0], 0.5 * size[1])
    return affinity.translate(affinity.rotate(flat, pose[2], (0, 0), use_radians=True), pose[0], pose[1])


def test_overlap_agrees_with_shapely(example):
    rng = np.random.Generator(np.random.PCG64(3))
    one, other = (np.column_stack([rng.uniform(-4, 4, (300, 2)), rng.uniform(-4, 4, 300)]) for _ in range(2))
    expected = [rectangle(a, SIZE).intersects(rectangle(b, SIZE * 0.8)) for a, b in zip(one, other, strict=True)]
    assert example.overlap(one, SIZE, other, SIZE * 0.8).tolist() == expected
    assert 50 < sum(expected) < 250


def test_time_to_collision_of_two_that_meet_head_on(example):
    ego, other = np.array((0.0, 0.0, 0.0, 10.0)), np.array(((44.8, 0.0, math.pi, 10.0),))
    assert example.time_to_collision(ego, SIZE, other, SIZE[None]) == pytest.approx(2.0, abs=0.11)
    beside = other + np.array((0.0, 3.0, 0.0, 0.0))
    assert example.time_to_collision(ego, SIZE, beside, SIZE[None]) == math.inf


def test_a_driver_that_brakes_stops_and_one_that_does_not_crashes(example):
    plan = np.column_stack([np.arange(0.0, 101.0, 5.0), np.zeros(21), np.zeros(21)])
    states = np.zeros((2, 150, 4))
    states[0, 0, 3], states[1, :, 0] = 8.0, 60.0  # a car stands in the way
    traffic = example.Traffic("map", ["ego", "other"], np.array((SIZE, SIZE)), states)
    crashes, least = example.Driver(8.0, 3.0).drive(plan, SIZE, traffic)
    assert crashes == 0 and 0.0 < least <= 3.0
    crashes, least = example.Driver(8.0, 0.0).drive(plan, SIZE, traffic)
    assert crashes > 5 and least == 0.0


@pytest.mark.dds
def test_it_drives_among_the_scenarios_of_the_suite(tmp_path):
    from suite_processes import Client, Processes, RESOURCES

    from msg_conventions.diagnostics import decode_diagnostics
    from msg_conventions.topics import TOPICS
    from scenario_gen.nodes.domain import free_domain

    nodes = {
        "log_player": ["-p", f"log_path:={RESOURCES / 'synthetic_c'}"],
        "road_server": ["-p", "road_name:=straight", "-p", "wait_for_tracks:=true"],
        "segmenter": [],
        "planner": [],
        "gp_sampler": ["-p", "count:=4", "-p", "seed:=7"],
    }
    with free_domain() as domain:
        suite = Processes(tmp_path, domain, nodes)
        command = [sys.executable, str(EXAMPLE), "--ros-args", "-p", "ego:='1'", "-p", "speed:=12.0"]
        ego = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=os.environ | {"ROS_DOMAIN_ID": str(domain)}
        )
        client = Client(domain)
        try:
            TOPICS["ego_consumer/report"] = TOPICS["scenarios/info"]
            client.hear("/ego_consumer/report", "/scenarios", "/tracks")
            reports = client.wait("/ego_consumer/report", 4, timeout=180.0)
            decoded = [decode_diagnostics(data) for data in reports]
            for stamp, (status,) in decoded:
                assert stamp > 0
                assert float(status.values["min_time_to_collision"]) >= 0.0, status
                assert float(status.values["collision_seconds"]) >= 0.0
            assert len({status.name for _, (status,) in decoded}) == 4
        finally:
            TOPICS.pop("ego_consumer/report", None)
            client.close()
            ego.send_signal(signal.SIGINT)
            output, _ = ego.communicate(timeout=180.0)
            print(output)  # pytest shows it where the test fails
            suite.end()
    assert "Traceback" not in output, output
    assert ego.returncode == 0
