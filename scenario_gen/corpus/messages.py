# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Basic safety messages in text -> Parquet sorted by hour, vehicle and time, with an account of every row that was left out.

A task parses one byte range, so a file may be of any size. DuckDB reads the text; what it cannot read it counts.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
import itertools
import json
from pathlib import Path
import re
from typing import Any

from scenario_gen.base.errors import guarded, needs
from scenario_gen.base.folders import scratch, write_text
from scenario_gen.base.stores import download, Part, Place, Remote, size_of, workplace
from scenario_gen.corpus.tasks import arriving
from scenario_gen.logs.tables import SPMD_COLUMNS

HOUR_US = 3_600_000_000  # µs
MOST_WRONG = 0.5  # of a file's rows whose clocks differ: beyond, the second clock is something else and is not used
SMALLER = "make room where the results go, or see the parameters memory, task_rows and range_size"
NAMED_DAY = re.compile(r"_(4\d{4})(?:_|\.)")
DAY_OF_2004 = 37_987  # 2004-01-01 as the names of the files count days
TYPES = {
    **dict.fromkeys(("TxDevice", "Gentime", "DSecond"), "BIGINT"),
    **dict.fromkeys(("Latitude", "Longitude"), "DOUBLE"),
    **dict.fromkeys(("Speed", "Heading"), "FLOAT"),
}
CAUSES = (  # in the order of messages.sql; each row is counted under the first that holds
    "left out: no vehicle",
    "left out: no stamp, or one outside of 2004 to 2044",
    "left out: no position, or (0, 0)",
    "left out: position off the globe",
    "left out: no speed or heading",
    "left out: no vehicle's speed",
    "left out: its clocks disagree (Gentime, DSecond)",
)
OFF = len(CAUSES)
ROWS = Path(__file__).with_suffix(".sql").read_text(encoding="utf-8")
GROUP_ROWS = 122_880  # rows of a group in a table
PACKED: dict[
    str, Any
] = {  # how tables of messages are written: differences between rows, of one vehicle and in order of time
    "compression": "zstd",
    "compression_level": 3,
    "use_dictionary": ["device", "speed", "heading", "cause", "file"],
    "column_encoding": dict.fromkeys(("t", "lat", "lon"), "DELTA_BINARY_PACKED"),
}
DEGREE = 1e7  # units of latitude and longitude in tables: a ten-millionth of a degree, as messages have them (SAE J2735); 1 cm
LONGEST_LINE = 65_536  # bytes; a longer one is no row
MOST_FILES = 65_536  # of a task: their numbers have two bytes


@dataclass(frozen=True)
class RangeTask:
    """Bytes to parse: `pieces` are (file, first byte, byte after the last); `target` the Parquet file."""

    name: str
    pieces: tuple[tuple[Place, int, int], ...]
    target: Place
    memory: int


def ranges(files: Sequence[Place], folder: Place, size: int, memory: int) -> list[RangeTask]:
    """Divide files into tasks of about `size` bytes or of `MOST_FILES`: long files are cut, short ones put together."""
    tasks: list[list[tuple[Place, int, int]]] = []
    room = 0
    for path in files:
        length = size_of(path)
        for begin in range(0, length, size):
            end = min(begin + size, length)
            if not tasks or room <= 0 or len(tasks[-1]) == MOST_FILES:
                tasks.append([])
                room = size
            tasks[-1].append((path, begin, end))
            room -= end - begin
    return [
        RangeTask(f"range {k}", tuple(pieces), folder / f"range-{k:06}.parquet", memory)
        for k, pieces in enumerate(tasks)
    ]


@contextmanager
def database(folder: Path, memory: int, what: str, remedy: str = SMALLER) -> Iterator[Any]:
    """Give a DuckDB connection of one thread, within `memory` MiB, that spills to a folder of its own in `folder`.

    Raises:
        InputError: the database fails; `what` it was doing begins the message, `remedy` ends it.
    """
    needs("corpus", "duckdb", "pyarrow")
    import duckdb

    folder.mkdir(parents=True, exist_ok=True)
    with scratch(folder) as spill, duckdb.connect() as connection:
        connection.execute("SET threads = 1")
        connection.execute(f"SET memory_limit = '{memory}MiB'")
        connection.execute("SET temp_directory = ?", [str(spill)])
        connection.execute("SET enable_progress_bar = false")
        with guarded(what, duckdb.Error, remedy=remedy):
            yield connection


def parse_range(task: RangeTask) -> None:
    """Write the rows of a range, and beside them the account of those left out, by file.

    Raises:
        InputError: the database fails (no memory, a full disk).
    """
    folder = workplace(task.target.parent.parent)
    folder.mkdir(parents=True, exist_ok=True)
    files = ", ".join(str(path) for path, _, _ in task.pieces)
    with (
        scratch(folder) as place,
        database(folder, task.memory, f"{task.name}: {files}") as base,
    ):
        names = {}
        for k, (path, begin, end), here in zip(
            itertools.count(), task.pieces, _fetched_text(task, place), strict=False
        ):
            whole = begin == 0 and end == size_of(path)
            names[str(here if whole else _extract(here, begin, end, place / f"{k}.csv"))] = str(
                path
            )
        first = place / "parsed.parquet"
        account = _parse(base, names, first)
        with arriving(task.target.with_suffix(".json")) as part:
            write_text(part, json.dumps(account, indent=1) + "\n")
        with arriving(task.target) as part:
            first.replace(part)


def _fetched_text(task: RangeTask, folder: Path) -> list[Path]:
    """Return the files of the pieces; of an object there is what `_extract` reads of it, at the same offsets, and else a hole."""
    parts = [
        Part(path, max(begin - 1, 0), min(end + LONGEST_LINE, size_of(path)), folder / f"{k}.txt")
        for k, (path, begin, end) in enumerate(task.pieces)
        if isinstance(path, Remote)
    ]
    download(parts)
    local = {part.source: part.target for part in parts}
    return [local[path] if isinstance(path, Remote) else path for path, _, _ in task.pieces]


def _extract(path: Path, begin: int, end: int, target: Path) -> Path:
    """Copy the lines that begin in a range of bytes to a file of their own."""
    with path.open("rb") as source, target.open("wb") as copy:
        source.seek(max(begin - 1, 0))
        if begin:
            source.readline()  # the line before, which begins in the range before
        left = end - source.tell()
        while left > 0 and (block := source.read(min(left, 1 << 24))):
            copy.write(block)
            left -= len(block)
        if source.tell() and left <= 0:
            source.seek(source.tell() - 1)
            if source.read(1) != b"\n":
                copy.write(source.readline())
    return target


def _parse(base: Any, names: dict[str, str], target: Path) -> dict[str, Any]:
    """Parse files (read name -> true name) into one table, as messages.sql says; return the account."""
    files, true = list(names), list(names.values())
    columns = {name: TYPES.get(name, "VARCHAR") for name in SPMD_COLUMNS}
    for name, value in (
        ("files", files),
        ("columns", columns),
        ("line", LONGEST_LINE),
        ("parsed", str(target)),
    ):
        base.execute(f"SET VARIABLE {name} = ?", [value])
    base.execute("CREATE TYPE read AS ENUM (SELECT unnest(getvariable('files')))")
    write_messages(base.sql(ROWS).to_arrow_reader(GROUP_ROWS), target)
    base.execute("CREATE VIEW parsed AS FROM read_parquet(getvariable('parsed'))")
    unchecked = _unchecked(base, target)
    account: dict[str, Counter[str]] = {name: Counter() for name in true}
    counts = "SELECT file, cause, count(*), count(*) FILTER (back AND cause = 0) FROM parsed GROUP BY ALL"
    for file, cause, count, back in base.execute(counts).fetchall():
        found = account[true[file]]
        found["rows"] += count
        found["kept: stamps that run backwards"] += back
        if cause:
            found[CAUSES[cause - 1]] += count
    rejected = (  # those with several faults count once
        "SELECT file_path, count(DISTINCT line) FROM reject_errors JOIN reject_scans USING (scan_id, file_id) GROUP BY ALL"
    )
    for name, count in base.execute(rejected).fetchall():
        account[names[name]]["rows"] += count
        account[names[name]]["left out: no row of 19 fields with numbers"] += count
    days = f"SELECT file, t // {24 * HOUR_US}, count(*) FROM parsed WHERE cause = 0 GROUP BY ALL"
    for file, day, count in base.execute(days).fetchall():
        named = NAMED_DAY.search(Path(true[file]).name)
        if named and abs(day - (int(named[1]) - DAY_OF_2004)) > 1:
            account[true[file]]["kept: stamps of another day"] += count
    hours = base.execute(
        f"SELECT t // {HOUR_US}, count(*) FROM parsed WHERE cause = 0 GROUP BY ALL ORDER BY ALL"
    ).fetchall()
    return {
        "files": {
            name: {why: n for why, n in sorted(found.items()) if n}
            for name, found in sorted(account.items())
        },
        "hours": {str(hour): rows for hour, rows in hours},
        "notes": [
            f"{true[file]}: DSecond disagrees with Gentime in most rows, and is ignored"
            for file in unchecked
        ],
    }


def _unchecked(base: Any, target: Path) -> list[int]:
    """Keep the rows after all of files in most of which the two clocks disagree; return which."""
    off = f"count(*) FILTER (cause = {OFF})"
    most = f"SELECT file FROM parsed WHERE cause IN (0, {OFF}) GROUP BY file HAVING {off} > {MOST_WRONG} * count(*) ORDER BY file"
    files = [file for (file,) in base.execute(most).fetchall()]
    if files:
        again, listed = target.with_name("again.parquet"), ", ".join(map(str, files))
        kept = f"(CASE WHEN cause = {OFF} AND file IN ({listed}) THEN 0 ELSE cause END)::UTINYINT AS cause"
        write_messages(
            base.sql(f"SELECT * REPLACE ({kept}) FROM parsed").to_arrow_reader(GROUP_ROWS), again
        )
        again.replace(target)
    return files


def write_messages(batches: Any, target: Path) -> None:
    """Write a table of messages.

    Args:
        batches: pyarrow's reader of them; latitude and longitude in units of 1e-7°.
        target: the file.
    """
    from pyarrow import parquet

    with parquet.ParquetWriter(target, batches.schema, **PACKED) as writer:
        for batch in batches:
            writer.write_batch(batch)


def quoted(names: Sequence[str]) -> str:
    """Return names as texts in SQL, separated by commas."""
    return ", ".join("'" + name.replace("'", "''") + "'" for name in names)
