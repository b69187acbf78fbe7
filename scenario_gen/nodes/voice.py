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

"""What a node says: its publishers, which speak while the node is active and fall silent with it."""

import threading
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from msg_conventions.topics import Quality, topic_entry
from scenario_gen.nodes.message_classes import message_class
from scenario_gen.nodes.publishing import publish
from scenario_gen.nodes.worker import stop_if_left_behind


def qos(quality: Quality) -> QoSProfile:
    """Return the profile of a topic."""
    return QoSProfile(
        depth=quality.depth,
        reliability=ReliabilityPolicy.RELIABLE if quality.reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if quality.transient_local else DurabilityPolicy.VOLATILE,
    )


class Voice:
    """The publishers of one node.

    A message is published whole or not at all: once `silence` has returned nothing more is, whatever still runs.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._publishers: dict[str, Any] = {}
        self._one_at_a_time = threading.RLock()
        self._heard = False

    def begin(self) -> None:
        """Speak from now on."""
        self._heard = True

    def silence(self) -> None:
        """Speak no more."""
        with self._one_at_a_time:
            self._heard = False

    def announce(self, topic: str) -> None:
        """Offer a topic of the suite.

        Raises:
            CancelledError: on the thread of a job that was left behind.
        """
        with self._one_at_a_time:
            stop_if_left_behind()
            if topic not in self._publishers:
                kind, quality = topic_entry(topic)
                self._publishers[topic] = self._node.create_publisher(message_class(kind), topic, qos(quality))

    def send(self, topic: str, data: bytes) -> None:
        """Publish the CDR bytes of a topic of the suite, if the node is active.

        Raises:
            CancelledError: on the thread of a job that was left behind.
        """
        with self._one_at_a_time:
            stop_if_left_behind()
            if self._heard:
                self.announce(topic)
                self.publish(self._publishers[topic], data)

    def publish(self, publisher: Any, data: bytes) -> None:
        """Publish the CDR bytes of any publisher of the node, if it is active.

        Raises:
            CancelledError: on the thread of a job that was left behind.
        """
        with self._one_at_a_time:
            stop_if_left_behind()
            if self._heard:
                publish(self._node, publisher, data)

    def insist(self, topic: str, data: bytes) -> None:
        """Publish the CDR bytes of a topic of the suite, active or not: what keeps the node from becoming active."""
        with self._one_at_a_time:
            self.announce(topic)
            publish(self._node, self._publishers[topic], data)

    def withdraw(self) -> None:
        """Take all publishers back, and with them what late joiners would have got."""
        with self._one_at_a_time:
            for topic in list(self._publishers):
                self._node.destroy_publisher(self._publishers.pop(topic))
