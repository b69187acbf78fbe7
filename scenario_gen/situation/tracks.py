# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The recorded motion, cleaned: one smooth, drivable path per vehicle, and the progress along it.

Positions are noisy (GPS staircases of a metre, kinks from a video tracker), speeds much less. The
path is therefore fitted to the positions over the distance u = ∫ v dt from the speed, as logs do
(`smoothing.path`), for their estimated noise. If its lateral acceleration is not drivable, more
noise is assumed. Bends that are too sharp are then eased; they turn as far as before. Standing
phases collapse to a point, time enters only through u(t), and no sample moves backwards.

A wait is a smoothed speed below 0.5 m/s (on foot 0.2 m/s) for at least 1 s.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
import math
from typing import Final, NamedTuple

import numpy as np
from scipy import ndimage

from scenario_gen.base.cancelling import stop_if_cancelled
from scenario_gen.numerics import (
    angle_between,
    Bools,
    Floats,
    frozen,
    frozen_ints,
    Ints,
    polyline_of,
    running_sum,
    runs,
    unit,
    wrap_angle,
)
from scenario_gen.numerics.curve import Curve
from scenario_gen.smoothing.path import estimated_noise, fit_path, GRID_STEP_M
from scenario_gen.types import (
    CAR,
    Encounter,
    mask,
    MAX_PLANNED_CURVATURE_PER_M,
    Vehicle,
    VEHICLE_TYPES,
)

CURVATURE_SHARE = 0.8  # of a type's sharpest curve; for a car 0.2 1/m, nearly its tightest turn
LATERAL_SHARE = 2.0 / 3.0  # of a type's lateral acceleration; for a car 4 m/s²
MAX_DEVIATION_M = 0.6  # from the recording
MIN_NOISE_M = 0.03  # of positions that are smooth already
NOISE_STEP_RATIO = 1.4  # by which more noise is assumed until a path is drivable
TURN_RAD = math.radians(45.0)
TURN_WINDOW_M = 30.0  # a bend of a road turns less within it
MAX_BEND_RAD = math.radians(25.0)  # of a bend of a road, within it
U_TURN_RAD = math.radians(140.0)
U_TURN_WINDOW_M = 45.0
MIN_PATH_M = 0.5  # a vehicle with a shorter path stands
EASING_SHARE = 0.95  # of the allowed curvature, to which bends are eased


@dataclass(frozen=True, eq=False)
class Track:
    """The cleaned motion of one vehicle.

    Attributes:
        vehicle: identity and footprint.
        curve: its path; if it always stands, one metre through its place.
        progress: (T,) arc length [m] on the path at each sample, non-decreasing.
        speed: (T,) m/s, as recorded.
        still: whether it always stands.
        deviation: largest distance [m] from a recorded position to the cleaned one.
        present: (2,) first and last sample; before and after, progress and speed are constant.
        dt: seconds between samples.
        lane: the centre line of its lanes on a road, beyond both ends of its path; None: unknown.
    """

    vehicle: Vehicle
    curve: Curve
    progress: Floats
    speed: Floats
    still: bool
    deviation: float
    present: Ints
    dt: float
    lane: Curve | None = None

    @cached_property
    def is_present(self) -> Bools:
        """(T,) whether it is present at each sample."""
        return np.asarray(mask(self.present[None], len(self.progress))[0])

    @property
    def travelled(self) -> float:
        """Total distance driven [m]."""
        return float(self.progress[-1])

    @property
    def poses(self) -> Floats:
        """(T, 3) cleaned poses at the samples."""
        return self.curve.at(self.progress)

    def turning(self, window: float) -> float:
        """Return the largest change of heading [rad, signed] over `window` metres of path."""
        stations = np.arange(0.0, max(self.curve.length - 1.0, 0.0) + 1e-9, GRID_STEP_M)
        yaw = self.curve.at(stations)[:, 2]
        largest = 0.0
        for lag in range(2, min(int(window / GRID_STEP_M), len(yaw) - 1) + 1, 2):
            change = yaw[lag:] - yaw[:-lag]
            peak = float(change[np.argmax(np.abs(change))])
            if abs(peak) > abs(largest):
                largest = peak
        return largest

    @property
    def makes_u_turn(self) -> bool:
        """Whether it turns round within 45 m of path."""
        return abs(self.turning(U_TURN_WINDOW_M)) > U_TURN_RAD

    @property
    def turns(self) -> bool:
        """Whether it turns as at a junction: by more than 45° within 30 m."""
        return abs(self.turning(TURN_WINDOW_M)) > TURN_RAD


class _Record(NamedTuple):
    """Positions (T, 2), headings and speeds (T,) of a vehicle, and the distance (T,) it claims."""

    position: Floats
    heading: Floats
    speed: Floats
    distance: Floats


class _Path(NamedTuple):
    """A path, the progress (T,) [m] on it, and the largest deviation [m] from the recording."""

    curve: Curve
    progress: Floats
    deviation: float


def clean_tracks(encounter: Encounter) -> tuple[Track, ...]:
    """Return one cleaned track per vehicle."""
    return tuple(_clean(encounter, n) for n in range(len(encounter.vehicles)))


def drivers_of(tracks: Sequence[Track]) -> tuple[Track, ...]:
    """Return the tracks without pedestrians; all tracks if everybody walks."""
    drivers = [track for track in tracks if not track.vehicle.kind.walks]
    return tuple(drivers or tracks)


def driver_rows(encounter: Encounter) -> dict[int, int]:
    """Return the rows among `drivers_of` by the rows in the encounter."""
    drivers = [n for n, vehicle in enumerate(encounter.vehicles) if not vehicle.kind.walks]
    rows = drivers or range(len(encounter.vehicles))
    return {n: k for k, n in enumerate(rows)}


def _clean(encounter: Encounter, n: int) -> Track:
    """Clean the motion of one vehicle while it is present."""
    first, last = encounter.present[n].tolist()
    rows = slice(first, last + 1)
    speed = encounter.speed[n, rows]
    steps = (speed[1:] + speed[:-1]) / 2.0 * encounter.dt
    record = _Record(
        encounter.position[n, rows],
        encounter.heading[n, rows],
        speed,
        running_sum(steps),
    )
    extent = float(np.hypot(*np.ptp(record.position, axis=0)))
    still = bool(record.distance[-1] < MIN_PATH_M or extent < MIN_PATH_M)
    dynamics = encounter.vehicles[n].kind.dynamics
    max_curvature = min(CURVATURE_SHARE * dynamics.sharpest, MAX_PLANNED_CURVATURE_PER_M)
    max_lateral = LATERAL_SHARE * dynamics.max_lateral_acceleration
    path = _standing(record) if still else _smoothed(record, max_curvature, max_lateral)
    padding = (first, encounter.speed.shape[1] - 1 - last)
    return Track(
        vehicle=encounter.vehicles[n],
        curve=path.curve,
        progress=frozen(np.pad(path.progress, padding, mode="edge")),
        speed=encounter.speed[n],
        still=still,
        deviation=path.deviation,
        present=frozen_ints([first, last]),
        dt=encounter.dt,
    )


def _standing(record: _Record) -> _Path:
    """The path of a vehicle that stands."""
    centre = record.position.mean(axis=0)
    sine, cosine = np.sin(record.heading).mean(), np.cos(record.heading).mean()
    yaw = float(np.arctan2(sine, cosine))
    curve = Curve(np.array([[*centre, yaw], [*(centre + unit(yaw)), yaw]]))
    deviation = float(np.hypot(*(record.position - centre).T).max())
    return _Path(curve, np.zeros(len(record.speed)), deviation)


def _smoothed(record: _Record, max_curvature: float, max_lateral: float) -> _Path:
    """The drivable path of a record; the limits are in 1/m and m/s²."""
    least = math.inf
    noise = estimated_noise(record.position, MIN_NOISE_M)
    weight = np.ones(len(record.distance))
    driven = record.distance[-1]
    grid = np.linspace(0.0, driven, max(math.ceil(driven / GRID_STEP_M), 6) + 1)
    speed = np.interp((grid[1:] + grid[:-1]) / 2.0, record.distance, record.speed)
    for factor in NOISE_STEP_RATIO ** np.arange(9):
        stop_if_cancelled()
        fitted = fit_path(record.distance, record.position, weight, factor * noise, record.speed)
        curve = Curve.through(fitted.curve(grid))
        progress = np.interp(record.distance, grid, curve.station)
        candidate = _Path(curve, progress, _deviation(curve, progress, record))
        curvature = _curvature(curve)
        lateral = float((curvature * np.square(speed)).max())
        excess = max(lateral / max_lateral, float(curvature.max()) / max_curvature) - 1.0
        cost = max(excess, 0.0) + candidate.deviation / MAX_DEVIATION_M
        if cost < least:
            least = cost
            path = candidate
        if excess <= 0.0 or candidate.deviation > MAX_DEVIATION_M:
            break
    curve, progress = path.curve, path.progress
    if _curvature(curve).max() > max_curvature:
        share = progress / curve.length
        curve = _eased(curve, max_curvature)
        progress = share * curve.length
        path = _Path(curve, progress, _deviation(curve, progress, record))
    return path._replace(curve=_aligned(path, record))


def _curvature(curve: Curve) -> Floats:
    """The curvature [1/m] of each edge of a curve."""
    return np.asarray(np.abs(np.diff(curve.points[:, 2])) / np.diff(curve.station))


def _deviation(curve: Curve, progress: Floats, record: _Record) -> float:
    """The largest distance [m] from the recording."""
    return float(np.hypot(*(curve.at(progress)[:, :2] - record.position).T).max())


def _eased(curve: Curve, max_curvature: float) -> Curve:
    """The curve with its sharpest bends spread out until no curvature exceeds the limit.

    The excess of a bend passes to its neighbours, so that it turns as far as before, over a longer
    distance. The path is then integrated again and placed nearest to the old one on average.
    """
    count = max(round(curve.length / GRID_STEP_M), 1)
    step = curve.length / count
    even = curve.at(np.linspace(0.0, curve.length, count + 1))
    bend = np.diff(even[:, 2])
    limit = EASING_SHARE * max_curvature * step
    for _ in range(2000):
        excess = np.sign(bend) * np.maximum(np.abs(bend) - limit, 0.0)
        if not excess.any():
            break
        bend = bend - excess
        bend[1:] += excess[:-1] / 2.0
        bend[:-1] += excess[1:] / 2.0
    yaw = even[0, 2] + running_sum(bend)
    xy = polyline_of(yaw, step)
    xy += (even[:, :2] - xy).mean(axis=0)
    return Curve(np.column_stack((xy, yaw)))


def _aligned(path: _Path, record: _Record) -> Curve:
    """Shift the yaw by whole turns to the recorded heading where the vehicle is fastest."""
    fastest = int(np.argmax(record.speed))
    off = float(record.heading[fastest] - path.curve.at(path.progress[fastest])[2])
    turns = np.round((off - float(wrap_angle(np.array(off)))) / (2.0 * np.pi))
    return Curve(path.curve.points + np.array([0.0, 0.0, 2.0 * np.pi * turns]))


MAX_TURN_CHANGE_RAD: Final = np.radians(40.0)  # between turns that are the same manoeuvre
SURELY_SAME_TURN_RAD: Final = np.radians(15.0)  # even if their names differ
MIN_NAMED_TURN_RAD = np.radians(30.0)
MIN_NAMED_U_TURN_RAD = np.radians(150.0)
BEND_WINDOW_M = 8.0


def turn_of(track: Track) -> float:
    """How far [rad, left positive] a track turns; 0 for a vehicle that stands."""
    if track.still:
        return 0.0
    start, end = track.curve.at(track.progress[[0, -1]])[:, 2]
    return float(end - start)


def manoeuvre_of(turn: float) -> str:
    """The name of a manoeuvre with this turn [rad]: "straight", "left", "right" or "U-turn"."""
    if abs(turn) < MIN_NAMED_TURN_RAD:
        return "straight"
    if abs(turn) > MIN_NAMED_U_TURN_RAD:
        return "U-turn"
    return "left" if turn > 0.0 else "right"


def is_same_turn(recorded: float, turn: float) -> bool:
    """Whether a turn [rad] is that of the recording: at most 40° different, with the same name."""
    change = abs(angle_between(turn, recorded))
    if change <= SURELY_SAME_TURN_RAD:
        return True
    return change <= MAX_TURN_CHANGE_RAD and manoeuvre_of(recorded) == manoeuvre_of(turn)


def follows_bend(track: Track) -> bool:
    """Whether a track turns no more than a road bends: at most 25° within 30 m."""
    share = min(track.travelled / TURN_WINDOW_M, 1.0)
    return abs(track.turning(TURN_WINDOW_M)) <= share * MAX_BEND_RAD


def sharpness_of(track: Track) -> float:
    """The curvature [1/m] of the sharpest bend over 8 m, within the range of cars."""
    window = min(BEND_WINDOW_M, max(track.curve.length, 1.0))
    bend = abs(track.turning(BEND_WINDOW_M)) / window
    return float(np.clip(bend, 0.005, 0.17))


def describe_turn(turn: float) -> str:
    """A turn [rad] in words: "turns left by 68°", "goes straight on (4° to the right)"."""
    side = "left" if turn > 0.0 else "right"
    degrees = abs(np.degrees(turn))
    if manoeuvre_of(turn) != "straight":
        return f"turns {side} by {degrees:.0f}°"
    return (
        f"goes straight on ({degrees:.0f}° to the {side})"
        if degrees >= 1.0
        else "goes straight on"
    )


WAIT_SPEED_MPS = VEHICLE_TYPES.built_in[CAR].waits_below
MIN_WAIT_S = 1.0
SMOOTHING_S = 0.5  # width of the centred moving mean
STANDSTILL_SPEED_MPS = 0.1  # a vehicle that is faster creeps


@dataclass(frozen=True)
class Wait:
    """A vehicle waits.

    Attributes:
        vehicle: index of the vehicle.
        start: seconds.
        end: seconds.
        moves_slowly: whether the vehicle creeps: it stands for less than 1 s.
    """

    vehicle: int
    start: float
    end: float
    moves_slowly: bool = False


def find_waits(encounter: Encounter) -> tuple[Wait, ...]:
    """Return the waits of all vehicles, ordered by vehicle and time."""
    width = 2 * round(0.5 * SMOOTHING_S / encounter.dt) + 1
    smooth = ndimage.uniform_filter1d(encounter.speed, width, mode="nearest")
    time = encounter.time
    waits = []
    for n, vehicle in enumerate(encounter.vehicles):
        slow = (smooth[n] < vehicle.kind.waits_below) & encounter.is_present[n]
        for begin, end in runs(slow):
            start, stop = float(time[begin]), float(time[end - 1])
            if stop - start >= MIN_WAIT_S - 1e-9:
                creeps = _creeps(encounter.speed[n, begin:end], time[begin:end])
                waits.append(Wait(n, start, stop, creeps))
    return tuple(waits)


def _creeps(speed: Floats, time: Floats) -> bool:
    """Whether less than `MIN_WAIT_S` lies between the first and the last standstill."""
    standstill = time[speed <= STANDSTILL_SPEED_MPS]
    return len(standstill) == 0 or bool(np.ptp(standstill) < MIN_WAIT_S - 1e-9)
