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

"""What a node says of itself on /diagnostics: its statuses by name, all of them every second, and at once when one changes.

That is how diagnostic_updater does it, so that diagnostic_aggregator takes what is said no more for stale, and who comes late
hears everything within a second. Nothing is latched: an error of an hour ago would reach a late aggregator as news.

A finding that is over goes back to OK, but not before it could be seen: aggregators look once a second.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
import threading
from time import monotonic
import traceback

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from msg_conventions.diagnostics import encode_diagnostics, Level, of_template, Status
from msg_conventions.topics import topic_entry
from scenario_gen.errors import printable, ScenarioGenError
from scenario_gen.nodes.publishing import publish
from scenario_gen.nodes.voice import qos
from scenario_gen.nodes.worker import stop_if_left_behind

PERIOD = 1.0  # seconds of real time between two messages
HOLD = 3.0  # seconds for which a finding is shown at least
AT_ONCE = 20  # messages a second beside the regular ones; what changes more often is said with the next
ALSO = 50  # findings of one name that a message says beside the newest
MOST = 100  # statuses of a node
LONGEST = 2_000  # characters of a message
LARGEST = 65_536  # characters of the values of one status


@dataclass(frozen=True)
class _Kept:
    """A status, when it was said, how often a finding was said in a row, and whether it is over."""

    status: Status
    since: float
    times: int = 1
    over: bool = False

    @property
    def bad(self) -> bool:
        return self.status.level is not Level.OK


class Health:
    """The statuses of one node."""

    def __init__(self, node: Node, before: Callable[[], None] = lambda: None, *, listening: bool = True) -> None:
        """Speak from now on; `before` is called each second, to bring what goes on up to date, `listening` see `listen`."""
        self._node, self._before, self._listening = node, before, listening
        self._kept: dict[str, _Kept] = {}
        self._one_at_a_time = threading.RLock()
        self._state: Status | None = None  # of nodes that have any
        self._news: dict[str, list[str]] = {}  # what was found since the last message, by name
        self._left, self._refilled = AT_ONCE, monotonic()
        self._due = False  # the regular message is being made
        quality = qos(topic_entry("/diagnostics")[1])
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", quality)
        node.create_timer(PERIOD, self._again, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def listen(self, *, to_work: bool) -> None:
        """Take in what the node's work has to say, or forget what it said and take in no more, but the node's state."""
        with self._one_at_a_time:
            self._listening = to_work
            self._kept.clear()
            self._news.clear()

    def state(self, message: str, **values: str) -> None:
        """Say in which state the node is; values that only tell how far something is wait for the next second."""
        with self._one_at_a_time:
            old, self._state = self._state, self._status("state", Level.OK, message, values)
            if old is None or old.message != message:
                self._now()

    def report(self, *statuses: Status, stamp_ns: int = 0) -> None:
        """Keep statuses, and forget those of an earlier report about the same: names that begin with the same word.

        Raises:
            CancelledError: on the thread of a job that was left behind.
        """
        with self._one_at_a_time:
            stop_if_left_behind()
            families = {family(status.name) for status in statuses}
            for name in [name for name in self._kept if family(name) in families]:
                if all(name != status.name for status in statuses):
                    self._kept.pop(name)
            changed = [self._keep(of_template(status, stamp_ns) if stamp_ns else status) for status in statuses]
            if any(changed):
                self._now()

    def say(
        self, level: Level, message: str, subject: str, values: Mapping[str, str], stamp_ns: int = 0, *, log: bool = True
    ) -> None:
        """Keep one status and log it; a job that was left behind ends here, before it is logged.

        Raises:
            CancelledError: on the thread of a job that was left behind.
        """
        with self._one_at_a_time:
            stop_if_left_behind()
            status = self._status(subject, level, message, values)
            if self._keep(of_template(status, stamp_ns) if stamp_ns else status):
                self._now()
        if not log:
            return
        if level is Level.OK:  # a call of its own for each severity: rclpy refuses to change it between calls from one line
            self._node.get_logger().info(message)
        elif level is Level.WARN:
            self._node.get_logger().warning(message)
        else:
            self._node.get_logger().error(message)

    def failed(self, name: str, error: BaseException) -> None:
        """Say that something went wrong; of a numbered job, `get_plan 7`, the subject is `get_plan`. The node lives on."""
        if not self._node.context.ok():
            return
        if not isinstance(error, ScenarioGenError):
            self._node.get_logger().error("".join(traceback.format_exception(error)))
        kind, (subject, _, job) = type(error).__name__, name.partition(" ")
        message = str(error) if isinstance(error, ScenarioGenError) else f"{kind}: {error}"
        self.say(Level.ERROR, message, subject, {"error": kind} | ({"job": job} if job else {}))

    def settle(self, name: str) -> None:
        """Say that what was wrong with something is over: good input has come, or a job of that name has been done."""
        subject = f"{self._node.get_fully_qualified_name()}: {name.partition(' ')[0]}"
        with self._one_at_a_time:
            if (kept := self._kept.get(subject)) is not None and kept.bad:
                self._kept[subject] = replace(kept, over=True)

    def _status(self, subject: str, level: Level, message: str, values: Mapping[str, str]) -> Status:
        return Status(f"{self._node.get_fully_qualified_name()}: {subject}", level, message, values)

    def _keep(self, status: Status) -> bool:
        """Take a status in; return whether it is news."""
        if not self._listening:
            return False
        status, old = bounded(status), self._kept.get(status.name)
        if status.level is Level.OK:
            self._kept[status.name] = _Kept(status, monotonic())
            news = old is None or old.status != status
        else:
            times = old.times + 1 if old is not None and old.bad else 1
            if times > 1:
                status = replace(status, values={**status.values, "times": str(times)})
            self._kept[status.name] = _Kept(status, monotonic(), times)
            found = self._news.setdefault(status.name, [])
            found.append(status.message)
            del found[: -ALSO - 1]
            news = True
        while len(self._kept) > MOST:  # at first what is well
            self._kept.pop(next((name for name, kept in self._kept.items() if not kept.bad), next(iter(self._kept))))
        return news

    def _now(self) -> None:
        if monotonic() - self._refilled >= PERIOD:
            self._left, self._refilled = AT_ONCE, monotonic()
        if self._left > 0 and not self._due:
            self._left -= 1
            self._publish()

    def _again(self) -> None:
        """End what is over and was shown long enough; say all."""
        self._due = True
        self._before()
        with self._one_at_a_time:
            self._due = False
            now = monotonic()
            for name, kept in self._kept.items():
                if kept.over and now - kept.since >= HOLD:
                    values = {key: value for key, value in kept.status.values.items() if key != "error"}
                    self._kept[name] = _Kept(Status(name, Level.OK, f"over: {kept.status.message}", values), now)
            self._publish()

    def _publish(self) -> None:
        """Publish all; findings of one name that no message has said yet are said beside the newest."""
        statuses = [self._state] if self._state else []
        for name, kept in self._kept.items():
            also = {f"also.{k}": message for k, message in enumerate(self._news.get(name, [])[: -1 if kept.bad else None])}
            statuses.append(bounded(replace(kept.status, values={**kept.status.values, **also})) if also else kept.status)
        self._news.clear()
        publish(self._node, self._publisher, encode_diagnostics(statuses, self._node.get_clock().now().nanoseconds))


def family(name: str) -> str:
    """Return node and first word of a status's name: `/planner: fit` of `/planner: fit of 7`."""
    node, _, subject = name.partition(": ")
    return f"{node}: {subject.partition(' ')[0]}"


def bounded(status: Status) -> Status:
    """Return a status of bounded size, all of which prints; values that are too many are counted."""
    left, values = LARGEST, dict[str, str]()
    for key, value in status.values.items():
        left -= len(key) + len(value)
        if left < 0:
            break
        values[key] = value
    if missing := len(status.values) - len(values):
        values["left_out"] = f"{missing} values, which would make the message too long"
    message = status.message if len(status.message) <= LONGEST else f"{status.message[:LONGEST]} …"
    return Status(status.name[:LONGEST], status.level, printable(message), values)
