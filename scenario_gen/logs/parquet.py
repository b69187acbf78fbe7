# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Parquet through Arrow: only needed columns are read, and every kind of column is accepted or refused by name.

The metadata of pandas in a file is ignored.
"""

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
from pyarrow import compute, parquet

from scenario_gen.base.errors import guarded, InputError
from scenario_gen.logs.columns import Column, find_columns, UNITS
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.raw import check_size

BATCH = 1 << 16  # rows


def read_columns(
    path: Path, before: int, config: LogConfig
) -> tuple[pd.DataFrame, dict[str, Column], list[str]]:
    """Read the columns that are needed; `before` rows were read from other files.

    Returns:
        A table of numbers and texts, and the columns with the factors to our units, those of times by the type in Arrow; and
        the names of all columns.

    Raises:
        InputError: the file is damaged or too large, or a column is of no kind that its quantity can have.
    """
    schema = read_schema(path)
    columns = find_columns(list(schema.names), path, config.columns)
    for quantity, column in list(columns.items()):
        kind = schema.field(column.name).type
        if quantity == "kind" and not is_text(
            kind.value_type if pa.types.is_dictionary(kind) else kind
        ):
            del columns[quantity]  # numbers whose meaning is not known
            continue
        check_kind(kind, quantity, column, path)
        if quantity == "time" and (factor := unit_of(kind)) is not None:
            columns[quantity] = replace(column, factor=factor)
    return (
        read_table(path, sorted({column.name for column in columns.values()}), before, config),
        columns,
        list(schema.names),
    )


def read_schema(path: Path) -> pa.Schema:
    """Return the names and types of the columns, each of another name.

    Raises:
        InputError: the file is damaged, or two columns have one name.
    """
    with guarded(f"{path} cannot be read as a Parquet table"):
        schema = parquet.read_schema(path)
        names = list(schema.names)
    for name, count in Counter(names).items():
        if count > 1:
            raise InputError(f"{path} has more than one column {name!r}; rename all but one")
    return schema


def read_table(path: Path, names: list[str], before: int, config: LogConfig) -> pd.DataFrame:
    """Read some columns as they stand; `before` rows were read from other files; a column that is missing is left out.

    Raises:
        InputError: the file is damaged or too large.
    """
    schema = read_schema(path)
    present = [name for name in names if name in schema.names]
    batches = read_batches(path, schema, present, before, config)
    frame = {}
    for name in present:
        with guarded(f"{path}, column {name!r} cannot be read"):
            frame[name] = to_series(pa.chunked_array([batch.column(name) for batch in batches]))
    return pd.DataFrame(frame)


def read_batches(
    path: Path, schema: pa.Schema, names: list[str], before: int, config: LogConfig
) -> list[Any]:
    """Read some columns batch by batch; texts as dictionaries, so that repeated ones are stored once.

    Raises:
        InputError: the file is damaged or too large.
    """
    texts = [name for name in names if is_text(schema.field(name).type)]
    with guarded(f"{path} cannot be read as a Parquet table"):
        file = parquet.ParquetFile(path, read_dictionary=texts)
        groups = [file.metadata.row_group(k) for k in range(file.metadata.num_row_groups)]
        parts = [group.column(k) for group in groups for k in range(group.num_columns)]
        declared = sum(
            max(part.total_uncompressed_size, 0)
            for part in parts
            if part.path_in_schema.split(".")[0] in names
        )
        rows, source = (
            file.metadata.num_rows,
            file.iter_batches(BATCH, columns=names, use_threads=False),
        )
    check_size(str(path), declared, before + rows, config)
    batches: list[Any] = []
    rows = size = 0
    while True:
        with guarded(f"{path} cannot be read as a Parquet table, after row {rows}"):
            batch = next(source, None)
            if batch is None:
                break
            rows, size = rows + batch.num_rows, size + batch.nbytes
        check_size(str(path), size, before + rows, config)
        batches.append(batch)
    if not rows:
        raise InputError(f"{path} has a header but no rows")
    return batches


def is_text(kind: pa.DataType) -> bool:
    """Return whether a type of Arrow is text."""
    return bool(
        pa.types.is_string(kind) or pa.types.is_large_string(kind) or pa.types.is_string_view(kind)
    )


def unit_of(kind: pa.DataType) -> float | None:
    """Return the seconds of a date's or timestamp's unit, None for other types."""
    if pa.types.is_timestamp(kind):
        return UNITS["time"][kind.unit]
    if pa.types.is_date(kind):
        return 86400.0 if pa.types.is_date32(kind) else UNITS["time"]["ms"]
    return None


def check_kind(kind: pa.DataType, quantity: str, column: Column, path: Path) -> None:
    """Refuse a column that holds neither numbers nor texts, nor times where those are wanted.

    Raises:
        InputError: it does; names the column and its type.
    """
    kind = kind.value_type if pa.types.is_dictionary(kind) else kind
    sound = is_text(kind) or any(
        is_kind(kind)
        for is_kind in (
            pa.types.is_integer,
            pa.types.is_floating,
            pa.types.is_decimal,
            pa.types.is_null,
        )
    )
    if not (sound or (quantity == "time" and unit_of(kind) is not None)):
        raise InputError(
            f"{path}, column {column.name!r} ({quantity}): a {kind} is no {quantity}; name another column"
        )


def to_series(values: pa.ChunkedArray) -> "pd.Series[Any]":
    """Return numbers (integers stay exact, and may be missing) or texts; times as integers of their unit."""
    if pa.types.is_dictionary(values.type):
        if is_text(values.type.value_type):
            return values.to_pandas().astype(object)
        values = compute.cast(values, values.type.value_type)
    if pa.types.is_null(values.type):
        return pd.Series(np.full(len(values), np.nan))
    if is_text(values.type):
        return values.to_pandas()
    if pa.types.is_date32(values.type):
        values = values.cast(pa.int32())
    if not (unit_of(values.type) or pa.types.is_integer(values.type)):
        return values.cast(pa.float64(), safe=False).to_pandas()
    whole = pa.uint64() if pa.types.is_uint64(values.type) else pa.int64()
    return values.cast(whole).to_pandas(
        types_mapper={pa.int64(): pd.Int64Dtype(), pa.uint64(): pd.UInt64Dtype()}.get
    )
