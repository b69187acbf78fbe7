# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Topics: message classes by name, qualities of service, and a node's publishers with their pace.

A publisher remembers as many messages as its depth says; what it forgets before a subscriber has it is lost, in silence. A reader
that keeps all acknowledges a message only where it has room for it (Fast DDS: 5000 of a topic), so whoever waits for
acknowledgements goes no faster than its subscribers.
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
OWN_QUALITY = ("/diagnostics", "/tf")  # as others expect them
SHARED = (
    "/diagnostics",
    "/rosout",
    "/parameter_events",
    "/tf",
    "/tf_static",
    "/clock",
    "/footprint",
    "/transition_event",
)
"""How the names of topics end that many nodes publish."""
DEPTH = 1000  # messages that a subscription holds at least
POLL_S = 0.002  # seconds between two looks for acknowledgements
PER_MESSAGE_S = 0.001  # seconds for each message while a subscriber is not waited for: for the sake of the others


def message_class(kind: str) -> Any:
    """Return the class of e.g. `nav_msgs/msg/Path`.

    Raises:
        InputError: the package is not installed or has no such type.
    """
    package, _, name = kind.partition("/msg/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError, ValueError, TypeError):  # TypeError: a topic of no type
        raise InputError(
            f"message type {kind} is not installed; source the workspace that has {package or 'it'}"
        ) from None


def qos(quality: Quality) -> QoSProfile:
    """Return the profile of a topic."""
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
    """Return the quality to subscribe with, which suits every publisher, and the one to offer at replay.

    Of the suite's own topics all is kept (DDS holds 5000 messages), so that publishers that pace themselves wait for the
    recorder; other messages may be of any size, and the newest are kept.

    Discovery does not always tell a publisher's depth; then it is that of the topic's kind.
    """
    reliable = all(offer.reliability == ReliabilityPolicy.RELIABLE for offer in offers)
    transient_local = all(offer.durability == DurabilityPolicy.TRANSIENT_LOCAL for offer in offers)
    offered = max(offer.depth for offer in offers)
    own = None
    with suppress(KeyError):
        own = topic_entry(topic)[1]
    subscribed = Quality(
        max(DEPTH, offered), reliable, transient_local, keep_all=reliable and own is not None
    )
    return subscribed, Quality(offered or (own.depth if own else 1), reliable, transient_local)


def create_publisher(node: Node, topic: str, name: str = "") -> Any:
    """Return a publisher of a topic of the suite, as `name` if that is another.

    Its quality can be overridden: `qos_overrides./topic.publisher.reliability`, `durability`, `depth`, `history`.
    """
    kind, quality = topic_entry(topic)
    options = None if topic in OWN_QUALITY else QoSOverridingOptions(OVERRIDABLE)
    return node.create_publisher(
        message_class(kind), name or topic, qos(quality), qos_overriding_options=options
    )


def create_frames_publisher(node: Node) -> Any:
    """Return a publisher of /tf; None, which is said once, where tf2_msgs is not installed."""
    try:
        return create_publisher(node, "/tf")
    except InputError as error:
        node.get_logger().warning(f"no frames are published on /tf: {error}", once=True)
        return None


def create_subscription(
    node: Node, topic: str, callback: Callable[..., None], quality: Quality | None = None
) -> Any:
    """Subscribe, raw, to a topic of the suite, with its own quality of service or another."""
    kind, own = topic_entry(topic)
    return node.create_subscription(
        message_class(kind), topic, callback, qos(quality or own), raw=True
    )


def publish(node: Node, publisher: Any, data: bytes) -> None:
    """Publish CDR bytes from any thread, if there is a publisher; no error if a signal has ended the node or its context."""
    try:
        if publisher is not None and node.context.ok():
            publisher.publish(data)
    except InvalidHandle:
        return  # the publisher was destroyed meanwhile
    except RuntimeError:  # of rcl
        if node.context.ok():
            raise


class Outputs:
    """The publishers of one node, which publish while it is active.

    A message is published whole or not at all: once `deactivate` has returned nothing more is, whatever still runs.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._publishers: dict[str, Any] = {}
        self._lock = threading.RLock()
        self._active = False
        self._paces: dict[str, Pace] = {}
        self._pacing = 0  # threads that do

    def activate(self) -> None:
        """Publish from now on."""
        self._active = True

    def deactivate(self) -> None:
        """Publish no more."""
        with self._lock:
            self._active = False

    def advertise(self, topic: str) -> None:
        """Offer a topic of the suite.

        Raises:
            CancelledError: on the thread of a job that was abandoned.
        """
        with self._lock:
            stop_if_abandoned()
            if topic not in self._publishers:
                self._publishers[topic] = create_publisher(self._node, topic)

    def send(self, topic: str, data: bytes) -> None:
        """Publish the CDR bytes of a topic of the suite, if the node is active.

        Raises:
            CancelledError: on the thread of a job that was abandoned.
        """
        with self._lock:
            stop_if_abandoned()
            if self._active:
                self.advertise(topic)
                publish(self._node, self._publishers[topic], data)

    def publish(self, publisher: Any, data: bytes) -> None:
        """Publish the CDR bytes of any other publisher of the node, if it is active.

        Raises:
            CancelledError: on the thread of a job that was abandoned.
        """
        with self._lock:
            stop_if_abandoned()
            if self._active:
                publish(self._node, publisher, data)

    @contextmanager
    def paced(
        self, topics: Iterable[str], patience: float, report: Callable[[str, int], None]
    ) -> Iterator[None]:
        """Let `send_paced` pace these topics inside; `report` is called with the topic and what its `Pace` reports.

        Several threads may pace the same topics, by one pace for each topic: that of the first one.
        """
        topics = tuple(topics)
        with self._lock:
            for topic in topics:
                self.advertise(topic)
                publisher = self._publishers[topic]
                if topic not in self._paces:
                    self._paces[topic] = Pace(
                        publisher, publisher.qos_profile.depth, patience, partial(report, topic)
                    )
            self._pacing += 1
        try:
            yield
        finally:
            with self._lock:
                self._pacing -= 1
                for topic in topics if self._pacing == 0 else ():
                    self._paces.pop(topic).end()

    def send_paced(self, topic: str, data: bytes, stop: Callable[[], bool]) -> None:
        """Publish as `send` does; on a topic that is paced, once its subscribers have room, or `stop` says so.

        Topics that are paced together take turns: on the last of them nodes of the same process are let take, too.
        Not to be called on the executor's thread.

        Raises:
            CancelledError: on the thread of a job that was abandoned.
        """
        if topic in self._paces:
            self._paces[topic].wait(lambda: stop() or not self._active)
            if topic == next(reversed(self._paces)):
                let_others_take(self._node.executor, lambda: stop() or not self._active)
        self.send(topic, data)

    def destroy(self) -> None:
        """Destroy all publishers, and with them what late joiners would have got."""
        with self._lock:
            for topic in list(self._publishers):
                self._node.destroy_publisher(self._publishers.pop(topic))


class Pace:
    """Counts what one publisher's subscribers may not have acknowledged yet."""

    def __init__(
        self, publisher: Any, depth: int, patience: float, report: Callable[[int], None]
    ) -> None:
        """Begin.

        Args:
            publisher: of rclpy.
            depth: messages that it remembers.
            patience: seconds without acknowledgement after which its subscribers are not waited for; 0: always wait.
            report: called when that happens with 0, and when all is acknowledged again, or at `end`, with the number of
                messages that were published meanwhile.
        """
        self._publisher, self._patience, self._report = publisher, patience, report
        self._most = max(1, depth * 9 // 10)
        self._open = 0  # messages since everything was acknowledged, or was waited for in vain
        self._left = patience  # seconds that the next wait may take
        self._alone = False  # a subscriber is not waited for
        self._unacknowledged = 0

    def wait(self, stop: Callable[[], bool]) -> None:
        """Wait until one message more overwrites none that is on its way, or `stop` says so."""
        if 8 * self._open >= self._most and self._acknowledged():
            self._done()
        deadline = monotonic() + self._left
        while self._open >= self._most and not stop():
            if self._acknowledged():
                self._done()
            elif self._patience and monotonic() >= deadline:
                self._go_on()
            else:
                sleep(POLL_S)
        if self._alone:
            self._unacknowledged += 1
            sleep(PER_MESSAGE_S)
        self._open += 1

    def end(self) -> None:
        """Say what is still unacknowledged of what was not waited for."""
        if self._alone:
            self._done()

    def _go_on(self) -> None:
        """Wait no more for now, and half as long the next time: twice `patience` in all."""
        self._open, self._left = 0, 0.5 * self._left
        if not self._alone:
            self._alone = True
            self._report(0)

    def _done(self) -> None:
        unacknowledged, alone = self._unacknowledged, self._alone
        self._open, self._unacknowledged, self._alone, self._left = 0, 0, False, self._patience
        if alone:
            self._report(unacknowledged)

    def _acknowledged(self) -> bool:
        with suppress(InvalidHandle):  # it was destroyed meanwhile
            return bool(self._publisher.wait_for_all_acked(Duration()))
        return True


def own_topics(node: Node) -> list[str]:
    """Return the full names of the topics that a node publishes and that are meant for one publisher."""
    names = {publisher.topic_name for publisher in list(node.publishers)}
    return sorted(name for name in names if not name.endswith(SHARED))


def others_on(node: Node, topic: str) -> list[str]:
    """Return the full names of other nodes that publish a topic; the node's own if there is another one of that name.

    The log player and the segmenter share `tracks`: one plays a log, the other publishes what streams have brought.
    """
    names = [
        f"{info.node_namespace.rstrip('/')}/{info.node_name}"
        for info in node.get_publishers_info_by_topic(topic)
    ]
    own = node.get_fully_qualified_name()
    if own in names:
        names.remove(own)
    partner = {"log_player": "segmenter", "segmenter": "log_player"}.get(node.get_name())
    return sorted(
        name
        for name in names
        if not (topic.endswith("/tracks") and name.rpartition("/")[2] == partner)
    )


def let_others_take(executor: Executor | None, stop: Callable[[], bool]) -> None:
    """Wait until the executor has gone round once, where it serves other nodes, too: each subscription takes a message then.

    In one process the worker would else outrun the executor's thread without end. Never called on that thread.
    """
    if executor is None or len(executor.get_nodes()) < 2:
        return
    turned = threading.Event()
    executor.create_task(turned.set)
    while not turned.wait(POLL_S) and not stop():
        pass


def unacknowledged(node: Node, topic: str, count: int) -> str:
    """Say in a sentence what `Pace` reported: that a topic's subscribers are not waited for any more, or what they may lack."""
    name = node.resolve_topic_name(topic)
    message = f"a subscriber of {name} acknowledges nothing; it is not waited for any more"
    if count:
        message = f"{count} messages of {name} were published without acknowledgement, a subscriber may lack them"
    who = (
        ", ".join(sorted({info.node_name for info in node.get_subscriptions_info_by_topic(name)}))
        or "none any more"
    )
    return f"{message} (subscribers: {who}); see which one hangs, or raise patience; who joins anew gets the last 1000"
