# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What a log may ask for: refused before the work is done, with the figure, the bound and the parameter to raise.

A clock alone can ask for hundreds of gibibytes: the common clock has a tick for every period between a vehicle's first and
last stamp, and one wrong stamp puts them years apart.
"""

from collections.abc import Sequence

import numpy as np

from scenario_gen.errors import InputError
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.raw import Observations, RawLog

LATEST_NS = 2**62  # years 1823 to 2116: so the difference of any two stamps fits in 64 bits
SLOWEST = 5.0  # s between fixes: a slower source says nothing of how a vehicle drives, or its unit of time is another one
FARTHEST = 1e8  # m from the origin of any frame: a quarter of the way to the moon
LARGEST = 100.0  # m: what is longer is no vehicle
UNITS = {"milliseconds": ("ms", 1e-3), "microseconds": ("us", 1e-6), "nanoseconds": ("ns", 1e-9)}
USUAL = (0.005, 2.0)  # s between fixes of usual sources


def check_size(where: str, size: int, rows: int, config: LogConfig) -> None:
    """Refuse a log of more than `size_limit` or `row_limit`.

    Args:
        where: the file; begins the message.
        size: bytes, decompressed.
        rows: rows or messages.
        config: holds the limits.

    Raises:
        InputError: it is too large.
    """
    if size > config.size_limit << 20:
        raise InputError(
            f"{where} holds {size / 2**20:.1f} MiB (decompressed, as far as it was read); at most {config.size_limit} MiB are "
            "read: cut the log, or raise the parameter size_limit"
        )
    if rows > config.row_limit:
        raise InputError(
            f"{where} holds {rows} rows or more; at most {config.row_limit} are read: cut the log, or raise the parameter "
            "row_limit"
        )


def check_vehicles(where: str, count: int, config: LogConfig) -> None:
    """Refuse a log of more than `vehicle_limit` vehicles.

    Raises:
        InputError: there are too many.
    """
    if count > config.vehicle_limit:
        raise InputError(
            f"{where}: {count} vehicles, at most {config.vehicle_limit} are read; check the vehicle column (parameter columns), "
            "or raise the parameter vehicle_limit"
        )


def check_clock(vehicles: Sequence[Observations], log: RawLog, config: LogConfig) -> None:
    """Refuse tracks whose common clock would have more than `tick_limit` ticks, or whose unit of time seems to be wrong.

    Args:
        vehicles: stamps in order.
        log: names the places.
        config: holds the limit and the period.

    Raises:
        InputError: the clock is too long, or the fixes are too far apart in time.
    """
    vehicles = [vehicle for vehicle in vehicles if len(vehicle.fix_ns) >= 2]
    if not vehicles:
        return
    typical = float(np.median(np.concatenate([np.diff(vehicle.fix_ns) for vehicle in vehicles]))) * 1e-9
    if typical > max(SLOWEST, config.longest_gap):
        likely = [(name, unit) for name, (unit, factor) in UNITS.items() if USUAL[0] <= typical * factor <= USUAL[1]]
        said = f"this looks like {likely[0][0]} read as seconds; " if likely else ""
        raise InputError(
            f"{log.where(int(vehicles[0].fix_row[1]))}: positions are {typical:g} s apart (median), at most {SLOWEST:g} s make a "
            f"track; {said}name the unit with the parameter columns, time=<column>:{likely[0][1] if likely else '<unit>'}"
        )
    spans = [int(vehicle.fix_ns[-1]) - int(vehicle.fix_ns[0]) for vehicle in vehicles]
    ticks = round(sum(spans) / (config.period * 1e9))
    if ticks > config.tick_limit:
        longest = vehicles[int(np.argmax(spans))]
        after = int(np.argmax(np.diff(longest.fix_ns))) + 1
        gap = int(longest.fix_ns[after]) - int(longest.fix_ns[after - 1])
        raise InputError(
            f"{log.where(int(longest.fix_row[after]))}: the stamp of vehicle {longest.id[:50]} is {gap * 1e-9:g} s after the one "
            f"before, so the clock has {ticks} ticks of {config.period:g} s in all; at most {config.tick_limit} are made: "
            "correct the stamp, cut the log (parameters start, end), or raise the parameter tick_limit"
        )
