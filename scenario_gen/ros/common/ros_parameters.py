# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""ROS parameters from configuration dataclasses, the same as on the command line.

ROS tools guess a value's type from its text, each in its own way: `-p ego:=21202` is an integer,
and `param load` reads the 1e-06 that `param dump` wrote as a text. So values are converted to the
declared type.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import Field
import json
import re
import sys
from typing import Any, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import flatten, updated, values_of

Config = TypeVar("Config")
USAGE = "usage: {name} [--namespace NAME]... [--ros-args -p PARAMETER:=VALUE ...]"
# `param load` would read `1: 10.5 -1.75` as a mapping, so it is stored as `1:10.5 -1.75`.
STATE_PARAMETERS = ("starts", "goals")


def descriptor(entry: "Field[Any]") -> ParameterDescriptor:
    """Return the descriptor of a declared parameter.

    It is dynamically typed if `converted` may change the type.
    """
    meta = entry.metadata
    result = ParameterDescriptor(
        description=meta["meaning"] + _unit(entry),
        dynamic_typing=isinstance(entry.default, float | str),
    )
    if meta["choices"]:
        result.additional_constraints = "one of " + ", ".join(meta["choices"])
    low, high = meta["low"], meta["high"]
    if low is None and high is None:
        return result
    bound = 1e300 if isinstance(entry.default, float) else 2**63 - 1
    low = -bound if low is None else low
    high = bound if high is None else high
    if isinstance(entry.default, float):
        value_range = FloatingPointRange(from_value=float(low), to_value=float(high))
        result.floating_point_range = [value_range]
    else:
        result.integer_range = [IntegerRange(from_value=int(low), to_value=int(high))]
    return result


def converted(entry: "Field[Any]", value: Any) -> Any:
    """Return a value as the declared type of `entry`, unchanged where it has no such form."""
    if isinstance(value, bool):
        return value
    if isinstance(entry.default, str) and isinstance(value, int | float):
        return str(value)
    if isinstance(entry.default, float) and isinstance(value, int | str):
        with suppress(ValueError):
            return float(value)
    return value


def with_values(config: Config, parameters: Sequence[Parameter]) -> Config:
    """Return `config` with the values of parameters; those that are not its own are ignored.

    Raises:
        InputError: a value has the wrong type or is out of range.
    """
    known = flatten(config)
    values = {p.name: converted(known[p.name][0], p.value) for p in parameters if p.name in known}
    return updated(config, values)


def values_of_call(config: Config, messages: Sequence[Any]) -> Config:
    """Return `config` with the values in a caller's rcl_interfaces/Parameter messages.

    Raises:
        InputError: one is unknown, has the wrong type or is out of range.
    """
    parameters = [Parameter.from_parameter_msg(message) for message in messages]
    if unknown := sorted({p.name for p in parameters} - set(flatten(config))):
        raise InputError(f"unknown parameter {', '.join(unknown)}")
    return with_values(config, parameters)


class ConfigParameters:
    """Keeps a configuration and the ROS parameters of a node equal."""

    def __init__(self, node: Node, config: Any) -> None:
        """Declare every parameter of `config`, apply overrides, and log them.

        Raises:
            InputError: an override has the wrong type or is out of range.
        """
        self.config = config
        self._node = node
        self._declared = {name: entry for name, (entry, _) in flatten(config).items()}
        for name, (entry, value) in flatten(config).items():
            try:
                node.declare_parameter(name, value, descriptor(entry))
            except Exception as error:
                raise InputError(
                    f"{node.get_fully_qualified_name()}: parameter {name}: {error}"
                ) from error
        overrides = [node.get_parameter(name) for name in self._declared]
        self.config = with_values(config, overrides)
        stored = [self._stored(parameter) for parameter in overrides]
        node.set_parameters(
            [new for new, old in zip(stored, overrides, strict=True) if new is not old]
        )
        self.config = with_values(config, [node.get_parameter(name) for name in self._declared])
        for name, entry in self._declared.items():
            if entry.metadata["fixed"]:
                fixed = descriptor(entry)
                fixed.type = node.describe_parameter(name).type
                fixed.read_only = True
                node.set_descriptor(name, fixed)
        node.add_pre_set_parameters_callback(self._prepare)
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._apply)
        # ROS ignores a parameter file for another node silently; the log shows it.
        values = values_of(self.config)
        node.get_logger().debug(f"all parameters: {_listed(values)}")
        defaults = values_of(config)
        given = {name: value for name, value in values.items() if value != defaults[name]}
        node.get_logger().info(f"parameters: {_listed(given) or 'all have their defaults'}")

    def _prepare(self, parameters: list[Parameter]) -> list[Parameter]:
        """Convert values to the declared types, and drop read-only parameters that do not change.

        `param load` also sets read-only parameters, one by one, and rclpy refuses to set none.
        """
        changes = [
            self._stored(parameter)
            for parameter in parameters
            if not self._is_unchanged_read_only(parameter)
        ]
        free = (name for name, entry in self._declared.items() if not entry.metadata["fixed"])
        return changes or [self._node.get_parameter(next(free))]

    def _stored(self, parameter: Parameter) -> Parameter:
        """Return the parameter in its stored form, the same object if it has that form."""
        name, old = parameter.name, parameter.value
        if name not in self._declared:
            return parameter
        new = converted(self._declared[name], old)
        if name in STATE_PARAMETERS and isinstance(new, str):
            new = re.sub(r":\s+", ":", new)
        return parameter if type(new) is type(old) and new == old else Parameter(name, value=new)

    def _is_unchanged_read_only(self, parameter: Parameter) -> bool:
        node, name = self._node, parameter.name
        if not node.has_parameter(name) or not node.describe_parameter(name).read_only:
            return False
        return bool(node.get_parameter(name).value == parameter.value)

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            with_values(self.config, parameters)
        except InputError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply(self, parameters: list[Parameter]) -> None:
        self.config = with_values(self.config, parameters)


def config_of(node: Any) -> Any:
    """Return the default configuration of a node's class: `Config` in its module."""
    return sys.modules[node.__module__].Config()


def help_of(name: str, nodes: Sequence[Any]) -> str:
    """Return the usage of an executable, and its nodes' parameters.

    Default, unit, meaning, choices.
    """
    lines = [USAGE.format(name=name)]
    for node in nodes:
        module = sys.modules[node.__module__]
        lines += ["", f"{(module.__doc__ or '').strip()}", "", f"Parameters of {node.__name__}:"]
        for parameter, (entry, value) in flatten(config_of(node)).items():
            meta = entry.metadata
            choices = f"; one of {', '.join(meta['choices'])}" if meta["choices"] else ""
            written = f"'{value}'" if isinstance(value, str) else json.dumps(value)
            lines.append(
                f"  {parameter} := {written}{_unit(entry)}\n      {meta['meaning']}{choices}"
            )
    return "\n".join(lines)


def _listed(values: Mapping[str, Any]) -> str:
    return ", ".join(f"{name}={value!r}" for name, value in values.items())


def _unit(entry: "Field[Any]") -> str:
    return f" [{entry.metadata['unit']}]" if entry.metadata["unit"] else ""
