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

"""What the executables answer to --help, without starting anything."""

from dataclasses import fields
import importlib
import subprocess
import sys

import pytest

from scenario_gen.nodes.process import asks_for_help
from scenario_gen.nodes.ros_parameters import help_of
from scenario_gen.nodes.start import node_class, NODES


@pytest.mark.dds
def test_the_player_lists_its_parameters():
    command = [sys.executable, "-m", "scenario_gen.nodes.start", "player", "--help"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120.0, check=False)
    assert done.returncode == 0 and done.stderr == ""
    assert "[--namespace NAME]... [--ros-args -p PARAMETER:=VALUE ...]" in done.stdout
    assert "  rate := 1.0\n      how many times as fast as it was recorded" in done.stdout
    for name in ("bag", "topics", "rate", "start_offset", "loop", "paused", "clock"):
        assert f"  {name} := " in done.stdout


@pytest.mark.dds
def test_help_may_be_read_in_part():
    command = f"{sys.executable} -m scenario_gen.nodes.start suite --help | head -n 3"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, timeout=120.0, check=False)
    assert done.stderr == "" and "suite: all nodes in one process" in done.stdout


@pytest.mark.parametrize("name", NODES)
def test_every_node_lists_all_of_its_parameters(name):
    module = importlib.import_module(f"scenario_gen.nodes.{name}")
    text = help_of(name, (node_class(name),))
    for entry in fields(module.Config):
        assert f"  {entry.name} := " in text or f"  {entry.name}." in text


def test_help_behind_ros_args_is_not_ours():
    assert asks_for_help(["player", "--help"]) and asks_for_help(["player", "-h", "--ros-args", "-p", "bag:=x"])
    assert not asks_for_help(["player", "--ros-args", "-p", "bag:=x"])
