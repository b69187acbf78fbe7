# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""MCAP files, read within bounds, whole or damaged.

The mcap library decodes each record. Its readers are not used, since they trust the lengths that
a file declares and stop at the first damage. Here each declared length is checked before bytes
are read or decompressed, and damage is a `DamagedError` with its place: an error for the reader of
a bag, a gap for `reindex`.

Source: MCAP file format specification, https://mcap.dev/spec.
"""

from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, replace
import heapq
import io
import mmap
import re
import struct
from typing import Any, BinaryIO, NamedTuple
import zlib

import lz4.frame
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    Footer,
    Header,
    MessageIndex,
    Schema,
    Statistics,
)
import zstandard

from scenario_gen.bags.storage.config import FIND_COST_BYTES, ReadBudget
from scenario_gen.bags.storage.metadata import quality_of
from scenario_gen.base.documents import shown
from scenario_gen.base.errors import describe, InputError, ScenarioGenError
from scenario_gen.types import Quality

MAX_STAMP_NS = 2**63
"""Stamps of rosbag2 are signed."""

_MAGIC = b"\x89MCAP0\r\n"
_PREFIX_BYTES = 9  # opcode and length of a record
_FOOTER_BYTES = 29  # with its prefix
_EXTRA_RECORD_BYTES = 1024  # beside the data of a chunk
_MESSAGE_OPCODE = int(Opcode.MESSAGE)
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_CHUNK_START = re.compile(rb"(?=\x06.{4}\x00{4})", re.DOTALL)  # of less than 4 GiB
_RECORDS: dict[int, Any] = {
    Opcode.HEADER: Header,
    Opcode.FOOTER: Footer,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.CHUNK: Chunk,
    Opcode.MESSAGE_INDEX: MessageIndex,
    Opcode.CHUNK_INDEX: ChunkIndex,
    Opcode.STATISTICS: Statistics,
}


class DamagedError(ScenarioGenError):
    """There is no whole record at byte `offset` of a file; caught inside this package."""

    def __init__(self, offset: int, problem: str) -> None:
        super().__init__(f"byte {offset}: {problem}")
        self.offset = offset
        self.problem = problem


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


@dataclass(frozen=True)
class Gap:
    """Skipped bytes: the first one, their number, the problem, and the known messages in them."""

    offset: int
    size: int
    problem: str
    messages: int = 0


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


def _decompress_chunk(chunk: Chunk, offset: int, budget: ReadBudget) -> bytes:
    """Return the records of a chunk.

    Raises:
        DamagedError: the chunk is too large, cannot be decompressed, or does not have the size or
            checksum that it declares.
        InputError: the bag as a whole is too large.
    """
    size = chunk.uncompressed_size
    max_bytes = budget.config.most_chunk_bytes
    if size > max_bytes:
        raise DamagedError(
            offset,
            f"a chunk of {size} bytes after decompression; bag.most_chunk_bytes is {max_bytes}",
        )
    budget.spend_decompressed(size)
    try:
        match chunk.compression:
            case "zstd":
                data = decompress_zstd(chunk.data, size)
            case "lz4":
                decompressor = lz4.frame.LZ4FrameDecompressor()
                data = decompressor.decompress(chunk.data, max_length=size + 1)
            case "":
                data = chunk.data
            case unknown:
                raise DamagedError(
                    offset, f"compression {shown(unknown, 40)!r} is unknown (known: zstd, lz4)"
                )
    except (zstandard.ZstdError, RuntimeError, MemoryError, EOFError) as error:
        raise DamagedError(
            offset, f"a chunk cannot be decompressed ({describe(error)})"
        ) from error
    crc = chunk.uncompressed_crc  # 0: not computed
    if len(data) != size or (crc and zlib.crc32(data) != crc):
        raise DamagedError(offset, f"a chunk differs from its declared size ({size}) or checksum")
    return bytes(data)


def _split_records(data: bytes, offset: int) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of the records in some bytes from byte `offset` of a file.

    Raises:
        DamagedError: a record is cut off.
    """
    start = 0
    while start < len(data):
        content_start = start + _PREFIX_BYTES
        end = content_start + int.from_bytes(data[start + 1 : content_start], "little")
        if data[start] == 0 or end > len(data):
            raise DamagedError(offset, "a record is cut off")
        yield data[start], data[content_start:end]
        start = end


def _decode(opcode: int, content: bytes, offset: int) -> Any:
    """Return a record: a LoggedMessage, or a class of mcap.records; None if it is not needed.

    Raises:
        DamagedError: it is damaged.
    """
    try:
        if opcode == _MESSAGE_OPCODE:
            channel_id, _, stamp_ns, _ = _MESSAGE.unpack_from(content)
            if stamp_ns >= MAX_STAMP_NS:
                raise ValueError(f"log time {stamp_ns} ns is out of range")
            return LoggedMessage(stamp_ns, offset, 0, channel_id, content[_MESSAGE.size :])
        kind = _RECORDS.get(opcode)
        return kind and kind.read(ReadDataStream(io.BytesIO(content)))
    except Exception as error:  # mcap raises various exceptions on damaged bytes
        raise DamagedError(offset, describe(error)) from error


@dataclass
class McapFile:
    """Contents of an MCAP file.

    Attributes:
        file: the open file.
        size: its size in bytes.
        budget: bounds of reading it.
        schemas: by id.
        channels: by id.
        counts: number of messages by channel.
        entries: lower bound of the stamps [ns] in a chunk, or in a message outside of chunks, and
            its offset.
        gaps: skipped bytes, in order.
        closed: whether the recorder closed the file.
    """

    file: BinaryIO
    size: int
    budget: ReadBudget
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: Counter[int] = field(default_factory=Counter)
    entries: list[tuple[int, int]] = field(default_factory=list)
    gaps: list[Gap] = field(default_factory=list)
    closed: bool = False

    def _read(self, start: int, size: int) -> bytes:
        """Return bytes of the file.

        Raises:
            DamagedError: the file ends before, or they are more than the bounds allow.
        """
        left = self.size - start
        max_bytes = self.budget.config.most_chunk_bytes
        if not 0 <= size <= left:
            raise DamagedError(start, f"{size} bytes are declared, {left} are left")
        if size > max_bytes + _EXTRA_RECORD_BYTES:
            raise DamagedError(
                start, f"a record of {size} bytes; bag.most_chunk_bytes is {max_bytes}"
            )
        self.file.seek(start)
        return self.file.read(size)

    def record(self, offset: int) -> tuple[Any, int]:
        """Return the record at an offset, None if it is not needed, and the next offset.

        Raises:
            DamagedError: there is none, or it is damaged or too large.
        """
        prefix = self._read(offset, _PREFIX_BYTES)
        length = int.from_bytes(prefix[1:], "little")
        start = offset + _PREFIX_BYTES
        if prefix[0] == 0 or length > self.size - start:
            raise DamagedError(
                offset, f"{length} bytes are declared, {self.size - start} are left"
            )
        if prefix[0] not in _RECORDS and prefix[0] != _MESSAGE_OPCODE:
            return None, start + length
        return _decode(prefix[0], self._read(start, length), offset), start + length

    def has_magic(self, offset: int) -> bool:
        """Return whether MCAP's magic bytes are at an offset."""
        return offset + len(_MAGIC) <= self.size and self._read(offset, len(_MAGIC)) == _MAGIC

    def footer_offset(self) -> int:
        """Return where the footer begins in a file that was closed."""
        return max(self.size - _FOOTER_BYTES - len(_MAGIC), 0)

    def read_summary(self, footer: Footer) -> bool:
        """Read topics and chunks from the summary; return whether it is complete.

        Raises:
            DamagedError: it is damaged.
        """
        start: int = footer.summary_start
        if not start:
            return False
        statistics = None
        for opcode, content in _split_records(
            self._read(start, self.footer_offset() - start), start
        ):
            record = _decode(opcode, content, start)
            if isinstance(record, Statistics):
                statistics = record
            elif isinstance(record, ChunkIndex):
                self.entries.append((record.message_start_time, record.chunk_start_offset))
            else:
                self._describe(record)
        if statistics is None or statistics.chunk_count != len(self.entries):
            return False
        self.counts = Counter(statistics.channel_message_counts)
        is_chunked = bool(self.entries) or not statistics.message_count
        return is_chunked and self.counts.keys() <= self.channels.keys()

    def scan(self) -> None:
        """Read the whole file for topics and messages; damaged parts become gaps."""
        self.entries.clear()
        self.counts.clear()
        offset = len(_MAGIC)
        if not self.has_magic(0):
            offset = self._skip_to_chunk(0, "the file does not begin as MCAP")
        while offset < self.size and not self.closed:
            try:
                record, next_offset = self.record(offset)
            except DamagedError as error:
                offset = self._skip_to_chunk(offset, error.problem)
                continue
            self._register(offset, record, next_offset)
            self.closed = isinstance(record, Footer) and self.has_magic(next_offset)
            offset = next_offset

    def _skip_to_chunk(self, offset: int, problem: str) -> int:
        """Note a gap up to the next whole chunk, or to the end of the file; return its end."""
        end = self._next_chunk(offset + 1)
        self.gaps.append(Gap(offset, end - offset, problem))
        return end

    def _next_chunk(self, start: int) -> int:
        """Return where the next whole chunk begins; the size of the file if there is none."""
        if start >= self.size:
            return self.size
        with mmap.mmap(self.file.fileno(), self.size, access=mmap.ACCESS_READ) as data:
            for match in _CHUNK_START.finditer(data, start):
                try:
                    chunk, _ = self.record(match.start())
                    self.budget.spend_decompressed(len(chunk.data))
                    _decompress_chunk(chunk, match.start(), self.budget)
                    return match.start()
                except DamagedError:
                    continue
                except InputError:
                    break
        return self.size

    def _register(self, offset: int, record: Any, next_offset: int) -> None:
        """Register a record at the top level of the file, or note that its content is lost."""
        last_gap = self.gaps[-1] if self.gaps else None
        try:
            if isinstance(record, (Chunk, LoggedMessage)):
                messages = list(self._messages_of(record, offset, None))
                first_ns = min((message.stamp_ns for message in messages), default=0)
                self.entries.append((first_ns, offset))
                self.counts.update(message.channel_id for message in messages)
            elif isinstance(record, MessageIndex) and last_gap and self._follows_gap(offset):
                known = last_gap.messages + len(record.records)
                size = next_offset - last_gap.offset
                self.gaps[-1] = replace(last_gap, messages=known, size=size)
            else:
                self._describe(record)
        except (DamagedError, InputError) as error:
            problem = error.problem if isinstance(error, DamagedError) else str(error)
            self.gaps.append(Gap(offset, next_offset - offset, problem))

    def _follows_gap(self, offset: int) -> bool:
        """Return whether the last gap ends at an offset."""
        return bool(self.gaps) and self.gaps[-1].offset + self.gaps[-1].size == offset

    def _describe(self, record: Any) -> None:
        """Remember a schema or a channel."""
        if isinstance(record, Schema):
            self.schemas[record.id] = record
        elif isinstance(record, Channel):
            self.channels[record.id] = record

    def list_topics(self) -> list[BagTopic]:
        """Return the channels with their types and numbers of messages.

        Raises:
            DamagedError: the type of a channel is missing.
        """
        topics = []
        for channel in self.channels.values():
            schema = self.schemas.get(channel.schema_id)
            if channel.schema_id and schema is None:
                raise DamagedError(0, f"the type of topic {shown(channel.topic)} is missing")
            topic = BagTopic(
                name=channel.topic,
                type=schema.name if schema else "",
                quality=quality_of(channel.metadata.get("offered_qos_profiles", "")),
                count=self.counts[channel.id],
                id=channel.id,
                encoding=channel.message_encoding,
            )
            topics.append(topic)
        return topics

    def messages(self, channels: Collection[int] | None = None) -> Iterator[LoggedMessage]:
        """Yield the messages of some channels (None: all) by their stamps, then by their place.

        Raises:
            DamagedError: a chunk is damaged.
        """
        heap: list[LoggedMessage] = []
        for start_ns, offset in sorted(self.entries):
            while heap and heap[0].stamp_ns < start_ns:
                yield heapq.heappop(heap)
            record, _ = self.record(offset)
            if not isinstance(record, (Chunk, LoggedMessage)):
                raise DamagedError(offset, "the index names a chunk that is not there")
            for message in self._messages_of(record, offset, channels):
                if message.stamp_ns < start_ns:
                    raise DamagedError(
                        offset,
                        f"a message is logged at {message.stamp_ns} ns, before the start of its "
                        f"chunk at {start_ns} ns",
                    )
                heapq.heappush(heap, message)
        while heap:
            yield heapq.heappop(heap)

    def _messages_of(
        self, record: Chunk | LoggedMessage, offset: int, channels: Collection[int] | None
    ) -> Iterator[LoggedMessage]:
        """Yield the messages of a chunk, or a message outside of chunks; register topics.

        Raises:
            DamagedError: the chunk is damaged.
        """
        if isinstance(record, LoggedMessage):
            self.budget.spend_decompressed(len(record.data) + FIND_COST_BYTES)
            if channels is None or record.channel_id in channels:
                yield record
            return
        data = _decompress_chunk(record, offset, self.budget)
        for number, (opcode, content) in enumerate(_split_records(data, offset)):
            inner = _decode(opcode, content, offset)
            if not isinstance(inner, LoggedMessage):
                self._describe(inner)
                continue
            self.budget.spend_decompressed(FIND_COST_BYTES)
            if channels is None or inner.channel_id in channels:
                yield inner._replace(number=number)


def open_mcap(file: BinaryIO, size: int, budget: ReadBudget) -> McapFile:
    """Return the contents of an MCAP file of `size` bytes.

    Raises:
        DamagedError: it is damaged, or was not closed.
        InputError: its messages are those of ROS 1.
    """
    mcap = McapFile(file, size, budget)
    if not mcap.has_magic(0):
        raise DamagedError(0, "the file does not begin as MCAP")
    header, _ = mcap.record(len(_MAGIC))
    if not isinstance(header, Header):
        raise DamagedError(len(_MAGIC), "the file has no header")
    if header.profile == "ros1":
        raise InputError(
            f"{file.name}: an MCAP file of profile 'ros1'; name the .bag file of its messages"
        )
    try:
        footer, _ = mcap.record(mcap.footer_offset())
    except DamagedError:
        footer = None
    if not isinstance(footer, Footer):
        raise DamagedError(
            mcap.footer_offset(),
            "the file has no footer: its recorder was killed, or it is cut off",
        )
    if not mcap.read_summary(footer):
        mcap.scan()
        if mcap.gaps:
            raise DamagedError(mcap.gaps[0].offset, mcap.gaps[0].problem)
    return mcap
