# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""A bag as rosbag2 (Jazzy) writes it: MCAP files of raw CDR messages, and metadata.yaml."""

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
import shutil
import tempfile
from types import TracebackType
from typing import Any, Self

from mcap.writer import CompressionType, Writer

from scenario_gen.bags.metadata import BagInfo, FileInfo, metadata_yaml, TopicInfo
from scenario_gen.bags.types import definition
from scenario_gen.errors import InputError

CHUNK_BYTES = 1024 * 1024


@dataclass(frozen=True)
class Split:
    """Begin a new file when the current one holds `bytes` of messages or spans `seconds`; 0 is never."""

    bytes: int = 0
    seconds: float = 0.0


class BagWriter:
    """Writes one bag; a context manager. Flushed chunk by chunk, so a killed process loses the last one only."""

    def __init__(self, folder: Path, *, compress: bool = True, split: Split = Split(), chunk_bytes: int = CHUNK_BYTES) -> None:
        """Create `folder` and its first file.

        Raises:
            InputError: the folder exists or cannot be made.
        """
        self.folder = folder
        self.info = BagInfo()
        self._compression = CompressionType.ZSTD if compress else CompressionType.NONE
        self._chunk_bytes = chunk_bytes
        self._split = split
        self._topics: dict[str, tuple[TopicInfo, tuple[str, str]]] = {}
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            raise InputError(f"{folder} exists already; name another folder for the bag, or remove it") from None
        except OSError as error:
            raise InputError(f"{folder}: {error.strerror}; choose a folder that can be written") from None
        self._open()

    def _open(self) -> None:
        self._file = FileInfo(f"{self.folder.name}_{len(self.info.files)}.mcap")
        self._bytes = 0
        self.info.files.append(self._file)
        self._stream = (self.folder / self._file.path).open("wb")
        self._writer = Writer(self._stream, chunk_size=self._chunk_bytes, compression=self._compression)
        self._writer.start(profile="ros2", library="scenario_gen")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    def _close_file(self) -> None:
        self._writer.add_metadata("rosbag2", {"serialized_metadata": metadata_yaml(self.info)})
        self._writer.finish()
        self._stream.close()

    def add_topic(self, name: str, kind: str, qos: str = "", type_hash: str = "", schema: tuple[str, str] | None = None) -> None:
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
        """Return the channel of a topic in the current file, made at its first use."""
        if name not in self._channels:
            topic, (encoding, text) = self._topics[name]
            if topic.type not in self._schemas:
                self._schemas[topic.type] = self._writer.register_schema(topic.type, encoding, text.encode())
            metadata = {"offered_qos_profiles": topic.qos, "topic_type_hash": topic.type_hash}
            self._channels[name] = self._writer.register_channel(name, "cdr", self._schemas[topic.type], metadata)
        return self._channels[name]

    def write(self, name: str, data: bytes, stamp_ns: int) -> None:
        """Append one CDR message to an announced topic, logged at `stamp_ns`.

        Raises:
            InputError: the stamp is negative, which an MCAP file cannot hold.
        """
        if stamp_ns < 0:
            raise InputError(f"{name}: stamp {stamp_ns} ns is before 1970; an MCAP file cannot hold it")
        full = self._split.bytes and self._bytes >= self._split.bytes
        long = self._split.seconds and self._file.count and stamp_ns - self._file.start_ns >= self._split.seconds * 1e9
        if full or long:
            self._close_file()
            self._open()
        topic, _ = self._topics[name]
        self._writer.add_message(self._channel(name), log_time=stamp_ns, data=data, publish_time=stamp_ns, sequence=topic.count)
        self._stream.flush()  # of what the writer has let go: a chunk once it is full
        self._file.add(stamp_ns)
        self._bytes += len(data)
        topic.count += 1

    def close(self) -> None:
        """Write indexes and metadata.yaml."""
        self._close_file()
        partial = self.folder / "metadata.yaml.partial"
        partial.write_text(metadata_yaml(self.info), encoding="utf-8")
        partial.replace(self.folder / "metadata.yaml")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()


class AtomicBag:
    """A bag that is there whole or not at all: written beside its place under another name, then moved there.

    A bag of an earlier run in the same place is replaced; a folder that is no bag is not touched.
    """

    def __init__(self, folder: Path, **options: Any) -> None:
        """Begin the bag (options: BagWriter's).

        Raises:
            InputError: `folder` exists and is no bag, or its place cannot be written.
        """
        self._target = folder
        if folder.exists() and not (folder / "metadata.yaml").is_file():
            raise InputError(f"{folder} exists and is no bag; name another folder, or remove it")
        try:
            folder.parent.mkdir(parents=True, exist_ok=True)
            self._scratch = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", dir=folder.parent))
        except OSError as error:
            raise InputError(f"{folder}: {error.strerror}; choose a folder that can be written") from None
        self._writer = BagWriter(self._scratch / folder.name, **options)

    def __enter__(self) -> BagWriter:
        return self._writer

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        try:
            if kind is not None:
                with suppress(Exception):
                    self._writer.close()
            else:
                self._writer.close()
                if self._target.exists():
                    self._target.replace(self._scratch / "replaced")
                self._writer.folder.replace(self._target)
        finally:
            shutil.rmtree(self._scratch, ignore_errors=True)
