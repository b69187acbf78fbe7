# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Any bag (MCAP, SQLite, ROS 1) of one or several files as raw messages (CDR) by their stamps."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, ExitStack
from dataclasses import dataclass, replace
import heapq
from operator import attrgetter
from pathlib import Path

import zstandard

from scenario_gen.bags.storage.config import BagConfig, ReadBudget
from scenario_gen.bags.storage.files import BagFiles, files_of, NOT_RECORDED
from scenario_gen.bags.storage.mcap import McapFile
from scenario_gen.bags.storage.messages import BagMessage, BagTopic, StoredFile
from scenario_gen.bags.storage.rosbags_files import open_with_rosbags
from scenario_gen.base.documents import shown
from scenario_gen.base.errors import guarded, InputError

_FRAME_HEADER_BYTES = 18
_STAMP = attrgetter("stamp_ns")


def _within(
    messages: Iterator[BagMessage], within_ns: tuple[int, int], unseen: set[str]
) -> Iterator[BagMessage]:
    """Yield the messages in a window, and the first ones of the `unseen` topics."""
    first_ns, last_ns = within_ns
    for message in messages:
        if message.stamp_ns > last_ns and not unseen:
            return
        if message.topic in unseen or first_ns <= message.stamp_ns <= last_ns:
            unseen.discard(message.topic)
            yield message


@dataclass(frozen=True)
class StoredBag:
    """An open bag.

    Attributes:
        path: its folder or file.
        files: path and contents of each file.
        listed: what its metadata says.
        budget: bounds of reading it.
    """

    path: Path
    files: list[tuple[Path, StoredFile]]
    listed: BagFiles
    budget: ReadBudget

    def topics(self) -> tuple[BagTopic, ...]:
        """Return the topics by name; a topic in several files as in the first, with all messages.

        Raises:
            InputError: a file is damaged.
        """
        topics: dict[str, BagTopic] = {}
        for _, file in self.files:
            for topic in file.topics:
                first = topics.get(topic.name)
                count = topic.count + (first.count if first else 0)
                topics[topic.name] = replace(first or topic, count=count)
        return tuple(topics[name] for name in sorted(topics))

    def warnings(self) -> tuple[str, ...]:
        """Return a line for each part that is missing, and for what was not recorded."""
        lines = [file.missing for _, file in self.files if file.missing]
        left = sum(topic.count for topic in self.topics())
        count = self.listed.count
        if count is not None and left < count:
            lines.append(f"{self.path}: {count - left} of its {count} messages are missing")
        lines += [
            f"not complete, by its recorder: {shown(key.removeprefix(NOT_RECORDED))}: "
            f"{shown(text, 400)}"
            for key, text in self.listed.custom.items()
            if isinstance(key, str) and key.startswith(NOT_RECORDED)
        ]
        return tuple(lines)

    def messages(
        self,
        wanted: Callable[[str, str], bool] = lambda _topic, _type: True,
        within_ns: tuple[int, int] | None = None,
    ) -> Iterator[BagMessage]:
        """Yield the messages of topics with a `wanted` name and type, by their stamps.

        Args:
            wanted: chooses topics.
            within_ns: first and last stamp; other messages are left out, except the first one of
                each topic.

        Raises:
            InputError: a file is damaged, there are more messages than the bounds allow, or a
                topic is not CDR of a known type.
        """
        streams = [self._messages_of_file(path, file, wanted) for path, file in self.files]
        merged = streams[0] if len(streams) == 1 else heapq.merge(*streams, key=_STAMP)
        if within_ns:
            offered = (topic for topic in self.topics() if wanted(topic.name, topic.type))
            merged = _within(merged, within_ns, {topic.name for topic in offered if topic.count})
        for message in merged:
            self.budget.spend_message(len(message.data))
            yield message

    def _messages_of_file(
        self, path: Path, file: StoredFile, wanted: Callable[[str, str], bool]
    ) -> Iterator[BagMessage]:
        topics = [topic for topic in file.topics if wanted(topic.name, topic.type)]
        for topic in topics:
            if topic.encoding != "cdr" or not topic.type:
                how = f"is encoded as {shown(topic.encoding)!r}" if topic.type else "has no type"
                raise InputError(
                    f"{path}: topic {shown(topic.name)} {how}; only CDR of a ROS type can be "
                    "read: choose other topics"
                )
        if topics:
            with guarded(f"{path}: cannot be read", OSError):
                yield from file.messages(topics)


@contextmanager
def open_bag(
    path: Path, config: BagConfig = BagConfig(), parameter: str = "bag.most_bytes"
) -> Iterator[StoredBag]:
    """Open a bag for reading.

    Args:
        path: its folder, or one of its files.
        config: the bounds.
        parameter: name of the parameter that sets `most_bytes`, for messages.

    Raises:
        InputError: the bag does not exist, or no message in it can be read.
    """
    with guarded(f"{shown(str(path))}: not the path of a bag", OSError, ValueError):
        bag_files = files_of(path) if path.is_dir() or path.is_file() else BagFiles(())
    if not bag_files.files:
        problem = "is not a bag" if path.exists() else "does not exist"
        raise InputError(
            f"{path} {problem}; name a folder with .mcap, .db3 or .bag files, or one of the files"
        )
    budget = ReadBudget(config, str(path), parameter)
    with ExitStack() as stack:
        if bag_files.compression == "file":
            _check_declared_sizes(bag_files.files, budget)
        if bag_files.compression:
            opened = [path if path.is_dir() else path.parent]
        else:
            opened = [*bag_files.files]
        files = [(file, _open(file, budget, stack)) for file in opened]
        bag = StoredBag(path, files, bag_files, budget)
        lines = [file.missing for _, file in files if file.missing]
        if lines and not any(topic.count for topic in bag.topics()):
            raise InputError(lines[0])
        yield bag


def _check_declared_sizes(files: Iterable[Path], budget: ReadBudget) -> None:
    """Check the decompressed sizes that compressed files declare.

    Raises:
        InputError: a file is not compressed, or one of them exceeds the bound.
    """
    for file in files:
        with guarded(f"{file}: cannot be decompressed", remedy="copy it again"):
            with file.open("rb") as stream:
                size = zstandard.frame_content_size(stream.read(_FRAME_HEADER_BYTES))
            if size > budget.config.most_bytes:
                raise InputError(
                    f"{file}: decompresses to {size} bytes; {budget.parameter} is "
                    f"{budget.config.most_bytes}"
                )


def _open(path: Path, budget: ReadBudget, stack: ExitStack) -> StoredFile:
    """Open one file of a bag, or the folder of a bag that rosbag2 compressed."""
    if path.stat().st_size == 0:
        raise InputError(f"{path} is empty (0 bytes); record or copy it again")
    if path.suffix != ".mcap":
        return stack.enter_context(open_with_rosbags(path, budget))
    with guarded(f"{path}: cannot be read", OSError):
        return McapFile(stack.enter_context(path.open("rb")), path, budget)


@contextmanager
def naming_bag(path: Path) -> Iterator[None]:
    """Name the bag in errors about its content: decoders know the topic only.

    Raises:
        InputError: as raised inside, with the name of the bag.
    """
    try:
        yield
    except InputError as error:
        if str(path) in str(error):
            raise
        raise InputError(f"{path}: {error}") from error


def bag_warnings(path: Path) -> tuple[str, ...]:
    """Return a line for each part of a bag that is missing, and for what was not recorded.

    Raises:
        InputError: it cannot be read as a bag.
    """
    with open_bag(path) as bag:
        return bag.warnings()


def read_messages(
    path: Path, wanted: Callable[[str], bool] = lambda _: True, config: BagConfig = BagConfig()
) -> Iterator[BagMessage]:
    """Yield the messages of topics with a `wanted` name, by their stamps.

    Raises:
        InputError: the bag does not exist, is damaged, or larger than `config` allows.
    """
    with open_bag(path, config) as bag:
        yield from bag.messages(lambda topic, _: wanted(topic))
