# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Any bag, MCAP, SQLite or of ROS 1, of one or several files, as raw messages (CDR) in order of their stamps."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, ExitStack
from dataclasses import dataclass, replace
import heapq
from pathlib import Path
import tempfile

import zstandard

from scenario_gen.bags.storage.config import Allowance, BagConfig
from scenario_gen.bags.storage.files import BagFiles, files_of, METADATA
from scenario_gen.bags.storage.mcap import (
    BagTopic,
    DamagedError,
    decompressed,
    McapFile,
    open_mcap,
)
from scenario_gen.bags.storage.others import open_ros1, open_sqlite, RosbagsFile
from scenario_gen.base.documents import shown
from scenario_gen.base.errors import guarded, InputError
from scenario_gen.base.folders import scratch

COPIED = 1 << 20  # bytes at a time


@dataclass(frozen=True)
class BagMessage:
    """A message as it lies in the bag: CDR bytes and the time it was logged, nanoseconds."""

    topic: str
    type: str
    data: bytes
    stamp_ns: int


@dataclass(frozen=True)
class StoredBag:
    """An open bag: its files, whether each message is compressed by itself, and the bounds of reading them."""

    files: list[tuple[Path, McapFile | RosbagsFile]]
    compressed: bool
    allowance: Allowance

    def topics(self) -> tuple[BagTopic, ...]:
        """Return the topics, sorted by name; of one that is in several files the first one's, with the messages of all.

        Raises:
            InputError: a file is damaged.
        """
        found: dict[str, BagTopic] = {}
        for stored in (
            topic for file, storage in self.files for topic in _topics(file, storage).values()
        ):
            before = found.get(stored.name)
            found[stored.name] = (
                replace(before, count=before.count + stored.count) if before else stored
            )
        return tuple(found[name] for name in sorted(found))

    def messages(
        self, wanted: Callable[[str, str], bool] = lambda _topic, _type: True
    ) -> Iterator[BagMessage]:
        """Yield the messages of the topics that are `wanted`, by name and type, in order of their stamps; of all files together.

        Raises:
            InputError: a file is damaged, there are more messages than the bounds allow, or a topic's are no CDR of a known type.
        """
        for message in heapq.merge(
            *(self._of_file(*entry, wanted) for entry in self.files), key=lambda m: m.stamp_ns
        ):
            self.allowance.hold(len(message.data))
            yield message

    def _of_file(
        self, file: Path, storage: McapFile | RosbagsFile, wanted: Callable[[str, str], bool]
    ) -> Iterator[BagMessage]:
        topics = {
            number: topic
            for number, topic in _topics(file, storage).items()
            if wanted(topic.name, topic.type)
        }
        for topic in topics.values():
            if topic.encoding != "cdr" or not topic.type:
                how = f"encoded as {shown(topic.encoding)!r}" if topic.type else "of no type"
                raise InputError(
                    f"{file}: topic {shown(topic.name)} is {how}; only CDR of a ROS type is read: choose others"
                )
        with _place(file):
            for stamp, number, data in storage.in_order(topics) if topics else ():
                yield BagMessage(
                    topics[number].name, topics[number].type, self._whole(data, file), stamp
                )

    def _whole(self, data: bytes, file: Path) -> bytes:
        """Return a message, decompressed where the bag compresses each by itself."""
        if not self.compressed:
            return data
        most = self.allowance.config.most_chunk_bytes
        with guarded(f"{file}: a message cannot be decompressed"):
            whole = decompressed(data, most)
        if len(whole) > most:
            raise InputError(
                f"{file}: a message decompresses to more than bag.most_chunk_bytes ({most})"
            )
        self.allowance.unpack(len(whole))
        return whole


def _topics(file: Path, storage: McapFile | RosbagsFile) -> dict[int, BagTopic]:
    """Return the topics of a file by the numbers that its messages bear."""
    with _place(file):
        return {topic.id: topic for topic in storage.list_topics()}


@contextmanager
def _place(file: Path) -> Iterator[None]:
    """Name the file in errors about damage."""
    try:
        yield
    except DamagedError as error:
        bag = file.parent if (file.parent / METADATA).exists() else file
        remedy = f"`scenario-gen reindex {bag}` saves what is whole"
        raise InputError(f"{file}: cut off or damaged, at {error}; {remedy}") from error
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror or error})") from error


@contextmanager
def open_bag(
    path: Path, config: BagConfig = BagConfig(), bound: str = "bag.most_bytes"
) -> Iterator[StoredBag]:
    """Open a bag for reading: its folder, or one of its files.

    Args:
        path: the folder or file.
        config: the bounds.
        bound: the parameter that `most_bytes` came from, for messages.

    Raises:
        InputError: the bag is missing, or a file of it is damaged or was not closed.
    """
    with guarded(f"{shown(str(path))}: no path of a bag", OSError, ValueError):
        found = files_of(path) if path.is_dir() or path.is_file() else BagFiles(())
    if not found.files:
        why = "is not a bag" if path.exists() else "does not exist"
        raise InputError(
            f"{path} {why}; name a folder with .mcap, .db3 or .bag files, or one of these files"
        )
    allowance = Allowance(
        config, str(path), sum(file.stat().st_size for file in found.files), bound
    )
    with ExitStack() as stack:
        files = [
            (file, _opened(file, found.compression == "file", allowance, stack))
            for file in found.files
        ]
        yield StoredBag(files, found.compression == "message", allowance)


def _opened(
    file: Path, compressed: bool, allowance: Allowance, stack: ExitStack
) -> McapFile | RosbagsFile:
    """Open one file of a bag, which may be compressed as a whole."""
    if file.stat().st_size == 0:
        raise InputError(f"{file} is empty (0 bytes); record or copy it again")
    real = _unpacked(file, stack, allowance) if compressed else file
    if real.suffix == ".db3":
        return stack.enter_context(open_sqlite(real, file, allowance))
    if real.suffix == ".bag":
        return stack.enter_context(open_ros1(real, allowance))
    with _place(file):
        return open_mcap(stack.enter_context(real.open("rb")), real.stat().st_size, allowance)


def _unpacked(file: Path, stack: ExitStack, allowance: Allowance) -> Path:
    """Return a file that rosbag2 compressed as a whole (`name.mcap.zstd`), decompressed to a scratch folder.

    Raises:
        InputError: it is damaged, or too large.
    """
    target = stack.enter_context(scratch(Path(tempfile.gettempdir()))) / file.stem
    problem = guarded(
        f"{file}: cannot be decompressed", zstandard.ZstdError, remedy="copy it again"
    )
    with file.open("rb") as packed, target.open("wb") as whole, problem:
        reader = zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True)
        while block := reader.read(COPIED):
            allowance.unpack(len(block))
            whole.write(block)
    return target


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
