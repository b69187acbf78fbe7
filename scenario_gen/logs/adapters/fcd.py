# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Floating-car data of SUMO (`--fcd-output`, XML): what moved in each step.

| quantity | attribute of timestep, vehicle | unit |
|---|---|---|
| time | time | s |
| vehicle, class | id; type | |
| position | x, y: the middle of the front bumper; longitude, latitude with `--fcd-output.geo` | m; degrees |
| heading | angle | degrees clockwise from north |
| speed | speed | m/s |

Source: SUMO's user documentation, FCDOutput. Sizes are not in it: a car has those of the parameters `length` and `width`.
"""

from collections.abc import Sequence
from dataclasses import replace
import math
from pathlib import Path

import numpy as np
import pandas as pd

from scenario_gen.base.errors import InputError
from scenario_gen.base.xml_reader import read_xml
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.kinds import type_called, usual_size
from scenario_gen.logs.raw import check_size, only_file, RawLog, Segment
from scenario_gen.logs.tables import from_frame, LATEST_S

MOVES = 1.0  # m/s
TINY = 0.05  # of a step by its speed: a vehicle that drives so little in x and y drives in degrees


def read(paths: Sequence[Path], config: LogConfig) -> RawLog:
    """Read the vehicles of one simulation.

    Raises:
        InputError: it is broken or too large, or an element lacks an attribute; names file and line.
    """
    path = only_file(paths, config)
    rows: list[tuple[float, str, float, float, float, float, str]] = []
    for step in read_xml(path, str(path)).findall("timestep"):
        time = step.number("time")
        for one in step:
            kind = "pedestrian" if one.tag == "person" else one.get("type", "")
            values = (
                one.number("x"),
                one.number("y"),
                one.number("speed", math.nan),
                one.number("angle", math.nan),
            )
            rows.append((time, one.attribute("id"), *values, kind))
        check_size(str(path), 0, len(rows), config)
    if not rows:
        raise InputError(f"{path}: no vehicle in any of its steps")
    frame = pd.DataFrame(
        rows, columns=pd.Index(["time", "vehicle", "x", "y", "speed", "angle", "kind"])
    )
    frame["heading"] = math.pi / 2.0 - np.radians(frame.pop("angle"))
    frame["time"], frame["time_ok"] = (
        (frame["time"].clip(-LATEST_S, LATEST_S) * 1e9).round().astype(np.int64),
        True,
    )
    own = frame.groupby("vehicle")
    driven = np.hypot(own["x"].diff(), own["y"].diff()) / (own["time"].diff() * 1e-9)
    moves = frame["speed"] > MOVES
    if (driven[moves] < TINY * frame["speed"][moves]).sum() > 0.5 * driven[moves].notna().sum():
        frame = frame.rename(columns={"x": "lon", "y": "lat"})
    else:
        half = frame["kind"].map(lambda kind: usual_size(type_called(kind) or "", config)[0] / 2.0)
        frame["x"] -= half * np.cos(frame["heading"].fillna(0.0))
        frame["y"] -= half * np.sin(frame["heading"].fillna(0.0))
    log = from_frame(frame, paths, (Segment(0, str(path), "vehicle", 1),), config)
    return replace(
        log, notes=("read as SUMO's floating-car data: x, y are of the front bumper", *log.notes)
    )
