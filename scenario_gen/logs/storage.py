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

"""The files of bags through rosbags, with bounds: what a damaged file asks for is refused before it is done."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, ExitStack
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import lz4.frame  # type: ignore[import-untyped,unused-ignore]
from rosbags.rosbag2 import Reader, storage_mcap

from scenario_gen.errors import InputError
from scenario_gen.guard import guarded

DAMAGED = "cut off or damaged, no bag"
REMEDY = "`reindex` saves what is whole in an MCAP file"


@dataclass
class Budget:
    """What may come out of the compressed chunks and messages of a file, in bytes, and what has come out."""

    file: Path
    limit: int
    spent: int = 0

    def unpack(self, decompress: Callable[[bytes, int], bytes], data: bytes, size: int | None) -> bytes:
        """Decompress one chunk, of which the file says that it holds `size` bytes, or one message.

        Args:
            decompress: (data, at most so many bytes) -> bytes.
            data: the compressed bytes.
            size: None if the file does not say.

        Raises:
            InputError: more comes out than is allowed.
        """
        left = self.limit - self.spent
        if size is not None and size > left:
            self.refuse(self.spent + size)
        most = left if size is None else size
        found = decompress(data, most + 1)  # one more tells that there is more
        if len(found) > left:
            self.refuse(self.spent + len(found))
        self.spent += len(found)
        return found

    def refuse(self, size: int) -> None:
        """Say that it is too much."""
        raise InputError(
            f"{self.file} holds {size / 2**20:.0f} MiB or more once decompressed; at most {self.limit / 2**20:.0f} MiB are read: "
            "choose topics, or raise the parameter size_limit"
        )


UNBOUNDED = Budget(Path("bag"), 1 << 40)
CURRENT: ContextVar[Budget] = ContextVar("CURRENT", default=UNBOUNDED)


def from_zstd(data: bytes, most: int) -> bytes:
    """Decompress at most so many bytes."""
    return bytes(storage_mcap.zstd.ZstdDecompressor().decompress(data, most))


def from_lz4(data: bytes, most: int) -> bytes:
    """Decompress at most so many bytes."""
    return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, most))


# rosbags 0.11 decompresses a chunk whole, whatever comes out; these stop at what the chunk's header says.
storage_mcap.DECOMPRESSORS["zstd"] = lambda data, size: CURRENT.get().unpack(from_zstd, data, size)
storage_mcap.DECOMPRESSORS["lz4"] = lambda data, size: CURRENT.get().unpack(from_lz4, data, size)


@contextmanager
def _counted(budget: Budget) -> Iterator[None]:
    """Let what rosbags decompresses in the block count for a budget, and its errors name the file."""
    token = CURRENT.set(budget)
    try:
        with guarded(f"{described(budget.file)}: {DAMAGED}", remedy=REMEDY if budget.file.suffix == ".mcap" else ""):
            yield
    finally:
        CURRENT.reset(token)


def described(file: Path) -> str:
    """Name a file with its size, which tells one that was cut off."""
    return f"{file}, {file.stat().st_size} bytes" if file.is_file() else str(file)


class BagFile:
    """An open file of a bag (or the folder of a compressed one).

    Attributes:
        file: its path.
        connections: those of rosbags; their topics and types are texts.
    """

    def __init__(self, reader: Any, budget: Budget) -> None:
        """Take an open reader of rosbags."""
        self.file = budget.file
        self._reader, self._budget, self._packed = reader, budget, False
        self.connections: tuple[Any, ...] = tuple(reader.connections)
        for connection in self.connections:
            if not (isinstance(connection.topic, str) and isinstance(connection.msgtype, str)):
                what = f"topic {connection.topic!r} of type {connection.msgtype!r}"
                raise InputError(f"{described(self.file)}: {DAMAGED} ({what}: a name is not text)")
        if reader.compression_mode == "message":  # rosbags would decompress messages whole, whatever comes out
            reader.storage.metadata = reader.storage.metadata._replace(compression_mode=None)
            self._packed = True

    def messages(self, connections: Sequence[Any]) -> Iterator[tuple[Any, int, bytes]]:
        """Yield (connection, time of reception [ns], CDR bytes) of some connections, none if there are none.

        Raises:
            InputError: the file is damaged, or too large once decompressed.
        """
        if not connections:
            return
        self._budget.spent = 0
        source = iter(self._reader.messages(connections))
        while True:
            with _counted(self._budget):
                item = next(source, None)
                if item is None:
                    return
                connection, stamp, data = item
                if self._packed:
                    data = self._budget.unpack(from_zstd, bytes(data), None)
            if not (isinstance(stamp, int) and abs(stamp) < 2**63 and isinstance(data, bytes | memoryview)):
                what = f"a message of {connection.topic} at {stamp!r} is {type(data).__name__}"
                raise InputError(f"{described(self.file)}: {DAMAGED} ({what}, not bytes at a time in nanoseconds)")
            yield connection, stamp, bytes(data)


@contextmanager
def opened(file: Path, limit: int = UNBOUNDED.limit) -> Iterator[BagFile]:
    """Open a file of a bag, or the folder of a compressed one.

    Args:
        file: its path.
        limit: bytes that may come out of what is compressed in it.

    Raises:
        InputError: it is empty, damaged, or too large once decompressed.
    """
    if file.is_file() and file.stat().st_size == 0:
        raise InputError(f"{file} is empty (0 bytes); record or copy it again")
    budget = Budget(file, limit)
    if file.is_dir():
        with _counted(budget):
            measure(file, budget)
    with ExitStack() as stack:
        with _counted(budget):
            reader = stack.enter_context(Reader(file))
        yield BagFile(reader, budget)


def measure(folder: Path, budget: Budget) -> None:
    """Decompress the files of a bag that was compressed file by file, to see how large they are; keep nothing."""
    for file in sorted(folder.glob("*.zstd")):
        with file.open("rb") as packed, storage_mcap.zstd.open(packed, "rb") as unpacked:
            while block := unpacked.read(1 << 20):
                budget.spent += len(block)
                if budget.spent > budget.limit:
                    budget.refuse(budget.spent)
    budget.spent = 0
