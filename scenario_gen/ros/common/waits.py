# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Coroutines of a node that wait on its executor's thread, such as services without an answer."""

from collections.abc import Callable
import math
from time import monotonic
from typing import Any

from rclpy.task import Future

from scenario_gen.ros.common.timers import create_steady_timer

POLL_S = 0.05  # real time between two checks whether a wait is over


class Waits:
    """The waits of a node's coroutines; they end one after the other, in their order."""

    def __init__(self, node: Any) -> None:
        self._node = node
        self._waiting: list[tuple[Future, Callable[[], bool]]] = []
        self._timer = create_steady_timer(node, POLL_S, self.check)

    async def until(self, is_so: Callable[[], bool], deadline: float = math.inf) -> None:
        """Return once `is_so` returns True, or at a deadline [s] on the steady clock.

        Each `check` calls it, also those of a timer.
        """

        def is_over() -> bool:
            return is_so() or monotonic() >= deadline

        if is_over():
            return
        ended = Future()
        self._waiting.append((ended, is_over))
        self._timer.reset()
        await ended
        # The next one's turn comes when this coroutine waits again or has ended.
        self._node.executor.create_task(self.check)

    def check(self) -> None:
        """End the first wait that is over."""
        for waiting in list(self._waiting):
            ended, is_over = waiting
            if is_over():
                self._waiting.remove(waiting)
                ended.set_result(None)
                break
        if not self._waiting:
            self._timer.cancel()
