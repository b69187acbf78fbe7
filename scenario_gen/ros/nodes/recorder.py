# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""recorder: any topics of any type, as raw CDR, to a bag; `~/start` and `~/stop` begin and end one.

What a publisher offers decides how it is subscribed, so latched topics are recorded from late on too. Messages are logged at the
time they arrive. The bag is closed on `~/stop`, on Ctrl-C and on SIGTERM; a killed recorder loses what came in its last seconds.
What is not recorded is said: on the terminal, on /diagnostics and in metadata.yaml. What is at the bag's place already is never
touched. Where the disk is full recording ends with an error on /diagnostics; what was written stays, for `scenario-gen reindex`.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
import re
import sys
from time import monotonic
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.time import Time

from msg_conventions.diagnostics import Level
from scenario_gen.bags.recordings.losses import Losses, remedy
from scenario_gen.bags.storage.metadata import qos_yaml
from scenario_gen.bags.storage.writer import BagWriter, Split
from scenario_gen.base.errors import InputError, of_system
from scenario_gen.ros.common.diagnostics import NodeDiagnostics
from scenario_gen.ros.common.node_parameters import RecorderParameters
from scenario_gen.ros.common.ros_parameters import ConfigParameters
from scenario_gen.ros.common.services import offer_trigger
from scenario_gen.ros.common.topics import adapted_quality, message_class, qos

REST_S = 30.0  # seconds that are taken at most, at the end, for what has arrived
AT_ONCE = 50  # messages of a topic, before others have their turn
HELD_S = 4.0  # seconds after which what came is written, whole chunk or not
OF_ALL = r"diagnostics|clock|tf|tf_static"  # of a whole ROS domain, whatever the namespace
OF_A_SUITE = (
    r"map|road/(entries|exits|info|lanes|markings)|"
    r"tracks|changepoints(/live)?|posterior|fit(/info)?|vehicle_\w+/(route|footprint|fix|speed)"
    r"|ego/(start|goal|witness)|scenarios(/info)?|markers|report"
)


def default_topics(namespace: str) -> str:
    """Return the regular expression of the topics of the suites in a namespace, and of what they share with all."""
    return rf"{re.escape(namespace.rstrip('/'))}(/.*)?/({OF_A_SUITE}|{OF_ALL})|/({OF_ALL})"


@dataclass(frozen=True)
class Config(RecorderParameters):
    """The recorder's parameters."""

    def __post_init__(self) -> None:
        super().__post_init__()
        try:
            re.compile(self.topics)
        except re.error as error:
            raise InputError(f"parameter topics is no regular expression: {error}") from None


@contextmanager
def _disk_errors(
    advice: str = "; `scenario-gen reindex` saves what is whole in the bag",
) -> Iterator[None]:
    """Turn the system's errors into ours."""
    try:
        yield
    except OSError as error:
        raise of_system(error, advice=advice) from error


class Recorder(Node):  # type: ignore[misc]
    """Records what matches."""

    END_S = REST_S + 5.0  # it writes what has arrived

    def __init__(self, namespace: str | None = None) -> None:
        super().__init__("recorder", namespace=namespace)
        self.parameters = ConfigParameters(self, Config())
        self._bag: BagWriter | None = None
        self._listening: dict[str, Any] = {}
        self._refused: set[str] = set()
        offer_trigger(self, "~/start", self._start_now)
        offer_trigger(self, "~/stop", self._stop_now)
        self.create_timer(0.1, self._look_around)
        self.create_timer(HELD_S, self._let_go)
        self._losses = Losses(self.count_publishers)
        self._warned: dict[str, str] = {}
        self.diagnostics = NodeDiagnostics(self, self._report_counts)
        self._report(Level.OK, "nothing is being recorded")

    def autostart(self) -> None:
        """Begin the bag that the parameter names."""
        if self.parameters.config.bag:
            self._start(Path(self.parameters.config.bag))

    def _start(self, folder: Path) -> None:
        config = self.parameters.config
        with _disk_errors("; name another folder for the bag"):
            self._bag = BagWriter(
                folder,
                compress=config.compress,
                split=Split(config.split_bytes, config.split_seconds),
            )
        self._losses, self._warned = Losses(self.count_publishers), {}
        self._report(Level.OK, f"recording to {folder}")
        self._refused.clear()
        self.diagnostics.resolve("topics")
        self._look_around()

    def stop(self, *, rest: bool = True) -> str:
        """Close the bag, if one is open, with the `rest` that has arrived; return its folder.

        Raises:
            InputError: the disk is full, or fails.
        """
        if rest:
            self._take_rest()
        for topic in list(self._listening):
            self.destroy_subscription(self._listening.pop(topic))
        bag, self._bag = self._bag, None
        if bag is None:
            return ""
        bag.info.not_recorded = dict(self._losses.summary(ended=True))
        self._warn(bag.info.not_recorded)
        with _disk_errors():
            bag.close()
        self._report(Level.OK, f"{bag.folder} is closed")
        return str(bag.folder)

    def _report(
        self, level: Level, message: str, subject: str = "recording", **values: str
    ) -> None:
        self.diagnostics.status(level, message, subject, values)

    def _take_rest(self) -> None:
        """Record what has arrived and waits to be taken; publishers believe that the recorder has it."""
        deadline = monotonic() + REST_S
        for topic in list(self._listening):
            while monotonic() < deadline and self._take_more(topic):
                pass

    def _take_more(self, topic: str) -> bool:
        """Record AT_ONCE messages that have arrived, cheaper than one a round of the executor; say whether there may be more."""
        for _ in range(AT_ONCE):
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
        """Close the bag; what else has to be done at the end may fail."""
        self.stop()
        self.diagnostics.publish()

    def _look_around(self) -> None:
        """Subscribe to topics that have come up since."""
        if self._bag is None:
            return
        wanted = re.compile(self.parameters.config.topics or default_topics(self.get_namespace()))
        for topic, kinds in self.get_topic_names_and_types():
            if (
                topic not in self._listening
                and topic not in self._refused
                and wanted.fullmatch(topic)
            ):
                self._listen(topic, kinds[0])

    def _report_counts(self) -> None:
        """Say on /diagnostics how many messages of each topic are in the bag."""
        if self._bag is not None:
            counts = {topic.name: str(topic.count) for topic in self._bag.info.topics}
            self.diagnostics.status(Level.OK, str(self._bag.folder), "recorded", counts, log=False)
            lost = self._losses.summary()
            if lost:
                message = "; ".join(self._blamed(topic, text) for topic, text in lost.items())
                self.diagnostics.status(Level.WARN, message, "losses", lost, log=False)
            self._warn(lost)

    def _blamed(self, topic: str, text: str) -> str:
        """Return what of a topic is not recorded, and what can be done: of two publishers one is to be ended."""
        infos = self.get_publishers_info_by_topic(topic) if self.context.ok() else []
        who = sorted(f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in infos)
        if len(who) > 1:
            return f"{topic}: {text}; {' and '.join(who)} publish it: end one of them, or give it another namespace"
        return f"{topic}: {text}; {remedy(text)}"

    def _warn(self, lost: Mapping[str, str]) -> None:
        """Say on the terminal what is new of what is not recorded."""
        for topic in lost:
            if lost[topic] != self._warned.get(topic):
                message = self._blamed(topic, lost[topic])
                if self.context.ok():
                    self.get_logger().warning(message)
                else:  # ended by a signal; /rosout is gone
                    print(f"[WARN] [{self.get_name()}]: {message}", file=sys.stderr, flush=True)
        self._warned = dict(lost)

    def _let_go(self) -> None:
        """Write what came in the last seconds."""
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
            self._bag.add_topic(
                topic, kind, qos_yaml(recorded), str(publishers[0].topic_type_hash)
            )
        except InputError as error:
            self._refused.add(topic)
            self._report(
                Level.ERROR, f"{topic} is not recorded: {error}", "topics", error="InputError"
            )
            return
        take, losses = partial(self._write, topic), self._losses
        losses.begin(topic, recorded)
        lost = SubscriptionEventCallbacks(
            message_lost=lambda event: losses.count_by_dds(topic, event.total_count)
        )

        def received(data: bytes, about: dict[str, Any]) -> None:  # rclpy counts the arguments
            take(data, about["publication_sequence_number"])
            self._take_more(topic)

        self._listening[topic] = self.create_subscription(
            message, topic, received, qos(quality), raw=True, event_callbacks=lost
        )

    def _write(self, topic: str, data: bytes, number: int | None) -> None:
        if self._bag is not None:
            now: Time = self.get_clock().now()
            with self._guarded():
                self._bag.write(topic, data, now.nanoseconds)
            self._losses.take(topic, data, number)

    @contextmanager
    def _guarded(self) -> Iterator[None]:
        """End the recording where the disk fails."""
        try:
            with _disk_errors():
                yield
        except InputError as error:
            self._give_up(error)

    def _give_up(self, error: InputError) -> None:
        """Say what is wrong and record no more; the node, and others in its process, live on."""
        self.stop(rest=False)  # nothing more is written to such a bag
        self._report(Level.ERROR, str(error), error="InputError")

    def _start_now(self) -> str:
        if self._bag is not None:
            raise InputError(f"{self._bag.folder} is being recorded; call ~/stop first")
        folder = Path(
            self.parameters.config.bag or f"bag_{self.get_clock().now().nanoseconds // 1_000_000}"
        )
        self._start(folder)
        return str(folder)

    def _stop_now(self) -> str:
        if folder := self.stop():
            return folder
        raise InputError("nothing is being recorded")
