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
import shutil
from typing import Any

from scenario_gen.corpus.config import CorpusConfig
from scenario_gen.corpus.encounters import CleanTask
from scenario_gen.corpus.grouping import grouped, MEETING_COLUMNS
from scenario_gen.corpus.meetings import HourTask, MEETINGS, overlap
from scenario_gen.corpus.messages import DAY_US, digest_of, HOUR_US, RangeTask
from scenario_gen.corpus.tables import rows_of
from scenario_gen.corpus.tasks import Target
from scenario_gen.logs import Meeting

Accounts = Mapping[Path, Sequence[Mapping[str, Any]]]
"""The rows of the account of each table of messages."""


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
        if path.stem in wanted:
            continue
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()
    names = {path.name for path in existing}
    return [task for task in tasks if task.target.name not in names]


def accounts_of(ranged: Iterable[RangeTask]) -> Accounts:
    """Return the accounts of the ranges that are parsed."""
    parsed = [task.target for task in ranged if task.target.exists()]
    return {table: list(rows_of([table.with_suffix(".account")])) for table in parsed}


def rows_by_hour(accounts: Accounts) -> Counter[tuple[int, Path]]:
    """Return the rows of each hour in each table of messages, from the rows of their accounts."""
    rows: Counter[tuple[int, Path]] = Counter()
    for table, account in accounts.items():
        for row in account:
            if row["hour"] is not None:
                rows[row["hour"], table] += row["rows"]
    return rows


def hour_tasks(accounts: Accounts, out: Path, config: CorpusConfig) -> list[HourTask]:
    """Return a task for each hour with enough messages.

    Args:
        accounts: of the ranges.
        out: the corpus.
        config: the parameters.
    """
    rows = rows_by_hour(accounts)
    tables: dict[int, set[Path]] = {}
    least = least_rows(config)
    for (hour, table), count in rows.items():
        if count >= least:  # fewer rows are wrong stamps, which would add hours to search
            tables.setdefault(hour, set()).add(table)
    sides = -(-overlap(config) // HOUR_US)
    tasks = []
    # A meeting may begin with the last row of an hour.
    for hour in sorted(
        {hour for hour, _ in rows} & {later - k for later in tables for k in (0, 1)}
    ):
        near = (tables.get(k, ()) for k in range(hour - sides, hour + sides + 1))
        read = sorted(set().union(*near))
        key = f"{hour}-{digest_of([table.stem for table in read])}"
        tasks.append(HourTask(hour, tuple(read), out / "hours" / key, config))
    return tasks


def clean_tasks(hours: Sequence[HourTask], out: Path, config: CorpusConfig) -> list[CleanTask]:
    """Return tasks for the encounters of the hours that are searched.

    A task has the encounters of one day, so that further days leave it unchanged.
    """
    searched = {hour.hour: hour.target for hour in hours if hour.target.exists()}
    encounters = grouped(meetings_of(searched.values()), config.log)
    tasks = []
    for _, day in groupby(encounters, key=lambda entry: entry.start // DAY_US):
        of_day = list(day)
        for k in range(0, len(of_day), config.task_encounters):
            entries = tuple(of_day[k : k + config.task_encounters])
            first = min(entry.earliest for entry in entries) // HOUR_US - 1
            last = max(entry.end for entry in entries) // HOUR_US
            near = tuple(searched[hour] for hour in range(first, last + 1) if hour in searched)
            name = f"{entries[0].start:016}-{k:06}"
            tasks.append(CleanTask(name, out, entries, near, config))
    return tasks


def meetings_of(hours: Iterable[Path]) -> Iterator[Meeting]:
    """Yield the meetings of the hours that are searched, sorted by start."""
    tables = [hour / MEETINGS for hour in hours]
    return (Meeting(**row) for row in rows_of(tables, MEETING_COLUMNS))
