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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
import math
import sys
from time import monotonic

from msg_conventions.changepoints import decode_changepoints
from msg_conventions.diagnostics import count_in, decode_diagnostics, encode_diagnostics, Level, read_request, Status
from msg_conventions.scenarios import decode_scenario, digest
from msg_conventions.topics import MANY_HEARD
from msg_conventions.tracks import decode_tracks
from scenario_gen.bags.accounts import Account, Accounts, Match
from scenario_gen.cancelling import stop_if_cancelled
from scenario_gen.errors import InputError
from scenario_gen.evaluation import CheckCounts, evaluate, EvaluationConfig, WITH
from scenario_gen.nodes.base import run_nodes, StageNode
from scenario_gen.parameters import check, parameter

Told = Sequence[tuple[bytes, Mapping[str, str]]]  # scenarios, each with its entry of `scenarios/info`
SCENARIOS = ("scenarios", "scenarios/info")
SETTLED = 5.0  # seconds without news after which it is said what a closed request lacks


@dataclass(frozen=True)
class Config:
    """The evaluator's parameters."""

    seed: int = parameter(0, "seed of the bootstrap, and of the choice of what is measured", low=0)
    measured: int = parameter(
        1000, "scenarios of a request that are measured, chosen by the seed where it has more", low=1, high=1000
    )
    keep: int = parameter(3000, "scenarios kept of requests that are not whole yet; the oldest requests are given up", low=1)
    wait: int = parameter(100, "closed requests that wait for scenarios on their way; older ones are given up", low=1)
    evaluation: EvaluationConfig = field(default_factory=EvaluationConfig)

    def __post_init__(self) -> None:
        check(self)


class Evaluator(StageNode):
    """Measures every request's scenarios against their template once the request is closed."""

    INPUTS = ("tracks", "changepoints")
    STAGES = ("interaction", "evaluation")
    OUTPUTS = ("report",)

    def __init__(self, namespace: str | None = None) -> None:
        super().__init__("evaluator", Config(), namespace)
        self._newest: dict[str, bytes] = {}
        self._accounts = Accounts()
        self._news = math.inf  # when something of scenarios came last
        self.create_timer(1.0, self._tell_missing)

    def started(self) -> None:
        """Listen to scenarios so that who paces them waits for this node."""
        self._accounts = Accounts(self.config.keep)
        for topic in SCENARIOS:
            self.listen(topic, MANY_HEARD)

    def received(self, topic: str, data: bytes) -> None:
        """Keep what comes, and evaluate a request when all of it is there."""
        if topic == "scenarios":
            self._keep(self._accounts.scenario(digest(data), data))
        elif topic == "scenarios/info":
            for status in decode_diagnostics(data)[1]:
                self._keep(self._accounts.tell(status, f"{topic}, {status.name}"))
        else:
            self._newest[topic] = data
        self._news = monotonic()
        self._give_up()
        if not {"tracks", "changepoints"} <= set(self._newest):
            return
        for request, account in list(self._accounts.open.items()):
            if account.whole:
                self._accounts.forget(request)
                self._submit(dict(self._newest), account)

    def _keep(self, match: Match | None) -> None:
        if match is not None:
            account, entry, data = match
            account.keep(entry, data, self.config.seed, self.config.measured)

    def _give_up(self) -> None:
        """Forget the oldest requests while more of them wait, or more scenarios of them are there, than are kept."""
        accounts = self._accounts.open
        closed = [request for request, account in accounts.items() if account.closing]
        for request in closed[: max(0, len(closed) - self.config.wait)]:
            self._forget(request)
        while len(accounts) > 1 and sum(len(account.kept) for account in accounts.values()) > self.config.keep:
            self._forget(next(iter(accounts)))

    def _forget(self, request: str) -> None:
        """Give up a request, and say what of it has not come."""
        said = self._accounts.open[request].sentence()
        self._accounts.forget(request)
        self.status(Level.WARN, f"{said}; it is not evaluated; see keep and wait", "requests", request=request)

    def _tell_missing(self) -> None:
        """Say what has not come of closed requests, once all is quiet."""
        if monotonic() - self._news < SETTLED or not self.active:
            return
        self._news = math.inf
        for account in self._accounts.incomplete(closed=True):
            why = "they were lost, or published before this node listened; it is not evaluated without them"
            self.status(Level.WARN, f"{account.sentence()}: {why}", "requests", missing=str(account.missing))

    def _submit(self, messages: Mapping[str, bytes], account: Account) -> None:
        name, status = f"request {account.request}", account.closing
        if status is None or "cancelled" in status.values:
            return
        scenarios = account.in_order()
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
        published, statuses = count_in(status.values, "published", told), []
        chosen = f"measured on {len(decoded)} of {published} scenarios, chosen by seed {self.config.seed}"
        for row in evaluation.rows:
            figures = {key: repr(entry.value) for key, entry in row.values.items() if math.isfinite(entry.value)}
            values = {"request": status.values["request"], "samples": str(row.samples), **figures}
            notes = (*row.notes, chosen) if row.name == WITH and len(decoded) < published else row.notes
            statuses.append(Status(f"{self.get_fully_qualified_name()}: {row.name}", Level.OK, "; ".join(notes), values))
        self.send("report", encode_diagnostics(statuses, encounter.start_ns))
        self.health.settle("requests")
        self.get_logger().info(f"request {status.values['request']} evaluated: {len(decoded)} scenarios")


def main() -> None:
    """Run the node."""
    sys.exit(run_nodes(Evaluator))
