# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The action `~/generate_scenarios`: a request with feedback, cancellation and result.

It needs the package scenario_gen_interfaces, because no action in Jazzy's packages has named
values as its goal and counts as its result. Without the package the sampler has the service
`~/generate` only.
"""

from dataclasses import dataclass, replace
from functools import partial
import importlib
from typing import Any

from diagnostic_msgs.msg import KeyValue
from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.qos import QoSProfile

from scenario_gen.ros.common.requests import Code, OpenRequest, OpenRequests, Outcome
from scenario_gen.ros.common.services import REQUESTS
from scenario_gen.ros.common.timers import create_steady_timer

NAME = "~/generate_scenarios"


@dataclass
class Goal:
    """A goal in progress: its handle, its request once that is open, and its last feedback."""

    handle: ServerGoalHandle
    request: OpenRequest | None = None
    feedback: Any = None


class Goals:
    """The goals of a sampler."""

    def __init__(self, node: Any, requests: OpenRequests, action: Any) -> None:
        """Offer the action, whose type is `action`."""
        self._requests = requests
        self._action = action
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
            result_timeout=900,
        )
        self._timer = create_steady_timer(node, 0.1, self._send_feedback)

    def destroy(self) -> None:
        """Withdraw the action."""
        self._server.destroy()

    async def _execute(self, handle: ServerGoalHandle) -> Any:
        """Serve a goal to its end."""
        key = bytes(handle.goal_id.uuid)
        goal = self._goals[key] = Goal(handle)
        self._timer.reset()
        try:
            outcome = await self._requests.answer(
                handle.request.parameters, handle.request.wait, partial(setattr, goal, "request")
            )
        finally:
            del self._goals[key]
        if outcome.code is Code.OK:
            handle.succeed()
        elif handle.is_cancel_requested:  # even if it was refused or failed meanwhile
            outcome = replace(outcome, code=Code.CANCELLED)
            handle.canceled()
        else:
            handle.abort()
        return self._result(outcome, goal.request)

    def _cancel(self, handle: ServerGoalHandle) -> CancelResponse:
        """Cancel the goal's request; a request that waits answers at once."""
        goal = self._goals.get(bytes(handle.goal_id.uuid))
        if goal is None or goal.request is None or not self._requests.cancel(goal.request):
            return CancelResponse.REJECT  # it has ended
        return CancelResponse.ACCEPT

    def _send_feedback(self) -> None:
        """Send each client the progress of its goal, if that has changed."""
        if not self._goals:
            self._timer.cancel()
        for goal in list(self._goals.values()):
            request = goal.request
            if request is None:
                continue
            feedback = self._action.Feedback(
                waiting_for=list(request.waiting_for),
                position=self._requests.position(request),
                wanted=request.n_requested,
                found=request.accepted,
                candidates=request.candidates,
            )
            if feedback != goal.feedback:
                goal.handle.publish_feedback(feedback)
                goal.feedback = feedback

    def _result(self, outcome: Outcome, request: OpenRequest | None) -> Any:
        """Return the result of a goal."""
        result = self._action.Result(
            code=int(outcome.code), reason=outcome.reason, request=outcome.request
        )
        if request:  # scenarios of a cancelled request stay published
            result.requested = request.n_requested
            result.published = request.accepted
        if outcome.answer:
            sampled, summary = outcome.answer
            indices = [scenario.index for scenario in sampled.generated.scenarios]
            result.published = len(indices)
            result.first_index = min(indices, default=0)
            result.last_index = max(indices, default=0)
            counts = {"candidates": summary.candidates}
            counts |= {f"refused.{cause}": count for cause, count in summary.refused.items()}
            result.account = [KeyValue(key=key, value=str(count)) for key, count in counts.items()]
        return result


def action_type() -> Any:
    """Return the type of the action, None where scenario_gen_interfaces is missing."""
    try:
        return importlib.import_module("scenario_gen_interfaces.action").Generate
    except (ImportError, AttributeError):  # a checkout has a folder with that name
        return None
