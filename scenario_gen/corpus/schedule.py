# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The tasks of the later stages of mining, from the results of the earlier ones.

The name of a result has a hash of what it depends on. A result that no task would write is
removed: its files have changed.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

from scenario_gen.base.documents import COUNT, read_json
from scenario_gen.corpus.config import CorpusConfig
from scenario_gen.corpus.encounters import CleanTask
from scenario_gen.corpus.grouping import grouped, MEETING_COLUMNS
from scenario_gen.corpus.meetings import HourTask, overlap
from scenario_gen.corpus.messages import DAY_US, digest_of, HOUR_US, RangeTask
from scenario_gen.corpus.tasks import Target
from scenario_gen.logs import Meeting


def _by_hour(values: dict[str, Any]) -> dict[str, Any]:
    return {
        "type": "object",
        "propertyNames": {"pattern": "^[0-9]{1,18}$"},
        "additionalProperties": values,
    }


_TEXTS = {"type": "object", "additionalProperties": {"type": "string"}}
ACCOUNT = {  # of a range: rows by cause of each file, rows and hashes of hours, damaged files
    "type": "object",
    "required": ["files", "hours", "contents", "other_clocks"],
    "properties": {
        "files": {
            "type": "object",
            "additionalProperties": {"type": "object", "additionalProperties": COUNT},
        },
        "hours": _by_hour(COUNT),
        "contents": _by_hour({"type": "string", "pattern": "^[0-9a-f]+$"}),
        "other_clocks": {"type": "array", "items": {"type": "string"}},
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


def clean_tasks(out: Path, config: CorpusConfig) -> list[CleanTask]:
    """Return tasks for the encounters that are not cleaned yet.

    A task has the encounters of one day, so that further days leave it unchanged.
    """
    hours = searched_hours(out)
    encounters = grouped(meetings_of(out), config.log)
    tasks = []
    for _, day in groupby(encounters, key=lambda entry: entry.start // DAY_US):
        of_day = list(day)
        for k in range(0, len(of_day), config.task_encounters):
            entries = tuple(of_day[k : k + config.task_encounters])
            first = min(entry.earliest for entry in entries) // HOUR_US - 1
            last = max(entry.end for entry in entries) // HOUR_US
            near = [hours[hour] for hour in range(first, last + 1) if hour in hours]
            keys = tuple(table.stem.partition("-")[2] for table in near)
            name = f"{entries[0].start:016}-{k:06}"
            tasks.append(CleanTask(name, out, entries, keys, config))
    return current(tasks, out / "encounters", "found-*")


def meetings_of(out: Path) -> Iterator[Meeting]:
    """Yield the meetings of the hours that are searched, sorted by start."""
    from pyarrow import parquet

    for table in searched_hours(out).values():
        rows = parquet.read_table(table, columns=list(MEETING_COLUMNS)).to_pylist()
        yield from (Meeting(**row) for row in rows)


def searched_hours(out: Path) -> dict[int, Path]:
    """Return the tables of the hours that are searched, in order."""
    tables = [*(out / "hours").glob("hour-*.parquet")]
    by_hour = {int(table.stem.split("-")[1]): table for table in tables}
    return {hour: by_hour[hour] for hour in sorted(by_hour)}
