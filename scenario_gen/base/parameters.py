# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters declared once: default, unit, range and meaning; the command line, the nodes and docs/ read them here."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, Field, field, fields, is_dataclass, replace
import math
from pathlib import Path
from typing import Any, TypeVar

from scenario_gen.base.documents import parse_yaml, read_yaml, shown, WHOLE
from scenario_gen.base.errors import did_you_mean, InputError
from scenario_gen.base.registry import installed

Config = TypeVar("Config")
KINDS = {float: "a number", int: "a whole number", bool: "true or false", str: "text"}


def parameter(
    default: Any,
    meaning: str,
    *,
    unit: str = "",
    low: float | None = None,
    high: float | None = None,
    choices: tuple[str, ...] = (),
    group: str = "",
) -> Any:
    """Declare one parameter of a frozen configuration dataclass; bounds are inclusive.

    Args:
        default: its value, which also gives its type.
        meaning: what it is, for people.
        unit: of its values, "" for a plain number.
        low: least value, None for no bound.
        high: largest value, None for no bound.
        choices: the texts allowed, none for any.
        group: of entry points, whose names are allowed beside `choices` (see `base.registry`).
    """
    meta = {
        "meaning": meaning,
        "unit": unit,
        "low": low,
        "high": high,
        "choices": choices,
        "group": group,
    }
    return field(default=default, metadata=meta)


@dataclass(frozen=True)
class Parameters:
    """Base of every configuration: its values are checked when it is created.

    Raises:
        InputError: a value has the wrong type or is out of range.
    """

    @property
    def of_plugins(self) -> "Mapping[str, Parameters]":
        """Configurations nested in it that installed packages add, by name; they are kept in the field `plugins`."""
        return {}

    def __post_init__(self) -> None:
        for entry in fields(self):
            if entry.metadata:
                check_value(entry.name, entry, getattr(self, entry.name))


def check_value(name: str, entry: "Field[Any]", value: Any) -> None:
    """Raise InputError naming `name` if `value` does not suit the declaration `entry`."""
    kind: type[Any] = type(entry.default)
    if isinstance(value, int) and not -WHOLE <= value < WHOLE:
        raise InputError(f"parameter {name} is an integer of more than 64 bits")
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        raise InputError(f"parameter {name} must be {KINDS[kind]}, not {shown(value)!r}")
    meta = entry.metadata
    if meta["choices"] and value not in meta["choices"]:
        plugins = installed(meta["group"]) if meta["group"] else {}
        if value not in plugins:
            choices = [one for one in (*meta["choices"], *plugins) if one]
            listed = ", ".join(choices) + did_you_mean(str(value), choices)
            raise InputError(f"parameter {name} is {shown(value)!r}; choose one of {listed}")
    if kind in (int, float):
        if not math.isfinite(value):
            raise InputError(f"parameter {name} is {value}; give a finite number")
        if meta["low"] is not None and value < meta["low"]:
            raise InputError(
                f"parameter {name} is {value}; it must be at least {meta['low']} {meta['unit']}".rstrip()
            )
        if meta["high"] is not None and value > meta["high"]:
            raise InputError(
                f"parameter {name} is {value}; it must be at most {meta['high']} {meta['unit']}".rstrip()
            )


def flatten(config: Any, prefix: str = "") -> dict[str, tuple["Field[Any]", Any]]:
    """Return {dotted name: (declaration, value)} of a configuration and the configurations nested in it."""
    flat: dict[str, tuple[Field[Any], Any]] = {}
    for entry in fields(config):
        value = getattr(config, entry.name)
        if is_dataclass(value):
            flat |= flatten(value, f"{prefix}{entry.name}.")
        elif entry.metadata:
            flat[prefix + entry.name] = (entry, value)
    for name, value in _of_plugins(config).items():
        flat |= flatten(value, f"{prefix}{name}.")
    return flat


def _of_plugins(config: Any) -> Mapping[str, Parameters]:
    return config.of_plugins if isinstance(config, Parameters) else {}


def _unknown(config: Any, name: str, prefix: str = "") -> str:
    """Return the message on a name that is no parameter of a configuration."""
    near = did_you_mean(name, flatten(config))
    return f"unknown parameter {prefix}{shown(name)}; `scenario-gen parameters` lists them{near}"


def updated(config: Config, values: dict[str, Any], prefix: str = "") -> Config:
    """Return a copy of `config` with the dotted names in `values` set.

    Raises:
        InputError: a name is unknown, or a value has the wrong type or is out of range.
    """
    changes: dict[str, Any] = {}
    nested: dict[str, dict[str, Any]] = {}
    known = {entry.name: entry for entry in fields(config)}  # type: ignore[arg-type]
    inside: dict[str, Any] = {
        name: part for name in known if is_dataclass(part := getattr(config, name))
    }
    inside.update(_of_plugins(config))
    for name, value in values.items():
        head, _, rest = name.partition(".")
        if (
            head not in inside
            if rest
            else head in inside or head not in known or not known[head].metadata
        ):
            raise InputError(_unknown(config, name, prefix))
        if rest:
            nested.setdefault(head, {})[rest] = value
        else:
            check_value(prefix + head, known[head], value)
            changes[head] = float(value) if isinstance(known[head].default, float) else value
    for head, inner in nested.items():
        part = updated(inside[head], inner, f"{prefix}{head}.")
        if head in known:
            changes[head] = part
        else:
            changes["plugins"] = (
                *changes.get("plugins", getattr(config, "plugins", ())),
                (head, part),
            )
    return replace(config, **changes)  # type: ignore[type-var]


def assigned(config: Config, assignment: str) -> Config:
    """Return a copy of `config` with one `name=value` set; the value is YAML, but text for a parameter that is text.

    Raises:
        InputError: there is no `=`, the name is unknown, or the value is no YAML or does not suit; the message names it.
    """
    name, equals, text = assignment.partition("=")
    if not equals:
        raise InputError(f"--set {shown(assignment)}: write it as name=value")
    known = flatten(config)
    if name not in known:
        raise InputError(_unknown(config, name))
    is_text = isinstance(known[name][0].default, str)  # stays text: vehicle "007" is no number
    value = text if is_text else parse_yaml(text, f"--set {name}={shown(text)}")
    if isinstance(known[name][0].default, float) and isinstance(value, str):
        with suppress(ValueError):
            value = float(value)  # 1e9 and nan, which are texts in YAML
    return updated(config, {name: value})


def loaded(config: Config, path: Path) -> Config:
    """Return a copy of `config` with the values of a parameter file.

    Raises:
        InputError: the file cannot be read, a name is unknown or a value does not suit; the message names file and parameter.
    """
    values = read_parameter_file(path)
    try:
        return updated(config, values)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def read_parameter_file(path: Path) -> dict[str, Any]:
    """Return {dotted name: value} of a ROS 2 parameter file (`/**: ros__parameters: ...`).

    Raises:
        InputError: the file cannot be read or is not of that form.
    """
    document = read_yaml(path)
    body = (
        next(iter(document.values()))
        if isinstance(document, dict) and len(document) == 1
        else None
    )
    nested = body.get("ros__parameters") if isinstance(body, dict) else None
    if not isinstance(nested, dict):
        raise InputError(f"{path}: not a parameter file of the form '/**: ros__parameters: ...'")
    return dict(_dotted(nested))


def _dotted(nested: dict[Any, Any], prefix: str = "") -> list[tuple[str, Any]]:
    """Flatten nested mappings to (dotted name, value) pairs."""
    pairs: list[tuple[str, Any]] = []
    for name, value in nested.items():
        pairs += (
            _dotted(value, f"{prefix}{name}.")
            if isinstance(value, dict)
            else [(f"{prefix}{name}", value)]
        )
    return pairs
