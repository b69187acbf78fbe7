# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Any rosbag2 bag, MCAP or SQLite, of one or several files, as raw messages in order of their stamps."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, ExitStack
from dataclasses import dataclass, replace
import heapq
import io
from pathlib import Path
import tempfile
from typing import BinaryIO

import zstandard

from scenario_gen.bags.storage.config import Allowance, BagConfig
from scenario_gen.bags.storage.files import files_of, METADATA
from scenario_gen.bags.storage.mcap import McapFile, open_mcap
from scenario_gen.bags.storage.metadata import quality_of
from scenario_gen.bags.storage.records import DamagedError, StoredTopic
from scenario_gen.bags.storage.sqlite import open_sqlite, SqliteFile
from scenario_gen.base.documents import shown
from scenario_gen.base.errors import guarded, InputError
from scenario_gen.base.folders import scratch
from scenario_gen.types import Quality

COPIED = 1 << 20  # bytes at a time


@dataclass(frozen=True)
class BagTopic:
    """A topic of a bag: its full name, type, the quality that its (first) publisher offered, and its number of messages."""

    name: str
    type: str
    quality: Quality
    count: int


@dataclass(frozen=True)
class BagMessage:
    """A message as it lies in the bag: CDR bytes and the time it was logged, nanoseconds."""

    topic: str
    type: str
    data: bytes
    stamp_ns: int


@dataclass(frozen=True)
class StoredBag:
    """An open bag: its files, how they are compressed ("" or as rosbag2 calls it), and the bounds of reading them."""

    files: list[tuple[Path, McapFile | SqliteFile]]
    compression: str
    allowance: Allowance

    def topics(self) -> tuple[BagTopic, ...]:
        """Return the topics, sorted by name; of one that is in several files the first one's, with the messages of all.

        Raises:
            InputError: a file is damaged.
        """
        found: dict[str, BagTopic] = {}
        for file, storage in self.files:
            for stored in _topics(file, storage).values():
                _check_type(stored, file)
                topic = found.get(stored.name) or BagTopic(stored.name, stored.type, quality_of(stored.qos), 0)
                found[stored.name] = replace(topic, count=topic.count + stored.count)
        return tuple(found[name] for name in sorted(found))

    def messages(self, wanted: Callable[[str, str], bool] = lambda _topic, _type: True) -> Iterator[BagMessage]:
        """Yield the messages of the topics that are `wanted`, by name and type, in order of their stamps; of all files together.

        Raises:
            InputError: a file is damaged, or there are more messages than the bounds allow.
        """
        for message in heapq.merge(*(self._of_file(*entry, wanted) for entry in self.files), key=lambda m: m.stamp_ns):
            self.allowance.hold(len(message.data))
            yield message

    def _of_file(self, file: Path, storage: McapFile | SqliteFile, wanted: Callable[[str, str], bool]) -> Iterator[BagMessage]:
        topics = {number: topic for number, topic in _topics(file, storage).items() if wanted(topic.name, topic.type)}
        for topic in topics.values():
            _check_type(topic, file)
            if topic.encoding != "cdr":
                name, encoding = shown(topic.name), shown(topic.encoding)
                raise InputError(f"{file}: topic {name} is encoded as {encoding!r}, not as 'cdr'; only CDR is read")
        if not topics:
            return
        with _place(file):
            for stamp, number, data in storage.in_order(topics):
                yield BagMessage(topics[number].name, topics[number].type, self._whole(data, file), stamp)

    def _whole(self, data: bytes, file: Path) -> bytes:
        """Return a message, decompressed where the bag compresses each by itself."""
        if self.compression != "message":
            return data
        most = self.allowance.config.most_chunk_bytes
        with guarded(f"{file}: a message cannot be decompressed"):
            whole = bytes(zstandard.ZstdDecompressor().stream_reader(io.BytesIO(data)).read(most + 1))
        if len(whole) > most:
            raise InputError(f"{file}: a message decompresses to more than bag.most_chunk_bytes ({most})")
        self.allowance.unpack(len(whole))
        return whole


def _topics(file: Path, storage: McapFile | SqliteFile) -> dict[int, StoredTopic]:
    """Return the topics of a file by the numbers that its messages bear."""
    with _place(file):
        return {topic.id: topic for topic in storage.list_topics()}


def _check_type(topic: StoredTopic, file: Path) -> None:
    """Refuse a topic whose type is missing in its file.

    Raises:
        InputError: it is.
    """
    if not topic.type:
        raise InputError(f"{file}: damaged, the type of topic {shown(topic.name)} is missing; {_remedy(file)}")


def _remedy(file: Path) -> str:
    bag = file.parent if (file.parent / METADATA).exists() else file
    return f"`scenario-gen reindex {bag}` saves what is whole"


@contextmanager
def _place(file: Path) -> Iterator[None]:
    """Name the file in errors about damage."""
    try:
        yield
    except DamagedError as error:
        raise InputError(f"{file}: cut off or damaged, at {error}; {_remedy(file)}") from error
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror or error})") from error


@contextmanager
def open_bag(
    path: Path,
    config: BagConfig = BagConfig(),
    bound: str = "bag.most_bytes",
) -> Iterator[StoredBag]:
    """Open a bag for reading: its folder, or one of its files.

    Args:
        path: the folder or file.
        config: the bounds.
        bound: the parameter that `most_bytes` came from, for messages.

    Raises:
        InputError: the bag is missing, or a file of it is damaged or was not closed.
    """
    try:
        there = path.exists()
    except (OSError, ValueError) as error:
        raise InputError(f"{shown(str(path))}: no path of a bag ({error})") from error
    if not there:
        raise InputError(f"{path} does not exist; name the folder of a bag, or an .mcap or .db3 file")
    found = files_of(path) if path.is_dir() or path.is_file() else None
    if found is None or not found.files:
        raise InputError(f"{path} is not a bag; name a folder with .mcap or .db3 files, or one of these files")
    allowance = Allowance(config, str(path), sum(file.stat().st_size for file in found.files), bound)
    with ExitStack() as stack:
        files: list[tuple[Path, McapFile | SqliteFile]] = []
        for file in found.files:
            real = _unpacked(file, stack, allowance) if found.compression == "file" else file
            if file.stat().st_size == 0:
                raise InputError(f"{file} is empty (0 bytes); record or copy it again")
            if real.suffix.lower() == ".db3":
                files.append((file, stack.enter_context(open_sqlite(real, allowance))))
                continue
            with _place(file):
                stream = stack.enter_context(real.open("rb"))
                files.append((file, open_mcap(stream, real.stat().st_size, allowance)))
        yield StoredBag(files, found.compression, allowance)


def _unpacked(file: Path, stack: ExitStack, allowance: Allowance) -> Path:
    """Return a file that rosbag2 compressed as a whole (`name.mcap.zstd`), decompressed to a scratch folder.

    Raises:
        InputError: it is damaged, or too large.
    """
    target = stack.enter_context(scratch(Path(tempfile.gettempdir()))) / file.stem
    with file.open("rb") as packed, target.open("wb") as whole:
        for block in _blocks(packed, file):
            allowance.unpack(len(block))
            whole.write(block)
    return target


def _blocks(packed: BinaryIO, file: Path) -> Iterator[bytes]:
    """Yield the content of a compressed file, piece by piece."""
    with guarded(f"{file}: cannot be decompressed", remedy="copy it again"):
        reader = zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True)
        while block := reader.read(COPIED):
            yield block


@contextmanager
def within(path: Path) -> Iterator[None]:
    """Name the bag in errors about its content: a decoder knows the topic only.

    Raises:
        InputError: as raised inside, with the bag's name.
    """
    try:
        yield
    except InputError as error:
        if str(path) in str(error):
            raise
        raise InputError(f"{path}: {error}") from error


def bag_topics(path: Path, config: BagConfig = BagConfig()) -> tuple[BagTopic, ...]:
    """Return the topics of a bag, sorted by name.

    Args:
        path: a bag's folder, or one of its files.
        config: what is read at most.

    Raises:
        InputError: the bag is missing, damaged or empty of metadata.
    """
    with open_bag(path, config) as bag:
        return bag.topics()


def read_messages(
    path: Path, wanted: Callable[[str], bool] = lambda _: True, config: BagConfig = BagConfig()
) -> Iterator[BagMessage]:
    """Yield the messages of the topics that are `wanted`, in the order they were logged; those of all files of a bag together.

    Raises:
        InputError: the bag is missing or damaged, or larger than `config` allows.
    """
    with open_bag(path, config) as bag:
        yield from bag.messages(lambda topic, _: wanted(topic))
