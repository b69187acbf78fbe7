# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Tables of public data sets (`data_sets`) to observations."""

from collections.abc import Callable, Sequence
from dataclasses import replace
import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from scenario_gen.base.errors import guarded, InputError, needs
from scenario_gen.logs.adapters.data_sets import (
    companion,
    DATA_SETS,
    DataSet,
    has_pedestrians,
    is_companion,
)
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.raw import check_size, RawLog
from scenario_gen.logs.stamps import reals
from scenario_gen.logs.tables import (
    from_frame,
    read_text,
    segment_of,
    to_numbers,
    vehicle_name,
)

_MIN_HEADING_MPS = 0.1  # a slower vehicle has no direction of travel

Load = Callable[[Path, DataSet, int, LogConfig], pd.DataFrame]


def read(
    paths: Sequence[Path], config: LogConfig, *, name: str, load: Load | None = None
) -> RawLog:
    """Read one recording of a data set.

    Args:
        paths: its files, one of which has the tracks.
        config: bounds sizes.
        name: key of `DATA_SETS`.
        load: returns the unchanged columns of a file, given the number of rows before it; by
            default, the file is a table.

    Raises:
        InputError: a file is damaged or missing, lacks a column, or there are several recordings.
    """
    data_set = DATA_SETS[name]
    companions = data_set.companions
    tracks = [path for path in paths if not companions or not is_companion(path, companions)]
    pedestrians = [path for path in tracks if has_pedestrians(path, name)]
    main = [path for path in tracks if path not in pedestrians]
    if len(main) != 1:
        names = ", ".join(path.name for path in main) or "none"
        raise InputError(
            f"{paths[0]}: a recording of {data_set.title} has one file of tracks, found: {names}; "
            "read one recording at a time"
        )
    frames = []
    segments = []
    n_rows = 0
    for path in (*main, *pedestrians):
        table = (load or _read_table)(path, data_set, n_rows, config)
        frame = _convert(table, path, data_set)
        frame["kind"] = _kinds(path, data_set, table)
        frame["row"] = range(n_rows, n_rows + len(table))
        frames.append(frame)
        segments.append(segment_of(path, n_rows))
        n_rows += len(table)
    frame = pd.concat(frames, ignore_index=True)
    notes = [f"read as {data_set.title}"]
    if "speed" not in frame:
        notes.append("no speeds: they are derived from the positions")
    log = from_frame(frame, main, tuple(segments), config)
    return replace(log, rows=n_rows, notes=tuple(notes))


def _read_table(
    path: Path, data_set: DataSet, rows_before: int, config: LogConfig
) -> pd.DataFrame:
    """Return the columns of a table unchanged.

    Raises:
        InputError: it is damaged or too large, or a column is missing.
    """
    check_size(str(path), path.stat().st_size, rows_before, config)
    if path.suffix.lower() == ".parquet":
        needs("parquet", "pyarrow")
        from scenario_gen.logs.parquet import read_table

        table = read_table(path, sorted(data_set.useful), rows_before, config)
    else:
        table = read_text(path, rows_before, config, sep=",")
    table.columns = pd.Index([str(column).strip() for column in table.columns])
    missing = sorted(data_set.needed - set(table.columns))
    is_interaction = data_set is DATA_SETS["interaction"]
    if missing and not (is_interaction and has_pedestrians(path, "interaction")):
        raise InputError(
            f"{path} lacks columns of {data_set.title}: {', '.join(missing)}; "
            f"it has {', '.join(table.columns)}"
        )
    return table


def _readcompanion(
    path: Path, data_set: DataSet, suffix: str, columns: Sequence[str]
) -> pd.DataFrame:
    """Return another file of the recording of a file of tracks.

    Raises:
        InputError: it does not exist, or lacks a column.
    """
    assert data_set.companions is not None
    file = companion(path, data_set.companions, suffix)
    if not path.name.endswith(data_set.companions.tracks) or not file.is_file():
        raise InputError(
            f"{path}: {data_set.title} also needs {file.name} in the same folder; copy it there"
        )
    with guarded(f"{file} cannot be read as a table"):
        frame = pd.read_csv(file, nrows=1_000_000)
    missing = [column for column in columns if column not in frame.columns]
    if missing or frame.empty:
        raise InputError(
            f"{file} lacks {', '.join(missing) or 'rows'}; "
            f"it has {', '.join(map(str, frame.columns))}"
        )
    return frame


def _kinds(path: Path, data_set: DataSet, table: pd.DataFrame) -> "pd.Series[Any]":
    """Return the class of every row, in lower case."""
    if data_set.names:
        return _numbered_kinds(data_set, table)
    if "kind" in data_set.columns:
        column = data_set.columns["kind"].name
        if column not in table:
            return pd.Series("pedestrian", index=table.index)
        return _lower(table[column])
    assert data_set.companions is not None
    column = data_set.columns["vehicle"].name
    classes = _readcompanion(path, data_set, data_set.companions.classes, (column, "class"))
    by_vehicle = dict(
        zip(classes[column].map(vehicle_name), _lower(classes["class"]), strict=True)
    )
    vehicles = table[column].map(vehicle_name)
    return vehicles.map(lambda name: by_vehicle.get(name, "without a class"))


def _lower(values: "pd.Series[Any]") -> "pd.Series[Any]":
    return values.astype(str).str.strip().str.lower()


def _numbered_kinds(data_set: DataSet, table: pd.DataFrame) -> "pd.Series[Any]":
    """Return the class of every row by the numbers in its columns."""

    def names(quantity: str) -> "pd.Series[Any]":
        known = data_set.names[quantity]
        numbers = table[data_set.columns[quantity].name].map(vehicle_name)
        return numbers.map(lambda number: known.get(number, f"type {number}"))

    kinds = names("kind")
    if data_set.columns["subkind"].name not in table:
        return kinds
    return kinds.where(kinds != "vehicle", names("subkind"))


def _convert(table: pd.DataFrame, path: Path, data_set: DataSet) -> pd.DataFrame:
    """Return the table in our quantities and units."""
    columns = {
        quantity: column
        for quantity, column in data_set.columns.items()
        if quantity not in ("kind", "subkind") and column.name in table
    }
    if data_set.companions:
        columns["time"] = replace(columns["time"], factor=_frame_period(path, data_set))
    frame = to_numbers(table, columns, path)
    if data_set.is_image_frame:
        frame["x"] = frame["x"] + frame["length"] / 2.0
        frame["y"] = -(frame["y"] + frame["width"] / 2.0)
        frame["vy"] = -frame["vy"]
    if not {"vx", "vy"} <= set(frame):
        return frame
    frame["speed"] = np.hypot(frame["vx"], frame["vy"])
    if "heading" not in frame:
        course = np.arctan2(frame["vy"], frame["vx"])
        frame["heading"] = course.where(frame["speed"] > _MIN_HEADING_MPS, math.nan)
    return frame


def _frame_period(path: Path, data_set: DataSet) -> float:
    """Return the seconds between two frames of a recording.

    Raises:
        InputError: its frame rate is missing or implausible.
    """
    assert data_set.companions is not None
    meta = _readcompanion(path, data_set, data_set.companions.frame_rate, ("frameRate",))
    frame_rate = float(reals(meta["frameRate"]).iloc[0])
    if not 0.1 <= frame_rate <= 1000.0:
        raise InputError(
            f"{path}: its recordingMeta has {frame_rate:g} frames per second; 0.1 to 1000 can be "
            "read"
        )
    return 1.0 / frame_rate
