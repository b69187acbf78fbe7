# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A log format: one JSON object a line, with vehicle, t [s], x [m], y [m], heading [rad]."""

from collections import defaultdict
from collections.abc import Sequence
import json
from pathlib import Path

from scenario_gen import LogConfig
from scenario_gen.base.errors import guarded
from scenario_gen.logs import Fix, LogFormat, RawLog, Rows, Segment


def read(paths: Sequence[Path], _: LogConfig) -> RawLog:
    """Read the lines of one file."""
    path, vehicles = paths[0], defaultdict[str, Rows](Rows)
    lines = path.read_text(encoding="utf-8").splitlines()
    for row, line in enumerate(lines):
        with guarded(f"{path}, line {row + 1}"):
            entry = json.loads(line)
            vehicles[entry["vehicle"]].fixes.append(
                Fix(round(entry["t"] * 1e9), row, entry["x"], entry["y"], entry["heading"])
            )
    observed = tuple(rows.observations(name) for name, rows in vehicles.items())
    return RawLog(path.stem, False, observed, len(lines), (Segment(0, str(path), "line", 1),))


FORMAT = LogFormat(lambda path: path.suffix == ".jsonl", read)
