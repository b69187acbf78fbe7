# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How a format of logs is recognised, by the name of a file and its first bytes."""

from contextlib import suppress
from pathlib import Path
import zlib

from scenario_gen.bags.storage.files import files_of

HEAD_BYTES = 65_536
"""Part of a file in which the marks of its format are expected."""

_TABLE_SUFFIXES = (".csv", ".tsv", ".txt", ".parquet", ".pq")
_PACKED_SUFFIXES = (".gz", ".zip")


def without_packing(path: Path) -> Path:
    """Return a path without the suffix .gz or .zip."""
    return path.with_suffix("") if is_packed(path) else path


def is_packed(path: Path) -> bool:
    """Return whether a name ends with .gz or .zip."""
    return path.suffix.lower() in _PACKED_SUFFIXES


def is_bag(path: Path) -> bool:
    """Return whether a path is the folder of a bag, or a single .mcap, .db3 or .bag file."""
    return bool(files_of(path).files)


def is_spmd(path: Path) -> bool:
    """Return whether half of a file's first lines have the 19 numbers of SPMD's messages.

    Its first line has no names, even if it is damaged.
    """
    if without_packing(path).suffix.lower() not in (".csv", ".txt"):
        return False
    lines = head_of(path).decode("utf-8-sig", errors="replace").splitlines()[:10]
    rows = [[field.strip(' "') for field in line.split(",")] for line in lines]
    n_messages = sum(len(row) == 19 and all(map(_is_number_or_empty, row)) for row in rows)
    return 0 < len(rows) <= 2 * n_messages and any(map(_is_number, rows[0]))


def is_sumo(path: Path) -> bool:
    """Return whether a file has SUMO's floating-car data, or the net or lights that go with it."""
    marks = (b"<fcd-export", b"<tlsStates", b"<net ")
    return path.suffix.lower() == ".xml" and any(mark in _head(path) for mark in marks)


def is_bsm(path: Path) -> bool:
    """Return whether a file has messages of J2735, in JSON or in a table made from it."""
    if path.suffix.lower() == ".csv":
        return b"coredata_position_lat" in _head(path).lower()
    is_json = path.suffix.lower() in (".json", ".jsonl", ".ndjson", ".txt")
    head = _head(path).lower()
    return is_json and b'"coredata"' in head


def is_table(path: Path) -> bool:
    """Return whether a name is that of a table, possibly packed."""
    return without_packing(path).suffix.lower() in _TABLE_SUFFIXES


def starts_with(path: Path, mark: bytes, *suffixes: str) -> bool:
    """Return whether a file has one of these suffixes and the mark near its beginning."""
    return path.suffix.lower() in suffixes and mark in _head(path)


def _is_number_or_empty(text: str) -> bool:
    return not text or _is_number(text)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def head_of(path: Path, size: int = HEAD_BYTES) -> bytes:
    """Return the first bytes of a file, unpacked if it is a .gz; none of a folder."""
    head = _head(path, size)
    if path.suffix.lower() == ".gz":
        with suppress(zlib.error):
            return zlib.decompressobj(wbits=31).decompress(head, size)
    return head


def _head(path: Path, size: int = HEAD_BYTES) -> bytes:
    """Return the first bytes of a file; none of a folder."""
    if not path.is_file():
        return b""
    with path.open("rb") as file:
        return file.read(size)
