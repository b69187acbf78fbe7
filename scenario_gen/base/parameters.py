# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Declarations of parameters (default, unit, range, meaning) for commands, nodes and docs/."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, Field, field, fields, is_dataclass, replace
import math
from pathlib import Path
from typing import Any, Self, TypeVar

from scenario_gen.base.documents import MAX_INTEGER_BITS, parse_yaml, read_yaml, shown
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
    fixed: bool = False,
) -> Any:
    """Declare one parameter of a frozen configuration dataclass; bounds are inclusive.

    Args:
        default: its value, which also determines its type.
        meaning: its description.
        unit: of its values, "" without one.
        low: lower bound, or None.
        high: upper bound, or None.
        choices: the allowed texts; none: any.
        group: entry points whose names are also allowed (see `base.registry`).
        fixed: a node reads it only when it starts; it is read-only afterwards.
    """
    meta = {
        "meaning": meaning,
        "unit": unit,
        "low": low,
        "high": high,
        "choices": choices,
        "group": group,
        "fixed": fixed,
    }
    return field(default=default, metadata=meta)


@dataclass(frozen=True)
class Parameters:
    """Base class of configurations, which check their values on creation.

    A class may have a property `of_plugins`: nested configurations from installed packages by
    name, kept in its field `plugins`.

    Raises:
        InputError: a value has the wrong type or is out of range.
    """

    def __new__(cls, *_: Any, **values: Any) -> Self:
        """Refuse a name that is no parameter.

        Raises:
            InputError: there is one.
        """
        for name in values.keys() - cls.__dataclass_fields__.keys():
            raise InputError(_unknown(cls(), name))
        return super().__new__(cls)

    def __post_init__(self) -> None:
        for entry in fields(self):
            if entry.metadata:
                check_value(entry.name, entry, getattr(self, entry.name))


def check_value(name: str, entry: "Field[Any]", value: Any) -> None:
    """Raise InputError naming `name` if `value` does not satisfy the declaration `entry`."""
    kind: type[Any] = type(entry.default)
    if isinstance(value, int) and value.bit_length() > MAX_INTEGER_BITS:
        raise InputError(f"parameter {name} is an integer of more than 64 bits")
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        raise InputError(f"parameter {name} must be {KINDS[kind]}, not {shown(value)!r}")
    if kind is str:
        _check_choice(name, entry.metadata, value)
    elif kind is not bool:
        _check_range(name, entry.metadata, value)


def _check_choice(name: str, meta: Mapping[str, Any], value: str) -> None:
    """Raise InputError if a text is none of the choices."""
    if not meta["choices"] or value in meta["choices"]:
        return
    plugins = installed(meta["group"]) if meta["group"] else {}
    if value not in plugins:
        choices = [choice for choice in (*meta["choices"], *plugins) if choice]
        listed = ", ".join(choices) + did_you_mean(value, choices)
        raise InputError(f"parameter {name} is {shown(value)!r}; choose one of {listed}")


def _check_range(name: str, meta: Mapping[str, Any], value: float) -> None:
    """Raise InputError if a number is not finite or out of range."""
    if not math.isfinite(value):
        raise InputError(f"parameter {name} is {value}; give a finite number")
    low, high, unit = meta["low"], meta["high"], meta["unit"]
    bound = ""
    if low is not None and value < low:
        bound = f"at least {low} {unit}"
    elif high is not None and value > high:
        bound = f"at most {high} {unit}"
    if bound:
        raise InputError(f"parameter {name} is {value}; it must be {bound}".rstrip())


def flatten(config: Any, prefix: str = "") -> dict[str, tuple["Field[Any]", Any]]:
    """Return {dotted name: (declaration, value)} of a configuration and those nested in it."""
    flat: dict[str, tuple[Field[Any], Any]] = {}
    for entry in fields(config):
        value = getattr(config, entry.name)
        if is_dataclass(value):
            flat |= flatten(value, f"{prefix}{entry.name}.")
        elif entry.metadata:
            flat[prefix + entry.name] = (entry, value)
    for name, value in getattr(config, "of_plugins", {}).items():
        flat |= flatten(value, f"{prefix}{name}.")
    return flat


def values_of(config: Any) -> dict[str, Any]:
    """Return {dotted name: value} of a configuration and those nested in it."""
    return {name: value for name, (_, value) in flatten(config).items()}


def _unknown(config: Any, name: str, prefix: str = "") -> str:
    """Return the message on an unknown name of a parameter."""
    near = did_you_mean(name, flatten(config))
    return f"unknown parameter {prefix}{shown(name)}; `scenario-gen --parameters` lists them{near}"


def updated(config: Config, values: dict[str, Any], prefix: str = "") -> Config:
    """Return a copy of `config` with the dotted names in `values` set.

    Raises:
        InputError: a name is unknown, or a value has the wrong type or is out of range.
    """
    declared = {entry.name: entry for entry in fields(config)}  # type: ignore[arg-type]
    nested = {name: getattr(config, name) for name in declared}
    nested = {name: part for name, part in nested.items() if is_dataclass(part)}
    nested |= getattr(config, "of_plugins", {})
    changes: dict[str, Any] = {}
    inner: dict[str, dict[str, Any]] = {}
    for name, value in values.items():
        head, _, rest = name.partition(".")
        if rest and head in nested:
            inner.setdefault(head, {})[rest] = value
        else:
            changes[name] = _checked(config, declared.get(name), name, value, prefix)
    plugins = []
    for head, part_values in inner.items():
        part = updated(nested[head], part_values, f"{prefix}{head}.")
        if head in declared:
            changes[head] = part
        else:
            plugins.append((head, part))
    if plugins:
        changes["plugins"] = (*getattr(config, "plugins", ()), *plugins)
    return replace(config, **changes)  # type: ignore[type-var]


def _checked(
    config: Any, entry: "Field[Any] | None", name: str, value: Any, prefix: str
) -> object:
    """Return a value of a parameter, a whole number as a float where floats are declared.

    Where text is declared, a mapping becomes "name=value, …", and a list "value, …".

    Raises:
        InputError: there is no such parameter, or it must not have this value.
    """
    if entry is None or not entry.metadata:
        raise InputError(_unknown(config, name, prefix))
    if isinstance(entry.default, str):
        if isinstance(value, Mapping):
            value = [f"{part}={text}" for part, text in value.items()]
        if isinstance(value, list | tuple):
            value = ",".join(map(str, value))
    check_value(prefix + name, entry, value)
    return float(value) if isinstance(entry.default, float) else value


def assigned(config: Config, assignment: str) -> Config:
    """Return a copy of `config` with one `name=value` set.

    The value is YAML, or plain text for a text parameter.

    Raises:
        InputError: there is no `=`, the name is unknown, or the value is no YAML or invalid; the
            message names it.
    """
    name, equals, text = assignment.partition("=")
    if not equals:
        raise InputError(f"--set {shown(assignment)}: write it as name=value")
    known = flatten(config)
    if name not in known:
        raise InputError(_unknown(config, name))
    value = parsed(known[name][0], text, f"--set {name}={shown(text)}")
    return updated(config, {name: value})


def parsed(entry: "Field[Any]", text: str, source: str) -> Any:
    """Return the value of a text for a declared parameter; `source` names it in messages.

    Raises:
        InputError: the text is not YAML.
    """
    if isinstance(entry.default, str):  # the vehicle "007" is not a number
        return text
    value = parse_yaml(text, source)
    if isinstance(entry.default, float) and isinstance(value, str):
        with suppress(ValueError):
            return float(value)  # YAML reads 1e9 and nan as texts
    return value


def loaded(config: Config, path: Path) -> Config:
    """Return a copy of `config` with the values of a parameter file.

    Raises:
        InputError: the file cannot be read, a name is unknown or a value is invalid; the message
            names file and parameter.
    """
    values = read_parameter_file(path)
    try:
        return updated(config, values)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def read_parameter_file(path: Path) -> dict[str, Any]:
    """Return {dotted name: value} of a ROS 2 parameter file (`/**: ros__parameters: ...`).

    Raises:
        InputError: the file cannot be read or has another form.
    """
    document = read_yaml(path)
    nested = None
    if isinstance(document, dict) and len(document) == 1:
        (body,) = document.values()
        nested = body.get("ros__parameters") if isinstance(body, dict) else None
    if not isinstance(nested, dict):
        raise InputError(f"{path}: not a parameter file of the form '/**: ros__parameters: ...'")
    return dict(dotted(nested))


def dotted(nested: Mapping[Any, Any], prefix: str = "") -> list[tuple[str, Any]]:
    """Flatten nested mappings to (dotted name, value) pairs."""
    pairs: list[tuple[str, Any]] = []
    for name, value in nested.items():
        if isinstance(value, dict):
            pairs += dotted(value, f"{prefix}{name}.")
        else:
            pairs.append((f"{prefix}{name}", value))
    return pairs
