# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters and versions behind a scenario, as texts in the summary of its request."""

from collections.abc import Mapping
from functools import cache
from importlib import metadata
import platform
from typing import Any, TypeVar

import scenario_gen
from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import flatten, parsed, updated, values_of

Config = TypeVar("Config")
RECORDING = "recording"
"""Key of the name of a template's recording."""

_LOG_PREFIX = "log "
_HASH_PREFIX = "sha256 "
_version = cache(metadata.version)


def log_texts(hashes: Mapping[str, str]) -> dict[str, str]:
    """Return the provenance entries of logs, from their SHA-256 by name."""
    return {_LOG_PREFIX + name: _HASH_PREFIX + sha256 for name, sha256 in hashes.items()}


def versions() -> dict[str, str]:
    """Return the versions that can change the last digits of a scenario."""
    result = {"scenario_gen": scenario_gen.__version__, "python": platform.python_version()}
    return result | {name: _version(name) for name in ("numpy", "scipy", "numba")}


def parameter_texts(config: Any) -> dict[str, str]:
    """Return {dotted name: text} of all parameters of a configuration, floats exact to the bit."""
    return {name: str(value) for name, value in values_of(config).items()}


def what_makes_it_again(config: Any, request: Any) -> dict[str, str]:
    """Return versions, all parameters, and what a request asks for."""
    asked = {name: text for name, text in parameter_texts(request).items() if text}
    return asked | versions() | parameter_texts(config)


def read_parameters(config: Config, texts: Mapping[str, str], prefix: str, origin: str) -> Config:
    """Return `config` with the values that `texts` has under `prefix`, e.g. "sampling.".

    Raises:
        InputError: a parameter is missing there, or its text is no such value; the message names
            `origin`.
    """
    values: dict[str, Any] = {}
    for name, (entry, _) in flatten(config).items():
        text = texts.get(prefix + name)
        if text is None:
            raise InputError(f"{origin}: parameter {prefix}{name} is missing")
        values[name] = parsed(entry, text, f"{origin}: parameter {prefix}{name}")
    return updated(config, values)
