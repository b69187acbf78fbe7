# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The tasks of the later stages of mining, from the results of the earlier ones."""

from bisect import bisect_left, bisect_right
from collections import Counter
from collections.abc import Sequence
from itertools import accumulate

import numpy as np

from scenario_gen.base.documents import COUNT, read_json
from scenario_gen.base.stores import each_fetched, Place
from scenario_gen.corpus.config import CorpusConfig
from scenario_gen.corpus.encounters import CleanTask
from scenario_gen.corpus.grouping import GroupTask, partitions
from scenario_gen.corpus.meetings import HourTask, overlap
from scenario_gen.corpus.messages import HOUR_US, RangeTask
from scenario_gen.corpus.tasks import undone
from scenario_gen.numerics import Ints

ACCOUNT = {  # of a range of text: rows left out by file, and rows by hour
    "type": "object",
    "required": ["files", "hours", "notes"],
    "properties": {
        "files": {
            "type": "object",
            "additionalProperties": {"type": "object", "additionalProperties": COUNT},
        },
        "hours": {
            "type": "object",
            "propertyNames": {"pattern": "^-?[0-9]{1,18}$"},
            "additionalProperties": COUNT,
        },
        "notes": {"type": "array", "items": {"type": "string"}},
    },
}


def least_rows(config: CorpusConfig) -> int:
    """Return the least number of messages of two vehicles in a meeting that is long enough."""
    log = config.log
    seconds = min(log.min_presence, log.min_duration)
    return 2 * (int(seconds / max(log.longest_gap, log.period)) + 1)


def hour_tasks(ranged: Sequence[RangeTask], out: Place, config: CorpusConfig) -> list[HourTask]:
    """Return tasks of about `task_rows` rows for the hours that are not searched yet."""
    rows: Counter[int] = Counter()
    files: dict[int, list[Place]] = {}
    seen: set[int] = set()
    least = least_rows(config)
    accounts = {task.target.with_suffix(".json"): task.target for task in ranged}
    for account, local in each_fetched(list(accounts)):
        for name, count in read_json(local, ACCOUNT)["hours"].items():
            seen.add(int(name))
            if count >= least:  # fewer rows are wrong stamps, which would add hours to search
                rows[int(name)] += count
                files.setdefault(int(name), []).append(accounts[account])

    done = {path.name for path in (out / "hours").glob("hour-*.parquet")}
    wanted = seen & {hour for last in files for hour in (last - 1, last)}
    sides = -(-overlap(config) // HOUR_US)
    batches: list[list[tuple[int, tuple[Place, ...]]]] = []
    room = 0
    for hour in sorted(wanted):  # a meeting may begin with the last row of an hour
        if f"hour-{hour}.parquet" in done:
            continue
        if not batches or rows[hour] > room:
            batches.append([])
            room = config.task_rows
        near: set[Place] = set()
        near.update(*(files.get(k, ()) for k in range(hour - sides, hour + sides + 1)))
        batches[-1].append((hour, tuple(sorted(near, key=str))))
        room -= rows[hour]
    return [
        HourTask(f"hours {batch[0][0]} to {batch[-1][0]}", tuple(batch), out / "hours", config)
        for batch in batches
    ]


def group_tasks(out: Place, config: CorpusConfig) -> list[GroupTask]:
    """Return tasks for the partitions of all meetings that are not grouped yet."""
    hours = searched_hours(out)
    tables = [out / "hours" / f"hour-{hour}.parquet" for hour in hours]
    start, end = (np.concatenate(parts) for parts in _columns(tables, "start", "end"))
    tasks = []
    for k, (begin, last) in enumerate(partitions(start, end)):
        near = _between(hours, begin // HOUR_US, (last - 1) // HOUR_US)
        tasks.append(GroupTask(f"partition {k}", out, k, near, begin, last, config))
    return undone(tasks)


def clean_tasks(out: Place, config: CorpusConfig) -> list[CleanTask]:
    """Return tasks for the encounters that are not cleaned yet."""
    hours = searched_hours(out)
    tables: list[Place] = sorted((out / "found").glob("part-*.parquet"), key=str)
    columns = _columns(tables, "earliest", "end")
    offsets = [0, *accumulate(len(part) for part in columns[0][1:])]
    earliest, end = (np.concatenate(parts) for parts in columns)
    tasks = []
    for first in range(0, offsets[-1], config.task_encounters):
        last = min(first + config.task_encounters, offsets[-1])
        parts = range(bisect_right(offsets, first) - 1, bisect_left(offsets, last))
        rows = [
            (part, max(first - offsets[part], 0), min(last, offsets[part + 1]) - offsets[part])
            for part in parts
        ]
        first_hour = int(min(earliest[first:last])) // HOUR_US - 1
        last_hour = int(max(end[first:last])) // HOUR_US
        tasks.append(
            CleanTask(
                f"encounters from {first}",
                out,
                first // config.task_encounters,
                tuple(span for span in rows if span[1] < span[2]),
                _between(hours, first_hour, last_hour),
                config,
            )
        )
    return undone(tasks)


def searched_hours(out: Place) -> list[int]:
    """Return the hours that are searched, in order."""
    tables = (out / "hours").glob("hour-*[0-9].parquet")
    return sorted(int(path.stem.removeprefix("hour-")) for path in tables)


def _between(hours: list[int], first: int, last: int) -> tuple[int, ...]:
    """Return the hours from the first to the last."""
    return tuple(hours[bisect_left(hours, first) : bisect_right(hours, last)])


def _columns(tables: Sequence[Place], *names: str) -> list[list[Ints]]:
    """Return for each column an empty array, and its values (rows,) in each table."""
    from pyarrow import parquet

    read = [parquet.read_table(local, columns=list(names)) for _, local in each_fetched(tables)]
    empty = np.zeros(0, dtype=np.int64)
    return [[empty, *(table[name].to_numpy() for table in read)] for name in names]
