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
from pyarrow import compute, parquet

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
    schema = _read_schema(path)
    header = list(schema.names)
    columns = find_columns(header, path, config.columns)
    for quantity, column in list(columns.items()):
        kind = _value_type(schema.field(column.name).type)
        if quantity in ("kind", "date") and not (_is_text(kind) or column.types):
            del columns[quantity]  # numbers of unknown meaning, or whole days
            continue
        unit_s = _time_unit_s(kind)
        is_time = quantity == "time" and unit_s is not None
        if not (is_time or _is_text(kind) or _is_number(kind)):
            raise InputError(
                f"{path}, column {column.name!r} ({quantity}): a {kind} is not a {quantity}; "
                "name another column"
            )
        if quantity == "time" and unit_s is not None:
            columns[quantity] = replace(column, factor=unit_s)
    names = sorted({column.name for column in columns.values()})
    return _read_table(path, names, rows_before, config), columns, header


def _read_schema(path: Path) -> pa.Schema:
    """Return the names and types of the columns.

    Raises:
        InputError: the file is damaged, or two columns have the same name.
    """
    with guarded(f"{path} cannot be read as a Parquet table"):
        schema = parquet.read_schema(path)
        counts = Counter(schema.names)
    for name, count in counts.items():
        if count > 1:
            raise InputError(f"{path} has several columns {name!r}; rename all but one")
    return schema


def _read_table(
    path: Path, names: Sequence[str], rows_before: int, config: LogConfig
) -> pd.DataFrame:
    """Read some columns unchanged; missing ones are omitted.

    Raises:
        InputError: the file is damaged or too large.
    """
    schema = _read_schema(path)
    present = [name for name in names if name in schema.names]
    batches = _read_batches(path, schema, present, rows_before, config)
    frame = {}
    for name in present:
        with guarded(f"{path}, column {name!r} cannot be read"):
            frame[name] = _to_series(pa.chunked_array([batch.column(name) for batch in batches]))
    return pd.DataFrame(frame)


def _read_batches(
    path: Path, schema: pa.Schema, names: Sequence[str], rows_before: int, config: LogConfig
) -> list[Any]:
    """Read some columns in batches; texts as dictionaries, so that repeated ones are stored once.

    Raises:
        InputError: the file is damaged or too large.
    """
    texts = [name for name in names if _is_text(schema.field(name).type)]
    with guarded(f"{path} cannot be read as a Parquet table"):
        file = parquet.ParquetFile(path, read_dictionary=texts)
        declared_bytes = _declared_bytes(file.metadata, names)
        declared_rows = file.metadata.num_rows
        source = file.iter_batches(1 << 16, columns=list(names), use_threads=False)
    check_size(str(path), declared_bytes, rows_before + declared_rows, config)
    batches: list[Any] = []
    n_rows = 0
    n_bytes = 0
    while True:
        with guarded(f"{path} cannot be read as a Parquet table, after row {n_rows}"):
            batch = next(source, None)
            if batch is None:
                break
            n_rows += batch.num_rows
            n_bytes += sum(map(_decoded_bytes, batch.columns))
        check_size(str(path), n_bytes, rows_before + n_rows, config)
        batches.append(batch)
    if not n_rows:
        raise InputError(f"{path} has a header but no rows")
    return batches


def _declared_bytes(metadata: Any, names: Sequence[str]) -> int:
    """Return the declared size of some columns after decompression."""
    total = 0
    for k in range(metadata.num_row_groups):
        group = metadata.row_group(k)
        for column in map(group.column, range(group.num_columns)):
            if column.path_in_schema.split(".")[0] in names:
                total += max(column.total_uncompressed_size, 0)
    return total


def _decoded_bytes(values: pa.Array) -> int:
    """Return the size of values; texts in a dictionary count as often as they occur."""
    if not pa.types.is_dictionary(values.type) or not _is_text(values.type.value_type):
        return int(values.nbytes)
    lengths = compute.binary_length(values.dictionary).take(values.indices)
    return compute.sum(lengths.cast(pa.int64())).as_py() or 0


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
