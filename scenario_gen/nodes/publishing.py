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

"""Publishing from a thread beside the executor's, while a signal may end the node at any instant."""

from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation as rclpy
from rclpy.node import Node


def publish(node: Node, publisher: Any, data: bytes) -> None:
    """Publish CDR bytes; once the node or its context has ended, whoever published goes unheard, which is no error."""
    try:
        if node.context.ok():
            publisher.publish(data)
    except rclpy.InvalidHandle:
        return  # the publisher was destroyed meanwhile
    except rclpy.RCLError:
        if node.context.ok():
            raise
