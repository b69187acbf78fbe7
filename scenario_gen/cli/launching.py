# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The launch files: their arguments are the nodes' parameters, and are checked before the first process starts.

What is given on the command line beats the parameter file named there, which beats config/suite.yaml. Empty means not given.
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
from scenario_gen.ros.plumbing import node_parameters

NODES = (
    "recorder",
    "road_server",
    "segmenter",
    "planner",
    "gp_sampler",
    "evaluator",
    "preview",
    "log_player",
)
"""Who listens comes first."""
LIVE = "live"
LEVELS = ("debug", "info", "warn", "error", "fatal")
NAMESPACE = re.compile(r"/|/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*", re.ASCII)
# Matches every node. Of two keys that match, rcl lets the one win that it met last for the first time, so this is one of our own.
EVERY_NODE = "/**/**"


@dataclass(frozen=True)
class OfEveryNode(Parameters):
    """Parameters that several nodes of the suite, or all, declare for themselves."""

    ego: str = parameter("", "id of the vehicle to leave out for a planner under test")
    starts: str = parameter(
        "", "start states on the road, `id:x y yaw [speed]`, vehicles separated by `;`"
    )
    goals: str = parameter("", "end states, in the same form")
    use_sim_time: bool = parameter(False, "the nodes follow /clock")
    autostart: bool = parameter(True, "the nodes configure and activate themselves")


@dataclass(frozen=True)
class OfLaunch(Parameters):
    """Arguments that are no parameters of nodes."""

    namespace: str = parameter("", "namespace of all nodes")
    params: str = parameter("", "parameter file; arguments on the command line have precedence")
    log_level: str = parameter("info", "lowest severity that is logged", choices=LEVELS)
    rviz: bool = parameter(False, "open RViz")
    composed: bool = parameter(False, "run all nodes in one process, for small machines")
    respawn: bool = parameter(False, "restart a node that ended, after 2 s; never a recorder")
    without: str = parameter("", f"nodes to leave out, separated by commas: {', '.join(NODES)}")


OTHER_NAMES = {"log_path": "log", "road_name": "road"}  # of parameters, as arguments
_OF_NODES = (
    node_parameters.LogPlayerParameters(),
    node_parameters.RoadServerParameters(),
    node_parameters.RecorderParameters(),
    node_parameters.SamplerParameters(),
    OfEveryNode(),
)
_DRIVE = flatten(node_parameters.TrafficParameters())
Arguments = Mapping[str, tuple[str, "Field[Any]"]]
SUITE: Arguments = {
    OTHER_NAMES.get(name, name): (name, entry)
    for config in _OF_NODES
    for name, (entry, _) in flatten(config).items()
}
DRIVE: Arguments = {  # of two of one name, the node's own
    name.removeprefix("drive."): (name, _DRIVE[name][0])
    for name in sorted(_DRIVE, key=lambda name: "." not in name)
}
LAUNCH = {name: entry for name, (entry, _) in flatten(OfLaunch()).items()}


@dataclass(frozen=True)
class Launch:
    """A launch that can begin: the nodes' parameters by name, and what it says itself."""

    given: Mapping[str, Any]
    own: OfLaunch

    @property
    def left_out(self) -> list[str]:
        """The nodes that are not started."""
        return [name.strip() for name in self.own.without.split(",") if name.strip()]

    def parameter_files(self, *defaults: Path) -> list[str]:
        """Return the files for each node; the last wins, which is written here and removed when this process ends."""
        files = [*map(str, defaults), *([self.own.params] if self.own.params else [])]
        if self.given:
            body = {EVERY_NODE: {"ros__parameters": dict(self.given)}}
            with tempfile.NamedTemporaryFile(
                "w", prefix="launch_params_", suffix=".yaml", encoding="utf-8", delete=False
            ) as file:
                yaml.safe_dump(body, file, allow_unicode=True)
            atexit.register(Path(file.name).unlink, missing_ok=True)
            files.append(file.name)
        return files


def meanings(arguments: Arguments) -> dict[str, str]:
    """Return what `ros2 launch --show-args` says of each argument."""
    return {
        name: f"{entry.metadata['meaning']} (default: {entry.default!r})"
        for name, entry in _entries(arguments).items()
    }


def _entries(arguments: Arguments) -> dict[str, "Field[Any]"]:
    return {name: entry for name, (_, entry) in arguments.items()} | LAUNCH


def read(arguments: Arguments, texts: Mapping[str, str]) -> Launch:
    """Return what is to be launched.

    Args:
        arguments: those of the launch file, beside `LAUNCH`.
        texts: what stands on the command line, by name; empty: not given. A launch file that includes ours may have others.

    Raises:
        InputError: one cannot be used, or looks like one of ours and is none; the message names it.
    """
    known, values = _entries(arguments), dict[str, Any]()
    for name, text in texts.items():
        if name in known and text:
            try:
                values[name] = (
                    _unquoted(text)
                    if isinstance(known[name].default, str)
                    else parse_yaml(text, "its value")
                )
                check_value(name, known[name], values[name])
            except InputError as error:
                raise InputError(f"{name}:={shown(text)}: {error}") from error
        elif text and (near := did_you_mean(name, known)):
            raise InputError(
                f"{name}:= is no argument of this launch file{near} There are {', '.join(known)}"
            )
    launch = Launch(
        {
            arguments[name][0]: value
            for name, value in values.items()
            if name in arguments and (name, value) != ("log", LIVE)
        },
        OfLaunch(**{name: value for name, value in values.items() if name in LAUNCH}),
    )
    _check(launch, of_suite="log" in arguments)
    if "log" in arguments and not (values.get("log") or launch.own.params):
        raise InputError(
            f"no log is given: write log:=FILE, or log:={LIVE} to wait for tracks, or fixes and speeds, of other nodes"
        )
    return launch


def _unquoted(text: str) -> str:
    """Return a text without the quotes that `ros2 run -p` needs around `1: 10 2 0`; `ros2 launch` takes it as it is."""
    return text[1:-1] if len(text) > 1 and text[0] == text[-1] and text[0] in "'\"" else text


def _check(launch: Launch, *, of_suite: bool) -> None:
    """Raise InputError if the namespace, a path or a node that is to be left out cannot be."""
    own, given = launch.own, launch.given
    if own.namespace and not NAMESPACE.fullmatch(own.namespace):
        raise InputError(
            f"namespace:={shown(own.namespace)}: write names of letters, digits and underscores, separated by /"
        )
    written = "bag" if of_suite else "results"
    for name, path in (
        ("params", own.params),
        ("log", given.get("log_path")),
        ("bag", "" if of_suite else given.get("bag")),
    ):
        if path and not Path(path).exists():
            raise InputError(
                f"{name}:={shown(path)}: it does not exist; check the name and the folder"
            )
    if path := given.get(written):
        _check_folder(f"{written}:={shown(path)}", Path(path), new=of_suite)
    if own.params and "ros__parameters" not in Path(own.params).read_text(
        encoding="utf-8", errors="replace"
    ):
        raise InputError(f"params:={own.params}: not a parameter file; it has no ros__parameters")
    for name in launch.left_out:
        if name not in NODES:
            raise InputError(
                f"without:={name}: choose of {', '.join(NODES)}{did_you_mean(name, NODES)}"
            )


def _check_folder(what: str, folder: Path, *, new: bool) -> None:
    """Raise InputError if a folder cannot be created, or is there where a `new` one is needed; it is removed again."""
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=not new)
    except OSError as error:
        raise InputError(f"{what}: {error.strerror}; name another folder") from error
    finally:
        for path in missing:
            with suppress(OSError):
                path.rmdir()
