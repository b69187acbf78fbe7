# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Tables of messages -> Parquet, sorted by hour, vehicle and time.

An account counts the rejected rows by cause. A task parses one byte range of a text, so a file may
have any size. DuckDB parses the rows, and counts those that it cannot parse.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
import gzip
from hashlib import sha256
import json
from pathlib import Path
import re
from typing import Any, IO, NamedTuple
import zlib

from scenario_gen.base.errors import describe, guarded, InputError, needs
from scenario_gen.base.folders import scratch, write_text
from scenario_gen.corpus.sources import MessageTable, OPTIONS
from scenario_gen.corpus.tasks import arriving

HOUR_US = 3_600_000_000
DAY_US = 24 * HOUR_US
# If the clocks of more rows differ, the second clock of a file has another meaning and is ignored.
MAX_DISAGREEING_SHARE = 0.5
MEMORY_REMEDY = (
    "free disk space at the results, or change the parameters memory, task_rows and range_size"
)
FILE_DAY = re.compile(r"_(4\d{4})(?:_|\.)")
EPOCH_DAY_INDEX = 37_987  # 2004-01-01 in the day numbers of file names
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
NO_ROW = "left out: fields are missing, or are no numbers"
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
GROUPED_RATIO = 64  # files that are smaller than a range by this ratio are parsed together


@dataclass(frozen=True)
class RangeTask:
    """Bytes to parse.

    Attributes:
        name: the task in messages.
        pieces: (file, first byte, byte after the last one).
        table: how the database reads them.
        target: the Parquet file to write.
        memory: limit of the database in MiB.
    """

    name: str
    pieces: tuple[tuple[Path, int, int], ...]
    table: MessageTable
    target: Path
    memory: int


def digest_of(*parts: object) -> str:
    """Return a short hash of what a result depends on."""
    return sha256(json.dumps(parts).encode()).hexdigest()[:12]


def ranges(
    messages: Sequence[tuple[Path, MessageTable]], folder: Path, size: int, memory: int
) -> list[RangeTask]:
    """Divide files into tasks of at most about `size` bytes.

    Small files are combined with their neighbours, at places that depend on their names alone. A
    task is named after the identity of its files, so that a changed file costs its own task.
    """
    tasks: list[tuple[MessageTable, list[tuple[Path, int, int]]]] = []
    is_open = False
    for path, table in messages:
        length = path.stat().st_size
        is_small = table.header >= 0 and length * GROUPED_RATIO < size
        step = size if table.header >= 0 else max(length, 1)
        for begin in range(max(table.header, 0), length, step):
            if not (is_small and is_open and tasks[-1][0] == table):
                tasks.append((table, []))
            tasks[-1][1].append((path, begin, min(begin + step, length)))
        is_open = is_small and zlib.crc32(str(path).encode()) % GROUPED_RATIO > 0
    named = []
    for table, pieces in tasks:
        parts = [(*identity_of(path), begin, end) for path, begin, end in pieces]
        target = folder / f"range-{digest_of(asdict(table), parts)}.parquet"
        named.append(RangeTask(pieces[0][0].name, tuple(pieces), table, target, memory))
    return named


def identity_of(path: Path) -> tuple[str, int, str]:
    """Return what tells whether a file has changed: name, size and time."""
    status = path.stat()
    return str(path.resolve()), status.st_size, str(status.st_mtime_ns)


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
        connection.execute("SET TimeZone = 'UTC'")
        connection.execute(f"SET memory_limit = '{memory}MiB'")
        connection.execute("SET temp_directory = ?", [str(spill)])
        connection.execute("SET enable_progress_bar = false")
        connection.execute("SET autoinstall_known_extensions = false")
        connection.execute("SET autoload_known_extensions = false")
        with guarded(task, duckdb.Error, remedy=remedy):
            yield connection


def parse_range(task: RangeTask) -> None:
    """Write the rows of a range, and an account of the rejected rows by file.

    The account is a JSON file with the name of the table. If the database refuses a file, the
    rows that can be decoded are parsed. The account names such a file, and a .gz with a wrong
    checksum, which the database does not compare.

    Raises:
        InputError: the database fails (no memory, a full disk).
    """
    import duckdb

    folder = task.target.parent.parent
    folder.mkdir(parents=True, exist_ok=True)
    with scratch(folder) as temporary:
        texts = [path for path, _, _ in task.pieces]
        is_packed = task.table.is_text and task.table.header < 0
        fault = _fault_of_gzip(texts[0]) if is_packed else ""
        try:
            account, table = _parse(task, texts, temporary)
        except InputError as error:
            if task.table.header >= 0 or isinstance(error.__cause__, duckdb.OutOfMemoryException):
                raise
            texts = [_decodable(path, task.table, temporary) for path in texts]
            account, table = _parse(task, texts, temporary)
            fault = fault or describe(error.__cause__ or error)
        if fault:
            account["damaged"] = {str(path): f"{path}: {fault}" for path, _, _ in task.pieces}
        with arriving(task.target.with_suffix(".json")) as part:
            write_text(part, json.dumps(account, indent=1) + "\n")
        with arriving(task.target) as part:
            table.replace(part)


def _fault_of_gzip(path: Path) -> str:
    """Return what is wrong with a .gz file, its checksums included; "" if it is sound."""
    try:
        with gzip.open(path) as file:
            while file.read(1 << 20):
                pass
    except (EOFError, gzip.BadGzipFile, zlib.error) as error:
        return describe(error)
    return ""


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


def _decodable(path: Path, table: MessageTable, folder: Path) -> Path:
    """Copy what can be decoded of a damaged file: a .gz up to the damage, Parquet's row groups."""
    target = folder / f"{path.name}.decoded"
    if table.is_text:
        with path.open("rb") as source, gzip.open(target, "wb", compresslevel=1) as copy:
            copy.writelines(_unpacked_blocks(source))
        return target
    from pyarrow import ArrowException, parquet

    with (
        parquet.ParquetFile(path) as file,
        parquet.ParquetWriter(target, file.schema_arrow) as writer,
    ):
        for k in range(file.num_row_groups):
            with suppress(ArrowException, OSError):
                writer.write_table(file.read_row_group(k))
    return target


def _unpacked_blocks(source: IO[bytes]) -> Iterator[bytes]:
    """Yield the content of a .gz, which may have several parts, up to its damage."""
    unpacker = zlib.decompressobj(wbits=31)
    with suppress(zlib.error):
        while block := unpacker.unused_data or source.read(1 << 16):
            if unpacker.eof:
                unpacker = zlib.decompressobj(wbits=31)
            yield unpacker.decompress(block)


def _parse(task: RangeTask, files: Sequence[Path], folder: Path) -> tuple[dict[str, Any], Path]:
    """Parse the pieces in files into one table with messages.sql.

    Returns:
        The account, and the table in `folder`.

    Raises:
        InputError: the database fails.
    """
    inputs = [str(path) for path, _, _ in task.pieces]
    names = {}
    for k, (path, (source, begin, end)) in enumerate(zip(files, task.pieces, strict=True)):
        is_whole = begin == 0 and end == source.stat().st_size
        lines = path if is_whole else _extract(path, begin, end, folder / f"{k}.csv")
        names[str(lines.absolute())] = inputs[k]
    target = folder / "parsed.parquet"
    with database(folder, task.memory, f"{task.name}: {', '.join(inputs)}") as base:
        base.execute("SET VARIABLE names = ?", [list(names)])
        base.execute("CREATE TYPE read AS ENUM (SELECT unnest(getvariable('names')))")
        base.execute("SET VARIABLE files = ?", [[pattern_of(name) for name in names]])
        base.execute(f"CREATE VIEW source AS SELECT {task.table.columns} FROM {task.table.reader}")
        write_messages(base.sql(SQL).to_arrow_reader(GROUP_ROWS), target)
        base.execute(f"CREATE VIEW parsed AS FROM {tables([target])}")
        counts = _counts(base)
        unchecked = _files_with_another_clock(counts)
        if unchecked:
            _accept_clocks(base, target, unchecked)
            counts = _counts(base)
        account = _account(counts, inputs)
        if task.table.is_text:
            _count_rejected(base, names, account["files"])
    account["other_clocks"] = [inputs[file] for file in unchecked]
    return account, target


class _Count(NamedTuple):
    """Rows of a file with a cause in an hour; those that run backwards, and a sum of hashes."""

    file: int
    cause: int
    hour: int
    rows: int
    backwards: int
    content: int


def _counts(base: Any) -> list[_Count]:
    """Return the numbers of parsed rows; the hour of rows that are left out is 0."""
    rows = base.execute(f"""
        SELECT file, cause, CASE WHEN cause = 0 THEN t // {HOUR_US} ELSE 0 END AS hour, count(*),
               count(*) FILTER (back), sum(hash(device, t, lat, lon, speed, heading) >> 24)
        FROM parsed GROUP BY file, cause, hour""").fetchall()
    return [_Count(*row) for row in rows]


def _account(counts: Sequence[_Count], inputs: Sequence[str]) -> dict[str, Any]:
    """Return the rows of each input by cause, and the rows and hashes of each hour."""
    files = {name: Counter[str]() for name in inputs}
    hours: Counter[int] = Counter()
    contents: Counter[int] = Counter()
    for count in counts:
        causes = files[inputs[count.file]]
        causes["rows"] += count.rows
        if count.cause:
            causes[CAUSES[count.cause - 1]] += count.rows
            continue
        causes["kept: stamps that run backwards"] += count.backwards
        hours[count.hour] += count.rows
        contents[count.hour] += count.content
        match = FILE_DAY.search(Path(inputs[count.file]).name)
        if match and abs(count.hour // 24 - (int(match[1]) - EPOCH_DAY_INDEX)) > 1:
            causes["kept: stamps of another day"] += count.rows
    return {
        "files": {name: dict(sorted((+causes).items())) for name, causes in sorted(files.items())},
        "hours": {str(hour): hours[hour] for hour in sorted(hours)},
        "contents": {str(hour): f"{contents[hour]:x}" for hour in sorted(contents)},
    }


def _count_rejected(base: Any, names: Mapping[str, str], files: dict[str, dict[str, int]]) -> None:
    """Add the rows that the database rejected; one with several errors counts once."""
    rejected = base.execute(
        "SELECT file_path, count(DISTINCT line)"
        " FROM reject_errors JOIN reject_scans USING (scan_id, file_id) GROUP BY ALL"
    )
    for path, count in rejected.fetchall():
        causes = files[names[path]]
        causes["rows"] = causes.get("rows", 0) + count
        causes[NO_ROW] = count


def _files_with_another_clock(counts: Sequence[_Count]) -> list[int]:
    """Return the files in which the clocks of most rows disagree."""
    all_rows: Counter[int] = Counter()
    disagreeing: Counter[int] = Counter()
    for count in counts:
        all_rows[count.file] += count.rows * (count.cause in (0, CLOCK_CAUSE_CODE))
        disagreeing[count.file] += count.rows * (count.cause == CLOCK_CAUSE_CODE)
    return [
        file
        for file, rows in sorted(all_rows.items())
        if disagreeing[file] > MAX_DISAGREEING_SHARE * rows
    ]


def _accept_clocks(base: Any, target: Path, files: Sequence[int]) -> None:
    """Accept the rows with disagreeing clocks in some files."""
    is_accepted = f"cause = {CLOCK_CAUSE_CODE} AND file IN ({', '.join(map(str, files))})"
    cause = f"(CASE WHEN {is_accepted} THEN 0 ELSE cause END)::UTINYINT AS cause"
    rows = base.sql(f"SELECT * REPLACE ({cause}) FROM parsed")
    rewritten = target.with_name("again.parquet")
    write_messages(rows.to_arrow_reader(GROUP_ROWS), rewritten)
    rewritten.replace(target)


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


def tables(paths: Sequence[Path], options: str = "") -> str:
    """Return the call that reads Parquet files, with further options; it reads no others."""
    files = quoted([pattern_of(str(path.absolute())) for path in paths])
    return f"read_parquet([{files}], {OPTIONS}{options})"


def pattern_of(name: str) -> str:
    """Return the pattern that only a file of this name matches; the database expands patterns."""
    return re.sub(r"[\[*?]", r"[\g<0>]", name)


def quoted(names: Sequence[str]) -> str:
    """Return names as SQL strings, separated by commas."""
    return ", ".join("'" + name.replace("'", "''") + "'" for name in names)
