# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`mine`: from an archive to a corpus of encounters, in stages of tasks that write files.

    messages/range-*.parquet    messages from text, by hour (`messages.py`)
    hours/hour-*.parquet        meetings of two vehicles (`meetings.py`), and their messages
    encounters/*.parquet        groups of meetings (`grouping.py`), cleaned (`encounters.py`);
                                other logs start here

An existing file is finished, so a killed run continues where it stopped. Its name depends on its
inputs, so a changed file costs what depends on it. An unreadable file is named and left out.
"""

from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import chain
import json
from pathlib import Path
import re
from typing import Any

from scenario_gen.base.documents import read_json
from scenario_gen.base.errors import needs, RefusedError
from scenario_gen.base.folders import write_text
from scenario_gen.base.parameters import flatten
from scenario_gen.corpus.config import CorpusConfig
from scenario_gen.corpus.encounters import (
    account_of,
    clean_found,
    encounter_of,
    LogTask,
    read_one_log,
    tables_of,
    UNREAD_LOGS,
)
from scenario_gen.corpus.inventory import inventory
from scenario_gen.corpus.meetings import search_hours
from scenario_gen.corpus.messages import digest_of, identity_of, parse_range, ranges, RangeTask
from scenario_gen.corpus.page import PAGE_COLUMNS, sketch, write_page
from scenario_gen.corpus.schedule import (
    ACCOUNT,
    accounts_of,
    clean_tasks,
    current,
    hour_tasks,
    least_rows,
    searched_hours,
)
from scenario_gen.corpus.tables import rows_at, rows_of
from scenario_gen.corpus.tasks import agree, arriving, check_out, held, spread, Task, Workers

ARCHIVE, PAGE, DETAILS = "archive.json", "encounters.html", "mine.json"
LEGEND = (
    "PET: time between the two vehicles in the conflict area; TTC: smallest time to collision;"
    " distance: smallest one. Pictures show the paths, and the vehicles where they are nearest."
)
DRAWN_COUNT = 10  # encounters of a kind of which the page has pictures
LISTED_COUNT = 2000  # encounters in the table of the page
NAMED_COUNT = 20  # failures and files that are named; the corpus contains all
NAMED_FILES_COUNT = 5  # files that a note names
DAMAGED = "damaged"
LEFT_OUT = "left out"  # begins the causes of rows that are not used
UNREAD = (DAMAGED, *UNREAD_LOGS)
MAX_REJECTED_SHARE = 0.1  # of the rows of a file; one with more is damaged
UNLISTED = ("memory", "task_rows")  # parameters that do not change results


@dataclass(frozen=True)
class MiningSummary:
    """The result of mining.

    Attributes:
        encounters: number of encounters in the corpus.
        kinds: number of encounters of each kind.
        read: number of tables and logs that were read, and of all.
        account: number of rows left out, by cause.
        files: the same by file, without files that have none.
        refused: encounters and logs that are left out: name, cause (a group) and reason.
        failed: a sentence for each task that failed.
        notes: further remarks.
    """

    encounters: int
    kinds: dict[str, int]
    read: tuple[int, int]
    account: dict[str, int]
    files: dict[str, dict[str, int]]
    refused: list[dict[str, str]]
    failed: list[str]
    notes: list[str]

    def lines(self) -> list[str]:
        """Return the summary for people: each cause once, with its number; damaged files first."""
        lines = [self._first_line()]
        if self.account:
            causes = ", ".join(f"{count} {cause}" for cause, count in sorted(self.account.items()))
            lines.append(f"rows: {causes} (in {len(self.files)} files)")
        groups: dict[str, list[dict[str, str]]] = {}
        for row in self.refused:
            groups.setdefault(row.get("cause", "not usable"), []).append(row)
        for cause, rows in groups.items():
            named = _named([row["name"] for row in rows], "")
            lines.append(f"{cause}: {named}; the first: {rows[0]['why']}")
        if self.notes:
            lines.append(f"notes: {len(self.notes)}; the first: {self.notes[0].strip()}")
        if self.failed:
            lines.append(f"failed tasks: {len(self.failed)}; the first: {self.failed[0]}")
        return lines

    def _first_line(self) -> str:
        kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(self.kinds.items()))
        return f"{self.encounters} encounters: {kinds or 'none'}; {self._share_read()}"

    def _share_read(self) -> str:
        files = f"read: {self.read[0]} of {self.read[1]} files"
        if not self.account:
            return files
        left_out = sum(n for cause, n in self.account.items() if cause.startswith(LEFT_OUT))
        return f"{files}, {1.0 - left_out / self.account['rows']:.2%} of the rows"

    def details(self) -> list[str]:
        """Return the summary with all causes and notes, for the page."""
        lines = [self._first_line()]
        lines += [f"{count} {cause}" for cause, count in sorted(self.account.items())]
        for file, causes in list(self.files.items())[:NAMED_COUNT]:
            lines.append(f"{file}: " + ", ".join(f"{n} {cause}" for cause, n in causes.items()))
        for row in self.refused[:NAMED_COUNT]:
            lines.append(f"encounter {row['name']} is left out: {row['why']}")
        for name, count in (
            ("files", len(self.files)),
            ("encounters left out", len(self.refused)),
        ):
            if count > NAMED_COUNT:
                lines.append(f"… and {count - NAMED_COUNT} more {name}")
        return [*lines, *self.notes, *self.failed]


def mine(
    archives: Sequence[Path],
    out: Path,
    config: CorpusConfig = CorpusConfig(),
    *,
    workers: Workers = Workers(),
    strict: bool = False,
) -> MiningSummary:
    """Find the encounters in an archive.

    Args:
        archives: files, bags or folders. All tables of messages in a folder, at any depth, are one
            archive on one clock; other tables and bags are one log each. A folder with nothing but
            such tables is one log, as for `read_log`.
        out: the corpus. An existing one with the same parameters is continued; only files that are
            new or have changed are read.
        config: the parameters.
        workers: run the tasks.
        strict: stop where a file cannot be read, or a task fails, instead of leaving it out.

    Raises:
        InputError: there is no log, or `out` has other parameters.
        RefusedError: with `strict`, something is left out.
    """
    needs("corpus", "duckdb", "pyarrow")
    messages, logs, others, unreadable = inventory(archives, config.log.columns)
    check_out(out, archives)
    with held(out), spread(workers) as run:
        agree(out, ARCHIVE, {"format": 5, "parameters": _parameters(config)}, "corpus")
        log_tasks = [_log_task(paths, out / "encounters", config) for paths in logs]
        ranged = ranges(messages, out / "messages", config.range_size << 20, config.memory)
        stale = _stale_files(ranged, out)
        done: Counter[str] = Counter()
        failed: list[str] = []

        def work(name: str, function: Callable[[Task], None], tasks: Sequence[Task]) -> None:
            done[name] += len(tasks)
            failed.extend(run(function, tasks))
            if strict and failed:
                raise RefusedError(f"{failed[0]}; without --strict it is left out")

        work("logs", read_one_log, current(log_tasks, out / "encounters", "log-*"))
        work("ranges", parse_range, current(ranged, out / "messages"))
        accounts = accounts_of(ranged, out)
        work("parts of hours", search_hours, hour_tasks(accounts, out, config))
        work("tables of encounters", clean_found, clean_tasks(out, config))
        contents = _contents(out)
        notes = _notes(others, stale, done, accounts.values(), least_rows(config))
        notes += _shared_ids(out)
        n_files = len(messages) + len(logs) + len(unreadable)
        result = _summary(contents, accounts.values(), unreadable, failed, notes, n_files)
        if strict and result.read[0] < n_files:
            raise RefusedError(f"{result.refused[0]['why']}; without --strict it is left out")
        with arriving(out / PAGE) as part:
            _write_page(part, contents, result)
        with arriving(out / DETAILS) as part:
            write_text(part, json.dumps(asdict(result), indent=1) + "\n")
        return result


@dataclass(frozen=True)
class _Contents:
    """The contents of the tables of encounters.

    Attributes:
        accounts: of each table.
        kinds: number of encounters of each kind.
        listed: rows of the table on the page, the first ones.
        drawn: rows with tracks, the first ones of each kind.
    """

    accounts: list[dict[str, Any]] = field(default_factory=list)
    kinds: Counter[str] = field(default_factory=Counter)
    listed: list[dict[str, Any]] = field(default_factory=list)
    drawn: list[dict[str, Any]] = field(default_factory=list)


def _contents(out: Path) -> _Contents:
    """Return the contents of the tables of encounters; each is read once.

    Raises:
        InputError: a table is damaged.
    """
    contents = _Contents()
    for table in sorted((out / "encounters").glob("*.parquet")):
        contents.accounts.append(account_of(table))
        drawn = []
        for k, row in enumerate(rows_of([table], PAGE_COLUMNS)):
            if len(contents.listed) < LISTED_COUNT:
                contents.listed.append(row)
            if contents.kinds[row["kind"]] < DRAWN_COUNT:
                drawn.append(k)
            contents.kinds[row["kind"]] += 1
        contents.drawn.extend(rows_at(table, drawn))
    return contents


def _write_page(path: Path, contents: _Contents, result: MiningSummary) -> None:
    """Write a page with a table of encounters, and pictures of some of each kind."""
    cards = defaultdict(list)
    for row in contents.drawn:
        kinds = json.loads(row["kinds"]).items()
        lines = [
            f"{row['count']} vehicles for {row['seconds']:.1f} s; smallest distance"
            f" {row['distance']:.1f} m",
            "; ".join(f"vehicles {pair}: {kind}" for pair, kind in kinds),
            *json.loads(row["reactions"])["sentences"],
        ]
        card = {"name": row["name"], "lines": lines, "picture": sketch(encounter_of(row))}
        cards[row["kind"]].append(card)
    rows = [
        row | {"reactions": json.loads(row["reactions"])["sentences"]} for row in contents.listed
    ]
    first, *rest = result.details()
    if (more := result.encounters - len(rows)) > 0:
        rest = [f"{more:,} more encounters are not listed here; `find` lists all", *rest]
    write_page(path, f"{first}. {LEGEND}", rows, cards, rest)


def _parameters(config: CorpusConfig) -> dict[str, Any]:
    """Return the parameters on which results depend."""
    parameters = {name: value for name, (_, value) in flatten(config).items()}
    return {name: value for name, value in parameters.items() if name not in UNLISTED}


def _log_task(paths: list[Path], folder: Path, config: CorpusConfig) -> LogTask:
    """Return the task of a log; its table is named after the identity of its files."""
    files: list[Path] = []
    for path in paths:
        inside = sorted(path.rglob("*")) if path.is_dir() else [path]
        files += [file for file in inside if file.is_file()]
    name = re.sub(r"\W+", "_", paths[0].stem)[:40]
    target = folder / f"log-{name}-{digest_of([identity_of(file) for file in files])}.parquet"
    return LogTask(paths[0].stem, tuple(paths), target, config)


def _stale_files(ranged: Sequence[RangeTask], out: Path) -> list[str]:
    """Return the files of an earlier run that have changed or are gone."""
    wanted = {task.target.stem for task in ranged}
    accounts = (out / "messages").glob("range-*.json")
    stale = [path for path in accounts if path.stem not in wanted]
    names = (read_json(path, ACCOUNT)["files"] for path in stale)
    return sorted(set(chain.from_iterable(names)))


def _summary(
    contents: _Contents,
    accounts: Collection[Mapping[str, Any]],
    unreadable: Mapping[str, str],
    failed: list[str],
    notes: list[str],
    n_files: int,
) -> MiningSummary:
    """Return the summary of a corpus.

    Args:
        contents: the encounters.
        accounts: of the ranges.
        unreadable: entries of the archive that are no files, and why.
        failed: a sentence for each failed task.
        notes: on the archive.
        n_files: number of tables of messages, of logs, and of unreadable entries.
    """
    files: dict[str, Counter[str]] = {}
    damaged: dict[str, str] = {}
    for account in accounts:
        damaged |= account.get("damaged", {})
        for file, causes in account["files"].items():
            files.setdefault(file, Counter()).update(causes)
    total = sum(files.values(), Counter[str]())
    for file, causes in files.items():
        rejected = Counter({c: count for c, count in causes.items() if c.startswith(LEFT_OUT)})
        if rejected.total() > MAX_REJECTED_SHARE * causes["rows"]:
            share = f"{rejected.total()} of {causes['rows']} rows"
            damaged.setdefault(file, f"{file}: {share} {rejected.most_common(1)[0][0]}")
    faults = {file: dict(+causes) for file, causes in files.items()}
    for causes_of_file in faults.values():
        causes_of_file.pop("rows", None)
    refused = [
        *({"name": name, "cause": UNREAD_LOGS[1], "why": why} for name, why in unreadable.items()),
        *({"name": name, "cause": DAMAGED, "why": why} for name, why in sorted(damaged.items())),
        *chain.from_iterable(account.get("refused", ()) for account in contents.accounts),
    ]
    refused.sort(key=lambda row: row.get("cause") not in UNREAD)
    n_unread = len(failed) + sum(row.get("cause") in UNREAD for row in refused)
    quality = chain.from_iterable(account.get("quality", ()) for account in contents.accounts)
    return MiningSummary(
        encounters=contents.kinds.total(),
        kinds=dict(contents.kinds),
        read=(n_files - n_unread, n_files),
        account=dict(+total),
        files={file: causes for file, causes in faults.items() if causes},
        refused=refused,
        failed=failed,
        notes=[*notes, *quality],
    )


def _notes(
    others: Sequence[Path],
    stale: Sequence[str],
    done: Mapping[str, int],
    accounts: Collection[Mapping[str, Any]],
    least: int,
) -> list[str]:
    """Return notes on files and rows that were not read, and on what was done again.

    Args:
        others: files of the archive in no known format.
        stale: files that have changed since the last run.
        done: number of tasks of each stage in this run.
        accounts: of the ranges.
        least: number of rows in an hour, below which they are not searched.
    """
    notes = []
    if stale:
        tasks = ", ".join(f"{count} {name}" for name, count in done.items())
        notes.append(
            f"{_named(stale)} changed or are gone since the last run; done again, with what"
            f" depends on them: {tasks}"
        )
    if others:
        notes.append(
            f"{_named([path.name for path in others])} are in no known format (unpack"
            " compressed ones)"
        )
    clocks = sorted(chain.from_iterable(account["other_clocks"] for account in accounts))
    if clocks:
        notes.append(
            f"{_named(clocks)}: DSecond disagrees with Gentime in most rows, and is ignored"
        )
    hours = chain.from_iterable(account["hours"].values() for account in accounts)
    strays = sum(count for count in hours if count < least)
    if strays:
        notes.append(
            f"{strays} rows lie in an hour of which their range of text has fewer than {least}"
            " (wrong stamps?): not searched"
        )
    return notes


def _named(names: Sequence[str], noun: str = " files") -> str:
    """Return a number with its noun, and the first names."""
    first = ", ".join(names[:NAMED_FILES_COUNT])
    return f"{len(names)}{noun} ({first}{' …' if len(names) > NAMED_FILES_COUNT else ''})"


def _shared_ids(out: Path) -> list[str]:
    """Return a note if several vehicles share an id."""
    from pyarrow import parquet

    shared: set[str] = set()
    for table in searched_hours(out).values():
        metadata = parquet.read_schema(table).metadata or {}
        shared.update(json.loads(metadata.get(b"shared", b"{}")))
    if not shared:
        return []
    names = ", ".join(sorted(shared)[:10])
    return [
        f"{len(shared)} ids are shared by several vehicles at once, and separated by place:"
        f" {names} …"
    ]


__all__ = ["ARCHIVE", "DETAILS", "PAGE", "MiningSummary", "mine", "tables_of"]
