# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Folders of results: complete or not at all, replacing only unchanged results of their kind.

A result has a marker, a file with its kind and the SHA-256 of every other file. Beside it, so that
it can take its place by a rename, is the folder of its intermediate files:

.scenario_gen-NAME/lock   locked while the process lives; names the process
                  /new    files that are being written
                  /old    the earlier result NAME while the new one replaces it

The next command that writes NAME removes those of a killed command. Errors of writing name the
file, and flushes survive a crash of the machine.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, ExitStack, suppress
from functools import partial
import hashlib
import json
import os
from pathlib import Path
import shutil
import socket
import stat
import tempfile
from typing import NewType

from filelock import FileLock, Timeout

from scenario_gen.base.errors import describe, InputError, of_system
from scenario_gen.base.signals import cleaned_up, signals_deferred

PREFIX = ".scenario_gen-"
TEMPORARY = f"{PREFIX}tmp-"
LOCK = "lock"
NEW = "new"
OLD = "old"
MARKER = ".scenario_gen.json"
FORMAT_VERSION = 1
UNTOUCHED = (
    "; earlier files are unchanged; make room, or name another folder that you may write to"
)
Kind = NewType("Kind", str)
"""A kind of result, as in the markers."""


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


@contextmanager
def claimed(folder: Path, purpose: Path) -> Iterator[Path]:
    """Lock a folder of intermediate files, created with its parents; remove it at the end.

    Args:
        folder: its name begins with `PREFIX`; the files of a killed process are removed.
        purpose: the file or folder that is being written, for messages.

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
                _prepare(lock, folder, purpose)
            yield folder / NEW
        finally:
            with signals_deferred():
                clean_up()


def _prepare(lock: FileLock, folder: Path, purpose: Path) -> None:
    """Lock and empty a folder, and create the folder of the new result in it."""
    _acquire(lock, folder, purpose)
    if not _emptied(folder):
        raise InputError(
            f"{folder / OLD} is an earlier result, but {purpose} exists, too; "
            "move one of them away"
        )
    (folder / NEW).mkdir()


def _acquire(lock: FileLock, folder: Path, purpose: Path) -> None:
    while not lock.is_locked:
        own_folder(folder)
        names = {path.name for path in folder.iterdir()}
        if names and not {LOCK} <= names <= {LOCK, NEW, OLD}:
            raise InputError(
                f"{folder} is needed for intermediate files, but has other ones; move it away"
            )
        try:
            with suppress(FileNotFoundError):  # another process has just removed the folder
                lock.acquire(timeout=1.0, poll_interval=0.02)
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


@contextmanager
def scratch(parent: Path | None = None) -> Iterator[Path]:
    """Yield an empty folder that only this user may enter; remove it at the end.

    It is in `parent`, or else in the folder for temporary files (TMPDIR).
    """
    with ExitStack() as stack:
        with signals_deferred():
            folder = Path(tempfile.mkdtemp(prefix=TEMPORARY, dir=parent))
            remove = partial(shutil.rmtree, folder, ignore_errors=True)
            stack.enter_context(cleaned_up(remove))
        stack.callback(remove)
        yield folder


def sweep(folder: Path) -> None:
    """Remove the folders of `scratch` at any depth in a folder that no other process uses."""
    for path in list(folder.rglob(f"{TEMPORARY}*")):
        shutil.rmtree(path, ignore_errors=True)


def check_replaceable(target: Path, kind: Kind) -> None:
    """Check that `replaced_folder` may replace a folder.

    Raises:
        InputError: as `replaced_folder`.
    """
    _check(target, _checked_place(target, ()), kind)


@contextmanager
def replaced_folder(target: Path, kind: Kind, inputs: Iterable[Path] = ()) -> Iterator[Path]:
    """Yield an empty folder for a result, and move it to `target` at the end, flushed to the disk.

    `target` stays unchanged until then, also if the body raises or the process is killed. It may
    be an empty folder or an unchanged earlier result of the same kind.

    Args:
        target: place of the result; its parents are created.
        kind: of the result.
        inputs: files and folders that are read for it; none of them may be in `target`.

    Yields:
        A folder with the same name, beside `target`.

    Raises:
        InputError: `target` may not be replaced, another process is writing to it, it cannot be
            written, or the disk is full.
    """
    place = _checked_place(target, inputs)
    scratch = place.with_name(f"{PREFIX}{place.name}")
    try:
        with claimed(scratch, target) as parent:
            _check(target, place, kind)
            new = parent / place.name
            new.mkdir()
            yield new
            with signals_deferred():
                _finish(new, kind)
                _check(target, place, kind)
                _put(target, place, new, kind)
    except OSError as error:
        path = place if error.filename is None else Path(os.fsdecode(error.filename))
        if not any(map(path.is_relative_to, (place, scratch))) and path not in scratch.parents:
            raise  # a file that the body reads
        advice = UNTOUCHED
        if os.path.lexists(scratch / OLD):
            advice = f"; the earlier result is in {scratch / OLD}, the next command puts it back"
        raise of_system(error, target, advice) from error


def _checked_place(target: Path, inputs: Iterable[Path]) -> Path:
    """Return the target's absolute path.

    Raises:
        InputError: no result may be there, an input is there, or the path cannot be used.
    """
    try:
        place = target.resolve()
        existing = next(folder for folder in (place, *place.parents) if folder.exists())
        is_current = Path.cwd().is_relative_to(place)
        inside = [path for path in inputs if path.resolve().is_relative_to(place)]
    except (OSError, RuntimeError, ValueError) as error:  # too long, a loop of links, a null byte
        raise InputError(
            f"{target} cannot be written: {describe(error)}; name another folder"
        ) from error
    if target.is_symlink():
        fault = "is a link; name the folder that it leads to"
    elif not existing.is_dir():
        fault = f"cannot be a folder, because {existing} is a file"
    elif is_current:
        fault = "is the folder that you are in, or above it"
    elif os.path.ismount(place):
        fault = "is a mount point, which cannot be replaced; name a folder in it"
    elif inside:
        fault = f"contains {inside[-1]}, an input of this command"
    else:
        return place
    raise InputError(f"{target} {fault}; name another folder")


def _put(target: Path, place: Path, new: Path, kind: Kind) -> None:
    """Move the new result to its place; on failure `claimed` puts the earlier one back.

    Raises:
        InputError: a file was added to the earlier result at the last moment.
        OSError: the file system refuses.
    """
    if place.exists():
        old = new.parents[1] / OLD
        place.rename(old)
        _check(target, old, kind)
    new.rename(place)
    with suppress(OSError):  # a file system without fsync of folders; all data are on the disk
        sync(place.parent)


def _finish(folder: Path, kind: Kind) -> None:
    """Write the marker of a new result, and flush all its files to the disk."""
    document = {"kind": kind, "format": FORMAT_VERSION, "files": _digests(folder)}
    write_text(folder / MARKER, json.dumps(document, indent=2) + "\n")
    sync_tree(folder)


def _digests(folder: Path) -> dict[str, str]:
    """Return {relative name: SHA-256} of all files at any depth, in order.

    "" for links and special files.
    """
    digests: dict[str, str] = {}
    for path in sorted(folder.iterdir()):
        if path.is_dir() and not path.is_symlink():
            digests |= {f"{path.name}/{name}": text for name, text in _digests(path).items()}
        else:
            is_regular = path.is_file() and not path.is_symlink()
            digests[path.name] = sha256_of(path) if is_regular else ""
    return digests


def _check(target: Path, folder: Path, kind: Kind) -> None:
    """Raise InputError if a folder has files that an earlier result has not.

    Files may be missing.
    """
    present = _digests(folder) if folder.exists() else {}
    files: dict[str, str] = {}
    if MARKER in present:
        with suppress(ValueError, KeyError, TypeError, RecursionError):
            marker = json.loads((folder / MARKER).read_text(encoding="utf-8"))
            if (marker["kind"], marker["format"]) == (kind, FORMAT_VERSION):
                files = {**marker["files"], MARKER: present[MARKER]}
    for name, digest in present.items():
        if files.get(name) == digest:
            continue
        fault = f"it holds {name} and is not an earlier result ({kind})"
        if files:
            fault = f"{name} in it is new or changed"
        raise InputError(
            f"{target} is not replaced: {fault}; move that away, or name another folder"
        )


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file, or of a folder's files by name without its marker."""
    digest = hashlib.sha256()
    for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
        if file.is_file() and (file == path or file.name != MARKER):
            with file.open("rb") as stream:
                hashlib.file_digest(stream, lambda: digest)
    return digest.hexdigest()
