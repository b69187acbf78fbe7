# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Whole MCAP files, read strictly: damage is an error."""

from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
import heapq
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.records import Channel, Header, Schema, Statistics
import numpy as np

from scenario_gen.bags.storage.config import Allowance
from scenario_gen.bags.storage.records import (
    ChunkHead,
    content,
    Contents,
    DamagedError,
    decompress,
    Fields,
    HEAD,
    LATEST,
    MAGIC,
    MESSAGE,
    Messages,
    read_chunk_head,
    read_contents,
    read_schema,
    Record,
    records,
    StoredTopic,
    TAIL_BYTES,
)

CHUNK_HEAD_BYTES = 64  # enough for the head of a chunk with any name of its compression
Logged = tuple[int, int, bytes]  # stamp [ns], channel, message


@dataclass(frozen=True)
class ChunkBlock:
    """A chunk: the stamp before which it has no message, and where it lies."""

    start_ns: int
    head: ChunkHead

    def contents(self, file: BinaryIO, allowance: Allowance) -> Contents:
        """Return its records, as far as they are whole.

        Raises:
            DamagedError: it cannot be decompressed.
        """
        data = content(file, self.head.records, allowance.config.most_chunk_bytes)
        return read_contents(decompress(data, self.head, allowance), self.head.records.start, allowance)


class LooseBlock(Messages):
    """Messages outside of chunks, one after the other in the file."""

    @property
    def start_ns(self) -> int:
        """Its first stamp."""
        return int(min(self.stamps))


Block = ChunkBlock | LooseBlock


@dataclass
class McapFile:
    """The content of an MCAP file: schemas and channels by id, blocks of messages, and their number by channel if it is known."""

    file: BinaryIO
    allowance: Allowance
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    blocks: list[Block] = field(default_factory=list)
    counts: dict[int, int] | None = None

    def take(self, record: Record) -> None:
        """Add a record at the top level of the file.

        Raises:
            DamagedError: its content is damaged.
        """
        most = self.allowance.config.most_chunk_bytes
        if record.opcode == Opcode.CHUNK:
            self.file.seek(record.start)
            head = read_chunk_head(self.file.read(min(CHUNK_HEAD_BYTES, record.length)), record)
            self.blocks.append(ChunkBlock(head.start_ns, head))
        elif record.opcode == Opcode.MESSAGE:
            if record.length > most:
                raise DamagedError(record.start, f"a message of {record.length} bytes; bag.most_chunk_bytes is {most}")
            last = self.blocks[-1] if self.blocks else None
            loose = last if isinstance(last, LooseBlock) else LooseBlock()
            self.file.seek(record.start)
            loose.add(self.file.read(MESSAGE.size), record.start, record.length, record.start)
            if loose is not last:
                self.blocks.append(loose)
        elif record.opcode == Opcode.SCHEMA:
            schema = read_schema(content(self.file, record, most), record.start)
            self.schemas[schema.id] = schema
        elif record.opcode == Opcode.CHANNEL:
            channel = Channel.read(Fields(content(self.file, record, most), record.start))
            self.channels[channel.id] = channel
        elif record.opcode == Opcode.STATISTICS:
            self.counts = Statistics.read(Fields(content(self.file, record, most), record.start)).channel_message_counts

    def learn(self, contents: Contents) -> None:
        """Add the schemas and channels of a chunk."""
        self.schemas |= {schema.id: schema for schema in contents.schemas}
        self.channels |= {channel.id: channel for channel in contents.channels}

    def list_topics(self) -> list[StoredTopic]:
        """Return the channels, with their types and numbers of messages.

        Raises:
            DamagedError: a chunk is damaged.
        """
        self.complete()
        found = []
        for channel in self.channels.values():
            kind = self.schemas[channel.schema_id].name if channel.schema_id in self.schemas else ""
            qos, count = channel.metadata.get("offered_qos_profiles", ""), (self.counts or {}).get(channel.id, 0)
            found.append(StoredTopic(channel.id, channel.topic, kind, qos, channel.message_encoding, count))
        return found

    def complete(self) -> None:
        """Read the chunks for channels and numbers of messages, if the file has no summary of them.

        Raises:
            DamagedError: a chunk is damaged.
        """
        if self.counts is not None and self.channels:
            return
        counts: Counter[int] = Counter()
        for block in self.blocks:
            if isinstance(block, ChunkBlock):
                contents = block.contents(self.file, self.allowance)
                self.learn(contents)
                counts.update(contents.channel_ids)
            else:
                counts.update(block.channel_ids)
        self.counts = dict(counts)

    def messages(self, block: Block, wanted: Collection[int] | None, *, strict: bool = True) -> Iterator[Logged]:
        """Yield the messages of a block in order of their stamps, of the channels that are wanted (None: of all).

        Raises:
            DamagedError: the block is damaged; not if `strict` is false and only its end is.
        """
        if isinstance(block, ChunkBlock):
            contents = block.contents(self.file, self.allowance)
            if strict and contents.damage:
                raise DamagedError(block.head.records.start, contents.damage)
            found: Messages = contents
        else:
            found = block
        order = np.argsort(np.frombuffer(found.stamps, dtype=np.uint64), kind="stable") if found.stamps else ()
        for k in order:
            stamp, channel, start, length = (a[k] for a in (found.stamps, found.channel_ids, found.starts, found.lengths))
            if stamp < block.start_ns and strict:
                raise DamagedError(start, f"a message is logged at {stamp} ns, before its chunk's start at {block.start_ns} ns")
            if wanted is not None and channel not in wanted:
                continue
            if isinstance(block, ChunkBlock):
                yield stamp, channel, contents.data[start : start + length]
            else:
                self.allowance.unpack(length)
                record = Record(Opcode.MESSAGE, start, length)
                yield stamp, channel, content(self.file, record, self.allowance.config.most_chunk_bytes)

    def in_order(self, wanted: Collection[int] | None, *, strict: bool = True) -> Iterator[Logged]:
        """Yield messages in order of their stamps, those of one stamp in the order of the file."""
        heap: list[tuple[int, int, Logged, Iterator[Logged]]] = []

        def advance(place: int, rest: Iterator[Logged]) -> None:
            message = next(rest, None)
            if message is not None:
                heapq.heappush(heap, (message[0], place, message, rest))

        def before(stamp: int) -> Iterator[Logged]:
            while heap and heap[0][0] < stamp:
                _, place, message, rest = heapq.heappop(heap)
                yield message
                advance(place, rest)

        for place, block in sorted(enumerate(self.blocks), key=lambda entry: entry[1].start_ns):
            yield from before(block.start_ns)
            advance(place, self.messages(block, wanted, strict=strict))
        yield from before(LATEST)


def open_mcap(file: BinaryIO, size: int, allowance: Allowance, wanted: str | None = "ros2") -> McapFile:
    """Return the content of an MCAP file of `size` bytes, of the profile that is wanted, or of any (None).

    Raises:
        DamagedError: it is damaged, was not closed, or is of another profile.
    """
    if size < len(MAGIC) + HEAD.size or file.read(len(MAGIC)) != MAGIC:
        raise DamagedError(0, "not the beginning of an MCAP file")
    footer = size - TAIL_BYTES
    file.seek(max(footer, 0))
    tail = file.read(TAIL_BYTES)
    opcode, length = HEAD.unpack_from(tail)
    if (
        footer < len(MAGIC)
        or not tail.endswith(MAGIC)
        or (opcode, length) != (Opcode.FOOTER, TAIL_BYTES - HEAD.size - len(MAGIC))
    ):
        raise DamagedError(max(footer, 0), "not the end of an MCAP file: its recorder was stopped, or it is cut off")
    found = McapFile(file, allowance)
    whole = records(file, len(MAGIC), size - len(MAGIC))
    first = next(whole)
    if first.opcode != Opcode.HEADER:
        raise DamagedError(first.start, "no header at the beginning of the file")
    profile = Header.read(Fields(content(file, first, allowance.config.most_chunk_bytes), first.start)).profile
    if wanted is not None and profile != wanted:
        raise DamagedError(first.start, f"the profile is {profile[:40]!r}, not {wanted!r}")
    for record in whole:
        found.take(record)
    return found
