# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""New speeds on a recorded path: without the recorded brake, or waiting for another vehicle.

Speeds belong to stations, so that a drive is on its recorded path however late it is. Human
accelerations limit them (`DrivingMargins`). A record that begins late is preceded by an approach,
and one that ends early is driven on.
"""

from dataclasses import dataclass, replace
import math
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Floats, polyline_of, running_sum, runs
from scenario_gen.numerics.curve import Curve
from scenario_gen.situation import Track
from scenario_gen.situation.tracks import MIN_WAIT_S
from scenario_gen.situation.yielding import smoothed_speed

STATION_STEP_M = 0.25
RIGHT_ANGLE_RAD = 0.5 * math.pi


@dataclass(frozen=True)
class DrivingMargins:
    """How people drive where paths meet; measured on recorded yields at junctions.

    Attributes:
        braking_mps2: of a driver who slows down.
        departure_mps2: acceleration after a stand or a slow part.
        acceleration_mps2: of a driver who goes first.
        max_lateral_mps2: in bends.
        min_rolling_mps: a driver who would have to be slower stops.
        stop_distance_m: from the standing place to where the conflict area is entered.
        own_line_m: a recorded standing place is the line if the area is nearer than this.
        gap_s: from the other vehicle's exit to the entry of a driver who rolls.
        min_gap_s: the least one, of a driver who would stand more briefly than `min_stand_s`.
        departure_lag_s: from the other vehicle's exit to the departure of a driver who stands.
        departed_m: way from a standing place over which a driver's departure is measured.
        own_departure_mps2: least and greatest acceleration of a recorded departure; who is slower
            has another vehicle ahead.
        min_stand_s: duration of a stop.
        start_up_s: from the decision to the departure of a driver who stands when the recording
            begins: the start-up lost time of the Highway Capacity Manual. With the way to the area
            it gives the critical headway of left turns there, 4.1 s.
        approach_s: time by which a driver approaches before the recording begins.
        slow_ratio: of a driver's free speed, below which it has slowed down.
        turning_rad: change of heading over the last metres of a path that still turns.
        turning_m: length of these last metres.
        turned_rad: a path that turns and has turned so far completes a right angle.
    """

    braking_mps2: float = 2.0
    departure_mps2: float = 1.7
    acceleration_mps2: float = 2.0
    max_lateral_mps2: float = 3.0
    min_rolling_mps: float = 0.7
    stop_distance_m: float = 4.0
    own_line_m: float = 15.0
    gap_s: float = 1.5
    min_gap_s: float = 1.0
    departure_lag_s: float = 0.8
    departed_m: float = 5.0
    own_departure_mps2: tuple[float, float] = (1.2, 2.5)
    min_stand_s: float = 1.5
    start_up_s: float = 2.0
    approach_s: float = 4.0
    slow_ratio: float = 0.5
    turning_rad: float = 0.12
    turning_m: float = 3.0
    turned_rad: float = 0.5


DRIVING = DrivingMargins()


class Drive(NamedTuple):
    """A drive along a track.

    Attributes:
        track: its path.
        station: (S,) arc lengths [m].
        speed: (S,) m/s there.
        stand: (S,) seconds for which it stands there.
    """

    track: Track
    station: Floats
    speed: Floats
    stand: Floats

    @property
    def time(self) -> Floats:
        """(S,) when [s] it leaves each station; it begins at 0 s."""
        mean = np.maximum(0.5 * (self.speed[1:] + self.speed[:-1]), 0.01)
        return running_sum(np.diff(self.station) / mean) + np.cumsum(self.stand)

    def time_at(self, station: float) -> float:
        """Return when [s] it leaves a station [m]."""
        return float(np.interp(station, self.station, self.time))

    def until(self, station: float) -> "Drive":
        """Return the drive as far as a station [m]."""
        count = max(int(np.searchsorted(self.station, station)) + 1, 2)
        return Drive(self.track, self.station[:count], self.speed[:count], self.stand[:count])

    def states(self) -> Floats:
        """(T, 4) poses and speeds at the track's period."""
        leaves = self.time
        stands = np.flatnonzero(self.stand)
        nodes = np.insert(leaves, stands, leaves[stands] - self.stand[stands])
        speeds = np.insert(self.speed, stands, self.speed[stands])
        dt = self.track.dt
        speed = np.interp(np.arange(int(nodes[-1] / dt) + 1) * dt, nodes, speeds)
        for _ in range(2):
            speed = ndimage.uniform_filter1d(speed, 5, mode="nearest")
        steps = 0.5 * (speed[1:] + speed[:-1]) * dt
        station = self.station[0] + running_sum(steps)
        return np.column_stack([self.track.curve.at(station), np.maximum(speed, 0.0)])


class Stop(NamedTuple):
    """How a driver stops before a conflict area.

    Attributes:
        line: station [m] at which it stands.
        departure: its acceleration [m/s²] from there.
    """

    line: float
    departure: float


def recorded_drive(track: Track, continued: float = 0.0) -> Drive:
    """Return the drive of a record, with an approach before it.

    A driver who brakes or is slow when the record begins comes from its free speed, the highest
    one that was recorded; others come at their first speed.

    Args:
        track: the record.
        continued: distance [m] by which it drives on after the record, with its free speed.

    Raises:
        RefusedError: how it drives on is unknown; the message says why.
    """
    rows = np.flatnonzero(track.is_present)
    progress = track.progress[rows]
    smooth = smoothed_speed(track.speed[rows], track.dt)
    free = float(smooth.max())
    if continued:
        track = _continued(track, float(smooth[-1]))
    slow = smooth < track.vehicle.kind.waits_below
    waits = [
        (begin, end) for begin, end in runs(slow) if (end - begin - 1) * track.dt >= MIN_WAIT_S
    ]

    steps = np.ceil(
        np.array([DRIVING.approach_s * free, np.ptp(progress) + continued]) / STATION_STEP_M
    )
    station = progress[0] + np.arange(-steps[0], steps[1] + 1.0) * STATION_STEP_M
    stand = np.zeros(len(station))
    moves = np.concatenate([[True], np.diff(progress) > 1e-6])
    speed = np.interp(station, progress[moves], smooth[moves])

    later = smooth[min(round(1.0 / track.dt), len(smooth) - 1)]
    slows = later < smooth[0] - 0.5 or smooth[0] < DRIVING.slow_ratio * free
    approach = _reached(float(smooth[0]), DRIVING.braking_mps2, progress[0] - station)
    if slows:
        speed = np.where(station < progress[0], np.minimum(approach, free), speed)
    leaving = _reached(float(smooth[-1]), DRIVING.departure_mps2, station - progress[-1])
    speed = np.where(station > progress[-1], np.minimum(leaving, free), speed)
    for first, end in waits:
        line = int(np.argmin(np.abs(station - progress[first:end].mean())))
        stand[line] = (end - first) * track.dt
        speed = np.minimum(speed, _around(station, line))
    return Drive(track, station, speed, stand)


def _reached(speed: float, acceleration: float, distance: Floats) -> Floats:
    """Return the speeds (S,) [m/s] at distances [m] behind a speed; before it, the speed."""
    return np.asarray(np.sqrt(speed * speed + 2.0 * acceleration * np.maximum(distance, 0.0)))


def _around(
    station: Floats, line: int, least: float = 0.0, departure: float = DRIVING.departure_mps2
) -> Floats:
    """Return the speeds (S,) [m/s] of a driver who brakes to `least` at a line, and departs."""
    distance = station - station[line]
    acceleration = np.where(distance < 0.0, DRIVING.braking_mps2, departure)
    return np.asarray(np.sqrt(least * least + 2.0 * acceleration * np.abs(distance)))


def _continued(track: Track, speed: float) -> Track:
    """Return a track that goes on behind its record: straight on, or to the end of its turn.

    A turn is completed to a right angle, since most junctions have right angles.

    Args:
        track: the record.
        speed: its last speed [m/s].

    Raises:
        RefusedError: it stands at the end, or it is unknown how far it turns.
    """
    who = track.vehicle.id
    if speed < track.vehicle.kind.waits_below:
        raise RefusedError(f"vehicle {who} stands in the conflict area when its recording ends")
    curve = track.curve
    end = float(track.progress[-1])
    yaw = curve.at(np.array([0.0, end - DRIVING.turning_m, end]))[:, 2]
    turned, turning = float(yaw[2] - yaw[0]), float(yaw[2] - yaw[1])
    rest = RIGHT_ANGLE_RAD - abs(turned)
    if abs(turning) < DRIVING.turning_rad or rest <= 0.0:
        return track
    if abs(turned) < DRIVING.turned_rad or turned * turning < 0.0:
        raise RefusedError(f"vehicle {who} begins to turn when its recording ends")
    step = math.copysign(STATION_STEP_M * abs(turning) / DRIVING.turning_m, turned)
    bend = yaw[2] + step * np.arange(math.ceil(rest / abs(step)) + 1)
    last = curve.at(end)
    arc = np.column_stack([last[:2] + polyline_of(bend, STATION_STEP_M), bend])
    points = np.vstack([curve.points[curve.station < end], arc])
    return replace(track, curve=Curve(points))


def free_drive(drive: Drive, entry: float, leaves: float) -> Drive:
    """Return a recorded drive without the brake and the stand before a conflict area.

    It has its approach speed, or the speed with which it left the area, as far as its bends allow.
    A driver who stands when the recording begins departs from there.

    Args:
        drive: as recorded.
        entry: station [m] at which it enters the area.
        leaves: station [m] behind it.
    """
    track, station, speed, stand = drive
    before = speed[station <= entry]
    slowest = int(np.argmin(before))
    begin = int(np.argmax(before[: slowest + 1]))
    approach = max(float(before[begin]), float(np.interp(leaves, station, speed)))

    regained = (np.arange(len(speed)) > slowest) & (speed >= approach)
    end = int(np.argmax(regained)) if regained.any() else len(speed)
    curvature = np.abs(np.gradient(track.curve.at(station)[:, 2], STATION_STEP_M))
    in_bends = np.sqrt(DRIVING.max_lateral_mps2 / np.maximum(curvature, 1e-6))
    free = speed.copy()
    free[begin:end] = np.maximum(speed, np.minimum(approach, in_bends))[begin:end]
    free_stand = np.where(station > entry, stand, 0.0)
    first = int(track.present[0])
    if track.speed[first] < track.vehicle.kind.waits_below:
        line = int(np.argmin(np.abs(station - track.progress[first])))
        free[: line + 1] = speed[: line + 1]
        free[line] = 0.0
        free_stand[line] = DRIVING.start_up_s
    return drive._replace(speed=_limited(free), stand=free_stand)


def _limited(speed: Floats) -> Floats:
    """Return speeds (S,) [m/s] with the accelerations of a human driver."""
    squares = np.square(speed)
    gain = 2.0 * DRIVING.acceleration_mps2 * STATION_STEP_M
    loss = 2.0 * DRIVING.braking_mps2 * STATION_STEP_M
    for k in range(1, len(squares)):
        squares[k] = min(squares[k], squares[k - 1] + gain)
    for k in range(len(squares) - 2, -1, -1):
        squares[k] = min(squares[k], squares[k + 1] + loss)
    return np.sqrt(squares)


def stop_before(drive: Drive, entry: float) -> Stop:
    """Return where and how a recorded driver stops before a conflict area.

    Args:
        drive: as recorded.
        entry: station [m] at which it enters the area.
    """
    stands = drive.station[(drive.stand > 0.0) & (drive.station <= entry)]
    if len(stands) == 0 or entry - stands[-1] > DRIVING.own_line_m:
        return Stop(entry - DRIVING.stop_distance_m, DRIVING.departure_mps2)
    line = float(stands[-1])
    departed = float(np.interp(line + DRIVING.departed_m, drive.station, drive.speed))
    departure = departed * departed / (2.0 * DRIVING.departed_m)
    low, high = DRIVING.own_departure_mps2
    return Stop(line, min(max(departure, low), high))


def delayed_drive(drive: Drive, entry: float, clears: float, stop: Stop) -> Drive:
    """Return a drive that lets another one go first; it rolls if it can, else it stops.

    Args:
        drive: as if it were alone.
        entry: station [m] at which it enters the conflict area.
        clears: when [s] the other vehicle has left the area; 0 s is when the drive begins.
        stop: where and how it stops.

    Raises:
        RefusedError: it would have to brake too hard.
    """
    line = int(np.searchsorted(drive.station, stop.line))
    stood = np.flatnonzero(drive.stand[: line + 1])
    if len(stood):  # since the recording began
        return _stopped(drive, int(stood[-1]), clears)

    def slowed(least: float) -> Drive:
        """Return the drive with a speed [m/s] at the line."""
        speed = _around(drive.station, line, least, stop.departure)
        return drive._replace(speed=np.minimum(drive.speed, speed))

    speeds = np.linspace(min(DRIVING.min_rolling_mps, drive.speed[line]), drive.speed[line], 20)
    entries = np.array([slowed(speed).time_at(entry) for speed in speeds])  # later if slower
    enters = clears + DRIVING.gap_s
    later = slowed(0.0)
    stands = clears + DRIVING.departure_lag_s - later.time[line]
    is_brief = stands < DRIVING.min_stand_s and entries[0] >= clears + DRIVING.min_gap_s
    if entries[0] >= enters or is_brief:
        later = slowed(float(np.interp(-enters, -entries, speeds)))
    else:
        later = _stopped(later, line, clears)
    if line == 0 or later.speed[0] < drive.speed[0]:
        raise RefusedError(f"vehicle {drive.track.vehicle.id} is too near to slow down")
    return later


def _stopped(drive: Drive, line: int, clears: float) -> Drive:
    """Return a drive that stands at a line, at least until another one has left."""
    arrives = float(drive.time[line] - drive.stand[line])
    stand = drive.stand.copy()
    stand[line] = max(clears + DRIVING.departure_lag_s - arrives, DRIVING.min_stand_s)
    return drive._replace(stand=stand)
