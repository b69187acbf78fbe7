# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""log_player: a log in, one of its encounters out as latched `tracks`; `~/play` reads it again.

The part that a stage requests on `tracks/part` replaces them.

With `stream`, the encounter is published as `vehicle_<id>/fix` and `vehicle_<id>/speed` of each
vehicle, and `/clock`, instead.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
import time

from rosgraph_msgs.msg import Clock

from msg_conventions.diagnostics import Level
from msg_conventions.driving import encode_clock
from msg_conventions.streams import encode_fix, encode_speed
from msg_conventions.topics import vehicle_topic
from msg_conventions.tracks import encode_tracks
from scenario_gen.base.cancelling import stop_if_cancelled
from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.logs import latitude_longitude, LogConfig, read_log
from scenario_gen.method.continuation import driven_on
from scenario_gen.ros.common.recording_part import send_part
from scenario_gen.ros.common.recording_part import TOPIC as PART
from scenario_gen.ros.common.services import offer_trigger
from scenario_gen.ros.common.stage_node import StageNode
from scenario_gen.types import Encounter, tokens

DISCOVERY_S = 1.0  # for subscribers to find the streams, which are not latched


@dataclass(frozen=True)
class Config(Parameters):
    """The log player's parameters."""

    log_path: str = parameter("", "log to read: a file, a bag or a folder of files")
    encounter: int = parameter(0, "which encounter of the log, from 0", low=0)
    stream: bool = parameter(
        False,
        "publish fixes and speeds of each vehicle with /clock instead of tracks",
    )
    rate: float = parameter(
        1.0, "speed of the stream, as a multiple of the recorded one", low=0.01, high=1000.0
    )
    wait_matching_subscriptions: int = parameter(
        0, "subscribers that each stream must have before it begins", low=0
    )
    log: LogConfig = field(default_factory=LogConfig)


class LogPlayer(StageNode):
    """Publishes one encounter of a log."""

    INPUTS = (PART,)
    OUTPUTS = ("tracks",)

    def __init__(self, namespace: str | None = None) -> None:
        super().__init__("log_player", Config(), namespace)
        offer_trigger(self, "~/play", self._play_again)
        self._sent: Encounter | None = None

    def started(self) -> None:
        """Read the log, if the parameters name one."""
        if self.config.log_path:
            self.work("play", self._play)

    def received(self, topic: str, data: bytes) -> None:
        """Send the requested part of the tracks."""
        send_part(self, self._sent, data)

    def _play(self, cancelled: Callable[[], bool]) -> None:
        config = self.config
        result = read_log(Path(config.log_path), config.log)
        if config.encounter >= len(result.encounters):
            raise InputError(
                f"parameter encounter is {config.encounter}; {config.log_path} holds "
                f"{len(result.encounters)}, counted from 0"
            )
        encounter, driven = driven_on(result.encounters[config.encounter])
        stop_if_cancelled()
        if not config.stream:
            self._sent = encounter
            self.outputs.send("tracks", encode_tracks(encounter))
        n, samples = encounter.speed.shape
        message = (
            f"{encounter.name}: {n} vehicles, {samples} samples over {encounter.duration:.1f} s"
        )
        remarks = (*result.quality.remarks(), *map(str, driven))
        notes = {f"note.{k}": note for k, note in enumerate(remarks)}
        if encounter.origin is not None:
            notes["origin"] = "{!r},{!r}".format(*encounter.origin)
        self.status(Level.OK, message, "encounter", encounter.start_ns, **notes)
        if config.stream:
            self._stream(encounter, config, cancelled)

    def _stream(self, encounter: Encounter, config: Config, cancelled: Callable[[], bool]) -> None:
        """Publish sample after sample, each after its /clock, until the end or a cancellation."""
        names = tokens(encounter.ids)
        positions = latitude_longitude(encounter)
        clock = self.create_publisher(Clock, "/clock", 10)
        self._wait_for_subscribers(names, config.wait_matching_subscriptions, cancelled)
        started = time.monotonic() + DISCOVERY_S
        for k in range(encounter.speed.shape[1]):
            _sleep_until(started + k * encounter.dt / config.rate, cancelled)
            if cancelled() or not self.context.ok():
                break
            stamp = encounter.start_ns + k * encounter.dt_ns
            self.outputs.publish(clock, encode_clock(stamp))
            for i, name in enumerate(names):
                frame = f"vehicle_{name}"
                latitude, longitude = positions[i, k].tolist()
                fix = encode_fix(latitude, longitude, stamp, frame)
                self.outputs.send(vehicle_topic(name, "fix"), fix)
                speed = encode_speed(float(encounter.speed[i, k]), stamp, frame)
                self.outputs.send(vehicle_topic(name, "speed"), speed)
        else:
            self.status(Level.OK, f"{encounter.name}: streamed", "stream", encounter.start_ns)
        self.destroy_publisher(clock)

    def _wait_for_subscribers(
        self, names: Sequence[str], count: int, cancelled: Callable[[], bool]
    ) -> None:
        """Advertise all streams, and wait until each has `count` subscribers."""
        topics = [vehicle_topic(name, kind) for name in names for kind in ("fix", "speed")]
        for topic in topics:
            self.outputs.advertise(topic)
        while min(map(self.count_subscribers, topics)) < count and not cancelled():
            time.sleep(0.05)

    def _play_again(self) -> str:
        if not (self.active and self.config.log_path):
            raise InputError("parameter log_path is empty, or the node is not active")
        self.started()
        return "started"


def _sleep_until(due: float, cancelled: Callable[[], bool]) -> None:
    """Sleep until a time [s] on the monotonic clock, or a cancellation."""
    while (remaining := due - time.monotonic()) > 0.0 and not cancelled():
        time.sleep(min(remaining, 0.1))
