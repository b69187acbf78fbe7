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
