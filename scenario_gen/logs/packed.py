# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Logs that are packed, .gz or .zip: unpacked to temporary files while they are read, within the bound on sizes."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
import gzip
from pathlib import Path
from typing import IO
import zipfile
import zlib

from scenario_gen.base.errors import guarded, InputError
from scenario_gen.base.folders import scratch
from scenario_gen.base.stores import naming_objects, temporary
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.formats import is_packed, without_packing
from scenario_gen.logs.raw import check_size

MOST_FILES = 10_000  # in a .zip
DAMAGE = (
    OSError,
    EOFError,
    zlib.error,
    zipfile.BadZipFile,
    RuntimeError,
    NotImplementedError,
)  # or a password, or a method


@contextmanager
def unpacked(paths: Sequence[Path], config: LogConfig) -> Iterator[list[Path]]:
    """Give the paths, those of packed files as the file, or the folder of several files, that is in them.

    Raises:
        InputError: a file is damaged, or too large when unpacked.
    """
    packed = {k: path for k, path in enumerate(paths) if path.is_file() and is_packed(path)}
    if not packed:
        yield list(paths)
        return
    with scratch(temporary()) as place:
        targets = {k: place / str(k) / without_packing(path).name for k, path in packed.items()}
        with naming_objects({str(targets[k]): str(path) for k, path in packed.items()}):
            room = config.size_limit << 20
            for k, path in packed.items():
                targets[k].parent.mkdir()
                room -= _unpack(path, targets[k], room, config)
            yield [_only(targets.get(k, path)) for k, path in enumerate(paths)]


def _unpack(path: Path, target: Path, room: int, config: LogConfig) -> int:
    """Unpack a file to a file, or a .zip to a folder; return the bytes written, at most `room`."""
    size = 0
    with guarded(f"{path} cannot be unpacked", *DAMAGE):
        if path.suffix.lower() == ".gz":
            with gzip.open(path) as source:
                size = _copy(source, target, room)
        else:
            with zipfile.ZipFile(path) as archive:
                members = [
                    one
                    for one in archive.infolist()
                    if not one.is_dir() and not _is_hidden(one.filename)
                ]
                target.mkdir()
                for one in members[:MOST_FILES]:
                    file = target / Path(one.filename).name  # folders in it do not count
                    if file.exists():
                        raise InputError(
                            f"{path} has two files {file.name}; unpack it, and give one folder at a time"
                        )
                    with archive.open(one) as source:
                        size += _copy(source, file, room - size)
    check_size(str(path), (config.size_limit << 20) + size - room, 0, config)
    return size


def _is_hidden(name: str) -> bool:
    return any(part.startswith((".", "__MACOSX")) for part in name.split("/"))


def _copy(source: IO[bytes] | gzip.GzipFile, target: Path, room: int) -> int:
    """Copy bytes, at most one more than there is room for; return how many."""
    with target.open("wb") as file:
        left = room + 1
        while left > 0 and (data := source.read(min(left, 1 << 20))):
            file.write(data)
            left -= len(data)
    return room + 1 - left


def _only(target: Path) -> Path:
    """Return the file that is alone in a folder, else the folder, or the file itself."""
    inside = list(target.iterdir()) if target.is_dir() else []
    return inside[0] if len(inside) == 1 else target
