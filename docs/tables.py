# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Write docs/tables/*.csv and config/default.yaml from the code: `python docs/tables.py`."""

from collections.abc import Iterator, Mapping
import csv
import io
import json
from pathlib import Path
import re
from typing import Any

import typer

from msg_conventions.topics import TOPICS
from scenario_gen.base.parameters import flatten
from scenario_gen.cli.commands import app
from scenario_gen.closed_loop.bars import Bars
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.corpus.config import CorpusConfig
from scenario_gen.logs.columns import NAMES, UNITS
from scenario_gen.method.config import PipelineConfig
from scenario_gen.output.exchange import ExportConfig

FOLDER = Path(__file__).with_name("tables")
DEFAULT_YAML = FOLDER.parents[1] / "config" / "default.yaml"
# Parameters of single commands, without those of config/default.yaml.
SINGLE = {
    "drive": [ClosedLoopConfig(), Bars()],
    "mine": [CorpusConfig()],
    "export": [ExportConfig()],
}
DEFAULTS = """\
# Every parameter of the stages with its default, for the nodes (in any namespace) and for `scenario-gen --params`.
# A node takes those it declares and leaves the others alone.
# Written by: python docs/tables.py
/**:
  ros__parameters:
"""
SHARED = ("limits.", "log.", "bag.")
Row = tuple[str, ...]
CONTENTS = {
    "/diagnostics": ("all", "findings and states"),
    "/localization/kinematic_state": ("traffic", "the ego, for Autoware"),
    "/perception/object_recognition/objects": ("traffic", "the others, for Autoware"),
    "changepoints": (
        "segmenter",
        "a point per changepoint, at samples of the tracks; frame local_enu",
    ),
    "clock": ("log_player, player, traffic", "time of what is played"),
    "diagnostics": ("bags", "/diagnostics of a run in process"),
    "ego/cmd_vel": ("you", "linear.x [m/s], angular.z [rad/s]"),
    "ego/cmd_vel_stamped": ("you", "the same; the stamp names the state that it answers"),
    "ego/goal": ("gp_sampler, traffic", "footprint's centre; speed in twist.twist.linear.x"),
    "ego/odom": ("you", "the ego of another simulator"),
    "ego/path": ("you", "stamped poses to track"),
    "ego/route": ("traffic", "path to the goal"),
    "ego/start": ("gp_sampler", "footprint's centre; speed in twist.twist.linear.x"),
    "ego/trajectory": ("you", "stamped poses to track"),
    "ego/witness": ("gp_sampler", "the reference drive, before each scenario"),
    "fit": ("planner", "start, changepoints and end on the road, at stamps of the routes"),
    "fit/info": ("planner", "JSON: fit, routes, what they were made from"),
    "map": (
        "road_server",
        "0 free, 100 occupied, −1 unknown; cells below 65 are drivable; not rotated",
    ),
    "markers": ("gp_sampler", "scenarios, to look at"),
    "posterior": (
        "segmenter",
        "vehicles × samples: x, y, z, vehicle, primitive, t [s], p of a changepoint; frame local_enu",
    ),
    "preview": ("preview", "the newest scenario in motion"),
    "report": ("evaluator", "figures"),
    "road/entries": ("road_server", "poses at lane centres, into the road"),
    "road/exits": ("road_server", "poses at lane centres, out of the road"),
    "road/lanes": ("road_server", "JSON: lanes, users, rules, entries, exits, the map"),
    "road/markings": ("road_server", "paint and signs"),
    "scenarios": ("gp_sampler", "one or several messages per scenario"),
    "scenarios/info": ("gp_sampler", "entries and summaries, below"),
    "tf": ("preview, traffic", "frames of the vehicles"),
    "tracks": ("log_player, segmenter", "the recording, evenly spaced from 0; frame local_enu"),
    "tracks/part": (
        "planner, road_server",
        "the part of a recording that fits the road; the sender of tracks sends it instead",
    ),
    "tracks/recorded": ("bags", "the recording, if a decision changed the tracks"),
    "traffic/local_map": ("traffic", "the map with the others as obstacles"),
    "traffic/markers": ("traffic", "the drive, to look at"),
    "vehicle_*/fix": ("log_player", "the log as a stream"),
    "vehicle_*/footprint": ("gp_sampler", "frame vehicle_<id>"),
    "vehicle_*/odom": ("traffic", "every vehicle at every step"),
    "vehicle_*/path": ("", "reserved for the path of a vehicle"),
    "vehicle_*/route": ("planner", "a pose's stamp is its time; equal poses are a standstill"),
    "vehicle_*/speed": ("log_player", "the log as a stream"),
    "verdicts": ("traffic", "a verdict per drive"),
}
"""Publisher and content of each topic."""


def code(text: str) -> str:
    """Return text as reStructuredText's literal."""
    return f"``{text}``" if text else ""


def columns() -> Iterator[Row]:
    """Yield the recognised columns of a table, with their units."""
    yield "quantity", "names, the preferred first", "units, the default first"
    for quantity, names in NAMES.items():
        if names:
            yield quantity, ", ".join(map(code, names)), ", ".join(map(code, UNITS[quantity]))


def parameters() -> Iterator[Row]:
    """Yield the parameters of single commands."""
    yield "command", "parameter", "default", "range", "meaning"
    for command, configs in SINGLE.items():
        for config in configs:
            prefix = "bars." if isinstance(config, Bars) else ""
            for name, (entry, default) in flatten(config, prefix).items():
                if not name.startswith(SHARED):
                    unit = f" {entry.metadata['unit']}" if entry.metadata["unit"] else ""
                    value = f"{code(str(default))}{unit}"
                    meaning = literal(entry.metadata["meaning"])
                    yield command, code(name), value, range_of(entry.metadata), meaning


def range_of(metadata: Mapping[str, Any]) -> str:
    """Return the range of a number in words."""
    low, high = metadata["low"], metadata["high"]
    bounds = ("at least", low), ("at most", high)
    return ", ".join(f"{word} {bound:g}" for word, bound in bounds if bound is not None)


def commands() -> Iterator[Row]:
    """Yield all commands with their arguments and options."""
    yield "command", "argument or option", "default", "meaning"
    group: Any = typer.main.get_command(app)
    yield from options(group)
    for name, command in group.commands.items():
        yield code(name), "", "", literal(command.get_short_help_str(limit=1000))
        yield from options(command)


def topics() -> Iterator[Row]:
    """Yield all topics with their types, publishers, contents and qualities of service."""
    yield "topic", "type", "from", "content", "durability", "depth"
    for topic, (kind, quality) in sorted(TOPICS.items()):
        durability = "latched" if quality.transient_local else "volatile"
        publisher, content = CONTENTS[topic]
        name, depth = kind.replace("/msg/", "/"), str(quality.depth)
        yield code(topic), name, publisher, content, durability, depth


def options(command: Any) -> Iterator[Row]:
    """Yield a row per argument and option of a command."""
    for entry in command.params:
        if entry.name == "help" or getattr(entry, "hidden", False):
            continue
        names = entry.opts if entry.opts[0].startswith("-") else [str(entry.name).upper()]
        default = "" if entry.default in (None, "") or entry.default is False else entry.default
        meaning = getattr(entry, "help", "") or ""
        yield "", ", ".join(map(code, names)), code(str(default)), literal(meaning)


def literal(text: str) -> str:
    """Return a help text with Markdown's code as reStructuredText's, without rich's escapes."""
    text = text.replace("\\[", "[")
    return re.sub(r"(?<!`)`([^`]+)`(?!`)", r"``\1``", " ".join(text.split())).replace("*", r"\*")


def tables() -> dict[str, str]:
    """Return the text of each table by its file's name."""
    made: dict[str, Any] = {
        "columns": columns,
        "commands": commands,
        "parameters": parameters,
        "topics": topics,
    }
    return {f"{name}.csv": written(list(table())) for name, table in made.items()}


def default_yaml() -> str:
    """Return the text of config/default.yaml, as YAML 1.1 reads it back: a real number always has a point."""
    lines, stage = [], ""
    for name, (entry, value) in flatten(PipelineConfig()).items():
        head, _, rest = name.partition(".")
        if head != stage:
            lines.append(f"    {head}:")
            stage = head
        text = json.dumps(value)
        text = (
            re.sub(r"^(-?\d+)(e[+-]?\d+)$", r"\1.0\2", text) if isinstance(value, float) else text
        )
        facts = ", ".join(filter(None, (entry.metadata["unit"], range_of(entry.metadata))))
        facts = f" [{facts}]" if facts else ""
        lines += [f"      # {entry.metadata['meaning']}{facts}", f"      {rest}: {text}"]
    return DEFAULTS + "\n".join(lines) + "\n"


def written(lines: list[Row]) -> str:
    """Return rows as CSV."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(lines)
    return text.getvalue()


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name, text in tables().items():
        (FOLDER / name).write_text(text, encoding="utf-8")
    DEFAULT_YAML.write_text(default_yaml(), encoding="utf-8")
