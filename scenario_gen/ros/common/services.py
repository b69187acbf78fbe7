# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Services without arguments: what an action says, or why it is refused, is the answer."""

from collections.abc import Callable
import traceback

from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_srvs.srv import Trigger

from scenario_gen.base.errors import describe, ScenarioGenError

REQUESTS = QoSProfile(
    depth=1000
)  # ROS's own 10 would drop the oldest of many requests that come at once


def offer_trigger(node: Node, name: str, action: Callable[[], str]) -> None:
    """Offer a std_srvs/Trigger; whatever goes wrong in `action`, the caller gets an answer and the node lives on."""

    def answer(_request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        try:
            response.message, response.success = action(), True
        except ScenarioGenError as error:
            response.message = str(error)
        except Exception as error:
            node.get_logger().error(traceback.format_exc())
            response.message = describe(error)
        return response

    node.create_service(Trigger, name, answer, qos_profile=REQUESTS)
