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

"""gp_sampler: road, tracks, changepoints, fit and routes of one template in; checked `scenarios` and their `scenarios/info` out.

It generates when the inputs are complete, and on `~/generate`, whose parameters are the node's own, valid for that call only.
"""

from collections.abc import Mapping
from functools import partial
from itertools import count
import sys

from rcl_interfaces.srv import SetParametersAtomically
from rclpy.task import Future
from std_srvs.srv import Trigger

from msg_conventions.diagnostics import Level
from msg_conventions.names import tokens
from msg_conventions.topics import vehicle_topic
from msg_conventions.tracks import decode_tracks
from scenario_gen.errors import RefusedError, ScenarioGenError
from scenario_gen.nodes.base import REQUESTS, run_nodes, StageNode
from scenario_gen.nodes.inputs import Inputs, stamp_of
from scenario_gen.nodes.pacing import unheard
from scenario_gen.nodes.ros_parameters import values_of_call
from scenario_gen.nodes.sample_request import Answer, answer_request, Config
from scenario_gen.requests.chain import Cancelled

ENDS = ("road/entries", "road/exits")  # of use only where start or end states are asked for


class GpSampler(StageNode):
    """Samples valid scenarios around the planned routes."""

    INPUTS = ("map", *ENDS, "tracks", "changepoints", "fit")
    STAGES = ("interaction", "roads", "fitting", "planning", "sampling", "validity")
    OUTPUTS = ("scenarios", "scenarios/info", "markers")

    def __init__(self, namespace: str | None = None) -> None:
        super().__init__("gp_sampler", Config(), namespace)
        paired = ("tracks", "changepoints", "fit", *(("map",) if self.config.pair_map else ()))
        self._seen = Inputs(paired, () if self.config.pair_map else ("map",))
        self._routes: set[str] = set()
        self._requests = map(str, count(1))
        self.create_service(SetParametersAtomically, "~/generate", self._generate_for_caller, qos_profile=REQUESTS)
        self.serve(Trigger, "~/cancel", self._cancel)

    def stopped(self) -> None:
        """Forget the inputs: being latched, they come again."""
        self._seen.clear()

    def received(self, topic: str, data: bytes) -> None:
        """Generate when everything is there."""
        self._seen.put(topic, data)
        if topic == "tracks":
            self._follow(data)
        config = self.config
        if config.generate_on_input and (topic not in ENDS or config.moves) and not self._missing(config):
            messages = self._messages()
            self.work("inputs", lambda cancelled: self._generate(messages, next(self._requests), config, cancelled))

    def _missing(self, config: Config) -> list[str]:
        """The topics that a request still waits for."""
        ends = ENDS if config.moves and config.pair_map else ()
        return self._seen.missing() or [topic for topic in ends if topic not in self._messages()]

    def _messages(self) -> dict[str, bytes]:
        """The template's messages; entries and exits only if they are those of its road."""
        messages = self._seen.complete() or {}
        for topic in ENDS:
            own = topic in messages and self.config.pair_map
            if not own or stamp_of(messages[topic], topic) != stamp_of(messages["map"], "map"):
                messages.pop(topic, None)
        return messages

    def _follow(self, tracks: bytes) -> None:
        """Listen to the routes of the vehicles in the tracks, and no longer to those of others."""
        wanted = {vehicle_topic(name, "route") for name in tokens(v.id for v in decode_tracks(tracks).vehicles)}
        self._seen.forget(self._routes - wanted)
        for topic in sorted(self._routes - wanted):
            self.ignore(topic)
        self._seen.expect(wanted)
        self._routes = wanted
        for topic in sorted(wanted):
            self.listen(topic)

    def _generate(self, messages: Mapping[str, bytes], request: str, config: Config, cancelled: Cancelled) -> Answer | None:
        """Sample, check and publish; the request's account closes `scenarios/info`. None if it was cancelled before its end."""
        if cancelled():
            return None
        node = self.get_fully_qualified_name()
        progress, send = partial(self._progress, request), partial(self.voice.send_paced, stop=cancelled)
        with self.voice.paced(self.OUTPUTS[:2], config.patience, partial(self._unheard, request)):
            answer = answer_request(messages, config, request, node, progress, cancelled, send)
        stopped = f"request {request} was cancelled: " if "cancelled" in answer.closing.values else ""
        said = (stopped + answer.closing.message, f"request {request}", answer.template.encounter.start_ns)
        self.status(answer.closing.level, *said)
        return None if stopped else answer

    def _progress(self, request: str, done: int, total: int, stamp_ns: int) -> None:
        if done == total or done % max(1, total // 10) == 0:
            self.status(Level.OK, f"request {request}: {done} of {total}", "progress", stamp_ns)

    def _unheard(self, request: str, topic: str, count: int) -> None:
        self.status(Level.WARN, unheard(self, topic, count), f"pace of {topic}", request=request, count=str(count))

    async def _generate_for_caller(
        self, request: SetParametersAtomically.Request, response: SetParametersAtomically.Response
    ) -> SetParametersAtomically.Response:
        """Generate with the caller's parameters; the answer comes when the set is done."""
        name, answer, executor = next(self._requests), Future(), self.executor
        try:
            config, messages = self._config_of(request)
        except ScenarioGenError as error:
            response.result.reason = f"request {name}: {error}"
            return response

        def job(cancelled: Cancelled) -> None:
            try:
                made = self._generate(messages, name, config, cancelled)
                message = made.closing.message if made else "cancelled"
                answer.set_result((bool(made and made.result.scenarios), message))
            except ScenarioGenError as error:
                answer.set_result((False, str(error)))
            except Exception as error:
                answer.set_result((False, f"{type(error).__name__}: {error}"))
                raise
            finally:
                executor.wake()

        self.work(f"request {name}", job)
        response.result.successful, reason = await answer
        response.result.reason = f"request {name}: {reason}"
        return response

    def _config_of(self, request: SetParametersAtomically.Request) -> tuple[Config, Mapping[str, bytes]]:
        if not self.active:
            raise RefusedError("the node is not active; activate it first")
        config: Config = values_of_call(self.config, request.parameters)
        if missing := self._missing(config):
            raise RefusedError(f"nothing to generate from yet: waiting for {', '.join(missing)}")
        return config, self._messages()

    def _cancel(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        names = self.cancel()
        response.success, response.message = bool(names), f"cancelled: {', '.join(names)}" if names else "nothing is running"
        return response


def main() -> None:
    """Run the node."""
    sys.exit(run_nodes(GpSampler))
