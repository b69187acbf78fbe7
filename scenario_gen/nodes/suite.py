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

"""suite: all nodes in one process with one executor, for small machines: `ros2 run scenario_gen suite`.

A parameter is that of every node that has it: `--ros-args -p log_path:=LOG -p road_name:=straight -p seed:=7`; one node's own
stands in a parameter file, or, where there is no namespace, behind its name: `-p recorder:bag:=BAG`.
`--nodes segmenter,planner` takes only some; `player` must be asked for.
"""

from collections.abc import Callable
import importlib
import sys
from typing import Any

from scenario_gen.nodes.base import run_nodes
from scenario_gen.nodes.usage import asks_for_help, show

CLASSES = {
    "recorder": "Recorder",
    "evaluator": "Evaluator",
    "gp_sampler": "GpSampler",
    "planner": "Planner",
    "segmenter": "Segmenter",
    "road_server": "RoadServer",
    "log_player": "LogPlayer",
    "player": "Player",
}
DEFAULT = ",".join(list(CLASSES)[:-1])  # who listens stands before who speaks


def chosen(arguments: list[str]) -> tuple[list[str], list[str]]:
    """Return the names of the nodes asked for, in the order in which they start, and the other arguments."""
    names, rest = DEFAULT, list(arguments)
    if "--nodes" in rest:
        at = rest.index("--nodes")
        names = rest[at + 1] if at + 1 < len(rest) else ""
        del rest[at : at + 2]
    wanted = [name.strip() for name in names.split(",")]
    if unknown := [name for name in wanted if name not in CLASSES]:
        raise SystemExit(f"usage: --nodes NAME,NAME of {', '.join(CLASSES)}; unknown: {', '.join(unknown)!r}")
    return [name for name in CLASSES if name in wanted], rest


def maker(name: str) -> Callable[[str | None], Any]:
    """Return the class of a node."""
    made: Callable[[str | None], Any] = getattr(importlib.import_module(f"scenario_gen.nodes.{name}"), CLASSES[name])
    return made


def main() -> None:
    """Run the nodes."""
    names, arguments = chosen(sys.argv)
    if asks_for_help(arguments):
        show(f"{(__doc__ or '').strip()}\n")
    sys.exit(run_nodes([maker(name) for name in names], arguments))
