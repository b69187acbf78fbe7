# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""player: a bag's messages as they were recorded, raw; `~/pause` and `~/resume`.

It plays any rosbag2 bag, MCAP or SQLite.

Each topic has the quality of service of its recording, or the one that the parameters
`qos_overrides./topic.publisher.reliability` and its siblings set. With an offset, the earlier
messages of latched topics are published first. With `clock`, /clock has the bag's time for nodes
with `use_sim_time`, in place of the bag's own /clock. The player ends when all is played and
acknowledged, unless it is to `loop`, or to `stay` for late subscribers of latched topics.
"""

from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
import re
import threading
from time import monotonic
from typing import Any

from rclpy.duration import Duration
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node
from rclpy.qos_overriding_options import QoSOverridingOptions
from rosgraph_msgs.msg import Clock

from msg_conventions.diagnostics import Level
from msg_conventions.driving import encode_clock
from scenario_gen.bags.storage.bag import bag_topics, BagMessage, read_messages
from scenario_gen.bags.storage.config import BagConfig
from scenario_gen.bags.storage.mcap import BagTopic
from scenario_gen.base.errors import InputError, ScenarioGenError
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.ros.common.diagnostics import NodeDiagnostics
from scenario_gen.ros.common.ros_parameters import ConfigParameters
from scenario_gen.ros.common.services import offer_trigger
from scenario_gen.ros.common.topics import (
    acknowledgement_warning,
    message_class,
    OVERRIDABLE,
    Pace,
    publish,
    qos,
)

UNBOUNDED = BagConfig(most_bytes=2**62)  # messages are published and dropped: any size will do
END_PATIENCE_S = 5.0  # for subscribers to receive the last messages
TICK_S = 0.01  # between two clock messages


@dataclass(frozen=True)
class Config(Parameters):
    """The player's parameters."""

    bag: str = parameter("", "bag to play: its folder or one of its files", fixed=True)
    topics: str = parameter(
        ".*", "regular expression of the full names of the topics to play", fixed=True
    )
    rate: float = parameter(
        1.0, "how many times as fast as it was recorded", low=0.01, high=1000.0
    )
    start_offset: float = parameter(
        0.0, "time in the bag at which to begin", unit="s", low=0.0, fixed=True
    )
    loop: bool = parameter(False, "begin again at the end")
    stay: bool = parameter(
        False, "keep running at the end, so that late subscribers get latched topics"
    )
    paused: bool = parameter(False, "wait for ~/resume before the first message", fixed=True)
    clock: bool = parameter(False, "publish /clock", fixed=True)
    patience: float = parameter(
        60.0,
        "time without acknowledgement after which a subscriber is no longer waited for; 0: wait "
        "for ever",
        unit="s",
        low=0.0,
        fixed=True,
    )


@dataclass(frozen=True)
class Offered:
    """A topic of the bag that is played: its publisher, and that publisher's pace."""

    topic: BagTopic
    publisher: Any
    pace: Pace


class Player(Node):  # type: ignore[misc]
    """Plays one bag."""

    def __init__(self, namespace: str | None = None) -> None:
        super().__init__("player", namespace=namespace)
        self.parameters = ConfigParameters(self, Config())
        self.diagnostics = NodeDiagnostics(self, self._report_progress)
        self._elapsed: float | None = None  # seconds of the bag that have been played, while it is
        self.done = False
        self.exit_code = 0
        self._running = threading.Event()
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None
        self._offered: dict[str, Offered] = {}
        self._clock_publisher = None
        if self.parameters.config.clock:
            self._clock_publisher = self.create_publisher(Clock, "/clock", 10)
        offer_trigger(self, "~/pause", partial(self._set_running, running=False))
        offer_trigger(self, "~/resume", partial(self._set_running, running=True))

    def autostart(self) -> None:
        """Offer the bag's topics and begin.

        Raises:
            InputError: the bag cannot be read, or none of its topics can be played.
        """
        config: Config = self.parameters.config
        if not config.bag:
            raise InputError("parameter bag is empty; name the bag to play")
        for topic in bag_topics(Path(config.bag), UNBOUNDED):
            name = topic.name if topic.name.startswith("/") else f"/{topic.name}"
            if re.fullmatch(config.topics, name) and not (config.clock and name == "/clock"):
                self._offer(topic, name, config.patience)
        if not self._offered:
            raise InputError(
                f"{config.bag}: none of its topics can be played; see the messages above and the "
                "parameter topics"
            )
        if not config.paused:
            self._running.set()
        self._thread = threading.Thread(target=self._play, args=(config,), daemon=True)
        self._thread.start()

    def _offer(self, topic: BagTopic, name: str, patience: float) -> None:
        """Create the publisher of a topic; an unknown type is reported."""
        try:
            publisher = self.create_publisher(
                message_class(topic.type),
                name,
                qos(topic.quality),
                qos_overriding_options=QoSOverridingOptions(OVERRIDABLE),
            )
        except InputError as error:
            message = f"{name} is not played: {error}"
            self.diagnostics.status(Level.ERROR, message, "topics", {"error": "InputError"})
            return
        pace = Pace(publisher, patience, partial(self._report_pace, name))
        self._offered[topic.name] = Offered(topic, publisher, pace)

    def _play(self, config: Config) -> None:
        self._elapsed = config.start_offset
        try:
            while not self._ended.is_set():
                self._play_once(config)
                if not self.parameters.config.loop:
                    break
            if self._ended.is_set():
                return
            self._elapsed = None
            self.diagnostics.status(Level.OK, f"{config.bag}: played", "playing", {})
        except ScenarioGenError as error:
            self._elapsed = None
            self.exit_code = error.exit_code
            values = {"error": type(error).__name__}
            self.diagnostics.status(Level.ERROR, str(error), "playing", values)
        if not self.parameters.config.stay and not self._ended.is_set():
            self._end_when_acknowledged()

    def _wait_for_acknowledgement(self, publisher: Any, deadline: float) -> None:
        """Wait until the subscribers have all messages, the deadline [s] or the node's end."""
        while not publisher.wait_for_all_acked(Duration()):
            if monotonic() >= deadline or self._ended.wait(TICK_S):
                return

    def _end_when_acknowledged(self) -> None:
        """Let `run_nodes` end the node once the subscribers have all messages."""
        for offered in self._offered.values():
            offered.pace.end()
        deadline = monotonic() + END_PATIENCE_S
        with suppress(InvalidHandle):  # the node is ending already
            for offered in self._offered.values():
                self._wait_for_acknowledgement(offered.publisher, deadline)
        self.executor.create_task(self._finish)  # waking the executor alone has no effect

    def _finish(self) -> None:
        self.diagnostics.publish()  # the result
        self.done = True

    def _play_once(self, config: Config) -> None:
        first_ns: int | None = None
        elapsed = config.start_offset  # seconds of the bag that have been played
        for message in self._from_offset(config):
            if first_ns is None:
                first_ns = message.stamp_ns
            due = (message.stamp_ns - first_ns) * 1e-9 + config.start_offset
            elapsed = self._wait_until(due, elapsed, config, first_ns)
            if self._ended.is_set():
                return
            self._publish(message.topic, message.data)

    def _publish(self, topic: str, data: bytes) -> None:
        """Publish once no pending message is overwritten; this may slow the replay down."""
        offered = self._offered[topic]
        offered.pace.wait(self._ended.is_set)
        publish(self, offered.publisher, data)

    def _report_pace(self, topic: str, count: int) -> None:
        self.diagnostics.status(
            Level.WARN,
            acknowledgement_warning(self, topic, count),
            f"pace of {topic}",
            {"count": str(count)},
        )

    def _from_offset(self, config: Config) -> Iterator[BagMessage]:
        """Yield the messages after the offset.

        Publish the last ones of latched topics before it first.
        """
        latched: dict[str, deque[bytes]] = {}
        begin_ns: int | None = None
        for message in read_messages(
            Path(config.bag), lambda topic: topic in self._offered, UNBOUNDED
        ):
            if begin_ns is None:
                begin_ns = message.stamp_ns
            if message.stamp_ns - begin_ns < config.start_offset * 1e9:
                quality = self._offered[message.topic].topic.quality
                if quality.transient_local:
                    kept = latched.setdefault(message.topic, deque(maxlen=quality.depth))
                    kept.append(message.data)
                continue
            for topic in list(latched):
                for data in latched.pop(topic):
                    self._publish(topic, data)
            yield message

    def _wait_until(self, due: float, elapsed: float, config: Config, first_ns: int) -> float:
        """Let the bag's time run from `elapsed` to `due` [s], at `rate` and unless paused.

        Return the time reached.
        """
        while elapsed < due and not self._ended.is_set():
            self._elapsed = elapsed
            self._running.wait(TICK_S)
            started = monotonic()
            rate = self.parameters.config.rate
            if self._running.is_set():
                self._ended.wait(min(TICK_S, (due - elapsed) / rate))
                elapsed += (monotonic() - started) * rate
            self._publish_clock(first_ns + round((min(elapsed, due) - config.start_offset) * 1e9))
        self._running.wait()
        return max(elapsed, due) if elapsed < due + 1.0 else due

    def _report_progress(self) -> None:
        """Report the time in the bag, each second."""
        elapsed = self._elapsed
        if elapsed is None:
            return
        paused = "" if self._running.is_set() else ", paused"
        message = f"{self.parameters.config.bag}: {elapsed:.1f} s played{paused}"
        values = {"seconds": f"{elapsed:.1f}"}
        self.diagnostics.status(Level.OK, message, "playing", values, log=False)

    def _publish_clock(self, stamp_ns: int) -> None:
        if self._clock_publisher is not None:
            publish(self, self._clock_publisher, encode_clock(stamp_ns))

    def _set_running(self, *, running: bool) -> str:
        if running == self._running.is_set():
            raise InputError("it is so already")
        if running:
            self._running.set()
            return "playing"
        self._running.clear()
        return "paused"

    def destroy_node(self) -> None:
        """End playing, then the node."""
        self._ended.set()
        self._running.set()
        if self._thread is not None:
            self._thread.join(END_PATIENCE_S)  # its last reports need the node
        super().destroy_node()
