# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A client of the action: python action_client.py GOALS, a JSON list; it prints a JSON list of how each went.

A goal is {"parameters": {…}, "wait": s, "cancel": …, "then": a node to activate when it has ended and the first one waits for
tracks}; each is sent once the one before is accepted.
"cancel" is how many scenarios it has found, which position in the queue it has, and which others have ended when it is cancelled.
It is a program of its own, for the libraries of an interface package are looked for where LD_LIBRARY_PATH said at the start.
"""

import json
import sys
import time

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
import rclpy
from rclpy.action import ActionClient
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile
from trajectory_msgs.msg import MultiDOFJointTrajectory

from scenario_gen_interfaces.action import Generate
from support.known_readers import until_known_at


def main(goals: list[dict]) -> list[dict]:
    rclpy.init()
    node = rclpy.create_node("action_client")
    scenarios = []
    quality = QoSProfile(
        depth=1000, history=HistoryPolicy.KEEP_ALL, durability=DurabilityPolicy.VOLATILE
    )

    def hear(_: bytes) -> None:
        scenarios.append(time.monotonic())

    node.create_subscription(MultiDOFJointTrajectory, "scenarios", hear, quality, raw=True)
    client = ActionClient(node, Generate, "gp_sampler/generate_scenarios")
    assert client.wait_for_server(180.0)
    until_known_at(
        node,
        "gp_sampler",
        lambda answer: rclpy.spin_until_future_complete(node, answer, timeout_sec=1.0),
    )
    ended, waits, then = [], [], []

    def look() -> None:
        if waits and then:
            activate(then.pop())

    def ended_ones() -> set[int]:
        return {one["goal"] for one in ended}

    def activate(name: str) -> None:
        change = node.create_client(ChangeState, f"{name}/change_state")
        assert change.wait_for_service(180.0)
        for transition in (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE):
            change.call_async(ChangeState.Request(transition=Transition(id=transition)))

    def send(k: int, goal: dict) -> None:
        told = {"feedback": []}

        def heard(message) -> None:
            one = message.feedback
            told["feedback"].append(list(one.waiting_for))
            found, position, after = goal.get("cancel", [0, 0, [k]])
            if (
                "handle" in told
                and one.found >= found
                and one.position >= position
                and ended_ones().issuperset(after)
            ):
                goal["cancel"] = [0, 0, [k]]
                told["handle"].cancel_goal_async()
            if "tracks" in one.waiting_for and k == 0:
                waits.append(k)
                look()

        def accepted(future) -> None:
            told["handle"] = future.result()
            told["handle"].get_result_async().add_done_callback(done)
            if k + 1 < len(goals):  # so that they arrive in their order
                send(k + 1, goals[k + 1])

        def done(future) -> None:
            answer = future.result()
            result = answer.result
            words = {
                name: getattr(result, name)
                for name in ("code", "reason", "request", "requested", "published")
            }
            more = {
                "status": answer.status,
                "first": result.first_index,
                "last": result.last_index,
                "account": {one.key: one.value for one in result.account},
            }
            ended.append({"goal": k, **words, **more, "feedback": told["feedback"]})
            then.extend([goal["then"]] if "then" in goal else [])
            look()

        given = [
            Parameter(name, value=value).to_parameter_msg()
            for name, value in goal.get("parameters", {}).items()
        ]
        message = Generate.Goal(parameters=given, wait=float(goal.get("wait", 300.0)))
        client.send_goal_async(message, feedback_callback=heard).add_done_callback(accepted)

    send(0, goals[0])
    while len(ended) < len(goals):
        rclpy.spin_once(node, timeout_sec=1.0)
    published, all_ended = sum(one["published"] for one in ended), time.monotonic()

    def silence() -> float:
        return time.monotonic() - max([all_ended, *scenarios[-1:]])

    while silence() < (1.0 if len(scenarios) >= published else 60.0):  # what is still on its way
        rclpy.spin_once(node, timeout_sec=0.05)
    return [*ended, {"heard": len(scenarios)}]


if __name__ == "__main__":
    print(json.dumps(main(json.loads(sys.argv[1]))))
