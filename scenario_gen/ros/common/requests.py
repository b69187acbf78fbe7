# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The sampler's requests: its parameters, the open requests, and their answers.

A request arrives by the service `~/generate` or the action `~/generate_scenarios`
(generate_action.py).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from itertools import count
import re
import threading
from time import monotonic
from typing import Any

from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from msg_conventions.diagnostics import Level, Subject
from msg_conventions.scenario_info import RequestSummary
from scenario_gen.base.cancelling import CancelledError
from scenario_gen.base.errors import InputError, ScenarioGenError
from scenario_gen.base.parameters import parameter
from scenario_gen.method.fitting import FittingConfig
from scenario_gen.method.routing import PlanningConfig
from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.method.segmentation import SegmentationConfig
from scenario_gen.method.validity import Limits
from scenario_gen.ros.common.ros_parameters import values_of_call
from scenario_gen.ros.common.services import offer_trigger, REQUESTS
from scenario_gen.ros.common.waits import Waits
from scenario_gen.types import (
    GenerationResult,
    Request,
)

MAX_NAMED_COUNT = 20  # waiting requests in a message
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_.-]{0,63}")
Answer = tuple[GenerationResult, RequestSummary]
"""The result of a request, whose scenarios have been published."""


@dataclass(frozen=True)
class Config(Request):
    """The sampler's parameters.

    `fitting` and `planning` apply to requests with start or end states, and, as `segmentation`,
    to drawn decisions.
    """

    count: int = parameter(50, "scenarios to generate", low=1, high=100_000)
    seed: int = parameter(
        0, "seed of the scenarios, and of the planner where states are requested", low=0
    )
    generate_on_input: bool = parameter(
        True, "generate whenever the inputs are complete or change; false: on ~/generate only"
    )
    patience: float = parameter(
        60.0,
        "time without acknowledgement after which a subscriber of scenarios is no longer waited "
        "for; 0: wait for ever",
        unit="s",
        low=0.0,
    )
    pair_map: bool = parameter(
        True,
        "use only a map with the recording's stamp; false: the newest map of any map server",
        fixed=True,
    )
    segmentation: SegmentationConfig = field(default_factory=SegmentationConfig)
    fitting: FittingConfig = field(default_factory=FittingConfig)
    planning: PlanningConfig = field(default_factory=PlanningConfig)
    sampling: SamplingConfig = field(default_factory=SamplingConfig)
    limits: Limits = field(default_factory=Limits)


class Code(IntEnum):
    """How a request ended, as in scenario_gen_interfaces/action/Generate."""

    OK = 0
    INVALID = 1
    NOT_READY = 2
    IMPOSSIBLE = 3
    CANCELLED = 4
    FAILED = 5


@dataclass(frozen=True)
class Outcome:
    """How a request ended, with the reason; `answer` is set if it was completed."""

    code: Code
    reason: str
    request: str = ""
    answer: Answer | None = None


@dataclass
class OpenRequest:
    """An open request: its name, its job, and its progress; times are on the steady clock [s]."""

    name: str
    job: str
    n_requested: int
    waiting_for: list[str] = field(default_factory=list)  # missing topics
    cancelled: bool = False  # while it waits for them
    started_at: float | None = None
    accepted: int = 0
    candidates: int = 0
    stamp_ns: int = 0
    logged_at: float = 0.0

    def progress(self, accepted: int, candidates: int, stamp_ns: int) -> None:
        """Set the progress."""
        self.accepted = accepted
        self.candidates = candidates
        self.stamp_ns = stamp_ns

    def seconds(self) -> float:
        """Return the seconds since the job started."""
        return 0.0 if self.started_at is None else monotonic() - self.started_at

    def values(self) -> dict[str, str]:
        """Return the values for /diagnostics."""
        return {
            "request": self.name,
            "requested": str(self.n_requested),
            "accepted": str(self.accepted),
            "candidates": str(self.candidates),
            "seconds": f"{self.seconds():.1f}",
        }


class OpenRequests:
    """The open requests of a sampler, its services, and its statuses `progress` and `generate`."""

    def __init__(self, node: Any) -> None:
        """Offer the services of `node`, the sampler."""
        self._node = node
        self._open: dict[str, OpenRequest] = {}
        self._numbers = count(1)
        self._lock = threading.Lock()
        self.waits = Waits(node)  # checked when an input has arrived
        for kind, name, answer in (
            (SetParametersAtomically, "~/generate", self._generate),
            (Trigger, "~/wait_until_ready", self._wait_until_ready),
            (SetParametersAtomically, "~/cancel_request", self._cancel_request),
        ):
            node.create_service(kind, name, answer, qos_profile=REQUESTS)
        offer_trigger(node, "~/cancel", self._cancel_all)

    def add(self, name: str = "", job: str = "", n_requested: int = 0) -> OpenRequest:
        """Open a request; by default its name is the next number.

        Raises:
            InputError: the name is invalid, or an open request has it.
        """
        with self._lock:
            if name and not NAME.fullmatch(name):
                raise InputError(
                    f"request is {name!r}; a letter and up to 63 letters, digits, `_`, `-` or `.` "
                    "are a name"
                )
            if name in self._open:
                raise InputError(
                    f"request {name!r} is open already; give another name, or wait for its answer"
                )
            name = name or str(next(self._numbers))
            self._open[name] = OpenRequest(name, job or f"request {name}", n_requested)
            return self._open[name]

    def begin(self, request: OpenRequest) -> None:
        """Start the clock of a request whose job begins."""
        request.started_at = monotonic()
        request.logged_at = request.started_at
        self.report()

    def end(self, request: OpenRequest, level: Level, message: str, **more: str) -> None:
        """Close a request, and report its progress with the values `more`."""
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

    def cancel_named(self, name: str) -> str:
        """Cancel the request with a name; return the answer to the caller.

        Raises:
            InputError: no open request has that name.
        """
        with self._lock:
            request = self._open.get(name)
            names = ", ".join(list(self._open)[:MAX_NAMED_COUNT])
        if request is None or not self.cancel(request):
            raise InputError(f"no request {name!r} is open; open: {names or 'none'}")
        count = f"{request.accepted} of {request.n_requested}"
        return f"request {name} is cancelled, {count} scenarios were found"

    def cancel(self, request: OpenRequest) -> bool:
        """Cancel a request; return False if it has ended."""
        if request.waiting_for:
            request.cancelled = True
            self.waits.check()
            return True
        return bool(self._node.cancel(request.job))

    def report(self) -> None:
        """Report the progress of the running request on /diagnostics and the terminal."""
        with self._lock:
            requests = list(self._open.values())
        running = next((each for each in requests if each.started_at is not None), None)
        if running is None:
            message = "no request is at work"
            self._node.diagnostics.status(Level.OK, message, Subject.PROGRESS, {}, log=False)
            return
        waiting = sum(each.started_at is None for each in requests)
        values = running.values()
        values["at_work"] = str(len(requests) - waiting)
        values["waiting"] = str(waiting)
        message = (
            f"request {running.name}: {running.accepted} of {running.n_requested} scenarios "
            f"from {running.candidates} candidates, {running.seconds():.0f} s"
        )
        log = monotonic() - running.logged_at >= 5.0
        if log:
            running.logged_at = monotonic()
        self._node.diagnostics.status(
            Level.OK, message, Subject.PROGRESS, values, running.stamp_ns, log=log
        )

    async def _generate(
        self, request: SetParametersAtomically.Request, response: SetParametersAtomically.Response
    ) -> SetParametersAtomically.Response:
        """Generate with the caller's parameters; answer when the set is complete."""
        outcome = await self.answer(request.parameters)
        response.result.successful = outcome.code is Code.OK
        response.result.reason = outcome.reason
        return response

    async def answer(
        self,
        parameters: Sequence[Any],
        wait: float = 0.0,
        opened: Callable[[OpenRequest], None] = lambda _: None,
    ) -> Outcome:
        """Serve a request to its end, on the executor's thread.

        Args:
            parameters: messages of rcl_interfaces, valid for this request; `request` is its name.
            wait: seconds to wait for the sampler's inputs.
            opened: called with the request as soon as it is open.
        """
        node = self._node
        try:
            name = _request_name(parameters)
            request = self.add(name)
        except ScenarioGenError as error:
            node.diagnostics.failed("generate", error)
            node.diagnostics.resolve("generate")
            return Outcome(Code.INVALID, str(error))
        opened(request)
        try:
            given = [parameter for parameter in parameters if parameter.name != "request"]
            config = values_of_call(node.config, given)
            request.n_requested = config.count
            code, reason = await self._wait_for_inputs(request, wait)
        except ScenarioGenError as error:
            self.end(request, Level.ERROR, str(error), error=type(error).__name__)
            return Outcome(Code.INVALID, f"request {request.name}: {error}", request.name)
        if code is not Code.OK:
            self.end(request, Level.WARN, reason)
            return Outcome(code, f"request {request.name}: {reason}", request.name)
        return await self._run(request, config)

    async def _run(self, request: OpenRequest, config: Any) -> Outcome:
        """Generate off the executor's thread."""
        node = self._node
        messages = node.inputs.complete() or {}

        def outcome(code: Code, reason: str, answer: Answer | None = None) -> Outcome:
            return Outcome(code, f"request {request.name}: {reason}", request.name, answer)

        def job(cancelled: Callable[[], bool]) -> Outcome:
            try:
                result: Answer | None = node.generate(messages, request, config, cancelled)
            except InputError as error:  # reported by the node
                return outcome(Code.INVALID, str(error))
            except ScenarioGenError as error:
                return outcome(Code.IMPOSSIBLE, str(error))
            if result is None:
                return outcome(Code.CANCELLED, node.stop_reason(messages, lambda: True))
            code = Code.OK if result[0].generated.scenarios else Code.IMPOSSIBLE
            return outcome(code, result[1].message(), result)

        def failed(error: BaseException) -> Outcome:
            if isinstance(error, CancelledError):
                return outcome(Code.CANCELLED, node.stop_reason(messages, lambda: True))
            return outcome(Code.FAILED, f"{type(error).__name__}: {error}")

        ended: Outcome = await node.result_of(request.job, job, failed)
        return ended

    async def _wait_for_inputs(self, request: OpenRequest, wait: float) -> tuple[Code, str]:
        """Wait until the sampler is active and has its inputs.

        Then append the request to the queue.
        """

        def is_ready() -> bool:
            request.waiting_for = self.missing()
            return request.cancelled or not request.waiting_for

        await self.waits.until(is_ready, monotonic() + wait)
        if request.cancelled:
            return Code.CANCELLED, "cancelled"
        if not self._node.active:
            return Code.NOT_READY, "the node is not active; activate it first"
        if request.waiting_for:
            topics = ", ".join(request.waiting_for)
            return Code.NOT_READY, f"nothing to generate from yet: waiting for {topics}"
        with self._lock:
            self._open[request.name] = self._open.pop(request.name)
        return Code.OK, ""

    def missing(self) -> list[str]:
        """Return the topics that a request waits for.

        `activation` while the node is not active.
        """
        missing: list[str] = self._node.inputs.missing() if self._node.active else ["activation"]
        return missing

    def position(self, request: OpenRequest) -> int:
        """Return how many requests are served before this one.

        0 if it runs or waits for its inputs.
        """
        with self._lock:
            queue = [name for name, other in self._open.items() if not other.waiting_for]
        if request.started_at is not None or request.name not in queue:
            return 0
        return queue.index(request.name)

    async def _wait_until_ready(
        self, _request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        """Answer once a request with the node's parameters can be served."""
        await self.waits.until(lambda: not self.missing())
        response.success = True
        response.message = "ready"
        return response

    def _cancel_request(
        self, request: SetParametersAtomically.Request, response: SetParametersAtomically.Response
    ) -> SetParametersAtomically.Response:
        try:
            response.result.reason = self.cancel_named(_request_name(request.parameters))
            response.result.successful = True
        except ScenarioGenError as error:
            response.result.reason = str(error)
        return response

    def _cancel_all(self) -> str:
        if names := self._node.cancel():
            return f"cancelled: {', '.join(names)}"
        raise InputError("nothing is running")


def _request_name(parameters: Sequence[Any]) -> str:
    """Return the value of the parameter `request`, "" without one; ROS tools turn '7' into 7."""
    for message in parameters:
        if message.name == "request":
            return str(Parameter.from_parameter_msg(message).value)
    return ""
