# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The contents of archives: tables of messages, other logs, and files in no known format."""

from collections.abc import Callable, Iterable, Sequence
import os
from pathlib import Path
from typing import NamedTuple

from scenario_gen.base.errors import InputError
from scenario_gen.corpus.sources import message_table, MessageTable
from scenario_gen.logs import is_bag, is_log, is_table, LOG_FORMATS


class Inventory(NamedTuple):
    """What archives contain.

    Attributes:
        messages: the tables of messages, and how each is read.
        logs: the other logs, each with its files.
        others: the files that are neither.
    """

    messages: list[tuple[Path, MessageTable]]
    logs: list[list[Path]]
    others: list[Path]


def inventory(archives: Sequence[Path], option: str = "") -> Inventory:
    """Return the contents of archives; `option` is the parameter `columns` of logs.

    Raises:
        InputError: a path does not exist, or contains no log.
    """
    total = Inventory([], [], [])
    for archive in archives:
        contents = _inventory_of(archive, option)
        total.messages.extend(contents.messages)
        total.logs.extend(contents.logs)
        total.others.extend(contents.others)
    return total


def _inventory_of(archive: Path, option: str) -> Inventory:
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
