# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The arguments of the launch files, checked before the first process starts; no stage is loaded for that.

What is given on the command line beats the parameter file named there, which beats config/suite.yaml. Empty means not given.
"""

import atexit
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields
import json
import os
from pathlib import Path
import re
import tempfile
from typing import Any, TypeVar

import yaml

from scenario_gen.base.documents import parse_yaml, read_yaml, shown
from scenario_gen.base.errors import did_you_mean, InputError
from scenario_gen.base.parameters import parameter, Parameters, updated
from scenario_gen.base.registry import installed

LIVE = "live"
ROADS = ("straight", "curve", "t_intersection", "four_way", "merge", "roundabout", "corridor")
LEVELS = ("debug", "info", "warn", "error", "fatal")
OTHER_NAMES = {"log": "log_path", "road": "road_name"}  # of arguments, as the nodes call them
MAPS = (".yaml", ".yml", ".osm", ".xodr", ".xml")  # endings of the names of maps
NODES = (
    "recorder",
    "road_server",
    "segmenter",
    "planner",
    "gp_sampler",
    "evaluator",
    "preview",
    "log_player",
)  # who listens comes first
OF_LAUNCH = ("namespace", "params", "composed", "respawn", "log_level", "rviz", "without")  # what is no parameter of a node
# Matches every node. Of two keys that match, rcl lets the one win that it met last for the first time, so this is one of our own.
EVERY_NODE = "/**/**"
NAMES = "write names of letters, digits and underscores, separated by /"
Given = TypeVar("Given", bound=Parameters)
NAMESPACE = re.compile(r"/|/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*", re.ASCII)


@dataclass(frozen=True)
class Arguments(Parameters):
    """The arguments of the launch file; parameters of nodes are declared as there."""

    log: str = parameter("", f"log to read: a file, a bag or a folder of files; {LIVE}: wait for what other nodes publish")
    encounter: int = parameter(0, "which encounter of the log, from 0", low=0)
    road: str = parameter("t_intersection", ", ".join(ROADS) + ", a map_server YAML file, or a vector map (.osm, .xodr, .xml)")
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
    without: str = parameter("", f"nodes to leave out, separated by commas: {', '.join(NODES)}")


@dataclass(frozen=True)
class DriveArguments(Parameters):
    """The arguments of drive.launch.py."""

    bag: str = parameter("", "bag with scenarios; empty: live from the topics scenarios and map")
    ego: str = parameter("", "id of the vehicle in whose place the ego drives; empty: the first")
    index: int = parameter(0, "number of the first scenario, from 0", low=0)
    policy: str = parameter("reactive", "how the others drive: reactive or replay", choices=("reactive", "replay"))
    rate: float = parameter(1.0, "how many times as fast as real time", low=0.01, high=1000.0)
    lock_step: bool = parameter(False, "one step for each call of traffic/step")
    step: float = parameter(0.1, "time of a step", unit="s", low=0.01, high=1.0)
    results: str = parameter("", "folder for drives.json and junit.xml")
    namespace: str = parameter("", "namespace of the node")
    params: str = parameter("", "parameter file; arguments on the command line have precedence")
    rviz: bool = parameter(False, "open RViz")


ENTRIES = {entry.name: entry for entry in fields(Arguments)}


@dataclass(frozen=True)
class Launch:
    """A launch that can begin: `given` are the nodes' parameters of the command line, `in_file` those of the parameter file."""

    arguments: Arguments
    given: Mapping[str, Any] = field(default_factory=dict)
    in_file: Mapping[str, Any] = field(default_factory=dict)

    @property
    def left_out(self) -> list[str]:
        """The nodes that are not started."""
        return [name.strip() for name in self.arguments.without.split(",") if name.strip()]

    @property
    def records(self) -> bool:
        """Whether a bag is named, and its recorder is not left out."""
        return bool(self.value("bag")) and "recorder" not in self.left_out

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


def declared(kind: type[Parameters] = Arguments) -> dict[str, tuple[str, str]]:
    """Return the default of each argument, as text, and its meaning."""
    defaults = {e.name: e.default if isinstance(e.default, str) else json.dumps(e.default) for e in fields(kind)}
    return {e.name: (defaults[e.name], str(e.metadata["meaning"])) for e in fields(kind)}


def refuse_misspelt(given: Iterable[str], kind: type[Parameters] = Arguments) -> None:
    """Refuse what looks like one of the arguments and is none; a launch file that includes ours may have others of its own.

    Args:
        given: names that stand on the command line, before any is declared.
        kind: the arguments that there are.

    Raises:
        InputError: one is misspelt.
    """
    known = [entry.name for entry in fields(kind)]
    for name in given:
        if name not in known and (near := did_you_mean(name, known)):
            raise InputError(f"{name}:= is no argument of this launch file{near} There are {', '.join(known)}")


def read_drive(texts: Mapping[str, str]) -> DriveArguments:
    """Return the arguments of drive.launch.py; those that are empty are not given.

    Raises:
        InputError: one cannot be used; the message names it.
    """
    arguments = DriveArguments()
    for name, text in texts.items():
        arguments = _taken(arguments, name, text) if text else arguments
    for name in ("bag", "params"):
        if (path := getattr(arguments, name)) and not Path(path).exists():
            raise InputError(f"{name}:={shown(path)}: it does not exist; check the name and the folder")
    if arguments.namespace and not NAMESPACE.fullmatch(arguments.namespace):
        raise InputError(f"namespace:={shown(arguments.namespace)}: {NAMES}")
    return arguments


def _taken(arguments: Given, name: str, text: str) -> Given:
    """Return the arguments with one more.

    Raises:
        InputError: it cannot be used; the message names it.
    """
    is_text = isinstance(getattr(type(arguments)(), name), str)
    try:
        return updated(arguments, {name: text if is_text else parse_yaml(text, "its value")})
    except InputError as error:
        raise InputError(f"{name}:={shown(text)}: {error}") from error


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
            arguments = _taken(arguments, name, text)
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
        raise InputError(f"namespace:={shown(namespace)}: {NAMES}")
    unknown = [name for name in launch.left_out if name not in NODES]
    if unknown:
        raise InputError(f"without:={unknown[0]}: choose of {', '.join(NODES)}{did_you_mean(unknown[0], NODES)}")
    if launch.left_out and launch.arguments.composed:
        raise InputError("without:= cannot be combined with composed:=true; run `ros2 run scenario_gen suite --nodes …` instead")
    log = launch.value("log_path")
    if not log and launch.arguments.log != LIVE:
        raise InputError(
            f"no log is given: write log:=FILE, or log:={LIVE} to wait for tracks, or fixes and speeds, of other nodes"
        )
    if log and not Path(str(log)).exists():
        raise InputError(f"log:={shown(log)}: it does not exist; name a file or a folder")
    road = launch.value("road_name")
    roads = (*ROADS, *installed("scenario_gen.roads")) if road not in ROADS else ROADS
    file = Path(str(road).partition("#")[0])
    if road and road not in roads and not (file.suffix.lower() in MAPS and file.is_file()):
        raise InputError(f"road:={shown(road)}: choose one of {', '.join(roads)}, or give a map that exists ({', '.join(MAPS)})")
    if launch.records and launch.arguments.composed and launch.arguments.respawn:
        raise InputError("respawn:=true: a composed suite with a bag cannot be restarted; leave out bag or composed")
    if (bag := launch.value("bag")) and Path(str(bag)).exists():
        raise InputError(f"bag:={shown(bag)}: exists already; name another folder for the bag, or remove it")
