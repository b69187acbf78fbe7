# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Live fixes and speeds → samples on the common clock, and a log of all of them.

Nothing is read in a second way: the last seconds of the streams are a small `RawLog` that is cleaned like any other, and all that
was buffered is a `RawLog` too, which `encounters_of` reads as if it came from a file.
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

WINDOW_NS = 3_000_000_000  # of the past that is cleaned again for every sample: enough to distinguish a jump from a new place
FAR_NS = (
    10_000_000_000  # a stamp this far from the newest one belongs to another time, or is wrong
)
MAX_PER_SECOND = 100  # messages of one kind per vehicle and second that are kept
EVERY = 2  # ticks that are sampled at once, after one cleaning


class Streams:
    """Buffers the newest `max_duration` seconds of streams and samples them; memory does not grow with time.

    Messages may come in any order, twice, or not at all, as long as they are less than `late` seconds behind the newest one;
    the samples are then those of messages in order. (Later ones still count in `take`.)
    """

    def __init__(self, config: LogConfig = LogConfig(), late: float = 0.5) -> None:
        """Start empty; `config` is that of a log, `start`, `end` and `strict` do not apply."""
        self.origin = config.origin
        self._config = replace(config, start=0.0, end=0.0, strict=False, vehicles="")
        self._dt_ns = round(config.period * 1e9)
        self._late_ns = round(late * 1e9)
        self._clear()

    def _clear(self) -> None:
        self._whole: dict[str, Rows] = {}
        self._recent: dict[str, Rows] = {}
        self._count = 0
        self._first = self._newest = -1  # stamps
        self._next = -1  # number of the next tick, once there were any
        self._n_strange = 0

    @property
    def config(self) -> LogConfig:
        """How the log of `take` is to be read: all of it, in the frame of the samples."""
        return replace(self._config, origin=self.origin)

    @property
    def seconds(self) -> float:
        """From the first message to the newest one that is buffered; 0.0 if there is none."""
        return (self._newest - self._first) * 1e-9

    def breaks(self, stamp_ns: int) -> bool:
        """Return whether the clock was set: this message is the last of several that are far from those before.

        A single such message is wrong, and `put_fix` and `put_speed` leave it out.
        """
        if self._newest < 0 or abs(stamp_ns - self._newest) <= FAR_NS:
            self._n_strange = 0
            return False
        self._n_strange += 1
        return self._n_strange >= CLEANING.relocation_count

    def put_fix(self, vehicle: str, stamp_ns: int, latitude: float, longitude: float) -> None:
        """Take a position in [degrees]; NaN where there is no fix."""
        if self._counts(stamp_ns):
            for rows in self._of(vehicle):
                rows.fixes.append((stamp_ns, self._count, latitude, longitude, np.nan))
                del rows.fixes[: -round(MAX_PER_SECOND * self._config.max_duration)]

    def put_speed(self, vehicle: str, stamp_ns: int, speed: float) -> None:
        """Take a speed in [m/s]."""
        if self._counts(stamp_ns):
            for rows in self._of(vehicle):
                rows.speeds.append((stamp_ns, self._count, speed))
                del rows.speeds[: -round(MAX_PER_SECOND * self._config.max_duration)]

    def _of(self, vehicle: str) -> tuple[Rows, Rows]:
        return self._whole.setdefault(vehicle, Rows()), self._recent.setdefault(vehicle, Rows())

    def _counts(self, stamp_ns: int) -> bool:
        """Number the message, unless it is of another time."""
        if self._newest < 0:
            self._first = self._newest = stamp_ns
        if abs(stamp_ns - self._newest) > FAR_NS:
            return False
        self._count += 1
        self._first, self._newest = min(self._first, stamp_ns), max(self._newest, stamp_ns)
        return True

    def samples(self) -> list[Sample]:
        """Return the samples that have become complete; a tick at which fewer than two vehicles are there has none.

        Raises:
            InputError: a clock stands or runs backwards; the last seconds are forgotten.
        """
        last = (self._newest - self._late_ns) // self._dt_ns // EVERY * EVERY
        following = self._first // self._dt_ns if self._next < 0 else self._next
        if self._newest < 0 or last < following:
            return []
        self._next = following
        try:
            tracks = self._tracks()
        except InputError:
            self._recent, self._next = {}, last + 1
            raise
        samples: list[Sample] = []
        while self._next <= last:
            tick = self._next * self._dt_ns
            if any(self._awaited(track, tick) for track in tracks):
                break
            self._next += 1
            if (sample := sample_at(tracks, tick, self._config)) is None:
                continue
            if not self.origin:
                self.origin = self._place(sample.vehicles[0].id)
                self._next -= 1
                return self.samples()
            samples.append(sample)
        self._forget(self._next * self._dt_ns - WINDOW_NS)
        return samples

    def _tracks(self) -> tuple[Observations, ...]:
        """Clean the last seconds."""
        names = sorted(
            (name for name, rows in self._recent.items() if len(rows.fixes) >= 2), key=natural
        )
        log = self._log("streams", {name: self._recent[name] for name in names})
        if not any(np.isfinite(vehicle.fix).all(axis=1).any() for vehicle in log.vehicles):
            return ()
        return clean(log, self.config)[0]

    def _awaited(self, track: Observations, tick: int) -> bool:
        """Return whether a vehicle's next fix may still come: its source may be slower than the others."""
        silent = (self._newest - self._late_ns - int(track.fix_ns[-1])) * 1e-9
        return bool(track.fix_ns[-1] < tick) and silent <= longest_bridge(
            np.diff(track.fix_ns) * 1e-9, self._config
        )

    def _place(self, vehicle: str) -> str:
        """Return the first sound fix of a vehicle, to about a metre, as an origin for all that follows."""
        on_globe = (
            row
            for row in self._recent[vehicle].fixes
            if 0.0 < abs(row[2]) <= 90.0 and abs(row[3]) <= 180.0
        )
        _, _, latitude, longitude, _ = min(on_globe)
        return f"{latitude:.5f},{longitude:.5f}"

    def _forget(self, before: int) -> None:
        for name, rows in list(self._recent.items()):
            rows.fixes[:] = [row for row in rows.fixes if row[0] >= before]
            rows.speeds[:] = [row for row in rows.speeds if row[0] >= before]
            if not rows.fixes and not rows.speeds:
                del self._recent[name]

    def _log(self, name: str, rows: dict[str, Rows]) -> RawLog:
        return RawLog(
            name=name,
            geographic=True,
            vehicles=tuple(own.observations(vehicle) for vehicle, own in rows.items()),
            rows=self._count,
            segments=(Segment(1, "the streams", "message", 1),),
        )

    def take(self, name: str) -> RawLog | None:
        """Return all that is buffered as a log, and start anew; None if no position came."""
        whole = {vehicle: rows for vehicle, rows in self._whole.items() if rows.fixes}
        log = self._log(name, whole) if whole else None
        self._clear()
        return log


def sample_at(tracks: Sequence[Observations], stamp_ns: int, config: LogConfig) -> Sample | None:
    """Return the vehicles with fixes around an instant that are not too far apart; None for fewer than two vehicles."""
    vehicles, position, speed = [], [], []
    for track in tracks:
        after = int(np.searchsorted(track.fix_ns, stamp_ns))
        before = (
            after if after < len(track.fix_ns) and track.fix_ns[after] == stamp_ns else after - 1
        )
        seconds = np.diff(track.fix_ns) * 1e-9
        if (
            before < 0
            or after == len(track.fix_ns)
            or seconds[before:after].sum() > longest_bridge(seconds, config)
        ):
            continue
        vehicles.append(Vehicle(track.id, track.length, track.width))
        position.append([np.interp(stamp_ns, track.fix_ns, axis) for axis in track.fix.T])
        if len(track.speed_ns):
            speed.append(np.interp(stamp_ns, track.speed_ns, track.speed))
        else:
            clock = (track.fix_ns - track.fix_ns[0]) * 1e-9
            speed.append(
                np.interp(
                    (stamp_ns - int(track.fix_ns[0])) * 1e-9,
                    clock,
                    speed_of_fixes(clock, track.fix),
                )
            )
    return (
        Sample(stamp_ns, tuple(vehicles), np.array(position), np.array(speed))
        if len(vehicles) >= 2
        else None
    )
