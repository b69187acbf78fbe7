# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Basic safety messages in text -> Parquet sorted by hour, with an account of every row that was left out.

A task parses one byte range, so a file may be of any size. DuckDB reads the text; what it cannot read it counts.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
import json
from pathlib import Path
import re
import tempfile
from typing import Any

import numpy as np

from scenario_gen.corpus.tasks import arriving
from scenario_gen.errors import guarded, needs
from scenario_gen.folders import write_text
from scenario_gen.logs.tables import COLUMNS

HOUR = 3_600_000_000  # µs
CLOCK = 1500  # ms by which the two clocks of a message may differ
MOST_WRONG = 0.5  # of a file's rows whose clocks differ: beyond, the second clock is something else and is not asked
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
CLOCKS = "left out: its clocks disagree (Gentime, DSecond)"


@dataclass(frozen=True)
class RangeTask:
    """Bytes to parse: `pieces` are (file, first byte, byte after the last); `target` the Parquet file."""

    name: str
    pieces: tuple[tuple[Path, int, int], ...]
    target: Path
    memory: int


def ranges(files: Sequence[Path], folder: Path, size: int, memory: int) -> list[RangeTask]:
    """Divide files into tasks of at most `size` bytes each: long files are cut, short ones put together."""
    tasks: list[list[tuple[Path, int, int]]] = []
    room = 0
    for path in files:
        length = path.stat().st_size
        for begin in range(0, length, size):
            end = min(begin + size, length)
            if not tasks or end - begin > room:
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
    with tempfile.TemporaryDirectory(dir=folder, prefix=".spill-") as spill, duckdb.connect() as connection:
        connection.execute("SET threads = 1")
        connection.execute(f"SET memory_limit = '{memory}MiB'")
        connection.execute("SET temp_directory = ?", [spill])
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
    folder = task.target.parent
    folder.mkdir(parents=True, exist_ok=True)
    files = ", ".join(str(path) for path, _, _ in task.pieces)
    with (
        tempfile.TemporaryDirectory(dir=folder.parent, prefix=".range-") as place,
        database(folder.parent, task.memory, f"{task.name}: {files}") as base,
    ):
        names = {}
        for k, (path, begin, end) in enumerate(task.pieces):
            whole = begin == 0 and end == path.stat().st_size
            names[str(path if whole else _extract(path, begin, end, Path(place) / f"{k}.csv"))] = str(path)
        account, kept = _parse(base, names)
        with arriving(task.target.with_suffix(".json")) as part:
            write_text(part, json.dumps(account, indent=1) + "\n")
        with arriving(task.target) as part:
            base.execute(
                f"COPY (SELECT device, t, lat, lon, speed, heading FROM parsed WHERE {kept} ORDER BY t // {HOUR}) "
                f"TO {quoted([str(part)])} "
                "(FORMAT parquet, COMPRESSION zstd)"
            )


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


def _parse(base: Any, names: dict[str, str]) -> tuple[dict[str, Any], str]:
    """Parse files (read name -> true name) into the table `parsed`; return the account, and the condition of rows to keep."""
    files = [name for name in names if Path(name).stat().st_size]
    columns = ", ".join(f"'{name}': '{TYPES.get(name, 'VARCHAR')}'" for name in COLUMNS)
    cause = " ".join(f"WHEN {condition} THEN {k}" for k, condition in enumerate(CAUSES.values(), start=1))
    off = (
        f"DSecond IS NOT NULL AND DSecond <> {UNKNOWN_SECOND} AND "
        f"abs((Gentime // 1000 - DSecond + 90000) % 60000 - 30000) > {CLOCK}"
    )
    source = "(SELECT NULL::VARCHAR AS filename, " + ", ".join(f"NULL::{TYPES[name]} AS {name}" for name in TYPES) + " LIMIT 0)"
    if files:
        source = (
            f"read_csv([{quoted(files)}], columns={{{columns}}}, header=false, auto_detect=false, delim=',', quote='', "
            "escape='', store_rejects=true, filename=true, max_line_size=65536)"
        )
    base.execute(
        f"CREATE TEMP TABLE parsed AS SELECT filename, TxDevice AS device, Gentime AS t, Latitude AS lat, Longitude AS lon, "
        f"Speed AS speed, Heading AS heading, (CASE {cause} ELSE 0 END)::UTINYINT AS cause, coalesce({off}, false) AS off "
        f"FROM {source}"
    )
    base.execute(
        "CREATE TEMP TABLE files AS SELECT filename, count(*) AS rows, "
        f"count(*) FILTER (cause = 0 AND off) <= {MOST_WRONG} * count(*) FILTER (cause = 0) AS checked "
        "FROM parsed GROUP BY filename"
    )
    account: dict[str, Counter[str]] = {name: Counter() for name in names.values()}
    notes: list[str] = []
    unchecked: list[str] = []
    for name, rows, checked in base.execute("FROM files ORDER BY filename").fetchall():
        account[names[name]]["rows"] += rows
        if not checked:
            unchecked.append(name)
            notes.append(f"{names[name]}: DSecond disagrees with Gentime in most rows, and is not asked")
    causes = "SELECT filename, cause, count(*) FROM parsed WHERE cause > 0 GROUP BY ALL"
    for name, number, count in base.execute(causes).fetchall():
        account[names[name]][list(CAUSES)[number - 1]] += count
    clocks = "SELECT filename, count(*) FROM parsed JOIN files USING (filename) WHERE cause = 0 AND checked AND off GROUP BY ALL"
    for name, count in base.execute(clocks).fetchall():
        account[names[name]][CLOCKS] += count
    for name, count in _rejected(base) if files else ():
        account[names[name]]["rows"] += count
        account[names[name]]["left out: no row of 19 fields with numbers"] += count
    for name, backwards, foreign in _clocks(base, names):
        account[names[name]] += Counter({"said: stamps that run backwards": backwards, "said: stamps of another day": foreign})
    kept = f"cause = 0 AND (NOT off{f' OR filename IN ({quoted(unchecked)})' if unchecked else ''})"
    hours = base.execute(f"SELECT t // {HOUR}, count(*) FROM parsed WHERE {kept} GROUP BY ALL ORDER BY ALL").fetchall()
    found = {
        "files": {name: dict(sorted(found.items())) for name, found in sorted(account.items())},
        "hours": {str(hour): rows for hour, rows in hours},
        "notes": sorted(set(notes)),
    }
    return found, kept


def quoted(names: Sequence[str]) -> str:
    """Return names as texts in SQL, separated by commas."""
    return ", ".join("'" + name.replace("'", "''") + "'" for name in names)


def _rejected(base: Any) -> list[tuple[str, int]]:
    """Rows of each file that are no rows; one with several faults counts once."""
    found: list[tuple[str, int]] = base.execute(
        "SELECT file_path, count(DISTINCT line) FROM reject_errors JOIN reject_scans USING (scan_id, file_id) GROUP BY ALL"
    ).fetchall()
    return found


def _clocks(base: Any, names: dict[str, str]) -> Iterator[tuple[str, int, int]]:
    """Yield for each file how many stamps lie before the stamp above of the same vehicle, and beyond a day of the file's name."""
    for name, true in names.items():
        rows = base.execute("SELECT device, t FROM parsed WHERE filename = ? AND cause = 0 AND NOT off", [name]).fetchnumpy()
        device, stamp = np.asarray(rows["device"]), np.asarray(rows["t"])
        backwards = int(((np.diff(stamp) < 0) & (np.diff(device) == 0)).sum())
        day = NAMED_DAY.search(Path(true).name)
        foreign = 0
        if day:
            begin = (int(day[1]) - DAY_OF_2004) * 24 * HOUR
            foreign = int(((stamp < begin - 24 * HOUR) | (stamp >= begin + 48 * HOUR)).sum())
        yield name, backwards, foreign
