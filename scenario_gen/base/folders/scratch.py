# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Folders of intermediate files, which end with their command.

The next command removes those of killed commands.

.scenario_gen-NAME/lock   locked while the process lives; names the process
                  /new    files that are being written
                  /old    the earlier result NAME while the new one replaces it (`replace.py`)

This folder is beside the result, so that the result can take its place by a rename.
"""

from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
import os
from pathlib import Path
from secrets import token_hex
import shutil
import socket
import tempfile

from filelock import FileLock, Timeout

from scenario_gen.base.errors import InputError
from scenario_gen.base.folders.disk import own_folder, write_text
from scenario_gen.base.signals import cleaned_up, signals_deferred

PREFIX = ".scenario_gen-"
LOCK = "lock"
NEW = "new"
OLD = "old"
NESTED = ("*/", "*/*/", "*/*/*/")  # where a corpus and a batch write inside of their folder


@contextmanager
def claimed(folder: Path, purpose: Path, timeout_s: float = 1.0) -> Iterator[Path]:
    """Lock a folder of intermediate files, created with its parents; remove it at the end.

    Args:
        folder: its name begins with `PREFIX`; the files of a killed process are removed.
        purpose: the file or folder that is being written, for messages.
        timeout_s: longest wait for another process.

    Yields:
        An empty folder in it that only this user may enter.

    Raises:
        InputError: another process has locked it, it contains other files, or it is of another
            account.
        OSError: the disk is full, or there is no right to write.
    """
    lock = FileLock(folder / LOCK, thread_local=False)
    missing = [parent for parent in folder.parents if not parent.exists()]

    def clean_up() -> None:
        with suppress(OSError):
            if lock.is_locked and _emptied(folder):
                (folder / LOCK).unlink()
            for each in (folder, *missing):
                each.rmdir()  # fails for the parent of the result
        lock.release()

    with cleaned_up(clean_up):
        try:
            with signals_deferred():
                _prepare(lock, folder, purpose, timeout_s)
            yield folder / NEW
        finally:
            with signals_deferred():
                clean_up()


def _prepare(lock: FileLock, folder: Path, purpose: Path, timeout_s: float) -> None:
    """Lock and empty a folder, and create the folder of the new result in it."""
    _acquire(lock, folder, purpose, timeout_s)
    if not _emptied(folder):
        raise InputError(
            f"{folder / OLD} is an earlier result, but {purpose} exists, too; "
            "move one of them away"
        )
    (folder / NEW).mkdir()


def _acquire(lock: FileLock, folder: Path, purpose: Path, timeout_s: float) -> None:
    while not lock.is_locked:
        own_folder(folder)
        names = {path.name for path in folder.iterdir()}
        if names and not {LOCK} <= names <= {LOCK, NEW, OLD}:
            raise InputError(
                f"{folder} is needed for intermediate files, but has other ones; move it away"
            )
        try:
            with suppress(FileNotFoundError):  # another process has just removed the folder
                lock.acquire(timeout=timeout_s, poll_interval=0.02)
        except Timeout as error:
            with suppress(OSError):
                owner = (folder / LOCK).read_text(encoding="utf-8")
                raise InputError(
                    f"{purpose} is being written by {owner}; wait for it, or name another folder"
                ) from error
    own_folder(folder)  # nobody has put a folder or a link of his own into its place
    write_text(folder / LOCK, f"process {os.getpid()} on {socket.gethostname()}")


def _emptied(folder: Path) -> bool:
    """Remove the intermediate files in a locked folder.

    An earlier result without a successor is put back.

    Returns:
        False if an earlier result stays, because something else has taken its place.
    """
    old = folder / OLD
    place = folder.with_name(folder.name.removeprefix(PREFIX))
    if old.exists() and not place.exists():
        old.rename(place)
    elif old.exists() and (folder / NEW / place.name).exists():
        return False
    for path in (folder / NEW, old):
        if path.exists():
            shutil.rmtree(path)
    return True


def scratch(parent: Path) -> AbstractContextManager[Path]:
    """Return a private empty folder in `parent`, removed at the end as by `claimed`."""
    if parent == Path(tempfile.gettempdir()):
        sweep(parent)  # workers may be killed while their command continues
    folder = parent / f"{PREFIX}{token_hex(8)}"
    return claimed(folder, folder)


def sweep(folder: Path) -> None:
    """Remove the folders of killed processes in a folder, if possible."""
    for each in folder.glob(f"{PREFIX}*"):
        with suppress(OSError, InputError), claimed(each, each, timeout_s=0.0):
            pass


def sweep_tree(folder: Path) -> None:
    """`sweep` a folder and all its subfolders."""
    for parent in {path.parent for path in folder.rglob(f"{PREFIX}*")}:
        sweep(parent)


def sweep_beside(arguments: Iterable[str]) -> None:
    """`sweep` the folders in a command's arguments and that of temporary files.

    Their parents and subfolders are included.
    """
    folders = {Path(tempfile.gettempdir())}
    for argument in arguments:
        with suppress(OSError, ValueError):
            text = argument.partition("=")[2] if argument.startswith("-") else argument
            path = Path(text).absolute()
            folders |= {each for each in (path, path.parent) if each.is_dir()}
            for level in NESTED:
                folders |= {left.parent for left in path.glob(f"{level}{PREFIX}*")}
    for folder in sorted(folders):
        sweep(folder)
