# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The launch files' arguments: the nodes' parameters, checked before the first process starts.

An argument on the command line has precedence over the parameter file named there, which has
precedence over config/suite.yaml. An empty argument is not given. `ros2 launch` has no numba, so
this module imports no node; resources/launch_arguments.json lists their parameters.
"""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, Field
import json
from pathlib import Path
import re
import sys
import tempfile
from typing import Any

import yaml

from scenario_gen.base.documents import parse_yaml, shown
from scenario_gen.base.errors import did_you_mean, InputError
from scenario_gen.base.parameters import check_value, flatten, parameter, Parameters
from scenario_gen.base.registry import installed
from scenario_gen.ros.common.node_parameters import check_topics, ROAD_NAMES
from scenario_gen.ros.node_names import SUITE

LIVE = "live"
LOG_LEVELS = ("debug", "info", "warn", "error", "fatal")
NAMESPACE = re.compile(r"/|/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*", re.ASCII)
# Matches every node. Of two matching keys rcl applies the one that it meets last for the first
# time, so this key differs from the usual `/**`.
EVERY_NODE = "/**/**"
_NUMBER = r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?"
STATES = re.compile(rf"([^;]+:\s*{_NUMBER}(\s+{_NUMBER}){{2,3}}\s*(;|$)\s*)+", re.IGNORECASE)
TABLE = Path(__file__).resolve().parents[1] / "resources" / "launch_arguments.json"
ARGUMENT_NAMES = {"log_path": "log", "road_name": "road"}  # parameter -> argument


@dataclass(frozen=True)
class LaunchOptions(Parameters):
    """Arguments that are not parameters of nodes."""

    namespace: str = parameter("", "namespace of all nodes")
    params: str = parameter("", "parameter file; arguments on the command line have precedence")
    log_level: str = parameter("info", "lowest severity that is logged", choices=LOG_LEVELS)
    rviz: bool = parameter(False, "open RViz")
    respawn: bool = parameter(False, "restart a node that ended, after 2 s; never a recorder")
    composed: bool = parameter(False, "run all nodes in one process, for small machines")
    without: str = parameter("", f"nodes to leave out, separated by commas: {', '.join(SUITE)}")


OPTIONS = {name: entry for name, (entry, _) in flatten(LaunchOptions()).items()}


@dataclass(frozen=True)
class LaunchFile:
    """A launch file and its arguments.

    Attributes:
        name: of the file.
        parameters: of its nodes, by argument.
        nodes: that have a parameter, by argument; none: all.
        declarations: of all arguments.
    """

    name: str
    parameters: Mapping[str, str]
    nodes: Mapping[str, Sequence[str]]
    declarations: Mapping[str, "Field[Any]"]

    def descriptions(self) -> dict[str, str]:
        """Return the descriptions that `ros2 launch --show-args` prints."""
        return {
            name: f"{entry.metadata['meaning']} (default: {entry.default!r})"
            for name, entry in self.declarations.items()
        }


def _launch_file(name: str, without: Sequence[str] = ()) -> LaunchFile:
    """Return a launch file whose arguments the table lists, without some of the options.

    A parameter of a drive is also an argument without its prefix, unless a node's hides it.
    """
    parameters: dict[str, str] = {}
    nodes: dict[str, Sequence[str]] = {}
    declarations: dict[str, Field[Any]] = {}
    table = json.loads(TABLE.read_text("utf-8"))[name]
    for parameter_name, row in table.items():
        short_name = parameter_name.removeprefix("drive.")
        argument = parameter_name if short_name in table else short_name
        argument = ARGUMENT_NAMES.get(argument, argument)
        nodes[argument] = row.pop("nodes")
        declarations[argument] = parameter(**row)
        parameters[argument] = parameter_name
    options = {name: entry for name, entry in OPTIONS.items() if name not in without}
    return LaunchFile(name, parameters, nodes, declarations | options)


SUITE_FILE = _launch_file("suite.launch.py")
DRIVE_FILE = _launch_file("drive.launch.py", without=("composed", "without"))


@dataclass(frozen=True)
class Launch:
    """The nodes' parameters by name, and the options of the launch file."""

    parameters: Mapping[str, Any]
    options: LaunchOptions

    @property
    def excluded(self) -> list[str]:
        """The nodes that are not started."""
        return [name.strip() for name in self.options.without.split(",") if name.strip()]

    def parameter_files(self, folder: str, *defaults: Path) -> list[str]:
        """Return each node's parameter files. The last one has precedence.

        It is written to `folder`, which has the log of this launch.
        """
        files = [str(path) for path in defaults]
        if self.options.params:
            files.append(self.options.params)
        if self.parameters:
            body = {EVERY_NODE: {"ros__parameters": dict(self.parameters)}}
            with tempfile.NamedTemporaryFile(
                "w",
                dir=folder,
                prefix="arguments_",
                suffix=".yaml",
                encoding="utf-8",
                delete=False,
            ) as file:
                yaml.safe_dump(body, file, allow_unicode=True)
            files.append(file.name)
        return files


def parse_arguments(
    file: LaunchFile, texts: Mapping[str, str], words: Sequence[str] | None = None
) -> Launch:
    """Parse and check the arguments of a launch file.

    Args:
        file: the launch file.
        texts: values of the arguments by name, empty if not given. A launch file that includes
            ours may add others.
        words: the command line; by default that of this process.

    Raises:
        InputError: an argument has an unusable value, or there is no such argument; the message
            names it.
    """
    _refuse_unknown(file, texts, sys.argv if words is None else words)
    values = {
        name: _parse_value(name, entry, texts[name])
        for name, entry in file.declarations.items()
        if texts.get(name)
    }
    launch = Launch(
        {
            parameter_name: values[name]
            for name, parameter_name in file.parameters.items()
            if name in values and (name, values[name]) != ("log", LIVE)
        },
        LaunchOptions(**{name: value for name, value in values.items() if name in OPTIONS}),
    )
    is_suite = "log" in file.parameters
    _check_options(launch)
    _refuse_unused(file, launch, values)
    _check_texts(launch.parameters)
    _check_paths(launch, is_suite=is_suite)
    if is_suite and not (values.get("log") or launch.options.params):
        raise InputError(
            f"no log is given: write log:=FILE, or log:={LIVE} to wait for tracks, or fixes and "
            "speeds, of other nodes"
        )
    return launch


def _refuse_unknown(file: LaunchFile, names: Iterable[str], words: Sequence[str]) -> None:
    """Raise InputError if an argument is unknown.

    Where another launch file includes this one, only names that resemble an argument are refused.
    """
    is_included = file.name not in [Path(word).name for word in words]
    given = {name for name, assigned, _ in (word.partition(":=") for word in words) if assigned}
    for name in (name for name in names if name not in file.declarations):
        near = did_you_mean(name, file.declarations)
        is_own = name in given and not is_included
        if near or is_own:
            raise InputError(
                f"{name}:= is no argument of {file.name}{near or '; --show-args lists them'}"
            )


def _refuse_unused(file: LaunchFile, launch: Launch, names: Iterable[str]) -> None:
    """Raise InputError if an argument is a parameter only of nodes that are not started."""
    for name in names:
        nodes = file.nodes.get(name, ())
        if nodes and set(nodes) <= set(launch.excluded):
            raise InputError(f"{name}:= has no effect without {' and '.join(nodes)}")


def _parse_value(name: str, declaration: "Field[Any]", text: str) -> Any:
    try:
        value: Any = text
        if isinstance(declaration.default, float):
            with suppress(ValueError):  # YAML reads 1e-6 as a text
                value = float(text)
        elif not isinstance(declaration.default, str):
            value = parse_yaml(text, "its value")
        elif len(text) > 1 and text[0] == text[-1] and text[0] in "'\"":
            value = text[1:-1]  # `ros2 run -p` needs quotes around `1: 10 2 0`, a launch does not
        check_value(name, declaration, value)
    except InputError as error:
        raise InputError(f"{name}:={shown(text)}: {error}") from error
    return value


def _check_options(launch: Launch) -> None:
    """Raise InputError if the namespace is invalid or an excluded node is unknown."""
    namespace = launch.options.namespace
    if namespace and not NAMESPACE.fullmatch(namespace):
        raise InputError(
            f"namespace:={shown(namespace)}: write names of letters, digits and underscores, "
            "separated by /"
        )
    for name in launch.excluded:
        if name not in SUITE:
            raise InputError(
                f"without:={name}: choose of {', '.join(SUITE)}{did_you_mean(name, SUITE)}"
            )


def _check_texts(parameters: Mapping[str, Any]) -> None:
    """Raise InputError if states, a regular expression or a road's name is invalid."""
    for name in ("starts", "goals"):
        text = parameters.get(name, "")
        if text and not STATES.fullmatch(text):
            raise InputError(
                f"{name}:={shown(text)}: write `id: x y yaw [speed]`, vehicles separated by `;`"
            )
    check_topics(parameters.get("topics", ""))
    road = parameters.get("road_name", "")
    roads = (*ROAD_NAMES, *installed("scenario_gen.roads"))
    if road and road not in roads and not Path(road).exists():
        raise InputError(
            f"road:={shown(road)}: no map with this name; choose a file, or of {', '.join(roads)}"
            f"{did_you_mean(road, roads)}"
        )


def _check_paths(launch: Launch, *, is_suite: bool) -> None:
    """Raise InputError if an input does not exist, or an output cannot be created."""
    params = launch.options.params
    inputs = {"params": params, "log": launch.parameters.get("log_path")}
    output = "bag"
    if not is_suite:
        inputs["bag"] = launch.parameters.get("bag")
        output = "results"
    for name, path in inputs.items():
        if path and not Path(path).exists():
            raise InputError(
                f"{name}:={shown(path)}: it does not exist; check the name and the folder"
            )
    if path := launch.parameters.get(output):
        _check_folder(f"{output}:={shown(path)}", Path(path), new=is_suite)
    if params and "ros__parameters" not in Path(params).read_text("utf-8", errors="replace"):
        raise InputError(f"params:={params}: not a parameter file; it has no ros__parameters")


def _check_folder(argument: str, folder: Path, *, new: bool) -> None:
    """Raise InputError if a folder cannot be created, or exists where a `new` one is needed.

    Remove it again.
    """
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=not new)
    except OSError as error:
        raise InputError(f"{argument}: {error.strerror}; name another folder") from error
    finally:
        for path in missing:
            with suppress(OSError):
                path.rmdir()
