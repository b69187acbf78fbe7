# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Folders of intermediate files: removed with the command, also by Ctrl-C; the next command removes those of killed ones.

.scenario_gen-NAME/lock   held while the process lives; says which one it is
                  /new    what is being written
                  /old    the earlier result NAME while the new one takes its place (`replace.py`)

A folder of results has this beside it, so that the new result takes its place by a rename.
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
from scenario_gen.base.folders.disk import write_text
from scenario_gen.base.signals import cleaned_up, signals_deferred

PREFIX, LOCK, NEW, OLD = ".scenario_gen-", "lock", "new", "old"
DEPTHS = ("*/", "*/*/")  # at which a corpus and a batch write below their own folder
PATIENCE_S = 1.0  # for a process that is about to release a folder


@contextmanager
def claimed(own: Path, what: Path, patience_s: float = PATIENCE_S) -> Iterator[Path]:
    """Hold the folder of intermediate files `own`, created with those above it, and removed at the end as far as it is empty.

    Args:
        own: its name begins with `PREFIX`; what a killed process left in it is removed.
        what: is being written, in messages.
        patience_s: seconds to wait for another process.

    Yields:
        An empty folder in it, which only this user may enter.

    Raises:
        InputError: another process holds it, or it contains files of others.
        OSError: there is no room, or no right to write.
    """
    lock = FileLock(own / LOCK, thread_local=False)
    missing = [folder for folder in own.parents if not folder.exists()]

    def clean_up() -> None:
        with suppress(OSError):
            if lock.is_locked and _emptied(own):
                (own / LOCK).unlink()
            for folder in (own, *missing):
                folder.rmdir()  # fails where there is something: the result
        lock.release()

    with cleaned_up(clean_up):
        try:
            with signals_deferred():
                _acquire(lock, own, what, patience_s)
                if not _emptied(own):
                    raise InputError(
                        f"{own / OLD} is an earlier result, in whose place {what} now is; move one of them away"
                    )
                (own / NEW).mkdir()
            yield own / NEW
        finally:
            with signals_deferred():
                clean_up()


def _acquire(lock: FileLock, own: Path, what: Path, patience_s: float) -> None:
    while not lock.is_locked:
        own.mkdir(0o700, parents=True, exist_ok=True)
        if (names := {path.name for path in own.iterdir()}) and not {LOCK} <= names <= {
            LOCK,
            NEW,
            OLD,
        }:
            raise InputError(
                f"{own} is needed for intermediate files, but holds other ones; move it away"
            )
        try:
            with suppress(FileNotFoundError):  # another process has just removed the folder
                lock.acquire(timeout=patience_s, poll_interval=0.02)
        except Timeout as error:
            with suppress(OSError):
                who = (own / LOCK).read_text(encoding="utf-8")
                raise InputError(
                    f"{what} is being written by {who}; wait for it, or name another folder"
                ) from error
    write_text(own / LOCK, f"process {os.getpid()} on {socket.gethostname()}")


def _emptied(own: Path) -> bool:
    """Remove what is in a folder of ours, or put it back if it is an earlier result without a successor.

    Returns:
        Whether nothing is left; an earlier result stays if others have put something in its place.
    """
    old, place = own / OLD, own.with_name(own.name.removeprefix(PREFIX))
    if old.exists() and not place.exists():
        old.rename(place)
    elif old.exists() and (own / NEW / place.name).exists():
        return False
    for path in (own / NEW, old):
        if path.exists():
            shutil.rmtree(path)
    return True


def scratch(parent: Path) -> AbstractContextManager[Path]:
    """Give an empty folder in `parent`, which only this user may enter, and remove it at the end, as `claimed` does."""
    if parent == Path(
        tempfile.gettempdir()
    ):  # where workers are killed while their command goes on
        sweep(parent)
    own = parent / f"{PREFIX}{token_hex(8)}"
    return claimed(own, own)


def sweep(folder: Path) -> None:
    """Remove what killed processes left in a folder, unless it cannot be removed or another process holds it."""
    for own in folder.glob(f"{PREFIX}*"):
        with suppress(OSError, InputError), claimed(own, own, patience_s=0.0):
            pass


def sweep_tree(folder: Path) -> None:
    """`sweep` a folder and those in it."""
    for above in {path.parent for path in folder.rglob(f"{PREFIX}*")}:
        sweep(above)


def sweep_beside(words: Iterable[str]) -> None:
    """`sweep` every folder among a command's arguments, with those in it, the one above, and that of temporary files."""
    folders = {Path(tempfile.gettempdir())}
    for word in words:
        with suppress(OSError, ValueError):
            path = Path(word.partition("=")[2] if word.startswith("-") else word).absolute()
            folders |= {above for above in (path, path.parent) if above.is_dir()}
            folders |= {left.parent for depth in DEPTHS for left in path.glob(f"{depth}{PREFIX}*")}
    for folder in sorted(folders):
        sweep(folder)
