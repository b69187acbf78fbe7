# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A bag in SQLite, as rosbag2 wrote by default before Jazzy."""

from collections.abc import Collection, Iterator
from contextlib import contextmanager
import itertools
from pathlib import Path
import sqlite3
from typing import Any
from urllib.parse import quote

from scenario_gen.bags.storage.config import Allowance
from scenario_gen.bags.storage.records import LATEST, StoredTopic
from scenario_gen.base.documents import shown
from scenario_gen.base.errors import guarded, InputError

NEEDED = {"topics": {"id", "name", "type"}, "messages": {"topic_id", "timestamp", "data"}}
STEPS = 1_000_000  # of SQLite's machine between two checks of a query
FREE_STEPS, STEPS_PER_BYTE = 50_000_000, 10  # a row has thirty bytes or more, and takes a hundred steps or fewer


class SqliteFile:
    """An open database."""

    def __init__(self, connection: sqlite3.Connection, what: str, allowance: Allowance) -> None:
        self._connection = connection
        self._what = what
        self._allowance = allowance
        self._topics = self._read_topics()

    def _rows(self, query: str, values: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
        with guarded(f"{self._what}: damaged", remedy="copy it again, or save what is whole with `sqlite3 FILE .recover`"):
            yield from iter(self._connection.execute(query, values).fetchone, None)

    def list_topics(self) -> tuple[StoredTopic, ...]:
        """Return the rows of `topics`."""
        return self._topics

    def _read_topics(self) -> tuple[StoredTopic, ...]:
        for table, needed in NEEDED.items():
            kind = next(iter(self._rows("SELECT type FROM sqlite_master WHERE name = ?", (table,))), ("",))[0]
            columns = {row[1] for row in self._rows(f"PRAGMA table_info({table})")}
            if kind != "table" or not needed <= columns:
                raise InputError(f"{self._what}: no bag: it has no table {table} with {', '.join(sorted(needed))}")
            if table == "topics":
                qos = "offered_qos_profiles" if "offered_qos_profiles" in columns else "''"
                encoding = "serialization_format" if "serialization_format" in columns else "'cdr'"
        counts = dict(self._rows("SELECT topic_id, count(*) FROM messages GROUP BY topic_id"))
        found = []
        for row in self._rows(f"SELECT id, name, type, {qos}, {encoding} FROM topics ORDER BY id"):
            number, name, kind, profiles, encoded = row
            if not isinstance(number, int) or not all(isinstance(text, str) for text in row[1:]):
                raise InputError(f"{self._what}: damaged, its table topics has the row {shown(row)}")
            found.append(StoredTopic(number, name, kind, profiles, encoded, counts.get(number, 0)))
        return tuple(found)

    def in_order(self, ids: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        """Yield stamp [ns], topic's id and bytes of the messages of some topics, in order of their stamps.

        Raises:
            InputError: the database is damaged.
        """
        marks = ",".join("?" for _ in ids)
        query = f"SELECT timestamp, topic_id, data FROM messages WHERE topic_id IN ({marks}) ORDER BY timestamp, rowid"
        for stamp, topic, data in self._rows(query, tuple(ids)):
            if not isinstance(stamp, int) or not -LATEST <= stamp < LATEST or not isinstance(data, bytes):
                raise InputError(f"{self._what}: damaged, a message has timestamp {shown(stamp)} and data {shown(data, 40)}")
            self._allowance.unpack(len(data))
            yield stamp, topic, data


@contextmanager
def open_sqlite(path: Path, allowance: Allowance) -> Iterator[SqliteFile]:
    """Open a database for reading, however its journal was left.

    Raises:
        InputError: it is damaged, or no bag.
    """
    what = str(path)
    with guarded(what):
        connection = sqlite3.connect(f"file:{quote(str(path.absolute()))}?mode=ro&immutable=1", uri=True)
    try:
        connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, max(1000, allowance.config.most_chunk_bytes))
        left = (FREE_STEPS + STEPS_PER_BYTE * path.stat().st_size) // STEPS
        looks = itertools.count()
        connection.set_progress_handler(lambda: next(looks) > left, STEPS)  # ends an endless query
        yield SqliteFile(connection, what, allowance)
    finally:
        connection.close()
