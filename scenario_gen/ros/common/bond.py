# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The bond of a lifecycle node with its manager: a manager as nav2's sees a node that has died.

Both sides publish bond/msg/Status on `bond` with the node's name as id. A side that misses the
other one's heartbeat, or receives `active: false`, knows that it has ended.
"""

from typing import Any
from uuid import uuid4

from rclpy.node import Node

from scenario_gen.base.errors import InputError
from scenario_gen.ros.common.timers import create_steady_timer
from scenario_gen.ros.common.topics import message_class, publish

TOPIC = "bond"
DEPTH_COUNT = 10
PERIOD_S = 1.0
TIMEOUT_S = 4.0


class Bond:
    """Heartbeats while a node is active, if the package `bond` is installed."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._instance_id = str(uuid4())
        self._timer: Any = None
        try:
            self._status = message_class("bond/msg/Status")
        except InputError:
            self._status = None
            return
        self._publisher = node.create_publisher(self._status, TOPIC, DEPTH_COUNT)
        node.create_subscription(self._status, TOPIC, self._receive, DEPTH_COUNT)

    def start(self) -> None:
        """Send heartbeats from now on."""
        if self._status is not None and self._timer is None:
            self._timer = create_steady_timer(self._node, PERIOD_S, lambda: self._send(True))

    def stop(self) -> None:
        """Tell the manager that the bond ends, and send no more."""
        if self._timer is not None:
            self._node.destroy_timer(self._timer)
            self._timer = None
            self._send(False)

    def _send(self, active: bool) -> None:
        status = self._status(id=self._node.get_name(), instance_id=self._instance_id)
        status.header.stamp = self._node.get_clock().now().to_msg()
        status.active = active
        status.heartbeat_period = PERIOD_S
        status.heartbeat_timeout = TIMEOUT_S
        publish(self._node, self._publisher, status)

    def _receive(self, status: Any) -> None:
        """End the bond when the manager does."""
        ours = status.id == self._node.get_name() and status.instance_id != self._instance_id
        if ours and not status.active:
            self.stop()
