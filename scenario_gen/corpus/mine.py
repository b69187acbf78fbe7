# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`mine`: from an archive to a corpus of encounters, in stages of tasks that write files.

    messages/range-*            messages from text, by hour, and their account (`messages.py`)
    hours/HOUR-*/               meetings of two vehicles (`meetings.py`), and their messages
    encounters/*.parquet        groups of meetings (`grouping.py`), cleaned (`encounters.py`);
                                other logs start here

An existing file is finished, so a killed run continues where it stopped. Its name depends on its
inputs, so a changed file costs what depends on it. An unreadable file is named and left out.
"""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from datetime import timedelta
from itertools import chain
import json
from pathlib import Path
import re
from typing import Any

from scenario_gen.base.errors import needs, RefusedError
from scenario_gen.base.folders import write_text
from scenario_gen.base.parameters import values_of
from scenario_gen.corpus.config import CorpusConfig
from scenario_gen.corpus.encounters import (
    account_of,
    clean_found,
    encounter_of,
    LogTask,
    QUALITY,
    read_one_log,
    tables_of,
    UNREAD_LOGS,
)
from scenario_gen.corpus.grouping import EPOCH
from scenario_gen.corpus.inventory import inventory
from scenario_gen.corpus.meetings import HourTask, MEETINGS, search_hour
from scenario_gen.corpus.messages import (
    DAMAGED,
    digest_of,
    identity_of,
    OTHER_CLOCK,
    parse_range,
    ranges,
)
from scenario_gen.corpus.page import PAGE_COLUMNS, sketch, write_page
from scenario_gen.corpus.schedule import (
    Accounts,
    accounts_of,
    clean_tasks,
    current,
    hour_tasks,
    least_rows,
    rows_by_hour,
)
from scenario_gen.corpus.tables import rows_of
from scenario_gen.corpus.tasks import agree, arriving, check_out, held, spread, Task, Workers

ARCHIVE, PAGE, DETAILS = "archive.json", "encounters.html", "mine.json"
LEGEND = (
    "PET: time between the two vehicles in the conflict area; TTC: smallest time to collision;"
    " distance: smallest one. Pictures show the paths, and the vehicles where they are nearest."
)
DRAWN_COUNT = 10  # encounters of a kind of which the page has pictures
LISTED_COUNT = 2000  # encounters in the table of the page
NAMED_COUNT = 20  # files and findings of a kind that the page names
NAMED_FILES_COUNT = 5  # that a line names
LEFT_OUT = "left out"  # begins the causes of rows that are not used
OTHERS = "files that are no logs"
SPARSE = "hours that are not searched (few rows, wrong stamps?)"
SHARED = "ids that several vehicles share"
UNREAD = (DAMAGED, *UNREAD_LOGS)
LAST = (OTHERS, OTHER_CLOCK, SPARSE, SHARED, QUALITY)  # findings below all others
MAX_REJECTED_SHARE = 0.1  # of the rows of a file; one with more is damaged

Note = tuple[str, str, str]
"""Kind of a finding, name (a file, log, encounter or id), sentence."""


@dataclass(frozen=True)
class Finding:
    """What else is to be said about an archive, by kind.

    Attributes:
        kind: of the finding.
        count: number of entries.
        entries: a sentence for each file, log, encounter or id.
    """

    kind: str
    count: int
    entries: dict[str, str]

    def __str__(self) -> str:
        names = ", ".join(list(self.entries)[:NAMED_FILES_COUNT])
        more = " …" if self.count > NAMED_FILES_COUNT else ""
        first = next(iter(self.entries.values())).strip().partition("\n")[0]
        return f"{self.kind}: {self.count} ({names}{more}); {first}"


@dataclass(frozen=True)
class MiningSummary:
    """The result of mining.

    Attributes:
        encounters: number of encounters in the corpus.
        kinds: number of encounters of each kind.
        read: number of tables and logs that were read, and of all.
        account: number of rows, and of those that are left out or doubtful, by cause.
        files: the same by file, without files that have none.
        findings: damaged and unread files first.
        failed: a sentence for each task that failed.
    """

    encounters: int
    kinds: dict[str, int]
    read: tuple[int, int]
    account: dict[str, int]
    files: dict[str, dict[str, int]]
    findings: list[Finding]
    failed: list[str]

    def lines(self) -> list[str]:
        """Return the summary for people: each kind of finding once, the worst first."""
        kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(self.kinds.items()))
        read = f"read: {self.read[0]} of {self.read[1]} files"
        rows = []
        if self.account:
            causes = dict(self.account)
            total = causes.pop("rows")
            left_out = sum(n for cause, n in causes.items() if cause.startswith(LEFT_OUT))
            read += f", {1.0 - left_out / max(total, 1):.2%} of the rows"
            counts = (f"{count} {cause}" for cause, count in sorted(causes.items()))
            rows.append(f"{total} rows: {', '.join(counts) or 'all sound'}")
        failed = [f"failed tasks: {len(self.failed)}; {self.failed[0]}"] if self.failed else []
        first = f"{self.encounters} encounters: {kinds or 'none'}; {read}"
        return [first, *failed, *map(str, self.findings), *rows]

    def details(self) -> Iterator[str]:
        """Yield the first files and findings of each kind, for the page."""
        yield from self.failed[:NAMED_COUNT]
        for finding in self.findings:
            for name, sentence in list(finding.entries.items())[:NAMED_COUNT]:
                yield f"{finding.kind}: {name}: {sentence}"
        for file, causes in list(self.files.items())[:NAMED_COUNT]:
            yield f"{file}: " + ", ".join(f"{n} {cause}" for cause, n in causes.items())


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
        agree(out, ARCHIVE, {"format": 6, "parameters": _parameters(config)}, "corpus")
        log_tasks = [_log_task(paths, out / "encounters", config) for paths in logs]
        ranged = ranges(messages, out / "messages", config.range_size << 20, config.memory)
        failed: list[str] = []

        def work(function: Callable[[Task], None], tasks: Sequence[Task]) -> None:
            failed.extend(run(function, tasks))
            if strict and failed:
                raise RefusedError(f"{failed[0]}; without --strict it is left out")

        work(read_one_log, current(log_tasks, out / "encounters", "log-*"))
        work(parse_range, current(ranged, out / "messages"))
        accounts = accounts_of(ranged)
        hours = hour_tasks(accounts, out, config)
        work(search_hour, current(hours, out / "hours"))
        cleaning = clean_tasks(hours, out, config)
        work(clean_found, current(cleaning, out / "encounters", "found-*"))
        contents = _contents(out)
        notes = [*contents.notes]
        notes += [(UNREAD_LOGS[1], name, why) for name, why in unreadable.items()]
        files, faults = _by_file(chain.from_iterable(accounts.values()))
        notes += faults
        unread = [note for note in notes if note[0] in UNREAD]
        n_files = len(messages) + len(logs) + len(unreadable)
        notes += [(OTHERS, path.name, "unpack compressed ones") for path in others]
        notes += _sparse_hours(accounts, least_rows(config))
        notes += _shared_ids(hours)
        result = MiningSummary(
            encounters=contents.kinds.total(),
            kinds=dict(contents.kinds),
            read=(n_files - len(failed) - len(unread), n_files),
            account=dict(+sum(files.values(), Counter[str]())),
            files={file: dict(causes) for file, causes in files.items() if len(causes) > 1},
            findings=_findings(notes),
            failed=failed,
        )
        if strict and unread:
            why = next(iter(result.findings[0].entries.values()))
            raise RefusedError(f"{why}; without --strict it is left out")
        with arriving(out / PAGE) as part:
            _write_page(part, contents, result)
        with arriving(out / DETAILS) as part:
            write_text(part, json.dumps(asdict(result), indent=1) + "\n")
        return result


@dataclass(frozen=True)
class _Contents:
    """The contents of the tables of encounters.

    Attributes:
        notes: of each table.
        kinds: number of encounters of each kind.
        listed: rows of the table on the page, the first ones.
        drawn: rows with tracks, the first ones of each kind.
    """

    notes: list[Note] = field(default_factory=list)
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
        notes = ((note["cause"], note["name"], note["why"]) for note in account_of(table))
        contents.notes.extend(notes)
        rows = list(rows_of([table], PAGE_COLUMNS))
        contents.listed.extend(rows[: LISTED_COUNT - len(contents.listed)])
        drawn = set()
        for row in rows:
            contents.kinds[row["kind"]] += 1
            if contents.kinds[row["kind"]] <= DRAWN_COUNT:
                drawn.add(row["name"])
        if drawn:
            contents.drawn.extend(row for row in rows_of([table]) if row["name"] in drawn)
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
    first, *rest = [*result.lines(), *result.details()]
    if (more := result.encounters - len(rows)) > 0:
        rest = [f"{more:,} more encounters are not listed here; `find` lists all", *rest]
    write_page(path, f"{first}. {LEGEND}", rows, cards, rest)


def _parameters(config: CorpusConfig) -> dict[str, Any]:
    """Return the parameters on which results depend."""
    return {name: value for name, value in values_of(config).items() if name != "memory"}


def _log_task(paths: list[Path], folder: Path, config: CorpusConfig) -> LogTask:
    """Return the task of a log; its table is named after the identity of its files."""
    files: list[Path] = []
    for path in paths:
        inside = sorted(path.rglob("*")) if path.is_dir() else [path]
        files += [file for file in inside if file.is_file()]
    name = re.sub(r"\W+", "_", paths[0].stem)[:40]
    target = folder / f"log-{name}-{digest_of([identity_of(file) for file in files])}.parquet"
    return LogTask(paths[0].stem, tuple(paths), target, config)


def _by_file(
    account: Iterable[Mapping[str, Any]],
) -> tuple[dict[str, Counter[str]], list[Note]]:
    """Return the rows of each file by cause, and notes on damaged files and other clocks.

    Args:
        account: rows of the tables' accounts.
    """
    files: dict[str, Counter[str]] = {}
    notes: dict[tuple[str, str], str] = {}
    for row in account:
        file, cause = row["file"], row["cause"]
        kind, _, why = cause.partition(": ")
        causes = files.setdefault(file, Counter())
        causes["rows"] += row["rows"] if kind in ("", LEFT_OUT) else 0
        if kind == DAMAGED:
            notes[DAMAGED, file] = f"{file}: {why}"
        elif cause == OTHER_CLOCK:
            notes[OTHER_CLOCK, file] = "its stamps are those of Gentime"
        elif cause:
            causes[cause] += row["rows"]
    for file, causes in files.items():
        left_out = Counter({c: count for c, count in causes.items() if c.startswith(LEFT_OUT)})
        if left_out.total() > MAX_REJECTED_SHARE * causes["rows"]:
            share = f"{left_out.total()} of {causes['rows']} rows"
            first = f"{file}: {share} {left_out.most_common(1)[0][0]}"
            notes.setdefault((DAMAGED, file), first)
    listed = [(kind, file, why) for (kind, file), why in notes.items()]
    return {file: +causes for file, causes in sorted(files.items())}, listed


def _findings(notes: Iterable[Note]) -> list[Finding]:
    """Return notes by kind: unread files first, then what else is left out, then the others."""
    by_kind: dict[str, dict[str, str]] = {}
    for kind, name, sentence in notes:
        by_kind.setdefault(kind, {}).setdefault(name, sentence)

    def rank(kind: str) -> int:
        if kind in UNREAD:
            return UNREAD.index(kind)
        return len(UNREAD) + (LAST.index(kind) + 1 if kind in LAST else 0)

    return [
        Finding(kind, len(by_kind[kind]), dict(sorted(by_kind[kind].items())))
        for kind in sorted(by_kind, key=rank)
    ]


def _sparse_hours(accounts: Accounts, least: int) -> Iterator[Note]:
    """Yield the hours of which a table has fewer than `least` rows: these are not searched."""
    for (hour, _), rows in rows_by_hour(accounts).items():
        if rows < least:
            yield SPARSE, f"{EPOCH + timedelta(hours=hour):%Y-%m-%d %H:00}", f"{rows} rows"


def _shared_ids(hours: Iterable[HourTask]) -> Iterator[Note]:
    """Yield the ids that several vehicles share."""
    from pyarrow import parquet

    for hour in hours:
        if hour.target.exists():
            metadata = parquet.read_schema(hour.target / MEETINGS).metadata or {}
            for name in json.loads(metadata.get(b"shared", b"{}")):
                yield SHARED, name, "they are separated by place"


__all__ = ["ARCHIVE", "DETAILS", "PAGE", "MiningSummary", "mine", "tables_of"]
