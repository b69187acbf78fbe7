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
from scenario_gen.bags.storage.metadata import BagInfo, FileInfo, metadata_yaml, TopicInfo
from scenario_gen.base.errors import InputError
from scenario_gen.base.folders import Kind, naming, replaced_folder, sync, write_text

CHUNK_BYTES = 1024 * 1024
WRITTEN = Kind("bag")


@dataclass(frozen=True)
class Split:
    """Begin a new file when the current one holds `bytes` of messages or spans `seconds`; 0 is never."""

    bytes: int = 0
    seconds: float = 0.0


class BagWriter:
    """Writes one bag; a context manager. Flushed chunk by chunk, so a killed process loses the last one only (see `let_go`)."""

    def __init__(
        self,
        folder: Path,
        *,
        compress: bool = True,
        split: Split = Split(),
        chunk_bytes: int = CHUNK_BYTES,
    ) -> None:
        """Create `folder` and its first file.

        Raises:
            InputError: the folder exists.
            OSError: it cannot be created.
        """
        self.folder = folder
        self.info = BagInfo()
        self._compression = CompressionType.ZSTD if compress else CompressionType.NONE
        self._chunk_bytes = chunk_bytes
        self._split = split
        self._topics: dict[str, tuple[TopicInfo, tuple[str, str]]] = {}
        self._broken = False
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            raise InputError(
                f"{folder} exists already; name another folder for the bag, or remove it"
            ) from None
        self._open()

    def _open(self) -> None:
        self._file = FileInfo(f"{self.folder.name}_{len(self.info.files)}.mcap")
        self._bytes = 0
        self.info.files.append(self._file)
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
            self._writer.add_metadata("rosbag2", {"serialized_metadata": metadata_yaml(self.info)})
            self._writer.finish()
            self._stream.close()
        sync(path)

    def add_topic(
        self,
        name: str,
        kind: str,
        qos: str = "",
        type_hash: str = "",
        schema: tuple[str, str] | None = None,
    ) -> None:
        """Announce a topic; a second time is ignored.

        Args:
            name: full topic name.
            kind: its type, e.g. `nav_msgs/msg/Path`.
            qos: YAML list of the offered QoS profiles.
            type_hash: RIHS01 hash, if it is known better than by the definition.
            schema: encoding and text of the type's definition, if it need not be looked up.

        Raises:
            InputError: no definition of the type can be found.
        """
        if name in self._topics:
            return
        known_hash = ""
        if schema is None:
            text, known_hash = definition(kind)
            schema = ("ros2msg", text)
        topic = TopicInfo(name, kind, qos, type_hash or known_hash)
        self._topics[name] = (topic, schema)
        self.info.topics.append(topic)
        self._channel(name)

    def _channel(self, name: str) -> int:
        """Return the channel of a topic in the current file, created at its first use."""
        if name not in self._channels:
            topic, (encoding, text) = self._topics[name]
            if topic.type not in self._schemas:
                self._schemas[topic.type] = self._writer.register_schema(
                    topic.type, encoding, text.encode()
                )
            metadata = {"offered_qos_profiles": topic.qos, "topic_type_hash": topic.type_hash}
            self._channels[name] = self._writer.register_channel(
                name, "cdr", self._schemas[topic.type], metadata
            )
        return self._channels[name]

    def write(self, name: str, data: bytes, stamp_ns: int) -> None:
        """Append one CDR message to an announced topic, logged at `stamp_ns`.

        Raises:
            InputError: the stamp is negative, which an MCAP file cannot hold.
            OSError: the disk is full, or fails; nothing more can be written.
        """
        if stamp_ns < 0:
            raise InputError(
                f"{name}: stamp {stamp_ns} ns is before 1970; an MCAP file cannot hold it"
            )
        with self._writing():
            full = self._split.bytes and self._bytes >= self._split.bytes
            long = (
                self._split.seconds
                and self._file.count
                and stamp_ns - self._file.start_ns >= self._split.seconds * 1e9
            )
            if full or long:
                self._close_file()
                self._open()
            topic, _ = self._topics[name]
            channel = self._channel(name)
            self._writer.add_message(
                channel, log_time=stamp_ns, data=data, publish_time=stamp_ns, sequence=topic.count
            )
            self._stream.flush()  # a full chunk, which the writer has just written
        self._file.add(stamp_ns, stamp_ns)
        self._bytes += len(data)
        topic.count += 1

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Name the current file in errors; after one, part of a record may be written, and nothing more is."""
        try:
            yield
        except OSError as error:
            error.filename = str(self.folder / self._file.path)
            self._broken = True
            raise

    def let_go(self) -> None:
        """Write the current chunk, if there is one, so that a killed process does not lose it.

        Raises:
            OSError: the disk is full, or fails; nothing more can be written.
        """
        if not self._broken:
            with self._writing():
                self._writer.flush()

    def close(self) -> None:
        """Write indexes and metadata.yaml; where a write has failed, leave the files as they are, for `reindex`.

        Raises:
            OSError: the disk is full, or fails.
        """
        try:
            if not self._broken:
                self._close_file()
                partial = self.folder / "metadata.yaml.partial"
                write_text(partial, metadata_yaml(self.info))
                sync(partial)
                partial.replace(self.folder / "metadata.yaml")
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
    folder: Path, kind: Kind = WRITTEN, inputs: Iterable[Path] = (), **options: Any
) -> Iterator[BagWriter]:
    """Yield a bag to write: it appears complete or not at all, and may replace an earlier one of the same kind.

    Args:
        folder: where it will be.
        kind: of result; only an earlier one of that kind is replaced.
        inputs: what is read for it, and may not lie in `folder`.
        options: BagWriter's.

    Raises:
        InputError: `folder` is there and may not be replaced, its place cannot be written, or the disk is full, or fails.
    """
    with replaced_folder(folder, kind, inputs) as partial:
        partial.rmdir()  # the writer creates it
        with BagWriter(partial, **options) as writer:
            yield writer
