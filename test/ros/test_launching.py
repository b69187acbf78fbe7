# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The launch files: what they start, what they refuse, and which of several values of a parameter wins in the nodes."""

import json
from pathlib import Path
import subprocess
import sys

import pytest
from support.launch_arguments import table_text
from support.launching import launched, words
from support.node_server import start_nodes
from support.suite_processes import RESOURCES, ROOT
import yaml

from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import flatten
from scenario_gen.roads.build import ROADS
from scenario_gen.ros.common.node_parameters import ROAD_NAMES
from scenario_gen.ros.common.ros_parameters import config_of
from scenario_gen.ros.common.start import node_class
from scenario_gen.ros.launch_arguments import (
    DRIVE_FILE,
    LIVE,
    parse_arguments,
    SUITE_FILE,
    TABLE,
)
from scenario_gen.ros.node_names import SUITE

LOG = str(RESOURCES / "synthetic_c")


def test_the_nodes_that_are_started(tmp_path):
    assert [(node.executable, node.name, node.respawn) for node in launched(log=LOG)] == [
        (name, name, False) for name in SUITE
    ]
    recording = launched(
        log=LOG, bag=str(tmp_path / "bag"), respawn="true", log_level="debug", namespace="/a"
    )
    assert [node.respawn for node in recording] == [name != "recorder" for name in SUITE]
    patient = [node.executable for node in recording if float(node.sigterm_timeout) > 30.0]
    assert patient == ["recorder"]  # it may still be closing its bag
    assert all(
        node.ros_arguments == ["--log-level", "debug"] and node.namespace == "/a"
        for node in recording
    )
    some = [name for name in SUITE if name not in ("planner", "recorder")]
    assert [node.executable for node in launched(log=LOG, without="planner, recorder")] == some
    (together, *pictures) = launched(
        log=LIVE, composed="true", rviz="true", without="planner,recorder"
    )
    assert (together.executable, together.name, together.arguments) == (
        "suite",
        None,
        ["--nodes", ",".join(some)],
    )
    assert [node.executable for node in pictures] == ["static_transform_publisher", "rviz2"]


def test_arguments_are_parameters_of_nodes():
    known = {name for node in SUITE for name in flatten(config_of(node_class(node)))}
    assert set(SUITE_FILE.parameters.values()) == known | {"autostart", "use_sim_time"}
    assert set(DRIVE_FILE.parameters.values()) == set(flatten(config_of(node_class("traffic"))))
    assert {"step", "patience", "drive.patience"} <= set(DRIVE_FILE.parameters)
    assert "(default: 50)" in SUITE_FILE.descriptions()["count"]
    assert TABLE.read_text("utf-8") == table_text(), "run: python support/launch_arguments.py"
    (node, *_) = launched(log=LOG, count="50")
    assert yaml.safe_load(Path(node.parameters[-1]).read_text())["/**/**"]["ros__parameters"] == {
        "count": 50,
        "log_path": LOG,
    }
    defaults = yaml.safe_load((ROOT / "config" / "suite.yaml").read_text())["/**"][
        "ros__parameters"
    ]
    assert set(defaults) <= known
    assert set(ROADS.built_in) == set(ROAD_NAMES)
    assert launched(log=LOG, starts="2: 53 4.57 0 9.5; a b:1 -2e1 .5", road="corridor")


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ({"count": "abc"}, "count:=abc"),
        ({"cout": "3"}, "cout:="),
        ({"without": "planner", "vehicle_type": "van"}, "vehicle_type:="),
        ({"file": "drive.launch.py", "composed": "true"}, "composed:="),
        ({"file": "drive.launch.py", "results": f"{ROOT / 'setup.py'}/x"}, "results:="),
        ({"log": "no_such.csv"}, "log:=no_such.csv"),
        ({"namespace": "a b"}, "namespace:=a b"),
        ({"params": str(ROOT / "pyproject.toml")}, "ros__parameters"),
        ({"bag": "/proc/x"}, "bag:=/proc/x"),
        ({"starts": "1 2 3"}, "starts:=1 2 3"),
        ({"topics": "(a+)+b"}, "topics"),
    ],
    ids=str,
)
def test_impossible_arguments_are_refused(given, named):
    with pytest.raises(InputError, match=named):
        launched(**(given if "file" in given else {"log": LOG} | given))


@pytest.mark.dds
@pytest.mark.parametrize("composed", [pytest.param("false", marks=pytest.mark.long), "true"])
def test_arguments_beat_file_beats_defaults(domain, client, tmp_path, composed):
    """Processes with the arguments that launch_ros gives them; the file has both kinds of sections: ROS takes the last."""
    from lifecycle_msgs.srv import GetState
    from rcl_interfaces.srv import GetParameters
    from rclpy.parameter import parameter_value_to_python

    file = tmp_path / "my.yaml"
    everywhere = {"count": 3, "seed": 5, "road_name": "straight", "ego": "7", "log_path": LOG}
    sections = {
        "/**": everywhere,
        "/**/gp_sampler": {"count": 4, "ego": "8", "limits": {"car": {"max_speed": 30}}},
    }
    file.write_text(
        yaml.safe_dump(
            {key: {"ros__parameters": body} for key, body in sections.items()}, sort_keys=False
        )
    )
    space = f"/launched_{composed}"
    nodes = launched(
        params=str(file), ego="21202", namespace=space, autostart="false", composed=composed
    )
    wanted = [node for node in nodes if node.executable in ("suite", "gp_sampler", "road_server")]
    some = ["--nodes", "gp_sampler,road_server"] if composed == "true" else []
    where = {"ROS_DOMAIN_ID": str(domain), "ROS_LOG_DIR": str(tmp_path)}
    processes = [start_nodes(node.executable, *some, *words(node), **where) for node in wanted]
    try:

        def values(node: str, *names: str) -> list[object]:
            answer = client.call(
                GetParameters,
                f"{space}/{node}/get_parameters",
                GetParameters.Request(names=list(names)),
            )
            return [parameter_value_to_python(value) for value in answer.values]

        assert values(
            "gp_sampler", "count", "seed", "ego", "pair_map", "limits.car.max_speed"
        ) == [4, 5, "21202", True, 30.0]
        assert values("road_server", "road_name", "wait_for_tracks", "autostart") == [
            "straight",
            True,
            False,
        ]
        state = client.call(GetState, f"{space}/gp_sampler/get_state", GetState.Request())
        assert state.current_state.label == "unconfigured"
    finally:
        for process in processes:
            process.terminate()
        assert [process.wait(180.0) for process in processes] == [0 for _ in processes]


def test_including_launch_file_has_own_arguments():
    texts = {"log": LOG, "robot": "big"}
    line = ["/opt/ros/jazzy/bin/ros2", "launch", "my_robot", "everything.launch.py", "robot:=big"]
    assert parse_arguments(SUITE_FILE, texts, line).parameters == {"log_path": LOG}
    line[2:4] = ["scenario_gen", "suite.launch.py"]
    with pytest.raises(InputError, match=r"robot:= is no argument of suite\.launch\.py"):
        parse_arguments(SUITE_FILE, texts, line)


IN_ROS_PYTHON = """
import json, sys
before = set(sys.modules)
from pathlib import Path
from scenario_gen.ros.launch_arguments import DRIVE_FILE, parse_arguments, SUITE_FILE
given = {"log": sys.argv[1], "bag": sys.argv[2], "starts": "'1: 31.8 68.45 0.0 10.7'", "goals": "1: 2 3 0", "road": "straight"}
for file, given in ((DRIVE_FILE, {}), (SUITE_FILE, given)):
    for name in file.parameters:
        entry = file.declarations[name]
        choices = entry.metadata["choices"]
        text = choices[-1] if choices else "/tmp" if name == "results" else "1"
        given.setdefault(name, text if isinstance(entry.default, str) and name != "bag" else json.dumps(entry.default).strip('"'))
    launch = parse_arguments(file, given)
print(json.dumps(dict(launch.parameters)))
others = {name.partition(".")[0] for name in set(sys.modules) - before if getattr(sys.modules[name], "__file__", None)}
assert others <= {*sys.stdlib_module_names, "scenario_gen", "yaml", "_yaml"}, others
"""


def test_launch_imports_only_ros_python(tmp_path):
    """Whatever is given: `ros2 launch` runs in ROS's own Python."""
    command = [sys.executable, "-c", IN_ROS_PYTHON, LOG, str(tmp_path / "bag")]
    answer = subprocess.run(command, capture_output=True, text=True, check=True)
    assert json.loads(answer.stdout)["starts"] == "1: 31.8 68.45 0.0 10.7"
