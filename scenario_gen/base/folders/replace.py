# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Results take their places: written beside it, checked, and exchanged with an earlier result."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, ExitStack, suppress
import errno
import os
from pathlib import Path
import stat

from scenario_gen.base.errors import InputError, of_system
from scenario_gen.base.folders.claim import alone, Claim, claim, GUARD, PREFIX, settle
from scenario_gen.base.folders.disk import exchange, is_gone, sync
from scenario_gen.base.folders.marker import finish, Kind, objection
from scenario_gen.base.interrupts import ending, uninterrupted

FORBIDDEN = {errno.EACCES, errno.EPERM, errno.EROFS}  # no right to write, or a file system that is read-only


@contextmanager
def replaced_folder(target: Path, kind: Kind, inputs: Iterable[Path] = ()) -> Iterator[Path]:
    """Yield an empty folder to write a result to, and move it to `target` at the end, flushed to the disk.

    Until then `target` stays as it is, also if the body raises, or the process is killed. It may be an empty folder or an
    unchanged earlier result of the same kind. Leftovers of killed runs beside it are removed.

    Args:
        target: place of the result; folders above are created.
        kind: of the result.
        inputs: files and folders that are read for it: none of them may lie in `target`.

    Yields:
        A folder of the same name, beside `target`.

    Raises:
        InputError: `target` may not be replaced, another process is writing to it, it cannot be written, or the disk is full.
    """
    try:
        place = _place(target, inputs)
        missing = [folder for folder in place.parents if not folder.exists()]
    except (OSError, RuntimeError, ValueError) as error:  # too long, a loop of links, a null character
        raise _failed(target, error) from error
    claims: list[Claim] = []

    def clean_up() -> None:
        while claims:
            claims.pop().release()
        for folder in missing:
            with suppress(OSError):  # it is not empty: the result is there
                folder.rmdir()

    with ending(clean_up):
        try:
            with uninterrupted(), _system_errors(target, place.parent):
                place.parent.mkdir(parents=True, exist_ok=True)
                with alone(place.parent):
                    settle(place)
                    _check(target, place, kind)
                    own = claim(place)
                    claims.append(own)
            with _system_errors(target, own.new):
                yield own.new
            with uninterrupted(), _system_errors(target, place.parent):
                finish(own.new, kind)
                _check(target, place, kind)
                _put(target, own, kind)
        finally:
            with uninterrupted():
                clean_up()


def _place(target: Path, inputs: Iterable[Path]) -> Path:
    """Return the target's absolute path.

    Raises:
        InputError: no result may be there, or one of the inputs lies there.
    """
    if target.is_symlink():
        raise InputError(f"{target} is a link; name the folder that it leads to, or another one")
    place = target.resolve()
    if place.parent == place:
        raise InputError(f"{target} is the root of the file system; name a folder in it")
    above = next((folder for folder in place.parents if folder.exists()), place)
    if not above.is_dir():
        raise InputError(f"{target} cannot be a folder, because {above} is a file; name another folder")
    if not place.exists():
        return place
    if not place.is_dir():
        raise InputError(f"{target} is a file; name a folder")
    if _above(place, Path.cwd()):
        raise InputError(f"{target} is the folder that you are in, or above it, and not an earlier result; name another one")
    if os.path.ismount(place):
        raise InputError(f"{target} is a mount point, which cannot be replaced; name a folder in it")
    if not place.stat().st_mode & stat.S_IWUSR:  # also for root, who may write everywhere
        raise InputError(f"{target} is read-only; name another folder")
    for path in (path for given in inputs for path in _all_of(given)):
        if _above(place, path):
            raise InputError(f"{target} holds {path}, which is read, and would be replaced; name another folder")
    return place


def _all_of(given: Path) -> list[Path]:
    """Return an input and all files in it; none where it cannot be read: its reader reports that."""
    with suppress(OSError, ValueError):
        return [given, *(given.rglob("*") if given.is_dir() else ())]
    return []


def _above(place: Path, path: Path) -> bool:
    """Return whether a path is a folder or lies in it, by its name or by the targets of its links."""
    with suppress(OSError, RuntimeError, ValueError):
        return any(candidate.is_relative_to(place) for candidate in (path.resolve(), path.parent.resolve() / path.name))
    return False


def _check(target: Path, place: Path, kind: Kind) -> None:
    """Raise InputError if the content of `place` may not be replaced."""
    if not is_gone(place) and (reason := objection(place, kind)):
        raise InputError(f"{target} is not replaced: {reason}; move that away, or name another folder")


def _put(target: Path, own: Claim, kind: Kind) -> None:
    """Move the new result to its place, or leave everything as it was.

    Raises:
        InputError: something came into the earlier result at the last moment, or that could not be put back.
        OSError: the file system refuses.
    """
    place, new, old = own.place, own.new, own.old
    with ExitStack() as undo:
        if not place.exists() or not any(place.iterdir()):
            new.rename(place)
            undo.callback(place.rename, new)
        elif exchange(new, place):
            undo.callback(exchange, new, place)
            _check(target, new, kind)
        else:
            old.parent.mkdir()
            place.rename(old)
            undo.callback(_put_back, target, own)
            _check(target, old, kind)
            new.rename(place)
            undo.callback(place.rename, new)
        sync(place.parent)
        undo.pop_all()


def _put_back(target: Path, own: Claim) -> None:
    try:
        own.old.rename(own.place)
    except OSError as error:
        raise of_system(error, target, f"; the earlier result is in {own.old}, the next run puts it back") from error


@contextmanager
def _system_errors(target: Path, folder: Path) -> Iterator[None]:
    """Turn the system's errors about files in `folder` into ours."""
    try:
        yield
    except OSError as error:
        if error.filename is None or Path(os.fsdecode(error.filename)).is_relative_to(folder):
            raise _failed(target, error) from error
        raise


def _failed(target: Path, error: Exception) -> InputError:
    """Return an error of the system as one of ours; a file being written is named as if it were in the target already."""
    forbidden = isinstance(error, OSError) and error.errno in FORBIDDEN
    remedy = "it cannot be written to: name another folder" if forbidden else "make room, or name another folder"
    advice = f"; what was there is untouched; {remedy}"
    if not isinstance(error, OSError):
        return InputError(f"{target}: {error}{advice}")
    path = target if error.filename is None else Path(os.fsdecode(error.filename))
    own = next((k for k, part in enumerate(path.parts) if part.startswith((PREFIX, GUARD))), None)
    return of_system(error, path if own is None else target.joinpath(*path.parts[own + 3 :]), advice)
