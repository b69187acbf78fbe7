# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Results take their places whole: written beside it, then renamed; in the place of an earlier result of the same kind only.

An earlier result is known by its marker, a file that holds its kind and the SHA-256 of every other file.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
import hashlib
import json
import os
from pathlib import Path
from typing import NewType

from scenario_gen.base.errors import describe, InputError, of_system
from scenario_gen.base.folders.disk import sync, sync_tree, write_text
from scenario_gen.base.folders.scratch import claimed, OLD, PREFIX
from scenario_gen.base.signals import signals_deferred

MARKER, FORMAT = ".scenario_gen.json", 1
UNTOUCHED = (
    "; what was there is untouched; make room, or name another folder that you may write to"
)
Kind = NewType("Kind", str)
"""A kind of result, as markers name it."""


@contextmanager
def replaced_folder(target: Path, kind: Kind, inputs: Iterable[Path] = ()) -> Iterator[Path]:
    """Yield an empty folder to write a result to, and move it to `target` at the end, flushed to the disk.

    Until then `target` stays as it is, also if the body raises, or the process is killed. It may be an empty folder or an
    unchanged earlier result of the same kind. What a killed run left there is removed.

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
    except (
        OSError,
        RuntimeError,
        ValueError,
    ) as error:  # too long, a loop of links, a null character
        raise InputError(
            f"{target} cannot be written: {describe(error)}; name another folder"
        ) from error
    own = place.with_name(f"{PREFIX}{place.name}")
    try:
        with claimed(own, target) as above:
            _check(target, place, kind)
            new = above / place.name
            new.mkdir()
            yield new
            with signals_deferred():
                _finish(new, kind)
                _check(target, place, kind)
                _put(target, place, new, kind)
    except OSError as error:
        named = place if error.filename is None else Path(os.fsdecode(error.filename))
        if not any(
            one.is_relative_to(other)
            for one, other in ((named, place), (named, own), (own, named))
        ):
            raise  # of what the body reads
        waits = f"; the earlier result is in {own / OLD}, the next command puts it back"
        raise of_system(
            error, target, waits if os.path.lexists(own / OLD) else UNTOUCHED
        ) from error


def _place(target: Path, inputs: Iterable[Path]) -> Path:
    """Return the target's absolute path.

    Raises:
        InputError: no result may be there, or one of the inputs lies there.
    """
    place = target.resolve()
    there = next(folder for folder in (place, *place.parents) if folder.exists())
    why = ""
    if target.is_symlink():
        why = "is a link; name the folder that it leads to"
    elif not there.is_dir():
        why = f"cannot be a folder, because {there} is a file"
    elif Path.cwd().is_relative_to(place):
        why = "is the folder that you are in, or above it"
    elif os.path.ismount(place):
        why = "is a mount point, which cannot be replaced; name a folder in it"
    elif read := next((path for path in inputs if path.resolve().is_relative_to(place)), None):
        why = f"holds {read}, which is read, and would be replaced"
    if why:
        raise InputError(f"{target} {why}; name another folder")
    return place


def _put(target: Path, place: Path, new: Path, kind: Kind) -> None:
    """Move the new result to its place; where that fails `claimed` puts the earlier one back.

    Raises:
        InputError: something came into the earlier result at the last moment.
        OSError: the file system refuses.
    """
    if place.exists():
        old = new.parents[1] / OLD
        place.rename(old)
        _check(target, old, kind)
    new.rename(place)
    with suppress(OSError):  # of a file system without such a call; all data are on the disk
        sync(place.parent)


def _finish(folder: Path, kind: Kind) -> None:
    """Write the marker of a new result, and flush all its files to the disk."""
    document = {"kind": kind, "format": FORMAT, "files": _digests(folder)}
    write_text(folder / MARKER, json.dumps(document, indent=2) + "\n")
    sync_tree(folder)


def _digests(folder: Path) -> dict[str, str]:
    """Return {relative name: SHA-256} of all files at any depth, in order; "" of what is no regular file, as a link."""
    found: dict[str, str] = {}
    for path in sorted(folder.iterdir()):
        if path.is_dir() and not path.is_symlink():
            found |= {f"{path.name}/{name}": digest for name, digest in _digests(path).items()}
        else:
            found[path.name] = "" if path.is_symlink() or not path.is_file() else sha256_of(path)
    return found


def _check(target: Path, there: Path, kind: Kind) -> None:
    """Raise InputError if `there` holds files that are not of an earlier result; some of its own may be missing."""
    present = _digests(there) if there.exists() else {}
    files: dict[str, str] = {}
    if MARKER in present:
        with suppress(ValueError, KeyError, TypeError, RecursionError):
            marker = json.loads((there / MARKER).read_text(encoding="utf-8"))
            if (marker["kind"], marker["format"]) == (kind, FORMAT):
                files = {**marker["files"], MARKER: present[MARKER]}
    foreign = next((name for name, digest in present.items() if files.get(name) != digest), "")
    if foreign:
        why = (
            f"{foreign} in it is new or changed"
            if files
            else f"it holds {foreign} and is not an earlier result ({kind})"
        )
        raise InputError(
            f"{target} is not replaced: {why}; move that away, or name another folder"
        )


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file, or of a folder's files in order of their names."""
    digest = hashlib.sha256()
    for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
        if file.is_file() and (
            file == path or file.name != MARKER
        ):  # which is about the files, and not in every bag
            with file.open("rb") as stream:
                hashlib.file_digest(stream, lambda: digest)
    return digest.hexdigest()
