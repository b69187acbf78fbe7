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

"""Parameters declared once: default, unit, range and meaning; the command line, the nodes and docs/ read them here."""

from dataclasses import Field, field, fields, is_dataclass, replace
from typing import Any, TypeVar

from scenario_gen.errors import InputError

Config = TypeVar("Config")


def parameter(
    default: Any,
    meaning: str,
    *,
    unit: str = "",
    low: float | None = None,
    high: float | None = None,
    choices: tuple[str, ...] = (),
) -> Any:
    """Declare one parameter of a frozen configuration dataclass; bounds are inclusive."""
    return field(default=default, metadata={"meaning": meaning, "unit": unit, "low": low, "high": high, "choices": choices})


def check(config: Any) -> None:
    """Raise InputError if a value of `config` has the wrong type or is out of range; call it in `__post_init__`."""
    for entry in fields(config):
        if entry.metadata:
            check_value(entry.name, entry, getattr(config, entry.name))


def check_value(name: str, entry: "Field[Any]", value: Any) -> None:
    """Raise InputError naming `name` if `value` does not suit the declaration `entry`."""
    wanted: type[Any] = type(entry.default)
    if wanted is float and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if not isinstance(value, wanted) or (wanted is int and isinstance(value, bool)):
        raise InputError(f"parameter {name} must be of type {wanted.__name__}, not {type(value).__name__} ({value!r})")
    meta = entry.metadata
    if meta["choices"] and value not in meta["choices"]:
        raise InputError(f"parameter {name} is {value!r}; choose one of {', '.join(meta['choices'])}")
    if wanted in (int, float):
        if value != value:  # noqa: PLR0124 - true of NaN only
            raise InputError(f"parameter {name} is not a number")
        if meta["low"] is not None and value < meta["low"]:
            raise InputError(f"parameter {name} is {value}; it must be at least {meta['low']} {meta['unit']}".rstrip())
        if meta["high"] is not None and value > meta["high"]:
            raise InputError(f"parameter {name} is {value}; it must be at most {meta['high']} {meta['unit']}".rstrip())


def flatten(config: Any, prefix: str = "") -> dict[str, tuple["Field[Any]", Any]]:
    """Return {dotted name: (declaration, value)} of a configuration and the configurations nested in it."""
    flat: dict[str, tuple[Field[Any], Any]] = {}
    for entry in fields(config):
        value = getattr(config, entry.name)
        if is_dataclass(value):
            flat |= flatten(value, f"{prefix}{entry.name}.")
        elif entry.metadata:
            flat[prefix + entry.name] = (entry, value)
    return flat


def updated(config: Config, values: dict[str, Any], prefix: str = "") -> Config:
    """Return a copy of `config` with the dotted names in `values` set.

    Raises:
        InputError: a name is unknown, or a value has the wrong type or is out of range.
    """
    changes: dict[str, Any] = {}
    nested: dict[str, dict[str, Any]] = {}
    known = {entry.name: entry for entry in fields(config)}  # type: ignore[arg-type]
    for name, value in values.items():
        head, _, rest = name.partition(".")
        if head not in known or bool(rest) != is_dataclass(getattr(config, head)):
            raise InputError(f"unknown parameter {prefix}{name}")
        if rest:
            nested.setdefault(head, {})[rest] = value
        else:
            check_value(prefix + head, known[head], value)
            changes[head] = float(value) if isinstance(known[head].default, float) else value
    for head, inner in nested.items():
        changes[head] = updated(getattr(config, head), inner, f"{prefix}{head}.")
    return replace(config, **changes)  # type: ignore[type-var]
