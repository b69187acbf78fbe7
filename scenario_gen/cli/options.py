# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What the commands share: options, how a command takes a class of them, and the configuration."""

from collections.abc import Callable
from functools import reduce
import inspect
from pathlib import Path
from typing import Annotated, Any, get_type_hints, TYPE_CHECKING, TypeVar

import typer

from scenario_gen.cli.output import say

if TYPE_CHECKING:
    from scenario_gen.pipeline import PipelineConfig

Options = TypeVar("Options")
Config = TypeVar("Config")
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="Set one parameter, as name=value (repeatable). `scenario-gen parameters` lists them.",
    ),
]
ParametersOption = Annotated[
    Path | None,
    typer.Option("--params", help="Read parameters from a YAML file such as config/default.yaml."),
]


def takes(options: type[Options]) -> Callable[[Callable[[Options], None]], Callable[..., None]]:
    """Let typer give a command its options as one frozen dataclass, whose fields are annotated as typer's parameters are."""

    def of(command: Callable[[Options], None]) -> Callable[..., None]:
        def parsed(**values: Any) -> None:
            command(options(**values))

        parsed.__name__, parsed.__doc__ = command.__name__, command.__doc__
        parsed.__annotations__ = get_type_hints(options, include_extras=True)
        parsed.__signature__ = inspect.signature(options)  # type: ignore[attr-defined]
        return parsed

    return of


def assigned_all(config: Config, assignments: list[str] | None) -> Config:
    """Return a configuration with each `name=value` in it.

    Raises:
        InputError: a name is unknown or a value does not suit; the message names it.
    """
    from scenario_gen.base.parameters import assigned

    return reduce(assigned, assignments or [], config)


def configured(file: Path | None, assignments: list[str] | None) -> "PipelineConfig":
    """Return the pipeline's configuration: defaults, then the file, then each `name=value`.

    Raises:
        InputError: the file cannot be read, a name is unknown or a value does not suit; the message names it.
    """
    from scenario_gen.base.parameters import loaded
    from scenario_gen.pipeline import PipelineConfig

    return assigned_all(
        PipelineConfig() if file is None else loaded(PipelineConfig(), file), assignments
    )


def remind(bag: Path) -> None:
    """Say what is missing of a bag that is read all the same."""
    from scenario_gen.bags.storage.files import metadata_warnings

    for remark in metadata_warnings(bag):
        say(remark)
