# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Writes whose errors name the file, and flushes that survive a crash of the machine."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
import os
from pathlib import Path
import stat

from scenario_gen.base.errors import InputError


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


def own_folder(path: Path) -> None:
    """Create a folder for this account alone, or check that an existing one is.

    Raises:
        InputError: it is a link, belongs to another account, or others may write to it.
        OSError: it cannot be created.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with suppress(FileExistsError):
        path.mkdir(0o700)
        return  # also on a disk that has no owners and modes
    status = path.lstat()
    writable = stat.S_IWOTH
    if status.st_gid != status.st_uid:  # as of a user's private group
        writable |= stat.S_IWGRP
    if not stat.S_ISDIR(status.st_mode):
        raise InputError(f"{path} is a link; remove it")
    if status.st_uid != os.geteuid():
        raise InputError(f"{path} belongs to another account; remove it")
    if status.st_mode & writable:
        raise InputError(f"other accounts may write to {path}; run `chmod go-w {path}`")


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
