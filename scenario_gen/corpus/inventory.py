# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The contents of archives: tables of messages, other logs, and files in no known format."""

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
from scenario_gen.corpus.sources import is_parquet, message_table, MessageTable
from scenario_gen.logs import is_bag, is_log, is_table, LOG_FORMATS

HEAD_BYTES = 16_384  # of an object, by which its format is recognised

AnyPlace = TypeVar("AnyPlace", bound=Place)


class Inventory(NamedTuple, Generic[AnyPlace]):
    """What archives contain.

    Attributes:
        messages: the tables of messages, and how each is read.
        logs: the other logs, each with its files.
        others: the files that are neither.
    """

    messages: list[tuple[AnyPlace, MessageTable]]
    logs: list[list[AnyPlace]]
    others: list[AnyPlace]


def inventory(archives: Sequence[Place], option: str = "") -> Inventory[Place]:
    """Return the contents of archives; `option` is the parameter `columns` of logs.

    Raises:
        InputError: a path does not exist, or contains no log.
    """
    total = Inventory[Place]([], [], [])
    for archive in archives:
        contents: Inventory[Place]
        if isinstance(archive, Remote):
            contents = _inventory_of_store(archive, option)
        else:
            files = _inventory_of_folder(archive, option)
            contents = Inventory(
                [*files.messages], [[*log] for log in files.logs], [*files.others]
            )
        total.messages.extend(contents.messages)
        total.logs.extend(contents.logs)
        total.others.extend(contents.others)
    return total


def _inventory_of_store(archive: Remote, option: str) -> Inventory[Place]:
    """Return the contents of a store, from copies of the beginnings or ends of its objects."""
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
        download(_sample(item, path) for path, item in zip(places, objects, strict=True))
        for path in list(places):
            places |= _folder_places(path, root, archive)
        with naming_objects({str(root): archive.url}):
            files = _inventory_of_folder(root, option)
        return Inventory(
            [(places[path], table) for path, table in files.messages],
            [[places[path] for path in log] for log in files.logs],
            [places[path] for path in files.others],
        )


def _sample(item: Remote, copy: Path) -> Part:
    """Return the bytes of an object that show its format: at the end of Parquet."""
    if is_parquet(copy):
        # The columns of a table are at its end.
        return Part(item, max(item.size - 16 * HEAD_BYTES, 0), item.size, copy)
    return Part(item, 0, min(item.size, HEAD_BYTES), copy)


def _folder_places(path: Path, root: Path, archive: Remote) -> dict[Path, Place]:
    """Return the folders with a file, up to the root, with their places in the store."""
    places: dict[Path, Place] = {}
    for folder in path.parents:
        if folder == root:
            places[folder] = archive
        elif folder.is_relative_to(root):
            places[folder] = archive / folder.relative_to(root).as_posix()
    return places


def _inventory_of_folder(archive: Path, option: str) -> Inventory[Path]:
    """Return the contents of a folder, or what a file is."""
    if not archive.exists():
        raise InputError(f"{archive} does not exist")
    if archive.is_dir() and is_bag(archive) and not _has_other_logs(archive):
        return Inventory([], [[archive]], [])
    paths = [archive] if archive.is_file() else _visible_files(archive)
    tables = {path: message_table(path, option) for path in paths}
    messages = [(path, table) for path, table in tables.items() if table]
    bags, rest = _split_bags([path for path in paths if not tables[path]])
    files, others = _split(rest, _may_be_log)
    logs = [[path] for path in (*files, *bags)]
    if len(files) + len(others) == len(paths) and _is_one_log(files, archive):
        logs = [files]
    _check_logs([*messages, *logs], archive)
    return Inventory(messages, logs, others)


def _check_logs(logs: Sequence[object], archive: Path) -> None:
    """Check that there is a log.

    Raises:
        InputError: there is none.
    """
    if not logs:
        names = ", ".join(LOG_FORMATS.names())
        raise InputError(f"{archive} has no log in a known format ({names})")


def _may_be_log(path: Path) -> bool:
    """Return whether a file is a log, or cannot be read: its reader names the reason."""
    try:
        return is_log(path)
    except OSError:
        return True


def _has_other_logs(folder: Path) -> bool:
    """Whether a folder with files of bags has tables, too, and no metadata that makes it a bag."""
    files = _visible_files(folder)
    is_whole = any(path.name == "metadata.yaml" for path in files)
    return not is_whole and any(is_table(path) for path in files)


def _is_one_log(files: Sequence[Path], folder: Path) -> bool:
    """Whether the files of a folder are the tables of one log."""
    return bool(files) and all(path.parent == folder and is_table(path) for path in files)


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
