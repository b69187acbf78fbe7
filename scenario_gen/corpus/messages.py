# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Tables of messages -> Parquet, sorted by hour, vehicle and time.

An account counts the rows by file, cause of being left out, and hour. A task parses one byte range
of a text, so a file may have any size. DuckDB parses the rows, and counts those that it cannot.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
import gzip
from hashlib import sha256
import json
from pathlib import Path
import re
from typing import Any, IO
import zlib

from scenario_gen.base.errors import describe, guarded, InputError, needs
from scenario_gen.base.folders import scratch
from scenario_gen.corpus.sources import MessageTable, OPTIONS
from scenario_gen.corpus.tasks import arriving

HOUR_US = 3_600_000_000
DAY_US = 24 * HOUR_US
MEMORY_REMEDY = "free disk space at the results, or change the parameters memory and range_size"
# Causes in the order of messages.sql; a row counts under the first cause that holds.
CAUSES = (
    "",
    "left out: no vehicle",
    "left out: no stamp, or one outside of 2004 to 2044",
    "left out: no position, or (0, 0)",
    "left out: position off the globe",
    "left out: no speed or heading",
    "left out: no vehicle's speed",
    "left out: its clocks disagree (Gentime, DSecond)",
)
NO_ROW = "left out: fields are missing, or are no numbers"
DAMAGED = "damaged"
OTHER_CLOCK = "kept: DSecond disagrees with Gentime in most rows of the file, and is ignored"
SQL = Path(__file__).with_suffix(".sql").read_text(encoding="utf-8")
ACCOUNT = "range-*.account"  # pattern of the names of accounts
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
    settings = {
        "threads": 1,
        "memory_limit": f"{memory}MiB",
        "autoinstall_known_extensions": False,
        "autoload_known_extensions": False,
    }
    with (
        scratch(folder) as spill,
        duckdb.connect(config=settings | {"temp_directory": str(spill)}) as connection,
    ):
        connection.execute("SET TimeZone = 'UTC'")
        connection.execute("SET enable_progress_bar = false")
        with guarded(task, duckdb.Error, remedy=remedy):
            yield connection


def parse_range(task: RangeTask) -> None:
    """Write the rows of a range, and their account in a table with the suffix .account.

    Its columns are file, cause ("" of rows that are kept), hour of these, rows. If the database
    refuses a file, the rows that can be decoded are parsed. The account names such a file, and a
    .gz with a wrong checksum, which the database does not compare.

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
            _parse(task, texts, temporary, fault)
        except InputError as error:
            if task.table.header >= 0 or isinstance(error.__cause__, duckdb.OutOfMemoryException):
                raise
            texts = [_decodable(path, task.table, temporary) for path in texts]
            _parse(task, texts, temporary, fault or describe(error.__cause__ or error))


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


def _parse(task: RangeTask, files: Sequence[Path], folder: Path, fault: str) -> None:
    """Parse the pieces in files into one table with messages.sql, and write its account.

    Raises:
        InputError: the database fails.
    """
    inputs = [str(path) for path, _, _ in task.pieces]
    names = []
    for k, (path, (source, begin, end)) in enumerate(zip(files, task.pieces, strict=True)):
        is_whole = begin == 0 and end == source.stat().st_size
        lines = path if is_whole else _extract(path, begin, end, folder / f"{k}.csv")
        names.append(str(lines.absolute()))
    with (
        arriving(task.target) as target,
        arriving(task.target.with_suffix(".account")) as account,
        database(folder, task.memory, f"{task.name}: {', '.join(inputs)}") as base,
    ):
        for name, value in (
            ("names", names),
            ("inputs", inputs),
            ("files", [pattern_of(name) for name in names]),
            ("causes", CAUSES),
        ):
            base.execute(f"SET VARIABLE {name} = ?", [value])
        base.execute("CREATE TYPE read AS ENUM (SELECT unnest(getvariable('names')))")
        base.execute(f"CREATE VIEW source AS SELECT {task.table.columns} FROM {task.table.reader}")
        write_messages(base.sql(SQL).to_arrow_reader(GROUP_ROWS), target)
        base.execute(f"CREATE VIEW parsed AS FROM {tables([target])}")
        unchecked = base.execute(OTHER_CLOCKS).fetchall()
        if unchecked:
            _accept_clocks(base, target, [str(file) for (file,) in unchecked])
        facts = [(name, f"{DAMAGED}: {fault}") for name in inputs if fault]
        facts += [(inputs[file], OTHER_CLOCK) for (file,) in unchecked]
        base.execute("CREATE TABLE account AS " + COUNTS)
        for fact in facts:
            base.execute("INSERT INTO account VALUES (?, ?, NULL, 0)", fact)
        if task.table.is_text:
            base.execute(f"INSERT INTO account {REJECTED}", [NO_ROW])
        base.execute(f"COPY account TO {quoted([str(account)])} (FORMAT parquet)")


# If the clocks of more than half of the rows differ, the second clock has another meaning.
OTHER_CLOCKS = """
    SELECT file FROM parsed WHERE cause IN (0, 7) GROUP BY file
    HAVING avg((cause = 7)::INTEGER) > 0.5 ORDER BY file"""
COUNTS = f"""
    WITH counted AS (
        SELECT getvariable('inputs')[file + 1] AS file, getvariable('causes')[cause + 1] AS cause,
               CASE WHEN cause = 0 THEN t // {HOUR_US} END AS hour, count(*) AS rows,
               count(*) FILTER (back AND cause = 0) AS backwards
        FROM parsed GROUP BY ALL),
    dated AS (  -- names of files may have their day, counted from 1899-12-30
        SELECT *, regexp_extract(parse_filename(file), '_(4[0-9]{{4}})[_.]', 1) AS day
        FROM counted)
    SELECT file, cause, hour, rows FROM counted
    UNION ALL SELECT file, 'kept: stamps that run backwards', NULL, backwards FROM counted
    UNION ALL SELECT file, 'kept: stamps of another day', NULL, rows FROM dated
        WHERE abs(TRY_CAST(day AS INTEGER) - 37_987 - hour // 24) > 1"""
# A row with several errors counts once.
REJECTED = """
    SELECT getvariable('inputs')[list_position(getvariable('names'), file_path)], ?, NULL,
           count(DISTINCT line)
    FROM reject_errors JOIN reject_scans USING (scan_id, file_id) GROUP BY ALL"""


def _accept_clocks(base: Any, target: Path, files: Sequence[str]) -> None:
    """Accept the rows with disagreeing clocks in some files."""
    is_accepted = f"cause = 7 AND file IN ({', '.join(files)})"
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
