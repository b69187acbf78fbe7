# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Arguments of `generate`: values with one meaning are accepted, others are refused."""

from collections.abc import Callable, Mapping, Sequence
import operator
from pathlib import Path
import secrets
import sys
from typing import Any, TYPE_CHECKING, TypeAlias

from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import dotted, updated
from scenario_gen.logs import LogResult, read_log
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.sampling import Progress
from scenario_gen.types import Encounter, Request

if TYPE_CHECKING:
    from pandas import DataFrame

Templates: TypeAlias = "Encounter | Sequence[Encounter] | LogResult | Path | str | DataFrame"
"""An encounter and further ones, or a log with one encounter."""


def encounters_of(source: Templates, config: PipelineConfig) -> list[Encounter]:
    """Return the template and the further encounters.

    Args:
        source: an encounter, a list of encounters, or a log with one encounter: what `read_log`
            returns or reads.
        config: how to read a log.

    Raises:
        InputError: it is something else, or the log has several encounters.
    """
    if isinstance(source, Encounter):
        return [source]
    if isinstance(source, (str, Path)) or hasattr(source, "to_csv"):
        source = read_log(source, config.log)
    if isinstance(source, LogResult):
        count = len(source.encounters)
        if count != 1:
            raise InputError(
                f"the log has {count} encounters: give one of them, e.g. log.encounters[0], or "
                "call generate_many for all"
            )
        return list(source.encounters)
    is_list = isinstance(source, Sequence) and len(source) > 0
    if not is_list or not all(isinstance(entry, Encounter) for entry in source):
        raise InputError(
            "encounter: an encounter, a list of encounters or a log is needed, e.g. "
            f"read_log(path).encounters[0], not {type(source).__name__}"
        )
    return list(source)


def config_of(config: PipelineConfig | Mapping[str, Any]) -> PipelineConfig:
    """Return the parameters; a mapping has the names of a parameter file, nested or with dots.

    Raises:
        InputError: a name is unknown, a value is out of range, or it is something else.
    """
    if isinstance(config, PipelineConfig):
        return config
    if isinstance(config, Mapping):
        return updated(PipelineConfig(), dict(dotted(config)))
    raise InputError(
        "config: a PipelineConfig is needed, e.g. PipelineConfig(sampling=SamplingConfig()), not "
        f"{type(config).__name__}"
    )


def request_of(request: Request | Mapping[str, Any] | str) -> Request:
    """Return the request; a mapping has its fields, a text is its target.

    Raises:
        InputError: a field is unknown, a value is invalid, or it is something else.
    """
    if isinstance(request, Request):
        return request
    if isinstance(request, str):
        return Request(target=request)
    if isinstance(request, Mapping):
        return updated(Request(), dict(request))
    raise InputError(
        f"request: a Request is needed, e.g. Request(ego='2'), not {type(request).__name__}"
    )


def whole_number(name: str, value: Any, lowest: int) -> int:
    """Return an argument that is a whole number.

    Raises:
        InputError: it is not, or it is below `lowest`.
    """
    try:
        number = operator.index(value)
    except TypeError:
        number = lowest - 1
    if number < lowest or isinstance(value, bool):
        raise InputError(f"{name}: a whole number of at least {lowest} is needed, not {value!r}")
    return number


def seed_of(seed: int | None) -> int:
    """Return the seed; None draws one, which the result has.

    Raises:
        InputError: it is no whole number, or negative.
    """
    return secrets.randbits(31) if seed is None else whole_number("seed", seed, 0)


def progress_of(progress: Progress | bool | None) -> Progress:
    """Return what takes scenarios so far, scenarios wanted and candidates; True prints them.

    Raises:
        InputError: it is something else.
    """
    if progress is True:
        return _print_progress
    if not progress:
        return lambda *_: None
    if not isinstance(progress, Callable):  # type: ignore[arg-type]
        raise InputError(f"progress: True or a function is needed, not {progress!r}")
    return progress


def _print_progress(done: int, wanted: int, candidates: int) -> None:
    """Print how far the generation is, on one line of standard error."""
    end = "\n" if done >= wanted else ""
    print(f"\r{done} of {wanted} scenarios, {candidates} candidates", end=end, file=sys.stderr)
