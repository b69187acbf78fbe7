# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The launch files' arguments: the nodes' parameters, checked before the first process starts.

An argument on the command line has precedence over the parameter file named there, which has
precedence over config/suite.yaml. An empty argument is not given. This module needs no rclpy.
"""

import atexit
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, Field
from pathlib import Path
import re
import tempfile
from typing import Any

import yaml

from scenario_gen.base.documents import parse_yaml, shown
from scenario_gen.base.errors import did_you_mean, InputError
from scenario_gen.base.parameters import check_value, flatten, parameter, Parameters
from scenario_gen.base.registry import installed
from scenario_gen.ros.common import node_parameters
from scenario_gen.ros.node_names import SUITE

LIVE = "live"
LOG_LEVELS = ("debug", "info", "warn", "error", "fatal")
NAMESPACE = re.compile(r"/|/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*", re.ASCII)
# Matches every node. Of two matching keys rcl applies the one that it meets last for the first
# time, so this key differs from the usual `/**`.
EVERY_NODE = "/**/**"
_NUMBER = r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?"
STATES = re.compile(rf"([^;]+:\s*{_NUMBER}(\s+{_NUMBER}){{2,3}}\s*(;|$)\s*)+", re.IGNORECASE)


@dataclass(frozen=True)
class SharedParameters(Parameters):
    """Parameters that several nodes of the suite, or all, declare for themselves."""

    ego: str = parameter("", "id of the vehicle to leave out for a planner under test")
    starts: str = parameter(
        "", "start states on the road, `id:x y yaw [speed]`, vehicles separated by `;`"
    )
    goals: str = parameter("", "end states, in the same form")
    use_sim_time: bool = parameter(False, "the nodes follow /clock")
    autostart: bool = parameter(True, "the nodes configure and activate themselves")


@dataclass(frozen=True)
class LaunchOptions(Parameters):
    """Arguments that are not parameters of nodes."""

    namespace: str = parameter("", "namespace of all nodes")
    params: str = parameter("", "parameter file; arguments on the command line have precedence")
    log_level: str = parameter("info", "lowest severity that is logged", choices=LOG_LEVELS)
    rviz: bool = parameter(False, "open RViz")
    composed: bool = parameter(False, "run all nodes in one process, for small machines")
    respawn: bool = parameter(False, "restart a node that ended, after 2 s; never a recorder")
    without: str = parameter("", f"nodes to leave out, separated by commas: {', '.join(SUITE)}")


ARGUMENT_NAMES = {"log_path": "log", "road_name": "road"}  # parameter -> argument
_SUITE_PARAMETERS = (
    node_parameters.LogPlayerParameters(),
    node_parameters.RoadServerParameters(),
    node_parameters.RecorderParameters(),
    node_parameters.SamplerParameters(),
    SharedParameters(),
)
_DRIVE_PARAMETERS = flatten(node_parameters.TrafficParameters())
Arguments = Mapping[str, tuple[str, "Field[Any]"]]  # argument -> parameter, declaration
SUITE_ARGUMENTS: Arguments = {
    ARGUMENT_NAMES.get(name, name): (name, entry)
    for config in _SUITE_PARAMETERS
    for name, (entry, _) in flatten(config).items()
}
DRIVE_ARGUMENTS: Arguments = {  # a node's parameter hides one of the drive with the same name
    name.removeprefix("drive."): (name, _DRIVE_PARAMETERS[name][0])
    for name in sorted(_DRIVE_PARAMETERS, key=lambda name: "." not in name)
}
OPTIONS = {name: entry for name, (entry, _) in flatten(LaunchOptions()).items()}


@dataclass(frozen=True)
class Launch:
    """The nodes' parameters by name, and the options of the launch file."""

    parameters: Mapping[str, Any]
    options: LaunchOptions

    @property
    def excluded(self) -> list[str]:
        """The nodes that are not started."""
        return [name.strip() for name in self.options.without.split(",") if name.strip()]

    def parameter_files(self, *defaults: Path) -> list[str]:
        """Return each node's parameter files. The last one has precedence.

        It is removed with this process.
        """
        files = [str(path) for path in defaults]
        if self.options.params:
            files.append(self.options.params)
        if self.parameters:
            body = {EVERY_NODE: {"ros__parameters": dict(self.parameters)}}
            with tempfile.NamedTemporaryFile(
                "w", prefix="launch_params_", suffix=".yaml", encoding="utf-8", delete=False
            ) as file:
                yaml.safe_dump(body, file, allow_unicode=True)
            atexit.register(Path(file.name).unlink, missing_ok=True)
            files.append(file.name)
        return files


def descriptions(arguments: Arguments) -> dict[str, str]:
    """Return the descriptions that `ros2 launch --show-args` prints."""
    return {
        name: f"{entry.metadata['meaning']} (default: {entry.default!r})"
        for name, entry in _declarations(arguments).items()
    }


def _declarations(arguments: Arguments) -> dict[str, "Field[Any]"]:
    return {name: entry for name, (_, entry) in arguments.items()} | OPTIONS


def parse_arguments(arguments: Arguments, texts: Mapping[str, str]) -> Launch:
    """Parse and check the arguments of a launch file.

    Args:
        arguments: of the launch file, in addition to `OPTIONS`.
        texts: values on the command line by name, empty if not given. A launch file that includes
            ours may add others.

    Raises:
        InputError: an argument has an unusable value, or resembles one of ours; the message names
            it.
    """
    declarations = _declarations(arguments)
    values: dict[str, Any] = {}
    for name, text in texts.items():
        if not text:
            continue
        if name in declarations:
            values[name] = _parse_value(name, declarations[name], text)
        elif suggestion := did_you_mean(name, declarations):
            raise InputError(
                f"{name}:= is no argument of this launch file{suggestion} There are "
                f"{', '.join(declarations)}"
            )
    launch = Launch(
        {
            parameter_name: values[name]
            for name, (parameter_name, _) in arguments.items()
            if name in values and (name, values[name]) != ("log", LIVE)
        },
        LaunchOptions(**{name: value for name, value in values.items() if name in OPTIONS}),
    )
    is_suite = "log" in arguments
    _check_options(launch)
    _check_texts(launch.parameters)
    _check_paths(launch, is_suite=is_suite)
    if is_suite and not (values.get("log") or launch.options.params):
        raise InputError(
            f"no log is given: write log:=FILE, or log:={LIVE} to wait for tracks, or fixes and "
            "speeds, of other nodes"
        )
    return launch


def _parse_value(name: str, declaration: "Field[Any]", text: str) -> Any:
    try:
        value = text
        if not isinstance(declaration.default, str):
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
    node_parameters.RecorderParameters(topics=parameters.get("topics", ""))
    road = parameters.get("road_name", "")
    roads = (*node_parameters.ROAD_NAMES, *installed("scenario_gen.roads"))
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
