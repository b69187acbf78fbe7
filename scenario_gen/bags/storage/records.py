# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The records of an MCAP file (mcap.dev/spec), read with every length held against the bytes that are there.

The readers of mcap and rosbags trust the lengths that a file announces, so a damaged one takes all memory, or fails in any way.
Here single records are read by mcap through `Fields`, which is bounded, and damage is a `DamagedError` with its place: an error
for the reader of a bag, a gap for `reindex`.
"""

from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
import io
import struct
from typing import Any, BinaryIO
import zlib

import lz4.frame
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
import zstandard

from scenario_gen.bags.storage.config import Allowance, FOUND_BYTES
from scenario_gen.base.errors import guarded, ScenarioGenError

MAGIC = b"\x89MCAP0\r\n"
PROTOBUF = "protobuf"  # the encoding of schemas that are no texts
HEAD = struct.Struct("<BQ")
MESSAGE = struct.Struct("<HIQQ")
CHUNK = struct.Struct("<QQQI")
FOOTER_BYTES = 20
TAIL_BYTES = HEAD.size + FOOTER_BYTES + len(MAGIC)
LATEST = 2**63  # rosbag2's stamps are signed
_WINDOW = 128 * 1024**2  # zstd's own default


class DamagedError(ScenarioGenError):
    """There is no whole record at byte `offset` of a file; caught inside this package."""

    def __init__(self, offset: int, problem: str) -> None:
        super().__init__(f"byte {offset}: {problem}")
        self.offset = offset


@dataclass(frozen=True)
class Record:
    """A record in a file: its kind, where its content begins and how long that is."""

    opcode: int
    start: int
    length: int

    @property
    def end(self) -> int:
        """Where the next record begins."""
        return self.start + self.length


@dataclass(frozen=True)
class StoredTopic:
    """A topic in a file of any storage: its number there, name, type ("" if missing), QoS profiles, encoding, message count."""

    id: int
    name: str
    type: str
    qos: str
    encoding: str
    count: int


class Fields(ReadDataStream):  # type: ignore[misc]  # mcap has no types
    """The fields of one record as mcap reads them, but nothing is read beyond its end.

    Raises:
        DamagedError: from every method, where a field is longer than what is left, or a text is not UTF-8.
    """

    def __init__(self, data: bytes, offset: int) -> None:
        """Take the record's content and its offset in the file."""
        super().__init__(io.BytesIO(data))
        self._size, self._offset = len(data), offset

    def read(self, length: int) -> bytes:
        """Return the next bytes.

        Raises:
            DamagedError: so many are not left.
        """
        left = self._size - self.count
        if length > left:
            raise DamagedError(self._offset + self.count, f"{length} bytes are announced where {left} are left")
        data: bytes = super().read(length)
        return data

    def read_prefixed_string(self) -> str:
        """Return the text that follows its length."""
        return self.decoded(self.read(self.read4()))

    def decoded(self, data: bytes) -> str:
        """Return the text of bytes that were just read.

        Raises:
            DamagedError: it is not UTF-8.
        """
        try:
            return data.decode()
        except UnicodeDecodeError:
            raise DamagedError(self._offset + self.count - len(data), "a text is not UTF-8") from None


def read_schema(data: bytes, offset: int) -> Schema:
    """Return a Schema record, whose definition is a text, or descriptors of Protocol Buffers.

    Raises:
        DamagedError: it is neither, or cut off.
    """
    fields = Fields(data, offset)
    schema = Schema.read(fields)
    if schema.encoding != PROTOBUF:
        fields.decoded(schema.data)
    return schema


def records(file: BinaryIO, start: int, end: int) -> Iterator[Record]:
    """Yield the records from byte `start` to `end` without reading their contents.

    Raises:
        DamagedError: one is longer than what is left, or none.
    """
    while start < end:
        file.seek(start)
        head = file.read(min(HEAD.size, end - start))
        if len(head) < HEAD.size:
            raise DamagedError(start, f"a record is cut off after {len(head)} bytes")
        opcode, length = HEAD.unpack(head)
        if opcode == 0:
            raise DamagedError(start, "no record begins here")
        if length > end - start - HEAD.size:
            raise DamagedError(start, f"a record of {length} bytes is announced where {end - start - HEAD.size} are left")
        yield Record(opcode, start + HEAD.size, length)
        start += HEAD.size + length


def content(file: BinaryIO, record: Record, most: int) -> bytes:
    """Return the content of a record.

    Raises:
        DamagedError: it is longer than `most`, or the file has become shorter.
    """
    if record.length > most:
        raise DamagedError(record.start, f"a record of {record.length} bytes; bag.most_chunk_bytes is {most}")
    file.seek(record.start)
    data = file.read(record.length)
    if len(data) < record.length:
        raise DamagedError(record.start, "the file ends inside a record")
    return data


@dataclass(frozen=True)
class ChunkHead:
    """The head of a Chunk record: stamps [ns], size and checksum of its records, and where they lie in the file."""

    start_ns: int
    end_ns: int
    size: int
    crc: int
    compression: str
    records: Record


def read_chunk_head(data: bytes, record: Record) -> ChunkHead:
    """Return the head of a chunk whose content begins with `data`.

    Raises:
        DamagedError: its lengths contradict each other.
    """
    fields = Fields(data, record.start)
    start_ns, end_ns, size, crc = CHUNK.unpack(fields.read(CHUNK.size))
    compression = fields.read_prefixed_string()
    length = fields.read8()
    if fields.count + length != record.length:
        raise DamagedError(record.start, f"a chunk of {length} bytes does not fill its record of {record.length}")
    return ChunkHead(start_ns, end_ns, size, crc, compression, Record(Opcode.CHUNK, record.start + fields.count, length))


@dataclass
class Messages:
    """The messages of a block: for each its stamp, its channel and where its bytes lie."""

    stamps: Any = field(default_factory=lambda: array("Q"))
    channel_ids: Any = field(default_factory=lambda: array("H"))
    starts: Any = field(default_factory=lambda: array("Q"))
    lengths: Any = field(default_factory=lambda: array("Q"))

    def add(self, head: bytes, start: int, length: int, offset: int) -> None:
        """Add a message record that begins with `head`, at `start`; `offset` is its place in the file, for errors.

        Raises:
            DamagedError: it is none.
        """
        if length < MESSAGE.size or len(head) < MESSAGE.size:
            raise DamagedError(offset, f"a message record of {length} bytes")
        channel, _, stamp, _ = MESSAGE.unpack(head)
        if stamp >= LATEST:
            raise DamagedError(offset, f"a message is logged at {stamp} ns, later than a stamp can be")
        self.stamps.append(stamp)
        self.channel_ids.append(channel)
        self.starts.append(start + MESSAGE.size)
        self.lengths.append(length - MESSAGE.size)


@dataclass
class Contents(Messages):
    """The records of a chunk; its messages lie in `data`."""

    data: bytes = b""
    schemas: list[Schema] = field(default_factory=list)
    channels: list[Channel] = field(default_factory=list)
    damage: str = ""  # why the reading ended before the end of the chunk


def decompress(data: bytes, head: ChunkHead, allowance: Allowance) -> bytes:
    """Return the records of a chunk, of the size that its head announces and no more.

    Raises:
        DamagedError: it is too large, cannot be decompressed, or has not the size or checksum in its head.
        InputError: the bag as a whole is too large.
    """
    most, offset = allowance.config.most_chunk_bytes, head.records.start
    if head.size > most:
        raise DamagedError(offset, f"a chunk of {head.size} bytes after decompression; bag.most_chunk_bytes is {most}")
    allowance.unpack(head.size)
    try:
        with guarded(head.compression):
            raw = _unpacked(data, head.compression, head.size + 1)
    except ScenarioGenError as error:
        raise DamagedError(offset, f"a chunk cannot be decompressed ({error})") from error
    if len(raw) != head.size:
        raise DamagedError(offset, f"a chunk does not decompress to the {head.size} bytes that it announces")
    if head.crc and zlib.crc32(raw) != head.crc:
        raise DamagedError(offset, "the checksum of a chunk is another than it announces")
    return raw


def _unpacked(data: bytes, compression: str, most: int) -> bytes:
    """Decompress, to at most `most` bytes."""
    if compression == "zstd":
        with zstandard.ZstdDecompressor(max_window_size=_WINDOW).stream_reader(
            io.BytesIO(data), read_across_frames=True
        ) as reader:
            return bytes(reader.read(most))
    if compression == "lz4":
        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=most))
    if compression:
        raise ValueError("no compression that is known; zstd and lz4 are")
    return data


def read_contents(raw: bytes, offset: int, allowance: Allowance) -> Contents:
    """Find the records of a chunk; where one is damaged, the reading ends there and `damage` is set.

    Args:
        raw: the decompressed chunk.
        offset: where the chunk lies in the file, for messages.
        allowance: the bag's.

    Raises:
        InputError: the bag as a whole has too many messages.
    """
    found, at, end = Contents(data=raw), 0, len(raw)
    try:
        while at < end:
            if end - at < HEAD.size:
                raise DamagedError(offset, f"{end - at} bytes are left over at the end of a chunk")
            opcode, length = HEAD.unpack_from(raw, at)
            at += HEAD.size
            if opcode == 0 or length > end - at:
                raise DamagedError(offset, f"at byte {at - HEAD.size} of a chunk's {end} no whole record begins")
            if opcode == Opcode.MESSAGE:
                found.add(raw[at : at + MESSAGE.size], at, length, offset)
            elif opcode == Opcode.SCHEMA:
                found.schemas.append(read_schema(raw[at : at + length], offset))
            elif opcode == Opcode.CHANNEL:
                found.channels.append(Channel.read(Fields(raw[at : at + length], offset)))
            at += length
    except DamagedError as error:
        found.damage = str(error)
    allowance.unpack(FOUND_BYTES * len(found.stamps))
    return found
