# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The command line: its commands and its exit codes. Each command loads the libraries that it needs."""

from contextlib import suppress
from importlib import metadata
import os
import sys
from typing import Annotated, Any, NoReturn

import typer

from scenario_gen.base.errors import (
    did_you_mean,
    InputError,
    of_system,
    ScenarioGenError,
    shown_error,
)
from scenario_gen.cli import bags, corpus, generation, output, testing

app = typer.Typer(
    cls=output.Program,
    help="Turn recorded encounters of vehicles into new, valid ones on other roads.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

installation = output.Commands("This installation")
PLAIN = {  # words of the library that reads the options
    "Input should be greater than or equal to": "it must be at least",
    "Input should be less than or equal to": "it must be at most",
    "Input should be a valid integer, unable to parse string as an integer": "it must be a whole number",
    "Input should be a valid number, unable to parse string as a number": "it must be a number",
}
UsageError: Any = typer.BadParameter.__bases__[0]  # typer has its own copy of click


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"scenario-gen {metadata.version('scenario_gen')}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version."
        ),
    ] = False,
    quiet: Annotated[
        bool, typer.Option("--quiet", "-q", help="Of any command: print errors only.")
    ] = False,
    verbose: Annotated[
        bool,
        typer.Option(
            "--verbose",
            "-v",
            help="Of `generate` and `demo`: routes and the comparison with the recording, too.",
        ),
    ] = False,
    as_json: Annotated[
        bool,
        typer.Option(
            "--json",
            help="Of any command: print one JSON object to standard output, messages to standard error.",
        ),
    ] = False,
) -> None:
    """Turn recorded encounters of vehicles into new, valid ones on other roads."""
    del version, quiet, verbose, as_json  # which `output.Program` takes


@installation.command()
def parameters() -> None:
    """List every parameter with its default, unit, range and meaning."""
    from rich.text import Text

    from scenario_gen.base.parameters import flatten
    from scenario_gen.pipeline import PipelineConfig

    known = flatten(PipelineConfig())
    keys = ("meaning", "unit", "low", "high", "choices")
    output.give(
        parameters={
            name: {"default": value} | {key: e.metadata[key] for key in keys}
            for name, (e, value) in known.items()
        }
    )
    for name, (entry, value) in known.items():
        meta = entry.metadata
        bounds = [str(meta[end]) if meta[end] is not None else "" for end in ("low", "high")]
        allowed = " | ".join(meta["choices"]) or ("…".join(bounds) if any(bounds) else "")
        text = f" = {value!r} {meta['unit']} {f'({allowed})' if allowed else ''}\n    {meta['meaning']}"
        output.say(Text(name, style="bold"), text, sep="", wrap=True)


@installation.command()
def doctor() -> None:
    """Check this environment: Python, packages, ROS 2. `ros2 doctor` checks the network and QoS."""
    from scenario_gen.ros.common.doctor import ERROR, examine

    findings = []
    for finding in examine():
        output.say(finding.line())
        findings.append(finding)
    output.give(findings=findings)
    raise typer.Exit(int(any(finding.level == ERROR for finding in findings)))


for commands in (
    generation.commands,
    bags.commands,
    testing.commands,
    corpus.commands,
    installation,
):
    app.add_typer(commands)


def refuse_undecodable(words: list[str]) -> None:
    """Refuse names that could not be written to a bag or a page.

    Raises:
        InputError: one is not valid UTF-8.
    """
    for word in words:
        if any("\ud800" <= letter <= "\udfff" for letter in word):
            raise InputError(f"{word}: the name is not valid UTF-8; rename the file")


def main() -> None:
    """Run the command line. An error becomes one message and an exit code, never a traceback."""
    try:
        try:
            refuse_undecodable(sys.argv[1:])
            code = app(standalone_mode=False, prog_name="scenario-gen")
        finally:
            sys.stdout.flush()
        sys.exit(code if isinstance(code, int) else 0)
    except UsageError as error:
        wrong = of_usage(error)
        if "--json" in sys.argv[1:]:  # which was not read as an option
            output.print_object({"exit_code": wrong.exit_code, "error": str(wrong)})
        fail(wrong)
    except ScenarioGenError as error:
        fail(error)
    except MemoryError:
        fail(InputError("not enough memory; use a shorter log, fewer scenarios or a smaller map"))
    except BrokenPipeError:
        sys.stdout = open(os.devnull, "w")  # noqa: PTH123, SIM115 - the reader has gone
        sys.exit(1)
    except OSError as error:
        fail(of_system(error, error.filename or "standard output or an unnamed file"))


def of_usage(error: Any) -> InputError:
    """Return an error in the words of the command line as one of ours: what is wrong, and what to do."""
    if type(error).__name__ == "NoArgsIsHelpError":  # prints the help, as without any error
        print(error.ctx.get_help())
        sys.exit(2)
    message = " ".join(error.format_message().split())
    for its, ours in PLAIN.items():
        message = message.replace(its, ours)
    if type(error).__name__ == "MissingParameter" and getattr(error.param, "help", None):
        message = f"{message.rstrip('.')} ({error.param.help.split('. ')[0].rstrip('.')})"
    path = error.ctx.command_path if error.ctx else "scenario-gen"
    unknown, known = getattr(error, "option_name", ""), []
    if unknown and error.ctx:
        known = [
            name
            for entry in error.ctx.command.get_params(error.ctx)
            for name in entry.opts
            if name.startswith("--")
        ]
        message = f"there is no option {unknown}{did_you_mean(unknown, known)}"
        if unknown[1:].isdecimal():
            message = f"{unknown}: a number here must not be negative"
    return InputError(f"{message.rstrip('.')}; see `{path} --help`")


def fail(error: ScenarioGenError) -> NoReturn:
    """Print the error and exit."""
    from rich.text import Text

    from scenario_gen.base.terminal import Terminal

    with suppress(OSError):
        Terminal(stderr=True).print(
            Text("error:", style="bold red"), shown_error(error), soft_wrap=True
        )
    try:
        sys.stdout.flush()
    except OSError:  # the disk is full or the reader has gone: what is left to print is dropped
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.exit(error.exit_code)


if __name__ == "__main__":
    main()
