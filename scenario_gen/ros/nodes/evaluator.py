# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""evaluator: `tracks`, `changepoints` and the `scenarios` of a request in; its figures out as `report`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
import math
from time import monotonic

from msg_conventions.changepoints import decode_changepoints
from msg_conventions.diagnostics import encode_diagnostics, Level, Status
from msg_conventions.scenario_info import decode_info, INFO, RequestSummary, ScenarioEntry
from msg_conventions.scenarios import decode_scenario, digest
from msg_conventions.topics import MANY_HEARD
from msg_conventions.tracks import decode_tracks
from scenario_gen.bags.recordings.requests import Match, RequestTracker, TrackedRequest
from scenario_gen.base.cancelling import stop_if_cancelled
from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.method.evaluation import evaluate_scenarios, EvaluationConfig
from scenario_gen.ros.common.stage_node import StageNode
from scenario_gen.types import (
    Note,
    NoteKind,
    WITH,
)

Entries = Sequence[
    tuple[bytes, ScenarioEntry]
]  # scenarios, each with its entry of `scenarios/info`
SCENARIOS = ("scenarios", INFO)
SETTLED_S = (
    5.0  # seconds without messages after which a closed request's missing messages are reported
)


@dataclass(frozen=True)
class Config(Parameters):
    """The evaluator's parameters."""

    seed: int = parameter(0, "seed of the bootstrap, and of the choice of what is measured", low=0)
    measured: int = parameter(
        1000,
        "scenarios of a request that are measured, chosen by the seed where it has more",
        low=1,
        high=1000,
    )
    keep: int = parameter(
        3000,
        "scenarios kept of requests that are not whole yet; the oldest requests are given up",
        low=1,
    )
    wait: int = parameter(
        100, "closed requests that wait for scenarios on their way; older ones are given up", low=1
    )
    evaluation: EvaluationConfig = field(default_factory=EvaluationConfig)


class Evaluator(StageNode):
    """Measures every request's scenarios against their template once the request is closed."""

    INPUTS = ("tracks", "changepoints")
    STAGES = ("situation", "method.evaluation")
    OUTPUTS = ("report",)

    def __init__(self, namespace: str | None = None) -> None:
        super().__init__("evaluator", Config(), namespace)
        self._newest: dict[str, bytes] = {}
        self._requests = RequestTracker()
        self._news = math.inf  # when something of scenarios came last
        self.create_timer(1.0, self._report_missing)

    def started(self) -> None:
        """Listen to scenarios so that who paces them waits for this node."""
        self._requests = RequestTracker(self.config.keep)
        for topic in SCENARIOS:
            self.listen(topic, MANY_HEARD)

    def received(self, topic: str, data: bytes) -> None:
        """Keep what comes, and evaluate a request when all of it is there."""
        if topic == "scenarios":
            self._keep(self._requests.add_scenario(digest(data), data))
        elif topic == INFO:
            for info in decode_info(data, topic):
                self._keep(self._requests.add_info(info))
        else:
            self._newest[topic] = data
        self._news = monotonic()
        self._give_up()
        if not {"tracks", "changepoints"} <= set(self._newest):
            return
        for name, request in list(self._requests.open.items()):
            if request.whole:
                self._requests.forget(name)
                self._submit(dict(self._newest), request)

    def _keep(self, match: Match | None) -> None:
        if match is not None:
            request, entry, data = match
            request.keep(entry, data, self.config.seed, self.config.measured)

    def _give_up(self) -> None:
        """Forget the oldest requests while more of them wait, or more scenarios of them are there, than are kept."""
        requests = self._requests.open
        closed = [name for name, request in requests.items() if request.summary]
        for name in closed[: max(0, len(closed) - self.config.wait)]:
            self._forget(name)
        while (
            len(requests) > 1
            and sum(len(request.kept) for request in requests.values()) > self.config.keep
        ):
            self._forget(next(iter(requests)))

    def _forget(self, request: str) -> None:
        """Give up a request, and report its missing messages."""
        message = self._requests.open[request].sentence()
        self._requests.forget(request)
        self.status(
            Level.WARN,
            f"{message}; it is not evaluated; see keep and wait",
            "requests",
            request=request,
        )

    def _report_missing(self) -> None:
        """Say what has not come of closed requests, once all is quiet."""
        if monotonic() - self._news < SETTLED_S or not self.active:
            return
        self._news = math.inf
        for request in self._requests.incomplete(closed=True):
            why = "they were lost, or published before this node listened; it is not evaluated without them"
            self.status(
                Level.WARN,
                f"{request.sentence()}: {why}",
                "requests",
                missing=str(request.missing),
            )

    def _submit(self, messages: Mapping[str, bytes], request: TrackedRequest) -> None:
        name, summary = f"request {request.request}", request.summary
        if summary is None or summary.cancelled:
            return
        scenarios = request.in_order()
        self.work(name, lambda _: self._evaluate(messages, scenarios, summary))

    def _evaluate(
        self, messages: Mapping[str, bytes], scenarios: Entries, summary: RequestSummary
    ) -> None:
        encounter = decode_tracks(messages["tracks"])
        segmentation = decode_changepoints(messages["changepoints"], encounter)
        # an ego that is left out may have been the first to come
        decoded = [
            decode_scenario(data, seed=entry.seed, index=entry.index, late=True)
            for data, entry in scenarios
        ]
        if any(stamp != encounter.start_ns for stamp, _ in decoded):
            raise InputError(
                f"request {summary.request}: its scenarios are not those of the newest tracks"
            )
        found = summary.result(tuple(scenario for _, scenario in decoded))
        evaluation = evaluate_scenarios(
            encounter,
            {WITH: found},
            changepoints=len(segmentation.changepoints),
            config=self.config.evaluation,
            seed=self.config.seed,
        )
        stop_if_cancelled()
        statuses = []
        chosen = Note.of(
            NoteKind.RANDOM_SUBSET,
            measured=len(decoded),
            total=summary.published,
            seed=self.config.seed,
        )
        for row in evaluation.rows:
            figures = {
                key: repr(entry.value)
                for key, entry in row.values.items()
                if math.isfinite(entry.value)
            }
            k = str(evaluation.changepoints)  # beside E always: more changepoints always lower it
            values = {
                "request": summary.request,
                "samples": str(row.samples),
                "changepoints": k,
                **figures,
            }
            notes = (
                (*row.notes, chosen)
                if row.name == WITH and len(decoded) < summary.published
                else row.notes
            )
            statuses.append(
                Status(
                    f"{self.get_fully_qualified_name()}: {row.name}",
                    Level.OK,
                    "; ".join(map(str, notes)),
                    values,
                )
            )
        self.outputs.send("report", encode_diagnostics(statuses, encounter.start_ns))
        self.diagnostics.resolve("requests")
        self.get_logger().info(f"request {summary.request} evaluated: {len(decoded)} scenarios")
