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

"""The basic-safety-message files of the Safety Pilot Model Deployment: headerless, 19 columns."""

from collections.abc import Sequence
import math
from pathlib import Path

import numpy as np
import pandas as pd

from scenario_gen.errors import InputError
from scenario_gen.logs.budgets import check_size
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.files import COLUMNS
from scenario_gen.logs.raw import RawLog, Segment
from scenario_gen.logs.table import from_frame, read_text, reals, vehicle_name

EPOCH_NS = 1_072_915_200 * 10**9  # 2004-01-01 UTC in Unix time; Gentime counts microseconds from there


def read(paths: Sequence[Path], config: LogConfig) -> RawLog:
    """Read the files as one log; a vehicle is a TxDevice."""
    frames, segments, row, size = [], [], 0, 0
    for path in paths:
        size += path.stat().st_size
        check_size(str(path), size, row, config)
        frames.append(read_messages(path, row, config))
        segments.append(Segment(row, str(path), "line", 1))
        row += len(frames[-1])
    return from_frame(pd.concat(frames, ignore_index=True), paths, tuple(segments), config)


def read_messages(path: Path, before: int, config: LogConfig) -> pd.DataFrame:
    """Read one file into the columns of the table reader: time [ns], vehicle, lat, lon, speed, heading (ours).

    Raises:
        InputError: the file is empty or a line has not 19 fields.
    """
    raw = read_text(path, before, config, sep=",", header=None, dtype=str)
    if raw.shape[1] != len(COLUMNS):
        raise InputError(
            f"{path} has {raw.shape[1]} columns on line 1; basic safety messages have {len(COLUMNS)}: {', '.join(COLUMNS)}"
        )
    raw.columns = pd.Index(COLUMNS)

    def numbers(name: str) -> "pd.Series[float]":
        return reals(raw[name])

    stamps = numbers("Gentime")  # microseconds stay exact in float64 until the year 2289
    known = stamps.notna() & (stamps.abs() < 8e15)
    return pd.DataFrame(
        {
            "time": stamps.where(known, 0.0).round().astype(np.int64) * 1000 + EPOCH_NS,
            "time_ok": known,
            "vehicle": numbers("TxDevice").map(vehicle_name),
            "lat": numbers("Latitude"),
            "lon": numbers("Longitude"),
            "speed": numbers("Speed"),
            "heading": math.pi / 2.0 - np.radians(numbers("Heading")),
        }
    )
