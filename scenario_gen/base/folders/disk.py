# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The file system: errors that name the file, data flushed to the disk, two folders exchanged at once."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
import ctypes
import errno
import os
from pathlib import Path
import shutil

AT_FDCWD, RENAME_EXCHANGE = -100, 2
# errors of a kernel or a file system that knows no exchange
UNKNOWN = {errno.ENOSYS, errno.EINVAL, errno.ENOTSUP, errno.EOPNOTSUPP, errno.EPERM}


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
    """Flush a file's content, or a folder's list of names, to the disk."""
    with naming(path):
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def sync_tree(folder: Path) -> None:
    """`sync` all that is in a folder, then the folder."""
    for path in sorted(folder.rglob("*"), reverse=True):  # what is in a folder comes before it
        sync(path)
    sync(folder)


def exchange(one: Path, other: Path) -> bool:
    """Let two folders swap their names in one step; return False where the system cannot.

    Raises:
        OSError: it can, but not here.
    """
    try:
        call = ctypes.CDLL(None, use_errno=True).renameat2
    except (AttributeError, OSError):
        return False
    if call(AT_FDCWD, os.fsencode(one), AT_FDCWD, os.fsencode(other), RENAME_EXCHANGE) == 0:
        return True
    number = ctypes.get_errno()
    if number in UNKNOWN:
        return False
    raise OSError(number, os.strerror(number), str(other))


def is_gone(path: Path) -> bool:
    """Return whether there certainly is nothing of that name."""
    try:
        path.lstat()
    except FileNotFoundError:
        return True
    except OSError:
        return False
    return False


def discard(path: Path) -> None:
    """Remove a file or a folder as far as that is possible."""
    with suppress(OSError):
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink()
