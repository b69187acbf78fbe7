# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The layout of a text table: encoding, separator, decimal sign, lines above the header."""

import codecs
from dataclasses import dataclass
from pathlib import Path
import re

from scenario_gen.logs.raw import UnknownFormatError
from scenario_gen.logs.recognise import head_of, is_spmd

_MAX_HEADER_BYTES = 65_536
_SAMPLE_LINE_COUNT = 20  # lines below the header that may show a decimal comma
_SEPARATORS = ",;\t|"
_WHITE_SPACE = r"\s+"
_COMMENTS = ("#", "//", "%", "sep=")
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_NUMBER_WITH_COMMA = re.compile(r"[-+]?\d*,\d+")


_POSE_COLUMNS = ("timestamp", "x", "y", "z", "qx", "qy", "qz", "qw")
_POSE_NOTE = "the file has no header: read as the trajectory of one vehicle, as of TUM"
_MAX_LENGTH_ERROR_RATIO = 0.01  # of the quaternion of a rotation
_UNNAMED = "unnamed"
SPMD_COLUMNS = [
    "RxDevice",
    "FileId",
    "TxDevice",
    "Gentime",
    "TxRandom",
    "MsgCount",
    "DSecond",
    "Latitude",
    "Longitude",
    "Elevation",
    "Speed",
    "Heading",
    "Ax",
    "Ay",
    "Az",
    "Yawrate",
    "PathCount",
    "RadiusOfCurve",
    "Confidence",
]
"""Columns of basic safety messages in the Safety Pilot Model Deployment, which has no header."""

READ_OPTIONS = {
    "skipinitialspace": True,
    "skip_blank_lines": False,
    "compression": None,
    "low_memory": False,
}
"""How pandas reads every text table: a row for each line, and no archive by its suffix."""


@dataclass(frozen=True)
class Layout:
    """How a table is written.

    Attributes:
        encoding: of its text.
        separator: between fields.
        decimal: sign before decimals.
        above: number of lines above the header; -1: the format has names, the file no header.
        names: of the columns, if a comment has them; the comment is then the header.
        notes: on what is unusual.
    """

    encoding: str = "utf-8-sig"
    separator: str = ","
    decimal: str = "."
    above: int = 0
    names: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def _first_lines(path: Path) -> tuple[str, list[str]]:
    """Return the encoding and the first lines of a file, unpacked if it is a .gz.

    Raises:
        UnknownFormatError: it is not text.
    """
    start = head_of(path, 4 * _MAX_HEADER_BYTES)
    encoding = "utf-8-sig"
    if start.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        encoding = "utf-16"
    elif b"\0" in start[:4096]:
        raise UnknownFormatError(
            f"{path} is not a text file (or UTF-16 without a byte order mark); save the table as "
            "UTF-8 text"
        )
    return encoding, start.decode(encoding, errors="replace").splitlines()


def _separator(header: str) -> str:
    """Return what separates the names in a header, as pandas understands it."""
    separator = max(_SEPARATORS, key=header.count)
    if separator not in header and len(header.split()) > 1:
        return _WHITE_SPACE
    return separator


def layout_of(path: Path) -> Layout:
    """Return the layout of a text table.

    Raises:
        UnknownFormatError: it is not text, its first line is too long, or has no column names.
    """
    if is_spmd(path):
        return Layout(above=-1, names=tuple(SPMD_COLUMNS))
    encoding, lines = _first_lines(path)
    above = next((k for k, line in enumerate(lines) if not _is_comment(line)), 0)
    header, *rows = lines[above : above + _SAMPLE_LINE_COUNT + 1] or [""]
    if len(header) >= _MAX_HEADER_BYTES:
        raise UnknownFormatError(
            f"{path} is not a table: its first line has {_MAX_HEADER_BYTES} characters or more"
        )
    separator = _separator(header)
    pattern = separator if separator == _WHITE_SPACE else re.escape(separator)
    first = re.split(pattern, header.strip())
    names = _names_in_comment(lines[above - 1], pattern, first) if above else ()
    if names:
        above -= 1
    elif _is_pose(first) and separator == _WHITE_SPACE:
        return Layout(encoding, separator, above=-1, names=_POSE_COLUMNS, notes=(_POSE_NOTE,))
    else:
        _check_names(first, path, above + 1)
        names = _names_with_rest(first, rows, separator)
    notes = ["the file is UTF-16"] if encoding == "utf-16" else []
    decimal = _decimal_sign([header, *rows], separator, pattern)
    if decimal == ",":
        notes.append("its numbers have a decimal comma")
    return Layout(encoding, separator, decimal, above, names, tuple(notes))


def _names_with_rest(first: list[str], rows: list[str], separator: str) -> tuple[str, ...]:
    """Return the names if there is a field behind the separator at the end of rows, else none."""
    ends = [row.rstrip() for row in rows if row.strip()]
    has_rest = bool(ends) and all(end.endswith(separator) for end in ends) and bool(first[-1])
    return (*first, _UNNAMED) if has_rest else ()


def _decimal_sign(lines: list[str], separator: str, pattern: str) -> str:
    """Return the sign before decimals in lines whose fields a pattern separates."""
    fields = (field.strip() for line in lines for field in re.split(pattern, line))
    return "," if separator != "," and any(map(_NUMBER_WITH_COMMA.fullmatch, fields)) else "."


def _names_in_comment(line: str, pattern: str, first: list[str]) -> tuple[str, ...]:
    """Return the names in the comment above a first row of numbers, if there is one per field."""
    if not _are_numbers(first):
        return ()
    text = line.strip().lstrip("#/%").strip()
    for separator in (pattern, ",", _WHITE_SPACE):
        names = [name.strip() for name in re.split(separator, text)]
        if len(names) == len(first) and all(names) and not _are_numbers(names):
            return tuple(names)
    return ()


def _is_pose(fields: list[str]) -> bool:
    """Return whether the fields of a row are a stamp, a place and a rotation, as of TUM."""
    if len(fields) != len(_POSE_COLUMNS) or not all(map(_NUMBER.fullmatch, fields)):
        return False
    return abs(sum(float(field) ** 2 for field in fields[4:]) - 1.0) < _MAX_LENGTH_ERROR_RATIO


def _are_numbers(fields: list[str]) -> bool:
    """Return whether most fields are numbers."""
    return sum(bool(_NUMBER.fullmatch(field.strip())) for field in fields) > len(fields) / 2


def _is_comment(line: str) -> bool:
    """Return whether a line above the header is empty or a comment."""
    text = line.strip().strip('"').lower()
    return not text or text.startswith(_COMMENTS)


def _check_names(names: list[str], path: Path, line: int) -> None:
    """Check that most fields of a header are names.

    Raises:
        UnknownFormatError: they are numbers.
    """
    if _are_numbers(names):
        raise UnknownFormatError(
            f"{path}: line {line} has numbers instead of column names; insert a line such as "
            "t,id,x,y,speed above it"
        )
