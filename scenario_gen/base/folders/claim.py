# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Claims on results: a folder beside the result's place, with a lock that the kernel releases when its process dies.

    .scenario_gen-XXXXXXXX/owner.json   locked; holds which result, which process, where and since when
                          /new/NAME     the result being written; after an exchange, the earlier one
                          /old/NAME     the earlier result, if the system cannot exchange two folders at once

One process at a time examines and creates such folders: it holds `.scenario_gen.lock` for that moment.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from datetime import datetime
import fcntl
import json
import os
from pathlib import Path
import socket
import tempfile
import time

from scenario_gen.base.errors import InputError
from scenario_gen.base.folders.disk import discard, is_gone, naming
from scenario_gen.base.folders.marker import is_marked, objection
from scenario_gen.base.interrupts import ending

PREFIX, GUARD = ".scenario_gen-", ".scenario_gen.lock"
OWNER, NEW, OLD = "owner.json", "new", "old"
PATIENCE = 20.0
"""Seconds to wait for others who examine the same folder; removing the leftovers of a large run takes longest."""


@dataclass(frozen=True)
class _Owner:
    """The owner of a claim: the result's name beside the claim, and the process."""

    target: str
    pid: int
    host: str
    since: str

    @classmethod
    def read(cls, descriptor: int) -> "_Owner | None":
        """Return the owner that the open file holds, None if it holds none."""
        try:
            found = cls(**json.loads(os.pread(descriptor, 65536, 0)))
        except (ValueError, TypeError, RecursionError):
            return None
        is_name = isinstance(found.target, str) and found.target not in ("", ".", "..") and "/" not in found.target
        return found if is_name else None


@dataclass(frozen=True)
class Claim:
    """The right to write one result, while `lock` (a descriptor) is open; `place` is where the result will be."""

    place: Path
    folder: Path
    lock: int

    @property
    def new(self) -> Path:
        """The folder to write to."""
        return self.folder / NEW / self.place.name

    @property
    def old(self) -> Path:
        """Where an earlier result waits, if two folders cannot be exchanged at once."""
        return self.folder / OLD / self.place.name

    def release(self) -> None:
        """Remove the claim's folder, unless it holds an earlier result that could not be put back: the next run will."""
        try:
            if is_gone(self.old) or os.path.lexists(self.place):
                _remove(self.folder)
        finally:
            os.close(self.lock)


def _locked(path: Path) -> int:
    """Return a descriptor of the file with the only lock on it, -1 if another process has it."""
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if os.fstat(descriptor).st_nlink:  # else its former owner has removed the file
            return descriptor
    except BlockingIOError:
        pass
    except BaseException:
        os.close(descriptor)
        raise
    os.close(descriptor)
    return -1


@contextmanager
def alone(parent: Path, patience: float = PATIENCE) -> Iterator[None]:
    """Let no other process of ours examine `parent`, or make a claim in it, during the work inside.

    Args:
        parent: the folder.
        patience: seconds to wait for others.

    Raises:
        InputError: a foreign file has the lock's name, or a process holds it for too long.
        OSError: the folder cannot be written.
    """
    path = parent / GUARD
    deadline = time.monotonic() + patience
    while (descriptor := _locked(path)) < 0:
        if time.monotonic() > deadline:
            raise InputError(f"{path} is held by another process; wait for it, or name another folder")
        time.sleep(0.02)
    try:
        if os.fstat(descriptor).st_size:
            raise InputError(f"{path} is needed as a lock, but has a content; move it away")
        try:
            with ending(path.unlink):
                yield
        finally:
            with suppress(OSError):
                path.unlink()
    finally:
        os.close(descriptor)


def claim(place: Path) -> Claim:
    """Begin a claim; to be called `alone`.

    Raises:
        OSError: there is no room, or no right to write.
    """
    folder = Path(tempfile.mkdtemp(prefix=PREFIX, dir=place.parent))
    lock = -1
    try:
        folder.chmod(0o755)
        with naming(folder):
            lock = os.open(folder / OWNER, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o644)
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            owner = _Owner(place.name, os.getpid(), socket.gethostname(), datetime.now().isoformat(" ", "seconds"))
            os.write(lock, json.dumps(asdict(owner)).encode())
        result = Claim(place, folder, lock)
        result.new.mkdir(parents=True)
    except BaseException:
        try:
            _remove(folder)
        finally:
            if lock >= 0:
                os.close(lock)
        raise
    return result


def settle(place: Path) -> None:
    """Finish the claims of killed runs beside `place`: put an earlier result back, remove the rest; to be called `alone`.

    Raises:
        InputError: a living process writes to `place`; the message says which.
    """
    with os.scandir(place.parent) as listing:
        claims = [Path(entry.path) for entry in listing if entry.name.startswith(PREFIX) and entry.is_dir(follow_symlinks=False)]
    for folder in claims:
        with suppress(OSError):  # another user's
            _settle(folder, place)


def _settle(folder: Path, place: Path) -> None:
    try:
        lock = os.open(folder / OWNER, os.O_RDWR | os.O_NOFOLLOW)
    except FileNotFoundError:
        folder.rmdir()  # empty; else it is not ours, and this fails
        return
    try:
        owner = _Owner.read(lock)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if owner is not None and owner.target == place.name:
                who = f"process {owner.pid} on {owner.host} since {owner.since}"
                raise InputError(f"{place} is being written by {who}; wait for it, or name another folder") from None
            return
        content = {entry.name for entry in folder.iterdir()}
        if owner is not None and content <= {OWNER, NEW, OLD}:
            _finish(Claim(folder.parent / owner.target, folder, lock))
        elif content == {OWNER} and not os.fstat(lock).st_size:
            _remove(folder)  # killed before it wrote its owner
    finally:
        os.close(lock)


def _finish(dead: Claim) -> None:
    """Finish a claim whose process is dead; files that might be another's stay."""
    if any(set(above.iterdir()) - {own} for own in (dead.new, dead.old) if (above := own.parent).is_dir()):
        return
    if dead.old.exists():
        if is_gone(dead.place):
            dead.old.rename(dead.place)
        elif dead.new.exists():
            return  # another file has come there since
    if dead.new.exists() and is_marked(dead.new) and objection(dead.new, None):
        return
    _remove(dead.folder)


def _remove(folder: Path) -> None:
    """Remove a claim, its owner last, so that it can be recognised as ours until it is gone."""
    inside = (folder / NEW, folder / OLD)
    for path in inside:
        discard(path)
    if all(is_gone(path) for path in inside):
        discard(folder / OWNER)
        with suppress(OSError):
            folder.rmdir()
