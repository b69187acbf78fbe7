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

"""What an executable says of itself when it is asked for help, or is called as it cannot be."""

from collections.abc import Sequence
import os
import sys
from typing import Any

from rclpy.utilities import remove_ros_args

from scenario_gen.parameters import flatten

USAGE = "usage: {name} [--namespace NAME]... [--ros-args -p PARAMETER:=VALUE ...]"


def help_of(name: str, makers: Sequence[Any]) -> str:
    """Return the usage of an executable, and every parameter of its nodes: default value, unit, meaning, choices."""
    lines = [USAGE.format(name=name)]
    for make in makers:
        module = sys.modules[make.__module__]
        lines += ["", f"{(module.__doc__ or '').strip()}", "", f"Parameters of {make.__name__}:"]
        for parameter, (entry, value) in flatten(module.Config()).items():
            meta = entry.metadata
            unit = f" [{meta['unit']}]" if meta["unit"] else ""
            choices = f"; one of {', '.join(meta['choices'])}" if meta["choices"] else ""
            lines.append(f"  {parameter} := {_written(value)}{unit}\n      {meta['meaning']}{choices}")
    return "\n".join(lines)


def show(text: str) -> None:
    """Print a text that somebody may read in part only: `--help | head`."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # or Python complains when it ends


def _written(value: object) -> str:
    """A value as the command line takes it."""
    return str(value).lower() if isinstance(value, bool) else f"'{value}'" if isinstance(value, str) else str(value)


def asks_for_help(arguments: Sequence[str]) -> bool:
    """Say whether `--help` stands among the words that are not ROS's."""
    return bool({"-h", "--help"} & set(remove_ros_args(list(arguments))[1:]))


def namespaces(arguments: Sequence[str]) -> list[str | None]:
    """Return the values of `--namespace` (one node for each, all in this process); [None] if there is none."""
    rest = remove_ros_args(list(arguments))[1:]
    if any(word != "--namespace" for word in rest[::2]) or len(rest) % 2:
        raise SystemExit(f"{USAGE.format(name=arguments[0])}\n--help lists the parameters")
    return [name or None for name in rest[1::2]] or [None]
