# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""SQLite bags, bags that rosbag2 compressed, and ROS 1 bags, read by rosbags."""

import bz2
from collections.abc import Callable, Collection, Iterator
from contextlib import closing, contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import lz4.frame
from rosbags.interfaces import ConnectionExtRosbag1

from scenario_gen.bags.storage.config import ReadBudget
from scenario_gen.bags.storage.definitions import ros1_types
from scenario_gen.bags.storage.messages import BagMessage, BagTopic
from scenario_gen.bags.storage.metadata import quality_of
from scenario_gen.base.documents import shown
from scenario_gen.base.errors import guarded, InputError
from scenario_gen.types import Quality

_OPENERS: dict[bytes, Callable[[Any], Any]] = {b"BZ": bz2.open, b"\x04\x22": lz4.frame.open}
_REMEDIES = {
    ".db3": "copy it again, or recover what is whole with `sqlite3 FILE .recover`",
    ".bag": "copy it again, or run `rosbag reindex` on it",
}


class RosbagsFile:
    """An open file or folder of a bag: a `StoredFile`, which is read whole or not at all."""

    missing = ""

    def __init__(self, reader: Any, path: Path) -> None:
        """Use an open reader of rosbags; `path` appears in messages.

        Raises:
            InputError: the name or the type of a topic is not a text.
        """
        self._reader = reader
        self._path = path
        self.topics = [self._topic(connection) for connection in reader.connections]

    def _topic(self, connection: Any) -> BagTopic:
        name, kind, ext = connection.topic, connection.msgtype, connection.ext
        if not isinstance(name, str) or not isinstance(kind, str):
            raise InputError(
                f"{self._path}: damaged, it has a topic {shown(name)} of type {shown(kind)}"
            )
        if isinstance(ext, ConnectionExtRosbag1):  # a latched topic repeats its last message
            quality = Quality(1 if ext.latching else 10, transient_local=bool(ext.latching))
        else:
            quality = quality_of([profile._asdict() for profile in ext.offered_qos_profiles])
        # Messages of ROS 1 are converted to CDR.
        encoding = getattr(ext, "serialization_format", "cdr")
        return BagTopic(name, kind, quality, connection.msgcount, connection.id, encoding)

    def messages(self, topics: Collection[BagTopic]) -> Iterator[BagMessage]:
        """Yield the messages of some topics by their stamps; those of ROS 1 as CDR.

        Raises:
            InputError: the file is damaged, or a type of ROS 1 has other fields than in ROS 2.
        """
        ids = {topic.id for topic in topics}
        chosen = [connection for connection in self._reader.connections if connection.id in ids]
        converters = {connection.id: self._converter(connection) for connection in chosen}
        with guarded(f"{self._path}: damaged", remedy=_REMEDIES.get(self._path.suffix, "")):
            for connection, stamp_ns, data in self._reader.messages(chosen):
                if not isinstance(stamp_ns, int) or not isinstance(data, bytes):  # SQLite has any
                    raise InputError(
                        f"{self._path}: damaged, a message has timestamp {shown(stamp_ns)} and "
                        f"data {shown(data, 40)}"
                    )
                converted = converters[connection.id](data)
                yield BagMessage(connection.topic, connection.msgtype, converted, stamp_ns)

    def _converter(self, connection: Any) -> Callable[[bytes], bytes]:
        """Return a function that converts the messages of a topic to CDR."""
        if not isinstance(connection.ext, ConnectionExtRosbag1):
            return bytes
        kind = connection.msgtype
        where = f"{self._path}, topic {shown(connection.topic)}: not a {shown(kind)} of ROS 2"
        with guarded(where, remedy="choose other topics"):
            store = ros1_types(kind, connection.msgdef.data)

        def convert(data: bytes) -> bytes:
            with guarded(where):
                return bytes(store.ros1_to_cdr(data, kind))

        return convert


@contextmanager
def open_with_rosbags(path: Path, budget: ReadBudget) -> Iterator[RosbagsFile]:
    """Open a file, or the folder of a bag that rosbag2 compressed.

    Raises:
        InputError: it is damaged, was not closed, or decompresses to more than the bounds allow.
    """
    from rosbags.rosbag1 import Reader as Ros1Reader
    from rosbags.rosbag2 import Reader

    is_ros1 = path.suffix == ".bag"
    where, remedy = f"{path}: cut off or damaged", _REMEDIES.get(path.suffix, "")
    with guarded(where, remedy=remedy):
        reader: Any = Ros1Reader(path) if is_ros1 else Reader(path)
        reader.open()
    with closing(reader):
        if is_ros1:
            with guarded(where, remedy=remedy):
                _check_chunks(path, reader.chunks.values(), budget)
        yield RosbagsFile(reader, path)


def _check_chunks(path: Path, chunks: Collection[Any], budget: ReadBudget) -> None:
    """Refuse the chunks of a ROS 1 bag that decompress to more than the bounds allow."""
    max_bytes = budget.config.most_chunk_bytes
    with path.open("rb") as stream:
        for chunk in chunks:
            stream.seek(chunk.datapos)
            data = stream.read(min(chunk.datasize, max_bytes + 1))
            if opener := _OPENERS.get(data[:2]):
                data = opener(BytesIO(data)).read(max_bytes + 1)
            if len(data) > max_bytes:
                raise InputError(
                    f"{path}: the chunk at byte {chunk.datapos} exceeds bag.most_chunk_bytes "
                    f"({max_bytes})"
                )
