# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Services without arguments.

The answer is the result of an action, or the reason of its refusal.
"""

from collections.abc import Callable
import traceback

from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_srvs.srv import Trigger

from scenario_gen.base.errors import describe, ScenarioGenError

REQUESTS = QoSProfile(depth=1000)  # the default depth of 10 would drop simultaneous requests


def offer_trigger(node: Node, name: str, action: Callable[[], str]) -> None:
    """Offer a std_srvs/Trigger service; after any error in `action` the caller gets an answer."""

    def answer(_request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        try:
            response.message = action()
            response.success = True
        except ScenarioGenError as error:
            response.message = str(error)
        except Exception as error:
            node.get_logger().error(traceback.format_exc())
            response.message = describe(error)
        return response

    node.create_service(Trigger, name, answer, qos_profile=REQUESTS)
