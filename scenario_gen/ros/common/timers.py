# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Timers for housekeeping, which real time drives: a simulated clock may stop or jump."""

from collections.abc import Callable

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.timer import Timer


def create_steady_timer(node: Node, period: float, callback: Callable[[], None]) -> Timer:
    """Call back each `period` [s] of real time, on the node's executor."""
    return node.create_timer(period, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))
