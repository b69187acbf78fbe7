# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What a node reports of itself on /diagnostics: its statuses by name, all of them every second, and soon when one changes.

That is how diagnostic_updater does it, so that diagnostic_aggregator takes no status for stale, and who comes late has all of
them within a second. Nothing is latched: an error of an hour ago would reach a late aggregator as news.

A finding that is over goes back to OK, but not before it could be seen: aggregators look once a second.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
import threading
from time import monotonic
import traceback

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from msg_conventions.diagnostics import encode_diagnostics, Level, of_template, Status
from scenario_gen.base.errors import LONGEST_REFUSAL, presentable, ScenarioGenError
from scenario_gen.base.worker import stop_if_abandoned
from scenario_gen.ros.common.topics import create_publisher, others_on, own_topics, publish

TICK_S = 0.25  # seconds of real time after which what has changed is published
TICKS = 4  # after so many all is published, changed or not
HOLD_S = 3.0  # seconds for which a finding is shown at least
MAX_STATUSES = 100  # statuses of a node
LARGEST = 65_536  # characters of the values of one status


@dataclass(frozen=True)
class _Entry:
    """A status, when it was reported, how often a finding was reported in a row, and whether it is over."""

    status: Status
    since: float
    times: int = 1
    over: bool = False

    @property
    def bad(self) -> bool:
        return self.status.level is not Level.OK


class NodeDiagnostics:
    """The statuses of one node, from any thread; its executor publishes them."""

    def __init__(
        self, node: Node, update: Callable[[], None] = lambda: None, *, enabled: bool = True
    ) -> None:
        """Report from now on; `update` is called each second, to bring what goes on up to date, `enabled` see `enable`."""
        self._node, self._update, self._enabled = node, update, enabled
        self._entries: dict[str, _Entry] = {}
        self._lock = threading.RLock()
        self._state: Status | None = None  # of nodes that have any
        self._changed = False
        self._fresh: set[str] = set()  # findings that no message has held yet, by name
        self._ticks = 0
        self._twins: dict[str, list[str]] = {}  # nodes that publish the same topics, by topic
        self._publisher = create_publisher(node, "/diagnostics")
        node.create_timer(TICK_S, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def enable(self, enabled: bool) -> None:
        """Take in what the node's work reports, or forget what it reported and take in no more, but the node's state."""
        with self._lock:
            self._enabled = enabled
            self._entries.clear()

    def state(self, message: str, **values: str) -> None:
        """Report in which state the node is; values that only tell how far something is wait for the next second."""
        with self._lock:
            old, self._state = self._state, self._status("state", Level.OK, message, values)
            self._changed |= old is None or old.message != message

    def report(self, *statuses: Status, stamp_ns: int = 0) -> None:
        """Keep statuses, and forget those of an earlier report about the same: names that begin with the same word.

        Raises:
            CancelledError: on the thread of a job that was abandoned.
        """
        with self._lock:
            stop_if_abandoned()
            names, families = (
                {status.name for status in statuses},
                {family(status.name) for status in statuses},
            )
            for name in [
                name for name in self._entries if family(name) in families and name not in names
            ]:
                self._entries.pop(name)
            for status in statuses:
                self._keep(of_template(status, stamp_ns) if stamp_ns else status)

    def status(
        self,
        level: Level,
        message: str,
        subject: str,
        values: Mapping[str, str],
        stamp_ns: int = 0,
        *,
        log: bool = True,
    ) -> None:
        """Keep one status and log it; an abandoned job ends here, before it is logged.

        Raises:
            CancelledError: on the thread of a job that was abandoned.
        """
        with self._lock:
            stop_if_abandoned()
            status = self._status(subject, level, message, values)
            self._keep(of_template(status, stamp_ns) if stamp_ns else status)
        if not log:
            return
        if (
            level is Level.OK
        ):  # a call of its own for each severity: rclpy refuses to change it between calls from one line
            self._node.get_logger().info(message)
        elif level is Level.WARN:
            self._node.get_logger().warning(message)
        else:
            self._node.get_logger().error(message)

    def failed(self, name: str, error: BaseException) -> None:
        """Report that something went wrong; of a numbered job, `get_plan 7`, the subject is `get_plan`. The node lives on."""
        if not self._node.context.ok():
            return
        kind, (subject, _, job) = type(error).__name__, name.partition(" ")
        message = str(error)
        if not isinstance(error, ScenarioGenError):
            self._node.get_logger().error("".join(traceback.format_exception(error)))
            message = f"{kind}: {error}"
        self.status(Level.ERROR, message, subject, {"error": kind} | ({"job": job} if job else {}))

    def resolve(self, name: str) -> None:
        """Mark what was wrong with something as over: good input has come, or a job of that name has been done."""
        subject = f"{self._node.get_fully_qualified_name()}: {name.partition(' ')[0]}"
        with self._lock:
            if (entry := self._entries.get(subject)) is not None and entry.bad:
                self._entries[subject] = replace(entry, over=True)

    def publish(self) -> None:
        """Publish all that is known now."""
        with self._lock:
            statuses = [
                *([self._state] if self._state else []),
                *(entry.status for entry in self._entries.values()),
            ]
            self._changed = False
            self._fresh.clear()
        publish(
            self._node,
            self._publisher,
            encode_diagnostics(statuses, self._node.get_clock().now().nanoseconds),
        )

    def _status(
        self, subject: str, level: Level, message: str, values: Mapping[str, str]
    ) -> Status:
        return Status(
            f"{self._node.get_fully_qualified_name()}: {subject}", level, message, values
        )

    def _keep(self, status: Status) -> None:
        """Take a status in."""
        if not self._enabled:
            return
        old, times = self._entries.get(status.name), 1
        if status.level is Level.OK:
            self._changed |= old is None or old.status != bounded(status)
        else:
            self._changed = True
            if old is not None and old.bad:
                times = old.times + 1
                status = replace(status, values={**status.values, "times": str(times)})
                if status.name in self._fresh:
                    known = status.message in old.status.message
                    status = replace(
                        status,
                        message=old.status.message
                        if known
                        else f"{status.message}; {old.status.message}",
                    )
            self._fresh.add(status.name)
        self._entries[status.name] = _Entry(bounded(status), monotonic(), times)
        while len(self._entries) > MAX_STATUSES:  # at first what is well
            first = next(iter(self._entries))
            self._entries.pop(
                next((name for name, entry in self._entries.items() if not entry.bad), first)
            )

    def _tick(self) -> None:
        """Every second bring all up to date, end what is over and was shown long enough, and publish; between, what changed."""
        self._ticks += 1
        if self._ticks % TICKS == 0:
            self._update()
            self._look_for_twins()
            with self._lock:
                for name, entry in self._entries.items():
                    if entry.over and monotonic() - entry.since >= HOLD_S:
                        values = {
                            key: value
                            for key, value in entry.status.values.items()
                            if key != "error"
                        }
                        status = Status(name, Level.OK, f"over: {entry.status.message}", values)
                        self._entries[name] = _Entry(status, monotonic())
        if self._changed or self._ticks % TICKS == 0:
            self.publish()

    def _look_for_twins(self) -> None:
        """Warn of other nodes that publish the node's own topics: who listens hears both and cannot tell them apart."""
        found = {
            topic: who for topic in own_topics(self._node) if (who := others_on(self._node, topic))
        }
        if found == self._twins:
            return
        self._twins = found
        if not found:
            self.resolve("twins")
            return
        said = "; ".join(
            f"{topic} is published by {' and '.join(who)}, too" for topic, who in found.items()
        )
        remedy = "who listens hears both: end one of the nodes, or give it another namespace"
        self.status(
            Level.WARN,
            f"{said}; {remedy}",
            "twins",
            {topic: " ".join(who) for topic, who in found.items()},
        )


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
    return Status(
        status.name[:LONGEST_REFUSAL],
        status.level,
        presentable(status.message, LONGEST_REFUSAL),
        values,
    )
