# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What can be a template: no larger than takes minutes and some gigabytes, and driven forwards."""

from itertools import combinations

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics.plane import ahead_and_left
from scenario_gen.types import Encounter

MOST_VEHICLES = 64  # as many as a log is cut into at most
MOST_VEHICLE_SECONDS = 4000.0  # two vehicles for 1,000 s take some two minutes and 1 GB; effort grows faster than the duration
MOST_SECONDS = 1000.0  # memory grows with the square of the duration
MOST_SAMPLES = (
    45_000  # of all vehicles: those seconds at 10 Hz; the segmenter keeps some 16 kB for each
)
FARTHEST_APART = 2000.0  # m: as `log.proximity` at most
REVERSED = 2.0  # m of path against its heading from which on a vehicle drives backwards
STRAY, OUT_OF_PROPORTION = (
    2000.0,
    4.0,
)  # a vehicle's places span at most so many metres, and so many times what it drives


def refuse_too_large(encounter: Encounter) -> None:
    """Refuse an encounter that would take hours, before anything is done with it.

    Raises:
        RefusedError: it is too long for its number of vehicles, has too many, or its vehicles are not where they can be; the
            message says what would fit.
    """
    count, seconds = len(encounter.vehicles), encounter.duration
    if count > MOST_VEHICLES:
        raise RefusedError(
            f"{encounter.name}: {count} vehicles, {MOST_VEHICLES} are possible; keep fewer with --set "
            f"log.max_vehicles={MOST_VEHICLES}, or name those that matter with --set log.vehicles=ID,ID"
        )
    if count * seconds > MOST_VEHICLE_SECONDS or seconds > MOST_SECONDS:
        longest, fewer = (
            int(min(MOST_VEHICLE_SECONDS / count, MOST_SECONDS)),
            int(MOST_VEHICLE_SECONDS / seconds),
        )
        instead = (
            f", or keep {fewer} vehicles: --set log.max_vehicles={fewer}"
            if fewer >= 2 and seconds <= MOST_SECONDS
            else ""
        )
        raise RefusedError(
            f"{encounter.name}: {count} vehicles for {seconds:.0f} s are {count * seconds:.0f} vehicle seconds, "
            f"{MOST_VEHICLE_SECONDS:.0f}, and {MOST_SECONDS:.0f} s, are possible; cut it to {longest} s: "
            f"--set log.max_duration={longest}{instead}"
        )
    if encounter.speed.size > MOST_SAMPLES:
        raise RefusedError(
            f"{encounter.name}: {count} vehicles with a sample every {encounter.dt:g} s have {encounter.speed.size} samples, "
            f"{MOST_SAMPLES} are possible; resample the tracks (10 Hz is usual): --set log.period=0.1"
        )
    _refuse_scattered(encounter)


def refuse_reversing(encounter: Encounter) -> None:
    """Refuse an encounter in which somebody drives backwards, which no scenario would.

    Raises:
        RefusedError: a vehicle moves against its heading for more than `REVERSED` in all.
    """
    for vehicle, position, heading, there in zip(
        encounter.vehicles,
        encounter.position,
        encounter.heading,
        encounter.is_present,
        strict=True,
    ):
        step, yaw = np.diff(position[there], axis=0), heading[there]
        ahead, aside = ahead_and_left(step, (yaw[1:] + yaw[:-1]) / 2.0)
        back = np.where(ahead < -np.abs(aside), -ahead, 0.0)
        if back.sum() > REVERSED:
            at = float(encounter.time[int(np.flatnonzero(there)[0]) + int(np.argmax(back > 0.0))])
            raise RefusedError(
                f"{encounter.name}: vehicle {vehicle.id[:50]} drives backwards for {back.sum():.1f} m, from {at:.1f} s on; only "
                "driving forwards is generated: leave it out (log.vehicles names who is kept), or cut the log there"
            )


def _refuse_scattered(encounter: Encounter) -> None:
    """Refuse vehicles that are not where they can be: roads, grids and searches would be as large as their distances.

    Raises:
        RefusedError: a vehicle's places are farther apart than it drives, or it is never near another one.
    """
    driven = encounter.speed.sum(axis=1) * encounter.dt
    spans = np.ptp(encounter.position, axis=1).max(axis=1)
    for vehicle, span, way in zip(encounter.vehicles, spans, driven, strict=True):
        if span > STRAY + OUT_OF_PROPORTION * way:
            raise RefusedError(
                f"{encounter.name}: the positions of vehicle {vehicle.id[:50]} are up to {span:.3g} m apart while its speeds "
                f"add up to {way:.3g} m; correct its positions, or leave it out"
            )
    nearest = np.full(len(encounter.vehicles), np.inf)
    for a, b in combinations(range(len(encounter.vehicles)), 2):
        gap = np.hypot(*(encounter.position[a] - encounter.position[b]).T).min()
        nearest[[a, b]] = np.minimum(nearest[[a, b]], gap)
    far = int(np.argmax(nearest))
    if nearest[far] > FARTHEST_APART:
        raise RefusedError(
            f"{encounter.name}: vehicle {encounter.vehicles[far].id[:50]} is never nearer than {nearest[far]:.3g} m to another, "
            f"{FARTHEST_APART:g} m are possible; correct its positions, or leave it out"
        )
