# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters and versions that regenerate a scenario, as texts in the summary of its request."""

from collections.abc import Mapping
from importlib import metadata
import platform
from typing import Any, TypeVar

import yaml

import scenario_gen
from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import flatten, updated

Config = TypeVar("Config")
RECORDING = (
    "recording"  # the name of the recording that a template is of; of a recombined one of both
)


_LOG_PREFIX = "log "
_HASH_PREFIX = "sha256 "


def log_texts(hashes: Mapping[str, str]) -> dict[str, str]:
    """Return the provenance entries of logs, from their SHA-256 by name."""
    return {_LOG_PREFIX + name: _HASH_PREFIX + sha256 for name, sha256 in hashes.items()}


def read_log_hashes(texts: Mapping[str, str]) -> dict[str, str]:
    """Return the SHA-256 of each log by its name, from `log_texts`."""
    return {
        name.removeprefix(_LOG_PREFIX): text.removeprefix(_HASH_PREFIX)
        for name, text in texts.items()
        if name.startswith(_LOG_PREFIX)
    }


def versions() -> dict[str, str]:
    """Return the versions that can change the last digits of a scenario."""
    result = {"scenario_gen": scenario_gen.__version__, "python": platform.python_version()}
    return result | {name: metadata.version(name) for name in ("numpy", "scipy", "numba")}


def parameter_texts(config: Any) -> dict[str, str]:
    """Return {dotted name: text} of all parameters of a configuration, floats exact to the bit."""
    return {name: str(value) for name, (_, value) in flatten(config).items()}


def what_makes_it_again(config: Any, request: Any) -> dict[str, str]:
    """Return versions, all parameters, and what a request asks for."""
    asked = {name: text for name, text in parameter_texts(request).items() if text}
    return asked | versions() | parameter_texts(config)


def read_parameters(config: Config, texts: Mapping[str, str], prefix: str, what: str) -> Config:
    """Return `config` with the values that `texts` has under `prefix`, e.g. "sampling.".

    Raises:
        InputError: a parameter is missing there, or its text is no such value; the message names
            `what`.
    """
    values: dict[str, Any] = {}
    for name, (entry, _) in flatten(config).items():
        text = texts.get(
            prefix + name, texts.get(prefix + name.rpartition(".")[2])
        )  # older bags: a limit of all types
        if text is None:
            raise InputError(
                f"{what}: parameter {prefix}{name} is not there, so it cannot be made again"
            )
        kind = type(entry.default)
        values[name] = (
            text
            if kind is str
            else yaml.safe_load(text.lower())
            if kind is bool
            else _number(kind, text)
        )
    return updated(config, values)


def _number(kind: type, text: str) -> Any:
    """Return the number in a text; the text itself if it is none, for `updated` to refuse."""
    try:
        return kind(text)
    except ValueError:
        return text
