# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""ROS parameters as the tools of ROS give them: numbers for texts, whole numbers for real ones, what they dumped."""

import ast
from pathlib import Path
import sys

from hypothesis import given, strategies
import pytest
from rclpy.parameter import Parameter, parameter_dict_from_yaml_file, parameter_value_to_python
from support.node_server import start_nodes
from support.suite_processes import Client, RESOURCES
import yaml

from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import flatten
from scenario_gen.ros.common.ros_parameters import config_of, converted, with_values
from scenario_gen.ros.common.start import node_class
from scenario_gen.ros.node_names import ALL, SUITE
from scenario_gen.ros.nodes.gp_sampler import Config

DECLARED = {name: entry for name, (entry, _) in flatten(Config()).items()}
RESERVED = "start_type_description_service"  # read-only, of every rclpy node


@given(strategies.integers(0, 2**63 - 1))
def test_number_is_taken_for_an_id(number):
    assert with_values(Config(), [Parameter("ego", value=number)]).ego == str(number)


@given(strategies.floats(allow_nan=False, allow_infinity=False))
def test_real_number_of_any_tool_taken(number):
    entry = DECLARED["limits.time_resolution"]
    assert converted(entry, str(number)) == number
    assert converted(entry, yaml.safe_load(yaml.safe_dump(number))) == number
    assert type(converted(entry, int(number))) is float


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("ego", True),
        ("limits.car.max_speed", "fast"),
        ("limits.car.max_speed", True),
        ("count", "5"),
        ("count", 5.0),
    ],
)
def test_obvious_mistakes_are_refused(name, value):
    with pytest.raises(InputError, match=name.rpartition(".")[2]):
        with_values(Config(), [Parameter(name, value=value)])


def config_names(function: ast.AST) -> set[str]:
    """The parameters that a function reads as `config.NAME` or `self.config.NAME`."""
    return {
        node.attr
        for node in ast.walk(function)
        if isinstance(node, ast.Attribute)
        and getattr(node.value, "attr", getattr(node.value, "id", "")) == "config"
    }


@pytest.mark.parametrize("name", ALL)
def test_startup_parameters_cannot_be_changed(name):
    """`param set` must not say "successful" and change nothing."""
    node = node_class(name)
    tree = ast.parse(Path(sys.modules[node.__module__].__file__).read_text())
    kinds = (ast.FunctionDef, ast.Lambda)
    early, later = set(), set()
    for function in (entry for entry in ast.walk(tree) if isinstance(entry, kinds)):
        at_start = getattr(function, "name", "lambda") in ("__init__", "autostart")
        (early if at_start else later).update(config_names(function))
    declared = {key: entry for key, (entry, _) in flatten(config_of(node)).items()}
    changeable = {key for key, entry in declared.items() if not entry.metadata["fixed"]}
    assert not (early - later) & changeable


def dumped(client: Client, node: str) -> dict[str, object]:
    """What `ros2 param dump` asks for: every parameter of a node and its value."""
    from rcl_interfaces.srv import GetParameters, ListParameters

    names = client.call(
        ListParameters, f"{node}/list_parameters", ListParameters.Request()
    ).result.names
    values = client.call(
        GetParameters, f"{node}/get_parameters", GetParameters.Request(names=names)
    ).values
    return dict(zip(names, map(parameter_value_to_python, values), strict=True))


def loaded(client: Client, node: str, path) -> set[str]:
    """What `ros2 param load` does with a file; return what was refused."""
    from rcl_interfaces.srv import SetParameters

    messages = list(parameter_dict_from_yaml_file(str(path)).values())
    results = client.call(
        SetParameters, f"{node}/set_parameters", SetParameters.Request(parameters=messages)
    ).results
    return {
        message.name
        for message, result in zip(messages, results, strict=True)
        if not result.successful
    }


@pytest.mark.dds
def test_nodes_load_their_dumped_parameters(domain, client, tmp_path):
    """And each parameter has the type that is declared, whatever was given."""
    values = {
        "ego": "21202",
        "log.vehicles": "21202",
        "starts": "'21202: 10.5 -1.75 0.0 8.0; 2: 3 4 1.5'",
        "limits.car.max_speed": "40",
        "limits.time_resolution": "1.0e-06",
        "log.origin": "48.1,11.5",
        "autostart": "false",
    }
    words = [word for name, value in values.items() for word in ("-p", f"{name}:={value}")]
    where = {"ROS_DOMAIN_ID": str(domain), "ROS_LOG_DIR": str(tmp_path)}
    process = start_nodes("suite", "--namespace", "/a", "--ros-args", *words, **where)
    bag = ("-p", f"bag:={RESOURCES / 'synthetic_c'}", "-p", "paused:=true")
    player = start_nodes("player", "--ros-args", "-r", "__ns:=/a", *bag, **where)

    def reloaded(node: str, values: dict[str, object]) -> set[str]:
        """Load a file of parameters; return the names of those that are refused."""
        file = tmp_path / f"{node}.yaml"
        file.write_text(yaml.dump({f"/a/{node}": {"ros__parameters": values}}))
        return loaded(client, f"/a/{node}", file)

    def typed(values: dict[str, object]) -> dict[str, tuple[type, object]]:
        return {key: (type(value), value) for key, value in values.items()}

    try:
        before = {name: dumped(client, f"/a/{name}") for name in (*SUITE, "player")}
        for name, values in before.items():
            assert RESERVED in values
            assert reloaded(name, values) == set(), name
            assert typed(dumped(client, f"/a/{name}")) == typed(values)
        assert before["log_player"]["log.vehicles"] == "21202"
        sampler = before["gp_sampler"]
        assert sampler["ego"] == "21202"
        assert sampler["starts"] == "21202:10.5 -1.75 0.0 8.0; 2:3 4 1.5"
        assert type(sampler["limits.car.max_speed"]) is float
        assert sampler["limits.time_resolution"] == 1e-6
        assert reloaded("player", {"bag": "/other"}) == {"bag"}, "it is read-only"
        other = {RESERVED: False, "ego": 7, "limits": {"car": {"max_speed": 30}}}
        assert reloaded("gp_sampler", other) == {RESERVED}, "what is read-only is not changed"
        changed = typed(dumped(client, "/a/gp_sampler"))
        assert changed[RESERVED] == (bool, True)
        assert changed["ego"] == (str, "7")
        assert changed["limits.car.max_speed"] == (float, 30.0)
    finally:
        for one in (process, player):
            one.terminate()
        assert [one.wait(180.0) for one in (process, player)] == [0, 0]
