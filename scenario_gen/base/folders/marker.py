# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Markers by which earlier results are recognised: a file that holds a result's kind and the SHA-256 of every file."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
import hashlib
import json
import os
from pathlib import Path, PurePosixPath
from typing import Any

from scenario_gen.base.folders.disk import is_gone, sync_tree, write_text

MARKER = ".scenario_gen.json"
FORMAT = 1


@dataclass(frozen=True)
class Kind:
    """A kind of result: its name in the marker, and how a folder of a version without markers is recognised."""

    name: str
    unmarked: Callable[[Path], bool] = lambda _: False


def finish(folder: Path, kind: Kind) -> None:
    """Write the marker of a new result, after all its other files, and flush all of them to the disk.

    Raises:
        OSError: a file cannot be read or written; it is named.
    """
    files = {name: _digest(folder / name) for name in sorted(entries(folder))}
    partial = folder / f"{MARKER}.partial"
    write_text(partial, json.dumps({"kind": kind.name, "format": FORMAT, "files": files}, indent=2) + "\n")
    partial.replace(folder / MARKER)
    sync_tree(folder)


def entries(folder: Path, above: str = "") -> Iterator[str]:
    """Yield the relative name of everything below a folder: files, links, and folders (with a slash) that are empty."""
    with os.scandir(folder) as listing:
        listed = list(listing)
    if above and not listed:
        yield above
    for entry in listed:
        if entry.is_dir(follow_symlinks=False):
            yield from entries(Path(entry.path), f"{above}{entry.name}/")
        else:
            yield f"{above}{entry.name}"


def is_marked(folder: Path) -> bool:
    """Return whether a folder has a marker, whatever its content, or may have one."""
    return not is_gone(folder / MARKER)


def objection(folder: Path, kind: Kind | None) -> str:
    """Return why a folder may not be replaced or removed, "" if it may; missing files of a result are no reason.

    Args:
        folder: it exists.
        kind: that the result must be of; None takes any that is marked.

    Raises:
        OSError: it cannot be read.
    """
    present = sorted(entries(folder))
    if not present:
        return ""
    if not is_marked(folder):
        earlier = kind is not None and kind.unmarked(folder)
        return "" if earlier else f"it holds {present[0]} and is not an earlier result"
    marker = _read(folder / MARKER)
    if marker is None:
        return f"its {MARKER} is not one that this version writes, so it is not an earlier result"
    if kind is not None and marker["kind"] != kind.name:
        return f"it is a result of another kind ({marker['kind']}, not {kind.name})"
    emptied = {f"{above}/" for file in marker["files"] for above in PurePosixPath(file).parents}  # by a removal cut short
    for name in present:
        if name == MARKER or name in emptied:
            continue
        if name not in marker["files"]:
            return f"it holds {name}, which is not of the earlier result there"
        if marker["files"][name] != _digest(folder / name):
            return f"{name} in it was changed since it was written"
    return ""


def _digest(path: Path) -> str:
    """Return the SHA-256 of a regular file, "" for a link or any other kind of file."""
    if path.is_symlink() or not path.is_file():
        return ""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _read(path: Path) -> dict[str, Any] | None:
    """Return the marker, None if it is not as this version writes it."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError):
        return None
    shape = {"kind": str, "format": int, "files": dict}
    if not isinstance(document, dict) or document.keys() != shape.keys() or document["format"] != FORMAT:
        return None
    return document if all(isinstance(document[key], of) for key, of in shape.items()) else None


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file, or of a folder's files in order of their names."""
    digest = hashlib.sha256()
    for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
        if file.is_file() and file.name != MARKER:  # which is about the files, and not in every bag
            digest.update(file.read_bytes())
    return digest.hexdigest()
