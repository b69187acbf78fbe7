# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What is needed to make a scenario again, as texts in the summary of its request: parameters and versions, out and in."""

from collections.abc import Mapping
from importlib import metadata
import platform
from typing import Any, TypeVar

import yaml

import scenario_gen
from scenario_gen.errors import InputError
from scenario_gen.parameters import flatten, former_name, updated

Config = TypeVar("Config")


def versions() -> dict[str, str]:
    """Return the versions on which the last digit of a scenario may depend."""
    own = {"scenario_gen": scenario_gen.__version__, "python": platform.python_version()}
    return own | {name: metadata.version(name) for name in ("numpy", "scipy", "numba")}


def parameter_texts(config: Any) -> dict[str, str]:
    """Return {dotted name: text} of every parameter of a configuration; real numbers exact to the bit."""
    return {name: str(value) for name, (_, value) in flatten(config).items()}


def read_parameters(config: Config, texts: Mapping[str, str], prefix: str, what: str) -> Config:
    """Return `config` with the values that `texts` has under `prefix`, e.g. "sampling.".

    Raises:
        InputError: a parameter is missing there, or its text is no such value; the message names `what`.
    """
    values: dict[str, Any] = {}
    for name, (entry, _) in flatten(config).items():
        text = texts.get(prefix + name, texts.get(prefix + former_name(name, entry)))
        if text is None:
            raise InputError(f"{what}: parameter {prefix}{name} is not there, so it cannot be made again")
        kind = type(entry.default)
        values[name] = text if kind is str else yaml.safe_load(text.lower()) if kind is bool else _number(kind, text)
    return updated(config, values)


def _number(kind: type, text: str) -> Any:
    """The number that the text says; the text itself if it is none, for `updated` to refuse."""
    try:
        return kind(text)
    except ValueError:
        return text
