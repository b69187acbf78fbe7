# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The action: scenario_gen_interfaces as colcon builds it, a suite in a real process, and a client in another."""

import json
import os
from pathlib import Path
import re
import shutil
import signal
import subprocess
import sys
import sysconfig

import pytest
from support.suite_processes import ROOT

from scenario_gen.base.ros_domain import free_domain, this_host_only
from scenario_gen.ros.common.requests import Code
from scenario_gen.ros.nodes.gp_sampler import GpSampler

pytestmark = pytest.mark.dds
SUCCEEDED, CANCELED, ABORTED = 4, 5, 6  # action_msgs/GoalStatus
PACKAGE = "scenario_gen_interfaces"
NODES = "log_player,road_server,segmenter,planner,gp_sampler"


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """What finds the package that colcon builds; the test skips where it cannot be built."""
    base, prefix = tmp_path_factory.mktemp("interfaces"), os.environ["AMENT_PREFIX_PATH"]
    programs = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    missing = [name for name in ("cmake", "c++") if not shutil.which(name, path=programs)]
    missing += [] if Path(sysconfig.get_path("include"), "Python.h").exists() else ["Python.h"]
    if missing:
        pytest.skip(
            f"{', '.join(missing)} not here, with which colcon builds interfaces (apt-get install g++ python3-dev)"
        )
    environment = os.environ | {"CMAKE_PREFIX_PATH": prefix.replace(":", ";"), "PATH": programs}
    settings = [
        f"-DCMAKE_PROJECT_INCLUDE={ROOT / 'test' / 'ros' / 'wheels.cmake'}",
        f"-DPython3_EXECUTABLE={sys.executable}",
    ]
    places = [
        "--base-paths",
        ROOT / PACKAGE,
        "--build-base",
        base / "build",
        "--install-base",
        base / "install",
    ]
    command = [
        Path(sys.executable).with_name("colcon"),
        "--log-base",
        base / "log",
        "build",
        *places,
        "--cmake-args",
        *settings,
    ]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout[-3000:] + run.stderr[-3000:]
    installed = base / "install" / PACKAGE
    (modules,) = installed.glob("lib/python3*/site-packages")
    paths = {
        "LD_LIBRARY_PATH": installed / "lib",
        "PYTHONPATH": modules,
        "AMENT_PREFIX_PATH": installed,
    }
    return {
        name: os.pathsep.join(filter(None, [str(path), os.environ.get(name, "")]))
        for name, path in paths.items()
    }


@pytest.fixture(scope="module")
def environment(built):
    with free_domain() as domain:
        yield os.environ | built | this_host_only() | {"ROS_DOMAIN_ID": str(domain)}


@pytest.fixture(scope="module")
def suite(environment, tmp_path_factory):
    """A suite that generates on request only; it has no tracks until its log player is activated."""
    log = tmp_path_factory.mktemp("suite") / "log.txt"
    values = {
        "log_player:autostart": "false",
        "log_path": ROOT / "examples" / "my_log.csv",
        "road_name": "four_way",
        "generate_on_input": "false",
    }
    words = [word for name, value in values.items() for word in ("-p", f"{name}:={value}")]
    command = [
        sys.executable,
        "-m",
        "scenario_gen.ros.common.start",
        "suite",
        "--nodes",
        NODES,
        "--ros-args",
        *words,
    ]
    with log.open("w") as file:
        process = subprocess.Popen(command, env=environment, stdout=file, stderr=file)
        yield log
        process.send_signal(signal.SIGINT)
        assert process.wait(180.0) == 0, log.read_text()[-3000:]


def ask(environment, *goals):
    """Send goals at once; return how each went, by its place, and how many scenarios were heard."""
    command = [sys.executable, "-m", "support.action_client", json.dumps(goals)]
    pipes = {"capture_output": True, "text": True, "timeout": 550.0}
    run = subprocess.run(command, check=False, cwd=ROOT / "test", env=environment, **pipes)
    assert run.returncode == 0, run.stderr[-3000:]
    *ended, heard = json.loads(run.stdout.splitlines()[-1])
    return sorted(ended, key=lambda one: one["goal"]), heard["heard"]


def test_codes_are_those_of_action():
    text = (ROOT / PACKAGE / "action" / "Generate.action").read_text()
    assert {
        name: int(code) for name, code in re.findall(r"^uint8 ([A-Z_]+)=(\d)", text, re.MULTILINE)
    } == dict(Code.__members__)


def test_goals_wait_for_inputs(environment, suite):
    wanted = [{"parameters": {"count": 100 - k, "seed": k, "request": f"r{k}"}} for k in range(3)]
    (first, *others, hasty), heard = ask(environment, *wanted, {"wait": 0.0, "then": "log_player"})
    assert (first["status"], first["code"], first["request"]) == (SUCCEEDED, Code.OK, "r0")
    assert first["requested"] == first["published"] == 100 and 0 <= first["first"] < first["last"]
    refused = sum(
        int(count) for cause, count in first["account"].items() if cause.startswith("refused.")
    )
    assert int(first["account"]["candidates"]) == first["last"] + 1 == 100 + refused
    assert any("tracks" in waiting_for for waiting_for in first["feedback"])
    assert [one["published"] for one in others] == [99, 98]
    assert (hasty["status"], hasty["code"]) == (ABORTED, Code.NOT_READY) and re.search(
        "not active|waiting for", hasty["reason"]
    )
    assert heard == 297
    assert "ERROR" not in suite.read_text()


def test_wrong_goals_get_their_code(environment, suite):
    wrong = [
        {"parameters": values}
        for values in ({"cout": 3}, {"count": 0}, {"request": "1 2"}, {"goals": "1: 9999 0 0 5"})
    ]
    many = {"parameters": {"count": 100_000}}
    hasty, _ = ask(
        environment, *[many | {"cancel": [0, 0, []]}] * 6
    )  # before, while and after their work begins
    assert [(one["status"], one["code"]) for one in hasty] == [(CANCELED, Code.CANCELLED)] * 6
    goals = [
        *[many | {"cancel": [1, 0, [GpSampler.THREADS]]}] * GpSampler.THREADS,
        many | {"cancel": [0, 1, []]},
        *wrong,
    ]
    answers, heard = ask(environment, *goals, {"parameters": {"count": 3, "seed": 9}})
    *running, waiting = answers[: GpSampler.THREADS + 1]
    *refused, last = answers[GpSampler.THREADS + 1 :]
    for one in (*running, waiting):
        assert (one["status"], one["code"]) == (CANCELED, Code.CANCELLED)
        assert "cancelled" in one["reason"]
    assert all(one["published"] > 0 for one in running) and waiting["published"] == 0
    assert [one["status"] for one in refused] == [ABORTED] * 4
    assert [one["code"] for one in refused] == [*[Code.INVALID] * 3, Code.IMPOSSIBLE]
    assert all(
        word in one["reason"]
        for word, one in zip(("cout", "count", "'1 2'", "vehicle"), refused, strict=True)
    )
    assert last["code"] == Code.OK and heard == sum(one["published"] for one in running) + 3
