# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The data quality of a log: dropped rows, bridged gaps, overlaps, and doubts about a reading."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import combinations
import math

import numpy as np
import shapely

from scenario_gen.base.errors import InputError
from scenario_gen.numerics.boxes import corners
from scenario_gen.types import Encounter, together


@dataclass(frozen=True)
class Dropped:
    """`count` rows dropped (or sorted) for `reason`; `first` is the place of the first one."""

    reason: str
    count: int
    first: str

    def __str__(self) -> str:
        return f"{self.count} × {self.reason}, first at {self.first}"


@dataclass(frozen=True)
class VehicleQuality:
    """How well one vehicle was recorded.

    Attributes:
        id: the vehicle.
        fixes: positions used.
        seconds: time on the common clock.
        pieces: uninterrupted pieces.
        bridged: gaps that were bridged.
        longest_bridged: the longest of them [s].
        cut: gaps at which the track was cut.
        longest_cut: the longest of them [s].
        reversals: stops at which the track was cut because the vehicle reversed.
        speed_before: RMS of measured speed minus speed of the raw positions [m/s].
        moved: RMS distance between raw and smooth positions [m].
        noise: standard deviation of the fixes [m], estimated or given; determines smoothness.
        lost: seconds of pieces left out, since no motion of a car fits them.
        smoothed: whether its motion was smoothed; not if it comes near no other vehicle.
    """

    id: str
    fixes: int
    seconds: float
    pieces: int
    bridged: int
    longest_bridged: float
    cut: int
    longest_cut: float
    reversals: int
    speed_before: float
    moved: float
    noise: float = math.nan
    lost: float = 0.0
    smoothed: bool = True


@dataclass(frozen=True)
class Overlap:
    """Two footprints overlap during `share` of the encounter, by up to `area` m²."""

    first: str
    second: str
    share: float
    area: float

    def __str__(self) -> str:
        return (
            f"recorded footprints of {self.first} and {self.second} overlap "
            f"{100 * self.share:.0f} % of the time (up to {self.area:.1f} m²)"
        )


@dataclass(frozen=True)
class EncounterQuality:
    """Facts about one encounter that are reported, not repaired.

    Attributes:
        name: of the encounter.
        vehicles: ids.
        seconds: its duration.
        overlaps: recorded overlaps of footprints.
        partly: vehicles present for a part of it: id, start and end [s].
    """

    name: str
    vehicles: tuple[str, ...]
    seconds: float
    overlaps: tuple[Overlap, ...]
    partly: tuple[tuple[str, float, float], ...] = ()


@dataclass(frozen=True)
class Quality:
    """The quality of a log; `rows` is the number of rows read."""

    name: str
    rows: int
    dropped: tuple[Dropped, ...]
    vehicles: tuple[VehicleQuality, ...]
    encounters: tuple[EncounterQuality, ...]
    notes: tuple[str, ...] = ()

    def remarks(self) -> tuple[str, ...]:
        """Return notes and overlaps: what a user should know before using the log."""
        overlaps = [
            f"encounter {encounter.name}: {overlap}"
            for encounter in self.encounters
            for overlap in encounter.overlaps
        ]
        return (*self.notes, *overlaps)

    def lines(self) -> tuple[str, ...]:
        """Return a summary for people, one fact per line."""
        lines = [
            f"{self.name}: {self.rows} rows of {len(self.vehicles)} vehicles, "
            f"{len(self.encounters)} encounter(s)"
        ]
        lines += [f"  {drop}" for drop in self.dropped]
        lines += map(_vehicle_line, self.vehicles)
        for encounter in self.encounters:
            names = ", ".join(encounter.vehicles)
            lines.append(f"  encounter {encounter.name}: {encounter.seconds:.1f} s of {names}")
            parts = [
                f"vehicle {name} from {start:.1f} to {end:.1f} s"
                for name, start, end in encounter.partly
            ]
            lines += [f"    {', '.join(parts)}"] if parts else []
            lines += [f"    {overlap}" for overlap in encounter.overlaps]
        return (*lines, *(f"  {note}" for note in self.notes))


def _vehicle_line(vehicle: VehicleQuality) -> str:
    """Return a vehicle's quality in one line."""
    gaps = "no gaps bridged"
    if vehicle.bridged:
        gaps = f"{vehicle.bridged} gaps bridged (up to {vehicle.longest_bridged:.1f} s)"
    if vehicle.cut:
        gaps += f", cut at {vehicle.cut} (up to {vehicle.longest_cut:.1f} s)"
    if vehicle.reversals:
        gaps += f", cut at {vehicle.reversals} reversals"
    recorded = f"  vehicle {vehicle.id}: {vehicle.fixes} fixes, {vehicle.seconds:.1f} s; {gaps}; "
    if not vehicle.smoothed:
        return f"{recorded}not smoothed, since it comes near no other vehicle"
    return (
        f"{recorded}speed against position {vehicle.speed_before:.2f} m/s RMS, positions changed "
        f"by {vehicle.moved:.2f} m RMS (noise of the fixes {vehicle.noise:.2f} m)"
    )


def find_overlaps(encounter: Encounter) -> tuple[Overlap, ...]:
    """Return the pairs whose footprints overlap at some sample."""
    poses = np.concatenate([encounter.position, encounter.heading[..., None]], axis=-1)
    polygons = [
        shapely.polygons(corners(poses[n], vehicle.length, vehicle.width))
        for n, vehicle in enumerate(encounter.vehicles)
    ]
    overlaps = []
    for a, b in combinations(range(len(polygons)), 2):
        area = shapely.area(shapely.intersection(polygons[a], polygons[b]))
        area = area[together(encounter.present, a, b)]
        if (area > 0.0).any():
            first = encounter.vehicles[a].id
            second = encounter.vehicles[b].id
            share = float((area > 0.0).mean())
            overlaps.append(Overlap(first, second, share, float(area.max())))
    return tuple(overlaps)


ALLOWED = "doubt"
"""Value of the parameter `allow` with which a log in doubt is read."""


class Quantity(Enum):
    """The quantity that is in doubt; the value is for people."""

    POSITION = "position"
    SPEED = "speed"
    CLOCK = "clock"
    FRAME = "frame"
    ROWS = "rows"
    VEHICLE = "vehicle"


@dataclass(frozen=True)
class Doubt:
    """A contradiction between the result of reading and the raw data.

    Attributes:
        quantity: what is in doubt.
        size: of the contradiction, in `unit`.
        cause: the contradiction, and its likely cause.
        remedy: the option that would read the log right; "" if unknown.
        vehicle: its id; "" if the doubt concerns the whole log.
        start: seconds since the log's first stamp.
        end: seconds since the log's first stamp; equal to `start` for the whole log.
        unit: of `size`, e.g. "m"; "" for a ratio.
        stops: whether it stops the reading, unless the parameter `allow` is `doubt`.
    """

    quantity: Quantity
    size: float
    cause: str
    remedy: str = ""
    vehicle: str = ""
    start: float = 0.0
    end: float = 0.0
    unit: str = ""
    stops: bool = True

    def __str__(self) -> str:
        subject = f"vehicle {self.vehicle}, " if self.vehicle else ""
        interval = f"{self.start:.1f} to {self.end:.1f} s: " if self.end > self.start else ""
        remedy = f"; {self.remedy}" if self.remedy else ""
        return f"{subject}{interval}{self.cause}{remedy}"


class DoubtError(InputError):
    """The result of reading contradicts the raw data, and the parameter `allow` is not set."""


def check_doubts(place: str, doubts: Sequence[Doubt], allow: str) -> None:
    """Check that no doubt stops the reading.

    Raises:
        DoubtError: one does; the message names it, and its remedy.
    """
    stopping = [doubt for doubt in doubts if doubt.stops]
    if not stopping or allow == ALLOWED:
        return
    raise DoubtError(f"{place}: {'; '.join(map(str, stopping[:3]))}")
