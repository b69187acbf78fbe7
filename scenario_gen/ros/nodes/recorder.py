# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""recorder: topics of any type, as raw CDR, to a bag; `~/start` and `~/stop` begin and end one.

Subscriptions adopt the publishers' quality of service, so latched messages are recorded late, too.
A message's log time is its arrival; with `use_sim_time` nothing is recorded before the first
/clock. `~/stop`, Ctrl-C and SIGTERM close the bag; a killed recorder
loses the messages of its last seconds. Messages that are not recorded are reported on the
terminal, on /diagnostics and in metadata.yaml. Existing files are never overwritten. On a full
disk the recording ends with an error on /diagnostics, and the written part stays readable.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
import re
from time import monotonic, time_ns
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.time import Time

from msg_conventions.diagnostics import Level, Subject
from scenario_gen.bags.recordings.message_loss import MessageLoss, TopicLoss
from scenario_gen.bags.storage.writer import BagWriter
from scenario_gen.base.errors import InputError, of_system
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.ros.common.diagnostics import NodeDiagnostics
from scenario_gen.ros.common.node_parameters import check_topics
from scenario_gen.ros.common.ros_parameters import ConfigParameters
from scenario_gen.ros.common.services import offer_trigger
from scenario_gen.ros.common.timers import create_steady_timer
from scenario_gen.ros.common.topics import adapted_quality, message_class, publishing_nodes, qos
from scenario_gen.ros.node_names import RECORDER_END_S

DRAIN_S = RECORDER_END_S - 5.0  # at most, at the end, for messages that have arrived
BATCH_MESSAGES = 50  # of one topic, before others have their turn
DOMAIN_TOPICS = r"diagnostics|clock|tf|tf_static"  # of a whole ROS domain, in any namespace
SUITE_TOPICS = (
    r"map|road/(entries|exits|lanes|markings)|"
    r"tracks|changepoints|posterior|fit(/info)?|vehicle_\w+/(route|footprint|fix|speed)"
    r"|ego/(start|goal|witness)|scenarios(/info)?|markers|report"
)


@dataclass(frozen=True)
class Config(Parameters):
    """The recorder's parameters."""

    bag: str = parameter(
        "", "folder of the bag; empty: wait for ~/start, and name the bag by the time", fixed=True
    )
    topics: str = parameter(
        "",
        "regular expression of the full names of the topics; empty: those in the node's "
        "namespace, /clock and /tf",
        fixed=True,
    )
    compress: bool = parameter(True, "compress chunks with zstd")

    def __post_init__(self) -> None:
        super().__post_init__()
        check_topics(self.topics)


def default_topics(namespace: str) -> str:
    """Return the expression of the suites' topics in a namespace and the domain's topics."""
    prefix = re.escape(namespace.rstrip("/"))
    return rf"{prefix}(/.*)?/({SUITE_TOPICS}|{DOMAIN_TOPICS})|/({DOMAIN_TOPICS})"


@contextmanager
def _disk_errors(
    advice: str = "; the bag can be read up to this point",
) -> Iterator[None]:
    """Turn OSErrors into InputErrors."""
    try:
        yield
    except OSError as error:
        raise of_system(error, advice=advice) from error


class Recorder(Node):  # type: ignore[misc]
    """Records the topics that match a parameter."""

    END_S = RECORDER_END_S

    def __init__(self, namespace: str | None = None) -> None:
        super().__init__("recorder", namespace=namespace)
        self.parameters = ConfigParameters(self, Config())
        self._bag: BagWriter | None = None
        self._listening: dict[str, Any] = {}
        self._refused: set[str] = set()
        offer_trigger(self, "~/start", self._start_now)
        offer_trigger(self, "~/stop", self._stop_now)
        create_steady_timer(self, 0.125, self._subscribe_to_new)
        create_steady_timer(self, 4.0, self._flush)  # writes incomplete chunks
        self._losses = MessageLoss(self.count_publishers)
        self._warned: dict[str, TopicLoss] = {}
        self.diagnostics = NodeDiagnostics(self, self._report_counts)

    def autostart(self) -> None:
        """Begin the bag named by the parameter."""
        if self.parameters.config.bag:
            self._start(Path(self.parameters.config.bag))
        else:
            self._report(Level.OK, "nothing is being recorded; ~/start begins a bag")

    def _start(self, folder: Path) -> None:
        with _disk_errors("; name another folder for the bag"):
            self._bag = BagWriter(folder, compress=self.parameters.config.compress)
        self._losses, self._warned = MessageLoss(self.count_publishers), {}
        waits = "" if self._has_time() else "; it begins with the first message on /clock"
        self._report(Level.OK, f"recording to {folder}{waits}")
        self._refused.clear()
        self.diagnostics.resolve("topics")
        self._subscribe_to_new()

    def stop(self, *, drain: bool = True) -> str:
        """Close the bag, if one is open; return its folder.

        Messages that have arrived are recorded first, unless `drain` is false.

        Raises:
            InputError: the disk is full, or fails.
        """
        if drain:
            self._drain()
        for topic in list(self._listening):
            self.destroy_subscription(self._listening.pop(topic))
        bag, self._bag = self._bag, None
        if bag is None:
            return ""
        lost = self._losses.summary(ended=True)
        bag.not_recorded = {topic: str(loss) for topic, loss in lost.items()}
        self._warn(lost)
        with _disk_errors():
            bag.close()
        self._report(Level.OK, f"{bag.folder} is closed")
        return str(bag.folder)

    def _report(
        self, level: Level, message: str, subject: str = "recording", **values: str
    ) -> None:
        self.diagnostics.status(level, message, subject, values)

    def _drain(self) -> None:
        """Record all messages that have arrived; their publishers consider them received."""
        deadline = monotonic() + DRAIN_S
        for topic in list(self._listening):
            while monotonic() < deadline and self._record_batch(topic):
                pass

    def _record_batch(self, topic: str) -> bool:
        """Record a batch of arrived messages; return whether there may be more.

        One message per round of the executor would take longer.
        """
        for _ in range(BATCH_MESSAGES):
            subscription = self._listening.get(topic)
            if subscription is None or self._bag is None:
                return False
            with subscription.handle:
                taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
            if taken is None:
                return False
            self._write(topic, taken[0], taken[1]["publication_sequence_number"])
        return True

    def close(self) -> None:
        """Close the bag, before the node is destroyed."""
        self.stop()
        self.diagnostics.publish()

    def _subscribe_to_new(self) -> None:
        """Subscribe to topics that are new."""
        if self._bag is None or not self._has_time():
            return
        wanted = re.compile(self.parameters.config.topics or default_topics(self.get_namespace()))
        for topic, kinds in self.get_topic_names_and_types():
            if (
                topic not in self._listening
                and topic not in self._refused
                and wanted.fullmatch(topic)
            ):
                self._listen(topic, kinds[0])

    def _has_time(self) -> bool:
        """Return whether the node's clock shows a time: a simulated one is 0 before /clock."""
        return bool(self.get_clock().now().nanoseconds)

    def _report_counts(self) -> None:
        """Report the recorded messages of each topic, and losses."""
        if self._bag is None:
            return
        counts = {topic.name: str(topic.count) for topic in self._bag.topics.values()}
        folder = str(self._bag.folder)
        self.diagnostics.status(Level.OK, folder, Subject.RECORDED, counts, log=False)
        lost = self._losses.summary()
        if lost:
            message = "; ".join(self._loss_message(topic, loss) for topic, loss in lost.items())
            texts = {topic: str(loss) for topic, loss in lost.items()}
            self.diagnostics.status(Level.WARN, message, "losses", texts, log=False)
        self._warn(lost)

    def _loss_message(self, topic: str, loss: TopicLoss) -> str:
        """Return the loss of a topic's messages with a remedy.

        Two publishers of one topic cause losses.
        """
        nodes = publishing_nodes(self, topic)
        if len(nodes) > 1:
            publishers = " and ".join(nodes)
            remedy_text = "end one of them, or give it another namespace"
            return f"{topic}: {loss}; {publishers} publish it: {remedy_text}"
        return f"{topic}: {loss}; {loss.remedy}"

    def _warn(self, lost: Mapping[str, TopicLoss]) -> None:
        """Log new losses."""
        for topic, loss in lost.items():
            if loss != self._warned.get(topic):
                self.get_logger().warning(self._loss_message(topic, loss))
        self._warned = dict(lost)

    def _flush(self) -> None:
        """Write the messages of the last seconds."""
        if self._bag is not None:
            with self._guarded():
                self._bag.flush()

    def _listen(self, topic: str, kind: str) -> None:
        publishers = self.get_publishers_info_by_topic(topic)
        if not publishers or self._bag is None:
            return
        quality, recorded = adapted_quality(
            topic, [publisher.qos_profile for publisher in publishers]
        )
        try:
            message = message_class(kind)
            self._bag.add_topic(topic, kind, recorded, str(publishers[0].topic_type_hash))
        except InputError as error:
            self._refused.add(topic)
            self._report(
                Level.ERROR, f"{topic} is not recorded: {error}", "topics", error="InputError"
            )
            return
        losses = self._losses
        losses.begin(topic, recorded)
        on_loss = SubscriptionEventCallbacks(
            message_lost=lambda event: losses.count_by_dds(topic, event.total_count)
        )

        def received(data: bytes, info: dict[str, Any]) -> None:  # rclpy counts the arguments
            self._write(topic, data, info["publication_sequence_number"])
            self._record_batch(topic)

        self._listening[topic] = self.create_subscription(
            message, topic, received, qos(quality), raw=True, event_callbacks=on_loss
        )

    def _write(self, topic: str, data: bytes, number: int | None) -> None:
        if self._bag is not None:
            now: Time = self.get_clock().now()
            with self._guarded():
                self._bag.write(topic, data, now.nanoseconds)
            self._losses.add(topic, data, number)

    @contextmanager
    def _guarded(self) -> Iterator[None]:
        """End the recording if the disk fails."""
        try:
            with _disk_errors():
                yield
        except InputError as error:
            self._give_up(error)

    def _give_up(self, error: InputError) -> None:
        """Report an error and stop recording; the node and others in its process continue."""
        self.stop(drain=False)  # nothing more is written to such a bag
        self._report(Level.ERROR, str(error), error="InputError")

    def _start_now(self) -> str:
        if self._bag is not None:
            raise InputError(f"{self._bag.folder} is being recorded; call ~/stop first")
        folder = Path(self.parameters.config.bag or f"bag_{time_ns() // 1_000_000}")
        self._start(folder)
        return str(folder)

    def _stop_now(self) -> str:
        if folder := self.stop():
            return folder
        raise InputError("nothing is being recorded")
