# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Bags in SQLite and bags of ROS 1, read by rosbags, once their tables or chunks are seen to keep to the bounds."""

import bz2
from collections.abc import Callable, Collection, Iterator
from contextlib import closing, contextmanager
from functools import partial
import io
import itertools
from pathlib import Path
import sqlite3
from typing import Any
from urllib.parse import quote

import lz4.frame
from rosbags.interfaces import ConnectionExtRosbag1

from scenario_gen.bags.storage.config import Allowance, FOUND_BYTES
from scenario_gen.bags.storage.definitions import ros1_types
from scenario_gen.bags.storage.mcap import BagTopic, LATEST, Logged
from scenario_gen.base.documents import shown
from scenario_gen.base.errors import guarded, InputError
from scenario_gen.types import Quality

NEEDED = {"topics": {"id", "name", "type"}, "messages": {"topic_id", "timestamp", "data"}}
STEPS = 1_000_000  # of SQLite's machine between two checks of a query
FREE_STEPS, STEPS_PER_BYTE = (
    50_000_000,
    10,
)  # a row has thirty bytes or more, and takes a hundred steps or fewer
BLOCK_BYTES = 1 << 20  # decompressed at a time
PACKED = {
    b"BZ": bz2.BZ2File,
    b"\x04\x22": lz4.frame.LZ4FrameFile,
}  # by how compressed chunks of ROS 1 begin
SQLITE_REMEDY = "copy it again, or save what is whole with `sqlite3 FILE .recover`"
ROS1_REMEDY = "copy it again, or run `rosbag reindex` on it"


class RosbagsFile:
    """An open file."""

    def __init__(self, reader: Any, file: Path, allowance: Allowance, remedy: str) -> None:
        """Take an open reader of rosbags, and the file that messages name."""
        self._reader, self._file, self._allowance, self._remedy = reader, file, allowance, remedy

    def list_topics(self) -> list[BagTopic]:
        """Return the topics.

        Raises:
            InputError: a name or a type is no text.
        """
        found = []
        for connection in self._reader.connections:
            if not all(isinstance(text, str) for text in (connection.topic, connection.msgtype)):
                raise InputError(
                    f"{self._file}: damaged, it has a topic {shown(connection.topic)} of {shown(connection.msgtype)}"
                )
            encoding = getattr(
                connection.ext, "serialization_format", "cdr"
            )  # of ROS 1 it will be
            name, kind, quality = connection.topic, connection.msgtype, _quality(connection.ext)
            found.append(
                BagTopic(name, kind, quality, connection.msgcount, connection.id, encoding)
            )
        return found

    def in_order(self, wanted: Collection[int]) -> Iterator[Logged]:
        """Yield the messages of some topics in order of their stamps, those of ROS 1 as CDR.

        Raises:
            InputError: the file is damaged, or a type of ROS 1 has other fields than ROS 2's of that name.
        """
        chosen = [connection for connection in self._reader.connections if connection.id in wanted]
        convert = {connection.id: self._converter(connection) for connection in chosen}
        rows = self._reader.messages(chosen)
        while True:
            with guarded(f"{self._file}: damaged", remedy=self._remedy):
                connection, stamp, data = next(rows, (None, 0, b""))
            if connection is None:
                return
            if (
                not isinstance(stamp, int)
                or not -LATEST <= stamp < LATEST
                or not isinstance(data, bytes)
            ):
                raise InputError(
                    f"{self._file}: damaged, a message has timestamp {shown(stamp)} and data {shown(data, 40)}"
                )
            self._allowance.unpack(len(data))
            yield stamp, connection.id, convert[connection.id](data)

    def _converter(self, connection: Any) -> Callable[[bytes], bytes]:
        """Return what turns a message of a topic into CDR."""
        if not isinstance(connection.ext, ConnectionExtRosbag1):
            return bytes
        where = f"{self._file}, topic {shown(connection.topic)}: no {shown(connection.msgtype)} of ROS 2"
        with guarded(where, remedy="choose other topics"):
            store = ros1_types(connection.msgtype, connection.msgdef.data)

        def convert(data: bytes) -> bytes:
            with guarded(where):
                return bytes(store.ros1_to_cdr(data, connection.msgtype))

        return convert


def _quality(ext: Any) -> Quality:
    """Return what the first publisher offered; a latched topic of ROS 1 keeps its last message."""
    if isinstance(ext, ConnectionExtRosbag1):
        return Quality(1 if ext.latching else 10, transient_local=bool(ext.latching))
    for offer in ext.offered_qos_profiles[:1]:
        depth = offer.depth if isinstance(offer.depth, int) else 10
        return Quality(
            max(1, depth),
            offer.reliability.name != "BEST_EFFORT",
            offer.durability.name == "TRANSIENT_LOCAL",
        )
    return Quality(10, transient_local=False)


@contextmanager
def open_sqlite(path: Path, file: Path, allowance: Allowance) -> Iterator[RosbagsFile]:
    """Open a database for reading, however its journal was left.

    Args:
        path: where it lies.
        file: its name in messages.
        allowance: the bag's.

    Raises:
        InputError: it is damaged, or no bag.
    """
    from rosbags.rosbag2 import Reader

    with guarded(f"{file}: damaged", remedy=SQLITE_REMEDY):
        _check_tables(path, file, allowance.config.most_chunk_bytes)
        reader = Reader(path)
        reader.open()
    with closing(reader):
        yield RosbagsFile(reader, file, allowance, SQLITE_REMEDY)


def _check_tables(path: Path, file: Path, most: int) -> None:
    """Refuse what would take a reader long, or much memory: views, values longer than `most` bytes, numbers given twice."""
    uri = f"file:{quote(str(path.absolute()))}?mode=ro&immutable=1"
    with closing(sqlite3.connect(uri, uri=True)) as base:
        base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, max(1000, most))
        left, looks = (
            (FREE_STEPS + STEPS_PER_BYTE * path.stat().st_size) // STEPS,
            itertools.count(),
        )
        base.set_progress_handler(lambda: next(looks) > left, STEPS)  # ends an endless query
        for table, needed in NEEDED.items():
            kinds = base.execute(
                "SELECT type FROM sqlite_master WHERE name = ?", (table,)
            ).fetchall()
            columns = {row[1] for row in base.execute(f"PRAGMA table_info({table})")}
            if kinds != [("table",)] or not needed <= columns:
                raise InputError(
                    f"{file}: no bag: it has no table {table} with {', '.join(sorted(needed))}"
                )
        base.execute("SELECT sum(length(data)), max(timestamp) FROM messages").fetchall()
        if base.execute("SELECT count(*) - count(DISTINCT id) FROM topics").fetchone()[0]:
            raise InputError(f"{file}: damaged, two topics have one id")


@contextmanager
def open_ros1(path: Path, allowance: Allowance) -> Iterator[RosbagsFile]:
    """Open a bag of ROS 1 for reading.

    Raises:
        InputError: it is damaged, was not closed, or decompresses to more than the bounds allow.
    """
    from rosbags.rosbag1 import Reader

    with guarded(f"{path}: cut off or damaged", remedy=ROS1_REMEDY):
        reader = Reader(path)
        reader.open()
    with closing(reader), path.open("rb") as stream:
        for chunk in reader.chunks.values():
            with guarded(
                f"{path}: cut off or damaged, at byte {chunk.datapos}", remedy=ROS1_REMEDY
            ):
                _check_chunk(stream, chunk.datapos, chunk.datasize, allowance)
        for connection in reader.connections:
            allowance.unpack(FOUND_BYTES * connection.msgcount)
        yield RosbagsFile(reader, path, allowance, ROS1_REMEDY)


def _check_chunk(stream: Any, start: int, length: int, allowance: Allowance) -> None:
    """Refuse a chunk that is cut off, or decompresses to more than the bounds allow."""
    most = allowance.config.most_chunk_bytes
    if length > most:
        raise InputError(
            f"{stream.name}: a chunk of {length} bytes at byte {start}; bag.most_chunk_bytes is {most}"
        )
    stream.seek(start)
    data = stream.read(length)
    if len(data) < length:
        raise ValueError(f"a chunk of {length} bytes is cut off after {len(data)}")
    if data[:2] not in PACKED:
        return
    size = 0
    with PACKED[data[:2]](io.BytesIO(data)) as unpacked:
        for block in iter(partial(unpacked.read, BLOCK_BYTES), b""):
            size += len(block)
            allowance.unpack(len(block))
            if size > most:
                raise InputError(
                    f"{stream.name}: a chunk at byte {start} decompresses to more than bag.most_chunk_bytes ({most})"
                )
