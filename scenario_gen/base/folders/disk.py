# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Writes whose errors name the file, and flushes that survive a crash of the machine."""

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Add the file's name to an OSError; those of write and fsync have none."""
    try:
        yield
    except OSError as error:
        error.filename = str(path)
        raise


def write_text(path: Path, text: str) -> None:
    """Write a text file; an OSError names it."""
    with naming(path), path.open("w", encoding="utf-8") as stream:
        stream.write(text)


def sync(path: Path) -> None:
    """Flush a file, or a folder's list of names, to the disk; an OSError names it."""
    with naming(path):
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def sync_tree(path: Path) -> None:
    """`sync` a file, or a folder after its content."""
    for inside in path.rglob("*") if path.is_dir() else ():
        sync(inside)
    sync(path)
