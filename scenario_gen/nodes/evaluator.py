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

"""evaluator: `tracks`, `changepoints` and the `scenarios` of a request in; its figures out as `report`."""

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
import math
import sys

from msg_conventions.changepoints import decode_changepoints
from msg_conventions.diagnostics import (
    count_in,
    decode_diagnostics,
    encode_diagnostics,
    Level,
    read_request,
    Status,
    take_entry,
    text_in,
)
from msg_conventions.scenarios import decode_scenario, digest
from msg_conventions.tracks import decode_tracks
from scenario_gen.cancelling import stop_if_cancelled
from scenario_gen.errors import InputError
from scenario_gen.evaluation import CheckCounts, evaluate, EvaluationConfig, WITH
from scenario_gen.nodes.base import run_nodes, StageNode
from scenario_gen.parameters import check, parameter

Told = Sequence[tuple[bytes, Mapping[str, str]]]  # scenarios, each with its entry of `scenarios/info`


@dataclass(frozen=True)
class Config:
    """The evaluator's parameters."""

    seed: int = parameter(0, "seed of the bootstrap", low=0)
    keep: int = parameter(10_000, "scenarios kept until their request is closed; older ones are forgotten", low=1)
    wait: int = parameter(100, "closed requests that wait for scenarios on their way; older ones are given up", low=1)
    evaluation: EvaluationConfig = field(default_factory=EvaluationConfig)

    def __post_init__(self) -> None:
        check(self)


class Evaluator(StageNode):
    """Measures every request's scenarios against their template once the request is closed."""

    INPUTS = ("tracks", "changepoints", "scenarios", "scenarios/info")
    STAGES = ("interaction", "evaluation")
    OUTPUTS = ("report",)

    def __init__(self, namespace: str | None = None) -> None:
        super().__init__("evaluator", Config(), namespace)
        self._newest: dict[str, bytes] = {}
        self._scenarios: dict[str, bytes] = {}  # by SHA-256
        self._open: dict[str, dict[str, Mapping[str, str]]] = {}  # request -> index -> entry of `scenarios/info`
        self._closed: dict[str, Status] = {}  # by request: what its account says, while scenarios of it are still to come
        self._cut: deque[str] = deque(maxlen=1000)  # requests given up before they were closed

    def received(self, topic: str, data: bytes) -> None:
        """Keep what comes, and evaluate a request when all of it is there."""
        if topic == "scenarios":
            self._scenarios[digest(data)] = data
            while len(self._scenarios) > self.config.keep:
                self._scenarios.pop(next(iter(self._scenarios)))
        elif topic == "scenarios/info":
            for status in decode_diagnostics(data)[1]:
                if not {"published", "sha256"} & set(status.values):
                    continue
                self._take_told(status, f"{topic}, {status.name}")
            self._give_up()
        else:
            self._newest[topic] = data
        if not {"tracks", "changepoints"} <= set(self._newest):
            return
        for request, status in list(self._closed.items()):
            entries = tuple(self._open.get(request, {}).values())
            if all(v["sha256"] in self._scenarios for v in entries):
                self._closed.pop(request)
                self._open.pop(request, None)
                self._submit(dict(self._newest), [(self._scenarios[v["sha256"]], v) for v in entries], status)
                for values in entries:  # two may have the same bytes
                    self._scenarios.pop(values["sha256"], None)

    def _take_told(self, status: Status, place: str) -> None:
        """Keep an entry of a request, or its closing."""
        request = text_in(status.values, "request", place)
        if "published" in status.values:
            count_in(status.values, "published", place)
            self._closed[request] = status
            if request in self._cut:
                self._forget(request)
            return
        entry = {key: text_in(status.values, key, place) for key in ("index", "seed", "sha256")}
        if entry["index"] == "0" and request in self._cut:  # begun anew
            self._cut.remove(request)
        take_entry(self._open.setdefault(request, {}), entry)

    def _give_up(self) -> None:
        """Forget the oldest requests while more of them wait, or more scenarios are told of, than are kept."""
        while len(self._closed) > self.config.wait:
            self._forget(next(iter(self._closed)))
        while self._open and sum(map(len, self._open.values())) > self.config.keep:
            self._forget(next(iter(self._open)))

    def _forget(self, request: str) -> None:
        """Give up a request, and say how many of its scenarios have not come or are not kept any more."""
        entries, closing = self._open.pop(request, {}), self._closed.pop(request, None)
        untold = int(closing.values["published"]) - len(entries) if closing else 0
        missing = max(untold, 0) + sum(v["sha256"] not in self._scenarios for v in entries.values())
        if closing is None and request not in self._cut:  # more of it is to come
            self._cut.append(request)
        words = f"request {request} is not evaluated: {missing} of its scenarios did not come; see keep and wait"
        self.status(Level.WARN, words, "requests", request=request)

    def _submit(self, messages: Mapping[str, bytes], scenarios: Told, status: Status) -> None:
        name = f"request {status.values['request']}"
        self.work(name, lambda cancelled: None if cancelled() else self._evaluate(messages, scenarios, status))

    def _evaluate(self, messages: Mapping[str, bytes], scenarios: Told, status: Status) -> None:
        encounter = decode_tracks(messages["tracks"])
        segmentation = decode_changepoints(messages["changepoints"], encounter)
        told = "scenarios/info"
        decoded = [
            decode_scenario(data, seed=count_in(v, "seed", told), index=count_in(v, "index", told)) for data, v in scenarios
        ]
        if any(stamp != encounter.start_ns for stamp, _ in decoded):
            raise InputError(f"request {status.values['request']}: its scenarios are not those of the newest tracks")
        account = read_request(status, tuple(scenario for _, scenario in decoded))
        evaluation = evaluate(
            encounter,
            segmentation,
            {WITH: account.scenarios},
            checks={WITH: CheckCounts.of_set(account)},
            config=self.config.evaluation,
            seed=self.config.seed,
        )
        stop_if_cancelled()
        statuses = []
        for row in evaluation.rows:
            figures = {key: repr(entry.value) for key, entry in row.values.items() if math.isfinite(entry.value)}
            values = {"request": status.values["request"], "samples": str(row.samples), **figures}
            statuses.append(Status(f"{self.get_fully_qualified_name()}: {row.name}", Level.OK, "; ".join(row.notes), values))
        self.send("report", encode_diagnostics(statuses, encounter.start_ns))
        self.health.settle("requests")
        self.get_logger().info(f"request {status.values['request']} evaluated: {len(decoded)} scenarios")


def main() -> None:
    """Run the node."""
    sys.exit(run_nodes(Evaluator))
