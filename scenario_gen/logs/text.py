# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How a table in text is written: its encoding, what separates its fields, and its decimal sign."""

import codecs
from dataclasses import dataclass
from pathlib import Path
import re

from scenario_gen.logs.raw import LONGEST_HEADER, UnknownFormatError

NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
WITH_COMMA = re.compile(r"[-+]?\d*,\d+")
LOOKED_AT = 20  # lines after the header in which a decimal comma is looked for
SEPARATORS = ",;\t|"
EXAMPLE = "t,id,x,y,speed"


@dataclass(frozen=True)
class Layout:
    """How a table is written, and how many lines stand above its header; `notes` says what is unusual about it."""

    encoding: str = "utf-8-sig"
    separator: str = ","
    decimal: str = "."
    above: int = 0
    notes: tuple[str, ...] = ()


def layout_of(path: Path) -> Layout:
    """Return how a table in text is written.

    Raises:
        InputError: it is no text, its first line is too long, or has no names of columns.
    """
    with path.open("rb") as file:
        start = file.read(4 * LONGEST_HEADER)
    is_utf16 = start.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    if not is_utf16 and b"\0" in start:
        raise UnknownFormatError(
            f"{path} is not a text file (or UTF-16 without a byte order mark); save the table as UTF-8 text"
        )
    encoding = "utf-16" if is_utf16 else "utf-8-sig"
    text = start.decode(encoding, errors="replace").splitlines()
    said = (line.strip().strip('"').lower() for line in text)
    above = next(
        (
            k
            for k, line in enumerate(said)
            if line and not line.startswith(("#", "//", "%", "sep="))
        ),
        0,
    )
    header, *lines = text[above : above + LOOKED_AT + 1] or [""]
    if len(header) >= LONGEST_HEADER:
        raise UnknownFormatError(
            f"{path} is no table: its first line has {LONGEST_HEADER} characters or more"
        )
    separator = max(SEPARATORS, key=header.count)
    if separator not in header and len(header.split()) > 1:
        separator = r"\s+"
    names = re.split(separator if separator == r"\s+" else re.escape(separator), header.strip())
    if len([name for name in names if NUMBER.fullmatch(name.strip())]) > len(names) / 2:
        raise UnknownFormatError(
            f"{path}: line {above + 1} has numbers instead of column names; put a line such as {EXAMPLE} above it"
        )
    has_comma = separator != "," and any(
        WITH_COMMA.fullmatch(field.strip())
        for line in lines
        for field in re.split(separator.replace("|", r"\|"), line)
    )
    notes = ["the file is UTF-16"] if is_utf16 else []
    notes += ["its numbers have a decimal comma"] if has_comma else []
    return Layout(encoding, separator, "," if has_comma else ".", above, tuple(notes))
