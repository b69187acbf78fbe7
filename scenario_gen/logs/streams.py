# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Live fixes and speeds: samples on the common clock, and a log of all messages.

Streams are read like files: the last seconds are a small `RawLog` that is cleaned like any other,
and the whole buffer is a `RawLog` for `encounters_of`.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.logs.cleaning import clean, CLEANING
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.encounters import longest_bridge
from scenario_gen.logs.raw import natural, Observations, RawLog, Rows, Segment
from scenario_gen.logs.smoothing import speed_of_fixes
from scenario_gen.types import Sample, Vehicle

_WINDOW_NS = 3_000_000_000  # cleaned again for every sample: tells a jump from a new place
FAR_NS = 10_000_000_000  # stamps farther from the newest one are of another time, or wrong
_MAX_RATE_HZ = 100  # messages of one kind per vehicle


class Streams:
    """Buffers the newest `max_duration` seconds of streams and samples them, in bounded memory.

    Messages may come in any order, twice, or not at all, if they are at most `max_delay`
    seconds behind the newest one; the samples are then those of messages in order. Later messages
    still count in `flush`.
    """

    def __init__(self, config: LogConfig = LogConfig(), max_delay: float = 0.5) -> None:
        """Begin empty; of `config`, `start`, `end` and `strict` do not apply."""
        self.origin = config.origin
        self._config = replace(config, start=0.0, end=0.0, strict=False, vehicles="")
        self._dt_ns = round(config.period * 1e9)
        self._max_delay_ns = round(max_delay * 1e9)
        self._clear()

    def _clear(self) -> None:
        self._all: dict[str, Rows] = {}
        self._recent: dict[str, Rows] = {}
        self._count = 0
        self._first_ns = -1
        self._newest_ns = -1
        self._next_tick = -1
        self._n_far = 0

    @property
    def config(self) -> LogConfig:
        """Configuration for the log of `flush`: all of it, in the frame of the samples."""
        return replace(self._config, origin=self.origin)

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
            for rows in self._of(vehicle):
                rows.fixes.append((stamp_ns, self._count, latitude, longitude, np.nan))
                del rows.fixes[: -round(_MAX_RATE_HZ * self._config.max_duration)]

    def put_speed(self, vehicle: str, stamp_ns: int, speed: float) -> None:
        """Add a speed [m/s]."""
        if self._counts(stamp_ns):
            for rows in self._of(vehicle):
                rows.speeds.append((stamp_ns, self._count, speed))
                del rows.speeds[: -round(_MAX_RATE_HZ * self._config.max_duration)]

    def _of(self, vehicle: str) -> tuple[Rows, Rows]:
        """Return the two buffers of a vehicle."""
        return self._all.setdefault(vehicle, Rows()), self._recent.setdefault(vehicle, Rows())

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

    def samples(self) -> list[Sample]:
        """Return the samples that have become complete, with at least two vehicles each.

        Raises:
            InputError: a clock stands still or runs backwards; the last seconds are dropped.
        """
        if self._newest_ns < 0:
            return []
        group = 2  # ticks per cleaning
        last_tick = (self._newest_ns - self._max_delay_ns) // self._dt_ns // group * group
        first_tick = self._first_ns // self._dt_ns if self._next_tick < 0 else self._next_tick
        if last_tick < first_tick:
            return []
        self._next_tick = first_tick
        try:
            tracks = self._tracks()
        except InputError:
            self._recent = {}
            self._next_tick = last_tick + 1
            raise
        samples: list[Sample] = []
        while self._next_tick <= last_tick:
            stamp_ns = self._next_tick * self._dt_ns
            if any(self._is_awaited(track, stamp_ns) for track in tracks):
                break
            sample = sample_at(tracks, stamp_ns, self._config)
            if sample is not None and not self.origin:  # the tracks get this frame
                self.origin = self._first_place(sample.vehicles[0].id)
                return self.samples()
            self._next_tick += 1
            if sample is not None:
                samples.append(sample)
        self._forget(self._next_tick * self._dt_ns - _WINDOW_NS)
        return samples

    def _tracks(self) -> tuple[Observations, ...]:
        """Return the cleaned tracks of the last seconds."""
        names = sorted(
            (name for name, rows in self._recent.items() if len(rows.fixes) >= 2), key=natural
        )
        log = self._log("streams", {name: self._recent[name] for name in names})
        if not any(np.isfinite(vehicle.fix).all(axis=1).any() for vehicle in log.vehicles):
            return ()
        return clean(log, self.config)[0]

    def _is_awaited(self, track: Observations, stamp_ns: int) -> bool:
        """Return whether a vehicle's next fix may still come from a slower source."""
        last_ns = int(track.fix_ns[-1])
        silent_s = (self._newest_ns - self._max_delay_ns - last_ns) * 1e-9
        longest_s = longest_bridge(np.diff(track.fix_ns) * 1e-9, self._config)
        return last_ns < stamp_ns and silent_s <= longest_s

    def _first_place(self, vehicle: str) -> str:
        """Return the first valid fix of a vehicle, to about a metre, as the origin."""
        on_globe = (
            row
            for row in self._recent[vehicle].fixes
            if 0.0 < abs(row[2]) <= 90.0 and abs(row[3]) <= 180.0
        )
        _, _, latitude, longitude, _ = min(on_globe)
        return f"{latitude:.5f},{longitude:.5f}"

    def _forget(self, before: int) -> None:
        """Drop recent messages before a stamp [ns]."""
        for name, rows in list(self._recent.items()):
            rows.fixes[:] = [row for row in rows.fixes if row[0] >= before]
            rows.speeds[:] = [row for row in rows.speeds if row[0] >= before]
            if not rows.fixes and not rows.speeds:
                del self._recent[name]

    def _log(self, name: str, rows: dict[str, Rows]) -> RawLog:
        """Return buffered messages as a log."""
        return RawLog(
            name=name,
            geographic=True,
            vehicles=tuple(buffer.observations(vehicle) for vehicle, buffer in rows.items()),
            rows=self._count,
            segments=(Segment(1, "the streams", "message", 1),),
        )

    def flush(self, name: str) -> RawLog | None:
        """Return the buffer as a log, and clear it; None without any position."""
        positioned = {vehicle: rows for vehicle, rows in self._all.items() if rows.fixes}
        log = self._log(name, positioned) if positioned else None
        self._clear()
        return log


def sample_at(tracks: Sequence[Observations], stamp_ns: int, config: LogConfig) -> Sample | None:
    """Return the vehicles with near fixes around an instant; None for fewer than two vehicles."""
    vehicles = []
    position = []
    speed = []
    for track in tracks:
        if not _is_recorded(track, stamp_ns, config):
            continue
        vehicles.append(Vehicle(track.id, track.length, track.width))
        position.append([np.interp(stamp_ns, track.fix_ns, axis) for axis in track.fix.T])
        speed.append(_speed_at(track, stamp_ns))
    if len(vehicles) < 2:
        return None
    return Sample(stamp_ns, tuple(vehicles), np.array(position), np.array(speed))


def _is_recorded(track: Observations, stamp_ns: int, config: LogConfig) -> bool:
    """Return whether an instant is at a fix, or in a gap that is bridged."""
    after = int(np.searchsorted(track.fix_ns, stamp_ns))
    if after == len(track.fix_ns):
        return False
    if track.fix_ns[after] == stamp_ns:
        return True
    seconds = np.diff(track.fix_ns) * 1e-9
    return after > 0 and bool(seconds[after - 1] <= longest_bridge(seconds, config))


def _speed_at(track: Observations, stamp_ns: int) -> float:
    """Return the speed [m/s] at an instant, measured or by the fixes."""
    if len(track.speed_ns):
        return float(np.interp(stamp_ns, track.speed_ns, track.speed))
    start_ns = int(track.fix_ns[0])
    seconds = (track.fix_ns - start_ns).astype(np.float64) * 1e-9
    fix_speed = speed_of_fixes(seconds, track.fix)
    return float(np.interp((stamp_ns - start_ns) * 1e-9, seconds, fix_speed))
