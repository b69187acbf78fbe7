# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`batch --compact`: merges the many small tables of a batch into few with large row groups."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

from scenario_gen.base.errors import guarded, InputError, needs
from scenario_gen.corpus.store import (
    finished_parts,
    FOLDERS,
    MANIFEST,
    parts_of,
    Tables,
    without_repeated,
)
from scenario_gen.corpus.tables import table_writer
from scenario_gen.corpus.tasks import arriving, held, spread, Workers


@dataclass(frozen=True)
class MergeTask:
    """Tables to merge, some of which may be merged already."""

    tables: Tables
    target: Path

    @property
    def name(self) -> str:
        """The task in messages."""
        return str(self.target)


def compact(batch: Path, workers: Workers = Workers()) -> tuple[int, int, list[str]]:
    """Merge the tables of finished parts; return their numbers before and after, and failures.

    `find` gives the same rows afterwards, and the batch can still grow.

    Raises:
        InputError: there is no batch, or another command writes it.
    """
    needs("corpus", "duckdb", "pyarrow")
    if not (batch / MANIFEST).exists():
        raise InputError(f"{batch} is no batch; name a folder that `scenario-gen batch` wrote")
    with held(batch), spread(workers) as run:
        before = _count(batch)
        failed = run(merge, _tasks(batch))
        return before, _count(batch), failed


def _count(batch: Path) -> int:
    return sum(len(tables) for name in FOLDERS for tables in parts_of(batch / name).values())


def _tasks(batch: Path) -> list[MergeTask]:
    """Return a task for each run of finished parts with several tables."""
    runs = {road: _runs(numbers) for road, numbers in finished_parts(batch).items()}
    tasks = []
    for name in FOLDERS:
        for partition, tables in parts_of(batch / name).items():
            folder, road = batch / name / partition, partition.rpartition("/")[2]
            tasks += [_merge_task(folder, tables, run) for run in runs.get(road, ())]
    return [task for task in tasks if len(task.tables) > 1]


def _merge_task(folder: Path, tables: Tables, run: range) -> MergeTask:
    """Return the task that merges the tables of a run of parts in a folder."""
    inside = {table: numbers for table, numbers in tables.items() if numbers[0] in run}
    return MergeTask(inside, folder / f"parts-{run.start:05}-{run.stop - 1:05}.parquet")


def _runs(numbers: Iterable[int]) -> list[range]:
    """Return the runs of consecutive numbers within each block."""
    ordered = sorted(numbers)
    # A table has at most 1,000 parts.
    groups = groupby(range(len(ordered)), lambda k: (ordered[k] - k, ordered[k] // 1000))
    runs = [[ordered[k] for k in group] for _, group in groups]
    return [range(run[0], run[-1] + 1) for run in runs]


def merge(task: MergeTask) -> None:
    """Merge tables, then remove them.

    Raises:
        InputError: a table is damaged.
        OSError: the disk is full or fails.
    """
    unique = without_repeated(task.tables)
    if len(unique) > 1:
        with arriving(task.target) as part:
            _write_merged(part, list(unique))
        unique = {}
    for table in task.tables.keys() - unique.keys():
        table.unlink()


def _write_merged(path: Path, tables: Sequence[Path]) -> None:
    """Write the rows of tables to one file; a row group is in memory at a time."""
    import pyarrow as pa
    from pyarrow import parquet

    writer: Any = None
    group: list[Any] = []
    try:
        for table in tables:
            with guarded(f"{table} cannot be read as a table"):
                group.append(parquet.ParquetFile(table).read())
            writer = writer or table_writer(path, group[0].schema)
            rows = sum(each.num_rows for each in group)
            size = sum(each.nbytes for each in group)
            if rows >= 100_000 or size >= 512 << 20:  # a group is in memory
                writer.write_table(pa.concat_tables(group), row_group_size=rows)
                group = []
        if group:
            writer.write_table(pa.concat_tables(group))
    finally:
        writer.close()
