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

"""Pacing: no message of a publisher overwrites one that its subscribers have not acknowledged.

A publisher remembers as many messages as its depth says; what it forgets before a subscriber has it is lost, in silence. A reader
that keeps all acknowledges a message only where it has room for it (Fast DDS: 5000 of a topic), so whoever waits for
acknowledgements goes no faster than its subscribers.
"""

from collections.abc import Callable
from contextlib import suppress
from threading import Event
from time import monotonic, sleep
from typing import Any

from rclpy.duration import Duration
from rclpy.exceptions import InvalidHandle
from rclpy.executors import Executor
from rclpy.node import Node

TICK = 0.002  # seconds between two looks for acknowledgements
SLOWLY = 0.001  # seconds for each message while a subscriber is not waited for: for the sake of the others


class Pace:
    """Counts what one publisher's subscribers may not have acknowledged yet."""

    def __init__(self, publisher: Any, depth: int, patience: float, tell: Callable[[int], None]) -> None:
        """Begin.

        Args:
            publisher: of rclpy.
            depth: messages that it remembers.
            patience: seconds without acknowledgement after which its subscribers are not waited for; 0: always wait.
            tell: called when that happens with 0, and when all is acknowledged again, or at `end`, with the number of
                messages that were published meanwhile.
        """
        self._publisher, self._patience, self._tell = publisher, patience, tell
        self._most = max(1, depth * 9 // 10)
        self._open = 0  # messages since everything was acknowledged, or was waited for in vain
        self._left = patience  # seconds that the next wait may take
        self._alone = False  # a subscriber is not waited for
        self._unheard = 0

    def wait(self, stop: Callable[[], bool]) -> None:
        """Wait until one message more overwrites none that is on its way, or `stop` says so."""
        if 8 * self._open >= self._most and self._acknowledged():
            self._done()
        deadline = monotonic() + self._left
        while self._open >= self._most and not stop():
            if self._acknowledged():
                self._done()
            elif self._patience and monotonic() >= deadline:
                self._go_on()
            else:
                sleep(TICK)
        if self._alone:
            self._unheard += 1
            sleep(SLOWLY)
        self._open += 1

    def end(self) -> None:
        """Say what is still unacknowledged of what was not waited for."""
        if self._alone:
            self._done()

    def _go_on(self) -> None:
        """Wait no more for now, and half as long the next time: twice `patience` in all."""
        self._open, self._left = 0, 0.5 * self._left
        if not self._alone:
            self._alone = True
            self._tell(0)

    def _done(self) -> None:
        unheard, alone = self._unheard, self._alone
        self._open, self._unheard, self._alone, self._left = 0, 0, False, self._patience
        if alone:
            self._tell(unheard)

    def _acknowledged(self) -> bool:
        with suppress(InvalidHandle):  # it was destroyed meanwhile
            return bool(self._publisher.wait_for_all_acked(Duration()))
        return True


def let_others_take(executor: Executor | None, stop: Callable[[], bool]) -> None:
    """Wait until the executor has gone round once, where it serves other nodes, too: each subscription takes a message then.

    In one process the worker would else outrun the executor's thread without end. Never called on that thread.
    """
    if executor is None or len(executor.get_nodes()) < 2:
        return
    turned = Event()
    executor.create_task(turned.set)
    while not turned.wait(TICK) and not stop():
        pass


def unheard(node: Node, topic: str, count: int) -> str:
    """Say in a sentence what `Pace` told: that a topic's subscribers are not waited for any more, or what they may lack."""
    name = node.resolve_topic_name(topic)
    said = f"a subscriber of {name} acknowledges nothing; it is not waited for any more"
    if count:
        said = f"{count} messages of {name} were published without acknowledgement, a subscriber may lack them"
    who = ", ".join(sorted({one.node_name for one in node.get_subscriptions_info_by_topic(name)})) or "none any more"
    return f"{said} (subscribers: {who}); see which one hangs, or raise patience; who joins anew gets the last 1000"
