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

"""ROS message classes by their name."""

import importlib
from typing import Any

from scenario_gen.errors import InputError


def message_class(kind: str) -> Any:
    """Return the class of e.g. `nav_msgs/msg/Path`.

    Raises:
        InputError: the package is not installed or has no such type.
    """
    package, _, name = kind.partition("/msg/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError, ValueError):
        if kind == "tf2_msgs/msg/TFMessage":
            from scenario_gen.nodes.raw_tf import raw_tf_message

            return raw_tf_message()
        raise InputError(f"message type {kind} is not installed; source the workspace that has {package or 'it'}") from None
