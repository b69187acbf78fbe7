"""gp_sampler: road, tracks, changepoints, fit and routes of one template in; checked `scenarios` and their `scenarios/info` out.

It generates when the inputs are complete, and on `~/generate`, whose parameters are the node's own, valid for that call only.
"""

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from rcl_interfaces.srv import SetParametersAtomically
from rclpy.task import Future
from std_srvs.srv import Trigger

from msg_conventions.diagnostics import Level, request_status
from msg_conventions.names import tokens
from msg_conventions.topics import vehicle_topic
from msg_conventions.tracks import decode_tracks
from scenario_gen.errors import RefusedError, ScenarioGenError
from scenario_gen.nodes.base import REQUESTS, StageNode, run_nodes
from scenario_gen.nodes.inputs import Inputs
from scenario_gen.nodes.ros_parameters import values_of_call
from scenario_gen.nodes.sample_messages import sample_messages
from scenario_gen.nodes.template import read_template
from scenario_gen.parameters import check, parameter
from scenario_gen.pipeline import PipelineConfig, sample_checked
from scenario_gen.sampling import SamplingConfig
from scenario_gen.scenario import ScenarioSet
from scenario_gen.validity import Limits


@dataclass(frozen=True)
class Config:
    """The sampler's parameters."""

    count: int = parameter(50, "scenarios to generate", low=1, high=100_000)
    seed: int = parameter(0, "seed of the samples", low=0)
    generate_on_input: bool = parameter(True, "generate whenever the inputs are complete or change; false: on ~/generate only")
    pair_map: bool = parameter(True, "take only a map with the template's stamp; false: any map server's newest one")
    sampling: SamplingConfig = field(default_factory=SamplingConfig)
    limits: Limits = field(default_factory=Limits)

    def __post_init__(self) -> None:
        check(self)


class GpSampler(StageNode):
    """Samples valid scenarios around the planned routes."""

    INPUTS = ("map", "tracks", "changepoints", "fit")
    STAGES = ("interaction", "roads", "sampling", "validity")
    OUTPUTS = ("scenarios", "scenarios/info", "markers")

    def __init__(self, namespace: str | None = None) -> None:
        super().__init__("gp_sampler", Config(), namespace)
        paired = ("tracks", "changepoints", "fit", *(("map",) if self.config.pair_map else ()))
        self._seen = Inputs(paired, () if self.config.pair_map else ("map",))
        self._routes: set[str] = set()
        self._requests = 0
        self.create_service(SetParametersAtomically, "~/generate", self._generate_for_caller, qos_profile=REQUESTS)
        self.serve(Trigger, "~/cancel", self._cancel)

    def received(self, topic: str, data: bytes) -> None:
        """Generate when everything is there."""
        self._seen.put(topic, data)
        if topic == "tracks":
            self._follow(data)
        messages = self._seen.complete()
        if self.config.generate_on_input and messages is not None:
            self.work("inputs", lambda cancelled: self._generate(messages, self._next_request(), self.config, cancelled))

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

    def _next_request(self) -> str:
        self._requests += 1
        return str(self._requests)

    def _generate(
        self, messages: Mapping[str, bytes], request: str, config: Config, cancelled: Callable[[], bool]
    ) -> ScenarioSet | None:
        """Sample, check and publish; the request's account closes `scenarios/info`. None if it was cancelled."""
        if cancelled():
            return None
        template = read_template(messages)
        stamp = template.encounter.start_ns
        result = sample_checked(
            template.encounter,
            template.segmentation,
            template.road,
            template.routes,
            template.asked,
            PipelineConfig(sampling=config.sampling, limits=config.limits),
            count=config.count,
            seed=config.seed,
            progress=lambda done, total: self._progress(request, done, total, stamp),
            cancelled=cancelled,
        )
        if cancelled():
            self.status(Level.WARN, f"request {request} was cancelled", f"request {request}", stamp)
            return None
        node = self.get_fully_qualified_name()
        closing = request_status(result, request, node, config.seed)
        for topic, data in sample_messages(template, result, closing, node):
            self.send(topic, data)
        self.status(closing.level, closing.message, f"request {request}", stamp)
        return result

    def _progress(self, request: str, done: int, total: int, stamp_ns: int) -> None:
        if done == total or done % max(1, total // 10) == 0:
            self.status(Level.OK, f"request {request}: {done} of {total}", "progress", stamp_ns)

    async def _generate_for_caller(
        self, request: SetParametersAtomically.Request, response: SetParametersAtomically.Response
    ) -> SetParametersAtomically.Response:
        """Generate with the caller's parameters; the answer comes when the set is done."""
        name, answer, executor = self._next_request(), Future(), self.executor
        try:
            config, messages = self._config_of(request)
        except ScenarioGenError as error:
            response.result.reason = f"request {name}: {error}"
            return response

        def job(cancelled: Callable[[], bool]) -> None:
            try:
                result = self._generate(messages, name, config, cancelled)
                message = request_status(result, name, "", config.seed).message if result else "cancelled"
                answer.set_result((bool(result and result.scenarios), message))
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
        messages = self._seen.complete()
        if messages is None:
            raise RefusedError(f"nothing to generate from yet: waiting for {', '.join(self._seen.missing())}")
        config: Config = values_of_call(self.config, request.parameters)
        return config, messages

    def _cancel(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        names = self.cancel()
        response.success = bool(names)
        response.message = f"cancelled: {', '.join(names)}" if names else "nothing is running"
        return response


def main() -> None:
    """Run the node."""
    sys.exit(run_nodes(GpSampler))
