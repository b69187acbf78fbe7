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

"""ROS parameters from the configuration dataclasses: same names, types, ranges and meanings as on the command line."""

from collections.abc import Sequence
from dataclasses import Field
from typing import Any, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from scenario_gen.errors import InputError
from scenario_gen.parameters import flatten, updated

Config = TypeVar("Config")
INT64 = 2**63 - 1


def descriptor(entry: "Field[Any]", *, read_only: bool = False) -> ParameterDescriptor:
    """Return the descriptor of one declared parameter; a real number may also be written without a point."""
    meta = entry.metadata
    text = meta["meaning"] + (f" [{meta['unit']}]" if meta["unit"] else "")
    result = ParameterDescriptor(description=text, read_only=read_only)
    if meta["choices"]:
        result.additional_constraints = "one of " + ", ".join(meta["choices"])
    if isinstance(entry.default, float):
        result.dynamic_typing = True
        if (meta["low"], meta["high"]) != (None, None):
            low, high = (float(end if end is not None else sign * 1e300) for end, sign in ((meta["low"], -1), (meta["high"], 1)))
            result.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
    elif isinstance(entry.default, int) and not isinstance(entry.default, bool) and (meta["low"], meta["high"]) != (None, None):
        low, high = (int(end if end is not None else sign * INT64) for end, sign in ((meta["low"], -1), (meta["high"], 1)))
        result.integer_range = [IntegerRange(from_value=low, to_value=high)]
    return result


def with_values(config: Config, parameters: Sequence[Parameter]) -> Config:
    """Return `config` with those of the parameters that belong to it.

    Raises:
        InputError: a value has the wrong type or is out of range.
    """
    known = flatten(config)
    return updated(config, {p.name: p.value for p in parameters if p.name in known})


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
        """Declare every parameter of `config`; overrides from the command line or a file take effect.

        Raises:
            InputError: an override has the wrong type or is out of range.
        """
        self.config = config
        self._node = node
        for name, (entry, value) in flatten(config).items():
            try:
                node.declare_parameter(name, value, descriptor(entry))
            except Exception as error:
                raise InputError(f"{node.get_fully_qualified_name()}: parameter {name}: {error}") from error
        self.config = with_values(config, [node.get_parameter(name) for name in flatten(config)])
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._take)

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            with_values(self.config, parameters)
        except InputError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _take(self, parameters: list[Parameter]) -> None:
        self.config = with_values(self.config, parameters)

    def log(self) -> None:
        """Log the values in effect: a parameter file keyed to another node would be ignored in silence."""
        values = ", ".join(f"{name}={value!r}" for name, (_, value) in flatten(self.config).items())
        self._node.get_logger().info(f"effective parameters: {values}")
