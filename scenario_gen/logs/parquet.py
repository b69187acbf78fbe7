# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Parquet tables: only needed columns are read; pandas' metadata in a file is ignored."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
from pyarrow import parquet

from scenario_gen.base.errors import guarded, InputError
from scenario_gen.logs.column import Column
from scenario_gen.logs.columns import find_columns, UNITS
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.raw import check_size


def read_columns(
    path: Path, rows_before: int, config: LogConfig
) -> tuple[pd.DataFrame, dict[str, Column], list[str]]:
    """Read the needed columns; `rows_before` rows were read from other files.

    Returns:
        The table; its columns by quantity, times with the unit of their Arrow type; the header.

    Raises:
        InputError: the file is damaged or too large, or a column does not suit its quantity.
    """
    problem = f"{path} cannot be read as a Parquet table"
    with guarded(problem):
        schema = parquet.read_schema(path)
        # Texts as dictionaries: repeated ones are stored once.
        texts = [field.name for field in schema if _is_text(field.type)]
        file = parquet.ParquetFile(path, read_dictionary=texts)
    header = list(schema.names)
    if repeated := [name for name, count in Counter(header).items() if count > 1]:
        raise InputError(f"{path} has several columns {repeated[0]!r}; rename all but one")
    columns = _typed(find_columns(header, path, config.columns), schema, path)
    names = sorted({column.name for column in columns.values()})
    metadata = file.metadata
    check_size(
        str(path), _declared_bytes(metadata, names), rows_before + metadata.num_rows, config
    )
    with guarded(problem):
        table = file.read(names, use_threads=False)
    check_size(str(path), table.nbytes, rows_before + table.num_rows, config)
    if not table.num_rows:
        raise InputError(f"{path} has a header but no rows")
    with guarded(problem):
        frame = pd.DataFrame({name: _to_series(table.column(name)) for name in names})
    return frame, columns, header


def _typed(columns: dict[str, Column], schema: pa.Schema, path: Path) -> dict[str, Column]:
    """Return the columns without those of unknown meaning; times have the unit of their type.

    Raises:
        InputError: a column does not suit its quantity.
    """
    for quantity, column in list(columns.items()):
        kind = _value_type(schema.field(column.name).type)
        if quantity in ("kind", "date") and not (_is_text(kind) or column.types):
            del columns[quantity]  # numbers of unknown meaning, or whole days
            continue
        unit_s = _time_unit_s(kind) if quantity == "time" else None
        if unit_s is not None:
            columns[quantity] = replace(column, factor=unit_s)
        elif not (_is_text(kind) or _is_number(kind)):
            raise InputError(
                f"{path}, column {column.name!r} ({quantity}): a {kind} is not a {quantity}; "
                "name another column"
            )
    return columns


def _declared_bytes(metadata: Any, names: Sequence[str]) -> int:
    """Return the declared size of some columns after decompression."""
    total = 0
    for k in range(metadata.num_row_groups):
        group = metadata.row_group(k)
        for column in map(group.column, range(group.num_columns)):
            if column.path_in_schema.split(".")[0] in names:
                total += max(column.total_uncompressed_size, 0)
    return total


def _value_type(kind: pa.DataType) -> pa.DataType:
    """Return the type of the values of a dictionary; of others the type itself."""
    return kind.value_type if pa.types.is_dictionary(kind) else kind


def _is_text(kind: pa.DataType) -> bool:
    is_text = pa.types.is_string(kind) or pa.types.is_large_string(kind)
    return bool(is_text or pa.types.is_string_view(kind))


def _is_number(kind: pa.DataType) -> bool:
    is_number = pa.types.is_integer(kind) or pa.types.is_floating(kind)
    return bool(is_number or pa.types.is_decimal(kind) or pa.types.is_null(kind))


def _time_unit_s(kind: pa.DataType) -> float | None:
    """Return the unit of dates and timestamps in seconds, None for other types."""
    if pa.types.is_timestamp(kind):
        return UNITS["time"][kind.unit]
    if pa.types.is_date32(kind):
        return UNITS["time"]["d"]
    return UNITS["time"]["ms"] if pa.types.is_date(kind) else None


def _to_series(values: pa.ChunkedArray) -> "pd.Series[Any]":
    """Return integers (some may be missing), numbers or texts; times as integers."""
    kind = _value_type(values.type)
    if pa.types.is_date32(kind):
        values = values.cast(pa.int32())
    if pa.types.is_integer(kind) or _time_unit_s(kind) is not None:
        values = values.cast(pa.uint64() if pa.types.is_uint64(kind) else pa.int64())
    nullable = {pa.int64(): pd.Int64Dtype(), pa.uint64(): pd.UInt64Dtype()}
    series = values.to_pandas(types_mapper=nullable.get)
    return series.astype(object) if isinstance(series.dtype, pd.CategoricalDtype) else series
