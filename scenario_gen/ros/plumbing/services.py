# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Services whose answers reach their callers, also those whose readers DDS has not found yet.

A request may come before the node has found the caller's reader, on a busy machine by seconds. rmw_fastrtps then waits 100 ms,
drops the answer and warns; the caller waits for ever. Sending it again is all that is missing.
"""

from collections import deque
from collections.abc import Callable
from functools import partial
from time import monotonic
from typing import Any
import warnings

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node

AGAIN = 0.1  # seconds between two attempts, of which each takes 100 ms
PATIENCE = 60.0  # seconds after which a caller is given up
MOST = 1000  # answers kept; then the oldest caller is given up

Send = Callable[[Any, Any], None]  # of a response and the header of its request


class ResponseRetry:
    """Keeps the answers of a node's services that could not be sent, and sends them again until they could."""

    def __init__(self, node: Node) -> None:
        """Take over the answers of all services that the node has by now."""
        self._node = node
        self._kept: deque[tuple[float, Callable[[], None]]] = deque()
        self._timer = node.create_timer(AGAIN, self._again, clock=Clock(clock_type=ClockType.STEADY_TIME), autostart=False)
        for service in node.services:
            service.send_response = partial(self._send, service.send_response)

    def _send(self, send: Send, response: Any, header: Any) -> None:
        if not delivered(partial(send, response, header)):
            if len(self._kept) >= MOST:
                self._kept.popleft()
                self._node.get_logger().warning(f"{MOST} callers are not found; the oldest one's answer is dropped")
            self._kept.append((monotonic() + PATIENCE, partial(send, response, header)))
            self._timer.reset()

    def _again(self) -> None:
        """Try the one that waits longest, so that others are served between."""
        self._timer.cancel()
        deadline, attempt = self._kept.popleft()
        if not delivered(attempt):
            if monotonic() < deadline:
                self._kept.append((deadline, attempt))
            else:
                self._node.get_logger().warning(f"a caller is not found after {PATIENCE:.0f} s; its answer is dropped")
        if self._kept:
            self._timer.reset()


def delivered(attempt: Callable[[], None]) -> bool:
    """Send an answer; return False if it was dropped, which rclpy reports by a warning only."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        attempt()
    return not any("failed to send response (timeout)" in str(warning.message) for warning in caught)
