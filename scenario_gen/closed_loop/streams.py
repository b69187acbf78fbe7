# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Streams of vehicles with one gap: who waits must go in time, and who goes must wait until then.

The vehicle for which the ego waits in a recorded encounter drives again and again on its recorded
path, close behind itself, except once: at a chosen time the ego has room to cross or to merge.
The ego stops before their conflict area, and departs into that gap. Paths are the recorded ones,
extended straight; speeds are those of a driver who waits.

The reference drive departs when the gap has been open for a while, and follows the queue closely:
who has its speeds a second later meets the stream, and a second earlier the queue. A planner that
looks may depart as soon as the gap opens, and later into the queue.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.evaluation import wanted_speeds
from scenario_gen.numerics import Floats
from scenario_gen.numerics.curve import Curve
from scenario_gen.situation import Conflict, conflict_of, passing, Situation, Track
from scenario_gen.types import Decided, Decision, Encounter, Motion, Outcome, token, Vehicle

ACCELERATION_MPS2 = 1.5  # of the ego that departs
BRAKING_MPS2 = 2.0  # of the ego that stops in a queue
STOPPING_MARGIN_M = 2.5  # from the ego that waits to the conflict area
MERGE_MARGIN_M = 7.0  # from an ego that merges: nearer ones stand beside the stream
MIN_STREAM_MPS = 4.0  # speed of the stream
TOP_SPEED_MPS = 14.0  # of the ego
CLOSED_S = 1.3  # between two vehicles of the stream, in the conflict area
SPARE_S = (1.9, 1.7)  # from the stream to the ego that crosses, and from the ego to the stream
MERGE_SPARE_S = (0.9, 2.2)  # of an ego that merges; no queue stops it
APPEARS_M = 55.0  # before the conflict area
EXIT_M = 30.0  # from the conflict area to the goal of the ego
EXTENSION_M = 60.0  # of both paths, straight
LONGEST_S = 30.0  # from the conflict area to the goal
OVERTIME_S = 5.0  # for which the stream lasts after the ego has arrived
QUEUE_M = 7.0  # from the conflict area to where the ego stands in a queue
QUEUE_GAP_M = 2.0  # ahead of it
HEADWAY_S = 0.4  # by which the queue departs before the ego
MIN_SAMPLES_COUNT = 5  # of a vehicle of the stream
LEAVES_M = 26.0  # behind the conflict area and the goal of the ego


class Lane(NamedTuple):
    """The path of one of the two vehicles, and where it is in the conflict area.

    Attributes:
        vehicle: identity and footprint.
        path: its path.
        entry: station [m] at which it enters the conflict area.
        exit: station [m] at which it has left it.
        speed: of the stream, or the greatest of the ego [m/s].
    """

    vehicle: Vehicle
    path: Curve
    entry: float
    exit: float
    speed: float


@dataclass(frozen=True, eq=False)
class Stream:
    """A stream that an ego crosses, or that it joins.

    Attributes:
        encounter: the recorded one.
        ego: the lane of the ego.
        other: the lane of the stream.
        joins: whether the ego drives on in the stream.
    """

    encounter: Encounter
    ego: Lane
    other: Lane
    joins: bool

    @classmethod
    def of(cls, encounter: Encounter, ego: int) -> "Stream":
        """Return the stream for which a vehicle of a recorded encounter waits.

        Raises:
            RefusedError: it goes second at no crossing and at no merge.
        """
        situation = Situation.of(encounter)
        begin = encounter.time[encounter.present[:, 0]]
        waits = [
            conflict
            for conflict in situation.conflicts
            if conflict.second == ego
            and conflict.entry_second > begin[ego]
            and not (conflict.following and conflict.entry_first <= begin[conflict.first])
        ]
        if not waits:
            raise RefusedError(
                f"vehicle {encounter.ids[ego]} waits for nobody: it crosses no path after another "
                "vehicle, and joins none"
            )
        recorded = min(waits, key=lambda conflict: conflict.entry_second)
        tracks = situation.tracks[ego], situation.tracks[recorded.first]
        return cls._of_tracks(encounter, *tracks, recorded)

    @classmethod
    def _of_tracks(
        cls, encounter: Encounter, ego: Track, other: Track, recorded: Conflict
    ) -> "Stream":
        """Return the stream of two tracks with a conflict: first the other one drives past.

        Raises:
            RefusedError: their paths, extended, do not meet.
        """
        begins = ego.curve.project(ego.poses[:1, :2])[0] - EXTENSION_M
        starts = float(begins[0]), -EXTENSION_M
        count = round(max(ego.curve.length, other.curve.length) + 3.0 * EXTENSION_M)
        rows = np.arange(2 * count)
        stations = np.stack([np.clip(rows - count, 0, None), np.clip(rows, None, count)])
        stations = stations + np.array(starts)[:, None]
        poses = np.stack([ego.curve.at(stations[0]), other.curve.at(stations[1])])
        consecutive = Motion.sampled(
            (ego.vehicle, other.vehicle),
            1.0,
            poses[..., :2],
            poses[..., 2],
            np.ones((2, 2 * count)),
            present=np.array([(count, 2 * count - 1), (0, count)]),
        )
        conflict = conflict_of(consecutive, 0, 1)
        if conflict is None or conflict.first != 1:
            raise RefusedError("the paths of the two vehicles do not meet")
        leaves, enters = passing(consecutive, conflict, merges=recorded.following)
        speed = float(np.interp(recorded.entry_first, encounter.time, other.speed))
        speed = max(MIN_STREAM_MPS, speed)
        entry, leave = starts[0] + enters - count, starts[0] + conflict.exit_second - count
        if recorded.following:
            leave, top = entry + ego.vehicle.length, speed
        else:
            ahead = np.arange(entry, leave + EXIT_M)
            top = float(wanted_speeds(ego.curve, ahead, TOP_SPEED_MPS, stops=False).min())
        return cls(
            encounter,
            Lane(ego.vehicle, ego.curve, entry, leave, top),
            Lane(
                other.vehicle,
                other.curve,
                starts[1] + conflict.entry_first,
                starts[1] + leaves,
                speed,
            ),
            recorded.following,
        )

    def open_at(self, time: float, queue: float, share: float) -> Encounter:
        """Return the encounter in which the ego enters the conflict area at a time.

        Args:
            time: from the begin of the encounter [s].
            queue: for which the ego stands behind the conflict area [s], where another vehicle
                stands ahead of it; 0 for none.
            share: of all scenarios that have this time and queue.

        Raises:
            RefusedError: the recording has too few samples.
        """
        dt = self.encounter.dt
        ego, other = self.ego, self.other
        margin = MERGE_MARGIN_M if self.joins else STOPPING_MARGIN_M
        stop = ego.entry - margin
        departs = time - np.sqrt(2.0 * margin / ACCELERATION_MPS2)
        way = ego.exit + QUEUE_M - stop if queue else np.inf
        peak = min(ego.speed, np.sqrt(way / (0.5 / ACCELERATION_MPS2 + 0.5 / BRAKING_MPS2)))
        leaves = queue and departs + 0.5 * peak / ACCELERATION_MPS2 + 0.5 * peak / BRAKING_MPS2
        leaves += queue and way / peak + queue
        times = np.arange(round((time + queue + LONGEST_S) / dt)) * dt
        driven = stop + _moved(times - departs, way, peak)
        if queue:
            driven += _moved(times - leaves, np.inf, ego.speed)
        arrives = int(np.searchsorted(driven, ego.exit + EXIT_M)) + 1
        clears = float(np.interp(ego.exit, driven, times))
        slower = other.speed - min(ego.speed, ACCELERATION_MPS2 * (clears - departs))
        catching_up = self.joins * max(slower, 0.0) ** 2 / (2.0 * ACCELERATION_MPS2 * other.speed)
        times = times[: arrives + round(OVERTIME_S / dt)]
        spare_before, spare_after = MERGE_SPARE_S if self.joins else SPARE_S
        occupied = (other.exit - other.entry) / other.speed
        period = occupied + CLOSED_S
        before = np.arange(time - spare_before - occupied, -occupied, -period)
        after = np.arange(clears + spare_after + catching_up, times[-1], period)
        entries = np.concatenate([before[::-1], after])
        stations = np.vstack(
            [driven[: len(times)], other.entry + other.speed * (times - entries[:, None])]
        )
        near = (stations >= other.entry - APPEARS_M) & (stations <= other.exit + LEAVES_M)
        near[0] = np.arange(len(times)) < arrives
        vehicles = [ego.vehicle, *(_named(other.vehicle, k) for k in range(len(entries)))]
        paths = [ego.path, *[other.path] * len(entries)]
        if queue:
            place = ego.exit + QUEUE_M + ego.vehicle.length + QUEUE_GAP_M
            ahead = place + _moved(times - leaves + HEADWAY_S, np.inf, ego.speed)
            stations = np.vstack([stations, ahead])
            near = np.vstack([near, ahead < ego.exit + EXIT_M + LEAVES_M])
            vehicles.append(_named(ego.vehicle, 0))
            paths.append(ego.path)
        rows = np.flatnonzero(near.sum(axis=1) > MIN_SAMPLES_COUNT)
        if len(rows) < 2:
            raise RefusedError(
                f"a vehicle of the stream would have {MIN_SAMPLES_COUNT} samples or less"
            )
        poses = np.stack([paths[row].at(stations[row]) for row in rows])
        begins = near[rows].argmax(axis=1)
        who, whom = token(ego.vehicle.id), token(vehicles[rows[1]].id)
        queued = f", queue {queue:g} s" if queue else ""
        return Encounter.sampled(
            tuple(vehicles[row] for row in rows),
            dt,
            poses[..., :2],
            poses[..., 2],
            np.gradient(stations[rows], dt, axis=1),
            present=np.column_stack([begins, begins + near[rows].sum(axis=1) - 1]),
            name=f"{self.encounter.name}, open at {time:.1f} s{queued}",
            source=Decided(
                self.encounter.recording,
                Decision(who, whom, Outcome.STOPS, time, share),
                self.encounter,
            ),
        )


def _named(vehicle: Vehicle, number: int) -> Vehicle:
    """Return a copy of a vehicle with a number."""
    return replace(vehicle, id=f"{vehicle.id}-{number}")


def _moved(times: Floats, way: float, top: float) -> Floats:
    """Return the ways (T,) [m] of a vehicle that starts at 0 s and stops after a way [m].

    It drives no faster than `top` [m/s].
    """
    speeding = top / ACCELERATION_MPS2
    braking = top / BRAKING_MPS2
    gone = np.clip(times, 0.0, None)
    begun = np.minimum(gone, speeding)
    moved = 0.5 * ACCELERATION_MPS2 * begun**2 + top * (gone - begun)
    if way < np.inf:
        end = way / top + 0.5 * (speeding + braking)
        left = np.clip(end - gone, 0.0, braking)
        moved = np.where(left < braking, way - 0.5 * BRAKING_MPS2 * left**2, moved)
    return np.asarray(moved)
