# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""From paths to a raw log: find the files, unpack them, choose the format, read."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from scenario_gen.bags.storage.files import files_of, METADATA
from scenario_gen.base.copies import renamed
from scenario_gen.base.errors import did_you_mean, guarded, InputError, reading
from scenario_gen.base.removed import refuse_removed
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.formats import LOG_FORMATS, LogFormat
from scenario_gen.logs.packed import unpacked
from scenario_gen.logs.raw import RawLog, UnknownFormatError
from scenario_gen.logs.recognise import is_bag, is_table, without_packing


def read_raw(paths: Sequence[Path], config: LogConfig) -> RawLog:
    """Read one log from files or a folder, in the first format that accepts all files.

    Raises:
        InputError: a path does not exist, no format accepts it, or its reader fails.
    """
    with guarded(str(paths[0]), OSError):  # no permission, name too long, removed meanwhile
        packed_files = [file for path in paths for file in log_files(path)]
    with unpacked(packed_files, config) as unpacked_paths:
        files = [file for path in unpacked_paths for file in log_files(path)]
        log_format = _format_of(files, config)
        with reading(files[0]):
            log: RawLog = log_format.read(files, config)
        segments = (replace(segment, label=renamed(segment.label)) for segment in log.segments)
        return replace(log, segments=tuple(segments))


def _format_of(files: Sequence[Path], config: LogConfig) -> LogFormat:
    """Return the format that the parameter names, or the first one that accepts all files.

    Raises:
        InputError: the parameter names no format, or one that was removed.
        UnknownFormatError: no format accepts them.
    """
    if config.format != "auto":
        refuse_removed(f"log.format={config.format}")
        return LOG_FORMATS[config.format]
    with guarded(str(files[0]), OSError):
        for log_format in LOG_FORMATS.values():
            if all(map(log_format.accepts, files)):
                return log_format
    refuse_removed(files[0].suffix.lower(), str(files[0]))
    raise UnknownFormatError(
        f"{files[0]} is not in a known log format ({', '.join(LOG_FORMATS.names())}; each may be "
        "packed as .gz or .zip); if its name misleads, name the format: --set log.format=table"
    )


def _check_exists(path: Path) -> None:
    """Check that a path is a file or a folder with content.

    Raises:
        InputError: it is not.
    """
    if path.is_file():
        if path.stat().st_size == 0:
            raise InputError(f"{path} is empty (0 bytes); copy it again")
    elif path.is_dir():
        if not any(path.iterdir()):
            raise InputError(f"{path} is an empty folder; name a folder with a recording")
    elif path.exists():
        raise InputError(f"{path} is neither a file nor a folder")
    else:
        neighbours = [file.name for file in path.parent.iterdir()] if path.parent.is_dir() else []
        raise InputError(
            f"{path} does not exist; check the name and the folder"
            f"{did_you_mean(path.name, neighbours)}"
        )


def logs_in(paths: Sequence[Path]) -> list[list[Path]]:
    """Return the logs of paths: a folder with bags and tables has several, other paths are one."""
    if len(paths) > 1:
        return [list(paths)]
    with guarded(str(paths[0]), OSError):
        return _logs_in_folder(paths[0]) or [list(paths)]


def _logs_in_folder(folder: Path) -> list[list[Path]]:
    """Return the logs of a folder with bags and tables; none of other folders, or of files."""
    if not folder.is_dir() or (folder / METADATA).exists():
        return []
    files = files_of(folder).files
    tables = sorted(file for file in folder.iterdir() if is_table(file) and file.stat().st_size)
    return [list(files), tables] if files and tables else []


def log_files(path: Path) -> list[Path]:
    """Return the files of a path: the tables of a folder; a file or the folder of a bag itself.

    Raises:
        InputError: nothing there can be read.
    """
    _check_exists(path)
    if path.is_file() or is_bag(path):
        return [path]
    tables = {file for file in path.iterdir() if is_table(file) and file.stat().st_size}
    packed_again = {
        file
        for file in tables
        if without_packing(file) != file and without_packing(file) in tables
    }
    return sorted(tables - packed_again) or [path]
