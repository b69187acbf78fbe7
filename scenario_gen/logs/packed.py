# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Packed logs (.gz, .zip), unpacked to temporary files within the bound on sizes."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
import gzip
from pathlib import Path
from typing import IO
import zipfile
import zlib

from scenario_gen.base.copies import naming_inputs, temp_folder
from scenario_gen.base.errors import guarded, InputError
from scenario_gen.base.folders import scratch
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.raw import check_size
from scenario_gen.logs.recognise import is_packed, without_packing

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
    with scratch(temp_folder()) as folder:
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
