# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The services of rosbag2's player, with its types where rosbag2_interfaces is installed.

Elsewhere they are std_srvs/Trigger: the parameter `rate` sets the rate, and `~/seek` jumps to the
parameter `start_offset`.
"""

from collections.abc import Callable
from functools import partial
import importlib
from typing import Any

from rclpy.node import Node
from rclpy.parameter import Parameter

from scenario_gen.base.errors import InputError
from scenario_gen.ros.common.bag_time import BagTime
from scenario_gen.ros.common.services import offer_trigger, REQUESTS

Seek = Callable[[int | None], str]
"""Jumps to a stamp [ns], or to the parameter `start_offset`."""


def offer_player_services(node: Node, time: BagTime, seek: Seek) -> None:
    """Offer the services that control the time in a bag."""

    def set_paused(*, paused: bool) -> str:
        if paused == time.paused:
            raise InputError("it is so already")
        time.pause(paused)
        return "paused" if paused else "playing"

    def play_next() -> str:
        if not time.paused:
            raise InputError("it is playing; call ~/pause first")
        time.step()
        return "one message"

    actions: dict[str, Callable[[], str]] = {
        "Pause": partial(set_paused, paused=True),
        "Resume": partial(set_paused, paused=False),
        "TogglePaused": lambda: set_paused(paused=not time.paused),
        "PlayNext": play_next,
        "Seek": lambda: seek(None),
    }
    try:
        types = importlib.import_module("rosbag2_interfaces.srv")
    except ImportError:
        for name, action in actions.items():
            offer_trigger(node, f"~/{_service_name(name)}", action)
        return

    def set_rate(rate: float) -> None:
        (result,) = node.set_parameters([Parameter("rate", value=rate)])
        if not result.successful:
            raise InputError(result.reason)

    calls: dict[str, Callable[[Any], object]] = {
        name: partial(_act, action) for name, action in actions.items()
    }
    calls |= {
        "Seek": lambda request: seek(request.time.sec * 10**9 + request.time.nanosec),
        "SetRate": lambda request: set_rate(request.rate),
        "GetRate": lambda _: {"rate": node.get_parameter("rate").value},
        "IsPaused": lambda _: {"paused": time.paused},
    }
    for name, call in calls.items():
        answer = partial(_answer, node, call)
        kind = getattr(types, name)
        node.create_service(kind, f"~/{_service_name(name)}", answer, qos_profile=REQUESTS)


def _act(action: Callable[[], str], _request: object) -> str:
    return action()


def _service_name(kind: str) -> str:
    """Return `play_next` of `PlayNext`."""
    return "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in kind)[1:]


def _answer(node: Node, call: Callable[[Any], object], request: Any, response: Any) -> Any:
    """Fill in the response's values, or `success`; log why a call is refused."""
    try:
        values = call(request)
    except InputError as error:
        node.get_logger().warning(str(error))
        values = {"success": False}
    for key, value in (values if isinstance(values, dict) else {"success": True}).items():
        if hasattr(response, key):
            setattr(response, key, value)
    return response
