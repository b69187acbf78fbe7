# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A small result, and a disk that fails, or a process that dies, at any one of its calls."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import fcntl
import io
import os
from pathlib import Path
from typing import Any

import pytest

from scenario_gen.bags.storage.writer import atomic_bag
from scenario_gen.base.folders import Kind, replaced_folder, write_text

KIND = Kind("test")
TEXT = b"\x00\x01\x00\x00\x02\x00\x00\x00a\x00"
CHANGES = ("mkdir", "open", "write", "fsync", "rename", "replace", "unlink", "rmdir", "chmod")
LOOKS = ("scandir", "listdir", "stat", "lstat")


def write_bag(target: Path, messages: int) -> None:
    """Write a bag of so many messages, whole or not at all."""
    with atomic_bag(target, KIND, chunk_bytes=100) as bag:
        bag.add_topic("/t", "std_msgs/msg/String")
        for k in range(messages):
            bag.write("/t", TEXT, k)


def write_texts(target: Path, size: int) -> None:
    """Write a folder of two small texts, one of them in a folder of its own, likewise."""
    with replaced_folder(target, KIND) as folder:
        (folder / "inner").mkdir()
        for name in ("one.txt", "inner/two.txt"):
            write_text(folder / name, name * size)


def write_nothing(target: Path) -> None:
    """Begin a result and give it up: what was left there is settled all the same."""
    with pytest.raises(ZeroDivisionError), replaced_folder(target, KIND):
        raise ZeroDivisionError


def content(folder: Path) -> dict[str, bytes]:
    """Every file below, by name."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


class Stream:
    """A file whose writes are counted, too."""

    def __init__(self, stream: Any, count: Callable[[str], None]) -> None:
        self._stream, self._count = stream, count

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def __enter__(self) -> "Stream":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def write(self, data: Any) -> int:
        self._count("stream write")
        return self._stream.write(data)

    def flush(self) -> None:
        self._count("stream flush")
        self._stream.flush()

    def close(self) -> None:
        try:
            if not self._stream.closed:
                self._count("stream close")
        finally:
            self._stream.close()


class Failing:
    """Calls to the system, counted; `fail` is called with the number of each."""

    def __init__(self, fail: Callable[[int], None]) -> None:
        self.calls: list[str] = []
        self._fail = fail

    def count(self, name: str) -> None:
        self.calls.append(name)
        self._fail(len(self.calls) - 1)

    @contextmanager
    def disk(self, exchanging: bool, names: tuple[str, ...] = CHANGES) -> Iterator[None]:
        """Let it be the disk of this process, on which folders can be exchanged at once or not."""
        with pytest.MonkeyPatch.context() as patch:

            def counted(name: str, own: Callable[..., Any]) -> Callable[..., Any]:
                def call(*arguments: Any, **options: Any) -> Any:
                    self.count(name)
                    return own(*arguments, **options)

                return call

            for name in names:
                patch.setattr(os, name, counted(name, getattr(os, name)))
            patch.setattr(fcntl, "flock", counted("flock", fcntl.flock))
            own_open = io.open
            patch.setattr(io, "open", lambda *a, **o: Stream(counted("io.open", own_open)(*a, **o), self.count))
            from scenario_gen.base.folders import replace

            exchange = counted("exchange", replace.exchange) if exchanging else lambda *_: False
            patch.setattr(replace, "exchange", exchange)
            yield
