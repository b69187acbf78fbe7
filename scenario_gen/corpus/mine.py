# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`mine`: an archive -> a corpus of encounters. Stages of tasks, each writing files that the next one reads.

    messages/range-*.parquet    what text said, by hour (`messages.py`)
    hours/hour-*.parquet        which two vehicles meet (`meetings.py`), and beside it their messages
    found/part-*.parquet        who is joined to whom (`grouping.py`)
    encounters/*.parquet        cleaned encounters (`encounters.py`); of logs in other formats, these at once

A file that is there is done, so a run that was killed goes on where it was.
"""

from bisect import bisect_left, bisect_right
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import accumulate, chain
import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from scenario_gen.base.documents import COUNT, read_json
from scenario_gen.base.errors import InputError, needs
from scenario_gen.base.folders import scratch
from scenario_gen.base.parameters import flatten
from scenario_gen.base.stores import (
    below,
    download,
    each_fetched,
    naming_objects,
    Part,
    Place,
    Remote,
    size_of,
    temporary,
)
from scenario_gen.corpus.config import CorpusConfig
from scenario_gen.corpus.encounters import (
    account_of,
    clean_found,
    CleanTask,
    encounter_of,
    LogTask,
    read_one_log,
    tables_of,
)
from scenario_gen.corpus.grouping import group_partition, GroupTask, partitions
from scenario_gen.corpus.meetings import HourTask, overlap, search_hours
from scenario_gen.corpus.messages import HOUR, parse_range, ranges, RangeTask
from scenario_gen.corpus.page import sketch, write_page
from scenario_gen.corpus.tables import rows_at, rows_of
from scenario_gen.corpus.tasks import agree, arriving, check_out, held, spread, undone, Workers
from scenario_gen.logs import is_bag, is_log, is_spmd, is_table, LOG_FORMATS
from scenario_gen.numerics import Ints
from scenario_gen.situation import Situation

ARCHIVE, PAGE = "archive.json", "encounters.html"
ACCOUNT = {  # of a range of text: what was left out, by file; rows by hour
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
HEAD = 16_384  # bytes of an object by which its format is recognised
MOST_DRAWN = 20  # encounters of a kind on the page
LEGEND = "Lines are paths, dots their starts. Space-time gap: smallest distance of two paths, plus 2 m for each second between."
MOST_SHOWN = 20  # failures and files that are named; the corpus holds all


@dataclass(frozen=True)
class Mined:
    """What mining came to.

    Attributes:
        encounters: in the corpus.
        kinds: how many of each kind.
        account: rows left out, by cause.
        files: the same by file, those with anything to say.
        refused: encounters that cleaning did not leave whole: name and reason.
        failed: a sentence for each task that failed.
        notes: what else a person should know.
    """

    encounters: int
    kinds: dict[str, int]
    account: dict[str, int]
    files: dict[str, dict[str, int]]
    refused: list[dict[str, str]]
    failed: list[str]
    notes: list[str]

    def lines(self) -> list[str]:
        """Return the summary for people."""
        kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(self.kinds.items()))
        lines = [f"{self.encounters} encounters: {kinds or 'none'}"]
        lines += [f"{count} {cause}" for cause, count in sorted(self.account.items())]
        for file, causes in list(self.files.items())[:MOST_SHOWN]:
            lines.append(f"{file}: " + ", ".join(f"{n} {cause}" for cause, n in causes.items()))
        lines += [
            f"encounter {one['name']} is left out: {one['why']}"
            for one in self.refused[:MOST_SHOWN]
        ]
        for what, ones in (("files", self.files), ("encounters left out", self.refused)):
            if len(ones) > MOST_SHOWN:
                lines.append(f"… and {len(ones) - MOST_SHOWN} more {what}")
        return [*lines, *self.notes, *self.failed]


def mine(
    archives: Sequence[Place],
    out: Place,
    config: CorpusConfig = CorpusConfig(),
    *,
    workers: Workers = Workers(),
) -> Mined:
    """Find the encounters of an archive.

    Args:
        archives: folders, whose SPMD files at any depth are one archive on one clock, and whose tables and bags are a log each;
            or files and bags. A folder of tables that holds no SPMD file and no other folder is one log, as for `read_log`.
        out: the corpus; an unfinished one of the same archive and parameters is gone on with.
        config: how.
        workers: who does it.

    Raises:
        InputError: there is nothing to read, or `out` is of another archive or other parameters.
    """
    needs("corpus", "duckdb", "pyarrow")
    messages, logs, others = inventory(archives)
    check_out(out, archives)
    with held(out), spread(workers) as go:
        _agree(out, messages, logs, config)
        log_tasks = [
            LogTask(
                paths[0].stem, tuple(paths), out / "encounters" / f"log-{k:05}.parquet", config
            )
            for k, paths in enumerate(logs)
        ]
        failed = go(read_one_log, undone(log_tasks))
        if messages:
            ranged = ranges(messages, out / "messages", config.range_size << 20, config.memory)
            lost = go(parse_range, undone(ranged))
            lost = lost or go(
                search_hours, hour_tasks(ranged, out, config)
            )  # of all ranges, for an hour is done only once
            lost = lost or go(group_partition, group_tasks(out, config))
            failed += lost or go(clean_found, clean_tasks(out, config))
        tables = _encounters(out)
        result = summary(out, config, tables, failed, others)
        with arriving(out / PAGE) as part:
            _write_gallery(part, tables, result)
        return result


@dataclass(frozen=True)
class _Encounters:
    """What the tables of encounters hold.

    Attributes:
        accounts: of each table.
        kinds: encounters of each kind.
        drawn: rows for the page, the first ones of each kind.
    """

    accounts: list[dict[str, Any]]
    kinds: Counter[str]
    drawn: list[dict[str, Any]]


def _encounters(out: Place) -> _Encounters:
    """Return what the tables of encounters hold; each is read once.

    Raises:
        InputError: a table is damaged.
    """
    found = _Encounters([], Counter(), [])
    for path, here in each_fetched(sorted((out / "encounters").glob("*.parquet"), key=str)):
        found.accounts.append(account_of(here, path))
        wanted = []
        for k, row in enumerate(rows_of([here], ["kind"])):
            wanted += [k] if found.kinds[row["kind"]] < MOST_DRAWN else []
            found.kinds[row["kind"]] += 1
        found.drawn.extend(rows_at(here, wanted))
    return found


def _write_gallery(path: Path, tables: _Encounters, made: Mined) -> None:
    """Write a page that shows encounters."""
    cards = []
    for row in tables.drawn:
        encounter = encounter_of(row)
        lines = [
            f"{row['count']} vehicles for {row['seconds']:.1f} s; smallest distance {row['distance']:.1f} m, "
            f"space-time gap {row['gap']:.1f} m",
            "; ".join(
                f"vehicles {pair}: {kind}" for pair, kind in json.loads(row["kinds"]).items()
            ),
            *Situation.of(encounter).reactions.sentences(encounter.vehicles),
        ]
        cards.append(
            {
                "title": f"{row['kind']}: {row['name']}",
                "lines": lines,
                "pictures": [sketch(encounter)],
            }
        )
    first, *rest = made.lines()
    write_page(path, "Encounters mined", f"{first}. {LEGEND}", cards, rest)


Files = tuple[list[Path], list[list[Path]], list[Path]]
Inventory = tuple[list[Place], list[list[Place]], list[Place]]
"""The SPMD files, the other logs, each with its files, and the files that are neither."""


def inventory(archives: Sequence[Place]) -> Inventory:
    """Return what lies in archives.

    Raises:
        InputError: a path does not exist, or nothing in it can be read.
    """
    messages: list[Place] = []
    logs: list[list[Place]] = []
    others: list[Place] = []
    for archive in archives:
        own = _of_objects(archive) if isinstance(archive, Remote) else _of_files(archive)
        messages += own[0]
        logs += [list(one) for one in own[1]]
        others += own[2]
    return messages, logs, others


def _of_objects(archive: Remote) -> Inventory:
    """Return what lies in a store, by the beginnings of its objects, which are copied to files of the same names."""
    single = archive.looked_up()
    objects = [single] if single.size >= 0 else list(archive.rglob("*"))
    if not objects:
        raise InputError(f"{archive} does not exist, or is empty")
    with scratch(temporary()) as place:
        root = place / archive.name
        found = {root if one is single else root / below(one, archive): one for one in objects}
        folders = {
            folder for path in found for folder in path.parents if folder.is_relative_to(root)
        }
        download(Part(one, 0, min(one.size, HEAD), path) for path, one in found.items())
        of_path = {
            folder: archive if folder == root else archive / folder.relative_to(root).as_posix()
            for folder in folders
        }
        of_path |= found
        with naming_objects({str(root): archive.url}):
            messages, logs, others = _of_files(root)
        return (
            [of_path[path] for path in messages],
            [[of_path[path] for path in own] for own in logs],
            [of_path[p] for p in others],
        )


def _of_files(archive: Path) -> Files:
    """Return what lies in a folder, or what a file is."""
    if not archive.exists():
        raise InputError(f"{archive} does not exist")
    if archive.is_file() or is_bag(archive):
        return ([archive], [], []) if is_spmd(archive) else ([], [[archive]], [])
    spmd, rest = _parted(_visible_files(archive), is_spmd)
    bags = {path.parent for path in rest if path.name == "metadata.yaml" and is_bag(path.parent)}
    if bags:
        rest = [path for path in rest if bags.isdisjoint(path.parents)]
    bag_files, rest = _parted(rest, is_bag)
    files, others = _parted(rest, is_log)
    are_tables = all(path.parent == archive and is_table(path) for path in files)
    if files and are_tables and not (spmd or bags or bag_files):
        logs = [files]  # one log in several tables
    else:
        logs = [[path] for path in (*files, *sorted(bags), *bag_files)]
    if not spmd and not logs:
        raise InputError(
            f"{archive} has no log in a known format ({', '.join(LOG_FORMATS.names())})"
        )
    return spmd, logs, others


def _visible_files(folder: Path) -> list[Path]:
    return sorted(
        Path(above, name)
        for above, _, names in os.walk(folder)
        for name in names
        if not name.startswith(".")
    )


def _parted(
    paths: Iterable[Path], chosen: Callable[[Path], bool]
) -> tuple[list[Path], list[Path]]:
    """Return the paths that are chosen, and the others."""
    parts: tuple[list[Path], list[Path]] = ([], [])
    for path in paths:
        parts[not chosen(path)].append(path)
    return parts


def _agree(
    out: Place, messages: Sequence[Place], logs: Sequence[Sequence[Place]], config: CorpusConfig
) -> None:
    """Write down what the corpus is of; or see that it is of the same.

    Raises:
        InputError: it is of something else.
    """
    files = [*messages, *chain.from_iterable(logs)]
    names = [path.url if isinstance(path, Remote) else str(path.resolve()) for path in files]
    sizes = [
        0 if isinstance(path, Path) and path.is_dir() else max(size_of(path), 0) for path in files
    ]
    document = {
        "format": 3,  # of the tables
        "files": [[name, size] for name, size in zip(names, sizes, strict=True)],
        "parameters": {
            name: value
            for name, (_, value) in flatten(config).items()
            if name not in ("memory", "task_rows")
        },
    }
    agree(out, ARCHIVE, document, "corpus")


def hour_tasks(ranged: Sequence[RangeTask], out: Place, config: CorpusConfig) -> list[HourTask]:
    """Put the hours that are not searched into tasks of about `task_rows` rows."""
    rows: Counter[int] = Counter()
    seen: set[int] = set()
    files: dict[int, list[Place]] = {}
    accounts = {task.target.with_suffix(".json"): task.target for task in ranged}
    for account, here in each_fetched(list(accounts)):
        for hour, count in read_json(here, ACCOUNT)["hours"].items():
            seen.add(int(hour))
            if count >= least_rows(
                config
            ):  # else every range is searched for hours that only wrong stamps name
                rows[int(hour)] += count
                files.setdefault(int(hour), []).append(accounts[account])
    tasks: list[list[tuple[int, tuple[Place, ...]]]] = []
    room = 0
    sides = -(-overlap(config) // HOUR)
    done = {path.name for path in (out / "hours").glob("hour-*.parquet")}
    for hour in sorted(
        seen & {hour for own in files for hour in (own - 1, own)}
    ):  # a meeting may begin with an hour's last row
        if f"hour-{hour}.parquet" in done:
            continue
        if not tasks or rows[hour] > room:
            tasks.append([])
            room = config.task_rows
        near = sorted(
            {
                path
                for near in range(hour - sides, hour + sides + 1)
                for path in files.get(near, ())
            },
            key=str,
        )
        tasks[-1].append((hour, tuple(near)))
        room -= rows[hour]
    return [
        HourTask(f"hours {own[0][0]} to {own[-1][0]}", tuple(own), out / "hours", config)
        for own in tasks
    ]


def least_rows(config: CorpusConfig) -> int:
    """Return the fewest messages that a meeting can have: without a gap that is too long, for long enough, of two vehicles."""
    return 2 * (
        int(
            min(config.log.min_presence, config.log.min_duration)
            / max(config.log.longest_gap, config.log.period)
        )
        + 1
    )


def group_tasks(out: Place, config: CorpusConfig) -> list[GroupTask]:
    """Divide all meetings at instants that none of them spans; return the partitions that are not grouped."""
    hours = _hours(out)
    tables = [out / "hours" / f"hour-{hour}.parquet" for hour in hours]
    start, end = (
        np.concatenate([np.zeros(0, dtype=np.int64), *own])
        for own in _columns(tables, "start", "end")
    )
    tasks = [
        GroupTask(
            f"partition {k}",
            out,
            k,
            _between(hours, begin // HOUR, (last - 1) // HOUR),
            begin,
            last,
            config,
        )
        for k, (begin, last) in enumerate(partitions(start, end))
    ]
    return undone(tasks)


def clean_tasks(out: Place, config: CorpusConfig) -> list[CleanTask]:
    """Put those encounters that are not cleaned into tasks."""
    hours = _hours(out)
    tables: list[Place] = sorted((out / "found").glob("part-*.parquet"), key=str)
    columns = _columns(tables, "earliest", "end")
    offsets = [0, *accumulate(map(len, columns[0]))]
    earliest, end = (np.concatenate([np.zeros(0, dtype=np.int64), *own]) for own in columns)
    tasks = []
    for k in range(0, offsets[-1], config.task_encounters):
        last = min(k + config.task_encounters, offsets[-1])
        parts = range(bisect_right(offsets, k) - 1, bisect_left(offsets, last))
        own = [
            (part, max(k - offsets[part], 0), min(last, offsets[part + 1]) - offsets[part])
            for part in parts
        ]
        near = _between(
            hours, int(min(earliest[k:last])) // HOUR - 1, int(max(end[k:last])) // HOUR
        )
        number = k // config.task_encounters
        tasks.append(
            CleanTask(
                f"encounters from {k}",
                out,
                number,
                tuple(one for one in own if one[1] < one[2]),
                near,
                config,
            )
        )
    return undone(tasks)


def _hours(out: Place) -> list[int]:
    """Return the hours that are searched, in order."""
    return sorted(
        int(path.stem.removeprefix("hour-"))
        for path in (out / "hours").glob("hour-*[0-9].parquet")
    )


def _between(hours: list[int], first: int, last: int) -> tuple[int, ...]:
    """Return those of the hours from the first to the last."""
    return tuple(hours[bisect_left(hours, first) : bisect_right(hours, last)])


def _columns(tables: Sequence[Place], *names: str) -> list[list[Ints]]:
    """Return for each column its values (rows,) in each table."""
    from pyarrow import parquet

    read = [parquet.read_table(here, columns=list(names)) for _, here in each_fetched(tables)]
    return [[table[name].to_numpy() for table in read] for name in names]


def summary(
    out: Place,
    config: CorpusConfig,
    tables: _Encounters,
    failed: list[str],
    others: Sequence[Place] = (),
) -> Mined:
    """Return what is in a corpus, by listing it; `others` are files of the archive that were not read."""
    from pyarrow import parquet

    files: dict[str, Counter[str]] = {}
    notes: list[str] = []
    strays, least = 0, least_rows(config)
    accounts_of_text: list[Place] = sorted((out / "messages").glob("*.json"), key=str)
    for _, here in each_fetched(accounts_of_text):
        account = read_json(here, ACCOUNT)
        notes += account["notes"]
        strays += sum(int(count) for count in account["hours"].values() if count < least)
        for file, causes in account["files"].items():
            files.setdefault(file, Counter()).update(causes)
    if others:
        first = ", ".join(path.name for path in others[:5])
        notes.append(
            f"{len(others)} files are of no format that is read (unpack what is compressed): {first}{' …' * (len(others) > 5)}"
        )
    if strays:
        notes.append(
            f"{strays} rows lie in an hour of which their range of text has fewer than {least} (wrong stamps?): not searched"
        )
    shared: Counter[str] = Counter()
    hours: list[Place] = sorted((out / "hours").glob("hour-*[0-9].parquet"), key=str)
    for _, here in each_fetched(hours):
        shared.update(
            json.loads((parquet.read_schema(here).metadata or {}).get(b"shared", b"{}")).keys()
        )
    if shared:
        first = ", ".join(sorted(shared)[:10])
        notes.append(
            f"{len(shared)} ids are shared by several vehicles at once, and separated by place: {first} …"
        )
    total: Counter[str] = Counter()
    for causes in files.values():
        total.update(causes)
    reports = {
        file: {cause: n for cause, n in causes.items() if n and cause != "rows"}
        for file, causes in files.items()
    }
    return Mined(
        encounters=tables.kinds.total(),
        kinds=dict(tables.kinds),
        account={cause: count for cause, count in total.items() if count},
        files={file: causes for file, causes in reports.items() if causes},
        refused=[one for account in tables.accounts for one in account.get("refused", ())],
        failed=failed,
        notes=notes + [line for account in tables.accounts for line in account.get("quality", ())],
    )


__all__ = ["ARCHIVE", "PAGE", "Mined", "inventory", "mine", "tables_of"]
