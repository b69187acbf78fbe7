# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The data-quality summary of a log: rows read and dropped, gaps bridged, speeds reconciled, overlaps in the record."""

from dataclasses import dataclass
from itertools import combinations
import math

import numpy as np
import shapely

from scenario_gen.numerics.boxes import corners
from scenario_gen.types import Encounter, together


@dataclass(frozen=True)
class Dropped:
    """`count` rows left out (or sorted) for `reason`; `first` names the place of the first of them."""

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
        reversals: stops at which the track was cut because the vehicle drove back where it came from.
        speed_before: RMS of measured speed less speed of the raw positions [m/s].
        speed_after: RMS of published speed less speed of the published positions [m/s].
        changed: RMS of measured less published speed [m/s].
        moved: RMS distance between raw and published positions [m].
        moved_most: the largest such distance [m].
        noise: standard deviation of the fixes [m], as estimated from the track (or as given); how smooth it is follows from it.
        turned: median difference of recorded and published headings while it moves [rad]; NaN if none is recorded.
        headings: share of the recorded headings that were used; the others contradict the path, or jump.
        lost: seconds of pieces that are left out, since no motion of a car fits them.
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
    speed_after: float
    changed: float
    moved: float
    moved_most: float
    noise: float = math.nan
    turned: float = math.nan
    headings: float = math.nan
    lost: float = 0.0


@dataclass(frozen=True)
class Overlap:
    """The recorded footprints of two vehicles overlap during `share` of the encounter, at most by `area` m²."""

    first: str
    second: str
    share: float
    area: float

    def __str__(self) -> str:
        return (
            f"recorded footprints of {self.first} and {self.second} overlap {100 * self.share:.0f} % of the time "
            f"(up to {self.area:.1f} m²)"
        )


@dataclass(frozen=True)
class EncounterQuality:
    """Facts of one encounter that are reported, not repaired.

    Attributes:
        name: the encounter's.
        vehicles: their names.
        seconds: how long it lasts.
        overlaps: recorded overlaps of footprints.
        partly: vehicles that are there for a part of it: name, from when, to when [s].
    """

    name: str
    vehicles: tuple[str, ...]
    seconds: float
    overlaps: tuple[Overlap, ...]
    partly: tuple[tuple[str, float, float], ...] = ()


@dataclass(frozen=True)
class Quality:
    """The summary of a log; `rows` counts what was read."""

    name: str
    rows: int
    dropped: tuple[Dropped, ...]
    vehicles: tuple[VehicleQuality, ...]
    encounters: tuple[EncounterQuality, ...]
    notes: tuple[str, ...] = ()

    def remarks(self) -> tuple[str, ...]:
        """Return what a person should know before anything is made of the log."""
        overlaps = [
            f"encounter {encounter.name}: {overlap}"
            for encounter in self.encounters
            for overlap in encounter.overlaps
        ]
        return (*self.notes, *overlaps)

    def lines(self) -> tuple[str, ...]:
        """Return the summary for people, one fact per line."""
        out = [
            f"{self.name}: {self.rows} rows of {len(self.vehicles)} vehicles, {len(self.encounters)} encounter(s)"
        ]
        out += [f"  {drop}" for drop in self.dropped]
        out += [vehicle_line(vehicle) for vehicle in self.vehicles]
        for encounter in self.encounters:
            out.append(
                f"  encounter {encounter.name}: {encounter.seconds:.1f} s of {', '.join(encounter.vehicles)}"
            )
            if encounter.partly:
                out.append(
                    "    vehicle "
                    + ", vehicle ".join(
                        f"{name} from {a:.1f} to {b:.1f} s" for name, a, b in encounter.partly
                    )
                )
            out += [f"    {overlap}" for overlap in encounter.overlaps]
        return (*out, *(f"  {note}" for note in self.notes))


def vehicle_line(vehicle: VehicleQuality) -> str:
    """Return a vehicle's quality in one line."""
    gaps = (
        f"{vehicle.bridged} gaps bridged (up to {vehicle.longest_bridged:.1f} s)"
        if vehicle.bridged
        else "no gaps bridged"
    )
    if vehicle.cut:
        gaps += f", cut at {vehicle.cut} (up to {vehicle.longest_cut:.1f} s)"
    if vehicle.reversals:
        gaps += f", cut at {vehicle.reversals} reversals"
    headings = ""
    if math.isfinite(vehicle.headings):
        headings = f"; {100.0 * vehicle.headings:.0f} % of its headings used"
        headings += (
            f", changed by {math.degrees(vehicle.turned):.1f}° (median)"
            if math.isfinite(vehicle.turned)
            else ""
        )
    return (
        f"  vehicle {vehicle.id}: {vehicle.fixes} fixes, {vehicle.seconds:.1f} s; {gaps}; speed against position "
        f"{vehicle.speed_before:.2f} → {vehicle.speed_after:.2f} m/s RMS, speeds changed by {vehicle.changed:.2f} m/s, "
        f"positions by {vehicle.moved:.2f} m RMS (at most {vehicle.moved_most:.1f} m; noise of the fixes {vehicle.noise:.2f} m)"
        + headings
    )


def find_overlaps(encounter: Encounter) -> tuple[Overlap, ...]:
    """Return the pairs whose footprints overlap at some sample, with the share of their common samples and the largest area."""
    poses = np.concatenate([encounter.position, encounter.heading[..., None]], axis=-1)
    footprints = [
        corners(poses[n], vehicle.length, vehicle.width)
        for n, vehicle in enumerate(encounter.vehicles)
    ]
    polygons = [shapely.polygons(each) for each in footprints]
    overlaps = []
    for a, b in combinations(range(len(polygons)), 2):
        area = shapely.area(shapely.intersection(polygons[a], polygons[b]))
        area = area[together(encounter.present, a, b)]
        share = float((area > 0.0).mean()) if len(area) else 0.0
        if share > 0.0:
            overlaps.append(
                Overlap(
                    encounter.vehicles[a].id, encounter.vehicles[b].id, share, float(area.max())
                )
            )
    return tuple(overlaps)
