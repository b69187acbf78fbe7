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
from scenario_gen.logs.tables import COLUMNS

HOUR = 3_600_000_000  # µs
CLOCK = 1500  # ms by which the two clocks of a message may differ
MOST_WRONG = 0.5  # of a file's rows whose clocks differ: beyond, the second clock is something else and is not used
UNKNOWN_SECOND = 65_535  # DSecond of a sender that does not know
LAST_STAMP = 40 * 365 * 24 * HOUR  # from 2004 on
SMALLER = "see the parameters memory, task_rows and range_size"
NAMED_DAY = re.compile(r"_(4\d{4})(?:_|\.)")
DAY_OF_2004 = 37_987  # 2004-01-01 as the names of the files count days
TYPES = {
    **dict.fromkeys(("TxDevice", "Gentime", "DSecond"), "BIGINT"),
    **dict.fromkeys(("Latitude", "Longitude"), "DOUBLE"),
    **dict.fromkeys(("Speed", "Heading"), "FLOAT"),
}
CAUSES = {  # in this order; each row is counted under the first that holds
    "left out: no vehicle": "TxDevice IS NULL",
    "left out: no stamp, or one outside of 2004 to 2044": f"Gentime IS NULL OR Gentime <= 0 OR Gentime > {LAST_STAMP}",
    "left out: no position, or (0, 0)": "Latitude IS NULL OR Longitude IS NULL OR (Latitude = 0 AND Longitude = 0)",
    "left out: position off the globe": "abs(Latitude) > 85 OR abs(Longitude) > 180 OR isnan(Latitude) OR isnan(Longitude)",
    "left out: no speed or heading": "Speed IS NULL OR Heading IS NULL OR isnan(Speed) OR isnan(Heading)",
    "left out: no vehicle's speed": "Speed < 0 OR Speed > 100",
}
OFF = len(CAUSES) + 1
DISAGREE = (
    f"DSecond <> {UNKNOWN_SECOND} AND "
    f"abs(Gentime * 1e-3 - DSecond - 60000.0 * round((Gentime * 1e-3 - DSecond) / 60000.0)) > {CLOCK}"
)
IN_ORDER = f"TRY_CAST(t // {HOUR} AS INTEGER), TRY_CAST(device AS INTEGER), TRY_CAST(t % {HOUR} AS UINTEGER)"  # short
GROUP = 122_880  # rows of a group in a table
PACKED: dict[str, Any] = {  # how tables of messages are written: differences between rows, of one vehicle and in order of time
    "compression": "zstd",
    "compression_level": 3,
    "use_dictionary": ["device", "speed", "heading", "cause", "file"],
    "column_encoding": dict.fromkeys(("t", "lat", "lon"), "DELTA_BINARY_PACKED"),
}
DEGREE = 1e7  # units of latitude and longitude in tables: a ten-millionth of a degree, as messages have them (SAE J2735); 1 cm
LONGEST_LINE = 65_536  # bytes; a longer one is no row
MOST_FILES = 65_536  # of a task: their numbers have two bytes
CLOCKS = "left out: its clocks disagree (Gentime, DSecond)"


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
    return [RangeTask(f"range {k}", tuple(pieces), folder / f"range-{k:06}.parquet", memory) for k, pieces in enumerate(tasks)]


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
    if task.target.exists():
        return
    folder = workplace(task.target.parent.parent)
    folder.mkdir(parents=True, exist_ok=True)
    files = ", ".join(str(path) for path, _, _ in task.pieces)
    with (
        scratch(folder) as place,
        database(folder, task.memory, f"{task.name}: {files}") as base,
    ):
        names = {}
        for k, (path, begin, end), here in zip(itertools.count(), task.pieces, _fetched_text(task, place), strict=False):
            whole = begin == 0 and end == size_of(path)
            names[str(here if whole else _extract(here, begin, end, place / f"{k}.csv"))] = str(path)
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
    """Parse files (read name -> true name) into one table in order of hours, in each of vehicles and time; return the account.

    The table has device, t, lat, lon [1e-7°], speed, heading, `cause` (0: the row is kept), `file` (which of `names`) and `back`
    (a stamp before that of the row above, of the same vehicle).
    """
    files = [name for name in names if Path(name).stat().st_size]
    columns = ", ".join(f"'{name}': '{TYPES.get(name, 'VARCHAR')}'" for name in COLUMNS)
    cause = " ".join(f"WHEN {condition} THEN {k}" for k, condition in enumerate(CAUSES.values(), start=1))
    one = len(files) == 1
    if len(files) > 1:
        base.execute(f"CREATE TYPE read AS ENUM ({quoted(files)})")  # found by hash: a list is searched for each row
    file = "0" if one else "enum_code(filename::read)"
    source = (
        f"read_csv([{quoted(files)}], columns={{{columns}}}, header=false, auto_detect=false, delim=',', quote='', "
        f"escape='', store_rejects=true, filename={'false' if one else 'true'}, max_line_size={LONGEST_LINE})"
    )
    if not files:
        source = "(SELECT " + ", ".join(f"NULL::{TYPES[name]} AS {name}" for name in TYPES) + ", '' AS filename LIMIT 0)"
        file = "0"
    select = (
        f"SELECT TxDevice AS device, Gentime AS t, TRY_CAST(round(Latitude * {DEGREE}) AS INTEGER) AS lat, "
        f"TRY_CAST(round(Longitude * {DEGREE}) AS INTEGER) AS lon, Speed AS speed, Heading AS heading, "
        f"(CASE {cause} WHEN {DISAGREE} THEN {OFF} ELSE 0 END)::UTINYINT AS cause, ({file})::USMALLINT AS file, "
        "coalesce(TxDevice = lag(TxDevice) OVER () AND Gentime < lag(Gentime) OVER (), false) AS back "
        f"FROM {source} ORDER BY {IN_ORDER}"
    )
    write_messages(base.sql(select).to_arrow_reader(GROUP), target)
    parsed = f"read_parquet({quoted([str(target)])})"
    counts = base.execute(
        f"SELECT file, cause, count(*), count(*) FILTER (back AND cause = 0) FROM {parsed} GROUP BY ALL"
    ).fetchall()
    notes = _unchecked(base, parsed, target, files, names, counts)
    if notes:
        counts = base.execute(
            f"SELECT file, cause, count(*), count(*) FILTER (back AND cause = 0) FROM {parsed} GROUP BY ALL"
        ).fetchall()
    account: dict[str, Counter[str]] = {name: Counter() for name in names.values()}
    causes = ["", *CAUSES, CLOCKS]
    for number, why, count, back in counts:
        found = account[names[files[number]]]
        found["rows"] += count
        found["said: stamps that run backwards"] += back
        if why:
            found[causes[why]] += count
    for name, count in _rejected(base) if files else ():
        account[names[name]]["rows"] += count
        account[names[name]]["left out: no row of 19 fields with numbers"] += count
    days = f"SELECT file, t // {24 * HOUR}, count(*) FROM {parsed} WHERE cause = 0 GROUP BY ALL"
    for number, day, count in base.execute(days).fetchall():
        true = names[files[number]]
        named = NAMED_DAY.search(Path(true).name)
        if named and abs(day - (int(named[1]) - DAY_OF_2004)) > 1:
            account[true]["said: stamps of another day"] += count
    hours = base.execute(f"SELECT t // {HOUR}, count(*) FROM {parsed} WHERE cause = 0 GROUP BY ALL ORDER BY ALL").fetchall()
    return {
        "files": {name: {why: n for why, n in sorted(found.items()) if n} for name, found in sorted(account.items())},
        "hours": {str(hour): rows for hour, rows in hours},
        "notes": notes,
    }


def _unchecked(
    base: Any, parsed: str, target: Path, files: list[str], names: dict[str, str], counts: list[tuple[int, int, int, int]]
) -> list[str]:
    """Keep the rows after all of files in most of which the two clocks disagree; say which."""
    good, off = Counter[int](), Counter[int]()
    for number, why, count, _ in counts:
        good[number] += count * (why == 0)
        off[number] += count * (why == OFF)
    most = [number for number in sorted(off) if off[number] > MOST_WRONG * (good[number] + off[number])]
    if most:
        again = target.with_name("again.parquet")
        listed = ", ".join(map(str, most))
        select = (
            f"SELECT * REPLACE ((CASE WHEN cause = {OFF} AND file IN ({listed}) THEN 0 ELSE cause END)::UTINYINT AS cause) "
            f"FROM {parsed}"
        )
        write_messages(base.sql(select).to_arrow_reader(GROUP), again)
        again.replace(target)
    return [f"{names[files[number]]}: DSecond disagrees with Gentime in most rows, and is not asked" for number in most]


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


def _rejected(base: Any) -> list[tuple[str, int]]:
    """Rows of each file that are no rows; one with several faults counts once."""
    found: list[tuple[str, int]] = base.execute(
        "SELECT file_path, count(DISTINCT line) FROM reject_errors JOIN reject_scans USING (scan_id, file_id) GROUP BY ALL"
    ).fetchall()
    return found


def quoted(names: Sequence[str]) -> str:
    """Return names as texts in SQL, separated by commas."""
    return ", ".join("'" + name.replace("'", "''") + "'" for name in names)
