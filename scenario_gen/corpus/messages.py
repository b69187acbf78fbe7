# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Basic safety messages in text -> Parquet, sorted by hour, vehicle and time.

An account counts the rejected rows by cause. A task parses one byte range, so a file may have any
size. DuckDB parses the text, and counts the rows that it cannot parse.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
import json
from pathlib import Path
import re
import shutil
from typing import Any

from scenario_gen.base.errors import guarded, InputError, needs
from scenario_gen.base.folders import scratch, write_text
from scenario_gen.base.stores import download, Part, Place, Remote, size_of, workplace
from scenario_gen.corpus.tasks import arriving
from scenario_gen.logs.tables import SPMD_COLUMNS

HOUR_US = 3_600_000_000
DAY_US = 24 * HOUR_US
# If the clocks of more rows differ, the second clock of a file has another meaning and is ignored.
MAX_DISAGREEING_SHARE = 0.5
MEMORY_REMEDY = (
    "free disk space at the results, or change the parameters memory, task_rows and range_size"
)
FILE_DAY = re.compile(r"_(4\d{4})(?:_|\.)")
EPOCH_DAY_INDEX = 37_987  # 2004-01-01 in the day numbers of file names
TYPES = {
    **dict.fromkeys(("TxDevice", "Gentime", "DSecond"), "BIGINT"),
    **dict.fromkeys(("Latitude", "Longitude"), "DOUBLE"),
    **dict.fromkeys(("Speed", "Heading"), "FLOAT"),
}
# Causes in the order of messages.sql; a row counts under the first cause that holds.
CAUSES = (
    "left out: no vehicle",
    "left out: no stamp, or one outside of 2004 to 2044",
    "left out: no position, or (0, 0)",
    "left out: position off the globe",
    "left out: no speed or heading",
    "left out: no vehicle's speed",
    "left out: its clocks disagree (Gentime, DSecond)",
)
CLOCK_CAUSE_CODE = len(CAUSES)
SQL = Path(__file__).with_suffix(".sql").read_text(encoding="utf-8")
GROUP_ROWS = 122_880  # row group of a table
# Tables store differences between rows, which are small for one vehicle in order of time.
PARQUET_OPTIONS: dict[str, Any] = {
    "compression": "zstd",
    "compression_level": 3,
    "use_dictionary": ["device", "speed", "heading", "cause", "file"],
    "column_encoding": dict.fromkeys(("t", "lat", "lon"), "DELTA_BINARY_PACKED"),
}
# Latitude and longitude are integers in units of 1e-7 degrees (1 cm), as in SAE J2735.
UNITS_PER_DEGREE = 1e7
MAX_LINE_BYTES = 65_536  # a longer line is not a row
MAX_TASK_FILES = 65_536  # file numbers in a table have two bytes


@dataclass(frozen=True)
class RangeTask:
    """Bytes to parse.

    Attributes:
        name: the task in messages.
        pieces: (file, first byte, byte after the last one).
        target: the Parquet file to write.
        memory: limit of the database in MiB.
    """

    name: str
    pieces: tuple[tuple[Place, int, int], ...]
    target: Place
    memory: int


def ranges(files: Sequence[Place], folder: Place, size: int, memory: int) -> list[RangeTask]:
    """Divide files into tasks with about `size` bytes and at most `MAX_TASK_FILES` pieces.

    Long files are divided, short ones are combined.
    """
    tasks: list[list[tuple[Place, int, int]]] = []
    room = 0
    for path in files:
        length = size_of(path)
        for begin in range(0, length, size):
            end = min(begin + size, length)
            if not tasks or room <= 0 or len(tasks[-1]) == MAX_TASK_FILES:
                tasks.append([])
                room = size
            tasks[-1].append((path, begin, end))
            room -= end - begin
    return [
        RangeTask(f"range {k}", tuple(pieces), folder / f"range-{k:06}.parquet", memory)
        for k, pieces in enumerate(tasks)
    ]


@contextmanager
def database(folder: Path, memory: int, task: str, remedy: str = MEMORY_REMEDY) -> Iterator[Any]:
    """Give a DuckDB connection with one thread that spills to a temporary folder.

    Args:
        folder: parent of the temporary folder.
        memory: limit in MiB.
        task: the beginning of error messages.
        remedy: the end of error messages.

    Raises:
        InputError: the database fails.
    """
    needs("corpus", "duckdb", "pyarrow")
    import duckdb

    folder.mkdir(parents=True, exist_ok=True)
    with scratch(folder) as spill, duckdb.connect() as connection:
        connection.execute("SET threads = 1")
        connection.execute(f"SET memory_limit = '{memory}MiB'")
        connection.execute("SET temp_directory = ?", [str(spill)])
        connection.execute("SET enable_progress_bar = false")
        with guarded(task, duckdb.Error, remedy=remedy):
            yield connection


def parse_range(task: RangeTask) -> None:
    """Write the rows of a range, and an account of the rejected rows by file.

    The account is a JSON file with the name of the table. If the parser refuses the bytes, as it
    does lone carriage returns, the range is parsed again as plain lines.

    Raises:
        InputError: the database fails (no memory, a full disk).
    """
    try:
        _parse_range(task, plain=False)
    except InputError as error:
        from duckdb import InvalidInputException

        if not isinstance(error.__cause__, InvalidInputException):
            raise
        _parse_range(task, plain=True)


def _parse_range(task: RangeTask, *, plain: bool) -> None:
    """Write the rows and the account of a range; with `plain`, of a copy as plain lines.

    Raises:
        InputError: as `parse_range`.
    """
    folder = workplace(task.target.parent.parent)
    folder.mkdir(parents=True, exist_ok=True)
    files = ", ".join(str(path) for path, _, _ in task.pieces)
    with (
        scratch(folder) as temporary,
        database(folder, task.memory, f"{task.name}: {files}") as base,
    ):
        names = {}
        texts = _fetched_text(task, temporary)
        for k, ((path, begin, end), text) in enumerate(zip(task.pieces, texts, strict=True)):
            is_whole = begin == 0 and end == size_of(path)
            lines = text if is_whole else _extract(text, begin, end, temporary / f"{k}.csv")
            if plain:
                lines = _plain(lines, temporary / f"{k}.plain.csv")
            names[str(lines)] = str(path)
        table = temporary / "parsed.parquet"
        account = _parse(base, names, table)
        with arriving(task.target.with_suffix(".json")) as part:
            write_text(part, json.dumps(account, indent=1) + "\n")
        with arriving(task.target) as part:
            table.replace(part)


def _fetched_text(task: RangeTask, folder: Path) -> list[Path]:
    """Return the files of the pieces.

    The copy of an object is sparse: it has the bytes that `_extract` reads, at the same offsets.
    """
    parts = []
    for k, (path, begin, end) in enumerate(task.pieces):
        if isinstance(path, Remote):
            last = min(end + MAX_LINE_BYTES, size_of(path))
            parts.append(Part(path, max(begin - 1, 0), last, folder / f"{k}.txt"))
    download(parts)
    copies = {part.source: part.target for part in parts}
    return [copies[path] if isinstance(path, Remote) else path for path, _, _ in task.pieces]


def _extract(path: Path, begin: int, end: int, target: Path) -> Path:
    """Copy the lines that begin within a range of bytes to another file."""
    with path.open("rb") as source, target.open("wb") as copy:
        source.seek(max(begin - 1, 0))
        if begin:
            source.readline()  # this line begins in the previous range
        left = end - source.tell()
        while left > 0 and (block := source.read(min(left, 1 << 24))):
            copy.write(block)
            left -= len(block)
        if source.tell() and left <= 0:
            source.seek(source.tell() - 1)
            if source.read(1) != b"\n":
                copy.write(source.readline())
    return target


def _plain(path: Path, target: Path) -> Path:
    """Copy a text with one kind of line end and ASCII only; other bytes become question marks."""
    with (
        path.open(encoding="latin-1") as source,
        target.open("w", encoding="ascii", errors="replace", newline="\n") as copy,
    ):
        shutil.copyfileobj(source, copy, 1 << 24)
    return target


def _parse(base: Any, names: Mapping[str, str], target: Path) -> dict[str, Any]:
    """Parse files into one table with messages.sql; return the account.

    Args:
        base: the database.
        names: {path to parse: name of the input}.
        target: the table.
    """
    columns = {name: TYPES.get(name, "VARCHAR") for name in SPMD_COLUMNS}
    variables = {
        "files": list(names),
        "columns": columns,
        "line": MAX_LINE_BYTES,
        "parsed": str(target),
    }
    for name, value in variables.items():
        base.execute(f"SET VARIABLE {name} = ?", [value])
    base.execute("CREATE TYPE read AS ENUM (SELECT unnest(getvariable('files')))")
    write_messages(base.sql(SQL).to_arrow_reader(GROUP_ROWS), target)
    base.execute("CREATE VIEW parsed AS FROM read_parquet(getvariable('parsed'))")
    inputs = list(names.values())
    unchecked = _accept_clocks(base, target)
    account = _row_counts(base, names)
    hours = base.execute(
        f"SELECT t // {HOUR_US}, count(*) FROM parsed WHERE cause = 0 GROUP BY ALL ORDER BY ALL"
    ).fetchall()
    notes = [
        f"{inputs[file]}: DSecond disagrees with Gentime in most rows, and is ignored"
        for file in unchecked
    ]
    files = {
        name: {cause: count for cause, count in sorted(counts.items()) if count}
        for name, counts in sorted(account.items())
    }
    return {"files": files, "hours": {str(hour): rows for hour, rows in hours}, "notes": notes}


def _row_counts(base: Any, names: Mapping[str, str]) -> dict[str, Counter[str]]:
    """Return the number of rows of each input, and of its rows with a cause."""
    inputs = list(names.values())
    account: dict[str, Counter[str]] = {name: Counter() for name in inputs}
    causes = base.execute(
        "SELECT file, cause, count(*), count(*) FILTER (back AND cause = 0)"
        " FROM parsed GROUP BY ALL"
    )
    for file, cause, count, backwards in causes.fetchall():
        counts = account[inputs[file]]
        counts["rows"] += count
        counts["kept: stamps that run backwards"] += backwards
        if cause:
            counts[CAUSES[cause - 1]] += count
    rejected = base.execute(  # a line with several errors counts once
        "SELECT file_path, count(DISTINCT line)"
        " FROM reject_errors JOIN reject_scans USING (scan_id, file_id) GROUP BY ALL"
    )
    for path, count in rejected.fetchall():
        counts = account[names[path]]
        counts["rows"] += count
        counts["left out: no row of 19 fields with numbers"] += count
    days = base.execute(
        f"SELECT file, t // {DAY_US}, count(*) FROM parsed WHERE cause = 0 GROUP BY ALL"
    )
    for file, day, count in days.fetchall():
        match = FILE_DAY.search(Path(inputs[file]).name)
        if match and abs(day - (int(match[1]) - EPOCH_DAY_INDEX)) > 1:
            account[inputs[file]]["kept: stamps of another day"] += count
    return account


def _accept_clocks(base: Any, target: Path) -> list[int]:
    """Accept the rows with disagreeing clocks in files where most rows have them.

    Returns:
        The numbers of these files.
    """
    disagreeing = f"count(*) FILTER (cause = {CLOCK_CAUSE_CODE})"
    query = (
        f"SELECT file FROM parsed WHERE cause IN (0, {CLOCK_CAUSE_CODE}) GROUP BY file"
        f" HAVING {disagreeing} > {MAX_DISAGREEING_SHARE} * count(*) ORDER BY file"
    )
    files = [file for (file,) in base.execute(query).fetchall()]
    if files:
        is_accepted = f"cause = {CLOCK_CAUSE_CODE} AND file IN ({', '.join(map(str, files))})"
        cause = f"(CASE WHEN {is_accepted} THEN 0 ELSE cause END)::UTINYINT AS cause"
        rows = base.sql(f"SELECT * REPLACE ({cause}) FROM parsed")
        rewritten = target.with_name("again.parquet")
        write_messages(rows.to_arrow_reader(GROUP_ROWS), rewritten)
        rewritten.replace(target)
    return files


def write_messages(batches: Any, target: Path) -> None:
    """Write a table of messages.

    Args:
        batches: a pyarrow reader; latitude and longitude in units of 1e-7°.
        target: the file.
    """
    from pyarrow import parquet

    with parquet.ParquetWriter(target, batches.schema, **PARQUET_OPTIONS) as writer:
        for batch in batches:
            writer.write_batch(batch)


def quoted(names: Sequence[str]) -> str:
    """Return names as SQL strings, separated by commas."""
    return ", ".join("'" + name.replace("'", "''") + "'" for name in names)
