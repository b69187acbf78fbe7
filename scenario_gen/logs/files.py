# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""From paths to a raw log: find the files, unpack them, choose the format, read."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
import gzip
from pathlib import Path
from typing import IO
import zipfile
import zlib

from scenario_gen.bags.storage.files import files_of, METADATA
from scenario_gen.base.copies import naming_inputs, renamed
from scenario_gen.base.errors import did_you_mean, guarded, InputError, reading
from scenario_gen.base.folders import scratch
from scenario_gen.base.removed import refuse_removed
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.formats import LOG_FORMATS, LogFormat
from scenario_gen.logs.raw import check_size, RawLog, UnknownFormatError
from scenario_gen.logs.recognise import is_bag, is_packed, is_table, without_packing

_BLOCK_BYTES = 1 << 20
_DAMAGE = (
    OSError,
    EOFError,
    zlib.error,
    zipfile.BadZipFile,
    RuntimeError,  # a password
    NotImplementedError,  # a compression method
)


@contextmanager
def unpacked(paths: Sequence[Path], config: LogConfig) -> Iterator[list[Path]]:
    """Yield the paths; a packed file is replaced by its only file, or a folder of its files.

    Raises:
        InputError: a file is damaged, or too large when unpacked.
    """
    packed = {k: path for k, path in enumerate(paths) if path.is_file() and is_packed(path)}
    if not packed:
        yield list(paths)
        return
    with scratch() as folder:
        targets = {k: folder / str(k) / without_packing(path).name for k, path in packed.items()}
        names = {str(targets[k]): str(path) for k, path in packed.items()}
        with naming_inputs(names):
            left_bytes = config.size_limit << 20
            for k, path in packed.items():
                targets[k].parent.mkdir()
                left_bytes -= _unpack(path, targets[k], left_bytes, config)
            yield [_only_file(targets.get(k, path)) for k, path in enumerate(paths)]


def _unpack(path: Path, target: Path, left_bytes: int, config: LogConfig) -> int:
    """Unpack a .gz to a file, or a .zip to a folder; return the bytes written.

    Raises:
        InputError: the file is damaged, or has more than `left_bytes`.
    """
    with guarded(f"{path} cannot be unpacked", *_DAMAGE):
        if path.suffix.lower() == ".gz":
            with gzip.open(path) as source:
                size = _copy(source, target, left_bytes)
        else:
            size = _unpack_zip(path, target, left_bytes)
    check_size(str(path), (config.size_limit << 20) + size - left_bytes, 0, config)
    return size


def _unpack_zip(path: Path, target: Path, left_bytes: int) -> int:
    """Unpack a .zip to a folder, without its own folders; return the bytes written.

    Raises:
        InputError: two files have the same name.
    """
    size = 0
    target.mkdir()
    with zipfile.ZipFile(path) as archive:
        members = [
            member
            for member in archive.infolist()
            if not member.is_dir() and not _is_hidden(member.filename)
        ]
        for member in members[:10_000]:
            file = target / Path(member.filename).name
            if file.exists():
                raise InputError(
                    f"{path} has two files {file.name}; unpack it, and read one folder at a time"
                )
            with archive.open(member) as source:
                size += _copy(source, file, left_bytes - size)
    return size


def _is_hidden(name: str) -> bool:
    return any(part.startswith((".", "__MACOSX")) for part in name.split("/"))


def _copy(source: IO[bytes] | gzip.GzipFile, target: Path, max_bytes: int) -> int:
    """Copy at most one byte more than `max_bytes`; return the number of bytes."""
    size = 0
    with target.open("wb") as file:
        while size <= max_bytes:
            block = source.read(min(max_bytes + 1 - size, _BLOCK_BYTES))
            if not block:
                break
            file.write(block)
            size += len(block)
    return size


def _only_file(target: Path) -> Path:
    """Return the only file in a folder, else the folder, or the file itself."""
    files = list(target.iterdir()) if target.is_dir() else []
    return files[0] if len(files) == 1 else target


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
