# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The journal of a search: one line for each drive. A search that is continued reads it."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
import json
from pathlib import Path
from typing import Any, TextIO
from zlib import crc32

from scenario_gen.base.documents import COUNT, NUMBER, parse_json, read_text
from scenario_gen.base.errors import InputError, of_system
from scenario_gen.base.folders import write_text
from scenario_gen.closed_loop.search.response import Response

MAX_JOURNAL_BYTES = 1 << 30  # some 10 million drives
REMEDY = "; move it away, or give another --out"
_TEXT = {"type": "string"}
_RESPONSE = [NUMBER, {"type": "array", "items": NUMBER}, _TEXT, {"type": "array", "items": _TEXT}]
_DRIVE = {"type": "array", "prefixItems": [COUNT, *_RESPONSE, COUNT], "minItems": 6, "maxItems": 6}
LINES = {"type": "array", "prefixItems": [{"type": "object"}], "items": _DRIVE, "minItems": 1}


@dataclass(frozen=True, eq=False)
class Journal:
    """The drives of a search.

    Attributes:
        known: responses of the drives in the file.
        file: open for further drives.
    """

    known: list[Response]
    file: TextIO

    def add(self, response: Response) -> None:
        """Append the response of a drive."""
        self.known.append(response)
        self.file.write(_line(len(self.known), response))
        self.file.flush()


def _line(number: int, response: Response) -> str:
    """Return the line of a drive: number from 1, margin, parts, kind, events and checksum."""
    values = [number, response.margin, list(response.parts), response.kind, list(response.events)]
    text = json.dumps(values)
    return f"{text[:-1]}, {crc32(text.encode())}]\n"


def read_journal(path: Path) -> tuple[dict[str, Any], list[Response], bool]:
    """Return the identity of the search, its drives, and whether the last line is complete.

    An incomplete last line is left out.

    Raises:
        InputError: it is a link, no regular file, no journal, or was changed.
    """
    invalid = f"{path} is no journal of a search"
    if path.is_symlink():
        raise InputError(f"{path} is a link{REMEDY}")
    lines = read_text(path, MAX_JOURNAL_BYTES, invalid).split("\n")  # not at other line ends
    try:
        head, *drives = parse_json(f"[{','.join(lines[:-1])}]", invalid, LINES)
    except InputError as error:
        raise InputError(f"{error}{REMEDY}") from error
    known = [
        Response(float(margin), tuple(parts), kind, tuple(events))
        for _, margin, parts, kind, events, _ in drives
    ]
    for number, (response, line) in enumerate(zip(known, lines[1:], strict=False), start=1):
        if _line(number, response) != f"{line}\n":
            raise InputError(f"{path}, line {number + 1}: not as a search wrote it{REMEDY}")
    return head, known, lines[-1] == ""


@contextmanager
def open_journal(path: Path, identity: Mapping[str, Any]) -> Iterator[Journal]:
    """Yield the journal at a path; create it if it does not exist.

    Args:
        path: of the journal.
        identity: everything that determines the drives.

    Raises:
        InputError: the file belongs to another search, is no journal, or cannot be written.
    """
    head = json.loads(json.dumps(identity))
    known: list[Response] = []
    try:
        if path.is_symlink() or (path.exists() and (not path.is_file() or path.stat().st_size)):
            saved, known, is_complete = read_journal(path)
            names = head.keys() | saved.keys()
            different = sorted(name for name in names if saved.get(name) != head.get(name))
            if different:
                raise InputError(
                    f"{path} has the drives of another search ({', '.join(different)} differ)"
                    f"{REMEDY}"
                )
        else:
            path.parent.mkdir(parents=True, exist_ok=True)
            is_complete = False
        if not is_complete:
            lines = [_line(number, drive) for number, drive in enumerate(known, start=1)]
            write_text(path, f"{json.dumps(head, sort_keys=True)}\n{''.join(lines)}")
        file = path.open("a", encoding="utf-8")
    except OSError as error:
        raise of_system(error, path, "; give another --out") from error
    with file:
        yield Journal(known, file)
