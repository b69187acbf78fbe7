# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Floating-car data of SUMO (`--fcd-output`, XML).

| quantity | attribute of timestep, vehicle | unit |
|---|---|---|
| time | time | s |
| vehicle, class | id; type | |
| position | x, y: the middle of the front bumper; degrees with `--fcd-output.geo` | m; degrees |
| heading | angle | degrees clockwise from north |
| speed | speed | m/s |

The format has no sizes: a car has those of the parameters `length` and `width`. The net and the
recorded states of its traffic lights may be given with it (sumo_lights).

Source: SUMO's user documentation, FCDOutput.
"""

from collections.abc import Sequence
from dataclasses import replace
import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from scenario_gen.base.errors import InputError
from scenario_gen.base.xml_reader import Element, read_xml
from scenario_gen.logs.adapters.sumo_lights import read_lights
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.kinds import type_called, usual_size
from scenario_gen.logs.raw import check_size, RawLog, Segment
from scenario_gen.logs.signals import RawSignal
from scenario_gen.logs.stamps import MAX_STAMP_S
from scenario_gen.logs.tables import from_frame

_MOVING_MPS = 1.0
_MIN_SPEED_RATIO = 0.05  # of x, y over the speed column; less means that x, y are degrees


def read(paths: Sequence[Path], config: LogConfig) -> RawLog:
    """Read the vehicles of one simulation.

    Raises:
        InputError: the file is damaged or too large, or an attribute is missing; names the line.
    """
    roots = _roots(paths, config)
    path = paths[list(roots).index("fcd-export")]
    rows: list[dict[str, Any]] = []
    for step in roots["fcd-export"].findall("timestep"):
        time = step.number("time")
        rows += [{"time": time, **_state(element)} for element in step]
        check_size(str(path), 0, len(rows), config)
    if not rows:
        raise InputError(f"{path}: none of its steps has a vehicle")
    frame = pd.DataFrame(rows)
    seconds = frame["time"].clip(-MAX_STAMP_S, MAX_STAMP_S)
    frame["time"] = (seconds * 1e9).round().astype(np.int64)
    frame["time_ok"] = True
    is_in_degrees = _is_in_degrees(frame)
    if is_in_degrees:
        frame = frame.rename(columns={"x": "lon", "y": "lat"})
    else:
        sizes = frame["kind"].map(lambda kind: usual_size(type_called(kind) or "", config))
        half_length = sizes.str[0] / 2.0
        heading = frame["heading"].fillna(0.0)
        frame["x"] -= half_length * np.cos(heading)
        frame["y"] -= half_length * np.sin(heading)
    log = from_frame(frame, [path], (Segment(0, str(path), "vehicle", 1),), config)
    notes = ["read as SUMO's floating-car data: x, y are those of the front bumper"]
    signals: Sequence[RawSignal] = ()
    if config.signals == "recorded" and is_in_degrees and len(roots) > 1:
        notes.append("traffic lights are left out: the vehicles are in degrees, the net in metres")
    elif config.signals == "recorded":
        signals = read_lights(roots.get("net"), roots.get("tlsStates"), notes)
    return replace(log, notes=(*notes, *log.notes), signals=tuple(signals))


def _roots(paths: Sequence[Path], config: LogConfig) -> dict[str, Element]:
    """Return the roots of files of one simulation by their tags, in the order of the files.

    Raises:
        InputError: a file is damaged, two are of one kind, or none has vehicles.
    """
    roots: dict[str, Element] = {}
    for path in paths:
        check_size(str(path), path.stat().st_size, 0, config)
        root = read_xml(path, str(path))
        if root.tag in roots:
            raise InputError(
                f"{path} and {roots[root.tag].file}: each has its own clock; read one at a time"
            )
        roots[root.tag] = root
    if "fcd-export" not in roots:
        raise InputError(
            f"{paths[0]} has no vehicles; give the floating-car data (--fcd-output) of its "
            "simulation, too"
        )
    return roots


def _state(element: Element) -> dict[str, Any]:
    """Return the state of a road user in one step."""
    is_person = element.tag == "person"
    return {
        "vehicle": element.attribute("id"),
        "x": element.number("x"),
        "y": element.number("y"),
        "speed": element.number("speed", math.nan),
        "heading": math.pi / 2.0 - math.radians(element.number("angle", math.nan)),
        "kind": "pedestrian" if is_person else element.get("type", ""),
    }


def _is_in_degrees(frame: pd.DataFrame) -> bool:
    """Return whether most vehicles move much less by x, y than by their speeds."""
    by_vehicle = frame.groupby("vehicle")
    distance = np.hypot(by_vehicle["x"].diff(), by_vehicle["y"].diff())
    rate = distance / (by_vehicle["time"].diff() * 1e-9)
    is_moving = frame["speed"] > _MOVING_MPS
    is_slower = rate[is_moving] < _MIN_SPEED_RATIO * frame["speed"][is_moving]
    return bool(is_slower.sum() > 0.5 * rate[is_moving].notna().sum())
