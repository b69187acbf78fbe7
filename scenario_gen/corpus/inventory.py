# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The contents of archives: files of messages (SPMD), other logs, and files in no known format."""

from collections.abc import Callable, Iterable, Sequence
import os
from pathlib import Path
from typing import Generic, NamedTuple, TypeVar

from scenario_gen.base.errors import InputError
from scenario_gen.base.folders import scratch
from scenario_gen.base.stores import (
    download,
    naming_objects,
    Part,
    Place,
    relative_name,
    Remote,
    temp_folder,
)
from scenario_gen.logs import is_bag, is_log, is_spmd, is_table, LOG_FORMATS

HEAD_BYTES = 16_384  # of an object, by which its format is recognised

AnyPlace = TypeVar("AnyPlace", bound=Place)


class Inventory(NamedTuple, Generic[AnyPlace]):
    """What archives contain.

    Attributes:
        messages: the SPMD files.
        logs: the other logs, each with its files.
        others: the files that are neither.
    """

    messages: list[AnyPlace]
    logs: list[list[AnyPlace]]
    others: list[AnyPlace]


def inventory(archives: Sequence[Place]) -> Inventory[Place]:
    """Return the contents of archives.

    Raises:
        InputError: a path does not exist, or contains no log.
    """
    total = Inventory[Place]([], [], [])
    for archive in archives:
        contents: Inventory[Place]
        if isinstance(archive, Remote):
            contents = _inventory_of_store(archive)
        else:
            files = _inventory_of_folder(archive)
            contents = Inventory(
                [*files.messages], [[*log] for log in files.logs], [*files.others]
            )
        total.messages.extend(contents.messages)
        total.logs.extend(contents.logs)
        total.others.extend(contents.others)
    return total


def _inventory_of_store(archive: Remote) -> Inventory[Place]:
    """Return the contents of a store, from copies of the beginnings of its objects."""
    single = archive.with_size()
    objects = [single] if single.size >= 0 else list(archive.rglob("*"))
    if not objects:
        raise InputError(f"{archive} does not exist, or is empty")
    with scratch(temp_folder()) as folder:
        root = folder / archive.name
        places: dict[Path, Place] = {
            root if item is single else root / relative_name(item, archive): item
            for item in objects
        }
        parts = [
            Part(item, 0, min(item.size, HEAD_BYTES), path)
            for path, item in zip(places, objects, strict=True)
        ]
        download(parts)
        for path in list(places):
            places |= _folder_places(path, root, archive)
        with naming_objects({str(root): archive.url}):
            files = _inventory_of_folder(root)
        return Inventory(
            [places[path] for path in files.messages],
            [[places[path] for path in log] for log in files.logs],
            [places[path] for path in files.others],
        )


def _folder_places(path: Path, root: Path, archive: Remote) -> dict[Path, Place]:
    """Return the folders with a file, up to the root, with their places in the store."""
    places: dict[Path, Place] = {}
    for folder in path.parents:
        if folder == root:
            places[folder] = archive
        elif folder.is_relative_to(root):
            places[folder] = archive / folder.relative_to(root).as_posix()
    return places


def _inventory_of_folder(archive: Path) -> Inventory[Path]:
    """Return the contents of a folder, or what a file is."""
    if not archive.exists():
        raise InputError(f"{archive} does not exist")
    if archive.is_file() or (is_bag(archive) and not _has_other_logs(archive)):
        return _inventory_of_file(archive)
    messages, rest = _split(_visible_files(archive), is_spmd)
    bags, rest = _split_bags(rest)
    files, others = _split(rest, is_log)
    logs = [[path] for path in (*files, *bags)]
    if not messages and not bags and _is_one_log(files, archive):
        logs = [files]
    if not messages and not logs:
        names = ", ".join(LOG_FORMATS.names())
        raise InputError(f"{archive} has no log in a known format ({names})")
    return Inventory(messages, logs, others)


def _has_other_logs(folder: Path) -> bool:
    """Whether a folder with files of bags has tables, too, and no metadata that makes it a bag."""
    files = _visible_files(folder)
    is_whole = any(path.name == "metadata.yaml" for path in files)
    return not is_whole and any(is_table(path) for path in files)


def _is_one_log(files: Sequence[Path], folder: Path) -> bool:
    """Whether the files of a folder are the tables of one log."""
    return bool(files) and all(path.parent == folder and is_table(path) for path in files)


def _inventory_of_file(path: Path) -> Inventory[Path]:
    """Return the inventory of one file or bag."""
    if is_spmd(path):
        return Inventory([path], [], [])
    return Inventory([], [[path]], [])


def _split_bags(paths: Iterable[Path]) -> tuple[list[Path], list[Path]]:
    """Return the bags among files (folders and single files), and the files outside of them."""
    parents = {path.parent for path in paths if path.name == "metadata.yaml"}
    folders = {folder for folder in parents if is_bag(folder)}
    files, rest = _split([path for path in paths if folders.isdisjoint(path.parents)], is_bag)
    return [*sorted(folders), *files], rest


def _visible_files(folder: Path) -> list[Path]:
    return sorted(
        Path(parent, name)
        for parent, _, names in os.walk(folder)
        for name in names
        if not name.startswith(".")
    )


def _split(paths: Iterable[Path], chosen: Callable[[Path], bool]) -> tuple[list[Path], list[Path]]:
    """Return the chosen paths, and the others."""
    parts: tuple[list[Path], list[Path]] = ([], [])
    for path in paths:
        parts[not chosen(path)].append(path)
    return parts
