# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The vehicles' streams in a node's namespace: subscribed to, sampled, buffered, and ended."""

from collections.abc import Callable
from dataclasses import dataclass
import re
from time import monotonic
from typing import Any

from rclpy.clock import Clock, ClockType

from msg_conventions.streams import decode_fix, decode_speed
from msg_conventions.topics import FIX_TYPE, TWIST_TYPE, vehicle_topic
from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.logs import LogConfig, RawLog, Streams
from scenario_gen.ros.common.topics import adapted_quality
from scenario_gen.situation import MAX_VEHICLES
from scenario_gen.types import Sample, token

CHECK_S = 0.2  # seconds between two checks for new streams, and for silence
TYPES = {"fix": FIX_TYPE, "speed": TWIST_TYPE}


@dataclass(frozen=True)
class LiveConfig(Parameters):
    """How a node listens to streams."""

    listen: bool = parameter(True, "listen to vehicle_<id>/fix and vehicle_<id>/speed, too")
    late: float = parameter(
        0.5,
        "a message may be so far behind the newest one and still count",
        unit="s",
        low=0.0,
        high=10.0,
    )
    silence: float = parameter(
        2.0, "when nothing comes for so long, real time, the streams have ended", unit="s", low=0.1
    )


class LiveStreams:
    """Subscribes to the vehicles' streams for a node and buffers them.

    `sampled` is called with every sample on the common clock. `ended` is called with the buffered log and how to read it: after
    silence, when `log.max_duration` seconds are buffered, or when the clock was set.
    """

    def __init__(
        self,
        node: Any,
        config: LiveConfig,
        log: LogConfig,
        sampled: Callable[[Sample], None],
        ended: Callable[[RawLog, LogConfig], None],
    ) -> None:
        """Check for streams periodically, in real time, because a simulated clock may stand."""
        self._node, self._config, self._log = node, config, log
        self._sampled, self._ended = sampled, ended
        self._streams = Streams(log, config.late)
        self._last_message = monotonic()
        self._topics: dict[str, tuple[str, str]] = {}  # by full name: vehicle, kind
        self._left_out: set[str] = (
            set()
        )  # topics that are not subscribed to, with the reason on /diagnostics
        self._timer = node.create_timer(
            CHECK_S, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def _look(self) -> None:
        """Subscribe to new streams, forget ended ones that were left out, and end the log after silence."""
        for topic in [
            topic for topic in self._left_out if not self._node.get_publishers_info_by_topic(topic)
        ]:
            self._left_out.discard(topic)
            self._topics.pop(topic)
            if not self._left_out:
                self._node.diagnostics.resolve("streams")
        try:
            self._subscribe()
        except InputError as error:
            self._node.diagnostics.failed("streams", error)
        if monotonic() - self._last_message > self._config.silence:
            self.end()

    def _subscribe(self) -> None:
        """Subscribe to new streams, as their publishers offer them."""
        for name in self._vehicles():
            for kind, kind_type in TYPES.items():
                topic = self._node.resolve_topic_name(vehicle_topic(name, kind))
                publishers = (
                    () if topic in self._topics else self._node.get_publishers_info_by_topic(topic)
                )
                if not publishers:
                    continue
                self._topics[topic] = (name, kind)
                self._left_out.add(topic)
                if (
                    name
                    not in list(dict.fromkeys(vehicle for vehicle, _ in self._topics.values()))[
                        :MAX_VEHICLES
                    ]
                ):
                    raise InputError(
                        f"{topic} is left out: {MAX_VEHICLES} others are in use; choose vehicles with log.vehicles"
                    )
                if publishers[0].topic_type != kind_type:
                    raise InputError(
                        f"{topic} is a {publishers[0].topic_type}; {kind_type} is needed, so it is left out"
                    )
                self._left_out.discard(topic)
                self._node.listen(
                    topic,
                    adapted_quality(topic, [publisher.qos_profile for publisher in publishers])[0],
                )

    def _vehicles(self) -> list[str]:
        """The vehicles of the parameter `log.vehicles`, or all that have a fix in the node's namespace."""
        if named := [token(name) for name in self._log.vehicles.split(",") if name.strip()]:
            return named
        pattern = re.compile(
            re.escape(self._node.get_namespace().rstrip("/")) + r"/vehicle_(\w+)/fix"
        )
        matches = (pattern.fullmatch(topic) for topic, _ in self._node.get_topic_names_and_types())
        return sorted(match[1] for match in matches if match)

    def received(self, topic: str, data: bytes) -> None:
        """Take a message in; one without a stamp counts from now, by the node's clock.

        Raises:
            InputError: it is damaged, or a clock stands or runs backwards.
        """
        vehicle, kind = self._topics[topic]
        stamp_ns, *values = decode_fix(data, topic) if kind == "fix" else decode_speed(data, topic)
        stamp_ns = stamp_ns or self._node.get_clock().now().nanoseconds
        self._last_message = monotonic()
        if self._streams.breaks(stamp_ns) or self._streams.seconds > self._log.max_duration:
            self.end()
        (self._streams.put_fix if kind == "fix" else self._streams.put_speed)(
            vehicle, stamp_ns, *values
        )
        for sample in self._streams.samples():
            self._sampled(sample)

    def end(self) -> bool:
        """Hand over what is buffered; return whether there was anything."""
        log = self._streams.take("live")
        if log is not None:
            for topic in self._topics:
                self._node.diagnostics.resolve(
                    topic
                )  # its stream has ended, and so have its faults
            self._ended(log, self._streams.config)
        return log is not None

    def close(self) -> None:
        """Stop checking for streams."""
        self._node.destroy_timer(self._timer)
