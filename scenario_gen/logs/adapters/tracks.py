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
from scenario_gen.logs.adapters.data_sets import DATA_SETS, DataSet
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.raw import check_size, RawLog
from scenario_gen.logs.tables import (
    from_frame,
    read_text,
    reals,
    segment_of,
    to_numbers,
    vehicle_name,
)

Load = Callable[[Path, DataSet, int, LogConfig], pd.DataFrame]


def read(
    paths: Sequence[Path], config: LogConfig, *, name: str, load: Load | None = None
) -> RawLog:
    """Read one recording of a data set.

    Args:
        paths: its file, or the folder's files, of which one holds the tracks.
        config: bounds sizes.
        name: of the format, a key of `DATA_SETS`.
        load: returns the columns of a file as they stand, of which so many rows were read before; by default of a table.

    Raises:
        InputError: a file is damaged or missing, has not the format's columns, or there are several recordings.
    """
    known = DATA_SETS[name]
    tracks = [path for path in paths if not _companion_ending(path, known)]
    tracks.sort(key=lambda path: _is_of_pedestrians(path, name))
    main = [path for path in tracks if not _is_of_pedestrians(path, name)]
    if len(main) != 1:
        names = ", ".join(path.name for path in main) or "none"
        raise InputError(
            f"{paths[0]}: one recording of {known.title} has one file of tracks, here are {names}; give one at a time"
        )
    frames, segments, row = [], [], 0
    for path in tracks:
        table = (load or _read_table)(path, known, row, config)
        frames.append(
            _convert(table, path, known).assign(
                kind=_kinds(path, known, table), row=range(row, row + len(table))
            )
        )
        segments.append(segment_of(path, row))
        row += len(table)
    frame = pd.concat(frames, ignore_index=True)
    without = (
        () if "speed" in frame else ("there are no speeds: they are derived from the positions",)
    )
    notes = (f"read as {known.title}", *without)
    return replace(from_frame(frame, main, tuple(segments), config), rows=row, notes=notes)


def recognised(path: Path) -> str:
    """Return the name of the format that a file's header is of, "" if of none; of a companion, that of its tracks."""
    if path.suffix.lower() == ".parquet":
        needs("parquet", "pyarrow")
        from pyarrow import parquet

        try:
            names = set(parquet.read_schema(path).names)
        except Exception:  # the reader of tables reports what is wrong with it
            return ""
    elif path.suffix.lower() == ".csv":
        for known in DATA_SETS.values():
            if known.companions and (ending := _companion_ending(path, known)):
                main = path.with_name(path.name.removesuffix(ending) + known.companions[0])
                return recognised(main) if main.is_file() else ""
        with path.open(encoding="utf-8-sig", errors="replace") as file:
            names = {field.strip() for field in file.readline().split(",")}
        if (
            path.name.startswith("pedestrian_tracks")
            and {"track_id", "timestamp_ms", "agent_type"} <= names
        ):
            return "interaction"
    else:
        return ""
    return next((name for name, known in DATA_SETS.items() if known.needed <= names), "")


def _companion_ending(path: Path, known: DataSet) -> str:
    """Return the ending by which a file belongs to another one of tracks, "" if it does not."""
    return next(
        (ending for ending in (known.companions or ())[1:] if path.name.endswith(ending)), ""
    )


def _is_of_pedestrians(path: Path, name: str) -> bool:
    """Return whether a file holds pedestrians alone, who have files of their own in INTERACTION."""
    return name == "interaction" and path.name.startswith("pedestrian")


def _read_table(path: Path, known: DataSet, before: int, config: LogConfig) -> pd.DataFrame:
    """Return the columns of a file as they stand; `before` rows were read from other files."""
    check_size(str(path), path.stat().st_size, before, config)
    if path.suffix.lower() == ".parquet":
        needs("parquet", "pyarrow")
        from scenario_gen.logs.parquet import read_table

        table = read_table(path, sorted(known.useful), before, config)
    else:
        table = read_text(path, before, config, sep=",")
    table.columns = pd.Index([str(column).strip() for column in table.columns])
    missing = sorted(known.needed - set(table.columns))
    if missing and not (
        known is DATA_SETS["interaction"] and _is_of_pedestrians(path, "interaction")
    ):
        raise InputError(
            f"{path} lacks columns of {known.title}: {', '.join(missing)}; it has {', '.join(table.columns)}"
        )
    return table


def _read_companion(
    path: Path, known: DataSet, which: int, columns: tuple[str, ...]
) -> pd.DataFrame:
    """Return a companion of a file of tracks.

    Raises:
        InputError: it is not there, or lacks a column.
    """
    assert known.companions is not None
    ending = known.companions[0]
    file = path.with_name(path.name.removesuffix(ending) + known.companions[which])
    if not path.name.endswith(ending) or not file.is_file():
        raise InputError(
            f"{path}: {known.title} has {file.name} beside it, which is not there; put it there under its own name"
        )
    with guarded(f"{file} cannot be read as a table"):
        frame = pd.read_csv(file, nrows=1_000_000)
    missing = [column for column in columns if column not in frame.columns]
    if missing or frame.empty:
        raise InputError(
            f"{file} lacks {', '.join(missing) or 'rows'}; it has {', '.join(map(str, frame.columns))}"
        )
    return frame


def _kinds(path: Path, known: DataSet, table: pd.DataFrame) -> "pd.Series[Any]":
    """Return the class of every row, in small letters."""
    if known.names:
        return _named(known, table)
    if "kind" in known.columns:
        column = known.columns["kind"].name
        kinds = table[column] if column in table else pd.Series("pedestrian", index=table.index)
        return kinds.astype(str).str.strip().str.lower()
    column = known.columns["vehicle"].name
    meta = _read_companion(path, known, 1, (column, "class"))
    classes = dict(
        zip(
            meta[column].map(vehicle_name),
            meta["class"].astype(str).str.strip().str.lower(),
            strict=True,
        )
    )
    return table[column].map(vehicle_name).map(lambda name: classes.get(name, "without a class"))


def _named(known: DataSet, table: pd.DataFrame) -> "pd.Series[Any]":
    """Return the class of every row, by the numbers in its columns."""

    def named(quantity: str) -> "pd.Series[Any]":
        names = known.names[quantity]
        return (
            table[known.columns[quantity].name]
            .map(vehicle_name)
            .map(lambda number: names.get(number, f"type {number}"))
        )

    kinds = named("kind")
    return (
        kinds.where(kinds != "vehicle", named("subkind"))
        if known.columns["subkind"].name in table
        else kinds
    )


def _convert(table: pd.DataFrame, path: Path, known: DataSet) -> pd.DataFrame:
    """Return the table in our quantities and units."""
    columns = {
        quantity: column
        for quantity, column in known.columns.items()
        if quantity not in ("kind", "subkind") and column.name in table
    }
    if known.companions:
        rate = float(reals(_read_companion(path, known, 2, ("frameRate",))["frameRate"]).iloc[0])
        if not 0.1 <= rate <= 1000.0:
            raise InputError(
                f"{path}: the recordingMeta beside it says {rate:g} frames per second; 0.1 to 1000 are read"
            )
        columns["time"] = replace(columns["time"], factor=1.0 / rate)
    out = to_numbers(table, columns, path)
    if known.image:
        out["x"], out["y"], out["vy"] = (
            out["x"] + out["length"] / 2.0,
            -(out["y"] + out["width"] / 2.0),
            -out["vy"],
        )
    if not {"vx", "vy"} <= set(out):
        return out
    vx, vy = out["vx"].to_numpy(float), out["vy"].to_numpy(float)
    out["speed"] = np.hypot(vx, vy)
    if "heading" not in out:
        out["heading"] = np.where(out["speed"] > 0.1, np.arctan2(vy, vx), math.nan)
    return out
