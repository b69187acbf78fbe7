# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A bag as rosbag2 (Jazzy) writes it: MCAP files of raw CDR messages, and metadata.yaml."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from mcap.writer import CompressionType, Writer

from scenario_gen.bags.storage.definitions import definition
from scenario_gen.bags.storage.files import METADATA
from scenario_gen.bags.storage.metadata import FileInfo, metadata_yaml, qos_yaml, TopicInfo
from scenario_gen.base.errors import InputError
from scenario_gen.base.folders import Kind, naming, replaced_folder, sync, write_text
from scenario_gen.types import Quality

_WRITTEN = Kind("bag")


@dataclass(frozen=True)
class Split:
    """When to begin a new file: after `bytes` of messages, or after `seconds`; 0 means never."""

    bytes: int = 0
    seconds: float = 0.0


class BagWriter:
    """Writes one bag; a context manager.

    Each full chunk is flushed, so that a killed process loses its last chunk only; see `flush`.

    Attributes:
        folder: of the bag.
        topics: by name.
        files: in order.
        not_recorded: by topic, what is missing.
    """

    def __init__(
        self,
        folder: Path,
        *,
        compress: bool = True,
        split: Split = Split(),
        chunk_bytes: int = 1024 * 1024,
    ) -> None:
        """Create the folder and its first file.

        Raises:
            InputError: the folder exists.
            OSError: it cannot be created.
        """
        self.folder = folder
        self.topics: dict[str, TopicInfo] = {}
        self.files: list[FileInfo] = []
        self.not_recorded: dict[str, str] = {}
        self._compression = CompressionType.ZSTD if compress else CompressionType.NONE
        self._chunk_bytes = chunk_bytes
        self._split = split
        self._failed = False
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            raise InputError(
                f"{folder} already exists; remove it, or name another folder for the bag"
            ) from None
        self._open_file()

    def _open_file(self) -> None:
        self._file = FileInfo(f"{self.folder.name}_{len(self.files)}.mcap")
        self._bytes = 0
        self.files.append(self._file)
        path = self.folder / self._file.path
        with naming(path):
            self._stream = path.open("xb")
            self._writer = Writer(
                self._stream, chunk_size=self._chunk_bytes, compression=self._compression
            )
            self._writer.start(profile="ros2", library="scenario_gen")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    def _close_file(self) -> None:
        path = self.folder / self._file.path
        with naming(path):
            self._writer.add_metadata("rosbag2", {"serialized_metadata": self._metadata()})
            self._writer.finish()
            self._stream.close()
        sync(path)

    def _metadata(self) -> str:
        return metadata_yaml(list(self.topics.values()), self.files, self.not_recorded)

    def add_topic(
        self, name: str, kind: str, quality: Quality = Quality(), type_hash: str = ""
    ) -> None:
        """Add a topic, unless it was added before.

        Args:
            name: full name.
            kind: its type, e.g. `nav_msgs/msg/Path`.
            quality: offered by its publisher.
            type_hash: RIHS01 hash; "": computed from the definition.

        Raises:
            InputError: the definition of the type is unknown.
        """
        if name not in self.topics:
            type_hash = type_hash or definition(kind)[1]
            self.topics[name] = TopicInfo(name, kind, quality, type_hash)
            self._channel(name)

    def _channel(self, name: str) -> int:
        """Return the channel of a topic in the current file; create it at its first use."""
        if name not in self._channels:
            topic = self.topics[name]
            if topic.type not in self._schemas:
                text, _ = definition(topic.type)
                self._schemas[topic.type] = self._writer.register_schema(
                    topic.type, "ros2msg", text.encode()
                )
            metadata = {
                "offered_qos_profiles": qos_yaml(topic.quality),
                "topic_type_hash": topic.type_hash,
            }
            self._channels[name] = self._writer.register_channel(
                name, "cdr", self._schemas[topic.type], metadata
            )
        return self._channels[name]

    def write(self, name: str, data: bytes, stamp_ns: int) -> None:
        """Append a CDR message of a topic that was added, logged at `stamp_ns`.

        Raises:
            InputError: the stamp is negative, which an MCAP file cannot hold.
            OSError: the disk is full, or fails; nothing more can be written.
        """
        if stamp_ns < 0:
            raise InputError(
                f"{name}: stamp {stamp_ns} ns is before 1970, which an MCAP file cannot hold"
            )
        topic = self.topics[name]
        with self._writing():
            if self._is_full(stamp_ns):
                self._close_file()
                self._open_file()
            self._writer.add_message(
                self._channel(name),
                log_time=stamp_ns,
                data=data,
                publish_time=stamp_ns,
                sequence=topic.count,
            )
            self._stream.flush()  # a full chunk, which the writer has just written
        self._file.add(stamp_ns)
        self._bytes += len(data)
        topic.count += 1

    def _is_full(self, stamp_ns: int) -> bool:
        """Return whether a message with this stamp begins a new file."""
        if self._split.bytes and self._bytes >= self._split.bytes:
            return True
        span_ns = stamp_ns - self._file.start_ns
        return self._split.seconds > 0.0 and span_ns >= self._split.seconds * 1e9

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Name the current file in errors, after which nothing more is written."""
        try:
            yield
        except OSError as error:
            error.filename = str(self.folder / self._file.path)
            self._failed = True
            raise

    def flush(self) -> None:
        """Write the current chunk, so that a killed process does not lose it.

        Raises:
            OSError: the disk is full, or fails; nothing more can be written.
        """
        if not self._failed:
            with self._writing():
                self._writer.flush()

    def close(self) -> None:
        """Write indexes and metadata.yaml; after a failed write, leave the files as they are.

        Raises:
            OSError: the disk is full, or fails.
        """
        try:
            if not self._failed:
                self._close_file()
                partial = self.folder / f"{METADATA}.partial"
                write_text(partial, self._metadata())
                sync(partial)
                partial.replace(self.folder / METADATA)
                sync(self.folder)
        finally:
            with suppress(OSError):
                self._stream.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


@contextmanager
def atomic_bag(
    folder: Path, kind: Kind = _WRITTEN, inputs: Iterable[Path] = (), **options: Any
) -> Iterator[BagWriter]:
    """Yield a bag to write, which appears complete or not at all.

    Args:
        folder: of the bag; it may replace an earlier one of the same kind.
        kind: kind of the result.
        inputs: paths that are read meanwhile, and must not be in `folder`.
        options: those of `BagWriter`.

    Raises:
        InputError: the folder exists and may not be replaced, or the disk is full, or fails.
    """
    with replaced_folder(folder, kind, inputs) as partial:
        partial.rmdir()  # the writer creates it
        with BagWriter(partial, **options) as writer:
            yield writer
