# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What the executables answer to --help, without starting anything."""

from dataclasses import fields
import importlib

import pytest
from support.node_server import start_nodes

from scenario_gen.ros.common.ros_parameters import help_of
from scenario_gen.ros.common.start import chosen_nodes, node_class
from scenario_gen.ros.node_names import COMPOSABLE


@pytest.mark.dds
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("-p", "frames:="),
            "'-p frames:='; write -r FROM:=TO and -p NAME:=VALUE, an empty text as -p \"NAME:=''\"",
        ),
        (("-p", "starts:=1: 31 68 0 10"), "Unknown YAML event; write"),
        (("-r", "foo"), "'-r foo'"),
        (("--params-file", "no_such.yaml"), "no_such.yaml"),
        (("--no-such",), "--no-such"),
    ],
    ids=str,
)
def test_unreadable_arguments_give_one_line(words, said):
    process = start_nodes("suite" if "-r" in words else "player", "--ros-args", *words)
    output, _ = process.communicate(180.0)
    (line,) = output.splitlines()
    assert (
        process.returncode == 2
        and line.startswith("error: ")
        and said in line
        and "/src/" not in line
    )


@pytest.mark.parametrize("name", COMPOSABLE)
def test_nodes_list_all_parameters(name):
    module = importlib.import_module(f"scenario_gen.ros.nodes.{name}")
    text = help_of(name, (node_class(name),))
    for entry in fields(module.Config):
        assert f"  {entry.name} := " in text or f"  {entry.name}." in text


def test_nodes_are_chosen_by_name():
    assert chosen_nodes(["suite", "--nodes", "segmenter,recorder", "--ros-args"]) == (
        ["recorder", "segmenter"],
        ["suite", "--ros-args"],
    )
    assert "player" not in chosen_nodes(["suite"])[0]
    for words in (["--nodes", "no_such"], ["--nodes"]):
        with pytest.raises(SystemExit, match="usage"):
            chosen_nodes(["suite", *words])
