# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The tasks of the later stages of mining, from the results of the earlier ones.

The name of a result has a hash of what it depends on. A result that no task would write is
removed: its files have changed.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from scenario_gen.base.documents import COUNT, read_json
from scenario_gen.corpus.config import CorpusConfig
from scenario_gen.corpus.encounters import CleanTask
from scenario_gen.corpus.grouping import GroupTask, partitions
from scenario_gen.corpus.meetings import HourTask, overlap
from scenario_gen.corpus.messages import digest_of, HOUR_US, RangeTask
from scenario_gen.corpus.tasks import Target
from scenario_gen.numerics import Ints


def _by_hour(values: dict[str, Any]) -> dict[str, Any]:
    return {
        "type": "object",
        "propertyNames": {"pattern": "^[0-9]{1,18}$"},
        "additionalProperties": values,
    }


_TEXTS = {"type": "object", "additionalProperties": {"type": "string"}}
ACCOUNT = {  # of a range: rows by cause of each file, rows and hashes of hours, damaged files
    "type": "object",
    "required": ["files", "hours", "contents", "notes"],
    "properties": {
        "files": {
            "type": "object",
            "additionalProperties": {"type": "object", "additionalProperties": COUNT},
        },
        "hours": _by_hour(COUNT),
        "contents": _by_hour({"type": "string", "pattern": "^[0-9a-f]+$"}),
        "notes": {"type": "array", "items": {"type": "string"}},
        "damaged": _TEXTS,
    },
}


def least_rows(config: CorpusConfig) -> int:
    """Return the least number of messages of two vehicles in a meeting that is long enough."""
    log = config.log
    seconds = min(log.min_presence, log.min_duration)
    return 2 * (int(seconds / max(log.longest_gap, log.period)) + 1)


def current(tasks: Sequence[Target], folder: Path, pattern: str = "[!.]*") -> list[Target]:
    """Return the tasks that are not done; remove other results of their stage.

    Args:
        tasks: of the stage.
        folder: of its results.
        pattern: of their names.
    """
    wanted = {task.target.stem for task in tasks}
    existing = list(folder.glob(pattern))
    for path in existing:
        if path.stem not in wanted:
            path.unlink()
    names = {path.name for path in existing}
    return [task for task in tasks if task.target.name not in names]


def accounts_of(ranged: Sequence[RangeTask], out: Path) -> dict[Path, dict[str, Any]]:
    """Return the tables of ranges that are parsed, with their accounts."""
    listed = {path.name: path for path in (out / "messages").glob("range-*")}
    tables: dict[Path, Path] = {}
    for task in ranged:
        account = listed.get(task.target.with_suffix(".json").name)
        if account is not None and task.target.name in listed:
            tables[account] = listed[task.target.name]
    return {table: read_json(account, ACCOUNT) for account, table in tables.items()}


class _Hour(NamedTuple):
    """An hour to search: its number of rows, and the tables with rows in it or near it."""

    hour: int
    rows: int
    tables: tuple[Path, ...]


def _hours(accounts: Mapping[Path, dict[str, Any]], config: CorpusConfig) -> dict[str, _Hour]:
    """Return the hours to search by key, which has a hash of their messages."""
    rows: Counter[int] = Counter()
    tables: dict[int, list[Path]] = {}
    least = least_rows(config)
    for table, account in accounts.items():
        for name, count in account["hours"].items():
            rows[int(name)] += count
            if count >= least:  # fewer rows are wrong stamps, which would add hours to search
                tables.setdefault(int(name), []).append(table)
    sides = -(-overlap(config) // HOUR_US)
    hours = {}
    # A meeting may begin with the last row of an hour.
    for hour in sorted(rows.keys() & {later - k for later in tables for k in (0, 1)}):
        near = range(hour - sides, hour + sides + 1)
        read = {table for k in near for table in tables.get(k, ())}
        digest = digest_of([_content(k, map(accounts.__getitem__, read)) for k in near])
        hours[f"{hour}-{digest}"] = _Hour(hour, rows[hour], tuple(sorted(read, key=str)))
    return hours


def _content(hour: int, accounts: Iterable[dict[str, Any]]) -> int:
    """Return the sum of the hashes of an hour's messages, whichever ranges have them."""
    return sum(int(account["contents"].get(str(hour), "0"), 16) for account in accounts)


def hour_tasks(
    accounts: Mapping[Path, dict[str, Any]], out: Path, config: CorpusConfig
) -> list[HourTask]:
    """Return tasks of about `task_rows` rows for the hours that are not searched yet."""
    hours = _hours(accounts, config)
    folder = out / "hours"
    existing = {path.stem: path for path in folder.glob("[!.]*")}
    names = {f"{kind}-{key}" for kind in ("hour", "rows") for key in hours}
    for name, path in existing.items():
        if name not in names:
            path.unlink()
    batches: list[list[tuple[int, str, tuple[Path, ...]]]] = []
    room = 0
    for key, (hour, rows, tables) in hours.items():
        if f"hour-{key}" in existing:
            continue
        if not batches or rows > room:
            batches.append([])
            room = config.task_rows
        batches[-1].append((hour, key, tables))
        room -= rows
    return [
        HourTask(f"hours {batch[0][0]} to {batch[-1][0]}", tuple(batch), folder, config)
        for batch in batches
    ]


def group_tasks(out: Path, config: CorpusConfig) -> list[GroupTask]:
    """Return tasks for the partitions of all meetings that are not grouped yet."""
    hours = searched_hours(out)
    columns = _columns([*hours.values()], "start", "end")
    start, end = (np.concatenate(parts) for parts in columns)
    tasks = []
    for begin, last in partitions(start, end):
        near = _between(hours, begin // HOUR_US, (last - 1) // HOUR_US)
        tasks.append(GroupTask(f"partition from {begin}", out, near, begin, last, config))
    return current(tasks, out / "found")


def clean_tasks(out: Path, config: CorpusConfig) -> list[CleanTask]:
    """Return tasks for the encounters that are not cleaned yet."""
    hours = searched_hours(out)
    tables = sorted((out / "found").glob("part-*.parquet"))
    columns = _columns(tables, "earliest", "end")
    tasks = []
    for table, earliest, end in zip(tables, columns[0][1:], columns[1][1:], strict=True):
        for first in range(0, len(end), config.task_encounters):
            rows = slice(first, min(first + config.task_encounters, len(end)))
            first_hour = int(min(earliest[rows])) // HOUR_US - 1
            near = _between(hours, first_hour, int(max(end[rows])) // HOUR_US)
            name = f"{table.stem}, encounters from {first}"
            tasks.append(CleanTask(name, out, table.stem, first, rows.stop, near, config))
    return current(tasks, out / "encounters", "found-*")


def searched_hours(out: Path) -> dict[int, Path]:
    """Return the tables of the hours that are searched, in order."""
    tables = [*(out / "hours").glob("hour-*.parquet")]
    by_hour = {int(table.stem.split("-")[1]): table for table in tables}
    return {hour: by_hour[hour] for hour in sorted(by_hour)}


def _between(hours: Mapping[int, Path], first: int, last: int) -> tuple[str, ...]:
    """Return the keys of the hours from the first to the last."""
    near = [hours[hour] for hour in range(first, last + 1) if hour in hours]
    return tuple(table.stem.partition("-")[2] for table in near)


def _columns(tables: Sequence[Path], *names: str) -> list[list[Ints]]:
    """Return for each column an empty array, and its values (rows,) in each table."""
    from pyarrow import parquet

    read = [parquet.read_table(table, columns=list(names)) for table in tables]
    empty = np.zeros(0, dtype=np.int64)
    return [[empty, *(table[name].to_numpy() for table in read)] for name in names]
