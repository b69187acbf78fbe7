# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How two vehicles interact: what they do, how they react, how they come to their conflict area.

The approaches are those of the recording, and those of vehicles that are alone.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.drives import (
    Drive,
    DRIVING,
    free_drive,
    recorded_drive,
    Stop,
    stop_before,
)
from scenario_gen.method.evaluation.law import features_of
from scenario_gen.numerics import Floats
from scenario_gen.situation import Conflict, conflict_of, EncounterKind, Situation, Track
from scenario_gen.types import Encounter, Pair, Reaction


@dataclass(frozen=True, eq=False)
class InteractingPair:
    """Two vehicles of an encounter that interact.

    Attributes:
        situation: of the encounter, with all its vehicles.
        kind: what they do.
        features: (F + J,) as in `EncounterFeatures.every`.
        conflict: between the two.
        reactions: of one of them to the other.
    """

    situation: Situation
    kind: EncounterKind
    features: Floats
    conflict: Conflict
    reactions: tuple[Reaction, ...]

    @property
    def encounter(self) -> Encounter:
        """The encounter, with all its vehicles."""
        return self.situation.encounter

    @property
    def tracks(self) -> tuple[Track, Track]:
        """The tracks of the first and of the second vehicle."""
        tracks = self.situation.tracks
        return tracks[self.conflict.first], tracks[self.conflict.second]

    def presence(self, n: int) -> Floats:
        """Return when [s] a vehicle appears and disappears, (2,)."""
        return np.asarray(self.encounter.time[self.encounter.present[n]])


def pair_of(encounter: Encounter, pair: Pair | None = None) -> InteractingPair | None:
    """Return a pair of an encounter, by default the closest; None if it shares no area."""
    situation = Situation.of(encounter)
    member = features_of(encounter, "", 0, pair)
    conflict = None if member.pair is None else situation.conflict(*member.pair)
    if member.kind is None or conflict is None:
        return None
    edges = situation.reactions.edges
    reactions = tuple(edge for edge in edges if {edge.who, edge.whom} == set(conflict.pair))
    return InteractingPair(situation, member.kind, member.every, conflict, reactions)


EARLIEST_S = 15.0  # before a recording, in which its drivers may have decided


@dataclass(frozen=True)
class DecisionMargins:
    """What drivers decide in time; measured on recorded yields at junctions.

    Attributes:
        horizon_s: time of free driving before the conflict area at which a driver decides.
        after_s: for which a vehicle that goes first is present after it has left the area.
        continued_m: distance by which a record is driven on.
        min_duration_s: of a new encounter.
        min_together_s: time for which both vehicles are present.
        max_merge_lag_s: in a merge a larger lag leaves nothing to decide.
        free_gap_s: a driver who would enter later than this does not slow down.
        shared_path_m: vehicles that are laterally nearer drive behind each other.
        approach_s: time before the first entry at which a new encounter begins.
        max_braking_mps2: of any driver, unless one brakes harder in the recording.
        min_courtesy_ratio: share of its speed that a driver keeps where vehicles merge from
            beside.
        behind_s: after its entry, when a vehicle has its free speed again.
    """

    horizon_s: float = 4.0
    after_s: float = 1.5
    continued_m: float = 40.0
    min_duration_s: float = 5.0
    min_together_s: float = 2.0
    max_merge_lag_s: float = 1.5
    free_gap_s: float = 1.5
    shared_path_m: float = 1.5
    approach_s: float = 5.0
    max_braking_mps2: float = 3.5
    min_courtesy_ratio: float = 0.5
    behind_s: float = 2.0


MARGINS = DecisionMargins()


class Approach(NamedTuple):
    """How a vehicle comes to a conflict area.

    Attributes:
        recorded: as recorded, and driven on until it has left the area.
        free: as if it were alone.
        entry: station [m] at which it enters the area.
        stop: where it stops before it.
    """

    recorded: Drive
    free: Drive
    entry: float
    stop: Stop

    @property
    def stands_first(self) -> bool:
        """Whether it stands when its recording begins."""
        track = self.recorded.track
        return bool(track.speed[track.present[0]] < track.vehicle.kind.waits_below)

    def arrivals(self, time: Floats) -> Floats:
        """Return when [s] it would enter if it drove on freely from each time (T,) [s] on.

        Before its record it drove freely. A driver who stands when the record begins stood before,
        and departs when it decides to.
        """
        track, free = self.recorded.track, self.free
        first, last = track.present.tolist()
        rows = np.clip(np.round(time / track.dt).astype(np.int64), first, last)
        needed = free.time_at(self.entry) - np.interp(
            track.progress[rows], free.station, free.time
        )
        if not self.stands_first:
            return np.asarray(np.maximum(time, track.dt * first) + needed)
        stands = track.speed[rows] < track.vehicle.kind.waits_below
        return np.asarray(time + needed + DRIVING.start_up_s * stands)


def approaches(pair: InteractingPair) -> tuple[Approach, Approach]:
    """Return how the first and the second vehicle of a pair come to the conflict area.

    Raises:
        RefusedError: a record ends in the area, and it is unknown how it goes on.
    """
    conflict = pair.conflict
    exits = conflict.exit_first, conflict.exit_second
    ends = [pair.presence(n)[1] for n in (conflict.first, conflict.second)]
    distances = [
        MARGINS.continued_m if conflict.following or end < leaves + MARGINS.after_s else 0.0
        for end, leaves in zip(ends, exits, strict=True)
    ]
    first, second = map(recorded_drive, pair.tracks, distances)
    after = int(first.time[-1] / first.track.dt) + 1
    consecutive = two_drives(first, second, after)
    areas = conflict_of(consecutive, 0, 1)
    narrow = tuple(replace(each, width=0.5 * each.width) for each in consecutive.vehicles)
    narrower = conflict_of(replace(consecutive, vehicles=narrow), 0, 1)
    if areas is None or narrower is None or areas.first != 0:
        raise RefusedError("the vehicles hardly touch each other's paths")
    begins = after * first.track.dt
    return (
        _approach(first, areas.entry_first, areas.exit_first, follows=areas.following),
        _approach(
            second,
            areas.entry_second - begins,
            areas.exit_second - begins,
            follows=areas.following,
        ),
    )


def _approach(drive: Drive, enters: float, leaves: float, *, follows: bool) -> Approach:
    """Return how a vehicle comes to a conflict area that it enters and leaves at times [s]."""
    times = np.array([enters, leaves, enters + MARGINS.behind_s])
    entry, exit_, behind = np.interp(times, drive.time, drive.station).tolist()
    free = free_drive(drive, entry, behind)
    if not follows:
        after = free.time_at(exit_) + MARGINS.after_s
        left = float(np.interp(after, free.time, free.station))
        end = max(left, float(drive.track.progress[-1]))
        drive, free = drive.until(end), free.until(end)
    return Approach(drive, free, entry, stop_before(drive, entry))


def offered_lag_of(first: Approach, second: Approach) -> float:
    """Return the time [s] by which the first vehicle would enter later, if both drove freely.

    They drive freely from the instant on at which either is the horizon before the area. Drivers
    who stand when their recording begins have come before; the instant is that of the other one.
    """
    track = first.recorded.track
    period = track.dt
    count = len(track.progress)
    time = np.arange(-round(EARLIEST_S / period), count, dtype=np.float64) * period
    arrivals = np.stack([first.arrivals(time), second.arrivals(time)])
    is_near = arrivals - time <= MARGINS.horizon_s
    comes = np.array([[not first.stands_first], [not second.stands_first]])
    counts = is_near & comes if comes.any() else np.tile(time >= 0.0, (2, 1))
    k = int(np.argmax(counts.any(axis=0)))
    return float(arrivals[0, k] - arrivals[1, k])


def two_drives(first: Drive, second: Drive, begin: int) -> Encounter:
    """Return two drives; the second one begins `begin` samples after the first."""
    states = first.states(), second.states()
    begins = max(-begin, 0), max(begin, 0)
    present = np.array([(k, k + len(rows) - 1) for k, rows in zip(begins, states, strict=True)])
    samples = np.arange(int(present.max()) + 1)
    rows = np.clip(samples - present[:, :1], 0, np.diff(present))
    values = np.stack([each[row] for each, row in zip(states, rows, strict=True)])
    vehicles = (first.track.vehicle, second.track.vehicle)
    position, heading, speed = values[..., :2], values[..., 2], values[..., 3]
    return Encounter.sampled(
        vehicles, first.track.dt, position, heading, speed, "two drives", present=present
    )
