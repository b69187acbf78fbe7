# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""MCAP files by mcap's stream reader, with bounds.

mcap trusts the lengths that a file announces. Here it is given one record at a time, of a size that is there and within bounds,
and a chunk is decompressed to the size that it announces and no more. Damage is a `DamagedError` with its place: an error for the
reader of a bag, a gap for `reindex`.
"""

from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, replace
import heapq
import io
import mmap
import re
from typing import Any, BinaryIO
import zlib

import lz4.frame
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    Footer,
    Header,
    Message,
    MessageIndex,
    Schema,
    Statistics,
)
from mcap.stream_reader import StreamReader
import zstandard

from scenario_gen.bags.storage.config import Allowance, FOUND_BYTES
from scenario_gen.bags.storage.metadata import quality_of
from scenario_gen.base.documents import shown
from scenario_gen.base.errors import describe, InputError, ScenarioGenError
from scenario_gen.types import Quality

MAGIC = b"\x89MCAP0\r\n"
HEAD_BYTES, FOOTER_BYTES = (
    9,
    29,
)  # of any record's kind and length, and of the footer's record, before the last magic
OPCODES = frozenset(
    (*range(Opcode.HEADER, Opcode.CHUNK_INDEX + 1), Opcode.STATISTICS)
)  # of records that matter here
LATEST = 2**63  # rosbag2's stamps are signed
SLACK = 1024  # bytes that a record may have beside the content that is bounded
WINDOW = 128 * 1024**2  # zstd's own default [bytes]
CHUNK = re.compile(
    rb"(?=\x06.{4}\x00{4})", re.DOTALL
)  # may begin the record of a chunk of less than 4 GiB
Logged = tuple[int, int, bytes]  # stamp [ns], channel, message


class DamagedError(ScenarioGenError):
    """There is no whole record at byte `offset` of a file; caught inside this package."""

    def __init__(self, offset: int, problem: str) -> None:
        super().__init__(f"byte {offset}: {problem}")
        self.offset, self.problem = offset, problem


@dataclass(frozen=True)
class BagTopic:
    """A topic of a bag: its full name, type ("" if it has none), what its first publisher offered, its number of messages.

    In one file it has an `id`, too, and an `encoding`.
    """

    name: str
    type: str
    quality: Quality
    count: int
    id: int = 0
    encoding: str = "cdr"


@dataclass(frozen=True)
class Gap:
    """Bytes that were passed over: the first one, how many, why, and how many messages were in them as far as known."""

    offset: int
    size: int
    problem: str
    messages: int = 0


def parsed(data: bytes, offset: int) -> Iterator[Any]:
    """Yield the records in some bytes, which lie at byte `offset` of a file.

    Raises:
        DamagedError: one is damaged.
    """
    stream = io.BytesIO(data)
    found = StreamReader(
        stream, skip_magic=True, emit_chunks=True, record_size_limit=len(data)
    ).records
    while stream.tell() < len(data):
        try:
            yield next(found)
        except StopIteration:
            return
        except EndOfFile:
            raise DamagedError(offset, "a record is cut off") from None
        except Exception as error:  # mcap fails in any way on damaged bytes
            raise DamagedError(offset, describe(error)) from error


def unpacked(chunk: Chunk, offset: int, allowance: Allowance) -> bytes:
    """Return the records of a chunk.

    Raises:
        DamagedError: it is too large, cannot be decompressed, or has not the size or checksum that it announces.
        InputError: the bag as a whole is too large.
    """
    size, most = chunk.uncompressed_size, allowance.config.most_chunk_bytes
    if size > most:
        raise DamagedError(
            offset, f"a chunk of {size} bytes after decompression; bag.most_chunk_bytes is {most}"
        )
    allowance.unpack(size)
    raw = chunk.data
    try:
        if chunk.compression == "zstd":
            raw = decompressed(raw, size)
        elif chunk.compression == "lz4":
            raw = lz4.frame.LZ4FrameDecompressor().decompress(raw, max_length=size + 1)
        elif chunk.compression:
            raise DamagedError(
                offset,
                f"compression {shown(chunk.compression, 40)!r} is unknown; zstd and lz4 are known",
            )
    except (zstandard.ZstdError, RuntimeError, MemoryError, EOFError) as error:
        raise DamagedError(
            offset, f"a chunk cannot be decompressed ({describe(error)})"
        ) from error
    if len(raw) != size or (chunk.uncompressed_crc and zlib.crc32(raw) != chunk.uncompressed_crc):
        raise DamagedError(
            offset, f"a chunk has not the {size} bytes or the checksum that it announces"
        )
    return bytes(raw)


def decompressed(data: bytes, most: int) -> bytes:
    """Return what zstd compressed, or more than `most` bytes of it."""
    with zstandard.ZstdDecompressor(max_window_size=WINDOW).stream_reader(
        io.BytesIO(data), read_across_frames=True
    ) as reader:
        return bytes(reader.read(most + 1))


@dataclass
class McapFile:
    """What is in an MCAP file: schemas and channels by id, messages by channel, and where they lie.

    Attributes:
        entries: a stamp [ns] before which a chunk, or a message outside of chunks, has nothing, and its offset.
        gaps: what was passed over, in order.
        closed: whether its recorder closed the file.
    """

    file: BinaryIO
    size: int
    allowance: Allowance
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: Counter[int] = field(default_factory=Counter)
    entries: list[tuple[int, int]] = field(default_factory=list)
    gaps: list[Gap] = field(default_factory=list)
    closed: bool = False

    def __post_init__(self) -> None:
        self._lost = False  # whether the last chunk is, whose indexes follow

    def _bytes(self, start: int, size: int) -> bytes:
        """Return bytes of the file.

        Raises:
            DamagedError: there are not so many, or they are more than the bounds allow.
        """
        left, most = self.size - start, self.allowance.config.most_chunk_bytes
        if not 0 <= size <= left:
            raise DamagedError(start, f"{size} bytes are announced where {left} are left")
        if size > most + SLACK:
            raise DamagedError(start, f"a record of {size} bytes; bag.most_chunk_bytes is {most}")
        self.file.seek(start)
        return self.file.read(size)

    def record(self, offset: int) -> tuple[Any, int]:
        """Return the record at a place, None if it is of no kind that matters here, and where the next one begins.

        Raises:
            DamagedError: there is none, or it is damaged or too large.
        """
        head = self._bytes(offset, HEAD_BYTES)
        length, start = int.from_bytes(head[1:], "little"), offset + HEAD_BYTES
        if head[0] == 0 or length > self.size - start:
            raise DamagedError(
                offset, f"{length} bytes are announced where {self.size - start} are left"
            )
        if head[0] not in OPCODES:
            return None, start + length
        return next(parsed(head + self._bytes(start, length), offset), None), start + length

    def read_summary(self, footer: Footer) -> bool:
        """Read topics and places from the summary; return whether it has all of them.

        Raises:
            DamagedError: it is damaged.
        """
        statistics, start = None, footer.summary_start
        for record in parsed(self._bytes(start, self.size - start), start) if start else ():
            if isinstance(record, Statistics):
                statistics = record
            elif isinstance(record, ChunkIndex):
                self.entries.append((record.message_start_time, record.chunk_start_offset))
            else:
                self._describe(record)
        if statistics is None or statistics.chunk_count != len(self.entries):
            return False
        self.counts = Counter(statistics.channel_message_counts)
        return bool(self.entries or not statistics.message_count) and set(self.counts) <= set(
            self.channels
        )

    def scan(self) -> None:
        """Read the whole file for topics and places; damage is noted among the gaps, and left out."""
        self.entries.clear()
        self.counts.clear()
        start = 0
        while start < self.size and not self.closed:
            try:
                if not start and self._bytes(0, len(MAGIC)) != MAGIC:
                    raise DamagedError(0, "not the beginning of an MCAP file")
                record, after = self.record(start or len(MAGIC))
                self._note(start or len(MAGIC), record, after)
                self.closed = (
                    isinstance(record, Footer) and self._bytes(after, len(MAGIC)) == MAGIC
                )
            except DamagedError as error:
                after = self._next_chunk(start + 1)
                self.gaps.append(Gap(start, after - start, error.problem))
            start = after

    def _note(self, offset: int, record: Any, after: int) -> None:
        """Take a record at the top level of the file, or note that it is lost."""
        try:
            if isinstance(record, Chunk):
                self._lost = False
                messages = list(self._in_chunk(record, offset, None))
                self.entries.append((min((message[0] for message in messages), default=0), offset))
                self.counts.update(message[3] for message in messages)
            elif isinstance(record, Message):
                self.entries.append((_stamp(record, offset), offset))
                self.counts[record.channel_id] += 1
            elif isinstance(record, MessageIndex) and self._lost:
                self.gaps[-1] = replace(
                    self.gaps[-1], messages=self.gaps[-1].messages + len(record.records)
                )
            else:
                self._describe(record)
        except (DamagedError, InputError) as error:
            self.gaps.append(Gap(offset, after - offset, getattr(error, "problem", str(error))))
            self._lost = True

    def _describe(self, record: Any) -> None:
        """Learn of a schema or a channel."""
        if isinstance(record, Schema):
            self.schemas[record.id] = record
        elif isinstance(record, Channel):
            self.channels[record.id] = record

    def _next_chunk(self, start: int) -> int:
        """Return where the next whole chunk from byte `start` begins; the size of the file if there is none."""
        with mmap.mmap(self.file.fileno(), self.size, access=mmap.ACCESS_READ) as data:
            for match in CHUNK.finditer(data, start):
                try:
                    record, _ = self.record(match.start())
                    self.allowance.unpack(len(record.data))
                    unpacked(record, match.start(), self.allowance)
                    return match.start()
                except DamagedError:
                    continue
                except InputError:
                    break
        return self.size

    def _in_chunk(
        self, chunk: Chunk, offset: int, wanted: Collection[int] | None
    ) -> Iterator[tuple[int, int, int, int, bytes]]:
        """Yield stamp, offset, number, channel and bytes of the messages of a chunk; learn what it says of topics."""
        raw = unpacked(chunk, offset, self.allowance)
        try:
            for number, record in enumerate(parsed(raw, offset)):
                if not isinstance(record, Message):
                    self._describe(record)
                    continue
                self.allowance.unpack(FOUND_BYTES)
                if wanted is None or record.channel_id in wanted:
                    yield _stamp(record, offset), offset, number, record.channel_id, record.data
        except DamagedError as error:
            raise DamagedError(offset, f"in a chunk: {error.problem}") from error

    def list_topics(self) -> list[BagTopic]:
        """Return the channels, with their types and numbers of messages.

        Raises:
            DamagedError: the type of one is missing that should be there.
        """
        found = []
        for channel in self.channels.values():
            if channel.schema_id and channel.schema_id not in self.schemas:
                raise DamagedError(0, f"the type of topic {shown(channel.topic)} is missing")
            kind = self.schemas[channel.schema_id].name if channel.schema_id else ""
            quality = quality_of(channel.metadata.get("offered_qos_profiles", ""))
            count = self.counts[channel.id]
            found.append(
                BagTopic(channel.topic, kind, quality, count, channel.id, channel.message_encoding)
            )
        return found

    def in_order(self, wanted: Collection[int] | None) -> Iterator[Logged]:
        """Yield messages of some channels (None: all) in order of their stamps, those of one stamp in the order of the file.

        Raises:
            DamagedError: a chunk is damaged.
        """
        heap: list[tuple[int, int, int, int, bytes]] = []
        for start, offset in sorted(self.entries):
            while heap and heap[0][0] < start:
                stamp, _, _, channel, data = heapq.heappop(heap)
                yield stamp, channel, data
            for message in self._at(offset, wanted):
                if message[0] < start:
                    raise DamagedError(
                        offset,
                        f"a message is logged at {message[0]} ns, before its chunk's start at {start} ns",
                    )
                heapq.heappush(heap, message)
        while heap:
            stamp, _, _, channel, data = heapq.heappop(heap)
            yield stamp, channel, data

    def _at(
        self, offset: int, wanted: Collection[int] | None
    ) -> Iterator[tuple[int, int, int, int, bytes]]:
        """Yield the messages of the chunk, or the one outside of chunks, at a place, as `_in_chunk` does."""
        record, _ = self.record(offset)
        if isinstance(record, Chunk):
            yield from self._in_chunk(record, offset, wanted)
        elif not isinstance(record, Message):
            raise DamagedError(offset, "no chunk where one is announced")
        elif wanted is None or record.channel_id in wanted:
            self.allowance.unpack(len(record.data) + FOUND_BYTES)
            yield _stamp(record, offset), offset, 0, record.channel_id, record.data


def _stamp(message: Message, offset: int) -> int:
    stamp: int = message.log_time
    if stamp >= LATEST:
        raise DamagedError(offset, f"a message is logged at {stamp} ns, later than a stamp can be")
    return stamp


def open_mcap(file: BinaryIO, size: int, allowance: Allowance) -> McapFile:
    """Return the content of an MCAP file of `size` bytes.

    Raises:
        DamagedError: it is damaged, or was not closed.
        InputError: its messages are of ROS 1.
    """
    found = McapFile(file, size, allowance)
    if size < len(MAGIC) or file.read(len(MAGIC)) != MAGIC:
        raise DamagedError(0, "not the beginning of an MCAP file")
    header, _ = found.record(len(MAGIC))
    if not isinstance(header, Header):
        raise DamagedError(len(MAGIC), "no header at the beginning of the file")
    if header.profile == "ros1":
        raise InputError(
            f"{file.name}: an MCAP file of profile 'ros1'; name the .bag file that it was made of"
        )
    end = max(size - FOOTER_BYTES - len(MAGIC), 0)
    try:
        footer, _ = found.record(end)
    except DamagedError:
        footer = None
    if not isinstance(footer, Footer):
        raise DamagedError(
            end, "not the end of an MCAP file: its recorder was stopped, or it is cut off"
        )
    if not found.read_summary(footer):
        found.scan()
        if found.gaps:
            raise DamagedError(found.gaps[0].offset, found.gaps[0].problem)
    return found
