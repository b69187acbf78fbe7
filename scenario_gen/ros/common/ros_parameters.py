# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""ROS parameters from the configuration dataclasses: same names, types, ranges and meanings as on the command line.

The tools of ROS guess a value's type from its text, each by rules of its own: `-p ego:=21202` is an integer, and `param load`
makes a text of the 1e-06 that `param dump` wrote. The declaration says what was meant, so values are brought to its type.
"""

from collections.abc import Sequence
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
from scenario_gen.base.parameters import flatten, updated

Config = TypeVar("Config")
INT64 = 2**63 - 1
USAGE = "usage: {name} [--namespace NAME]... [--ros-args -p PARAMETER:=VALUE ...]"
STATES = (
    "starts",
    "goals",
)  # `1: 10.5 -1.75` would be a mapping to `param load`, so it is kept as `1:10.5 -1.75`


def descriptor(entry: "Field[Any]") -> ParameterDescriptor:
    """Return the descriptor of one declared parameter; what is no real number or text may become one (see `meant`)."""
    meta = entry.metadata
    result = ParameterDescriptor(
        description=meta["meaning"] + _unit(entry),
        dynamic_typing=isinstance(entry.default, float | str),
    )
    if meta["choices"]:
        result.additional_constraints = "one of " + ", ".join(meta["choices"])
    low, high = meta["low"], meta["high"]
    if (low, high) == (None, None):
        return result
    if isinstance(entry.default, float):
        low, high = float(-1e300 if low is None else low), float(1e300 if high is None else high)
        result.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
    else:
        low, high = -INT64 if low is None else int(low), INT64 if high is None else int(high)
        result.integer_range = [IntegerRange(from_value=low, to_value=high)]
    return result


def meant(entry: "Field[Any]", value: Any) -> Any:
    """Return a value as the type that `entry` declares, if it can be meant so, else as it is."""
    if (
        isinstance(entry.default, str)
        and isinstance(value, int | float)
        and not isinstance(value, bool)
    ):
        return str(value)
    if (
        isinstance(entry.default, float)
        and isinstance(value, int | str)
        and not isinstance(value, bool)
    ):
        with suppress(ValueError):
            return float(value)
    return value


def with_values(config: Config, parameters: Sequence[Parameter]) -> Config:
    """Return `config` with those of the parameters that belong to it.

    Raises:
        InputError: a value has the wrong type or is out of range.
    """
    known = flatten(config)
    return updated(
        config, {p.name: meant(known[p.name][0], p.value) for p in parameters if p.name in known}
    )


def values_of_call(config: Config, messages: Sequence[Any]) -> Config:
    """Return `config` with the rcl_interfaces/Parameter messages of a caller.

    Raises:
        InputError: one is unknown, has the wrong type or is out of range.
    """
    parameters = [Parameter.from_parameter_msg(message) for message in messages]
    if unknown := sorted({p.name for p in parameters} - set(flatten(config))):
        raise InputError(f"unknown parameter {', '.join(unknown)}")
    return with_values(config, parameters)


class ConfigParameters:
    """Keeps a configuration and the ROS parameters of a node the same."""

    def __init__(self, node: Node, config: Any) -> None:
        """Declare every parameter of `config`, and log the values in effect; overrides of the command line or a file are taken.

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
        given = [node.get_parameter(name) for name in self._declared]
        self.config = with_values(config, given)
        node.set_parameters([kept for old in given if (kept := self._kept(old)) is not old])
        self.config = with_values(config, [node.get_parameter(name) for name in self._declared])
        node.add_pre_set_parameters_callback(self._keep)
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._take)
        # a parameter file keyed to another node would be ignored in silence
        values = ", ".join(
            f"{name}={value!r}" for name, (_, value) in flatten(self.config).items()
        )
        node.get_logger().info(f"effective parameters: {values}")

    def _keep(self, parameters: list[Parameter]) -> list[Parameter]:
        """Return what is to be set: values of the declared types, and nothing that is read-only and in effect already."""
        changes = [
            self._kept(parameter) for parameter in parameters if not self._repeats(parameter)
        ]
        # `param load` sets what was dumped one by one, read-only ones too, and rclpy refuses to set nothing
        return changes or [self._node.get_parameter(next(iter(self._declared)))]

    def _kept(self, parameter: Parameter) -> Parameter:
        """Return the parameter as it is kept; itself, if nothing is to be changed."""
        name, old = parameter.name, parameter.value
        if name not in self._declared:
            return parameter
        new = meant(self._declared[name], old)
        if name in STATES and isinstance(new, str):
            new = re.sub(r":\s+", ":", new)
        return parameter if type(new) is type(old) and new == old else Parameter(name, value=new)

    def _repeats(self, parameter: Parameter) -> bool:
        """Say whether a read-only parameter is given the value that it has."""
        node = self._node
        if (
            not node.has_parameter(parameter.name)
            or not node.describe_parameter(parameter.name).read_only
        ):
            return False
        return bool(node.get_parameter(parameter.name).value == parameter.value)

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            with_values(self.config, parameters)
        except InputError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _take(self, parameters: list[Parameter]) -> None:
        self.config = with_values(self.config, parameters)


def config_of(node: Any) -> Any:
    """Return the default configuration of a node's class: the `Config` of its module."""
    return sys.modules[node.__module__].Config()


def help_of(name: str, nodes: Sequence[Any]) -> str:
    """Return the usage of an executable, and every parameter of its nodes: default value, unit, meaning, choices."""
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


def _unit(entry: "Field[Any]") -> str:
    return f" [{entry.metadata['unit']}]" if entry.metadata["unit"] else ""
