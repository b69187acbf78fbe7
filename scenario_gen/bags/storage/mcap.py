# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""MCAP files by the mcap library.

Its reader of whole files is used once the sizes that a file declares are within bounds. It reads
no file without a footer: of such a file the records up to the cut are read one by one.
"""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from operator import attrgetter
import os
from pathlib import Path
from typing import Any, BinaryIO

from mcap.exceptions import McapError
from mcap.reader import SeekingReader
from mcap.records import Channel, Chunk, Footer, Message, Schema
from mcap.stream_reader import breakup_chunk, MAGIC_SIZE, StreamReader

from scenario_gen.bags.storage.config import ReadBudget
from scenario_gen.bags.storage.messages import BagMessage, BagTopic
from scenario_gen.bags.storage.metadata import quality_of
from scenario_gen.base.documents import parse_yaml
from scenario_gen.base.errors import describe, guarded, InputError

_MAX_STAMP_NS = 2**63  # rosbag2's stamps are signed
_EXTRA_RECORD_BYTES = 1024  # beside the data of a chunk
_SIZE_OFFSET_BYTES = 25  # of a chunk's size: behind opcode, length, and two stamps


class McapFile:
    """An open MCAP file: a `StoredFile`."""

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
        self._end = -1  # of the whole records, once it is known
        indexed = self._indexed()
        self._is_indexed = indexed is not None
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
        offsets = [chunk.chunk_start_offset for chunk in chunks]
        if max(offsets) >= self._size or not all(each.message_index_offsets for each in chunks):
            return None
        for offset in offsets:
            self._stream.seek(offset + _SIZE_OFFSET_BYTES)
            self._check_size(int.from_bytes(self._stream.read(8), "little"))
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
                self._check_size(record.uncompressed_size)
                yield from breakup_chunk(record, validate_crc=True)
            else:
                yield record
            if self._stream.tell() == self._end:
                return

    def _check_size(self, size: int) -> None:
        """Check the size that a chunk declares.

        Raises:
            InputError: it is above the bound.
        """
        max_bytes = self._budget.config.most_chunk_bytes
        if size > max_bytes:
            raise InputError(
                f"{self._path}: a chunk of {size} bytes; bag.most_chunk_bytes is {max_bytes}"
            )

    def _topics(
        self,
        schemas: Mapping[int, Schema],
        channels: Mapping[int, Channel],
        counts: Mapping[int, int],
    ) -> list[BagTopic]:
        """Return the channels with their types, "" if one is missing, and numbers of messages."""
        topics = []
        for number, channel in channels.items():
            schema = schemas.get(channel.schema_id)
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
        n_missing = sum(topic.count for topic in topics)
        remedy = f"`mcap recover {self._path.name}` saves what is whole"
        with guarded(f"{self._path}: damaged", remedy=remedy):
            for message in self._by_time({topic.name for topic in topics}):
                topic = by_id.get(message.channel_id)
                if topic is None:
                    continue
                if message.log_time >= _MAX_STAMP_NS:
                    raise McapError(f"log time {message.log_time} ns is out of range")
                n_missing -= 1
                yield BagMessage(topic.name, topic.type, message.data, message.log_time)
            if n_missing > 0:
                raise McapError(f"{n_missing} messages cannot be read")

    def _by_time(self, names: Collection[str]) -> Iterator[Message]:
        """Yield the messages by time; of a whole file those of some topics, chunk by chunk."""
        self._stream.seek(0)
        if self._is_indexed:
            reader = SeekingReader(self._stream, validate_crcs=True, record_size_limit=self._size)
            yield from (message for _, _, message in reader.iter_messages(names))
            return
        records = (each for each in self._records() if isinstance(each, Message))
        yield from sorted(records, key=attrgetter("log_time"))


def _profiles(text: str) -> Any:
    """Return the offered profiles of a topic's metadata; none if they are damaged."""
    try:
        return parse_yaml(text, "offered_qos_profiles")
    except InputError:
        return None
