# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What commands print: messages, tables, progress, and with --json one object of results."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, fields, is_dataclass
import functools
import json
import math
import os
from pathlib import Path
import sys
from typing import Any
import webbrowser

import typer
from typer.core import TyperGroup

from scenario_gen.base.errors import InputError, printable, ScenarioGenError, shown_error
from scenario_gen.base.stores import renamed
from scenario_gen.cli import places


@dataclass
class Output:
    """How the running command prints, and its results so far."""

    quiet: bool = False
    verbose: bool = False
    as_json: bool = False
    results: dict[str, Any] = field(default_factory=dict)


_current = Output()
FLAGS = ("--quiet", "-q", "--verbose", "-v", "--json")


class Program(TyperGroup):
    """The program: takes --quiet, --verbose and --json before and behind a command's name, and prints what --json asks for."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Take the flags of all commands, wherever they stand before a `--`."""
        end = args.index("--") if "--" in args else len(args)
        flags = [word for word in args[:end] if word in FLAGS]
        return super().parse_args(
            ctx, [*flags, *(word for word in args[:end] if word not in FLAGS), *args[end:]]
        )

    def invoke(self, ctx: Any) -> Any:
        """Run the command; with --json, print its results as the last line of standard output, also after an error."""
        global _current  # noqa: PLW0603 - the command line runs one command in a process
        _current = Output(ctx.params["quiet"], ctx.params["verbose"], ctx.params["as_json"])
        ended: dict[str, Any] = {"exit_code": 0}
        try:
            return super().invoke(ctx)
        except typer.Exit as end:
            ended["exit_code"] = end.exit_code
            raise
        except (ScenarioGenError, OSError) as error:
            ended |= {"exit_code": getattr(error, "exit_code", 2), "error": shown_error(error)}
            raise
        except Exception:  # a wrong option, which the caller reports
            _current.as_json = False
            raise
        finally:
            if _current.as_json:
                print_object({"command": ctx.invoked_subcommand} | _current.results | ended)
            _current = Output()


class Commands(typer.Typer):
    """Commands that stand together in `--help`; each takes URLs of a store where it takes paths."""

    def __init__(self, panel: str) -> None:
        super().__init__()
        self.panel = panel

    def command(
        self, name: str | None = None, *, panel: str = "", urls: Sequence[str] = (), **options: Any
    ) -> Callable[..., Any]:
        """Return a decorator that adds a command, as typer's; the function itself stays as it is.

        Args:
            name: of the command; the function's by default.
            panel: of `--help`.
            urls: parameters whose URLs the function takes itself.
            options: of typer.
        """

        def of(function: Callable[..., None]) -> Callable[..., None]:
            paths = places.paths_of(function, urls)

            @functools.wraps(function)
            def run(**values: Any) -> None:
                with places.as_files(values, paths) as local:
                    function(**local)

            super(Commands, self).command(name, rich_help_panel=panel or self.panel, **options)(
                run
            )
            return function

        return of


def give(**results: Any) -> None:
    """Add results to the object of --json."""
    _current.results |= plain(results)


def print_object(results: Mapping[str, Any]) -> None:
    """Print results as one JSON object in one line."""
    print(json.dumps(plain(results), ensure_ascii=False, allow_nan=False))


def plain(value: Any) -> Any:
    """Return a value as JSON has it: dataclasses become objects, paths texts, NaN and infinity null."""
    if is_dataclass(value) and not isinstance(value, type):
        return {entry.name: plain(getattr(value, entry.name)) for entry in fields(value)}
    if isinstance(value, Mapping):
        return {str(getattr(key, "value", key)): plain(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple, set, frozenset)):
        return [plain(inner) for inner in value]
    if hasattr(value, "tolist"):  # numpy's
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, (bool, int)):
        return value
    return printable(renamed(str(value)))


def is_verbose() -> bool:
    """Return whether --verbose was given."""
    return _current.verbose


def say(*what: Any, sep: str = " ", wrap: bool = False) -> None:
    """Print a message: texts letter by letter, and what rich can draw; `wrap` breaks lines at the terminal's width."""
    from scenario_gen.base.terminal import Terminal

    if not _current.quiet:
        texts = [renamed(one) if isinstance(one, str) else one for one in what]
        Terminal(stderr=_current.as_json).print(*texts, sep=sep, soft_wrap=not wrap)


def say_rows(columns: Sequence[str], rows: Sequence[Sequence[str]], names: int = 1) -> None:
    """Print a table; nothing in it is cut off.

    Where standard output is no terminal, fields are separated by tabs. Where the terminal is too narrow, each row becomes a
    text: what it is, then its other fields with their names.

    Args:
        columns: their names.
        rows: their texts.
        names: the first so many columns say what a row is.
    """
    from rich.table import Table

    from scenario_gen.base.terminal import Terminal

    terminal = Terminal(stderr=_current.as_json)
    if not terminal.is_terminal:
        for row in (columns, *rows) if not _current.quiet else ():
            print("\t".join(printable(" ".join(text.split())) for text in row), file=terminal.file)
        return
    table = Table(*columns, box=None, pad_edge=False)
    for row in rows:
        table.add_row(*row)
    if (
        terminal.measure(table, options=terminal.options.update(width=10_000)).maximum
        <= terminal.width
    ):
        say(table)
        return
    for row in rows:
        pairs = [
            f"{name}\N{NO-BREAK SPACE}{text}"
            for name, text in zip(columns[names:], row[names:], strict=True)
            if text
        ]
        say(", ".join([" ".join(row[:names]), *pairs]), wrap=True)


def bars() -> AbstractContextManager[Callable[[str, int, int], None]]:
    """Return progress bars with the remaining time, or with --quiet nothing; the value takes name, done and total of a bar."""
    from scenario_gen.base.terminal import progress_bars

    return nullcontext(lambda *_: None) if _current.quiet else progress_bars()


def status() -> AbstractContextManager[Callable[[str], None]]:
    """Return a line that changes, or with --quiet nothing; the value takes its text."""
    from scenario_gen.base.terminal import status_line

    return nullcontext(lambda _: None) if _current.quiet else status_line()


def beside(path: Path, name: str) -> Path:
    """Return the path of that name beside an input, where a command writes by default.

    Raises:
        InputError: the input is the copy of an object, beside which nothing would stay.
    """
    if (url := renamed(str(path))) != str(path):
        raise InputError(
            f"--out is missing: name a folder or a place in a store, for nothing is written beside {url}"
        )
    return path.resolve().with_name(name)


def open_page(page: Path) -> bool:
    """Open a page in a browser if somebody sits at this terminal and there is a display; return whether it was opened."""
    has_display = sys.platform == "darwin" or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")
    )
    is_copy = renamed(str(page)) != str(page)
    if is_copy or _current.as_json or _current.quiet or not (sys.stdout.isatty() and has_display):
        return False
    return webbrowser.open(page.resolve().as_uri())
