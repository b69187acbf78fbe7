# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""New speeds on a recorded path: without the recorded brake, or waiting for another vehicle.

Speeds belong to stations, so that a drive is on its recorded path however late it is. Human
accelerations limit them (`DrivingMargins`).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Floats, running_sum
from scenario_gen.situation import Track
from scenario_gen.situation.evidence import smoothed_speed

STATION_STEP_M = 0.25


@dataclass(frozen=True)
class DrivingMargins:
    """How people drive where paths meet; measured on recorded yields at junctions.

    Attributes:
        braking_mps2: of a driver who slows down for another one.
        departure_mps2: acceleration after a stand or a slow part.
        acceleration_mps2: of a driver who goes first.
        max_lateral_mps2: in bends.
        min_rolling_mps: a driver who would have to be slower stops.
        stop_distance_m: from the standing place to where the shared area is entered.
        gap_s: from the other vehicle's exit to the entry of a driver who rolls.
        departure_lag_s: from the other vehicle's exit to the departure of a driver who stands.
        min_stand_s: duration of a stop.
        first_stand_s: before a driver departs who stands when the recording begins.
        carried_s: time by which a recording is carried backwards at its first speed.
    """

    braking_mps2: float = 2.0
    departure_mps2: float = 1.7
    acceleration_mps2: float = 2.0
    max_lateral_mps2: float = 3.0
    min_rolling_mps: float = 1.5
    stop_distance_m: float = 6.0
    gap_s: float = 1.5
    departure_lag_s: float = 0.8
    min_stand_s: float = 1.5
    first_stand_s: float = 2.0
    carried_s: float = 4.0


MARGINS = DrivingMargins()


class Drive(NamedTuple):
    """A drive along a track.

    Attributes:
        track: its path.
        station: (S,) arc lengths [m].
        speed: (S,) m/s there.
        stand: seconds for which it stands at `line`.
        line: index of the station at which it stands.
    """

    track: Track
    station: Floats
    speed: Floats
    stand: float = 0.0
    line: int = 0

    @property
    def time(self) -> Floats:
        """(S,) when [s] it leaves each station; it begins at 0 s."""
        mean = np.maximum(0.5 * (self.speed[1:] + self.speed[:-1]), 0.01)
        time = running_sum(np.diff(self.station) / mean)
        time[self.line :] += self.stand
        return time

    def time_at(self, station: float) -> float:
        """Return when [s] it leaves a station [m]."""
        return float(np.interp(station, self.station, self.time))

    def states(self) -> Floats:
        """(T, 4) poses and speeds at the track's period."""
        leaves = self.time
        arrives = leaves[self.line] - self.stand
        nodes = np.insert(leaves, self.line, arrives)
        speeds = np.insert(self.speed, self.line, self.speed[self.line])
        dt = self.track.dt
        speed = np.interp(np.arange(int(nodes[-1] / dt) + 1) * dt, nodes, speeds)
        for _ in range(2):
            speed = ndimage.uniform_filter1d(speed, 5, mode="nearest")
        steps = 0.5 * (speed[1:] + speed[:-1]) * dt
        station = self.station[0] + running_sum(steps)
        return np.column_stack([self.track.curve.at(station), np.maximum(speed, 0.0)])


def recorded_drive(track: Track) -> Drive:
    """Return the drive of a record, carried backwards at its first speed."""
    rows = np.flatnonzero(track.is_present)
    speed = smoothed_speed(track.speed[rows], track.dt)
    progress = track.progress[rows]
    moves = np.concatenate([[True], np.diff(progress) > 1e-6])
    begin = float(progress[0])
    if speed[0] > track.vehicle.kind.waits_below:
        begin -= MARGINS.carried_s * float(speed[0])
    station = np.arange(begin, progress[-1], STATION_STEP_M)
    return Drive(track, station, np.interp(station, progress[moves], speed[moves]))


def free_drive(track: Track, entry: float, leaves: float) -> Drive:
    """Return the drive of a record without the brake and the stand before a shared area.

    It has its approach speed, or the speed with which it left the area, as far as its bends allow.

    Args:
        track: the record.
        entry: station [m] at which it enters the area.
        leaves: station [m] behind it.
    """
    drive = recorded_drive(track)
    station, speed = drive.station, drive.speed
    before = speed[station <= entry]
    slowest = int(np.argmin(before))
    begin = int(np.argmax(before[: slowest + 1]))
    approach = max(float(before[begin]), float(np.interp(leaves, station, speed)))

    regained = (np.arange(len(speed)) > slowest) & (speed >= approach)
    end = int(np.argmax(regained)) if regained.any() else len(speed)
    curvature = np.abs(np.gradient(track.curve.at(station)[:, 2], STATION_STEP_M))
    in_bends = np.sqrt(MARGINS.max_lateral_mps2 / np.maximum(curvature, 1e-6))
    free = speed.copy()
    free[begin:end] = np.maximum(speed, np.minimum(approach, in_bends))[begin:end]
    free[0] = speed[0]

    stands = speed[0] < track.vehicle.kind.waits_below
    stand = MARGINS.first_stand_s if stands else 0.0
    return drive._replace(speed=_limited(free), stand=stand)


def _limited(speed: Floats) -> Floats:
    """Return speeds (S,) [m/s] with the accelerations of a human driver."""
    squares = np.square(speed)
    gain = 2.0 * MARGINS.acceleration_mps2 * STATION_STEP_M
    loss = 2.0 * MARGINS.braking_mps2 * STATION_STEP_M
    for k in range(1, len(squares)):
        squares[k] = min(squares[k], squares[k - 1] + gain)
    for k in range(len(squares) - 2, -1, -1):
        squares[k] = min(squares[k], squares[k + 1] + loss)
    return np.sqrt(squares)


def delayed_drive(drive: Drive, entry: float, clears: float) -> Drive:
    """Return a drive that lets another one go first; it rolls if it can, else it stops.

    Args:
        drive: as if it were alone.
        entry: station [m] at which it enters the shared area.
        clears: when [s] the other vehicle has left the area; 0 s is when the drive begins.

    Raises:
        RefusedError: it would have to brake too hard, or to stop after the other one has left.
    """
    line = int(np.searchsorted(drive.station, entry - MARGINS.stop_distance_m))
    distance = drive.station - drive.station[line]
    slope = np.where(distance < 0.0, -MARGINS.braking_mps2, MARGINS.departure_mps2)

    def slowed(least: float) -> Drive:
        """Return the drive with a speed [m/s] at the line."""
        speed = np.sqrt(least * least + 2.0 * slope * distance)
        return drive._replace(speed=np.minimum(drive.speed, speed))

    speeds = np.linspace(MARGINS.min_rolling_mps, drive.speed[line], 20)
    entries = np.array([slowed(speed).time_at(entry) for speed in speeds])  # later if slower
    enters = clears + MARGINS.gap_s
    if entries[0] >= enters:
        later = slowed(float(np.interp(-enters, -entries, speeds)))
    else:
        later = slowed(0.0)
        arrives = float(later.time[line])
        if arrives > clears:
            raise RefusedError("it would stop after the other one has left")
        stand = max(clears + MARGINS.departure_lag_s - arrives, MARGINS.min_stand_s)
        later = later._replace(stand=stand, line=line)
    if drive.stand or line == 0 or later.speed[0] < drive.speed[0]:
        raise RefusedError(f"vehicle {drive.track.vehicle.id} is too near to slow down")
    return later
