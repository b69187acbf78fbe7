# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Topics: message classes by name, qualities of service, and a node's publishers with their pace.

A publisher stores as many messages as its depth. A message that it drops before a subscriber has
it is lost silently. A subscriber that keeps all messages acknowledges one only when it has room
(Fast DDS: 5000 messages a topic), so a publisher that waits for acknowledgements adapts to its
slowest subscriber.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
import importlib
import threading
from time import monotonic, sleep
from typing import Any

from rclpy.duration import Duration
from rclpy.exceptions import InvalidHandle
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSPolicyKind, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions

from msg_conventions.diagnostics import Level
from msg_conventions.topics import topic_entry
from scenario_gen.base.errors import InputError
from scenario_gen.base.worker import stop_if_abandoned
from scenario_gen.types import Quality

OVERRIDABLE = (
    QoSPolicyKind.HISTORY,
    QoSPolicyKind.DEPTH,
    QoSPolicyKind.RELIABILITY,
    QoSPolicyKind.DURABILITY,
)
FIXED_QUALITY = ("/diagnostics", "/tf")  # as other packages expect them
UNKNOWN_NODE = "_NODE_NAME_UNKNOWN_"  # of rmw
POLL_S = 0.002  # between two checks for acknowledgements


def message_class(kind: str) -> Any:
    """Return the class of e.g. `nav_msgs/msg/Path`.

    Raises:
        InputError: the package is not installed or has no such type.
    """
    package, _, name = kind.partition("/msg/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError, ValueError, TypeError):  # TypeError: an empty type
        raise InputError(
            f"message type {kind} is not installed; source the workspace that has "
            f"{package or 'it'}"
        ) from None


def qos(quality: Quality) -> QoSProfile:
    """Return the QoS profile of a quality."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_ALL if quality.keep_all else HistoryPolicy.KEEP_LAST,
        depth=quality.depth,
        reliability=ReliabilityPolicy.RELIABLE
        if quality.reliable
        else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL
        if quality.transient_local
        else DurabilityPolicy.VOLATILE,
    )


def adapted_quality(topic: str, offers: Sequence[QoSProfile]) -> tuple[Quality, Quality]:
    """Return the quality for a subscription that suits every publisher, and the one for a replay.

    A subscription to the suite's own topics keeps all messages (DDS holds 5000), so that paced
    publishers wait for the recorder. Other messages may be large, so only the newest are kept.
    Discovery does not always report a publisher's depth; then the depth of the topic counts.
    """
    reliable = all(offer.reliability == ReliabilityPolicy.RELIABLE for offer in offers)
    transient_local = all(offer.durability == DurabilityPolicy.TRANSIENT_LOCAL for offer in offers)
    offered_depth = max(offer.depth for offer in offers)
    declared = None
    with suppress(KeyError):
        declared = topic_entry(topic)[1]
    subscribed = Quality(
        max(1000, offered_depth),
        reliable,
        transient_local,
        keep_all=reliable and declared is not None,
    )
    replay_depth = offered_depth or (declared.depth if declared else 1)
    return subscribed, Quality(replay_depth, reliable, transient_local)


def create_publisher(node: Node, topic: str) -> Any:
    """Return a publisher of one of the suite's topics.

    Parameters can override its quality: `qos_overrides./topic.publisher.reliability`,
    `durability`, `depth`, `history`.
    """
    kind, quality = topic_entry(topic)
    options = None if topic in FIXED_QUALITY else QoSOverridingOptions(OVERRIDABLE)
    return node.create_publisher(
        message_class(kind), topic, qos(quality), qos_overriding_options=options
    )


def create_frames_publisher(node: Node) -> Any:
    """Return a publisher of /tf, or None, which is logged, if tf2_msgs is not installed."""
    try:
        return create_publisher(node, "/tf")
    except InputError as error:
        node.get_logger().info(f"no frames are published on /tf: {error}", once=True)
        return None


def create_subscription(
    node: Node, topic: str, callback: Callable[..., None], quality: Quality | None = None
) -> Any:
    """Subscribe, raw, to one of the suite's topics, with its declared quality or another one."""
    kind, declared = topic_entry(topic)
    return node.create_subscription(
        message_class(kind), topic, callback, qos(quality or declared), raw=True
    )


def publish(node: Node, publisher: Any, data: Any) -> None:
    """Publish a message or its CDR bytes from any thread.

    Nothing is published if the publisher is None or the node has ended.
    """
    try:
        if publisher is not None and node.context.ok():
            publisher.publish(data)
    except InvalidHandle:
        return  # the publisher was destroyed meanwhile
    except RuntimeError:  # rcl's
        if node.context.ok():
            raise


class Outputs:
    """The publishers of one node, which publish while it is active.

    Nothing is published after `deactivate` has returned, even by jobs that still run.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._publishers: dict[str, Any] = {}
        self._lock = threading.RLock()
        self._active = False
        self._paces: dict[str, Pace] = {}
        self._pacing_count = 0  # threads inside `paced`

    def activate(self) -> None:
        """Publish from now on."""
        self._active = True

    def deactivate(self) -> None:
        """Publish no more."""
        with self._lock:
            self._active = False

    def advertise(self, topic: str) -> None:
        """Create the publisher of one of the suite's topics.

        Raises:
            CancelledError: on the thread of an abandoned job.
        """
        with self._lock:
            stop_if_abandoned()
            if topic not in self._publishers:
                self._publishers[topic] = create_publisher(self._node, topic)

    def send(self, topic: str, data: bytes) -> None:
        """Publish CDR bytes on one of the suite's topics, if the node is active.

        Raises:
            CancelledError: on the thread of an abandoned job.
        """
        with self._lock:
            stop_if_abandoned()
            if self._active:
                self.advertise(topic)
                publish(self._node, self._publishers[topic], data)

    def publish(self, publisher: Any, data: bytes) -> None:
        """Publish CDR bytes with another publisher of the node, if the node is active.

        Raises:
            CancelledError: on the thread of an abandoned job.
        """
        with self._lock:
            stop_if_abandoned()
            if self._active:
                publish(self._node, publisher, data)

    @contextmanager
    def paced(
        self, topics: Iterable[str], patience: float, report: Callable[[str, int], None]
    ) -> Iterator[None]:
        """Let `send_paced` pace these topics inside.

        `report` gets the topic and the report of its `Pace`.

        Several threads may pace the same topics; they share the paces of the first thread.
        """
        topics = tuple(topics)
        with self._lock:
            for topic in topics:
                self.advertise(topic)
                if topic not in self._paces:
                    publisher = self._publishers[topic]
                    self._paces[topic] = Pace(publisher, patience, partial(report, topic))
            self._pacing_count += 1
        try:
            yield
        finally:
            with self._lock:
                self._pacing_count -= 1
                for topic in list(self._paces) if self._pacing_count == 0 else ():
                    self._paces.pop(topic).end()

    def send_paced(self, topic: str, data: bytes, stop: Callable[[], bool]) -> None:
        """Publish as `send` does; on a paced topic once its subscribers have room.

        A `stop` that returns True ends the wait.

        After the last of the topics that are paced together, the executor gets a turn, so that
        nodes in this process can receive. Must not be called on the executor's thread.

        Raises:
            CancelledError: on the thread of an abandoned job.
        """
        if topic in self._paces:
            self._paces[topic].wait(lambda: stop() or not self._active)
            if topic == next(reversed(self._paces)):
                yield_to_executor(self._node.executor, lambda: stop() or not self._active)
        self.send(topic, data)

    def destroy(self) -> None:
        """Destroy all publishers with their latched messages."""
        for topic in list(self._publishers):
            self.withdraw(topic)

    def withdraw(self, topic: str) -> None:
        """Destroy the publisher of a topic, if there is one, with its latched messages."""
        with self._lock:
            if topic in self._publishers:
                self._node.destroy_publisher(self._publishers.pop(topic))


class Pace:
    """Limits the messages of one publisher that its subscribers may not have acknowledged yet."""

    def __init__(self, publisher: Any, patience: float, report: Callable[[int], None]) -> None:
        """Start with everything acknowledged.

        Args:
            publisher: of rclpy.
            patience: seconds without acknowledgement after which its subscribers are not waited
                for; 0: always wait.
            report: called with 0 when that happens, and when all is acknowledged again, or at
                `end`, with the number of messages that were published meanwhile.
        """
        self._publisher = publisher
        self._patience = patience
        self._report = report
        # Fast DDS asks for acknowledgements at once only when the history is full.
        self._max_pending = max(1, publisher.qos_profile.depth)
        self._pending = 0  # messages since the last acknowledgement, or the last vain wait
        self._next_wait_s = patience
        self._ignoring = False  # whether a subscriber is not waited for
        self._unacknowledged = 0

    def wait(self, stop: Callable[[], bool]) -> None:
        """Wait until one more message overwrites no pending one, or `stop` returns True."""
        if 8 * self._pending >= self._max_pending and self.is_acknowledged():
            self._restart()
        deadline = monotonic() + self._next_wait_s
        while self._pending >= self._max_pending and not stop():
            if self.is_acknowledged():
                self._restart()
            elif self._patience and monotonic() >= deadline:
                self._stop_waiting()
            else:
                sleep(POLL_S)
        if self._ignoring:
            self._unacknowledged += 1
            sleep(0.001)  # leaves time for other subscribers
        self._pending += 1

    def end(self) -> None:
        """Report messages that are still unacknowledged."""
        if self._ignoring:
            self._restart()

    def _stop_waiting(self) -> None:
        """Stop this wait, and halve the next one: all waits together take twice the patience."""
        self._pending = 0
        self._next_wait_s *= 0.5
        if not self._ignoring:
            self._ignoring = True
            self._report(0)

    def _restart(self) -> None:
        unacknowledged = self._unacknowledged if self._ignoring else None
        self._pending = 0
        self._unacknowledged = 0
        self._ignoring = False
        self._next_wait_s = self._patience
        if unacknowledged is not None:
            self._report(unacknowledged)

    def is_acknowledged(self) -> bool:
        """Return whether the subscribers have all messages."""
        with suppress(InvalidHandle):  # it was destroyed meanwhile
            return bool(self._publisher.wait_for_all_acked(Duration()))
        return True


def publishing_nodes(node: Node, topic: str) -> list[str]:
    """Return the full names of the nodes that publish a topic, one for each publisher.

    A new publisher is discovered before the name of its node, and left out until then.
    """
    return sorted(
        f"{info.node_namespace.rstrip('/')}/{info.node_name}"
        for info in node.get_publishers_info_by_topic(topic)
        if info.node_name != UNKNOWN_NODE
    )


def other_publishers(node: Node, topic: str) -> list[str]:
    """Return the full names of other nodes that publish a topic.

    They include another node with the same name.
    """
    names = publishing_nodes(node, topic)
    with suppress(ValueError):
        names.remove(node.get_fully_qualified_name())
    return names


def yield_to_executor(executor: Executor | None, stop: Callable[[], bool]) -> None:
    """Wait until an executor with several nodes has completed one round.

    Each subscription receives a message in it.

    Otherwise the calling worker could outrun the executor's thread without end.
    """
    if executor is None or len(executor.get_nodes()) < 2:
        return
    completed = threading.Event()
    executor.create_task(completed.set)
    while not completed.wait(POLL_S) and not stop():
        pass


def report_pace(node: Any, topic: str, count: int, **values: str) -> None:
    """Warn on /diagnostics of what a `Pace` reports of a topic, with further values.

    A subscriber is not waited for, or may lack `count` messages.
    """
    name = node.resolve_topic_name(topic)
    message = f"a subscriber of {name} acknowledges nothing; it is not waited for any more"
    if count:
        message = (
            f"{count} messages of {name} were published without acknowledgement, "
            "a subscriber may lack them"
        )
    subscribers = sorted({info.node_name for info in node.get_subscriptions_info_by_topic(name)})
    message += (
        f" (subscribers: {', '.join(subscribers) or 'none any more'}); end the subscriber "
        "that hangs, or raise patience; a new subscriber gets the last 1000"
    )
    values["count"] = str(count)
    node.diagnostics.status(Level.WARN, message, f"pace of {topic}", values)
