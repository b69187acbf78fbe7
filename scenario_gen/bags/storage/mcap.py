# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""MCAP files by the mcap library: sizes are checked before bytes are read, up to a cut.

The library's readers are not used for messages: they trust the sizes that a file declares, and
read no file without a footer. Its records are, one at a time.
"""

from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
import heapq
import io
import os
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple
import zlib

import lz4.frame
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Channel, Chunk, Footer, Message, Schema
from mcap.stream_reader import MAGIC_SIZE, StreamReader
import zstandard

from scenario_gen.bags.storage.config import FIND_COST_BYTES, ReadBudget
from scenario_gen.bags.storage.metadata import quality_of
from scenario_gen.base.documents import shown
from scenario_gen.base.errors import describe, guarded, InputError
from scenario_gen.types import Quality

MAX_STAMP_NS = 2**63
"""Stamps of rosbag2 are signed."""

_PREFIX_BYTES = 9  # opcode and length of a record
_EXTRA_RECORD_BYTES = 1024  # beside the data of a chunk
_NEEDED = (Opcode.FOOTER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.CHUNK)


@dataclass(frozen=True)
class BagTopic:
    """A topic of a bag.

    Attributes:
        name: full name.
        type: "" if it has none.
        quality: offered by its first publisher.
        count: number of its messages.
        id: its number in one file.
        encoding: of its messages, in one file.
    """

    name: str
    type: str
    quality: Quality
    count: int
    id: int = 0
    encoding: str = "cdr"


class LoggedMessage(NamedTuple):
    """A message in a file; sorted by stamp, then by its place."""

    stamp_ns: int
    offset: int
    number: int
    channel_id: int
    data: bytes


def decompress_zstd(data: bytes, max_bytes: int) -> bytes:
    """Return the first `max_bytes` + 1 decompressed bytes at most."""
    decompressor = zstandard.ZstdDecompressor(max_window_size=128 * 1024**2)  # zstd's default
    with decompressor.stream_reader(io.BytesIO(data), read_across_frames=True) as reader:
        return bytes(reader.read(max_bytes + 1))


def _decompress(chunk: Chunk) -> bytes:
    """Return the records of a chunk of the size and checksum that it declares.

    Raises:
        McapError: it has others.
        Exception: that of the decompressor.
    """
    size = chunk.uncompressed_size
    match chunk.compression:
        case "zstd":
            data = decompress_zstd(chunk.data, size)
        case "lz4":
            data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
        case "":
            data = chunk.data
        case unknown:
            raise McapError(f"compression {shown(unknown, 40)!r} is unknown (known: zstd, lz4)")
    crc = chunk.uncompressed_crc  # 0: not computed
    if len(data) != size or (crc and zlib.crc32(data) != crc):
        raise McapError(f"a chunk differs from its declared size ({size}) or checksum")
    return bytes(data)


def _records(data: bytes) -> Iterator[Any]:
    """Yield the records in the data of a chunk."""
    stream = io.BytesIO(data)
    records = StreamReader(stream, skip_magic=True, emit_chunks=True).records
    while stream.tell() < len(data):
        yield next(records)


class McapFile:
    """An open MCAP file.

    Attributes:
        missing: "" if the file is whole, else a line that says what cannot be read.
    """

    def __init__(self, stream: BinaryIO, path: Path, budget: ReadBudget) -> None:
        """Read the summary, or else the file up to its cut.

        Args:
            stream: the file.
            path: its name in messages.
            budget: bounds of reading it.

        Raises:
            InputError: it is larger than the bounds allow.
        """
        self.missing = ""
        self._stream = stream
        self._size = os.fstat(stream.fileno()).st_size
        self._path = path
        self._budget = budget
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._counts: Counter[int] = Counter()
        self._entries: list[tuple[int, int]] = []  # first stamp and offset of chunks or messages
        if not self._has_summary():
            self._scan()

    def _has_summary(self) -> bool:
        """Read topics and chunks from the summary; return whether it is whole."""
        try:
            reader = SeekingReader(self._stream, record_size_limit=self._size)
            summary = reader.get_summary()
        except Exception:  # mcap raises various exceptions on damaged bytes
            return False
        if summary is None or summary.statistics is None:
            return False
        statistics, chunks = summary.statistics, summary.chunk_indexes
        counts = statistics.channel_message_counts
        if statistics.chunk_count != len(chunks) or not counts.keys() <= summary.channels.keys():
            return False
        self._schemas, self._channels = summary.schemas, summary.channels
        self._counts = Counter(counts)
        self._entries = [(chunk.message_start_time, chunk.chunk_start_offset) for chunk in chunks]
        return bool(chunks) or not statistics.message_count

    def _scan(self) -> None:
        """Read the file for topics and messages, up to the first record that is not whole.

        Raises:
            InputError: it is larger than the bounds allow.
        """
        self._entries, self._counts, offset = [], Counter(), 0
        try:
            self._stream.seek(0)
            SeekingReader(self._stream).get_header()
            offset = MAGIC_SIZE
            record: Any = None
            while not isinstance(record, Footer):
                record, end = self._record(offset)
                messages = list(self._messages_of(record, offset))
                if messages:
                    self._entries.append((min(messages).stamp_ns, offset))
                    self._counts.update(message.channel_id for message in messages)
                offset = end
        except InputError:
            raise
        except Exception as error:
            self.missing = (
                f"{self._path}: not closed by its recorder, cut off or damaged: what follows byte "
                f"{offset} of {self._size} is missing ({describe(error)}); `mcap recover "
                f"{self._path.name}` makes a whole file of it"
            )

    def _record(self, offset: int) -> tuple[Any, int]:
        """Return the record at an offset, None if it is not needed, and the next offset.

        Raises:
            InputError: it is larger than the bounds allow.
            Exception: mcap's, if it is not whole.
        """
        self._stream.seek(offset)
        prefix = self._stream.read(_PREFIX_BYTES)
        length = int.from_bytes(prefix[1:], "little")
        end = offset + _PREFIX_BYTES + length
        if len(prefix) < _PREFIX_BYTES or not prefix[0] or end > self._size:
            raise McapError("no whole record")
        if prefix[0] not in _NEEDED:
            return None, end
        self._check_size(length - _EXTRA_RECORD_BYTES, offset)
        stream = io.BytesIO(prefix + self._stream.read(length))
        return next(StreamReader(stream, skip_magic=True, emit_chunks=True).records), end

    def _check_size(self, size: int, offset: int) -> None:
        max_bytes = self._budget.config.most_chunk_bytes
        if size > max_bytes:
            raise InputError(
                f"{self._path}: a chunk of {size} bytes at byte {offset}; bag.most_chunk_bytes "
                f"is {max_bytes}"
            )

    def _messages_of(self, record: Any, offset: int) -> Iterator[LoggedMessage]:
        """Yield the messages of a chunk, or one outside of chunks; remember topics.

        Raises:
            InputError: they are larger than the bounds allow.
            Exception: mcap's, if they are damaged.
        """
        records: Iterable[Any] = [record]
        if isinstance(record, Chunk):
            self._check_size(record.uncompressed_size, offset)
            self._budget.spend_decompressed(record.uncompressed_size)
            records = _records(_decompress(record))
        for number, each in enumerate(records):
            if isinstance(each, Schema):
                self._schemas[each.id] = each
            elif isinstance(each, Channel):
                self._channels[each.id] = each
            elif isinstance(each, Message):
                self._budget.spend_decompressed(FIND_COST_BYTES)
                if each.log_time >= MAX_STAMP_NS:
                    raise McapError(f"log time {each.log_time} ns is out of range")
                yield LoggedMessage(each.log_time, offset, number, each.channel_id, each.data)

    def list_topics(self) -> list[BagTopic]:
        """Return the channels with their types and numbers of messages.

        Raises:
            InputError: the type of a channel is missing.
        """
        topics = []
        for channel in self._channels.values():
            schema = self._schemas.get(channel.schema_id)
            if channel.schema_id and schema is None:
                raise InputError(
                    f"{self._path}: damaged, the type of topic {shown(channel.topic)} is missing"
                )
            topic = BagTopic(
                name=channel.topic,
                type=schema.name if schema else "",
                quality=quality_of(channel.metadata.get("offered_qos_profiles", "")),
                count=self._counts[channel.id],
                id=channel.id,
                encoding=channel.message_encoding,
            )
            topics.append(topic)
        return topics

    def messages(self, channels: Collection[int]) -> Iterator[LoggedMessage]:
        """Yield the messages of some channels by their stamps, then by their place.

        Raises:
            InputError: a chunk is damaged, or larger than the bounds allow.
        """
        heap: list[LoggedMessage] = []
        for start_ns, offset in sorted(self._entries):
            while heap and heap[0].stamp_ns < start_ns:
                yield heapq.heappop(heap)
            damage = f"{self._path}: damaged at byte {offset}"
            with guarded(damage, remedy=f"`mcap recover {self._path.name}` saves what is whole"):
                record, _ = self._record(offset)
                if not isinstance(record, (Chunk, Message)):
                    raise McapError("the index names a chunk that is not there")
                for message in self._messages_of(record, offset):
                    if message.stamp_ns < start_ns:
                        raise McapError(
                            f"a message is logged at {message.stamp_ns} ns, before the start of "
                            f"its chunk at {start_ns} ns"
                        )
                    if message.channel_id in channels:
                        heapq.heappush(heap, message)
        while heap:
            yield heapq.heappop(heap)
