# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""evaluator: `tracks`, `changepoints` and the `scenarios` of a request in.

Its metrics out as `report`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
import math
from time import monotonic

from msg_conventions.changepoints import decode_changepoints
from msg_conventions.diagnostics import encode_diagnostics, Level, Status
from msg_conventions.scenario_info import decode_info, INFO, RequestSummary, ScenarioEntry
from msg_conventions.scenarios import decode_scenario, digest
from msg_conventions.topics import LOSSLESS
from msg_conventions.tracks import decode_tracks
from scenario_gen.bags.recordings.request_tracker import Match, RequestTracker, TrackedRequest
from scenario_gen.base.cancelling import stop_if_cancelled
from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.method.evaluation import evaluate_scenarios, EvaluationConfig
from scenario_gen.ros.common.stage_node import StageNode
from scenario_gen.ros.common.timers import create_steady_timer
from scenario_gen.types import Evaluation, Row, WITH

Entries = Sequence[tuple[bytes, ScenarioEntry]]
"""Scenarios with their entries in `scenarios/info`."""
SCENARIOS = ("scenarios", INFO)
MAX_STORED_COUNT = 3000  # scenarios of requests that are not complete
MAX_REQUEST_COUNT = 100  # of those requests
QUIET_S = 5.0  # without messages, after which a closed request's missing ones are reported


@dataclass(frozen=True)
class Config(Parameters):
    """The evaluator's parameters."""

    seed: int = parameter(0, "seed of the bootstrap, and of the choice of scenarios", low=0)
    measured: int = parameter(
        1000,
        "scenarios of a request that are measured; of more the seed chooses these",
        low=1,
        high=1000,
    )
    evaluation: EvaluationConfig = field(default_factory=EvaluationConfig)


class Evaluator(StageNode):
    """Measures each closed request's scenarios against their template."""

    INPUTS = ("tracks", "changepoints")
    STAGES = ("situation", "method.evaluation")
    OUTPUTS = ("report",)

    def __init__(self, namespace: str | None = None) -> None:
        super().__init__("evaluator", Config(), namespace)
        self._newest: dict[str, bytes] = {}
        self._requests = RequestTracker()
        self._last_message = math.inf  # time of the last message [s]
        create_steady_timer(self, 1.0, self._report_missing)

    def started(self) -> None:
        """Subscribe to scenarios with a quality for which paced publishers wait."""
        self._requests = RequestTracker(MAX_STORED_COUNT)
        for topic in SCENARIOS:
            self.listen(topic, LOSSLESS)

    def received(self, topic: str, data: bytes) -> None:
        """Store a message, and evaluate each request that is complete."""
        if topic == "scenarios":
            self._keep(self._requests.add_scenario(digest(data), data))
        elif topic == INFO:
            self._keep(self._requests.add_info(decode_info(data, topic)))
        else:
            self._newest[topic] = data
        self._last_message = monotonic()
        self._drop_excess()
        if not {"tracks", "changepoints"} <= set(self._newest):
            return
        for name, request in list(self._requests.open.items()):
            if request.is_complete:
                self._requests.forget(name)
                self._submit(dict(self._newest), request)

    def _keep(self, match: Match | None) -> None:
        if match is not None:
            request, entry, messages = match
            request.store(entry, b"".join(messages), self.config.seed, self.config.measured)

    def _drop_excess(self) -> None:
        """Drop the oldest requests above the limits of requests and of stored scenarios."""
        requests = self._requests.open
        while len(requests) > 1 and (
            len(requests) > MAX_REQUEST_COUNT
            or sum(len(each.stored) for each in requests.values()) > MAX_STORED_COUNT
        ):
            oldest = next(iter(requests))
            message = f"{requests[oldest].sentence()}; it is not evaluated"
            self._requests.forget(oldest)
            self.status(Level.WARN, message, "requests", request=oldest)

    def _report_missing(self) -> None:
        """Report the missing messages of closed requests, once no more arrive."""
        if monotonic() - self._last_message < QUIET_S or not self.active:
            return
        self._last_message = math.inf
        for request in self._requests.incomplete(closed=True):
            cause = "they were lost, or published before this node listened"
            message = f"{request.sentence()}: {cause}; it is not evaluated"
            self.status(Level.WARN, message, "requests", missing=str(request.missing))

    def _submit(self, messages: Mapping[str, bytes], request: TrackedRequest) -> None:
        name = f"request {request.request}"
        summary = request.summary
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
            decode_scenario(data, seed=entry.seed, index=entry.index, may_start_late=True)
            for data, entry in scenarios
        ]
        if any(stamp != encounter.start_ns for stamp, _ in decoded):
            raise InputError(
                f"request {summary.request}: its scenarios are not those of the newest tracks"
            )
        result = summary.result(tuple(scenario for _, scenario in decoded))
        evaluation = evaluate_scenarios(
            encounter,
            {WITH: result},
            changepoints=len(segmentation.changepoints),
            config=self.config.evaluation,
            seed=self.config.seed,
        )
        stop_if_cancelled()
        statuses = [
            self._row_status(row, evaluation, summary, len(decoded)) for row in evaluation.rows
        ]
        self.outputs.send("report", encode_diagnostics(statuses, encounter.start_ns))
        self.diagnostics.resolve("requests")
        self.get_logger().info(f"request {summary.request} evaluated: {len(decoded)} scenarios")

    def _row_status(
        self, row: Row, evaluation: Evaluation, summary: RequestSummary, measured: int
    ) -> Status:
        """Return the status for one row of the evaluation."""
        values = {
            "request": summary.request,
            "samples": str(row.samples),
            # beside E, which more changepoints always lower
            "changepoints": str(evaluation.changepoints),
        }
        for key, entry in row.values.items():
            if math.isfinite(entry.value):
                values[key] = repr(entry.value)
        notes = [str(note) for note in row.notes]
        if row.name == WITH and measured < summary.published:
            notes.append(
                f"measured on {measured} of {summary.published} scenarios, chosen by seed "
                f"{self.config.seed}"
            )
        name = f"{self.get_fully_qualified_name()}: {row.name}"
        return Status(name, Level.OK, "; ".join(notes), values)
