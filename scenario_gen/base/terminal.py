# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Output to the terminal.

Names of files, vehicles and encounters are shown literally, whatever characters they have.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text

from scenario_gen.base.errors import printable


class Terminal(Console):
    """A console that interprets no markup in texts and prints no control characters.

    Only Text objects have styles.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(markup=False, emoji=False, highlight=False, **options)

    def render_str(self, text: str, **options: Any) -> Text:
        """Render a plain text; rich calls this for every text, also for a table's cells."""
        return super().render_str(printable(text), **options)


@contextmanager
def progress_bars() -> Iterator[Callable[[str, int, int], None]]:
    """Show progress bars on standard error if it is a terminal.

    Yield a function that takes name, done and total of a bar.
    """
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left:"),
        TimeRemainingColumn(),
    )
    tasks: dict[str, TaskID] = {}
    console = Terminal(stderr=True)
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as bars:

        def advance(name: str, done: int, total: int) -> None:
            if name not in tasks:
                tasks[name] = bars.add_task(printable(name), total=total)
            bars.update(tasks[name], completed=done, total=total)

        yield advance


@contextmanager
def status_line() -> Iterator[Callable[[str], None]]:
    """Show a changing line on standard error if it is a terminal.

    Yield a function that sets its text.
    """
    with Terminal(stderr=True).status("starting") as status:
        yield lambda text: status.update(Text(printable(text)))
