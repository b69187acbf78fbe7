# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""From files to encounters: choose the reader, clean, smooth, group, cut."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from scenario_gen.base.errors import InputError
from scenario_gen.base.folders.scratch import scratch
from scenario_gen.base.stores import naming_objects, temporary
from scenario_gen.logs.cleaning import clean, Drops
from scenario_gen.logs.clock import check_unit, retimed
from scenario_gen.logs.config import LogConfig, picked
from scenario_gen.logs.encounters import Piece, pieces_of, plausible
from scenario_gen.logs.files import read_raw
from scenario_gen.logs.geodesy import about_its_middle, EARTH_M
from scenario_gen.logs.groups import distances, driven, find_groups, ticks
from scenario_gen.logs.growing import Group, Meeting
from scenario_gen.logs.kinds import typed
from scenario_gen.logs.quality import EncounterQuality, find_overlaps, Quality, VehicleQuality
from scenario_gen.logs.raw import natural, Observations, RawLog
from scenario_gen.logs.smoothing import DOUBTED_MPS
from scenario_gen.logs.units import remarks_on_units
from scenario_gen.numerics import runs
from scenario_gen.types import cut, Encounter, tokens, Vehicle

if TYPE_CHECKING:
    from pandas import DataFrame

FAR_M = 200_000.0  # from an origin that is given: there distances are 0.02 % too long
MUCH = 0.02  # of the rows: if more are left out, people are told at once
TABLE = "dataframe.csv"  # as which a DataFrame is read


@dataclass(frozen=True)
class LogResult:
    """The encounters of a log, in order of time, and how good the record was."""

    encounters: tuple[Encounter, ...]
    quality: Quality


def read_log(
    path: "Path | str | Sequence[Path | str] | DataFrame", config: LogConfig = LogConfig()
) -> LogResult:
    """Read a log and cut it into encounters.

    Args:
        path: a file, a bag or a folder of files; or several files that share one clock; or a table with the columns of a file.
        config: how to read, clean and cut.

    Returns:
        At least one encounter, on a common clock in a local east-north frame, and the data-quality summary.

    Raises:
        InputError: the log cannot be used; the message names the file and the row or topic, and what to do.
    """
    if hasattr(path, "to_csv"):
        with (
            scratch(temporary()) as folder,
            naming_objects({str(folder / TABLE): "the DataFrame"}),
        ):
            path.to_csv(folder / TABLE, index=False)
            return read_log(folder / TABLE, config)
    paths = [Path(p) for p in ([path] if isinstance(path, (str, Path)) else path)]
    try:
        return encounters_of(read_raw(paths, config), config)
    except InputError as error:  # some errors, e.g. on a vehicle's clock, do not name the file
        if str(error).startswith(("parameter ", *(str(known)[:100] for known in paths))):
            raise
        raise type(error)(f"{paths[0]}: {error}") from error


class NoEncounterError(InputError):
    """A log can be read and holds no encounter, or one vehicle alone; the message says how near to one it comes."""


def encounters_of(log: RawLog, config: LogConfig) -> LogResult:
    """Cut a raw log, from files or streams, into encounters, as `read_log` does.

    Raises:
        NoEncounterError: there is no encounter in it, or one vehicle alone; the message says why.
        InputError: the log cannot be used.
    """
    if log.encounters:
        return as_recorded(log, config)
    check_unit(log, config)
    log, notes = retimed(typed(log, config), config)
    tracks, drops = clean(log, config)
    said_first = (*notes, *notes_on_drops(log, drops), *drops.notes)
    if len({track.id for track in tracks}) < 2:
        raise NoEncounterError(explain_few_vehicles(log, [track.id for track in tracks], drops))
    tracks, dt_ns = (
        tuple(sorted(tracks, key=lambda track: natural(track.id))),
        round(config.period * 1e9),
    )
    origin_ns = min(int(track.fix_ns[0]) for track in tracks) // dt_ns * dt_ns
    pieces: list[Piece] = []
    vehicles = []
    for track in tracks:
        own, quality = pieces_of(track, origin_ns, config)
        pieces += own
        vehicles.append(quality)
    if not pieces and any(vehicle.lost for vehicle in vehicles):
        raise InputError(
            f"{log.segments[0].label}: speeds and positions of no vehicle can be reconciled; check their units"
        )
    pieces, doubts = plausible(pieces, config)
    groups, notes = find_groups(pieces, config)
    if not groups:
        raise NoEncounterError("; ".join((*doubts, explain_no_encounter(log, pieces, config))))
    notes += doubts
    notes += notes_on_origin(tracks, config)
    notes += notes_on_vehicles(
        vehicles,
        unusable(log, tracks, config),
        {pieces[m].track.id for group in groups for m in group.spans},
        config,
    )
    encounters = []
    for k, group in enumerate(groups):
        name = log.name if len(groups) == 1 else f"{log.name}-{k + 1:0{len(str(len(groups)))}d}"
        encounter, remarks = cut_encounter(name, group, pieces, origin_ns, config)
        encounters.append(encounter)
        notes += remarks
    summary = Quality(
        name=log.name,
        rows=log.rows,
        dropped=drops.of(log),
        vehicles=tuple(vehicles),
        encounters=tuple(encounter_quality(encounter) for encounter in encounters),
        notes=(
            *remarks_on_units(pieces, origin_ns, config),
            *said_first,
            *log.notes,
            *dict.fromkeys(notes),
        ),
    )
    return LogResult(tuple(encounters), summary)


def unusable(log: RawLog, tracks: Sequence[Observations], config: LogConfig) -> list[str]:
    """Return the vehicles of a log of which fewer than two positions were left."""
    requested = picked([vehicle.id for vehicle in log.vehicles], config, log.name)
    return sorted(set(requested) - {track.id for track in tracks}, key=natural)


def notes_on_drops(log: RawLog, drops: Drops) -> tuple[str, ...]:
    """Return a note if more than `MUCH` of the rows were left out, with the causes."""
    if sum(drops.count.values()) <= MUCH * log.rows:
        return ()
    return (
        f"of {log.rows} rows there are left out, or sorted: {'; '.join(map(str, drops.of(log)))}{advice(log, drops)}",
    )


def advice(log: RawLog, drops: Drops) -> str:
    """Return what to check if most rows were left out for one reason."""
    units = {
        "speed is above": "the unit of the speeds (speed=…:kmh, …:cmps)",
        "position jumps": "the unit of x, y (x=…:cm,y=…:cm)",
    }
    checks = [
        words
        for why, words in units.items()
        if any(n > 0.3 * log.rows for own, n in drops.count.items() if why in own)
    ]
    return f": check {' and '.join(checks)} with --set log.columns=…" if checks else ""


def notes_on_origin(tracks: Sequence[Observations], config: LogConfig) -> tuple[str, ...]:
    """Return a note if the parameter `origin` is so far away that distances are wrong."""
    far = max(float(np.hypot(*track.fix.T).max()) for track in tracks) if config.origin else 0.0
    if far < FAR_M:
        return ()
    longer = (far / EARTH_M) / max(math.sin(far / EARTH_M), 1e-3) - 1.0
    return (
        f"positions are up to {far / 1000.0:.0f} km from the parameter origin: distances there are up to {100 * longer:.1g} % "
        "too long; name an origin that is nearer, or none",
    )


def notes_on_vehicles(
    vehicles: Sequence[VehicleQuality],
    without_positions: list[str],
    met: set[str],
    config: LogConfig,
) -> tuple[str, ...]:
    """Return notes on vehicles that are in no encounter, have no positions, or whose measured speeds are not used."""
    doubted = [v.id for v in vehicles if v.changed > DOUBTED_MPS]
    left = [v for v in vehicles if v.id not in met]
    if len(left) > config.max_vehicles:
        notes = [
            f"{len(left)} of {len(vehicles)} vehicles are in no encounter: {', '.join(v.id for v in left)}"
        ]
    else:
        notes = [
            f"vehicle {v.id} is in no encounter; it was recorded for {v.seconds:.1f} s"
            for v in left
        ]
    if without_positions:
        notes.append(f"fewer than two usable positions: vehicle {', '.join(without_positions)}")
    notes += [
        f"vehicle {v.id}: {v.lost:.1f} s are left out, for no motion of a car fits its positions"
        for v in vehicles
        if v.lost
    ]
    return (
        *notes,
        *(
            f"vehicle {name}: its measured speeds contradict its positions and are not used"
            for name in doubted
        ),
    )


def as_recorded(log: RawLog, config: LogConfig) -> LogResult:
    """Return encounters that were recorded as such, unchanged but for the chosen window and vehicles."""
    cut = [between(encounter, config) for encounter in log.encounters]
    encounters = tuple(encounter for encounter, _ in cut)
    notes = (*log.notes, *(note for _, notes in cut for note in notes))
    return LogResult(
        encounters,
        Quality(log.name, log.rows, (), (), tuple(map(encounter_quality, encounters)), notes),
    )


def between(encounter: Encounter, config: LogConfig) -> tuple[Encounter, tuple[str, ...]]:
    """Return the encounter in the chosen time window and with the chosen vehicles, and notes on those not there in the window.

    Raises:
        InputError: a vehicle is unknown, or fewer than two vehicles or samples are left.
    """
    ids = [vehicle.id for vehicle in encounter.vehicles]
    requested = [ids.index(name) for name in picked(ids, config, encounter.name)]
    if config.start >= encounter.duration:
        raise InputError(
            f"parameter start is {config.start:g} s, but {encounter.name} is only {encounter.duration:.1f} s long"
        )
    first = math.ceil(config.start / encounter.dt - 1e-9)
    last = math.floor(config.end / encounter.dt + 1e-9) + 1 if config.end else len(encounter.time)
    last = min(last, len(encounter.time))
    inside = cut(encounter.present, first, last)
    rows = [n for n in requested if inside[n, 1] > inside[n, 0]]
    notes = tuple(
        f"vehicle {ids[n]} is left out: it is not recorded in the requested time"
        for n in requested
        if n not in rows
    )
    if len(rows) < 2:
        raise InputError(
            f"encounter {encounter.name!r}: {len(rows)} of {len(requested)} vehicles are recorded between {config.start:g} s and "
            f"{(last - 1) * encounter.dt:g} s; at least 2 are needed: change --set log.start=…, log.end=… or log.vehicles=…"
        )
    first, last = first + int(inside[rows, 0].min()), first + int(inside[rows, 1].max()) + 1
    return encounter.select(rows, first, last - 1), notes


def encounter_quality(encounter: Encounter) -> EncounterQuality:
    """Return the quality of an encounter."""
    ids = tuple(vehicle.id for vehicle in encounter.vehicles)
    last = len(encounter.time) - 1
    partly = tuple(
        (name, float(encounter.time[begin]), float(encounter.time[end]))
        for name, (begin, end) in zip(ids, encounter.present.tolist(), strict=True)
        if (begin, end) != (0, last)
    )
    return EncounterQuality(
        encounter.name, ids, encounter.duration, find_overlaps(encounter), partly
    )


def cut_encounter(
    name: str, group: Group[Meeting], pieces: Sequence[Piece], origin_ns: int, config: LogConfig
) -> tuple[Encounter, tuple[str, ...]]:
    """Cut a group out of its pieces; a vehicle of unknown heading faces east, with a note."""
    spans = dict(sorted(group.spans.items()))
    members = [pieces[m] for m in spans]
    notes = []
    position, heading, speed = [], [], []
    for piece, (first, last) in zip(members, spans.values(), strict=True):
        at = np.clip(np.arange(group.start, group.end), first, last - 1) - piece.first
        position.append(piece.smooth.position[at])
        speed.append(piece.smooth.speed[at])
        facing = piece.smooth.heading[at]
        if np.isnan(facing).any():
            notes.append(
                f"vehicle {piece.track.id} never moves and its heading is not recorded: taken as east"
            )
            facing = np.zeros(len(facing))
        heading.append(facing)
    tokens(
        member.track.id for member in members
    )  # refuses ids that are one name in ROS, before anything is made of them
    dt_ns = round(config.period * 1e9)
    encounter = Encounter.sampled(
        tuple(Vehicle(p.track.id, p.track.length, p.track.width, p.track.kind) for p in members),
        config.period,
        np.array(position),
        np.array(heading),
        np.array(speed),
        name=name,
        start_ns=origin_ns + group.start * dt_ns,
        origin=members[0].track.origin,
        present=np.array(list(spans.values())) - group.start - np.array([0, 1]),
    )
    return encounter if config.origin else about_its_middle(encounter), tuple(notes)


def explain_few_vehicles(log: RawLog, names: list[str], drops: Drops) -> str:
    """Return the error message on fewer than two vehicles."""
    causes = "; ".join(
        (*(note for note in log.notes if note.startswith("left out: ")), *map(str, drops.of(log)))
    )
    have = f"only vehicle {names[0]}" if names else "no vehicle"
    return (
        f"{log.segments[0].label}: {have} has usable positions; an encounter needs at least two vehicles on one clock. "
        "Give the files of all vehicles in one command, or check --set log.columns=… and log.vehicles=…"
        + (f". {causes}{advice(log, drops)}" if causes else "")
    )


def explain_no_encounter(log: RawLog, pieces: Sequence[Piece], config: LogConfig) -> str:
    """Return the error message on a log without encounters."""
    rule = (
        f"{log.segments[0].label}: no two vehicles are within {config.proximity:g} m for {config.min_duration:g} s while one "
        f"drives {config.travel:g} m"
    )
    pairs = [
        (a, b)
        for a, b in combinations(pieces, 2)
        if a.track.id != b.track.id and np.isfinite(distances(a, b)).any()
    ]
    if not pairs:
        return f"{rule}: no two vehicles are recorded at the same time and site"
    met = [(*time_near(a, b, config), a.track.id, b.track.id) for a, b in pairs]
    seconds, travel, nearest, first, second = max(met, key=lambda one: (one[0], one[1], -one[2]))
    if seconds <= 0.0:
        nearest, first, second = min(one[2:] for one in met)
        long_enough = [
            apart
            for a, b in pairs
            if len(apart := distances(a, b)) > ticks(config.min_duration, config)
        ]
        remedy = "none is recorded beside another for that long"
        if long_enough:
            width = ticks(config.min_duration, config) + 2
            reach = min(
                float(sliding_window_view(np.pad(apart, 1, "edge"), width).max(axis=1).min())
                for apart in long_enough
            )
            remedy = f"--set log.proximity={math.ceil(reach / 10.0 + 1e-9) * 10} takes two"
        return f"{rule}. Vehicles {first} and {second} come closest, to {nearest:.0f} m; {remedy}"
    near = f"Vehicles {first} and {second} are within {config.proximity:g} m for {seconds:.1f} s and come as near as {nearest:.0f} m"
    if seconds < config.min_duration:
        return f"{rule}. {near}; --set log.min_duration={math.floor(10.0 * seconds) / 10.0:g} takes them"
    if travel < config.travel:
        return f"{rule}. {near}, and the faster one drives {travel:.1f} m; --set log.travel={math.floor(travel):g} takes them"
    return f"{rule}. {near}, but one after the other; --set log.proximity=… or log.longest_gap=… may take them"


def time_near(a: Piece, b: Piece, config: LogConfig) -> tuple[float, float, float]:
    """Return how long two pieces are near each other at a stretch [s], how far one drives in it, how near they come [m]."""
    apart, begin = distances(a, b), max(a.first, b.first)
    spans = [
        (last - 1 - first, begin + first, begin + last)
        for first, last in runs(apart < config.proximity)
    ]
    near, first, last = max(spans, default=(0, begin, begin))
    return (
        near * config.period,
        max(driven(a, first, last, config), driven(b, first, last, config)),
        float(apart.min()),
    )
