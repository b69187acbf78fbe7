# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Options and arguments that commands share, and the configuration."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import reduce
import inspect
from pathlib import Path
from typing import Annotated, Any, get_type_hints, TYPE_CHECKING, TypeVar

import typer

from scenario_gen.base.errors import InputError
from scenario_gen.cli.output import print_

if TYPE_CHECKING:
    from scenario_gen.pipeline import PipelineConfig

Options = TypeVar("Options")
Config = TypeVar("Config")
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="Set a parameter, as name=value. Repeatable. `scenario-gen --parameters` lists them.",
    ),
]
ParametersOption = Annotated[
    Path | None,
    typer.Option("--params", help="Read parameters from a YAML file such as config/default.yaml."),
]
SeedOption = Annotated[
    int, typer.Option(min=0, help="Random seed. The same seed gives the same result.")
]
WorkersOption = Annotated[
    int, typer.Option(min=0, max=1024, help="Number of processes. 0: one per core.")
]


HELP = {"help_option_names": ["-h", "--help"]}
"""Settings of a command."""
OUT = ("--out", "-o")
"""The names of the option for a command's folder or file."""


class Commands(typer.Typer):
    """A group of commands in `--help`."""

    def __init__(self, panel: str) -> None:
        super().__init__()
        self.panel = panel

    def command(
        self, name: str | None = None, *, panel: str = "", **options: Any
    ) -> Callable[..., Any]:
        """Return a decorator that registers a function as a command.

        Args:
            name: of the command; the function's name by default.
            panel: in `--help`; that of the group by default.
            options: further ones of typer.
        """
        options = {"rich_help_panel": panel or self.panel, "context_settings": HELP} | options
        return super().command(name, **options)


def takes(options: type[Options]) -> Callable[[Callable[[Options], None]], Callable[..., None]]:
    """Pass options to a command as one frozen dataclass, annotated for typer."""

    def decorate(command: Callable[[Options], None]) -> Callable[..., None]:
        def parsed(**values: Any) -> None:
            command(options(**values))

        parsed.__name__ = command.__name__
        parsed.__doc__ = command.__doc__
        parsed.__annotations__ = get_type_hints(options, include_extras=True)
        parsed.__signature__ = inspect.signature(options)  # type: ignore[attr-defined]
        return parsed

    return decorate


def assigned_all(config: Config, assignments: Sequence[str] | None) -> Config:
    """Return a configuration with each `name=value` applied.

    Raises:
        InputError: a name is unknown or a value is not allowed; the message names it.
    """
    from scenario_gen.base.parameters import assigned

    return reduce(assigned, assignments or [], config)


def configured(file: Path | None, assignments: Sequence[str] | None) -> "PipelineConfig":
    """Return the pipeline's configuration: defaults, then the file, then each `name=value`.

    Raises:
        InputError: the file cannot be read, a name is unknown or a value is not allowed.
    """
    from scenario_gen.base.parameters import loaded
    from scenario_gen.pipeline import PipelineConfig

    config = PipelineConfig() if file is None else loaded(PipelineConfig(), file)
    return assigned_all(config, assignments)


def bag_at(path: Path) -> Path:
    """Return a bag, or that in a folder from `generate`.

    Prints what is missing in a bag that can be read nevertheless.
    """
    from scenario_gen.bags.storage.bag import bag_warnings
    from scenario_gen.bags.storage.files import files_of
    from scenario_gen.output.results import BAG

    with suppress(InputError, OSError):  # the command says why it cannot be read
        if path.is_dir() and not files_of(path).files and (path / BAG).is_dir():
            path /= BAG
        for warning in bag_warnings(path):
            print_(warning)
    return path
