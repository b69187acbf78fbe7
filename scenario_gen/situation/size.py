# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Which encounters can be used: small enough for minutes and gigabytes, and driven forwards."""

from itertools import combinations

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import ahead_and_left
from scenario_gen.types import Encounter

MAX_VEHICLES = 64  # the largest encounter that is cut from a log
MAX_VEHICLE_TIME_S = 4000.0  # two vehicles for 1,000 s take two minutes and 1 GB
MAX_DURATION_S = 1000.0  # memory grows with the square of the duration
MAX_SAMPLES = 45_000  # of all vehicles; the segmentation needs 16 kB for each
MAX_DISTANCE_M = 2000.0  # to the nearest vehicle, the limit of `log.proximity`
MAX_REVERSING_M = 2.0
MAX_EXTENT_M = 2000.0  # of a vehicle's positions,
MAX_EXTENT_RATIO = 4.0  # or so many times the distance that it drives
SHOWN_CHARACTERS = 50  # of a vehicle's id


def refuse_too_large(encounter: Encounter) -> None:
    """Refuse an encounter that would take hours.

    Raises:
        RefusedError: it is too long for its number of vehicles, has too many of them or too many
            samples, or its vehicles are too far from each other; the message says what fits.
    """
    count, seconds = len(encounter.vehicles), encounter.duration
    name = encounter.name
    if count > MAX_VEHICLES:
        raise RefusedError(
            f"{name}: {count} vehicles, {MAX_VEHICLES} are possible; use fewer with"
            f" --set log.max_vehicles={MAX_VEHICLES}, or choose with --set log.vehicles=ID,ID"
        )
    if count * seconds > MAX_VEHICLE_TIME_S or seconds > MAX_DURATION_S:
        longest = int(min(MAX_VEHICLE_TIME_S / count, MAX_DURATION_S))
        fewer = int(MAX_VEHICLE_TIME_S / seconds)
        alternative = ""
        if fewer >= 2 and seconds <= MAX_DURATION_S:
            alternative = f", or use {fewer} vehicles: --set log.max_vehicles={fewer}"
        raise RefusedError(
            f"{name}: {count} vehicles for {seconds:.0f} s are {count * seconds:.0f} vehicle"
            f" seconds, {MAX_VEHICLE_TIME_S:.0f}, and {MAX_DURATION_S:.0f} s, are possible;"
            f" cut it to {longest} s: --set log.max_duration={longest}{alternative}"
        )
    if encounter.speed.size > MAX_SAMPLES:
        raise RefusedError(
            f"{name}: {count} vehicles with a sample every {encounter.dt:g} s have"
            f" {encounter.speed.size} samples, {MAX_SAMPLES} are possible; resample the tracks"
            " (10 Hz is usual): --set log.period=0.1"
        )
    _refuse_scattered(encounter)


def refuse_reversing(encounter: Encounter) -> None:
    """Refuse an encounter with a vehicle that drives backwards, since no scenario would.

    Raises:
        RefusedError: a vehicle drives more than 2 m against its heading.
    """
    for n, vehicle in enumerate(encounter.vehicles):
        rows = np.flatnonzero(encounter.is_present[n])
        heading = encounter.heading[n, rows]
        step = np.diff(encounter.position[n, rows], axis=0)
        ahead, left = ahead_and_left(step, (heading[1:] + heading[:-1]) / 2.0)
        backwards = np.where(ahead < -np.abs(left), -ahead, 0.0)
        if backwards.sum() > MAX_REVERSING_M:
            start = encounter.time[rows[int(np.argmax(backwards > 0.0))]]
            raise RefusedError(
                f"{encounter.name}: vehicle {vehicle.id[:SHOWN_CHARACTERS]} drives backwards for"
                f" {backwards.sum():.1f} m, from {start:.1f} s on; scenarios only drive forwards:"
                " leave it out (log.vehicles names the vehicles to use), or cut the log there"
            )


def _refuse_scattered(encounter: Encounter) -> None:
    """Refuse vehicles with impossible positions: roads and grids would be as large as these.

    Raises:
        RefusedError: a vehicle's positions are farther apart than it drives, or it is never near
            another one.
    """
    driven = encounter.speed.sum(axis=1) * encounter.dt
    extents = np.ptp(encounter.position, axis=1).max(axis=1)
    for vehicle, extent, distance in zip(encounter.vehicles, extents, driven, strict=True):
        if extent > MAX_EXTENT_M + MAX_EXTENT_RATIO * distance:
            raise RefusedError(
                f"{encounter.name}: the positions of vehicle {vehicle.id[:SHOWN_CHARACTERS]} are"
                f" up to {extent:.3g} m apart while its speeds add up to {distance:.3g} m;"
                " correct its positions, or leave it out"
            )
    nearest = np.full(len(encounter.vehicles), np.inf)
    for a, b in combinations(range(len(encounter.vehicles)), 2):
        gap = np.hypot(*(encounter.position[a] - encounter.position[b]).T).min()
        nearest[[a, b]] = np.minimum(nearest[[a, b]], gap)
    farthest = int(np.argmax(nearest))
    if nearest[farthest] > MAX_DISTANCE_M:
        raise RefusedError(
            f"{encounter.name}: vehicle {encounter.vehicles[farthest].id[:SHOWN_CHARACTERS]} is"
            f" never nearer than {nearest[farthest]:.3g} m to another, {MAX_DISTANCE_M:g} m are"
            " possible; correct its positions, or leave it out"
        )
