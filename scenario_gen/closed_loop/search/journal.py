# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The drives of a search in a file, a line each, written as they end; a search that goes on reads them again."""

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
from scenario_gen.closed_loop.search.estimate import Response

LARGEST = 1 << 30  # bytes of a journal; a drive takes some 100
REMEDY = "; move it away, or give another --out"
_TEXT = {"type": "string"}
_RESPONSE = [NUMBER, {"type": "array", "items": NUMBER}, _TEXT, {"type": "array", "items": _TEXT}]
_DRIVE = {"type": "array", "prefixItems": [COUNT, *_RESPONSE, COUNT], "minItems": 6, "maxItems": 6}
LINES = {"type": "array", "prefixItems": [{"type": "object"}], "items": _DRIVE, "minItems": 1}


@dataclass(frozen=True, eq=False)
class Journal:
    """The drives of a search.

    Attributes:
        known: responses of the drives that the file had.
        file: where further ones go.
    """

    known: list[Response]
    file: TextIO

    def add(self, response: Response) -> None:
        """Write one drive."""
        self.known.append(response)
        self.file.write(_line(len(self.known), response))
        self.file.flush()


def _line(number: int, response: Response) -> str:
    """Return the line of a drive, counted from 1: number, margin, parts, kind, events, and the checksum of all these."""
    values = [number, response.margin, list(response.parts), response.kind, list(response.events)]
    text = json.dumps(values)
    return f"{text[:-1]}, {crc32(text.encode())}]\n"


def read_journal(path: Path) -> tuple[dict[str, Any], list[Response], bool]:
    """Return what the drives of a journal hang on, the drives, and whether its last line is whole; a cut one is left out.

    Raises:
        InputError: it is a link, or no regular file, or no journal, or was changed.
    """
    what = f"{path} is no journal of a search"
    if path.is_symlink():
        raise InputError(f"{path} is a link{REMEDY}")
    lines = read_text(path, LARGEST, what).split(
        "\n"
    )  # as they were written: other characters end no line
    try:
        head, *drives = parse_json(f"[{','.join(lines[:-1])}]", what, LINES)
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
    """Yield the journal at a path, made if it is not there; `identity` says what the drives hang on.

    Raises:
        InputError: the file is of another search, is no journal, or cannot be written.
    """
    head = json.loads(json.dumps(identity))
    known: list[Response] = []
    try:
        if path.is_symlink() or (path.exists() and (not path.is_file() or path.stat().st_size)):
            before, known, whole = read_journal(path)
            differ = sorted(
                name for name in head.keys() | before.keys() if before.get(name) != head.get(name)
            )
            if differ:
                raise InputError(
                    f"{path} has the drives of another search ({', '.join(differ)} differ){REMEDY}"
                )
        else:
            path.parent.mkdir(parents=True, exist_ok=True)
            whole = False
        if not whole:
            first = json.dumps(head, sort_keys=True)
            write_text(
                path,
                f"{first}\n{''.join(_line(number, one) for number, one in enumerate(known, start=1))}",
            )
        file = path.open("a", encoding="utf-8")
    except OSError as error:
        raise of_system(error, path, "; give another --out") from error
    with file:
        yield Journal(known, file)
