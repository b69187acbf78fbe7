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

"""What gp_sampler's callers call: `~/generate`, `~/cancel_request` for one of them, `~/cancel` for all."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter
from rclpy.task import Future
from std_srvs.srv import Trigger

from msg_conventions.diagnostics import Level
from scenario_gen.errors import RefusedError, ScenarioGenError
from scenario_gen.nodes.base import REQUESTS
from scenario_gen.nodes.open_requests import OpenRequests
from scenario_gen.nodes.ros_parameters import values_of_call
from scenario_gen.nodes.sample_request import Config


class GenerateServices:
    """The services of a sampler, which keeps its requests in `requests`."""

    def __init__(self, node: Any, requests: OpenRequests) -> None:
        self._node, self._requests = node, requests
        node.create_service(SetParametersAtomically, "~/generate", self._generate, qos_profile=REQUESTS)
        node.serve(SetParametersAtomically, "~/cancel_request", self._cancel_request)
        node.serve(Trigger, "~/cancel", self._cancel)

    async def _generate(
        self, request: SetParametersAtomically.Request, response: SetParametersAtomically.Response
    ) -> SetParametersAtomically.Response:
        """Generate with the caller's parameters; the answer comes when the set is done."""
        node, answer, executor = self._node, Future(), self._node.executor
        try:
            asked, name = _named(request.parameters)
            opened = self._requests.add(name)
        except ScenarioGenError as error:
            node.failed("generate", error)
            node.health.settle("generate")
            response.result.reason = str(error)
            return response
        try:
            config, messages = self._config_of(asked)
            opened.wanted = config.count
        except ScenarioGenError as error:
            self._requests.end(opened, Level.ERROR, str(error), error=type(error).__name__)
            response.result.reason = f"request {opened.name}: {error}"
            return response

        def job(cancelled: Callable[[], bool]) -> None:
            try:
                made = node.generate(messages, opened, config, cancelled)
                message = made.closing.message if made else node.over(messages, lambda: True)
                answer.set_result((bool(made and made.result.scenarios), message))
            except ScenarioGenError as error:
                answer.set_result((False, str(error)))
            except Exception as error:
                answer.set_result((False, f"{type(error).__name__}: {error}"))
                raise
            finally:
                executor.wake()

        node.work(opened.job, job)
        response.result.successful, reason = await answer
        response.result.reason = f"request {opened.name}: {reason}"
        return response

    def _config_of(self, asked: Sequence[Any]) -> tuple[Config, Mapping[str, bytes]]:
        if not self._node.active:
            raise RefusedError("the node is not active; activate it first")
        config: Config = values_of_call(self._node.config, asked)
        if missing := self._node.missing(config):
            raise RefusedError(f"nothing to generate from yet: waiting for {', '.join(missing)}")
        return config, self._node.messages()

    def _cancel_request(
        self, request: SetParametersAtomically.Request, response: SetParametersAtomically.Response
    ) -> SetParametersAtomically.Response:
        try:
            response.result.reason = self._requests.cancel(_named(request.parameters)[1])
            response.result.successful = True
        except ScenarioGenError as error:
            response.result.reason = str(error)
        return response

    def _cancel(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        names = self._node.cancel()
        response.success, response.message = bool(names), f"cancelled: {', '.join(names)}" if names else "nothing is running"
        return response


def _named(parameters: Sequence[Any]) -> tuple[list[Any], str]:
    """Return a caller's parameters but `request`, and what that is, "" if there is none; the tools of ROS make 7 of '7'."""
    names = [Parameter.from_parameter_msg(parameter).value for parameter in parameters if parameter.name == "request"]
    return [parameter for parameter in parameters if parameter.name != "request"], str(names[0]) if names else ""
