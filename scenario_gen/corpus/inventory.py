# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The contents of archives: tables of messages, other logs, and what cannot be read."""

from collections.abc import Callable, Iterable, Sequence
import os
from pathlib import Path
import stat
from typing import NamedTuple

from scenario_gen.base.errors import InputError, printable
from scenario_gen.corpus.sources import message_table, MessageTable
from scenario_gen.logs import is_bag, is_log, is_table, LOG_FORMATS


class Inventory(NamedTuple):
    """What archives contain.

    Attributes:
        messages: the tables of messages, and how each is read.
        logs: the other logs, each with its files.
        others: the files that are neither.
        unreadable: sentences about the entries that are no files, by name.
    """

    messages: list[tuple[Path, MessageTable]]
    logs: list[list[Path]]
    others: list[Path]
    unreadable: dict[str, str]


def inventory(archives: Sequence[Path], option: str = "") -> Inventory:
    """Return the contents of archives; `option` is the parameter `columns` of logs.

    Raises:
        InputError: a path does not exist, or contains no log.
    """
    total = Inventory([], [], [], {})
    for archive in archives:
        contents = _inventory_of(archive, option)
        total.messages.extend(contents.messages)
        total.logs.extend(contents.logs)
        total.others.extend(contents.others)
        total.unreadable.update(contents.unreadable)
    return total


def _inventory_of(archive: Path, option: str) -> Inventory:
    """Return the contents of a folder, or what a file is."""
    if not archive.exists():
        raise InputError(f"{archive} does not exist")
    if archive.is_dir() and is_bag(archive) and not _has_other_logs(archive):
        return Inventory([], [[archive]], [], {})
    entries = [archive] if archive.is_file() else _visible_entries(archive)
    unreadable = {path: why for path in entries if (why := _fault(path))}
    contents = _sorted_files([path for path in entries if path not in unreadable], option)
    if not contents.messages and _is_one_log(contents.logs, archive):
        contents = contents._replace(logs=[[path for (path,) in contents.logs]])
    _check_logs([*contents.messages, *contents.logs], archive)
    named = {printable(str(path)): why for path, why in unreadable.items()}
    return contents._replace(unreadable=named)


def _sorted_files(paths: Sequence[Path], option: str) -> Inventory:
    """Return files by what they are."""
    tables = {path: message_table(path, option) for path in paths}
    messages = [(path, table) for path, table in tables.items() if table]
    bags, rest = _split_bags([path for path in paths if not tables[path]])
    files, others = _split(rest, _may_be_log)
    return Inventory(messages, [[path] for path in (*files, *bags)], others, {})


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
    files = _visible_entries(folder)
    is_whole = any(path.name == "metadata.yaml" for path in files)
    return not is_whole and any(is_table(path) for path in files)


def _is_one_log(logs: Sequence[Sequence[Path]], folder: Path) -> bool:
    """Whether the logs of a folder are the tables of one log, and no bags."""
    files = [path for log in logs for path in log]
    return bool(files) and all(path.parent == folder and is_table(path) for path in files)


def _split_bags(paths: Iterable[Path]) -> tuple[list[Path], list[Path]]:
    """Return the bags among files (folders and single files), and the files outside of them."""
    parents = {path.parent for path in paths if path.name == "metadata.yaml"}
    folders = {folder for folder in parents if is_bag(folder)}
    files, rest = _split([path for path in paths if folders.isdisjoint(path.parents)], is_bag)
    return [*sorted(folders), *files], rest


def _visible_entries(folder: Path) -> list[Path]:
    """Return the files in a folder at any depth, and the folders that cannot be entered."""
    entries: list[Path] = []
    walk = os.walk(folder, onerror=lambda error: entries.append(Path(error.filename)))
    for parent, folders, names in walk:
        links = [name for name in folders if Path(parent, name).is_symlink()]
        entries += [Path(parent, name) for name in (*names, *links) if not name.startswith(".")]
    return sorted(entries)


def _fault(path: Path) -> str:
    """Return why an entry of a folder is no file that can be read; "" if it is one."""
    name = printable(str(path))
    try:
        str(path).encode()
        mode = path.stat().st_mode
    except UnicodeEncodeError:
        return f"{name}: the name is not UTF-8; rename it"
    except OSError as error:
        return f"{name}: {error.strerror}{' (a link)' if path.is_symlink() else ''}"
    if stat.S_ISDIR(mode):
        remedy = "name its folder as an archive, too" if path.is_symlink() else "check its rights"
        return f"{name}: folder is not entered; {remedy}"
    return "" if stat.S_ISREG(mode) else f"{name} is not a file"


def _split(paths: Iterable[Path], chosen: Callable[[Path], bool]) -> tuple[list[Path], list[Path]]:
    """Return the chosen paths, and the others."""
    parts: tuple[list[Path], list[Path]] = ([], [])
    for path in paths:
        parts[not chosen(path)].append(path)
    return parts
