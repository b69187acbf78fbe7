# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A node's statuses on /diagnostics: all of them every second, and sooner after a change.

diagnostic_updater does the same, so diagnostic_aggregator considers no status stale, and late
subscribers have all statuses within a second. Nothing is latched, because an old error would look
new to a late aggregator. A finding that is over becomes OK, but not before aggregators, which
look once a second, could see it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
import threading
from time import monotonic
import traceback

from rclpy.node import Node

from msg_conventions.diagnostics import encode_diagnostics, Level, of_template, Status
from scenario_gen.base.errors import MAX_REFUSAL_CHARACTERS, presentable, ScenarioGenError
from scenario_gen.base.worker import stop_if_abandoned
from scenario_gen.ros.common.timers import create_steady_timer
from scenario_gen.ros.common.topics import create_publisher, publish

TICK_S = 0.25  # real time after which changes are published
FULL_PERIOD_STEPS = 4  # ticks after which all is published, changed or not
MIN_SHOWN_S = 3.0  # for which a finding is shown at least


@dataclass(frozen=True)
class _Entry:
    """A status, its time [s], its count in a row as a finding, and whether it is over."""

    status: Status
    since: float
    times: int = 1
    over: bool = False

    @property
    def is_finding(self) -> bool:
        return self.status.level is not Level.OK


class NodeDiagnostics:
    """The statuses of one node. Any thread may report; the node's executor publishes."""

    def __init__(
        self, node: Node, update: Callable[[], None] = lambda: None, *, enabled: bool = True
    ) -> None:
        """Report from now on.

        Args:
            node: whose statuses these are.
            update: called each second, to report the progress.
            enabled: see `enable`.
        """
        self._node = node
        self._update = update
        self._enabled = enabled
        self._entries: dict[str, _Entry] = {}
        self._lock = threading.RLock()
        self._state: Status | None = None  # lifecycle nodes have one
        self._changed = False
        self._unpublished: set[str] = set()  # names of findings that no message contains yet
        self._ticks = 0
        self._publisher = create_publisher(node, "/diagnostics")
        create_steady_timer(node, TICK_S, self._tick)

    def enable(self, enabled: bool) -> None:
        """Accept reports about the node's work, or drop them and all that were accepted."""
        with self._lock:
            self._enabled = enabled
            self._entries.clear()

    def state(self, message: str, **values: str) -> None:
        """Report the node's state.

        Changed values alone are published with the next full message.
        """
        with self._lock:
            old = self._state
            self._state = self._status("state", Level.OK, message, values)
            self._changed |= old is None or old.message != message

    def report(self, *statuses: Status, stamp_ns: int = 0) -> None:
        """Report statuses in place of all earlier ones of the same families.

        Raises:
            CancelledError: on the thread of an abandoned job.
        """
        with self._lock:
            stop_if_abandoned()
            names = {status.name for status in statuses}
            families = {family(status.name) for status in statuses}
            for name in list(self._entries):
                if family(name) in families and name not in names:
                    self._entries.pop(name)
            for status in statuses:
                self._add(of_template(status, stamp_ns) if stamp_ns else status)

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
        """Report one status and log it.

        Raises:
            CancelledError: on the thread of an abandoned job.
        """
        with self._lock:
            stop_if_abandoned()
            status = self._status(subject, level, message, values)
            self._add(of_template(status, stamp_ns) if stamp_ns else status)
        if not log:
            return
        logger = self._node.get_logger()
        # rclpy refuses different severities from one line.
        if level is Level.OK:
            logger.info(message)
        elif level is Level.WARN:
            logger.warning(message)
        else:
            logger.error(message)

    def failed(self, name: str, error: BaseException) -> None:
        """Report an error; the node continues.

        For a numbered job such as `get_plan 7` the subject is `get_plan`.
        """
        if not self._node.context.ok():
            return
        kind = type(error).__name__
        message = str(error)
        is_bug = not isinstance(error, ScenarioGenError)
        if is_bug:
            self._node.get_logger().error("".join(traceback.format_exception(error)))
            message = f"{kind}: {error}"
        subject, _, job = name.partition(" ")
        values = {"error": kind, "job": job} if job else {"error": kind}
        self.status(Level.ERROR, message, subject, values, log=not is_bug)

    def resolve(self, name: str) -> None:
        """Mark a finding as over: valid input has arrived, or a job of that name has succeeded."""
        subject = f"{self._node.get_fully_qualified_name()}: {name.partition(' ')[0]}"
        with self._lock:
            entry = self._entries.get(subject)
            if entry is not None and entry.is_finding:
                self._entries[subject] = replace(entry, over=True)

    def publish(self) -> None:
        """Publish all statuses, unless a simulated clock has no time yet to stamp them with."""
        now_ns = self._node.get_clock().now().nanoseconds
        if not now_ns:
            return
        with self._lock:
            statuses = [entry.status for entry in self._entries.values()]
            if self._state:
                statuses.insert(0, self._state)
            self._changed = False
            self._unpublished.clear()
        publish(self._node, self._publisher, encode_diagnostics(statuses, now_ns))

    def _status(
        self, subject: str, level: Level, message: str, values: Mapping[str, str]
    ) -> Status:
        name = f"{self._node.get_fully_qualified_name()}: {subject}"
        return Status(name, level, message, values)

    def _add(self, status: Status) -> None:
        if not self._enabled:
            return
        status = _presentable(status)
        old = self._entries.get(status.name)
        times = 1
        if status.level is Level.OK:
            self._changed |= old is None or old.status != status
        else:
            self._changed = True
            if old is not None and old.is_finding:
                times = old.times + 1
                status = _presentable(self._repeated(status, old.status, times))
            self._unpublished.add(status.name)
        self._entries[status.name] = _Entry(status, monotonic(), times)

    def _repeated(self, status: Status, old: Status, times: int) -> Status:
        """Return a finding with its count.

        It keeps the old message if no message contains that yet.
        """
        message = status.message
        if status.name in self._unpublished:
            message = old.message if message in old.message else f"{message}; {old.message}"
        return replace(status, message=message, values={**status.values, "times": str(times)})

    def _tick(self) -> None:
        """Publish changes, and every second all statuses after an update."""
        self._ticks += 1
        is_full = self._ticks % FULL_PERIOD_STEPS == 0
        if is_full:
            self._update()
            self._end_findings()
        if self._changed or is_full:
            self.publish()

    def _end_findings(self) -> None:
        """Set findings to OK that are over and were shown long enough."""
        with self._lock:
            for name, entry in self._entries.items():
                if not entry.over or monotonic() - entry.since < MIN_SHOWN_S:
                    continue
                values = dict(entry.status.values)
                values.pop("error", None)
                status = Status(name, Level.OK, f"over: {entry.status.message}", values)
                self._entries[name] = _Entry(status, monotonic())


def family(name: str) -> str:
    """Return the node and the first word of a status's subject.

    `/planner: fit` of `/planner: fit of 7`.
    """
    node, _, subject = name.partition(": ")
    return f"{node}: {subject.partition(' ')[0]}"


def _presentable(status: Status) -> Status:
    """Return a status whose message is printable and not too long."""
    return replace(status, message=presentable(status.message, MAX_REFUSAL_CHARACTERS))
