# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Trailers with tracks of their own become parts of the vehicles that tow them."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import chain, permutations

import numpy as np

from scenario_gen.logs.encounters import Piece
from scenario_gen.logs.kinds import MAX_LENGTH_M
from scenario_gen.logs.raw import Observations
from scenario_gen.numerics import ahead_and_left
from scenario_gen.types import Encounter, together, TRAILER, Trailer, TRUCK, Vehicle


@dataclass(frozen=True)
class _CouplingLimits:
    """What shows that one vehicle tows another one; no driver follows like that.

    Attributes:
        min_travel_m: way on which it is seen.
        max_gap_m: between the bumpers.
        max_change_m: of the distance between the centres of a vehicle and a trailer, in bends.
        max_truck_change_m: of that between two trucks.
        max_named_change_m: of that to a trailer that the log names.
        drawbar_m: of a trailer with only its length known.
        min_length_m: of such a trailer; smaller numbers are flags.
    """

    min_travel_m: float = 20.0
    max_gap_m: float = 3.0
    max_change_m: float = 1.0
    max_truck_change_m: float = 0.3
    max_named_change_m: float = 3.0
    drawbar_m: float = 1.0
    min_length_m: float = 1.5


_LIMITS = _CouplingLimits()


def coupled(
    pieces: Sequence[Piece], encounters: Sequence[Encounter]
) -> tuple[list[Piece], list[str]]:
    """Return the pieces without those of trailers, which their vehicles tow; and notes.

    A vehicle's trailer is the one that the log names, or else the trailer or truck that keeps
    its distance behind it in an encounter.
    """
    names = {piece.track.id: piece.track.trailer_name for piece in pieces}
    notes: list[str] = []
    towed = _towed(encounters, names, notes)
    parts = {trailer.id for trailer in towed.values()}
    kept = []
    for piece in pieces:
        track = piece.track
        if track.id in parts:
            continue
        known = towed.get(track.id) or track.trailer
        name = track.trailer_name
        if known is None and name:
            known = None if name in names else _with_length(track)
            fate = (
                f"{known.length:g} m long"
                if known
                else "left out: neither a vehicle behind it nor metres"
            )
            notes.append(f"vehicle {track.id} has the trailer {name}; {fate}")
        kept.append(replace(piece, track=replace(track, trailer=known)))
    return kept, list(dict.fromkeys(notes))


def _towed(
    encounters: Sequence[Encounter], names: Mapping[str, str], notes: list[str]
) -> dict[str, Trailer]:
    """Return the trailers with tracks of their own, by the vehicle that tows them; add notes."""
    towed: dict[str, Trailer] = {}
    taken: set[str] = set()
    for vehicle, trailer, distance in chain.from_iterable(_pairs(e, names) for e in encounters):
        if taken & {vehicle.id, trailer.id}:
            continue
        taken |= {vehicle.id, trailer.id}
        reach = max(distance - vehicle.half[0], 0.5 * distance)
        size = (trailer.length, trailer.width)
        towed[vehicle.id] = Trailer(trailer.id, *size, distance - reach, reach)
        notes.append(
            f"vehicle {trailer.id} is the trailer of {vehicle.id}, {distance:.1f} m behind it: "
            "both are one road user"
        )
    return towed


def _with_length(track: Observations) -> Trailer | None:
    """Return the trailer of which the log has the length; None if it has not."""
    with suppress(ValueError):
        length = float(track.trailer_name)
        if _LIMITS.min_length_m <= length <= MAX_LENGTH_M:
            half = 0.5 * track.length
            reach = _LIMITS.drawbar_m + 0.5 * length
            return Trailer(f"{track.id}_trailer", length, track.width, half, reach)
    return None


def _pairs(
    encounter: Encounter, names: Mapping[str, str]
) -> Iterator[tuple[Vehicle, Vehicle, float]]:
    """Yield each vehicle with its trailer and the distance [m] of their centres.

    Args:
        encounter: a part of the log.
        names: the trailers that the log names, by vehicle.
    """
    for a, b in permutations(range(len(encounter.vehicles)), 2):
        vehicle, trailer = encounter.vehicles[a], encounter.vehicles[b]
        common = together(encounter.present, a, b)
        is_named = names[vehicle.id] == trailer.id
        limits = {TRAILER: _LIMITS.max_change_m, TRUCK: _LIMITS.max_truck_change_m}
        limit = _LIMITS.max_named_change_m if is_named else limits.get(trailer.type, 0.0)
        if common.stop == common.start or not limit:
            continue
        offset = encounter.position[b, common] - encounter.position[a, common]
        low, distance, high = np.percentile(np.hypot(*offset.T), [5.0, 50.0, 95.0]).tolist()
        ahead, _ = ahead_and_left(offset, encounter.heading[a, common])
        driven = float(encounter.speed[b, common].sum() * encounter.dt)
        is_close = distance - vehicle.half[0] - trailer.half[0] <= _LIMITS.max_gap_m
        is_seen = is_close and driven >= _LIMITS.min_travel_m
        if (is_named or is_seen) and high - low <= limit and (ahead < 0.0).all():
            yield vehicle, trailer, distance
