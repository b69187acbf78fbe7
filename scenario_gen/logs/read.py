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

"""From a path to encounters: choose the reader, clean, smooth, cut."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenario_gen.encounter import Encounter, Vehicle
from scenario_gen.errors import InputError
from scenario_gen.logs.cleaning import clean, Drops
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.encounters import find_groups, Group
from scenario_gen.logs.overlaps import find_overlaps
from scenario_gen.logs.pieces import Piece, pieces_of
from scenario_gen.logs.quality import Dropped, EncounterQuality, Quality, VehicleQuality
from scenario_gen.logs.raw import natural, RawLog
from scenario_gen.logs.smoothing import DOUBTED
from scenario_gen.logs.sources import read_raw


@dataclass(frozen=True)
class LogResult:
    """The encounters of a log, in order of time, and how good the record was."""

    encounters: tuple[Encounter, ...]
    quality: Quality


def read_log(path: Path | str | Sequence[Path | str], config: LogConfig = LogConfig()) -> LogResult:  # noqa: B008 - frozen
    """Read a log and cut it into encounters.

    Args:
        path: a file, a bag or a folder of files; or several files that share one clock.
        config: how to read, clean and cut.

    Returns:
        At least one encounter, on a common clock in a local east-north frame, and the data-quality summary.

    Raises:
        InputError: the log cannot be used; the message names the file and the row or topic, and what to do.
    """
    paths = [Path(p) for p in ([path] if isinstance(path, (str, Path)) else path)]
    try:
        return encounters_of(read_raw(paths, config), config)
    except InputError as error:  # what is wrong with an encounter, or with a vehicle's clock, knows of no files
        if str(error).startswith(("parameter ", *(str(known)[:100] for known in paths))):
            raise
        raise InputError(f"{paths[0]}: {error}") from error


def encounters_of(log: RawLog, config: LogConfig) -> LogResult:
    """Cut what was read, or heard, into encounters; as `read_log` does.

    Raises:
        InputError: there is no encounter in it; the message says why.
    """
    if log.encounters:
        return as_recorded(log, config)
    tracks, drops, origin = clean(log, config)
    if len(tracks) < 2:
        raise InputError(too_few(log, [track.id for track in tracks], drops))
    tracks = tuple(sorted(tracks, key=lambda track: natural(track.id)))
    dt_ns = round(config.period * 1e9)
    origin_ns = min(int(track.fix_ns[0]) for track in tracks) // dt_ns * dt_ns
    pieces: list[Piece] = []
    vehicles = []
    for track in tracks:
        try:
            own, quality = pieces_of(track, origin_ns, config)
        except InputError as error:
            raise InputError(f"{log.segments[0].label}, vehicle {track.id}: {error}") from error
        pieces += own
        vehicles.append(quality)
    groups, notes = find_groups(pieces, config)
    if not groups:
        raise InputError(no_meeting(log, pieces, config))
    notes += unmet(vehicles, {pieces[m].track.id for group in groups for m in group.members}, config)
    encounters = []
    for k, group in enumerate(groups):
        name = log.name if len(groups) == 1 else f"{log.name}-{k + 1:0{len(str(len(groups)))}d}"
        encounter, remarks = make_encounter(name, group, pieces, origin_ns, origin, config)
        encounters.append(encounter)
        notes += remarks
    summary = Quality(
        name=log.name,
        rows=log.rows,
        dropped=tuple(Dropped(reason, count, log.where(drops.first[reason])) for reason, count in drops.count.items()),
        vehicles=tuple(vehicles),
        encounters=tuple(encounter_quality(encounter) for encounter in encounters),
        notes=(*log.notes, *dict.fromkeys(notes)),
    )
    return LogResult(tuple(encounters), summary)


def unmet(vehicles: Sequence[VehicleQuality], met: set[str], config: LogConfig) -> tuple[str, ...]:
    """Say who is in no encounter, and whose measured speeds were not believed."""
    doubted = [v.id for v in vehicles if v.changed > DOUBTED]
    left = [v for v in vehicles if v.id not in met]
    if len(left) > config.most_vehicles:
        said = [f"{len(left)} of {len(vehicles)} vehicles are in no encounter: {', '.join(v.id for v in left)}"]
    else:
        said = [f"vehicle {v.id} is in no encounter: there for {v.seconds:.1f} s" for v in left]
    return (*said, *(f"vehicle {name}: its measured speeds contradict its positions and are not used" for name in doubted))


def as_recorded(log: RawLog, config: LogConfig) -> LogResult:
    """Encounters that were recorded as such stay as they are, bit for bit; only the window and the vehicles are chosen."""
    from scenario_gen.logs.bag import between

    encounters = tuple(between(encounter, config) for encounter in log.encounters)
    summary = Quality(log.name, log.rows, (), (), tuple(map(encounter_quality, encounters)), log.notes)
    return LogResult(encounters, summary)


def encounter_quality(encounter: Encounter) -> EncounterQuality:
    """The facts of an encounter."""
    ids = tuple(vehicle.id for vehicle in encounter.vehicles)
    return EncounterQuality(encounter.name, ids, encounter.duration, find_overlaps(encounter))


def make_encounter(
    name: str,
    group: Group,
    pieces: Sequence[Piece],
    origin_ns: int,
    origin: tuple[float, float] | None,
    config: LogConfig,
) -> tuple[Encounter, tuple[str, ...]]:
    """Cut a group out of its pieces; a vehicle whose heading nobody knows faces east, and the note says so."""
    members = [pieces[m] for m in group.members]
    notes = []
    position, heading, speed = [], [], []
    for piece in members:
        span = slice(group.first - piece.first, group.last - piece.first)
        position.append(piece.smooth.position[span])
        speed.append(piece.smooth.speed[span])
        facing = piece.smooth.heading[span]
        if np.isnan(facing).any():
            notes.append(f"vehicle {piece.track.id} never moves and its heading is not recorded: taken as east")
            facing = np.zeros(len(facing))
        heading.append(facing)
    dt_ns = round(config.period * 1e9)
    encounter = Encounter(
        name=name,
        vehicles=tuple(Vehicle(p.track.id, p.track.length, p.track.width) for p in members),
        start_ns=origin_ns + group.first * dt_ns,
        dt_ns=dt_ns,
        position=np.array(position),
        heading=np.array(heading),
        speed=np.array(speed),
        origin=origin,
    )
    return encounter, tuple(notes)


def too_few(log: RawLog, names: list[str], drops: Drops) -> str:
    """Say why there are fewer than two vehicles."""
    causes = "; ".join(f"{count} × {reason}, first at {log.where(drops.first[reason])}" for reason, count in drops.count.items())
    have = f"only vehicle {names[0]}" if names else "no vehicle"
    return (
        f"{log.segments[0].label}: {have} has usable positions; an encounter needs at least two vehicles on one clock "
        f"(give their files together, or check the parameters columns and vehicles)" + (f". Left out: {causes}" if causes else "")
    )


def no_meeting(log: RawLog, pieces: Sequence[Piece], config: LogConfig) -> str:
    """Say why no encounter was found."""
    nearest, who = np.inf, "no two vehicles are there at the same time"
    for i, a in enumerate(pieces):
        for b in pieces[i + 1 :]:
            first, last = max(a.first, b.first), min(a.last, b.last)
            if a.track.id != b.track.id and last > first:
                gap = a.smooth.position[first - a.first : last - a.first] - b.smooth.position[first - b.first : last - b.first]
                least = float(np.hypot(gap[:, 0], gap[:, 1]).min())
                if least < nearest:
                    nearest, who = least, f"{a.track.id} and {b.track.id} come closest, to {least:.0f} m"
    return (
        f"{log.segments[0].label}: no two vehicles are within {config.proximity:g} m for {config.shortest:g} s while one "
        f"drives {config.travel:g} m ({who}); see the parameters proximity, shortest, travel and longest_gap"
    )
