# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""gp_sampler: a template with its road and plan in; checked `scenarios` out.

`scenarios/info` describes each scenario. With `sampling.decisions=drawn` each outcome that differs
from the recorded one is a namespace with a template of its own: `goes_first/tracks`,
`goes_first/scenarios`, …

It generates when the inputs are complete, for the action `~/generate_scenarios`, and for the
service `~/generate`. Their parameters are the node's own, valid for that request only, and
`request`, the caller's name for it. /diagnostics has the progress; `~/cancel_request` cancels one
request, `~/cancel` all.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
import os
import threading

from msg_conventions.diagnostics import Level
from msg_conventions.documents import hash_of, LANES, PLAN
from msg_conventions.request_messages import RequestMessages
from msg_conventions.scenario_info import request_summary
from scenario_gen.bags.recordings.scenario_publisher import ScenarioPublisher
from scenario_gen.bags.recordings.template import decode_template
from scenario_gen.bags.recordings.write import result_messages
from scenario_gen.base.provenance import parameter_texts, versions
from scenario_gen.method.chain import Chain, Generation
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.outcome_sets import for_one_set, outcome_sets
from scenario_gen.method.sampling import Callbacks, Cancelled, OnValid
from scenario_gen.ros.common.generate_action import action_type, Goals
from scenario_gen.ros.common.requests import (
    Answer,
    Config,
    OpenRequest,
    OpenRequests,
)
from scenario_gen.ros.common.stage_node import TemplateNode
from scenario_gen.ros.common.topics import other_publishers, report_pace
from scenario_gen.situation import Situation
from scenario_gen.types import (
    BoundaryStates,
    EgoSlot,
    Encounter,
    GenerationResult,
    Planned,
    Scenario,
    token,
)

GOAL = "ego/goal"


class GpSampler(TemplateNode):
    """Samples valid scenarios around the planned routes."""

    INPUTS = ("map", LANES, "tracks", "changepoints", PLAN)
    STAGES = (
        "situation",
        "roads",
        "method.segmentation",
        "method.fitting",
        "method.routing",
        "method.sampling",
        "method.validity",
    )
    OUTPUTS = ("scenarios", "scenarios/info", "markers")
    THREADS = min(2, os.cpu_count() or 1)  # a small request need not wait for a large one

    def __init__(self, namespace: str | None = None) -> None:
        super().__init__("gp_sampler", Config(), namespace)
        self._turn = threading.Lock()
        self._requests = OpenRequests(self)
        action = action_type()
        self._goals = Goals(self, self._requests, action) if action else None

    def destroy_node(self) -> None:
        """Withdraw the action, then end the node."""
        if self._goals:
            self._goals.destroy()
        super().destroy_node()

    def update_diagnostics(self) -> None:
        """Report the progress of the running request."""
        super().update_diagnostics()
        self._requests.report()
        if self._has_traffic():
            self.outputs.withdraw(GOAL)

    def _has_traffic(self) -> bool:
        """Return whether another node, `traffic`, publishes the ego's goal."""
        return bool(other_publishers(self, self.resolve_topic_name(GOAL)))

    def _send(self, topic: str, data: bytes, stop: Callable[[], bool]) -> None:
        if topic != GOAL or not self._has_traffic():
            self.outputs.send_paced(topic, data, stop)

    def received(self, topic: str, data: bytes) -> None:
        """Generate when all inputs have arrived."""
        self.inputs.put(topic, data)
        self._requests.waits.check()
        config, messages = self.config, self.inputs.complete()
        if messages and config.generate_on_input:
            self.work(
                "inputs", lambda cancelled: self._generate_on_input(messages, config, cancelled)
            )

    def _generate_on_input(
        self, messages: Mapping[str, bytes], config: Config, cancelled: Cancelled
    ) -> None:
        request = self._requests.add(job="inputs", n_requested=config.count)
        self.generate(messages, request, config, cancelled)

    def stop_reason(self, messages: Mapping[str, bytes], cancelled: Cancelled) -> str:
        """Return why a request has to stop, "" if it need not."""
        if self.inputs.replaced(messages):
            return "given up: its inputs were replaced"
        return "cancelled" if cancelled() else ""

    def generate(
        self,
        messages: Mapping[str, bytes],
        request: OpenRequest,
        config: Config,
        cancelled: Cancelled,
    ) -> Answer | None:
        """Sample, check and publish.

        The request's summary closes `scenarios/info`. None if it was stopped early.
        """

        def stop() -> bool:  # also within a set: no scenario on an old map follows a new map
            return bool(self.stop_reason(messages, cancelled))

        level = Level.WARN
        message = ""
        values: dict[str, str] = {}
        try:
            if stop():
                return None
            self._requests.begin(request)
            report = partial(report_pace, self, request=request.name)
            with self.outputs.paced(self.OUTPUTS[:2], config.patience, report):
                result, summary = self._answer(messages, request, config, stop)
            message = summary.message()
            if summary.cancelled:
                message = f"{self.stop_reason(messages, cancelled)}: {message}"
                return None
            level = Level.OK if summary.is_full else Level.WARN
            return result, summary
        except Exception as error:
            if not stop():
                level = Level.ERROR
                message = str(error)
                values = {"error": type(error).__name__}
            raise
        finally:
            message = message or self.stop_reason(messages, cancelled) or "cancelled"
            self._requests.end(request, level, message, **values)

    def _answer(
        self,
        messages: Mapping[str, bytes],
        request: OpenRequest,
        config: Config,
        stop: Callable[[], bool],
    ) -> Answer:
        """Sample, check and publish; fit and plan again if start or end states are requested.

        Parallel requests do not mix the messages of their scenarios. If `stop` returns True,
        published scenarios stay, and the summary says so.

        Raises:
            InputError: a message is damaged, or a named vehicle does not exist.
            RefusedError: the request is impossible; the message says why, and which similar
                request is possible.
        """
        template = decode_template(messages)
        encounter = template.encounter
        inputs = {topic: hash_of(topic, messages[topic]) for topic in ("tracks", "map")}
        encoder = RequestMessages(encounter, request.name, inputs)
        send = partial(self._send, stop=stop)
        publisher = ScenarioPublisher(encoder, template.road.frame_id, send)
        sets = _Sets(template, config, stop, request, partial(self._publish, publisher))
        results = outcome_sets(
            sets.generate, encounter, config.sampling, config, config.count, config.seed
        )
        provenance = parameter_texts(config) | versions()
        for each in results:
            if each.encounter.made != "recorded":
                self._send_outcome(replace(each, provenance=provenance), request, config, stop)
        outcome = results[0]
        result = outcome.generated
        summary = request_summary(
            result,
            request.name,
            config.seed,
            encounter.start_ns,
            inputs=inputs,
            provenance=provenance,
            cancelled=stop() and len(result.scenarios) < result.requested,
            reactions=outcome.reacting,
        )
        if outcome.encounter.made == "recorded":
            with self._turn:
                publisher.close(result, summary)
        return outcome, summary

    def _publish(
        self,
        publisher: ScenarioPublisher,
        scenario: Scenario,
        requested: BoundaryStates,
        ego: EgoSlot | None,
    ) -> None:
        """Publish a scenario; no other request publishes one at the same time."""
        with self._turn:
            publisher.scenario(scenario, requested, ego)

    def _send_outcome(
        self,
        result: GenerationResult,
        request: OpenRequest,
        config: Config,
        stop: Callable[[], bool],
    ) -> None:
        """Publish all messages of an outcome in a namespace of its own."""
        assert result.encounter.decision
        namespace = token(result.encounter.decision.outcome)
        report = partial(report_pace, self, request=request.name)
        paced = [f"{namespace}/{topic}" for topic in self.OUTPUTS[:2]]
        with self._turn, self.outputs.paced(paced, config.patience, report):
            for topic, data, _ in result_messages(result, request.name):
                self.outputs.send_paced(f"{namespace}/{topic}", data, stop)


@dataclass(eq=False)
class _Sets:
    """The sets of a request; those of outcomes that were not recorded are published later.

    Attributes:
        template: planned on its road.
        config: the request's parameters.
        stop: whether it has to stop.
        request: is told the progress.
        publish: called with each scenario of the recorded outcome.
        done: scenarios in the sets so far.
    """

    template: Planned
    config: Config
    stop: Cancelled
    request: OpenRequest
    publish: OnValid
    done: int = 0

    def generate(self, part: Encounter, count: int) -> GenerationResult:
        """Return the scenarios of an outcome.

        Raises:
            RefusedError: there are none.
        """
        config, callbacks = self.config, Callbacks(self._advance, self.stop)
        stages = _stages(part, config)
        if part.made == "recorded":
            callbacks = replace(callbacks, on_valid=self.publish)
            return self._recorded(part, stages, count, callbacks)
        generation = Generation(
            self.template.road, stages, config, config.seed, callbacks=callbacks
        )
        made = generation.run(part, count)
        self.done += len(made)
        return made

    def _recorded(
        self, part: Encounter, stages: PipelineConfig, count: int, callbacks: Callbacks
    ) -> GenerationResult:
        """Return scenarios of the template, planned anew if start or end states are requested."""
        template, config = replace(self.template, encounter=part), self.config
        chain = Chain(
            Situation.of(part),
            template.segmentation,
            template.road,
            stages,
            config,
            count,
            config.seed,
        )
        planned = chain.plan() if config.moves else replace(template, seed=config.seed)
        return chain.sample(planned, callbacks)

    def _advance(self, done: int, _total: int, candidates: int) -> None:
        self.request.progress(self.done + done, candidates, self.template.encounter.start_ns)


def _stages(encounter: Encounter, config: Config) -> PipelineConfig:
    """Return the parameters of the stages, for the recorded or another outcome."""
    return PipelineConfig(
        fitting=config.fitting,
        planning=config.planning,
        sampling=for_one_set(config.sampling, encounter),
        limits=config.limits,
        segmentation=config.segmentation,
    )
