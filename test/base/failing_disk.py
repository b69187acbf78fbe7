# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A small result, and a disk that fails, or a process that dies, at any one of its calls."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import io
import os
from pathlib import Path
from typing import Any

import pytest

from scenario_gen.bags.storage.writer import atomic_bag
from scenario_gen.base.folders import Kind, replaced_folder, write_text

KIND = Kind("bag")
TEXT = b"\x00\x01\x00\x00\x02\x00\x00\x00a\x00"
CALLS = (
    "mkdir",
    "open",
    "write",
    "fsync",
    "rename",
    "replace",
    "unlink",
    "rmdir",
    "scandir",
    "stat",
)


def write_bag(target: Path, messages: int) -> None:
    """Write a bag of so many messages, whole or not at all."""
    with atomic_bag(target, chunk_bytes=100) as bag:
        bag.add_topic("/t", "std_msgs/msg/String")
        for k in range(messages):
            bag.write("/t", TEXT, k)


def write_texts(target: Path, size: int) -> None:
    """Write a folder of two small texts, one of them in a folder of its own, likewise."""
    with replaced_folder(target, KIND) as folder:
        (folder / "inner").mkdir()
        for name in ("one.txt", "inner/two.txt"):
            write_text(folder / name, name * size)


class Failing:
    """Calls to the system, counted; `fail` is called with the number of each."""

    def __init__(self, fail: Callable[[int], None]) -> None:
        self.calls = 0
        self._fail = fail

    def _counted(self, own: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **options: Any) -> Any:
            self.calls += 1
            self._fail(self.calls - 1)
            return own(*arguments, **options)

        return call

    @contextmanager
    def disk(self) -> Iterator[None]:
        """Let it be the disk of this process."""
        with pytest.MonkeyPatch.context() as patch:
            for name in CALLS:
                patch.setattr(os, name, self._counted(getattr(os, name)))
            patch.setattr(io, "open", self._counted(io.open))
            yield
