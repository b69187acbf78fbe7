# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Parquet tables that tasks read and write; a table is never partly written."""

from collections.abc import Iterator, Mapping, Sequence
import json
from pathlib import Path
from typing import Any

from scenario_gen.base.errors import guarded, InputError, needs
from scenario_gen.corpus.tasks import arriving

# A row group is decoded as a whole, and the tracks of an encounter are long.
GROUP_ROWS = 100
UNITS = {
    "seconds": "s",
    "distance": "m",
    "ttc": "s",
    "pet": "s",
    "speed": "m/s",
    "braking": "m/s²",
}


def write_table(
    target: Path, rows: Sequence[Mapping[str, Any]], columns: Mapping[str, str], **facts: Any
) -> None:
    """Write a table atomically; NaN becomes null.

    Args:
        target: the file.
        rows: each has at least the columns.
        columns: pyarrow's type name of each column; `[]` at its end makes a list type.
        facts: written as JSON to the metadata of the table.
    """
    needs("corpus", "pyarrow")
    import pyarrow as pa
    from pyarrow import parquet

    def data_type(name: str) -> Any:
        if name.endswith("[]"):
            return pa.list_(data_type(name[:-2]))
        return pa.type_for_alias(name)

    metadata = {name: json.dumps(value) for name, value in facts.items()}
    fields = []
    for name, text in columns.items():
        unit = {"unit": UNITS[name]} if name in UNITS else None
        fields.append(pa.field(name, data_type(text), metadata=unit))
    schema = pa.schema(fields, metadata)
    clean = [
        {name: None if row[name] != row[name] else row[name] for name in columns} for row in rows
    ]
    table = pa.Table.from_pylist(clean, schema=schema)
    with arriving(target) as part:
        parquet.write_table(table, part, row_group_size=GROUP_ROWS, compression="zstd")


def rows_of(
    tables: Sequence[Path], columns: Sequence[str] | None = None
) -> Iterator[dict[str, Any]]:
    """Yield the rows of tables, in their order.

    Raises:
        InputError: a table is damaged, or lacks a column.
    """
    from pyarrow import parquet

    for table in tables:
        with guarded(f"{table} cannot be read as a table"):
            rows = parquet.read_table(
                table, columns=list(columns) if columns else None
            ).to_pylist()
        if rows and (missing := set(columns or ()) - rows[0].keys()):
            raise InputError(f"{table} lacks the columns {', '.join(sorted(missing))}")
        yield from rows
