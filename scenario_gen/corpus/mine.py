# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`mine`: from an archive to a corpus of encounters, in stages of tasks that write files.

    messages/range-*.parquet    messages from text, by hour (`messages.py`)
    hours/hour-*.parquet        meetings of two vehicles (`meetings.py`), and their messages
    found/part-*.parquet        groups of meetings (`grouping.py`)
    encounters/*.parquet        cleaned encounters (`encounters.py`); other logs start here

An existing file is finished, so a killed run continues where it stopped.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from itertools import chain
import json
from pathlib import Path
from typing import Any

from scenario_gen.base.documents import read_json
from scenario_gen.base.errors import needs
from scenario_gen.base.folders import write_text
from scenario_gen.base.parameters import flatten
from scenario_gen.base.stores import each_fetched, Place, Remote, size_of
from scenario_gen.corpus.config import CorpusConfig
from scenario_gen.corpus.encounters import (
    account_of,
    clean_found,
    encounter_of,
    LogTask,
    read_one_log,
    tables_of,
)
from scenario_gen.corpus.grouping import group_partition
from scenario_gen.corpus.inventory import inventory
from scenario_gen.corpus.meetings import search_hours
from scenario_gen.corpus.messages import parse_range, ranges
from scenario_gen.corpus.page import sketch, write_page
from scenario_gen.corpus.schedule import (
    ACCOUNT,
    clean_tasks,
    group_tasks,
    hour_tasks,
    least_rows,
    searched_hours,
)
from scenario_gen.corpus.tables import rows_at, rows_of
from scenario_gen.corpus.tasks import agree, arriving, check_out, held, spread, undone, Workers
from scenario_gen.situation import Situation

ARCHIVE, PAGE, DETAILS = "archive.json", "encounters.html", "mine.json"
LEGEND = (
    "Lines are paths, dots their starts. Space-time gap: smallest distance between two paths,"
    " plus 2 m for each second between."
)
DRAWN_COUNT = 20  # encounters of a kind on the page
NAMED_COUNT = 20  # failures and files that are named; the corpus contains all
NAMED_FILES_COUNT = 5  # files that a note names
UNLISTED = ("memory", "task_rows")  # parameters that do not change results


@dataclass(frozen=True)
class MiningSummary:
    """The result of mining.

    Attributes:
        encounters: number of encounters in the corpus.
        kinds: number of encounters of each kind.
        account: number of rows left out, by cause.
        files: the same by file, without files that have none.
        refused: encounters and logs that are left out: name, cause (a group) and reason.
        failed: a sentence for each task that failed.
        notes: further remarks.
    """

    encounters: int
    kinds: dict[str, int]
    account: dict[str, int]
    files: dict[str, dict[str, int]]
    refused: list[dict[str, str]]
    failed: list[str]
    notes: list[str]

    def lines(self) -> list[str]:
        """Return the summary for people: groups with counts and causes, in at most five lines."""
        lines = [self._first_line()]
        if self.account:
            causes = ", ".join(f"{count} {cause}" for cause, count in sorted(self.account.items()))
            lines.append(f"rows: {causes} (in {len(self.files)} files)")
        if self.refused:
            groups = Counter(row.get("cause", "not usable") for row in self.refused)
            causes = ", ".join(f"{count} × {cause}" for cause, count in groups.most_common())
            first = self.refused[0]
            lines.append(f"left out: {causes}; the first, {first['name']}: {first['why']}")
        if self.notes:
            lines.append(f"notes: {len(self.notes)}; the first: {self.notes[0].strip()}")
        if self.failed:
            lines.append(f"failed tasks: {len(self.failed)}; the first: {self.failed[0]}")
        return lines

    def _first_line(self) -> str:
        kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(self.kinds.items()))
        return f"{self.encounters} encounters: {kinds or 'none'}"

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
    archives: Sequence[Place],
    out: Place,
    config: CorpusConfig = CorpusConfig(),
    *,
    workers: Workers = Workers(),
) -> MiningSummary:
    """Find the encounters in an archive.

    Args:
        archives: files, bags or folders. All SPMD files in a folder, at any depth, are one archive
            on one clock; tables and bags are one log each. A folder with nothing but tables is one
            log, as for `read_log`.
        out: the corpus; an unfinished one from the same archive and parameters is continued.
        config: the parameters.
        workers: run the tasks.

    Raises:
        InputError: there is no log, or `out` has another archive or other parameters.
    """
    needs("corpus", "duckdb", "pyarrow")
    messages, logs, others = inventory(archives)
    check_out(out, archives)
    with held(out), spread(workers) as run:
        _agree_on_archive(out, [*messages, *chain.from_iterable(logs)], config)
        encounters = out / "encounters"
        log_tasks = [
            LogTask(paths[0].stem, tuple(paths), encounters / f"log-{k:05}.parquet", config)
            for k, paths in enumerate(logs)
        ]
        failed = run(read_one_log, undone(log_tasks))
        if messages:
            ranged = ranges(messages, out / "messages", config.range_size << 20, config.memory)
            lost = run(parse_range, undone(ranged))
            # an hour is searched once, so all of its ranges must be there
            lost = lost or run(search_hours, hour_tasks(ranged, out, config))
            lost = lost or run(group_partition, group_tasks(out, config))
            failed += lost or run(clean_found, clean_tasks(out, config))
        contents = _contents(out)
        result = _summary(out, config, contents, failed, others)
        with arriving(out / PAGE) as part:
            _write_gallery(part, contents, result)
        with arriving(out / DETAILS) as part:
            write_text(part, json.dumps(asdict(result), indent=1) + "\n")
        return result


@dataclass(frozen=True)
class _Contents:
    """The contents of the tables of encounters.

    Attributes:
        accounts: of each table.
        kinds: number of encounters of each kind.
        drawn: rows for the page, the first ones of each kind.
    """

    accounts: list[dict[str, Any]] = field(default_factory=list)
    kinds: Counter[str] = field(default_factory=Counter)
    drawn: list[dict[str, Any]] = field(default_factory=list)


def _contents(out: Place) -> _Contents:
    """Return the contents of the tables of encounters; each is read once.

    Raises:
        InputError: a table is damaged.
    """
    contents = _Contents()
    for path, local in each_fetched(sorted((out / "encounters").glob("*.parquet"), key=str)):
        contents.accounts.append(account_of(local, path))
        drawn = []
        for k, row in enumerate(rows_of([local], ["kind"])):
            if contents.kinds[row["kind"]] < DRAWN_COUNT:
                drawn.append(k)
            contents.kinds[row["kind"]] += 1
        contents.drawn.extend(rows_at(local, drawn))
    return contents


def _write_gallery(path: Path, contents: _Contents, result: MiningSummary) -> None:
    """Write a page with pictures of encounters."""
    cards = []
    for row in contents.drawn:
        encounter = encounter_of(row)
        kinds = json.loads(row["kinds"]).items()
        lines = [
            f"{row['count']} vehicles for {row['seconds']:.1f} s; smallest distance"
            f" {row['distance']:.1f} m, space-time gap {row['gap']:.1f} m",
            "; ".join(f"vehicles {pair}: {kind}" for pair, kind in kinds),
            *Situation.of(encounter).reactions.sentences(encounter.vehicles),
        ]
        title = f"{row['kind']}: {row['name']}"
        cards.append({"title": title, "lines": lines, "pictures": [sketch(encounter)]})
    first, *rest = result.details()
    write_page(path, "Encounters mined", f"{first}. {LEGEND}", cards, rest)


def _agree_on_archive(out: Place, files: Sequence[Place], config: CorpusConfig) -> None:
    """Write down the archive and the parameters of a corpus, or compare them with those written.

    Raises:
        InputError: they are others.
    """
    parameters = {name: value for name, (_, value) in flatten(config).items()}
    document = {
        "format": 3,
        "files": [_name_and_size(path) for path in files],
        "parameters": {n: value for n, value in parameters.items() if n not in UNLISTED},
    }
    agree(out, ARCHIVE, document, "corpus")


def _name_and_size(path: Place) -> list[str | int]:
    if isinstance(path, Remote):
        return [path.url, max(size_of(path), 0)]
    return [str(path.resolve()), 0 if path.is_dir() else size_of(path)]


def _summary(
    out: Place,
    config: CorpusConfig,
    contents: _Contents,
    failed: list[str],
    others: Sequence[Place],
) -> MiningSummary:
    """Return the summary of a corpus; `others` are files of the archive in no known format."""
    least = least_rows(config)
    files: dict[str, Counter[str]] = {}
    notes: list[str] = []
    strays = 0
    paths: list[Place] = sorted((out / "messages").glob("*.json"), key=str)
    for _, local in each_fetched(paths):
        account = read_json(local, ACCOUNT)
        notes += account["notes"]
        strays += sum(int(count) for count in account["hours"].values() if count < least)
        for file, causes in account["files"].items():
            files.setdefault(file, Counter()).update(causes)
    total = sum(files.values(), Counter[str]())
    faults = {file: dict(+causes) for file, causes in files.items()}
    for causes_of_file in faults.values():
        causes_of_file.pop("rows", None)
    refused = chain.from_iterable(account.get("refused", ()) for account in contents.accounts)
    quality = chain.from_iterable(account.get("quality", ()) for account in contents.accounts)
    return MiningSummary(
        encounters=contents.kinds.total(),
        kinds=dict(contents.kinds),
        account=dict(+total),
        files={file: causes for file, causes in faults.items() if causes},
        refused=list(refused),
        failed=failed,
        notes=[*notes, *_notes(others, strays, least), *_shared_ids(out), *quality],
    )


def _notes(others: Sequence[Place], strays: int, least: int) -> list[str]:
    """Return notes on files and rows that were not read."""
    notes = []
    if others:
        names = ", ".join(path.name for path in others[:NAMED_FILES_COUNT])
        more = " …" if len(others) > NAMED_FILES_COUNT else ""
        notes.append(
            f"{len(others)} files are in no known format (unpack compressed ones): {names}{more}"
        )
    if strays:
        notes.append(
            f"{strays} rows lie in an hour of which their range of text has fewer than {least}"
            " (wrong stamps?): not searched"
        )
    return notes


def _shared_ids(out: Place) -> list[str]:
    """Return a note if several vehicles share an id."""
    from pyarrow import parquet

    shared: set[str] = set()
    tables = [out / "hours" / f"hour-{hour}.parquet" for hour in searched_hours(out)]
    for _, local in each_fetched(tables):
        metadata = parquet.read_schema(local).metadata or {}
        shared.update(json.loads(metadata.get(b"shared", b"{}")))
    if not shared:
        return []
    names = ", ".join(sorted(shared)[:10])
    return [
        f"{len(shared)} ids are shared by several vehicles at once, and separated by place:"
        f" {names} …"
    ]


__all__ = ["ARCHIVE", "DETAILS", "PAGE", "MiningSummary", "mine", "tables_of"]
