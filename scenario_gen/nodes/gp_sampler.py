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

from collections.abc import Callable, Mapping
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
from scenario_gen.nodes.inputs import Inputs
from scenario_gen.nodes.ros_parameters import values_of_call
from scenario_gen.nodes.sample_messages import sample_messages
from scenario_gen.nodes.sample_request import Answer, answer_request, Config

ENDS = ("road/entries", "road/exits")  # of use only where start or end states are asked for
Asked = Callable[[], bool]  # whether a job was cancelled


class GpSampler(StageNode):
    """Samples valid scenarios around the planned routes."""

    INPUTS = ("map", *ENDS, "tracks", "changepoints", "fit", "fit/info")
    STAGES = ("interaction", "roads", "fitting", "planning", "sampling", "validity")
    OUTPUTS = ("scenarios", "scenarios/info", "markers")

    def __init__(self, namespace: str | None = None) -> None:
        super().__init__("gp_sampler", Config(), namespace)
        paired = ("tracks", "changepoints", "fit", "fit/info", *(("map",) if self.config.pair_map else ()))
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
        """The template's messages; entries and exits only if the fit was made with them."""
        messages = self._seen.complete() or {}
        return {t: data for t, data in messages.items() if t not in ENDS or self._seen.named("fit/info", t)}

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

    def _generate(self, messages: Mapping[str, bytes], request: str, config: Config, cancelled: Asked) -> Answer | None:
        """Sample, check and publish; the request's account closes `scenarios/info`. None if it was given up."""
        over = partial(self._over, messages, cancelled)
        if over():
            return None
        node = self.get_fully_qualified_name()
        answer = answer_request(messages, config, request, node, partial(self._progress, request), lambda: bool(over()))
        encounter = answer.template.encounter
        for topic, data in sample_messages(encounter, answer.asked, answer.result, answer.closing, node):
            if why := over():  # also amid a set: nothing of an old map is said beside the new one
                self.status(Level.WARN, f"request {request} was {why}", f"request {request}", encounter.start_ns)
                return None
            self.send(topic, data)
        self.status(answer.closing.level, answer.closing.message, f"request {request}", encounter.start_ns)
        return answer

    def _over(self, messages: Mapping[str, bytes], cancelled: Asked) -> str:
        """Say why a request is to be given up; nothing if it is not."""
        return "given up: its inputs were replaced" if self._seen.replaced(messages) else "cancelled" if cancelled() else ""

    def _progress(self, request: str, done: int, total: int, stamp_ns: int) -> None:
        if done == total or done % max(1, total // 10) == 0:
            self.status(Level.OK, f"request {request}: {done} of {total}", "progress", stamp_ns)

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

        def job(cancelled: Asked) -> None:
            try:
                made = self._generate(messages, name, config, cancelled)
                why = made.closing.message if made else self._over(messages, lambda: True)
                answer.set_result((bool(made and made.result.scenarios), why))
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
