# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A bag as rosbag2 (Jazzy) writes it: MCAP files of raw CDR messages, and metadata.yaml."""

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType, Writer

from scenario_gen.bags.storage.definitions import definition
from scenario_gen.bags.storage.files import METADATA
from scenario_gen.bags.storage.metadata import metadata_yaml, qos_yaml, TopicInfo
from scenario_gen.base.errors import InputError
from scenario_gen.base.folders import Kind, naming, replaced_folder, sync, write_text
from scenario_gen.types import Quality

_WRITTEN = Kind("bag")
_MAX_STAMP_NS = 2**63 - 1


class BagWriter(AbstractContextManager["BagWriter"]):
    """Writes one bag; a context manager.

    Each full chunk is flushed, so that a killed process loses its last chunk only; see `flush`.

    Attributes:
        folder: of the bag.
        topics: by name.
        not_recorded: by topic, what is missing.
    """

    def __init__(
        self,
        folder: Path,
        *,
        compress: bool = True,
        chunk_bytes: int = 1024 * 1024,
    ) -> None:
        """Create the folder and its file.

        Raises:
            InputError: the folder exists.
            OSError: it cannot be created.
        """
        self.folder = folder
        self.topics: dict[str, TopicInfo] = {}
        self.not_recorded: dict[str, str] = {}
        self._failed = False
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            raise InputError(
                f"{folder} already exists; remove it, or name another folder for the bag"
            ) from None
        self._span_ns = (_MAX_STAMP_NS, 0)  # first and last stamp
        self._schemas: dict[str, int] = {}
        compression = CompressionType.ZSTD if compress else CompressionType.NONE
        self._path = folder / f"{folder.name}_0.mcap"
        with naming(self._path):
            self._stream = self._path.open("xb")
            self._writer = Writer(self._stream, chunk_size=chunk_bytes, compression=compression)
            self._writer.start(profile="ros2", library="scenario_gen")

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
        if name in self.topics:
            return
        text, computed_hash = definition(kind)
        type_hash = type_hash or computed_hash
        if kind not in self._schemas:
            self._schemas[kind] = self._writer.register_schema(kind, "ros2msg", text.encode())
        metadata = {
            "offered_qos_profiles": qos_yaml(quality),
            "topic_type_hash": type_hash,
        }
        channel = self._writer.register_channel(name, "cdr", self._schemas[kind], metadata)
        self.topics[name] = TopicInfo(name, kind, quality, type_hash, channel)

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
            self._writer.add_message(
                topic.channel,
                log_time=stamp_ns,
                data=data,
                publish_time=stamp_ns,
                sequence=topic.count,
            )
            self._stream.flush()  # a full chunk, which the writer has just written
        first_ns, last_ns = self._span_ns
        self._span_ns = min(first_ns, stamp_ns), max(last_ns, stamp_ns)
        topic.count += 1

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Name the file in errors, after which nothing more is written."""
        try:
            yield
        except OSError as error:
            error.filename = str(self._path)
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
                topics = list(self.topics.values())
                text = metadata_yaml(self._path.name, topics, self._span_ns, self.not_recorded)
                with naming(self._path):
                    self._writer.add_metadata("rosbag2", {"serialized_metadata": text})
                    self._writer.finish()
                    self._stream.close()
                sync(self._path)
                partial = self.folder / f"{METADATA}.partial"
                write_text(partial, text)
                sync(partial)
                partial.replace(self.folder / METADATA)
                sync(self.folder)
        finally:
            with suppress(OSError):
                self._stream.close()

    def __exit__(self, *_: object) -> None:
        self.close()


@contextmanager
def atomic_bag(folder: Path, **options: Any) -> Iterator[BagWriter]:
    """Yield a bag to write, which appears complete or not at all.

    Args:
        folder: of the bag; it may replace an earlier one.
        options: those of `BagWriter`.

    Raises:
        InputError: the folder exists and may not be replaced, or the disk is full, or fails.
    """
    with replaced_folder(folder, _WRITTEN) as partial:
        partial.rmdir()  # the writer creates it
        with BagWriter(partial, **options) as writer:
            yield writer
