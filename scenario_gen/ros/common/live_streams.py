# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The vehicles' streams in a node's namespace: subscribed, buffered, and ended."""

from collections.abc import Callable
from dataclasses import dataclass
import re
from time import monotonic
from typing import Any

from msg_conventions.streams import decode_fix, decode_speed
from msg_conventions.topics import FIX_TYPE, TWIST_TYPE, vehicle_topic
from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.logs import LogConfig, RawLog, Streams
from scenario_gen.ros.common.timers import create_steady_timer
from scenario_gen.ros.common.topics import adapted_quality
from scenario_gen.situation import MAX_VEHICLES
from scenario_gen.types import token

TYPES = {"fix": FIX_TYPE, "speed": TWIST_TYPE}


@dataclass(frozen=True)
class LiveConfig(Parameters):
    """Parameters of live streams."""

    listen: bool = parameter(True, "listen to vehicle_<id>/fix and vehicle_<id>/speed, too")
    silence: float = parameter(
        2.0, "real time without messages after which the streams have ended", unit="s", low=0.1
    )


class LiveStreams:
    """Subscribes to the vehicles' streams for a node and buffers them.

    `ended` gets the buffered log with its configuration: after silence, after `log.max_duration`,
    or when the clock was set.
    """

    def __init__(
        self,
        node: Any,
        config: LiveConfig,
        log: LogConfig,
        ended: Callable[[RawLog, LogConfig], None],
    ) -> None:
        """Check for streams periodically, in real time, because a simulated clock may stop."""
        self._node = node
        self._config = config
        self._log = log
        self._ended = ended
        self._streams = Streams(log)
        self._last_message = monotonic()
        self._topics: dict[str, tuple[str, str]] = {}  # full name -> vehicle, kind
        self._refused: set[str] = set()  # topics with an error on /diagnostics
        self._timer = create_steady_timer(node, 0.25, self._check)

    def _check(self) -> None:
        """Forget ended streams, subscribe to new ones, and end the log after silence."""
        for topic in list(self._refused):
            if not self._node.get_publishers_info_by_topic(topic):
                self._refused.discard(topic)
                self._topics.pop(topic)
                if not self._refused:
                    self._node.diagnostics.resolve("streams")
        try:
            for name in self._vehicles():
                for kind in TYPES:
                    self._subscribe(name, kind)
        except InputError as error:
            self._node.diagnostics.failed("streams", error)
        if monotonic() - self._last_message > self._config.silence:
            self.end()

    def _subscribe(self, name: str, kind: str) -> None:
        """Subscribe to a vehicle's stream, if it is new, with its publishers' quality.

        Raises:
            InputError: there are too many vehicles, or the stream has another type.
        """
        topic = self._node.resolve_topic_name(vehicle_topic(name, kind))
        if topic in self._topics:
            return
        publishers = self._node.get_publishers_info_by_topic(topic)
        if not publishers:
            return
        self._topics[topic] = (name, kind)
        self._refused.add(topic)
        vehicles = list(dict.fromkeys(vehicle for vehicle, _ in self._topics.values()))
        if name not in vehicles[:MAX_VEHICLES]:
            raise InputError(
                f"{topic} is left out: {MAX_VEHICLES} others are in use; choose vehicles with "
                "log.vehicles"
            )
        if publishers[0].topic_type != TYPES[kind]:
            raise InputError(
                f"{topic} is a {publishers[0].topic_type}; {TYPES[kind]} is needed, so it is left "
                "out"
            )
        self._refused.discard(topic)
        offers = [publisher.qos_profile for publisher in publishers]
        self._node.listen(topic, adapted_quality(topic, offers)[0])

    def _vehicles(self) -> list[str]:
        """Return the vehicles in `log.vehicles`, or all with a fix in the node's namespace."""
        if names := [token(name) for name in self._log.vehicles.split(",") if name.strip()]:
            return names
        namespace = re.escape(self._node.get_namespace().rstrip("/"))
        pattern = re.compile(namespace + r"/vehicle_(\w+)/fix")
        matches = (pattern.fullmatch(topic) for topic, _ in self._node.get_topic_names_and_types())
        return sorted(match[1] for match in matches if match)

    def received(self, topic: str, data: bytes) -> None:
        """Add a message to its stream; a message without a stamp gets the node's time.

        Raises:
            InputError: it is damaged.
        """
        vehicle, kind = self._topics[topic]
        decode = decode_fix if kind == "fix" else decode_speed
        stamp_ns, *values = decode(data, topic)
        stamp_ns = stamp_ns or self._node.get_clock().now().nanoseconds
        self._last_message = monotonic()
        if self._streams.breaks(stamp_ns) or self._streams.seconds > self._log.max_duration:
            self.end()
        put = self._streams.put_fix if kind == "fix" else self._streams.put_speed
        put(vehicle, stamp_ns, *values)

    def end(self) -> bool:
        """Hand the buffered log over; return whether there was one."""
        log = self._streams.flush("live")
        if log is None:
            return False
        for topic in self._topics:
            self._node.diagnostics.resolve(topic)  # errors of ended streams are over
        self._ended(log, self._streams.config)
        return True

    def close(self) -> None:
        """Stop checking for streams."""
        self._node.destroy_timer(self._timer)
