# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The launch file: what it starts, what it refuses, and which of several values of a parameter wins in the nodes."""

import importlib
import os
from pathlib import Path
import subprocess
import sys
from types import SimpleNamespace
from unittest import mock

from node_server import start_nodes
import pytest
from suite_processes import RESOURCES, ROOT
import yaml

from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import flatten
from scenario_gen.cli.launching import declared, ENTRIES, LIVE, OF_LAUNCH, OTHER_NAMES, ROADS
from scenario_gen.roads import BUILT_IN

SUITE = ("road_server", "segmenter", "planner", "gp_sampler", "evaluator", "preview", "log_player")
LOG = str(RESOURCES / "synthetic_c")


def launched(file: str = "suite.launch.py", **arguments: str) -> list[SimpleNamespace]:
    """What a launch file would start; the launch package is not among the wheels, so stand-ins take its place."""
    started, declared, functions = [], {}, []

    def node(**keywords):
        started.append(SimpleNamespace(**{"name": None, "respawn": False, "parameters": [], **keywords}))
        return started[-1]

    def configuration(name):
        return SimpleNamespace(perform=lambda context: context[name])

    def declare(name, *, default_value, description):
        assert description
        declared[name] = default_value

    def opaque(*, function):
        functions.append(function)

    stand_ins = {
        "launch": mock.MagicMock(),
        "launch.actions": mock.MagicMock(DeclareLaunchArgument=declare, OpaqueFunction=opaque),
        "launch.substitutions": mock.MagicMock(LaunchConfiguration=configuration),
        "launch_ros": mock.MagicMock(),
        "launch_ros.actions": mock.MagicMock(Node=node),
        "ament_index_python.packages": mock.MagicMock(get_package_share_directory=lambda _: str(ROOT)),
    }
    source = (ROOT / "launch" / file).read_text()
    with mock.patch.dict(sys.modules, stand_ins):
        scope: dict[str, object] = {}
        exec(compile(source, file, "exec"), scope)
        scope["generate_launch_description"]()
        try:
            functions[0](dict(arguments))
            assert set(arguments) <= set(declared)
            return functions[1](declared | arguments)
        except InputError:
            assert not started, "nothing may be started before all is checked"
            raise


def words(node: SimpleNamespace) -> list[str]:
    """The command line with which launch_ros starts a node, behind its executable."""
    names = ["-r", f"__node:={node.name}"] if node.name else []
    files = [word for path in node.parameters for word in ("--params-file", path)]
    return ["--ros-args", *node.ros_arguments, *names, "-r", f"__ns:={node.namespace or '/'}", *files]


def test_the_nodes_that_are_started(tmp_path):
    assert [node.executable for node in launched(log=LOG)] == list(SUITE)
    assert all(node.name == node.executable and not node.respawn for node in launched(log=LOG))
    recording = launched(log=LOG, bag=str(tmp_path / "bag"), respawn="true", log_level="debug", namespace="/a")
    assert [node.executable for node in recording] == ["recorder", *SUITE]
    assert [node.respawn for node in recording] == [False, *(True for _ in SUITE)]
    assert all(node.ros_arguments == ["--log-level", "debug"] and node.namespace == "/a" for node in recording)
    (together, *pictures) = launched(log=LIVE, composed="true", rviz="true")
    assert (together.executable, together.name) == ("suite", None)
    assert [node.executable for node in pictures] == ["static_transform_publisher", "rviz2"]
    file = tmp_path / "own.yaml"
    file.write_text(f"/**/recorder:\n  ros__parameters: {{bag: {tmp_path / 'bag'}}}\n")
    assert launched(log=LOG, params=str(file))[0].executable == "recorder"


def test_every_node_can_be_left_out(tmp_path):
    for name in SUITE:
        assert [node.executable for node in launched(log=LOG, without=name)] == [one for one in SUITE if one != name]
    recorded = launched(log=LOG, bag=str(tmp_path / "bag"), without="recorder, evaluator")
    assert [node.executable for node in recorded] == [one for one in SUITE if one != "evaluator"]


def test_arguments_have_their_true_defaults_and_count_only_where_they_are_given():
    assert declared()["count"][0] == "50" and declared()["autostart"][0] == "true" and declared()["road"][0] == "t_intersection"
    (node, *_) = launched(log=LOG, count="50")
    assert yaml.safe_load(Path(node.parameters[-1]).read_text())["/**/**"]["ros__parameters"]["count"] == 50
    (node, *_) = launched(log=LOG)
    assert "count" not in yaml.safe_load(Path(node.parameters[-1]).read_text())["/**/**"]["ros__parameters"]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"rate": "abc"}, "rate:=abc"),
        ({"bag": "no_such_bag"}, "bag:=no_such_bag: it does not exist"),
        ({"policy": "brave"}, "policy:=brave: .*reactive, replay"),
        ({"lock_step": "maybe"}, "lock_step:=maybe"),
        ({"lockstep": "true"}, "lockstep:= is no argument .*did you mean lock_step"),
        ({"params": "none.yaml"}, "params:=none.yaml: it does not exist"),
    ],
    ids=str,
)
def test_a_drive_that_cannot_be_is_refused_before_a_process_starts(given, said):
    with pytest.raises(InputError, match=said):
        launched("drive.launch.py", **given)


def test_a_road_of_an_installed_package_can_be_named(monkeypatch):
    monkeypatch.setattr("scenario_gen.cli.launching.installed", lambda group: {"plaza": group})
    assert launched(log=LOG, road="plaza")
    with pytest.raises(
        InputError, match=r"road:=nowhere: choose one of straight, .*, corridor, plaza, or give a map that exists"
    ):
        launched(log=LOG, road="nowhere")


def test_arguments_are_declared_as_the_nodes_declare_them():
    modules = [importlib.import_module(f"scenario_gen.ros.nodes.{node}") for node in ("recorder", *SUITE)]
    known = {}
    for module in modules:
        for name, (entry, _) in flatten(module.Config()).items():
            known.setdefault(name, entry)
    defaults = yaml.safe_load((ROOT / "config" / "suite.yaml").read_text())["/**"]["ros__parameters"]
    assert set(defaults) <= set(known)
    for name, entry in ENTRIES.items():
        if name not in (*OF_LAUNCH, "autostart", "use_sim_time"):
            theirs = known[OTHER_NAMES.get(name, name)]
            assert theirs.default == entry.default, name
            assert [theirs.metadata[end] for end in ("low", "high")] == [entry.metadata[end] for end in ("low", "high")], name
            assert defaults.get(theirs.name, entry.default) == entry.default, name
    assert (*BUILT_IN, "corridor") == ROADS


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"count": "abc"}, "count:=abc: .*whole number"),
        ({"count": "0"}, "count:=0: .*at least 1"),
        ({"cout": "3"}, "cout:= is no argument of this launch file; did you mean count"),
        ({"without": "planer"}, "without:=planer: choose of .*did you mean planner"),
        ({"without": "planner", "composed": "true"}, "cannot be combined with composed"),
        ({"seed": "1.5"}, "seed:=1.5"),
        ({"rate": "fast"}, "rate:=fast"),
        ({"encounter": "[1"}, r"encounter:=\[1"),
        ({"road": "nowhere"}, "road:=nowhere: choose one of straight"),
        ({"road": "no_such.yaml"}, "road:=no_such.yaml"),
        ({"log": "no_such.csv"}, "log:=no_such.csv: it does not exist"),
        ({"log": ""}, f"no log is given: write log:=FILE, or log:={LIVE}"),
        ({"starts": "1: 2 3"}, "starts"),
        ({"goals": "1: 2 3 x"}, "goals"),
        ({"log_level": "loud"}, "log_level:=loud: .*debug, info"),
        ({"respawn": "perhaps"}, "respawn:=perhaps"),
        ({"autostart": "2"}, "autostart:=2"),
        ({"namespace": "a b"}, "namespace:=a b"),
        ({"params": "no_such.yaml"}, "no_such.yaml"),
        ({"params": str(ROOT / "pyproject.toml")}, "pyproject.toml"),
        ({"params": str(ROOT / "config" / "suite_foxglove.json")}, "no ros__parameters"),
        ({"bag": LOG}, "bag:=.*exists already"),
        ({"bag": "new_bag", "composed": "true", "respawn": "true"}, "respawn:=true"),
    ],
    ids=str,
)
def test_what_cannot_be_is_refused_before_a_process_starts(given, said):
    with pytest.raises(InputError, match=said):
        launched(**({"log": LOG} | given))


@pytest.mark.dds
@pytest.mark.parametrize("composed", ["false", "true"])
def test_the_parameter_file_beats_the_defaults_and_arguments_beat_the_file(domain, client, tmp_path, composed):
    """Processes with the arguments that launch_ros gives them; the file has both kinds of sections: ROS takes the last."""
    from lifecycle_msgs.srv import GetState
    from rcl_interfaces.srv import GetParameters
    from rclpy.parameter import parameter_value_to_python

    file = tmp_path / "my.yaml"
    everywhere = {"count": 3, "seed": 5, "road_name": "straight", "ego": "7", "log_path": LOG}
    sections = {"/**": everywhere, "/**/gp_sampler": {"count": 4, "ego": "8", "limits": {"max_speed": 30}}}
    file.write_text(yaml.safe_dump({key: {"ros__parameters": body} for key, body in sections.items()}, sort_keys=False))
    space = f"/launched_{composed}"
    nodes = launched(params=str(file), ego="21202", namespace=space, autostart="false", composed=composed)
    wanted = [node for node in nodes if node.executable in ("suite", "gp_sampler", "road_server")]
    some = ["--nodes", "gp_sampler,road_server"] if composed == "true" else []
    where = {"ROS_DOMAIN_ID": str(domain), "ROS_LOG_DIR": str(tmp_path)}
    processes = [start_nodes(node.executable, *some, *words(node), **where) for node in wanted]
    try:

        def values(node: str, *names: str) -> list[object]:
            answer = client.call(GetParameters, f"{space}/{node}/get_parameters", GetParameters.Request(names=list(names)))
            return [parameter_value_to_python(value) for value in answer.values]

        assert values("gp_sampler", "count", "seed", "ego", "pair_map", "limits.max_speed") == [4, 5, "21202", True, 30.0]
        assert values("road_server", "road_name", "wait_for_tracks", "autostart") == ["straight", True, False]
        state = client.call(GetState, f"{space}/gp_sampler/get_state", GetState.Request())
        assert state.current_state.label == "unconfigured"
    finally:
        for process in processes:
            process.terminate()
        assert [process.wait(60.0) for process in processes] == [0 for _ in processes]


def test_what_is_written_for_a_launch_is_removed_at_its_end(tmp_path):
    code = (
        "import sys; from pathlib import Path; from scenario_gen.cli.launching import read_arguments;"
        "print(read_arguments({'log': sys.argv[1], 'ego': '007'}).parameter_files(Path('suite.yaml'))[-1]);"
        "assert not any(name.split('.')[0] in ('numba', 'rclpy') for name in sys.modules)"
    )
    command = [sys.executable, "-c", code, LOG]
    answer = subprocess.run(command, capture_output=True, text=True, env=os.environ | {"TMPDIR": str(tmp_path)}, check=True)
    assert Path(answer.stdout.strip()).parent == tmp_path
    assert list(tmp_path.iterdir()) == []


def test_a_drive_is_launched_with_its_parameters(domain, client, tmp_path):
    """The values that launch_ros would write for `traffic`: each is one of its parameters, and takes effect."""
    from rcl_interfaces.srv import GetParameters

    from scenario_gen.ros.plumbing.driving import Config

    (only, *pictures) = launched("drive.launch.py", ego="2", policy="replay", lock_step="true", namespace="/a", rviz="true")
    assert (only.executable, only.namespace, [one.executable for one in pictures]) == ("traffic", "/a", ["rviz2"])
    (values,) = only.parameters
    assert set(values) <= set(flatten(Config()))
    file = tmp_path / "values.yaml"
    file.write_text(yaml.safe_dump({"/**": {"ros__parameters": values | {"ego": 2}}}))  # launch_ros guesses a number
    process = start_nodes("traffic", "--ros-args", "-r", "__ns:=/a", "--params-file", str(file), ROS_DOMAIN_ID=str(domain))
    try:
        request = GetParameters.Request(names=["ego", "drive.policy", "lock_step"])
        ego, policy, lock_step = client.call(GetParameters, "/a/traffic/get_parameters", request).values
        assert (ego.string_value, policy.string_value, lock_step.bool_value) == ("2", "replay", True)
    finally:
        process.kill()
