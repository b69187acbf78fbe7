# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The arguments of launch/suite.launch.py, checked before the first process starts; no stage is loaded for that.

What is given on the command line beats the parameter file named there, which beats config/suite.yaml. Empty means not given.
"""

import atexit
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
import json
import os
from pathlib import Path
import re
import tempfile
from typing import Any

import yaml

from scenario_gen.base.documents import parse_yaml, read_yaml, shown
from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import parameter, Parameters, updated
from scenario_gen.base.registry import installed

LIVE = "live"
ROADS = ("straight", "curve", "t_intersection", "four_way", "merge", "roundabout", "corridor")
LEVELS = ("debug", "info", "warn", "error", "fatal")
OTHER_NAMES = {"log": "log_path", "road": "road_name"}  # of arguments, as the nodes call them
OF_LAUNCH = ("namespace", "params", "composed", "respawn", "log_level", "rviz")  # what is no parameter of a node
# Matches every node. Of two keys that match, rcl lets the one win that it met last for the first time, so this is one of our own.
EVERY_NODE = "/**/**"
NAMESPACE = re.compile(r"/|/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*", re.ASCII)


@dataclass(frozen=True)
class Arguments(Parameters):
    """The arguments of the launch file; parameters of nodes are declared as there."""

    log: str = parameter("", f"log to read: a file, a bag or a folder of files; {LIVE}: wait for what other nodes publish")
    encounter: int = parameter(0, "which encounter of the log, from 0", low=0)
    road: str = parameter("t_intersection", ", ".join(ROADS) + ", or a map_server YAML file")
    count: int = parameter(50, "scenarios to generate", low=1, high=100_000)
    seed: int = parameter(0, "seed of every stage", low=0)
    ego: str = parameter("", "id of the vehicle to leave out for a planner under test")
    starts: str = parameter("", "start states on the road, `id:x y yaw [speed]`, vehicles separated by `;`")
    goals: str = parameter("", "end states, in the same form")
    bag: str = parameter("", "folder to record to; empty records nothing")
    stream: bool = parameter(False, "play the log as fixes and speeds of each vehicle, with /clock, instead of tracks")
    rate: float = parameter(1.0, "speed of the stream relative to the recording", low=0.01, high=1000.0)
    use_sim_time: bool = parameter(False, "the nodes follow /clock")
    autostart: bool = parameter(True, "the nodes configure and activate themselves")
    namespace: str = parameter("", "namespace of all nodes")
    params: str = parameter("", "parameter file; arguments on the command line have precedence")
    composed: bool = parameter(False, "run all nodes in one process, for small machines")
    respawn: bool = parameter(False, "restart a node that ended, after 2 s")
    log_level: str = parameter("info", "lowest severity that is logged: " + ", ".join(LEVELS), choices=LEVELS)
    rviz: bool = parameter(False, "open RViz")


ENTRIES = {entry.name: entry for entry in fields(Arguments)}


@dataclass(frozen=True)
class Launch:
    """A launch that can begin: `given` are the nodes' parameters of the command line, `in_file` those of the parameter file."""

    arguments: Arguments
    given: Mapping[str, Any] = field(default_factory=dict)
    in_file: Mapping[str, Any] = field(default_factory=dict)

    @property
    def records(self) -> bool:
        """Whether a bag is named."""
        return bool(self.value("bag"))

    def value(self, name: str) -> Any:
        """Return the value of a parameter, None if nobody says it."""
        return self.given.get(name, self.in_file.get(name))

    def parameter_files(self, defaults: Path) -> list[str]:
        """Return the files for each node; the last wins, which is written here and removed when this process ends."""
        files = [str(defaults), *([self.arguments.params] if self.arguments.params else [])]
        if self.given:
            descriptor, path = tempfile.mkstemp(prefix="launch_params_", suffix=".yaml")
            with os.fdopen(descriptor, "w", encoding="utf-8") as stream:
                yaml.safe_dump({EVERY_NODE: {"ros__parameters": dict(self.given)}}, stream, allow_unicode=True)
            atexit.register(Path(path).unlink, missing_ok=True)
            files.append(path)
        return files


def descriptions() -> dict[str, str]:
    """Return the meaning of each argument, with the value that config/suite.yaml or the launch file has for it."""
    return {name: f"{e.metadata['meaning']} [{json.dumps(e.default)}]" for name, e in ENTRIES.items()}


def read_arguments(texts: Mapping[str, str]) -> Launch:
    """Return what is to be launched.

    Args:
        texts: the arguments as they stand on the command line; empty: not given.

    Raises:
        InputError: one cannot be used; the message names it.
    """
    arguments, given = Arguments(), {}
    for name, text in texts.items():
        if text:
            is_text = isinstance(ENTRIES[name].default, str)
            try:
                arguments = updated(arguments, {name: text if is_text else parse_yaml(text, "its value")})
            except InputError as error:
                raise InputError(f"{name}:={shown(text)}: {error}") from error
            if name not in OF_LAUNCH and (name, text) != ("log", LIVE):
                given[OTHER_NAMES.get(name, name)] = getattr(arguments, name)
    launch = Launch(arguments, given, dict(_settings(Path(arguments.params))) if arguments.params else {})
    _check_places(launch)
    for end in ("starts", "goals"):
        if launch.value(end):
            from scenario_gen.types import read_states  # loads the stages, which takes seconds

            read_states(str(launch.value(end)), end)
    return launch


def _settings(path: Path) -> Iterator[tuple[str, Any]]:
    """Yield what a parameter file says of any node, in its order.

    Raises:
        InputError: it cannot be read, or says nothing.
    """
    found = False
    level = [read_yaml(path)]
    while level:
        body = level.pop(0)
        if isinstance(body, dict):
            level += [inner for key, inner in body.items() if key != "ros__parameters"]
            if isinstance(own := body.get("ros__parameters"), dict):
                found = True
                yield from own.items()
    if not found:
        raise InputError(f"params:={path}: not a parameter file; it has no ros__parameters")


def _check_places(launch: Launch) -> None:
    """Raise InputError if the namespace, the log, the road or the bag cannot be."""
    namespace = launch.arguments.namespace
    if namespace and not NAMESPACE.fullmatch(namespace):
        raise InputError(f"namespace:={shown(namespace)}: write names of letters, digits and underscores, separated by /")
    log = launch.value("log_path")
    if not log and launch.arguments.log != LIVE:
        raise InputError(
            f"no log is given: write log:=FILE, or log:={LIVE} to wait for tracks, or fixes and speeds, of other nodes"
        )
    if log and not Path(str(log)).exists():
        raise InputError(f"log:={shown(log)}: it does not exist; name a file or a folder")
    road = launch.value("road_name")
    roads = (*ROADS, *installed("scenario_gen.roads")) if road not in ROADS else ROADS
    if road and road not in roads and not (str(road).endswith((".yaml", ".yml")) and Path(str(road)).is_file()):
        raise InputError(f"road:={shown(road)}: choose one of {', '.join(roads)}, or give a map_server YAML file that exists")
    if launch.records and launch.arguments.composed and launch.arguments.respawn:
        raise InputError("respawn:=true: a composed suite with a bag cannot be restarted; leave out bag or composed")
    if (bag := launch.value("bag")) and Path(str(bag)).exists():
        raise InputError(f"bag:={shown(bag)}: exists already; name another folder for the bag, or remove it")
