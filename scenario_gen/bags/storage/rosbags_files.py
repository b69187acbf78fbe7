# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""SQLite bags and ROS 1 bags, read by rosbags once their tables or chunks are within bounds."""

import bz2
from collections.abc import Callable, Collection, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
import sqlite3
from typing import Any
from urllib.parse import quote

import lz4.frame
from rosbags.interfaces import ConnectionExtRosbag1

from scenario_gen.bags.storage.config import FIND_COST_BYTES, ReadBudget
from scenario_gen.bags.storage.definitions import ros1_types
from scenario_gen.bags.storage.mcap import BagTopic, LoggedMessage, MAX_STAMP_NS
from scenario_gen.base.documents import shown
from scenario_gen.base.errors import guarded, InputError
from scenario_gen.types import Quality

_COLUMNS = {"topics": {"id", "name", "type"}, "messages": {"topic_id", "timestamp", "data"}}
_DECOMPRESSORS: dict[bytes, Any] = {
    b"BZ": bz2.BZ2Decompressor,
    b"\x04\x22": lz4.frame.LZ4FrameDecompressor,
}
_SQLITE_REMEDY = "copy it again, or recover what is whole with `sqlite3 FILE .recover`"
_ROS1_REMEDY = "copy it again, or run `rosbag reindex` on it"


class RosbagsFile:
    """An open file of a bag; such files are read whole or not at all."""

    missing = ""

    def __init__(self, reader: Any, file: Path, remedy: str) -> None:
        """Use an open reader of rosbags; `file` and `remedy` appear in messages."""
        self._reader = reader
        self._file = file
        self._remedy = remedy

    def list_topics(self) -> list[BagTopic]:
        """Return the topics.

        Raises:
            InputError: a name or a type is not a text.
        """
        topics = []
        for connection in self._reader.connections:
            name, kind = connection.topic, connection.msgtype
            if not isinstance(name, str) or not isinstance(kind, str):
                raise InputError(
                    f"{self._file}: damaged, it has a topic {shown(name)} of type {shown(kind)}"
                )
            # Messages of ROS 1 are converted to CDR.
            encoding = getattr(connection.ext, "serialization_format", "cdr")
            quality = _quality(connection.ext)
            topics.append(
                BagTopic(name, kind, quality, connection.msgcount, connection.id, encoding)
            )
        return topics

    def messages(self, channels: Collection[int]) -> Iterator[LoggedMessage]:
        """Yield the messages of some topics by their stamps; those of ROS 1 as CDR.

        Raises:
            InputError: the file is damaged, or a type of ROS 1 has other fields than in ROS 2.
        """
        chosen = [
            connection for connection in self._reader.connections if connection.id in channels
        ]
        converters = {connection.id: self._converter(connection) for connection in chosen}
        rows = self._reader.messages(chosen)
        while True:
            with guarded(f"{self._file}: damaged", remedy=self._remedy):
                row = next(rows, None)
            if row is None:
                return
            connection, stamp_ns, data = row
            is_stamp = isinstance(stamp_ns, int) and -MAX_STAMP_NS <= stamp_ns < MAX_STAMP_NS
            if not is_stamp or not isinstance(data, bytes):
                raise InputError(
                    f"{self._file}: damaged, a message has timestamp {shown(stamp_ns)} and data "
                    f"{shown(data, 40)}"
                )
            yield LoggedMessage(stamp_ns, 0, 0, connection.id, converters[connection.id](data))

    def _converter(self, connection: Any) -> Callable[[bytes], bytes]:
        """Return a function that converts the messages of a topic to CDR."""
        if not isinstance(connection.ext, ConnectionExtRosbag1):
            return bytes
        kind = connection.msgtype
        where = f"{self._file}, topic {shown(connection.topic)}: not a {shown(kind)} of ROS 2"
        with guarded(where, remedy="choose other topics"):
            store = ros1_types(kind, connection.msgdef.data)

        def convert(data: bytes) -> bytes:
            with guarded(where):
                return bytes(store.ros1_to_cdr(data, kind))

        return convert


def _quality(ext: Any) -> Quality:
    """Return the quality of the first publisher; a latched topic repeats its last message."""
    if isinstance(ext, ConnectionExtRosbag1):
        return Quality(1 if ext.latching else 10, transient_local=bool(ext.latching))
    if not ext.offered_qos_profiles:
        return Quality(10, transient_local=False)
    profile = ext.offered_qos_profiles[0]
    return Quality(
        depth=max(1, profile.depth) if isinstance(profile.depth, int) else 10,
        reliable=profile.reliability.name != "BEST_EFFORT",
        transient_local=profile.durability.name == "TRANSIENT_LOCAL",
    )


@contextmanager
def open_sqlite(path: Path, file: Path) -> Iterator[RosbagsFile]:
    """Open a database for reading, in whatever state its journal is.

    Args:
        path: the database.
        file: its name in messages.

    Raises:
        InputError: it is damaged, or not a bag.
    """
    from rosbags.rosbag2 import Reader

    with guarded(f"{file}: damaged", remedy=_SQLITE_REMEDY):
        _check_tables(path, file)
        reader = Reader(path)
        reader.open()
    with closing(reader):
        yield RosbagsFile(reader, file, _SQLITE_REMEDY)


def _check_tables(path: Path, file: Path) -> None:
    """Refuse views and computed columns, which may have any number of rows and bytes."""
    uri = f"file:{quote(str(path.absolute()))}?mode=ro&immutable=1"
    with closing(sqlite3.connect(uri, uri=True)) as database:
        for table, needed in _COLUMNS.items():
            query = "SELECT type FROM sqlite_master WHERE name = ?"
            kinds = database.execute(query, (table,)).fetchall()
            columns = {row[1] for row in database.execute(f"PRAGMA table_info({table})")}
            if kinds != [("table",)] or not needed <= columns:
                raise InputError(
                    f"{file}: not a bag, it has no table {table} with {', '.join(sorted(needed))}"
                )


@contextmanager
def open_ros1(path: Path, budget: ReadBudget) -> Iterator[RosbagsFile]:
    """Open a ROS 1 bag for reading.

    Raises:
        InputError: it is damaged, was not closed, or decompresses to more than the bounds allow.
    """
    from rosbags.rosbag1 import Reader

    problem = f"{path}: cut off or damaged"
    with guarded(problem, remedy=_ROS1_REMEDY):
        reader = Reader(path)
        reader.open()
    with closing(reader), path.open("rb") as stream:
        for chunk in reader.chunks.values():
            stream.seek(chunk.datapos)
            data = stream.read(min(chunk.datasize, budget.config.most_chunk_bytes + 1))
            with guarded(f"{problem}, at byte {chunk.datapos}", remedy=_ROS1_REMEDY):
                _check_chunk(f"{path}: the chunk at byte {chunk.datapos}", data, budget)
        for connection in reader.connections:
            budget.spend_decompressed(FIND_COST_BYTES * connection.msgcount)
        yield RosbagsFile(reader, path, _ROS1_REMEDY)


def _check_chunk(place: str, data: bytes, budget: ReadBudget) -> None:
    """Refuse a chunk that decompresses to more than the bounds allow, or is followed by others."""
    max_bytes = budget.config.most_chunk_bytes
    decompressor = _DECOMPRESSORS.get(data[:2])
    if decompressor is not None:
        opened = decompressor()
        data = opened.decompress(data, max_length=max_bytes + 1)
        if opened.unused_data:
            raise InputError(f"{place}: damaged, its data go on behind the compressed ones")
    if len(data) > max_bytes:
        raise InputError(f"{place} exceeds bag.most_chunk_bytes ({max_bytes})")
    budget.spend_decompressed(len(data))
