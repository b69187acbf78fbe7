# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Encounters cut out of smooth pieces, or out of encounters that were recorded as such."""

from collections.abc import Sequence
import math

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.logs.config import chosen_vehicles, LogConfig
from scenario_gen.logs.encounters import Piece
from scenario_gen.logs.geodesy import in_own_frame
from scenario_gen.logs.growing import Group, Meeting
from scenario_gen.logs.quality import EncounterQuality, find_overlaps, Quality
from scenario_gen.logs.raw import RawLog
from scenario_gen.types import cut, Encounter, tokens, Vehicle


def cut_encounter(
    name: str, group: Group[Meeting], pieces: Sequence[Piece], origin_ns: int, config: LogConfig
) -> tuple[Encounter, list[str]]:
    """Cut a group out of its pieces; a vehicle with unknown heading faces east, with a note.

    Args:
        name: of the encounter.
        group: members with their ticks.
        pieces: all pieces of the log.
        origin_ns: stamp of the first tick.
        config: names period and origin.

    Raises:
        InputError: two vehicles would have the same name in ROS.
    """
    spans = dict(sorted(group.spans.items()))
    members = [pieces[member] for member in spans]
    tokens(piece.track.id for piece in members)
    notes = []
    position, heading, speed = [], [], []
    for piece, (first, last) in zip(members, spans.values(), strict=True):
        samples = np.clip(np.arange(group.start, group.end), first, last - 1) - piece.first
        position.append(piece.smooth.position[samples])
        speed.append(piece.smooth.speed[samples])
        piece_heading = piece.smooth.heading[samples]
        if np.isnan(piece_heading).any():
            notes.append(
                f"vehicle {piece.track.id} never moves and its heading is not recorded: "
                "taken as east"
            )
            piece_heading = np.zeros(len(samples))
        heading.append(piece_heading)

    tracks = [piece.track for piece in members]
    dt_ns = round(config.period * 1e9)
    encounter = Encounter.sampled(
        tuple(Vehicle(t.id, t.length, t.width, t.kind, t.trailer) for t in tracks),
        config.period,
        np.array(position),
        np.array(heading),
        np.array(speed),
        name=name,
        start_ns=origin_ns + group.start * dt_ns,
        origin=tracks[0].origin,
        present=np.array(list(spans.values())) - group.start - np.array([0, 1]),
    )
    return encounter if config.origin else in_own_frame(encounter), notes


def recorded_encounters(log: RawLog, config: LogConfig) -> tuple[tuple[Encounter, ...], Quality]:
    """Return encounters that were recorded as such, in the chosen window, of the chosen vehicles.

    Raises:
        InputError: a vehicle is unknown, or fewer than two vehicles are left.
    """
    encounters = []
    notes = list(log.notes)
    for recorded in log.encounters:
        encounter, encounter_notes = _selected(recorded, config)
        encounters.append(encounter)
        notes += encounter_notes
    qualities = tuple(map(encounter_quality, encounters))
    quality = Quality(log.name, log.rows, (), (), qualities, tuple(notes))
    return tuple(encounters), quality


def _selected(encounter: Encounter, config: LogConfig) -> tuple[Encounter, list[str]]:
    """Return the chosen window and vehicles of an encounter, and notes on absent vehicles.

    Raises:
        InputError: a vehicle is unknown, or fewer than two vehicles are left.
    """
    ids = encounter.ids
    requested = [ids.index(name) for name in chosen_vehicles(ids, config, encounter.name)]
    if config.start >= encounter.duration:
        raise InputError(
            f"parameter start is {config.start:g} s, but {encounter.name} is only "
            f"{encounter.duration:.1f} s long"
        )
    n_samples = len(encounter.time)
    begin = math.ceil(config.start / encounter.dt - 1e-9)
    end = math.floor(config.end / encounter.dt + 1e-9) + 1 if config.end else n_samples
    end = min(end, n_samples)
    present = cut(encounter.present, begin, end)
    rows = [row for row in requested if present[row, 1] > present[row, 0]]
    if len(rows) < 2:
        raise InputError(
            f"encounter {encounter.name!r}: {len(rows)} of {len(requested)} vehicles are recorded "
            f"between {config.start:g} s and {(end - 1) * encounter.dt:g} s; at least 2 are "
            "needed: change --set log.start=…, log.end=… or log.vehicles=…"
        )

    first = begin + int(present[rows, 0].min())
    last = begin + int(present[rows, 1].max())
    notes = [
        f"vehicle {ids[row]} is left out: it is not recorded in the requested time"
        for row in requested
        if row not in rows
    ]
    return encounter.select(rows, first, last), notes


def encounter_quality(encounter: Encounter) -> EncounterQuality:
    """Return the quality of an encounter."""
    ids = encounter.ids
    last = len(encounter.time) - 1
    partly = tuple(
        (name, float(encounter.time[begin]), float(encounter.time[end]))
        for name, (begin, end) in zip(ids, encounter.present.tolist(), strict=True)
        if (begin, end) != (0, last)
    )
    overlaps = find_overlaps(encounter)
    return EncounterQuality(encounter.name, ids, encounter.duration, overlaps, partly)
