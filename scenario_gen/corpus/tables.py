# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Tables as tasks write and read them: Parquet, each whole or not there."""

from collections.abc import Iterator, Mapping, Sequence
import json
from typing import Any

from scenario_gen.base.errors import guarded, InputError, needs
from scenario_gen.base.stores import each_fetched, fetched, Place
from scenario_gen.corpus.tasks import arriving

ROWS = 100  # of a group, which is read at once: an encounter's tracks are long


def write_table(
    target: Place, rows: Sequence[Mapping[str, Any]], columns: Mapping[str, str], **facts: Any
) -> None:
    """Write a table, whole or not at all; NaN becomes null.

    Args:
        target: the file.
        rows: have at least the columns.
        columns: pyarrow's name of the type of each; with `[]` a list of such.
        facts: stand as JSON in the table's metadata.
    """
    needs("corpus", "pyarrow")
    import pyarrow as pa
    from pyarrow import parquet

    def kind(name: str) -> Any:
        return pa.list_(kind(name[:-2])) if name.endswith("[]") else pa.type_for_alias(name)

    schema = pa.schema([(name, kind(text)) for name, text in columns.items()])
    clean = [
        {name: None if row[name] != row[name] else row[name] for name in columns} for row in rows
    ]
    table = pa.Table.from_pylist(clean, schema=schema)
    with arriving(target) as part:
        described = table.replace_schema_metadata(
            {name: json.dumps(value) for name, value in facts.items()}
        )
        parquet.write_table(described, part, row_group_size=ROWS, compression="zstd")


def rows_of(
    tables: Sequence[Place], columns: Sequence[str] | None = None
) -> Iterator[dict[str, Any]]:
    """Yield the rows of tables, in their order.

    Raises:
        InputError: a table is damaged, or lacks a column.
    """
    from pyarrow import parquet

    for path, here in each_fetched(tables):
        with guarded(f"{path} cannot be read as a table"):
            rows = parquet.read_table(here, columns=list(columns) if columns else None).to_pylist()
        if rows and (lacking := set(columns or ()) - rows[0].keys()):
            raise InputError(f"{path} lacks the columns {', '.join(sorted(lacking))}")
        yield from rows


def rows_at(table: Place, numbers: Sequence[int]) -> list[dict[str, Any]]:
    """Return rows of a table by their numbers.

    Raises:
        InputError: the table is damaged, or has no such row.
    """
    from pyarrow import dataset

    with (
        fetched([table]) as (here,),
        guarded(f"{table} cannot be read as a table", remedy="`mine` writes it anew"),
    ):
        found: list[dict[str, Any]] = (
            dataset.dataset(here, format="parquet").take(list(numbers)).to_pylist()
        )
    return found
