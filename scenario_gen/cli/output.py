# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Output of commands: messages, tables, progress, and with --json one object with the results."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, fields, is_dataclass
from io import BufferedWriter, FileIO, TextIOWrapper
import json
import math
import os
from pathlib import Path
import sys
from typing import Any
import webbrowser

from scenario_gen.base.copies import renamed
from scenario_gen.base.errors import printable, printable_lines

UNBOUNDED_COLUMNS = 10_000
"""Width of a terminal in which no line breaks."""


@dataclass
class Output:
    """How the running command prints, and the fields of its JSON object so far."""

    quiet: bool = False
    verbose: bool = False
    as_json: bool = False
    results: dict[str, Any] = field(default_factory=dict)


current = Output()
"""Set by the options before a command; the command line runs one command per process."""


class _Pipe(FileIO):
    """Standard output that goes nowhere once its reader has ended, as in `| head -1`."""

    def write(self, data: Any) -> int:
        """Write bytes; a command whose output nobody reads any more does its work nevertheless."""
        try:
            return super().write(data)
        except BrokenPipeError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), self.fileno())
            return super().write(data)


def outlive_reader() -> None:
    """Let the command end as usual, with its exit code, when its output is no longer read."""
    stream = sys.__stdout__
    if stream is None or sys.stdout is not stream or stream.isatty():
        return
    stream.flush()
    pipe = BufferedWriter(_Pipe(stream.fileno(), "wb", closefd=False))
    sys.stdout = TextIOWrapper(pipe, stream.encoding, stream.errors)


def configure(**options: Any) -> None:
    """Set how the running command prints; the fields are those of `Output`."""
    vars(current).update(vars(Output(**options)))


def emit_json(**results: Any) -> None:
    """Add fields to the JSON object of the running command."""
    current.results |= json_value(results)


def print_json(results: Mapping[str, Any]) -> None:
    """Print one JSON object on one line."""
    print(json.dumps(json_value(results), ensure_ascii=False, allow_nan=False))


def json_value(value: Any) -> Any:
    """Return a value for JSON: dataclasses become objects, paths text, NaN and infinity null."""
    if is_dataclass(value) and not isinstance(value, type):
        return {entry.name: json_value(getattr(value, entry.name)) for entry in fields(value)}
    if isinstance(value, Mapping):
        return {
            printable(str(getattr(key, "value", key))): json_value(item)
            for key, item in value.items()
        }
    if isinstance(value, (list, tuple, set, frozenset)):
        return [json_value(item) for item in value]
    if hasattr(value, "tolist"):  # NumPy arrays and scalars
        return json_value(value.tolist())
    return _json_scalar(value)


def _json_scalar(value: Any) -> bool | int | float | str | None:
    """Return a scalar for JSON; anything but a number or None becomes text."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, (bool, int)):
        return value
    return printable_lines(renamed(str(value)))


def print_(*values: Any, sep: str = " ", wrap: bool = False) -> None:
    """Print texts literally, and rich objects; `wrap` breaks lines at the terminal width.

    Where another program reads, no line is broken or ends in spaces, and Markdown stays as it is.
    """
    from scenario_gen.base.terminal import Terminal

    if current.quiet:
        return
    texts: list[Any] = [renamed(value) if isinstance(value, str) else value for value in values]
    terminal = Terminal(stderr=current.as_json)
    if terminal.is_terminal:
        terminal.print(*texts, sep=sep, soft_wrap=not wrap)
        return
    terminal.width = UNBOUNDED_COLUMNS
    with terminal.capture() as captured:
        terminal.print(*map(_plain, texts), sep=sep)
    for line in captured.get().splitlines():
        print(line.rstrip(), file=terminal.file)


def _plain(value: Any) -> Any:
    """Return the text of Markdown, and anything else as it is."""
    from rich.text import Text

    is_markdown = hasattr(value, "markup") and not isinstance(value, Text)
    return Text(value.markup) if is_markdown else value


def print_table(columns: Sequence[str], rows: Sequence[Sequence[str]], names: int = 1) -> None:
    """Print a table without cutting anything off.

    Fields are separated by tabs unless standard output is a terminal. If the terminal is too
    narrow, each row is printed as text: its name, then its other fields with their column names.

    Args:
        columns: their names.
        rows: their texts.
        names: number of leading columns that together name a row.
    """
    from rich.table import Table

    from scenario_gen.base.terminal import Terminal

    terminal = Terminal(stderr=current.as_json)
    if not terminal.is_terminal:
        for row in (columns, *rows) if not current.quiet else ():
            print("\t".join(printable(" ".join(text.split())) for text in row), file=terminal.file)
        return
    table = Table(*columns, box=None, pad_edge=False)
    for row in rows:
        table.add_row(*row)
    unbounded = terminal.options.update(
        width=UNBOUNDED_COLUMNS
    )  # measures a table without wrapping it
    if terminal.measure(table, options=unbounded).maximum <= terminal.width:
        print_(table)
        return
    for row in rows:
        pairs = zip(columns[names:], row[names:], strict=True)
        texts = [f"{name}\N{NO-BREAK SPACE}{text}" for name, text in pairs if text]
        print_(", ".join([" ".join(row[:names]), *texts]), wrap=True)


def progress() -> AbstractContextManager[Callable[[str, int, int], None]]:
    """Return progress bars (none with --quiet); call the value with name, done and total."""
    from scenario_gen.base.terminal import progress_bars

    return nullcontext(lambda *_: None) if current.quiet else progress_bars()


def status() -> AbstractContextManager[Callable[[str], None]]:
    """Return a status line (none with --quiet); call the value with its text."""
    from scenario_gen.base.terminal import status_line

    return nullcontext(lambda _: None) if current.quiet else status_line()


def default_output(path: Path, name: str) -> Path:
    """Return the path `name` in the folder of an input, where a command writes without --out."""
    return path.resolve().with_name(name)


def open_page(page: Path) -> bool:
    """Open a page in a browser if a user is present; return whether it was opened."""
    has_display = sys.platform == "darwin" or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")
    )
    if current.as_json or current.quiet:
        return False
    if not (has_display and sys.stdout.isatty()):
        return False
    return webbrowser.open(page.resolve().as_uri())
