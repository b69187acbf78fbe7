# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Files written so that an error names them and a crash of the machine does not lose them."""

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Let an OSError name the file that is being written: those of write and fsync do not."""
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
    """Flush a file's content, or a folder's list of names, to the disk; an OSError names it."""
    with naming(path):
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def sync_tree(path: Path) -> None:
    """`sync` a file, or a folder after all that is in it."""
    for inside in path.rglob("*") if path.is_dir() else ():
        sync(inside)
    sync(path)
