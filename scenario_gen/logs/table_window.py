# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A window of time of a text table that is too large to be read whole.

The table is parsed twice, in blocks: first its stamps, to find the earliest, then all columns.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from scenario_gen.base.errors import guarded, InputError
from scenario_gen.logs.column import Column
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.raw import check_size
from scenario_gen.logs.stamps import read_stamps, time_of_day
from scenario_gen.logs.text import READ_OPTIONS
from scenario_gen.numerics import Bools, Ints

LARGE_BYTES = 64 << 20
"""Smaller tables are read whole, and cut afterwards."""

_BLOCK_ROWS = 200_000


def has_window(path: Path, config: LogConfig) -> bool:
    """Return whether only a window of a table is read."""
    return bool(config.start or config.end) and path.stat().st_size > LARGE_BYTES


def read_window(
    path: Path, columns: Mapping[str, Column], config: LogConfig, options: dict[str, Any]
) -> pd.DataFrame:
    """Read the rows between the parameters `start` and `end`, and the first and the last one.

    Args:
        path: the table.
        columns: its columns by quantity.
        config: the window, and the largest number of rows in it.
        options: those of `pandas.read_csv`.

    Returns:
        The rows in the order of the file; the index counts all rows of the file.

    Raises:
        InputError: the stamps do not tell which rows are in the window, or there are too many.
    """
    begin_ns, end_ns, ends = _window(path, columns, config, options)
    n_rows = 0
    parts = []
    for block in _blocks(path, options):
        stamps, is_valid = _stamps_of(block, path, columns)
        wanted = is_valid & (stamps >= begin_ns) & (stamps <= end_ns)
        wanted |= block.index.isin(ends)
        n_rows += int(wanted.sum())
        check_size(f"{path}, in the window", 0, n_rows, config)
        parts.append(block[wanted])
    return pd.concat(parts)


def _blocks(path: Path, options: Mapping[str, Any]) -> Iterator[pd.DataFrame]:
    """Yield blocks of rows; the index counts all rows.

    Raises:
        InputError: it is not a table.
    """
    with (
        guarded(f"{path} cannot be read as a table"),
        pd.read_csv(path, chunksize=_BLOCK_ROWS, **READ_OPTIONS, **options) as reader,
    ):
        yield from reader


def _window(
    path: Path, columns: Mapping[str, Column], config: LogConfig, options: dict[str, Any]
) -> tuple[int, int, list[int]]:
    """Return the first and last stamp [ns] of the window, and the earliest and the latest row.

    Raises:
        InputError: the stamps are no continuous time, or the table has scenes.
    """
    names = [columns[name].name for name in ("time", "date") if name in columns]
    earliest = latest = (0, -1)
    for block in _blocks(path, {**options, "usecols": names}):
        if block.index[0] == 0:
            _check_continuous(block, path, columns)
        stamps, is_valid = _stamps_of(block, path, columns)
        rows = np.flatnonzero(is_valid)
        if not len(rows):
            continue
        first = rows[np.argmin(stamps[rows])]
        last = rows[np.argmax(stamps[rows])]
        if earliest[1] < 0 or stamps[first] < earliest[0]:
            earliest = (int(stamps[first]), int(block.index[first]))
        if latest[1] < 0 or stamps[last] > latest[0]:
            latest = (int(stamps[last]), int(block.index[last]))
    begin_ns = earliest[0] + round(config.start * 1e9)
    end_ns = earliest[0] + round(config.end * 1e9) if config.end else latest[0]
    return begin_ns, end_ns, [earliest[1], latest[1]]


def _stamps_of(
    block: pd.DataFrame, path: Path, columns: Mapping[str, Column]
) -> tuple[Ints, Bools]:
    """Return the stamps (R,) [ns] of a block, and which are valid."""
    column = columns["time"]
    dates = block[columns["date"].name] if "date" in columns else None
    place = f"{path}, column {column.name!r} (time)"
    stamps, is_valid = read_stamps(block[column.name], column, dates, place)
    return stamps.to_numpy(), is_valid.to_numpy()


def _check_continuous(block: pd.DataFrame, path: Path, columns: Mapping[str, Column]) -> None:
    """Check in the first block that stamps are those of one clock, in a known unit.

    Raises:
        InputError: they are not.
    """
    column = columns["time"]
    where = f"{path}, column {column.name!r} (time)"
    remedy = "cut the log, or raise --set log.size_limit=… and read it without log.start, log.end"
    if "scene" in columns:
        raise InputError(f"{path}: each scene of a table has its own time; {remedy}")
    values = block[column.name]
    if "date" not in columns and time_of_day(values, column) is not None:
        raise InputError(f"{where}: times of the day have no date; {remedy}")
    may_count_frames = pd.api.types.is_integer_dtype(values) and values.abs().max() < 1e9
    if not column.unit and may_count_frames:
        raise InputError(
            f"{where} has whole numbers without a unit; name it, for example "
            f"--set log.columns=time={column.name}:s or {column.name}:25fps"
        )
