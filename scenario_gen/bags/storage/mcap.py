# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""MCAP files by the mcap library.

Its reader of whole files is used once the sizes that a file declares are within bounds. It reads
no file without a footer: of such a file the records up to the cut are read one by one.
"""

from bisect import bisect_left
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from itertools import chain, zip_longest
from operator import attrgetter
import os
from pathlib import Path
import struct
from typing import Any, BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Channel, Chunk, ChunkIndex, Footer, Message, Schema
from mcap.stream_reader import (
    breakup_chunk,
    get_chunk_data_stream,
    MAGIC_SIZE,
    StreamReader,
)

from scenario_gen.bags.storage.config import ReadBudget
from scenario_gen.bags.storage.messages import BagMessage, BagTopic
from scenario_gen.bags.storage.metadata import quality_of
from scenario_gen.base.documents import parse_yaml, shown
from scenario_gen.base.errors import describe, guarded, InputError

_MAX_STAMP_NS = 2**63  # rosbag2's stamps are signed
_EXTRA_RECORD_BYTES = 1024  # beside the data of a chunk
_RECORD = struct.Struct("<BQ")  # opcode and length
_MESSAGE_HEAD = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_STAMP = attrgetter("stamp_ns")


class McapFile:
    """An open MCAP file: a `StoredFile`."""

    def __init__(self, stream: BinaryIO, path: Path, budget: ReadBudget) -> None:
        """Read the summary, or else the file up to its cut.

        Args:
            stream: the file.
            path: its name in messages.
            budget: bounds of reading it.

        Raises:
            InputError: it is larger than the bounds allow, or a topic's type is missing.
        """
        self.missing = ""
        self._stream = stream
        self._size = os.fstat(stream.fileno()).st_size
        self._path = path
        self._budget = budget
        self._end = -1  # of the whole records, once it is known
        self._chunks: list[ChunkIndex] = []  # by time; none without a complete index
        indexed = self._indexed()
        self.topics = self._scanned() if indexed is None else indexed

    def _indexed(self) -> list[BagTopic] | None:
        """Return the topics by the summary; None if it has no complete index of messages.

        Raises:
            InputError: the file declares sizes above the bounds.
        """
        try:
            summary = SeekingReader(self._stream, record_size_limit=self._size).get_summary()
        except Exception:  # mcap raises various exceptions on damaged bytes
            return None
        if summary is None or summary.statistics is None:
            return None
        chunks, statistics = summary.chunk_indexes, summary.statistics
        counts = statistics.channel_message_counts
        if not chunks or statistics.chunk_count != len(chunks) or counts.keys() - summary.channels:
            return None
        for chunk in chunks:
            self._check_size(chunk)
        self._chunks = sorted(chunks, key=attrgetter("message_start_time"))
        return self._topics(summary.schemas, summary.channels, counts)

    def _scanned(self) -> list[BagTopic]:
        """Return the topics of the file's whole records, up to the first that is not whole.

        Raises:
            InputError: the file declares sizes above the bounds.
        """
        schemas: dict[int, Schema] = {}
        channels: dict[int, Channel] = {}
        counts: Counter[int] = Counter()
        offset = 0
        lines = []
        try:
            for record in self._records():
                offset = self._stream.tell()
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    channels[record.id] = record
                elif isinstance(record, Message):
                    counts[record.channel_id] += 1
        except InputError:
            raise
        except Exception as error:
            self._end = offset
            lines.append(
                f"{self._path}: not closed by its recorder, cut off or damaged: what follows byte "
                f"{offset} of {self._size} is missing ({describe(error)}); `mcap recover "
                f"{self._path.name}` makes a whole file of it"
            )
        if unnamed := counts.keys() - channels.keys():
            count = sum(counts[number] for number in unnamed)
            lines.append(f"{self._path}: damaged, the topic of {count} messages is missing")
        self.missing = "; ".join(lines)
        return self._topics(schemas, channels, counts)

    def _records(self) -> Iterator[Any]:
        """Yield the whole records up to the footer; the messages of a chunk, not the chunk.

        Raises:
            InputError: a chunk declares a size above the bounds.
            Exception: mcap's, at the first record that is not whole.
        """
        self._stream.seek(0)
        limit = min(self._size, self._budget.config.most_chunk_bytes + _EXTRA_RECORD_BYTES)
        reader = StreamReader(self._stream, emit_chunks=True, record_size_limit=limit)
        for record in reader.records:
            if isinstance(record, Footer):
                if (rest := self._size - self._stream.tell() - MAGIC_SIZE) > 0:
                    raise McapError(f"{rest} bytes follow the footer")
                return
            if isinstance(record, Chunk):
                self._check_size(record)
                yield from breakup_chunk(record, validate_crc=True)
            else:
                yield record
            if self._stream.tell() == self._end:
                return

    def _check_size(self, chunk: Any) -> None:
        """Check the declared size of a chunk or of its index.

        Raises:
            InputError: it, or that of all, is above the bounds.
        """
        size, max_bytes = chunk.uncompressed_size, self._budget.config.most_chunk_bytes
        if size > max_bytes:
            raise InputError(
                f"{self._path}: a chunk of {size} bytes; bag.most_chunk_bytes is {max_bytes}"
            )
        self._budget.spend_decompressed(size)

    def _topics(
        self,
        schemas: Mapping[int, Schema],
        channels: Mapping[int, Channel],
        counts: Mapping[int, int],
    ) -> list[BagTopic]:
        """Return the channels with their types and numbers of messages.

        Raises:
            InputError: the type of a channel is missing.
        """
        topics = []
        for number, channel in channels.items():
            schema = schemas.get(channel.schema_id)
            if channel.schema_id and schema is None:
                raise InputError(
                    f"{self._path}: damaged, the type of topic {shown(channel.topic)} is missing"
                )
            quality = quality_of(_profiles(channel.metadata.get("offered_qos_profiles", "")))
            kind, count = schema.name if schema else "", counts.get(number, 0)
            topics.append(
                BagTopic(channel.topic, kind, quality, count, number, channel.message_encoding)
            )
        return topics

    def messages(self, topics: Collection[BagTopic]) -> Iterator[BagMessage]:
        """Yield the messages of some topics by their stamps.

        Raises:
            InputError: the file is damaged, or larger than the bounds allow.
        """
        by_id = {topic.id: topic for topic in topics}
        parts = self._parts_by_time(by_id)
        n_missing = sum(topic.count for topic in topics)
        remedy = f"`mcap recover {self._path.name}` saves what is whole"
        with guarded(f"{self._path}: damaged", remedy=remedy):
            for part in parts:
                if part and part[-1].stamp_ns >= _MAX_STAMP_NS:
                    raise McapError(f"log time {part[-1].stamp_ns} ns is out of range")
                n_missing -= len(part)
                yield from part
            if n_missing > 0:
                raise McapError(f"{n_missing} messages cannot be read")

    def _parts_by_time(self, by_id: Mapping[int, BagTopic]) -> Iterator[list[BagMessage]]:
        """Yield the messages of some topics by their stamps, in parts."""
        if not self._chunks:
            records = (each for each in self._records() if isinstance(each, Message))
            messages = [
                BagMessage(by_id[m.channel_id].name, by_id[m.channel_id].type, m.data, m.log_time)
                for m in records
                if m.channel_id in by_id
            ]
            yield sorted(messages, key=_STAMP)
            return
        offsets = [chunk.message_index_offsets for chunk in self._chunks]
        used = [
            chunk
            for chunk, channels in zip(self._chunks, offsets, strict=True)
            if not channels or not channels.keys().isdisjoint(by_id)
        ]
        starts = [chunk.message_start_time for chunk in used[1:]]
        pending: list[BagMessage] = []
        for chunk, next_start in zip_longest(used, starts, fillvalue=2**64):
            pending = sorted(chain(pending, self._messages_in(chunk, by_id)), key=_STAMP)
            n_ready = bisect_left(pending, next_start, key=_STAMP)
            yield pending[:n_ready]
            pending = pending[n_ready:]

    def _messages_in(
        self, index: ChunkIndex, by_id: Mapping[int, BagTopic]
    ) -> Iterator[BagMessage]:
        """Yield the messages of some topics in a chunk; mcap's own loop takes ten times as long.

        Raises:
            McapError: the chunk is damaged.
        """
        self._stream.seek(index.chunk_start_offset + _RECORD.size)
        chunk = Chunk.read(ReadDataStream(self._stream))
        if chunk.uncompressed_size != index.uncompressed_size:
            raise McapError("the index has another size of a chunk")
        stream, size = get_chunk_data_stream(chunk, validate_crc=True)
        data = stream.read(size)
        end = 0
        while end < size:
            opcode, length = _RECORD.unpack_from(data, end)
            begin, end = end + _RECORD.size, end + _RECORD.size + length
            if opcode != Opcode.MESSAGE:
                continue
            channel, _, stamp_ns, _ = _MESSAGE_HEAD.unpack_from(data, begin)
            topic = by_id.get(channel)
            if topic is not None:
                content = data[begin + _MESSAGE_HEAD.size : end]
                yield BagMessage(topic.name, topic.type, content, stamp_ns)
        if end > size:
            raise McapError("a chunk ends within a record")


def _profiles(text: str) -> Any:
    """Return the offered profiles of a topic's metadata; none if they are damaged."""
    try:
        return parse_yaml(text, "offered_qos_profiles")
    except InputError:
        return None
