# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""player: a bag's messages as they were recorded, raw.

It plays any rosbag2 bag, MCAP or SQLite. `~/pause_playing` and `~/resume_playing` stop the time in
the bag and let it pass.

Each topic has the quality of service of its recording, or the one that the parameters
`qos_overrides./topic.publisher.reliability` and its siblings set; the history of a volatile topic
is longer. Playing begins once the topics have subscribers, or after seconds without. With `clock`,
/clock has the bag's time for nodes with `use_sim_time`, also while the player is paused, in place
of the bag's own /clock. Messages that are late, by up to a second, are caught up with. The player
ends when all is played and acknowledged, unless it is to `loop`, or to `stay` for late subscribers
of latched topics.
"""

from collections import deque
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
import re
import threading
from time import monotonic, sleep
from typing import Any

from rclpy.node import Node
from rclpy.qos_overriding_options import QoSOverridingOptions
from rosgraph_msgs.msg import Clock

from msg_conventions.diagnostics import Level
from msg_conventions.driving import encode_clock
from scenario_gen.bags.storage.bag import open_bag, read_messages
from scenario_gen.bags.storage.config import BagConfig
from scenario_gen.bags.storage.messages import BagTopic
from scenario_gen.base.errors import InputError, ScenarioGenError
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.ros.common.bag_time import BagTime
from scenario_gen.ros.common.diagnostics import NodeDiagnostics
from scenario_gen.ros.common.ros_parameters import ConfigParameters
from scenario_gen.ros.common.services import offer_trigger
from scenario_gen.ros.common.timers import create_steady_timer
from scenario_gen.ros.common.topics import (
    message_class,
    OVERRIDABLE,
    Pace,
    publish,
    qos,
    report_pace,
)
from scenario_gen.types import Quality

UNBOUNDED = BagConfig(most_bytes=2**62)  # messages are published and dropped: any size will do
END_PATIENCE_S = 5.0  # for subscribers to receive the last messages
POLL_S = 0.01  # between two looks at subscribers
CLOCK_PERIOD_S = 0.025  # real time between two messages on /clock, as of rosbag2's player
MATCH_S = 1.0  # for the topics to get subscribers once one of them has one
FIRST_MATCH_S = 5.0  # for that first one
USUAL_DEPTH_COUNT = 10  # messages that a subscription stores if its node does not say more
BURST_S = 0.02  # in which a subscriber may not have taken any of them
MIN_ROUND_S = 1.0  # time of the bag between two rounds, for bags with a single stamp
# Fast DDS asks for acknowledgements every 3 s, or when a history is full: more than that.
MIN_HISTORY_COUNT = 1000


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
    loop: bool = parameter(False, "begin again at the end")
    stay: bool = parameter(
        False, "keep running at the end, so that late subscribers get latched topics"
    )
    paused: bool = parameter(
        False, "wait for ~/resume_playing before the first message", fixed=True
    )
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
    sent_at: deque[float]  # times of the last messages on the steady clock [s]

    @property
    def is_heard(self) -> bool:
        """Whether it has a subscriber."""
        return bool(self.publisher.get_subscription_count())


class Player(Node):  # type: ignore[misc]
    """Plays one bag."""

    def __init__(self, namespace: str | None = None) -> None:
        super().__init__("player", namespace=namespace)
        self.parameters = ConfigParameters(self, Config())
        self.diagnostics = NodeDiagnostics(self, self._report_progress)
        self.done = False
        self.exit_code = 0
        self._time = BagTime(lambda: self.parameters.config.rate)
        self._begin_ns: int | None = None  # stamp of the bag's first message
        self._is_over = False
        self._thread: threading.Thread | None = None
        self._offered: dict[str, Offered] = {}
        self._count = 0  # messages that were played
        self._burst_count = 0  # of those, ones that shallow subscriptions could miss
        self._unheard: set[str] = set()  # names in the bag of topics without a subscriber so far
        self._clock_publisher = None
        if self.parameters.config.clock:
            self._clock_publisher = self.create_publisher(Clock, "/clock", 10)
            create_steady_timer(self, CLOCK_PERIOD_S, self._publish_clock)
        offer_trigger(self, "~/pause_playing", partial(self._pause, paused=True))
        offer_trigger(self, "~/resume_playing", partial(self._pause, paused=False))

    def autostart(self) -> None:
        """Offer the bag's topics and begin.

        Raises:
            InputError: the bag cannot be read, or none of its topics can be played.
        """
        config: Config = self.parameters.config
        if not config.bag:
            raise InputError("parameter bag is empty; name the bag to play")
        with open_bag(Path(config.bag), UNBOUNDED) as bag:
            topics, missing = bag.topics(), bag.warnings()
        for warning in missing:
            self.diagnostics.status(Level.WARN, warning, "bag", {})
        for topic in topics:
            name = topic.name if topic.name.startswith("/") else f"/{topic.name}"
            if re.fullmatch(config.topics, name) and not (config.clock and name == "/clock"):
                self._offer(topic, name, config.patience)
        if not self._offered:
            raise InputError(
                f"{config.bag}: none of its topics can be played; see the messages above and the "
                "parameter topics"
            )
        self._unheard = set(self._offered)
        self._thread = threading.Thread(target=self._play, args=(config,), daemon=True)
        self._thread.start()

    def _offer(self, topic: BagTopic, name: str, patience: float) -> None:
        """Create the publisher of a topic; an unknown type is reported."""
        try:
            publisher = self.create_publisher(
                message_class(topic.type),
                name,
                qos(_played_quality(topic.quality)),
                qos_overriding_options=QoSOverridingOptions(OVERRIDABLE),
            )
        except InputError as error:
            message = f"{name} is not played: {error}"
            self.diagnostics.status(Level.ERROR, message, "topics", {"error": "InputError"})
            return
        pace = Pace(publisher, patience, partial(report_pace, self, name))
        self._offered[topic.name] = Offered(
            topic, publisher, pace, deque(maxlen=USUAL_DEPTH_COUNT)
        )

    def _play(self, config: Config) -> None:
        if not config.paused:
            self._wait_for_subscribers()
            self._time.pause(False)
        started = monotonic()
        try:
            while not self._time.ended:
                self._play_round(Path(config.bag))
                if not self.parameters.config.loop:
                    break
            if self._time.ended:
                return
            self._report_end(config.bag, monotonic() - started)
        except ScenarioGenError as error:
            self.exit_code = error.exit_code
            values = {"error": type(error).__name__}
            self.diagnostics.status(Level.ERROR, str(error), "playing", values)
        self._is_over = True
        if not self.parameters.config.stay and not self._time.ended:
            self._end_when_acknowledged()

    def _wait_for_subscribers(self) -> None:
        """Wait until each topic has a subscriber; volatile messages before that would be lost."""
        started = monotonic()
        while not self._time.ended:
            heard = [offered.is_heard for offered in self._offered.values()]
            patience = MATCH_S if any(heard) else FIRST_MATCH_S
            if all(heard) or monotonic() - started > patience:
                return
            sleep(POLL_S)

    def _report_end(self, bag: str, seconds: float) -> None:
        """Report how much was played in real time, and which topics nobody subscribed to."""
        unheard = sorted(self._unheard)
        message = f"{bag}: played, {self._count} messages in {seconds:.1f} s"
        if unheard:
            message += f"; without any subscriber: {', '.join(unheard)}"
        if self._burst_count:
            message += (
                f"; a subscriber of depth {USUAL_DEPTH_COUNT} could miss {self._burst_count} of "
                f"them, sent within {BURST_S} s of {USUAL_DEPTH_COUNT} others of their topic"
            )
        level = Level.WARN if len(unheard) == len(self._offered) else Level.OK
        self.diagnostics.status(level, message, "playing", {})

    def _wait_for_acknowledgement(self, pace: Pace, deadline: float) -> None:
        """Wait until the subscribers have all messages, the deadline [s] or the node's end."""
        while not (pace.is_acknowledged() or self._time.ended or monotonic() >= deadline):
            sleep(POLL_S)

    def _end_when_acknowledged(self) -> None:
        """Let `run_nodes` end the node once the subscribers have all messages."""
        deadline = monotonic() + END_PATIENCE_S
        for offered in self._offered.values():
            offered.pace.end()
            self._wait_for_acknowledgement(offered.pace, deadline)
        self.executor.create_task(self._finish)  # waking the executor alone has no effect

    def _finish(self) -> None:
        self.diagnostics.publish()  # the result
        self.done = True

    def _play_round(self, bag: Path) -> None:
        """Play the bag to its end, or to the node's end."""
        self._time.begin()
        for message in read_messages(bag, lambda topic: topic in self._offered, UNBOUNDED):
            if self._begin_ns is None:
                self._begin_ns = message.stamp_ns
            if not self._time.wait((message.stamp_ns - self._begin_ns) * 1e-9):
                return
            self._publish(message.topic, message.data)
        if self.parameters.config.loop:
            self._time.wait(MIN_ROUND_S)

    def _publish(self, topic: str, data: bytes) -> None:
        """Publish once no pending message is overwritten; this may slow the replay down."""
        offered = self._offered[topic]
        if topic in self._unheard and offered.is_heard:
            self._unheard.discard(topic)
        offered.pace.wait(lambda: self._time.ended)
        publish(self, offered.publisher, data)
        self._count += 1
        now = monotonic()
        is_full = len(offered.sent_at) == USUAL_DEPTH_COUNT
        self._burst_count += is_full and now - offered.sent_at[0] < BURST_S
        offered.sent_at.append(now)

    def _report_progress(self) -> None:
        """Report the time in the bag, each second."""
        if self._begin_ns is None or self._is_over:
            return
        elapsed = self._time.shown()
        paused = ", paused" if self._time.paused else ""
        message = f"{self.parameters.config.bag}: {elapsed:.1f} s played{paused}"
        values = {"seconds": f"{elapsed:.1f}"}
        self.diagnostics.status(Level.OK, message, "playing", values, log=False)

    def _publish_clock(self) -> None:
        """Publish the bag's time."""
        if self._begin_ns is not None:
            stamp_ns = self._begin_ns + round(self._time.shown() * 1e9)
            publish(self, self._clock_publisher, encode_clock(stamp_ns))

    def _pause(self, *, paused: bool) -> str:
        """Stop the time in the bag, or let it pass.

        Raises:
            InputError: it is so already.
        """
        state = "paused" if paused else "playing"
        if paused == self._time.paused:
            raise InputError(f"it is {state} already")
        self._time.pause(paused)
        return state

    def destroy_node(self) -> None:
        """End playing, then the node."""
        self._time.end()
        if self._thread is not None:
            self._thread.join(END_PATIENCE_S)  # its last reports need the node
        super().destroy_node()


def _played_quality(quality: Quality) -> Quality:
    """Return the quality of a topic's publisher: the recorded one, volatile ones with room."""
    if quality.transient_local:
        return quality
    return replace(quality, depth=max(quality.depth, MIN_HISTORY_COUNT), keep_all=False)
