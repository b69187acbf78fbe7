# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Live fixes and speeds as a `RawLog` of all messages, for `encounters_of`."""

from dataclasses import replace

from scenario_gen.logs.cleaning import CLEANING
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.raw import Fix, RawLog, Rows, Segment, Speed

FAR_NS = 10_000_000_000  # stamps farther from the newest one are of another time, or wrong
_MAX_RATE_HZ = 100  # messages of one kind per vehicle


class Streams:
    """Buffers the newest `max_duration` seconds of streams, in bounded memory.

    Messages may come in any order, twice, or not at all.

    Attributes:
        config: configuration for the log of `flush`.
    """

    def __init__(self, config: LogConfig = LogConfig()) -> None:
        """Begin empty; of `config`, `start`, `end` and `strict` do not apply."""
        self.config = replace(config, start=0.0, end=0.0, strict=False, vehicles="")
        self._clear()

    def _clear(self) -> None:
        self._rows: dict[str, Rows] = {}
        self._count = 0
        self._first_ns = -1
        self._newest_ns = -1
        self._n_far = 0

    @property
    def seconds(self) -> float:
        """Time between the first and the newest buffered message; 0.0 if there is none."""
        return (self._newest_ns - self._first_ns) * 1e-9

    def breaks(self, stamp_ns: int) -> bool:
        """Return whether the clock was set: several messages in a row are far from earlier ones.

        A single such message is wrong, and `put_fix` and `put_speed` ignore it.
        """
        if self._newest_ns < 0 or abs(stamp_ns - self._newest_ns) <= FAR_NS:
            self._n_far = 0
            return False
        self._n_far += 1
        return self._n_far >= CLEANING.relocation_count

    def put_fix(self, vehicle: str, stamp_ns: int, latitude: float, longitude: float) -> None:
        """Add a position [degrees]; NaN without a fix."""
        if self._counts(stamp_ns):
            fixes = self._rows.setdefault(vehicle, Rows()).fixes
            fixes.append(Fix(stamp_ns, self._count, latitude, longitude))
            del fixes[: -round(_MAX_RATE_HZ * self.config.max_duration)]

    def put_speed(self, vehicle: str, stamp_ns: int, speed: float) -> None:
        """Add a speed [m/s]."""
        if self._counts(stamp_ns):
            speeds = self._rows.setdefault(vehicle, Rows()).speeds
            speeds.append(Speed(stamp_ns, self._count, speed))
            del speeds[: -round(_MAX_RATE_HZ * self.config.max_duration)]

    def _counts(self, stamp_ns: int) -> bool:
        """Count a message, unless it is of another time; return whether it counts."""
        if self._newest_ns < 0:
            self._first_ns = stamp_ns
            self._newest_ns = stamp_ns
        if abs(stamp_ns - self._newest_ns) > FAR_NS:
            return False
        self._count += 1
        self._first_ns = min(self._first_ns, stamp_ns)
        self._newest_ns = max(self._newest_ns, stamp_ns)
        return True

    def flush(self, name: str) -> RawLog | None:
        """Return the buffer as a log, and clear it; None without any position."""
        vehicles = tuple(
            rows.observations(vehicle) for vehicle, rows in self._rows.items() if rows.fixes
        )
        segments = (Segment(1, "the streams", "message", 1),)
        log = RawLog(
            name=name, geographic=True, vehicles=vehicles, rows=self._count, segments=segments
        )
        self._clear()
        return log if vehicles else None
