# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The action `~/generate_scenarios`: a request with feedback, cancel and result, where scenario_gen_interfaces is built.

No action of Jazzy's own packages has a goal of named values and a result of counts, hence the small package. Without it the
sampler has the service `~/generate` only.
"""

from dataclasses import dataclass, replace
from functools import partial
import importlib
from typing import Any

from diagnostic_msgs.msg import KeyValue
from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.clock import Clock, ClockType
from rclpy.qos import QoSProfile

from msg_conventions.scenario_info import REFUSED
from scenario_gen.ros.common.requests import Code, OpenRequest, OpenRequests, Outcome
from scenario_gen.ros.common.services import REQUESTS

NAME = "~/generate_scenarios"
FEEDBACK_S = 0.1  # seconds between two feedbacks
KEPT_S = 900  # seconds for which a result can be fetched


@dataclass
class Goal:
    """A goal at work: its handle, its request once that is open, and what its client was told last."""

    handle: ServerGoalHandle
    request: OpenRequest | None = None
    told: Any = None


class Goals:
    """The goals of a sampler."""

    def __init__(self, node: Any, requests: OpenRequests, action: Any) -> None:
        """Offer the action, whose type is `action`."""
        self._requests, self._action = requests, action
        self._goals: dict[bytes, Goal] = {}
        self._server = ActionServer(
            node,
            action,
            NAME,
            self._execute,
            cancel_callback=self._cancel,
            goal_service_qos_profile=REQUESTS,
            result_service_qos_profile=REQUESTS,
            cancel_service_qos_profile=REQUESTS,
            feedback_pub_qos_profile=QoSProfile(depth=100),
            result_timeout=KEPT_S,
        )
        self._timer = node.create_timer(
            FEEDBACK_S, self._tell, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def destroy(self) -> None:
        """Withdraw the action."""
        self._server.destroy()

    async def _execute(self, handle: ServerGoalHandle) -> Any:
        """Serve a goal to its end."""
        key = bytes(handle.goal_id.uuid)
        goal = self._goals[key] = Goal(handle)
        self._timer.reset()
        asked = handle.request
        try:
            outcome = await self._requests.answer(
                asked.parameters, asked.wait, partial(setattr, goal, "request")
            )
        finally:
            del self._goals[key]
        if outcome.code is Code.OK:
            handle.succeed()
        elif handle.is_cancel_requested:  # also where it was refused, or failed, by then
            outcome = replace(outcome, code=Code.CANCELLED)
            handle.canceled()
        else:
            handle.abort()
        return self._result(outcome, goal.request)

    def _cancel(self, handle: ServerGoalHandle) -> CancelResponse:
        """End the goal's request; one that has not begun is ended here, and answers at once."""
        goal = self._goals.get(bytes(handle.goal_id.uuid))
        if goal is None or goal.request is None:
            return CancelResponse.REJECT  # it has ended
        return (
            CancelResponse.ACCEPT
            if self._requests.cancelled(goal.request)
            else CancelResponse.REJECT
        )

    def _tell(self) -> None:
        """Tell each client how far its goal is, if that has changed."""
        if not self._goals:
            self._timer.cancel()
        for goal in list(self._goals.values()):
            request = goal.request
            if request is None:
                continue
            waiting = list(request.waiting_for)
            counts = {
                "wanted": request.n_requested,
                "found": request.accepted,
                "candidates": request.candidates,
            }
            feedback = self._action.Feedback(
                waiting_for=waiting, position=self._requests.position(request), **counts
            )
            if feedback != goal.told:
                goal.handle.publish_feedback(feedback)
                goal.told = feedback

    def _result(self, outcome: Outcome, request: OpenRequest | None) -> Any:
        """Return the result of a goal."""
        result = self._action.Result(
            code=int(outcome.code), reason=outcome.reason, request=outcome.request
        )
        if request:
            result.requested, result.published = (
                request.n_requested,
                request.accepted,
            )  # what a cancelled one has sent stays
        if outcome.answer:
            sampled, summary = outcome.answer
            published = [scenario.index for scenario in sampled.generated.scenarios]
            result.published = len(published)
            result.first_index, result.last_index = (
                (min(published), max(published)) if published else (0, 0)
            )
            counts = {
                key: text
                for key, text in summary.values.items()
                if key == "candidates" or key.startswith(REFUSED)
            }
            result.account = [KeyValue(key=key, value=text) for key, text in counts.items()]
        return result


def action_type() -> Any:
    """Return the type of the action; None where scenario_gen_interfaces is not built, or not sourced."""
    try:
        return importlib.import_module("scenario_gen_interfaces.action").Generate
    except (ImportError, AttributeError):  # a checkout holds a folder of that name
        return None
