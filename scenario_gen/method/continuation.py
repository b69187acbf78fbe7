# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A record that ends in the way of another vehicle is driven on until the vehicle has left it.

Else the vehicle would vanish there, and the other one would drive through its place.
"""

from dataclasses import replace

import numpy as np

from scenario_gen.method.approaches import MARGINS
from scenario_gen.method.drives import recorded_drive
from scenario_gen.numerics.rounding import ROUNDING_S
from scenario_gen.situation import passing, refuse_too_large, Situation, Track
from scenario_gen.types import Encounter, Note, NoteKind


def driven_on(encounter: Encounter) -> tuple[Encounter, tuple[Note, ...]]:
    """Return an encounter in which nobody vanishes where another vehicle passes, and notes.

    Raises:
        RefusedError: it is too large, or it is unknown how a vehicle drives on.
    """
    refuse_too_large(encounter)
    notes = []
    ends = encounter.time[encounter.present[:, 1]]
    tracks = Situation.of(encounter).tracks
    for n, leaves in sorted(_exits(encounter).items()):
        if ends[n] == encounter.time[-1] or leaves < ends[n] - ROUNDING_S:
            continue
        whole = _continued(encounter, n, tracks[n])
        left = np.searchsorted(whole.time, _exits(whole)[n] + MARGINS.after_s)
        present = whole.present.copy()
        present[n, 1] = min(int(left), present[n, 1])
        later = (present[n, 1] - encounter.present[n, 1]) * encounter.dt
        encounter = replace(whole, present=present)
        values = {"vehicle": encounter.vehicles[n].id, "time": later}
        notes.append(Note.of(NoteKind.DRIVEN_ON, **values))
    return encounter, tuple(notes)


def _exits(encounter: Encounter) -> dict[int, float]:
    """Return when [s] each vehicle that goes first has cleared the last area, by its index."""
    exits: dict[int, float] = {}
    for conflict in Situation.of(encounter).conflicts:
        clears, _ = passing(encounter, conflict, merges=conflict.following)
        exits[conflict.first] = max(clears, exits.get(conflict.first, clears))
    return exits


def _continued(encounter: Encounter, n: int, track: Track) -> Encounter:
    """Return an encounter whose vehicle n drives on to its end, or `MARGINS.continued_m`.

    Raises:
        RefusedError: it is unknown how it drives on.
    """
    drive = recorded_drive(track, MARGINS.continued_m)
    last = int(encounter.present[n, 1])
    begins = drive.time_at(float(track.progress[last]))
    times = begins + encounter.dt * np.arange(1, len(encounter.time) - last)
    station = np.interp(times, drive.time, drive.station)
    ends = np.array([track.progress[last], *station])
    poses = drive.track.curve.at(ends)
    poses += [*encounter.position[n, last], encounter.heading[n, last]] - poses[0]
    position, heading = encounter.position.copy(), encounter.heading.copy()
    speed = encounter.speed.copy()
    position[n, last:], heading[n, last:] = poses[:, :2], poses[:, 2]
    speed[n, last + 1 :] = np.interp(station, drive.station, drive.speed)
    present = encounter.present.copy()
    present[n, 1] = last + int(np.count_nonzero(times <= drive.time[-1]))
    return replace(encounter, position=position, heading=heading, speed=speed, present=present)
