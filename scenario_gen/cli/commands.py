# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The command line: its commands and exit codes. Each command imports the libraries it needs."""

from contextlib import suppress
from importlib import metadata
import os
import re
import sys
import tempfile
import traceback
from typing import Annotated, Any

import typer

from scenario_gen.base.errors import (
    BugError,
    describe,
    InputError,
    of_system,
    ScenarioGenError,
    shown_error,
)
from scenario_gen.base.removed import REMOVED
from scenario_gen.cli import bags, corpus, generation, output, testing
from scenario_gen.cli.options import HELP

PROGRAM = "scenario-gen"
GLOBAL_OPTIONS = ("--quiet", "-q", "--verbose", "-v", "--json")
UsageError: Any = typer.BadParameter.__bases__[0]  # typer has its own copy of click

app = typer.Typer(
    help="Turn recorded encounters of vehicles into new, valid scenarios on other roads.",
    pretty_exceptions_enable=False,
    context_settings=HELP,
)


def _print_version(requested: bool) -> None:
    if requested:
        print(f"{PROGRAM} {metadata.version('scenario_gen')}")
        raise typer.Exit


def _print_parameters() -> None:
    """Print every parameter with its default, unit, range and meaning."""
    from rich.text import Text

    from scenario_gen.base.parameters import flatten
    from scenario_gen.pipeline import PipelineConfig

    keys = ("meaning", "unit", "low", "high", "choices")
    table = {}
    for name, (entry, default) in flatten(PipelineConfig()).items():
        meta = entry.metadata
        table[name] = {"default": default} | {key: meta[key] for key in keys}
        bounds = [str(meta[end]) if meta[end] is not None else "" for end in ("low", "high")]
        allowed = " | ".join(meta["choices"]) or ("…".join(bounds) if any(bounds) else "")
        allowed = f"({allowed})" if allowed else ""
        text = f" = {default!r} {meta['unit']} {allowed}\n    {meta['meaning']}"
        output.print_(Text(name, style="bold"), Text(text), sep="", wrap=True)
    output.emit_json(parameters=table)


@app.callback(invoke_without_command=True)
def options(
    context: typer.Context,
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version."
        ),
    ] = False,
    parameters: Annotated[
        bool,
        typer.Option(
            "--parameters",
            help="List every parameter with its default, unit, range and meaning.",
        ),
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")] = False,
    verbose: Annotated[
        bool,
        typer.Option(
            "--verbose",
            "-v",
            help="In `generate` and `demo`: print routes and the comparison with the recording.",
        ),
    ] = False,
    as_json: Annotated[
        bool,
        typer.Option(
            "--json",
            help="Print one JSON object to standard output, and messages to standard error.",
        ),
    ] = False,
) -> None:
    """Turn recorded encounters of vehicles into new, valid scenarios on other roads."""
    del version
    output.configure(quiet=quiet, verbose=verbose, as_json=as_json)
    if parameters:
        _print_parameters()
        raise typer.Exit
    if context.invoked_subcommand is None:
        context.fail("Missing command.")


for commands in (
    generation.commands,
    bags.commands,
    testing.commands,
    corpus.commands,
):
    app.add_typer(commands)


def arguments(words: list[str]) -> list[str]:
    """Return the arguments with the global options first; users may write them after a command.

    Raises:
        InputError: a word is not valid UTF-8, so that no bag or page could contain it.
    """
    for word in words:
        if any("\ud800" <= letter <= "\udfff" for letter in word):
            raise InputError(f"{word}: the name is not valid UTF-8; rename the file")
    end = words.index("--") if "--" in words else len(words)
    first = [word for word in words[:end] if word in GLOBAL_OPTIONS]
    return [*first, *(word for word in words[:end] if word not in first), *words[end:]]


def refuse_removed(words: list[str]) -> None:
    """Refuse the first command, option or kind of address that an earlier release had.

    Raises:
        InputError: there is one; the message says what replaces it.
    """
    command = next((word for word in words if not word.startswith("-")), "")
    options = [word.partition("=")[0] for word in words if word.startswith("--")]
    addresses = [f"{word.partition('://')[0]}://" for word in words if "://" in word]
    for name in (command, *options, *addresses):
        if name in REMOVED:
            raise InputError(f"{name} was removed: {REMOVED[name]}")


def usage_error(error: Any) -> InputError:
    """Return a usage error of typer as an error of ours, with the help of a missing parameter."""
    message = " ".join(error.format_message().split()).rstrip(".")
    parameter = getattr(error, "param", None)
    if parameter is not None and parameter.help and not error.message:  # it is missing
        first = re.split(r"\.(?: (?=[A-Z`])|$)", parameter.help)[0]
        message = f"{message} ({first})"
    path = error.ctx.command_path if error.ctx else PROGRAM
    return InputError(f"{message}; see `{path} --help`")


def run(words: list[str]) -> int:
    """Run a command; return its exit code.

    Raises:
        ScenarioGenError: the command failed; BugError if it did so unexpectedly.
    """
    try:
        refuse_removed(words)
        code = app(arguments(words) or ["--help"], standalone_mode=False, prog_name=PROGRAM)
        sys.stdout.flush()
    except UsageError as error:
        raise usage_error(error) from error
    except MemoryError as error:
        raise InputError(
            f"not enough memory ({error}); check the inputs for a wrong coordinate or time; if"
            " there is none, use a shorter log, fewer scenarios or a part of the map"
        ) from error
    except OSError as error:
        name = error.filename or "standard output or an unnamed file"
        raise of_system(error, name) from error
    except (ScenarioGenError, typer.Abort):
        raise
    except Exception as error:
        raise _bug(error) from error
    return code if isinstance(code, int) else 0


def _bug(error: Exception) -> BugError:
    """Return an unexpected exception as an error, with its traceback in a file."""
    place = "the traceback could not be written"
    with suppress(OSError):
        descriptor, name = tempfile.mkstemp(".txt", "scenario_gen_bug_")
        with os.fdopen(descriptor, "w", encoding="utf-8") as file:
            file.write("".join(traceback.format_exception(error)))
        place = f"attach {name} and the input"
    return BugError(f"this is a bug in scenario_gen ({describe(error)}); report it: {place}")


def main() -> None:
    """Run the command line: an error becomes one message and an exit code, not a traceback."""
    output.outlive_reader()
    words = sys.argv[1:]
    ended: dict[str, Any] = {}
    try:
        ended["exit_code"] = run(words)
    except ScenarioGenError as error:
        ended |= {"exit_code": error.exit_code, "error": shown_error(error)}
        _print_error(ended["error"])
    with suppress(OSError):
        if "--json" in words:
            command = next((word for word in words if word not in GLOBAL_OPTIONS), None)
            output.print_json({"command": command} | output.current.results | ended)
        output.configure()
        sys.stdout.flush()
        sys.exit(ended["exit_code"])
    # The disk is full: Python must not try to write the rest at its exit.
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.exit(ended["exit_code"] or 1)


def _print_error(message: str) -> None:
    from rich.text import Text

    from scenario_gen.base.terminal import Terminal

    with suppress(OSError):
        Terminal(stderr=True).print(
            Text("error:", style="bold red"), Text(message), soft_wrap=True
        )


if __name__ == "__main__":
    main()
