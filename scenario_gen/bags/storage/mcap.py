# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""MCAP files by mcap's stream reader, with bounds.

mcap trusts the lengths that a file announces. Here no more is read than is there (`Exact`), and a chunk is decompressed to the
size that it announces and no more. Damage is a `DamagedError` with its place: an error for the reader of a bag, a gap for
`reindex`.
"""

from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
import heapq
import io
import mmap
import re
from typing import Any, BinaryIO
import zlib

import lz4.frame
from mcap.exceptions import EndOfFile, RecordLengthLimitExceeded
from mcap.records import Channel, Chunk, ChunkIndex, Footer, Header, Message, MessageIndex, Schema, Statistics
from mcap.stream_reader import StreamReader
import zstandard

from scenario_gen.bags.storage.config import Allowance, FOUND_BYTES
from scenario_gen.bags.storage.metadata import quality_of
from scenario_gen.base.documents import shown
from scenario_gen.base.errors import describe, guarded, InputError, ScenarioGenError
from scenario_gen.types import Quality

MAGIC = b"\x89MCAP0\r\n"
FOOTER_BYTES = 29  # of its record, which stands before the last magic
LATEST = 2**63  # rosbag2's stamps are signed
SLACK = 1024  # bytes that a record may have beside the content that is bounded
WINDOW = 128 * 1024**2  # zstd's own default [bytes]
CHUNK = re.compile(rb"(?=\x06.{4}\x00{4})", re.DOTALL)  # may begin the record of a chunk of less than 4 GiB
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


class Exact:
    """A stream of which a read gives as many bytes as it asks for."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        """Take a file and its size [bytes]."""
        self.size, self.seek, self.tell = size, file.seek, file.tell
        self._read = file.read

    def read(self, length: int) -> bytes:
        """Return the next bytes; none at the end, where mcap looks for a further record by its first byte.

        Raises:
            DamagedError: so many are not left.
        """
        left = self.size - self.tell()
        if length > left and (left or length > 1):
            raise DamagedError(self.tell(), f"{length} bytes are announced where {left} are left")
        return self._read(length)


def records(stream: Exact, most: int, *, magic: bool = False) -> Iterator[tuple[int, Any]]:
    """Yield the records from where a stream stands up to its end or its footer, each with the place from which it is found.

    Raises:
        DamagedError: one is damaged, or longer than `most` bytes.
    """
    reader = StreamReader(stream, skip_magic=not magic, emit_chunks=True, record_size_limit=most + SLACK)
    found, start = reader.records, stream.tell()
    while True:
        try:
            record = next(found)
        except StopIteration:
            return
        except EndOfFile:
            if stream.tell() != start:
                raise DamagedError(start, "a record is cut off") from None
            return
        except DamagedError:
            raise
        except RecordLengthLimitExceeded as error:
            raise DamagedError(start, f"{error}; bag.most_chunk_bytes is {most}") from error
        except Exception as error:  # mcap fails in any way on damaged bytes
            raise DamagedError(start, describe(error)) from error
        yield start, record
        start = stream.tell()


def unpacked(chunk: Chunk, offset: int, allowance: Allowance) -> bytes:
    """Return the records of a chunk.

    Raises:
        DamagedError: it is too large, cannot be decompressed, or has not the size or checksum that it announces.
        InputError: the bag as a whole is too large.
    """
    size, most = chunk.uncompressed_size, allowance.config.most_chunk_bytes
    if size > most:
        raise DamagedError(offset, f"a chunk of {size} bytes after decompression; bag.most_chunk_bytes is {most}")
    allowance.unpack(size)
    raw = chunk.data
    try:
        with guarded("a chunk cannot be decompressed"):
            if chunk.compression == "zstd":
                raw = decompressed(chunk.data, size)
            elif chunk.compression == "lz4":
                raw = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
            elif chunk.compression:
                raise ValueError(f"{chunk.compression!r} is unknown; zstd and lz4 are known")
    except InputError as error:
        raise DamagedError(offset, str(error)) from error
    if len(raw) != size or (chunk.uncompressed_crc and zlib.crc32(raw) != chunk.uncompressed_crc):
        raise DamagedError(offset, f"a chunk has not the {size} bytes or the checksum that it announces")
    return bytes(raw)


def decompressed(data: bytes, most: int) -> bytes:
    """Return what zstd compressed, or more than `most` bytes of it."""
    with zstandard.ZstdDecompressor(max_window_size=WINDOW).stream_reader(io.BytesIO(data), read_across_frames=True) as reader:
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
        self.stream, self.most = Exact(self.file, self.size), self.allowance.config.most_chunk_bytes
        self._lost = False  # whether the last chunk is, whose indexes follow

    def read_summary(self, footer: Footer) -> bool:
        """Read topics and places from the summary; return whether it has all of them.

        Raises:
            DamagedError: it is damaged.
        """
        statistics = None
        self.stream.seek(footer.summary_start)
        for _, record in records(self.stream, self.most) if footer.summary_start else ():
            if isinstance(record, Statistics):
                statistics = record
            elif isinstance(record, ChunkIndex):
                self.entries.append((record.message_start_time, record.chunk_start_offset))
            else:
                self._describe(record)
        if statistics is None or statistics.chunk_count != len(self.entries):
            return False
        self.counts = Counter(statistics.channel_message_counts)
        return bool(self.entries or not statistics.message_count) and set(self.counts) <= set(self.channels)

    def scan(self) -> None:
        """Read the whole file for topics and places; damage is noted among the gaps, and left out."""
        self.entries.clear()
        self.counts.clear()
        start = 0
        while start < self.size:
            self.stream.seek(start)
            try:
                for offset, record in records(self.stream, self.most, magic=not start):
                    start = offset
                    self._note(offset, record)
                    start = self.stream.tell()
                    self.closed = isinstance(record, Footer)
                return
            except DamagedError as error:
                after = self._next_chunk(start + 1)
                self.gaps.append(Gap(start, after - start, error.problem))
                start, self.closed = after, False

    def _note(self, offset: int, record: Any) -> None:
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
                self.gaps[-1] = replace(self.gaps[-1], messages=self.gaps[-1].messages + len(record.records))
            else:
                self._describe(record)
        except (DamagedError, InputError) as error:
            self.gaps.append(Gap(offset, self.stream.tell() - offset, getattr(error, "problem", str(error))))
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
                self.stream.seek(match.start())
                try:
                    _, record = next(records(self.stream, self.most), (0, None))
                    if isinstance(record, Chunk):
                        self.allowance.unpack(len(record.data))
                        unpacked(record, match.start(), self.allowance)
                        return match.start()
                except DamagedError:
                    continue
                except InputError:
                    break
        return self.size

    def _in_chunk(self, chunk: Chunk, offset: int, wanted: Collection[int] | None) -> Iterator[tuple[int, int, int, int, bytes]]:
        """Yield stamp, offset, number, channel and bytes of the messages of a chunk; learn what it says of topics."""
        raw = unpacked(chunk, offset, self.allowance)
        try:
            for number, (_, record) in enumerate(records(Exact(io.BytesIO(raw), len(raw)), self.most)):
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
            found.append(BagTopic(channel.topic, kind, quality, count, channel.id, channel.message_encoding))
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
                    raise DamagedError(offset, f"a message is logged at {message[0]} ns, before its chunk's start at {start} ns")
                heapq.heappush(heap, message)
        while heap:
            stamp, _, _, channel, data = heapq.heappop(heap)
            yield stamp, channel, data

    def _at(self, offset: int, wanted: Collection[int] | None) -> Iterator[tuple[int, int, int, int, bytes]]:
        """Yield the messages of the chunk, or the one outside of chunks, at a place, as `_in_chunk` does."""
        if offset >= self.size:
            raise DamagedError(offset, "a chunk is announced beyond the end of the file")
        self.stream.seek(offset)
        _, record = next(records(self.stream, self.most), (0, None))
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


def open_mcap(file: BinaryIO, size: int, allowance: Allowance, wanted: str | None = "ros2") -> McapFile:
    """Return the content of an MCAP file of `size` bytes, of the profile that is wanted, or of any (None).

    Raises:
        DamagedError: it is damaged, was not closed, or is of another profile.
    """
    found = McapFile(file, size, allowance)
    if size < len(MAGIC) or file.read(len(MAGIC)) != MAGIC:
        raise DamagedError(0, "not the beginning of an MCAP file")
    _, header = next(records(found.stream, found.most), (0, None))
    if not isinstance(header, Header):
        raise DamagedError(len(MAGIC), "no header at the beginning of the file")
    if wanted is not None and header.profile != wanted:
        raise DamagedError(len(MAGIC), f"the profile is {header.profile[:40]!r}, not {wanted!r}")
    end, footer = max(size - FOOTER_BYTES - len(MAGIC), 0), None
    found.stream.seek(end)
    with suppress(DamagedError):
        _, footer = next(records(found.stream, found.most), (0, None))
    if not isinstance(footer, Footer):
        raise DamagedError(end, "not the end of an MCAP file: its recorder was stopped, or it is cut off")
    if not found.read_summary(footer):
        found.scan()
        if found.gaps:
            raise DamagedError(found.gaps[0].offset, found.gaps[0].problem)
    return found
