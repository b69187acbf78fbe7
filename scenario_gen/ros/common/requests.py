# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The sampler's requests: its parameters, the open requests and their services, and how a request is answered.

A request comes by the service `~/generate`, or by the action `~/generate_scenarios` (generate_action.py).
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from enum import IntEnum
from itertools import count
import re
import threading
from time import monotonic
from typing import Any

from rcl_interfaces.srv import SetParametersAtomically
from rclpy.clock import Clock, ClockType
from rclpy.parameter import Parameter
from rclpy.task import Future
from std_srvs.srv import Trigger

from msg_conventions.diagnostics import Level
from msg_conventions.hashes import template_hashes
from msg_conventions.request_messages import RequestMessages
from msg_conventions.scenario_info import request_summary, RequestSummary
from scenario_gen.bags.recordings.sending import RequestSender, Send
from scenario_gen.bags.recordings.template import decode_template
from scenario_gen.base.cancelling import CancelledError
from scenario_gen.base.errors import InputError, RefusedError, ScenarioGenError
from scenario_gen.base.provenance import parameter_texts, versions
from scenario_gen.method.chain import Chain
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.fitting import FittingConfig
from scenario_gen.method.routing import PlanningConfig
from scenario_gen.method.sampling import Callbacks, SamplingConfig
from scenario_gen.method.validity import Limits
from scenario_gen.ros.common.node_parameters import SamplerParameters
from scenario_gen.ros.common.ros_parameters import values_of_call
from scenario_gen.ros.common.services import offer_trigger, REQUESTS
from scenario_gen.situation import Situation
from scenario_gen.types import BoundaryStates, EgoSlot, GenerationResult, Request, Scenario

SHOWN = 20  # waiting requests that are named
LOG_S = 5.0  # seconds between two lines on the terminal that say how far a request is
POLL_S = 0.1  # seconds between two looks whether those that wait can be served
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_.-]{0,63}")
Answer = tuple[
    GenerationResult, RequestSummary
]  # the result of a request, whose scenarios are published by then


@dataclass(frozen=True)
class Config(Request, SamplerParameters):
    """The sampler's parameters; `fitting` and `planning` are used for requests with start or end states."""

    fitting: FittingConfig = field(default_factory=FittingConfig)
    planning: PlanningConfig = field(default_factory=PlanningConfig)
    sampling: SamplingConfig = field(default_factory=SamplingConfig)
    limits: Limits = field(default_factory=Limits)


class Code(IntEnum):
    """How a request ended, as scenario_gen_interfaces/action/Generate has it."""

    OK = 0
    INVALID = 1
    NOT_READY = 2
    IMPOSSIBLE = 3
    CANCELLED = 4
    FAILED = 5


@dataclass(frozen=True)
class Outcome:
    """How a request ended, in words, too; `answer` if it came to its end."""

    code: Code
    reason: str
    request: str = ""
    answer: Answer | None = None


@dataclass
class OpenRequest:
    """An open request: its name, its job, and its progress."""

    name: str
    job: str
    n_requested: int
    waiting_for: list[str] = field(default_factory=list)  # topics that are missing
    cancelled: bool = False  # while it waits for them
    began: float | None = None
    accepted: int = 0
    candidates: int = 0
    stamp_ns: int = 0
    logged: float = 0.0  # when the last line was written on the terminal

    def progress(self, accepted: int, candidates: int, stamp_ns: int) -> None:
        """Set the progress."""
        self.accepted, self.candidates, self.stamp_ns = accepted, candidates, stamp_ns

    def seconds(self) -> float:
        """Seconds since its job began."""
        return 0.0 if self.began is None else monotonic() - self.began

    def values(self) -> dict[str, str]:
        """What /diagnostics reports of it."""
        return {
            "request": self.name,
            "requested": str(self.n_requested),
            "accepted": str(self.accepted),
            "candidates": str(self.candidates),
            "seconds": f"{self.seconds():.1f}",
        }


class OpenRequests:
    """The open requests of a sampler, which its statuses `progress` and `generate` report, and its services."""

    def __init__(self, node: Any) -> None:
        """Offer the services. `node`: the sampler; it generates, and returns the topics still missing."""
        self._node = node
        self._open: dict[str, OpenRequest] = {}
        self._numbers = count(1)
        self._lock = threading.Lock()
        self._waiters: list[tuple[Future, Callable[[], bool]]] = []
        self._timer = node.create_timer(
            POLL_S, self.look, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )
        node.create_service(
            SetParametersAtomically, "~/generate", self._generate, qos_profile=REQUESTS
        )
        node.create_service(
            Trigger, "~/wait_until_ready", self._wait_until_ready, qos_profile=REQUESTS
        )
        node.create_service(
            SetParametersAtomically, "~/cancel_request", self._cancel_request, qos_profile=REQUESTS
        )
        offer_trigger(node, "~/cancel", self._cancel_all)

    def add(self, given: str = "", job: str = "", n_requested: int = 0) -> OpenRequest:
        """Open a request; without a name of its own, or a job's, it has the next number.

        Raises:
            InputError: the name is none, or that of an open request.
        """
        with self._lock:
            if given and not NAME.fullmatch(given):
                raise InputError(
                    f"request is {given!r}; a letter and up to 63 letters, digits, `_`, `-` or `.` are a name"
                )
            if given in self._open:
                raise InputError(
                    f"request {given!r} is open already; give another name, or wait for its answer"
                )
            name = given or str(next(self._numbers))
            self._open[name] = OpenRequest(name, job or f"request {name}", n_requested)
            return self._open[name]

    def begin(self, request: OpenRequest) -> None:
        """Start the clock of a request whose job begins."""
        request.began = monotonic()
        request.logged = request.began
        self.report()

    def end(self, request: OpenRequest, level: Level, message: str, **more: str) -> None:
        """Close a request that is done, cancelled or refused; `more` is reported on /diagnostics beside how far it came."""
        with self._lock:
            self._open.pop(request.name, None)
        self._node.status(
            level,
            f"request {request.name}: {message}",
            "generate",
            request.stamp_ns,
            **request.values(),
            **more,
        )
        self._node.diagnostics.resolve("generate")
        self.report()

    def cancel(self, name: str) -> str:
        """Cancel one of them; return what to answer.

        Raises:
            InputError: none has that name.
        """
        with self._lock:
            request, known = self._open.get(name), ", ".join(list(self._open)[:SHOWN])
        if request is None or not self.cancelled(request):
            raise InputError(f"no request {name!r} is open; open: {known or 'none'}")
        return f"request {name} is cancelled, {request.accepted} of {request.n_requested} scenarios were found"

    def cancelled(self, request: OpenRequest) -> bool:
        """Cancel a request; False if it has ended."""
        if request.waiting_for:
            request.cancelled = True
            self.look()
            return True
        return bool(self._node.cancel(request.job))

    def report(self) -> None:
        """Report on /diagnostics how far the request at work is, and now and then on the terminal."""
        with self._lock:
            running = next(
                (request for request in self._open.values() if request.began is not None), None
            )
            waiting = [request for request in self._open.values() if request.began is None]
        if running is None:
            self._node.diagnostics.status(
                Level.OK, "no request is at work", "progress", {}, log=False
            )
            return
        values = running.values() | {
            "at_work": str(len(self._open) - len(waiting)),
            "waiting": str(len(waiting)),
        }
        values |= {
            f"waiting.{request.name}": f"{request.n_requested} scenarios"
            for request in waiting[:SHOWN]
        }
        found = f"{running.accepted} of {running.n_requested} scenarios from {running.candidates} candidates"
        message = f"request {running.name}: {found}, {running.seconds():.0f} s"
        if log := monotonic() - running.logged >= LOG_S:
            running.logged = monotonic()
        self._node.diagnostics.status(
            Level.OK, message, "progress", values, running.stamp_ns, log=log
        )

    async def _generate(
        self, request: SetParametersAtomically.Request, response: SetParametersAtomically.Response
    ) -> SetParametersAtomically.Response:
        """Generate with the caller's parameters; the answer comes when the set is done."""
        outcome = await self.answer(request.parameters)
        response.result.successful, response.result.reason = (
            outcome.code is Code.OK,
            outcome.reason,
        )
        return response

    async def answer(
        self,
        parameters: Sequence[Any],
        wait: float = 0.0,
        opened: Callable[[OpenRequest], None] = lambda _: None,
    ) -> Outcome:
        """Serve a request, on the executor's thread, to its end.

        Args:
            parameters: the sampler's, as messages of rcl_interfaces, valid for this request; `request` is its name.
            wait: seconds to wait for the sampler's inputs.
            opened: called with the request as soon as it is open.
        """
        node = self._node
        try:
            requested, name = _named(parameters)
            request = self.add(name)
        except ScenarioGenError as error:
            node.diagnostics.failed("generate", error)
            node.diagnostics.resolve("generate")
            return Outcome(Code.INVALID, str(error))
        opened(request)
        try:
            config = values_of_call(node.config, requested)
            request.n_requested = config.count
            code, reason = await self._ready(request, config, wait)
        except ScenarioGenError as error:
            self.end(request, Level.ERROR, str(error), error=type(error).__name__)
            return Outcome(Code.INVALID, f"request {request.name}: {error}", request.name)
        if code is not Code.OK:
            self.end(request, Level.WARN, reason)
            return Outcome(code, f"request {request.name}: {reason}", request.name)
        messages = node.messages()

        def job(cancelled: Callable[[], bool]) -> tuple[Code, str, Answer | None]:
            try:
                result: Answer | None = node.generate(messages, request, config, cancelled)
            except ScenarioGenError as error:  # which has been reported
                return (
                    Code.INVALID if isinstance(error, InputError) else Code.IMPOSSIBLE,
                    str(error),
                    None,
                )
            if result is None:
                return Code.CANCELLED, node.given_up(messages, lambda: True), None
            return (
                Code.OK if result[0].generated.scenarios else Code.IMPOSSIBLE,
                result[1].status.message,
                result,
            )

        def failed(error: BaseException) -> tuple[Code, str, Answer | None]:
            if isinstance(error, CancelledError):
                return Code.CANCELLED, node.given_up(messages, lambda: True), None
            return Code.FAILED, f"{type(error).__name__}: {error}", None

        code, reason, result = await node.result_of(request.job, job, failed)
        return Outcome(code, f"request {request.name}: {reason}", request.name, result)

    async def _ready(self, request: OpenRequest, config: Any, wait: float) -> tuple[Code, str]:
        """Wait until the sampler is active and has its inputs; then the request is the last one in the queue."""
        until = monotonic() + wait

        def ready() -> bool:
            request.waiting_for = self.missing(config)
            return request.cancelled or not request.waiting_for or monotonic() >= until

        await self._until(ready)
        if request.cancelled:
            return Code.CANCELLED, "cancelled"
        if not self._node.active:
            return Code.NOT_READY, "the node is not active; activate it first"
        if request.waiting_for:
            return (
                Code.NOT_READY,
                f"nothing to generate from yet: waiting for {', '.join(request.waiting_for)}",
            )
        with self._lock:
            self._open[request.name] = self._open.pop(request.name)
        return Code.OK, ""

    async def _until(self, ready: Callable[[], bool]) -> None:
        """Wait until `ready` says so; it is asked ten times a second, and when an input has come."""
        if ready():
            return
        arrived = Future()
        self._waiters.append((arrived, ready))
        self._timer.reset()
        await arrived
        self._node.executor.create_task(
            self.look
        )  # when this one stands in the queue, it is the next one's turn

    def missing(self, config: Any) -> list[str]:
        """The topics that a request waits for; `activation` while the node is not active."""
        missing: list[str] = self._node.missing(config) if self._node.active else ["activation"]
        return missing

    def position(self, request: OpenRequest) -> int:
        """How many requests are served before this one; 0 if it is at work, or waits for its inputs."""
        with self._lock:
            served = [name for name, other in self._open.items() if not other.waiting_for]
        return (
            served.index(request.name) if request.began is None and request.name in served else 0
        )

    def look(self) -> None:
        """Let the first one go on that waits for inputs and need not any more; called when an input has come."""
        for waiter in list(self._waiters):
            arrived, done = waiter
            if done():
                self._waiters.remove(waiter)
                arrived.set_result(None)
                break
        if not self._waiters:
            self._timer.cancel()

    async def _wait_until_ready(
        self, _request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        """Answer once a request with the node's own parameters can be served, however long that takes."""
        node = self._node
        await self._until(lambda: not self.missing(node.config))
        response.success, response.message = True, "ready"
        return response

    def _cancel_request(
        self, request: SetParametersAtomically.Request, response: SetParametersAtomically.Response
    ) -> SetParametersAtomically.Response:
        try:
            response.result.reason = self.cancel(_named(request.parameters)[1])
            response.result.successful = True
        except ScenarioGenError as error:
            response.result.reason = str(error)
        return response

    def _cancel_all(self) -> str:
        if names := self._node.cancel():
            return f"cancelled: {', '.join(names)}"
        raise InputError("nothing is running")


def _named(parameters: Sequence[Any]) -> tuple[list[Any], str]:
    """Return a caller's parameters but `request`, and what that is, "" if there is none; the tools of ROS make 7 of '7'."""
    names = [
        Parameter.from_parameter_msg(parameter).value
        for parameter in parameters
        if parameter.name == "request"
    ]
    return [parameter for parameter in parameters if parameter.name != "request"], str(
        names[0]
    ) if names else ""


def answer_request(
    messages: Mapping[str, bytes],
    config: Config,
    request: OpenRequest,
    node: str,
    cancelled: Callable[[], bool],
    send: Send,
    turn: AbstractContextManager[object],
) -> Answer:
    """Sample, check and publish; fit and plan anew if start or end states are requested.

    Args:
        messages: of the template, by topic.
        config: the values of this request.
        request: what is told how far it is.
        node: the node's full name.
        cancelled: whether to stop early; what was published by then stays, and the summary says so.
        send: called with topic and CDR bytes of every message, scenarios as they are drawn.
        turn: held while a scenario's messages, or those of the end, are sent, so that requests at the same time do not mix them.

    Raises:
        InputError: a message is damaged, or a vehicle that is named does not exist.
        RefusedError: the request is impossible; the message says why, and which similar request is possible.
    """
    template = decode_template(messages)
    encounter, segmentation, (road, _) = (
        template.encounter,
        template.segmentation,
        template.road_and_fit(),
    )

    def advance(done: int, _total: int, candidates: int) -> None:
        request.progress(done, candidates, encounter.start_ns)

    hashes = template_hashes(messages)
    sender = RequestSender(
        RequestMessages(encounter, request.name, node, hashes), road.frame_id, send
    )

    def in_turn(scenario: Scenario, requested: BoundaryStates, ego: EgoSlot | None) -> None:
        with turn:
            sender.scenario(scenario, requested, ego)

    callbacks = Callbacks(advance, cancelled, found=in_turn)
    stages = PipelineConfig(
        fitting=config.fitting,
        planning=config.planning,
        sampling=config.sampling,
        limits=config.limits,
    )
    chain = Chain(
        Situation.of(encounter), segmentation, road, stages, config, config.count, config.seed
    )
    try:
        outcome = chain.sample(
            chain.plan() if config.moves else replace(template, seed=config.seed), callbacks
        )
    except RefusedError as error:
        from scenario_gen.method.nearest import suggest_nearest  # only a refusal needs it

        raise suggest_nearest(error, chain, cancelled) from None
    result = outcome.generated
    provenance = parameter_texts(config) | versions() | hashes
    stopped = cancelled() and len(result.scenarios) < result.requested
    summary = request_summary(
        result,
        request.name,
        node,
        config.seed,
        provenance,
        cancelled=stopped,
        reactions=outcome.reacting,
    )
    with turn:
        sender.close(result, summary)
    return outcome, summary
