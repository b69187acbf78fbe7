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

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
import threading
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from msg_conventions.topics import Quality, topic_entry
from scenario_gen.nodes.message_classes import message_class
from scenario_gen.nodes.pacing import let_others_take, Pace
from scenario_gen.nodes.publishing import publish
from scenario_gen.nodes.worker import stop_if_left_behind


def qos(quality: Quality) -> QoSProfile:
    """Return the profile of a topic."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_ALL if quality.keep_all else HistoryPolicy.KEEP_LAST,
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
        self._paces: dict[str, Pace] = {}

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

    @contextmanager
    def paced(self, topics: Iterable[str], patience: float, tell: Callable[[str, int], None]) -> Iterator[None]:
        """Let `send_paced` pace these topics inside; `tell` is called with the topic and what its `Pace` says."""
        for topic in topics:
            self.announce(topic)
            depth = topic_entry(topic)[1].depth
            self._paces[topic] = Pace(self._publishers[topic], depth, patience, partial(tell, topic))
        try:
            yield
        finally:
            for topic in topics:
                self._paces.pop(topic).end()

    def send_paced(self, topic: str, data: bytes, stop: Callable[[], bool]) -> None:
        """Publish as `send` does; on a topic that is paced, once its subscribers have room, or `stop` says so.

        Topics that are paced together take turns: on the last of them nodes of the same process are let take, too.
        Not to be called on the executor's thread.

        Raises:
            CancelledError: on the thread of a job that was left behind.
        """
        if topic in self._paces:
            self._paces[topic].wait(lambda: stop() or not self._heard)
            if topic == next(reversed(self._paces)):
                let_others_take(self._node.executor, lambda: stop() or not self._heard)
        self.send(topic, data)

    def publish(self, publisher: Any, data: bytes) -> None:
        """Publish the CDR bytes of any publisher of the node, if it is active.

        Raises:
            CancelledError: on the thread of a job that was left behind.
        """
        with self._one_at_a_time:
            stop_if_left_behind()
            if self._heard:
                publish(self._node, publisher, data)

    def withdraw(self) -> None:
        """Take all publishers back, and with them what late joiners would have got."""
        with self._one_at_a_time:
            for topic in list(self._publishers):
                self._node.destroy_publisher(self._publishers.pop(topic))
