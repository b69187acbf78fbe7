# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Results take their places whole and replace only unchanged earlier ones of their kind.

An earlier result has a marker, a file with its kind and the SHA-256 of every other file.
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

MARKER = ".scenario_gen.json"
FORMAT_VERSION = 1
UNTOUCHED = (
    "; earlier files are unchanged; make room, or name another folder that you may write to"
)
Kind = NewType("Kind", str)
"""A kind of result, as in the markers."""


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
        InputError: as `_place`, or the path cannot be used.
    """
    try:
        return _place(target, inputs)
    except (OSError, RuntimeError, ValueError) as error:  # too long, a loop of links, a null byte
        raise InputError(
            f"{target} cannot be written: {describe(error)}; name another folder"
        ) from error


def _place(target: Path, inputs: Iterable[Path]) -> Path:
    """Return the target's absolute path.

    Raises:
        InputError: no result may be there, or an input is there.
    """
    place = target.resolve()
    existing = next(folder for folder in (place, *place.parents) if folder.exists())
    fault = ""
    if target.is_symlink():
        fault = "is a link; name the folder that it leads to"
    elif not existing.is_dir():
        fault = f"cannot be a folder, because {existing} is a file"
    elif Path.cwd().is_relative_to(place):
        fault = "is the folder that you are in, or above it"
    elif os.path.ismount(place):
        fault = "is a mount point, which cannot be replaced; name a folder in it"
    else:
        for path in inputs:
            if path.resolve().is_relative_to(place):
                fault = f"contains {path}, an input of this command"
    if fault:
        raise InputError(f"{target} {fault}; name another folder")
    return place


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
