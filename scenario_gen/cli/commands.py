# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The command line: its commands, and how it ends; libraries are loaded by the command that needs them."""

from contextlib import suppress
import os
import sys
from typing import NoReturn

import typer

from scenario_gen.base.errors import InputError, of_system, presentable, ScenarioGenError
from scenario_gen.cli import bags, corpus, generation, searching

app = typer.Typer(
    help="Turn recorded vehicle encounters into new, valid ones on other roads.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

for group in (generation, bags, searching, corpus):
    app.add_typer(group.commands)


@app.command()
def doctor() -> None:
    """Say what is wrong with this environment: Python, packages, ROS, DDS, QoS of visible topics, kernels."""
    from scenario_gen.ros.plumbing.doctor import main as examined

    raise typer.Exit(examined())


def refuse_undecodable(words: list[str]) -> None:
    """Refuse names that could not be written to a result.

    Raises:
        InputError: one is no UTF-8 text.
    """
    for word in words:
        if any("\ud800" <= letter <= "\udfff" for letter in word):
            raise InputError(f"{word}: a name that is no UTF-8 text cannot go into a bag or a page; rename the file")


def main() -> None:
    """Run the command line; an error of ours, or of the system, is one message and an exit code, never a traceback."""
    try:
        try:
            refuse_undecodable(sys.argv[1:])
            app()
        finally:
            sys.stdout.flush()
    except ScenarioGenError as error:
        fail(error)
    except MemoryError:
        fail(InputError("there is not enough memory; take less at once: a shorter log, fewer scenarios, a smaller map"))
    except BrokenPipeError:
        sys.stdout = open(os.devnull, "w")  # noqa: PTH123, SIM115 - nobody listens any more
        sys.exit(1)
    except OSError as error:
        fail(of_system(error, error.filename or "standard output, or a file that the system does not name"))


def fail(error: ScenarioGenError) -> NoReturn:
    """Say what is wrong and end."""
    from rich.text import Text

    from scenario_gen.base.terminal import Terminal

    with suppress(OSError):
        Terminal(stderr=True).print(Text("error:", style="bold red"), presentable(str(error)), soft_wrap=True)
    try:
        sys.stdout.flush()
    except OSError:  # a full disk, or nobody listens: what is left goes nowhere, so that the interpreter ends in peace
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.exit(error.exit_code)


if __name__ == "__main__":
    main()
