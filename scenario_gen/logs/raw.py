# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Raw logs, the result of every reader: observations per vehicle, and their places in files."""

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from scenario_gen.base.copies import renamed
from scenario_gen.base.errors import InputError
from scenario_gen.logs.column import Column
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.quality import Doubt
from scenario_gen.logs.signals import RawSignal
from scenario_gen.numerics import Floats, Ints
from scenario_gen.types import Encounter, Trailer


class UnknownFormatError(InputError):
    """A file is in no known log format, or lacks the columns of its format."""


@dataclass(frozen=True, eq=False)
class Observations:
    """Observations of one vehicle, in the order of the log; not yet cleaned.

    Attributes:
        id: the vehicle's name in the log.
        fix_ns: (F,) stamps of the positions, nanoseconds.
        fix: (F, 2) latitude and longitude [degrees], or x and y [m]; see `RawLog.geographic`.
        fix_row: (F,) rows of the log; see `RawLog.where`.
        heading: (F,) rad, counter-clockwise from east; NaN where it is not recorded.
        speed_ns: (S,) stamps of the speeds, nanoseconds.
        speed: (S,) m/s.
        speed_row: (S,) rows of the log.
        length: metres, NaN if it is not recorded.
        width: metres, NaN if it is not recorded.
        kind: the log's word for its type of road user, or ""; `kinds.typed` turns it into a type.
        trailer_name: the id or the length [m] of its trailer in the log, or "".
        trailer: its trailer, as far as it is known.
        origin: latitude and longitude [degrees] of the frame of a projected `fix`.
        height: (F,) metres, NaN where it is not recorded; None: nowhere.
        course: (S,) directions [rad] of recorded velocity vectors; None: not recorded.
        ego: (F, 3) poses of the vehicle that recorded it [m, rad]; None: not recorded.
        ahead: how far its centre is ahead of the recorded point, in vehicle lengths; NaN: as the
            parameter `columns` says.
    """

    id: str
    fix_ns: Ints
    fix: Floats
    fix_row: Ints
    heading: Floats
    speed_ns: Ints
    speed: Floats
    speed_row: Ints
    length: float = np.nan
    width: float = np.nan
    kind: str = ""
    trailer_name: str = ""
    trailer: Trailer | None = None
    origin: tuple[float, float] | None = None
    height: Floats | None = None
    course: Floats | None = None
    ego: Floats | None = None
    ahead: float = math.nan

    @classmethod
    def of_rows(
        cls,
        name: str,
        stamps: Ints,
        states: Floats,
        rows: Ints,
        size: tuple[float, float],
        *,
        kind: str = "",
        measured: bool = True,
    ) -> "Observations":
        """Return the observations of a log in which each row has a fix and maybe a speed.

        Args:
            name: the vehicle.
            stamps: (F,) nanoseconds.
            states: (F, 4) position (two columns), heading and speed.
            rows: (F,) rows of the log.
            size: length and width, metres or NaN.
            kind: the log's word for its type of road user, or "".
            measured: whether the log has speeds.
        """
        n_speeds = len(rows) if measured else 0
        return cls(
            id=name,
            fix_ns=stamps,
            fix=states[:, :2],
            fix_row=rows,
            heading=states[:, 2],
            speed_ns=stamps[:n_speeds],
            speed=states[:n_speeds, 3],
            speed_row=rows[:n_speeds],
            length=size[0],
            width=size[1],
            kind=kind,
        )


class Fix(NamedTuple):
    """A position in a message: stamp, row of the log, place, heading [rad] and height [m]."""

    stamp_ns: int
    row: int
    x: float
    y: float
    heading: float = math.nan
    height: float = math.nan


class Speed(NamedTuple):
    """A speed in a message: stamp, row of the log, m/s, and direction of the velocity [rad]."""

    stamp_ns: int
    row: int
    speed: float
    course: float = math.nan


@dataclass
class Rows:
    """Messages of one vehicle."""

    fixes: list[Fix] = field(default_factory=list)
    speeds: list[Speed] = field(default_factory=list)

    def observations(self, name: str) -> Observations:
        """Return the rows as arrays."""
        fixes = np.array([fix[2:] for fix in self.fixes], dtype=float).reshape(-1, 4)
        speeds = np.array([speed[2:] for speed in self.speeds], dtype=float).reshape(-1, 2)
        return Observations(
            id=name,
            fix_ns=np.array([fix.stamp_ns for fix in self.fixes], dtype=np.int64),
            fix=fixes[:, :2],
            fix_row=np.array([fix.row for fix in self.fixes], dtype=np.int64),
            heading=fixes[:, 2],
            speed_ns=np.array([speed.stamp_ns for speed in self.speeds], dtype=np.int64),
            speed=speeds[:, 0],
            speed_row=np.array([speed.row for speed in self.speeds], dtype=np.int64),
            height=fixes[:, 3],
            course=speeds[:, 1],
        )


@dataclass(frozen=True)
class Segment:
    """Rows from `first` on are from `label`, called `unit` there, numbered from `number`."""

    first: int
    label: str
    unit: str
    number: int


@dataclass(frozen=True, eq=False)
class RawLog:
    """A log as it was read, before any cleaning.

    Attributes:
        name: the log's name, for people.
        geographic: positions are latitude and longitude, not metres.
        vehicles: observations of each vehicle, by first appearance.
        rows: number of rows read.
        segments: where the rows come from, in order.
        notes: for people, on how it was read.
        dropped: rows that the reader left out: (cause, row).
        excluded: number of road users left out, by what the log calls their type.
        separators: further columns that tell apart rows of one vehicle with the same stamp.
        columns: of a table, by quantity; they tell whether a unit is named or assumed.
        doubts: of the reader.
        signals: traffic lights whose states were recorded, on the clock of the vehicles.
        encounters: those of a recorded `tracks` topic, used unchanged; then without vehicles.
    """

    name: str
    geographic: bool
    vehicles: tuple[Observations, ...]
    rows: int
    segments: tuple[Segment, ...]
    notes: tuple[str, ...] = ()
    dropped: tuple[tuple[str, int], ...] = ()
    encounters: tuple[Encounter, ...] = ()
    excluded: Mapping[str, int] = field(default_factory=dict)
    separators: tuple[str, ...] = ()
    columns: Mapping[str, Column] = field(default_factory=dict)
    doubts: tuple[Doubt, ...] = ()
    signals: tuple[RawSignal, ...] = ()

    def segment(self, row: int) -> Segment:
        """Return where a row comes from."""
        return self.segments[bisect_right([s.first for s in self.segments], row) - 1]

    def where(self, row: int) -> str:
        """Name the file and line (or topic and message) of a row."""
        segment = self.segment(row)
        return f"{renamed(segment.label)}, {segment.unit} {segment.number + row - segment.first}"


MAX_NUMBER_LENGTH_COUNT = 300
"""Characters: float64 has no longer number, and Python refuses to read 4,300 digits."""


def natural(name: str) -> tuple[int, int, str]:
    """Sort key of names in which whole numbers sort by value, before the rest."""
    is_number = name.isascii() and name.isdigit() and len(name) < MAX_NUMBER_LENGTH_COUNT
    return (0, int(name), name) if is_number else (1, 0, name)


def only_file(paths: Sequence[Path], config: LogConfig) -> Path:
    """Return the only path of a log whose format allows one file: each has its own clock.

    Raises:
        InputError: there are several, or the file is too large.
    """
    if len(paths) != 1:
        raise InputError(
            f"{paths[0]} and {len(paths) - 1} more: each has its own clock; read one at a time"
        )
    check_size(str(paths[0]), paths[0].stat().st_size, 0, config)
    return paths[0]


def check_size(where: str, size: int, rows: int, config: LogConfig) -> None:
    """Check a log against `size_limit` and `row_limit`.

    Args:
        where: the file; begins the message.
        size: bytes, decompressed.
        rows: rows or messages.
        config: names the limits.

    Raises:
        InputError: the log is too large.
    """
    if size > config.size_limit << 20:
        raise InputError(
            f"{where} has at least {size / 2**20:.1f} MiB after decompression (limit "
            f"{config.size_limit} MiB): cut the log, or raise --set log.size_limit=…"
        )
    if rows > config.row_limit:
        raise InputError(
            f"{where} has at least {rows} rows (limit {config.row_limit}): cut the log, "
            "or raise --set log.row_limit=…"
        )


def check_vehicles(where: str, count: int, config: LogConfig) -> None:
    """Check a log against `vehicle_limit`.

    Raises:
        InputError: it has too many vehicles.
    """
    if count > config.vehicle_limit:
        raise InputError(
            f"{where}: {count} vehicles (limit {config.vehicle_limit}); check "
            "--set log.columns=vehicle=…, or raise --set log.vehicle_limit=…"
        )
