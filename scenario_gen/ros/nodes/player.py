# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""player: a bag's messages as they were recorded, raw; `~/pause` and `~/resume`; any rosbag2 bag, MCAP or SQLite.

Each topic is offered with the quality of service it was recorded with, or as `qos_overrides./topic.publisher.reliability` and the
like say. With an offset, what latched topics had said before it is published first. With `clock`, the bag's time is published on
/clock, so that nodes with `use_sim_time` follow it, in place of the bag's own /clock. When all is played and acknowledged the
player ends, unless it is to `loop`, or to `stay` for who comes late to latched topics.
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

STREAMED = BagConfig(
    most_bytes=2**62
)  # a message is published and forgotten, so a bag may be of any size
PATIENCE_S = 5.0  # seconds in which listeners have to take the last messages
TICK_S = 0.01  # seconds between two clock messages


@dataclass(frozen=True)
class Config(Parameters):
    """The player's parameters."""

    bag: str = parameter("", "bag to play: its folder or one of its files")
    topics: str = parameter(".*", "regular expression of the full names of the topics to play")
    rate: float = parameter(
        1.0, "how many times as fast as it was recorded", low=0.01, high=1000.0
    )
    start_offset: float = parameter(0.0, "begin so far into the bag", unit="s", low=0.0)
    loop: bool = parameter(False, "begin again at the end")
    stay: bool = parameter(
        False, "stay when all is played, so that latched topics reach who comes later, too"
    )
    paused: bool = parameter(False, "wait for ~/resume before the first message")
    clock: bool = parameter(False, "publish /clock")
    patience: float = parameter(
        60.0,
        "wait so long for subscribers that acknowledge nothing, then go on and warn; 0: for ever",
        unit="s",
        low=0.0,
    )


class Player(Node):  # type: ignore[misc]
    """Plays one bag."""

    def __init__(self, namespace: str | None = None) -> None:
        super().__init__("player", namespace=namespace)
        self.parameters = ConfigParameters(self, Config())
        self.diagnostics = NodeDiagnostics(self, self._report_progress)
        self._at: float | None = None  # seconds of the bag that have been played, while it is
        self.done = False
        self.exit_code = 0
        self._running = threading.Event()
        self._ended = threading.Event()
        self._player: threading.Thread | None = None
        self._offered: dict[str, tuple[Any, bool, int]] = {}
        self._paces: dict[str, Pace] = {}
        self._clock_publisher = (
            self.create_publisher(Clock, "/clock", 10) if self.parameters.config.clock else None
        )
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
        for topic in bag_topics(Path(config.bag), STREAMED):
            name = topic.name if topic.name.startswith("/") else f"/{topic.name}"
            if not re.fullmatch(config.topics, name) or (config.clock and name == "/clock"):
                continue
            try:
                kind, quality = message_class(topic.type), qos(topic.quality)
                publisher = self.create_publisher(
                    kind, name, quality, qos_overriding_options=QoSOverridingOptions(OVERRIDABLE)
                )
                self._offered[topic.name] = (
                    publisher,
                    topic.quality.transient_local,
                    topic.quality.depth,
                )
                self._paces[topic.name] = Pace(
                    publisher,
                    publisher.qos_profile.depth,
                    config.patience,
                    partial(self._report_pace, name),
                )
            except InputError as error:
                self.diagnostics.status(
                    Level.ERROR,
                    f"{name} is not played: {error}",
                    "topics",
                    {"error": "InputError"},
                )
        if not self._offered:
            raise InputError(
                f"{config.bag}: none of its topics can be played; see the messages above and the parameter topics"
            )
        if not config.paused:
            self._running.set()
        self._player = threading.Thread(target=self._play, args=(config,), daemon=True)
        self._player.start()

    def _play(self, config: Config) -> None:
        self._at = config.start_offset
        try:
            while not self._ended.is_set():
                self._play_once(config)
                if not config.loop:
                    break
            if self._ended.is_set():
                return
            self._at = None
            self.diagnostics.status(Level.OK, f"{config.bag}: played", "playing", {})
        except ScenarioGenError as error:
            self._at = None
            self.diagnostics.status(
                Level.ERROR, str(error), "playing", {"error": type(error).__name__}
            )
            self.exit_code = error.exit_code
        if not config.stay and not self._ended.is_set():
            self._leave()

    def _leave(self) -> None:
        """Let `run_nodes` end the node, once who listens has everything."""
        for pace in self._paces.values():
            pace.end()
        deadline = monotonic() + PATIENCE_S
        with suppress(InvalidHandle):  # the node is being ended already
            for publisher, _, _ in self._offered.values():
                while (
                    not publisher.wait_for_all_acked(Duration())
                    and monotonic() < deadline
                    and not self._ended.wait(TICK_S)
                ):
                    pass
        self.executor.create_task(
            self._finish
        )  # to wake the executor alone would not make it look

    def _finish(self) -> None:
        self.diagnostics.publish()  # how it went
        self.done = True

    def _play_once(self, config: Config) -> None:
        first: int | None = None
        elapsed = config.start_offset  # seconds of the bag that have been played
        for message in self._from_offset(config):
            first = message.stamp_ns if first is None else first
            elapsed = self._wait_until(
                (message.stamp_ns - first) * 1e-9 + config.start_offset, elapsed, config, first
            )
            if self._ended.is_set():
                return
            self._publish(message.topic, message.data)

    def _publish(self, topic: str, data: bytes) -> None:
        """Publish, once it overwrites nothing that is on its way; a replay may take longer than the recording for that."""
        self._paces[topic].wait(self._ended.is_set)
        publish(self, self._offered[topic][0], data)

    def _report_pace(self, topic: str, count: int) -> None:
        self.diagnostics.status(
            Level.WARN,
            acknowledgement_warning(self, topic, count),
            f"pace of {topic}",
            {"count": str(count)},
        )

    def _from_offset(self, config: Config) -> Iterator[BagMessage]:
        """Yield the messages from the offset on; before the first, publish what latched topics hold by then."""
        latched: dict[str, deque[bytes]] = {}
        begin: int | None = None
        for message in read_messages(
            Path(config.bag), lambda topic: topic in self._offered, STREAMED
        ):
            begin = message.stamp_ns if begin is None else begin
            if message.stamp_ns - begin < config.start_offset * 1e9:
                if self._offered[message.topic][1]:
                    depth = self._offered[message.topic][2]
                    latched.setdefault(message.topic, deque(maxlen=depth)).append(message.data)
                continue
            for topic in list(latched):
                for data in latched.pop(topic):
                    self._publish(topic, data)
            yield message

    def _wait_until(self, due: float, elapsed: float, config: Config, first_ns: int) -> float:
        """Let the bag's time run, at `rate` and unless paused, from `elapsed` to `due` [s]; return where it stands."""
        while elapsed < due and not self._ended.is_set():
            self._at = elapsed
            self._running.wait(TICK_S)
            started = monotonic()
            if self._running.is_set():
                self._ended.wait(min(TICK_S, (due - elapsed) / config.rate))
                elapsed += (monotonic() - started) * config.rate
            self._publish_clock(first_ns + round((min(elapsed, due) - config.start_offset) * 1e9))
        self._running.wait()
        return max(elapsed, due) if elapsed < due + 1.0 else due

    def _report_progress(self) -> None:
        """Say how far into the bag it is, each second."""
        if (at := self._at) is not None:
            message = f"{self.parameters.config.bag}: {at:.1f} s played" + (
                "" if self._running.is_set() else ", paused"
            )
            self.diagnostics.status(
                Level.OK, message, "playing", {"seconds": f"{at:.1f}"}, log=False
            )

    def _publish_clock(self, stamp_ns: int) -> None:
        if self._clock_publisher is not None:
            publish(self, self._clock_publisher, encode_clock(stamp_ns))

    def _set_running(self, *, running: bool) -> str:
        if running == self._running.is_set():
            raise InputError("it is so already")
        (self._running.set if running else self._running.clear)()
        return "playing" if running else "paused"

    def destroy_node(self) -> None:
        """End playing, then the node."""
        self._ended.set()
        self._running.set()
        if self._player is not None:
            self._player.join(PATIENCE_S)  # what it still says needs the node
        super().destroy_node()
