# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The template's own motion, cleaned: one smooth, drivable path per vehicle, and the progress along it.

Positions carry noise (GPS staircases of a metre, kinks of a video tracker), speeds far less of it. So the position is
smoothed as a function of the distance u = ∫ v dt that the speed claims: a penalised spline f(u) that minimises
∫ |f(u) − p|² du + λ ∫ |f''|² du (Eilers & Marx 1996). The least λ is taken at which the lateral acceleration can be
driven, or the one that weighs that least badly against a path far from the record; bends that are too sharp are then eased,
and turn as far as before. Standing
phases collapse to a point, time enters only through u(t), and no sample turns back.
"""

from dataclasses import dataclass
from functools import cached_property
import math

import numpy as np
from scipy import linalg

from scenario_gen.base.cancelling import stop_if_cancelled
from scenario_gen.numerics import Bools, Floats, frozen, frozen_ints, Ints, wrap_angle
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.plane import polyline_of, unit
from scenario_gen.types import Encounter, mask, ON_THE_SPOT, Vehicle

_WAVELENGTHS = (
    8.0,
    12.0,
    16.0,
    24.0,
    32.0,
    48.0,
    64.0,
    96.0,
    128.0,
)  # metres at which the filter halves an oscillation
_SHARE_OF_CURVATURE = (
    0.8  # of the sharpest curve of its type; of a car 0.2 1/m, its tightest turn but for a little
)
_SHARE_OF_LATERAL = 2.0 / 3.0  # of its type's lateral acceleration; of a car 4 m/s²
_MAX_DEVIATION = 0.6  # metres from the record
_TURN = math.radians(45.0)
_U_TURN = math.radians(140.0)
_STILL = 0.5  # metres: less path than this in a whole log is no path


@dataclass(frozen=True, eq=False)
class Track:
    """One vehicle's cleaned motion.

    Attributes:
        vehicle: identity and footprint.
        curve: its path; for a vehicle that stands throughout a metre of it, through its place.
        progress: (T,) arc length [m] on the path at each of the template's samples, non-decreasing.
        speed: (T,) m/s, as recorded.
        still: True if it stands throughout.
        deviation: largest distance [m] from a recorded position to the cleaned one.
        present: (2,) first and last sample at which it is there; before and after, progress and speed are those at these.
        recorded_turn: how far [rad, left positive] the recorded heading turns from start to end; NaN for one that stands.
        dt: seconds between samples.
        lane: the middle of the lanes that it drives on a road, before and beyond its path too; None: they are not known.
    """

    vehicle: Vehicle
    curve: Curve
    progress: Floats
    speed: Floats
    still: bool
    deviation: float
    present: Ints
    recorded_turn: float
    dt: float
    lane: Curve | None = None

    @cached_property
    def there(self) -> Bools:
        """(T,) whether it is there at each sample."""
        return np.asarray(mask(self.present[None], len(self.progress))[0])

    @property
    def travelled(self) -> float:
        """Metres driven in all."""
        return float(self.progress[-1])

    @property
    def poses(self) -> Floats:
        """(T, 3) cleaned poses at the template's samples."""
        return self.curve.at(self.progress)

    def turning(self, window: float) -> float:
        """The largest change of heading [rad, signed] over `window` metres of path."""
        s = np.arange(0.0, max(self.curve.length - 1.0, 0.0) + 1e-9, 0.5)
        yaw = self.curve.at(s)[:, 2]
        reach = int(window / 0.5)
        best = 0.0
        for lag in range(2, min(reach, len(s) - 1) + 1, 2):
            change = yaw[lag:] - yaw[:-lag]
            peak = float(change[np.argmax(np.abs(change))])
            best = peak if abs(peak) > abs(best) else best
        return best

    @property
    def makes_u_turn(self) -> bool:
        """True if it turns round within 45 m of path."""
        return abs(self.turning(45.0)) > _U_TURN

    @property
    def turns(self) -> bool:
        """True if it turns as at a junction: by more than 45° within 30 m (a bend of the road is gentler)."""
        return abs(self.turning(30.0)) > _TURN


def clean_tracks(encounter: Encounter) -> tuple[Track, ...]:
    """Return one cleaned track per vehicle."""
    return tuple(_clean(encounter, i) for i in range(len(encounter.vehicles)))


def drivers_of(tracks: tuple[Track, ...]) -> tuple[Track, ...]:
    """Return those who drive, whom lanes are for; everybody, where nobody does."""
    return tuple(track for track in tracks if not track.vehicle.kind.walks) or tracks


def driver_rows(encounter: Encounter) -> dict[int, int]:
    """Return the rows of those who drive, or of everybody where nobody does: among `drivers_of`, by that in the encounter."""
    drive = [n for n, vehicle in enumerate(encounter.vehicles) if not vehicle.kind.walks] or range(
        len(encounter.vehicles)
    )
    return {n: k for k, n in enumerate(drive)}


def _clean(encounter: Encounter, i: int) -> Track:
    """Clean one vehicle's motion while it is there."""
    first, last = encounter.present[i].tolist()
    there = slice(first, last + 1)
    heading, speed = encounter.heading[i, there], encounter.speed[i, there]
    claimed = np.concatenate(([0.0], np.cumsum((speed[1:] + speed[:-1]) / 2.0 * encounter.dt)))
    spread = float(np.hypot(*np.ptp(encounter.position[i, there], axis=0)))
    still = bool(claimed[-1] < _STILL or spread < _STILL)
    cleaned = _standing if still else _smoothed
    dynamics = encounter.vehicles[i].kind.dynamics
    limits = (
        min(_SHARE_OF_CURVATURE * dynamics.sharpest, ON_THE_SPOT),
        _SHARE_OF_LATERAL * dynamics.max_lateral_acceleration,
    )
    curve, progress, deviation = cleaned(
        encounter.position[i, there], heading, speed, claimed, limits
    )
    return Track(
        vehicle=encounter.vehicles[i],
        curve=curve,
        progress=frozen(
            np.pad(progress, (first, encounter.speed.shape[1] - 1 - last), mode="edge")
        ),
        speed=encounter.speed[i],
        still=still,
        deviation=deviation,
        present=frozen_ints([first, last]),
        recorded_turn=math.nan if still else float(heading[-1] - heading[0]),
        dt=encounter.dt,
    )


def _standing(
    position: Floats,
    heading: Floats,
    speed: Floats,
    _claimed: Floats,
    _limits: tuple[float, float],
) -> tuple[Curve, Floats, float]:
    """The path of a vehicle that stands, its progress, and how far its positions lie from it."""
    centre = position.mean(axis=0)
    yaw = float(np.arctan2(np.sin(heading).mean(), np.cos(heading).mean()))
    curve = Curve(np.array([[*centre, yaw], [*(centre + unit(yaw)), yaw]]))
    return curve, np.zeros(len(speed)), float(np.hypot(*(position - centre).T).max())


def _smoothed(
    position: Floats, heading: Floats, speed: Floats, claimed: Floats, limits: tuple[float, float]
) -> tuple[Curve, Floats, float]:
    """The drivable path of positions (T, 2) at distances (T,) that the speed claims, the progress, and the largest deviation.

    The limits are of curvature [1/m] and of lateral acceleration [m/s²].
    """
    max_curvature, max_lateral = limits
    best: tuple[float, Curve, Floats, float] | None = None
    for wavelength in _WAVELENGTHS:
        stop_if_cancelled()
        grid, smooth = smoothing_spline(claimed, position, wavelength)
        curve = Curve.through(smooth)
        progress = np.interp(claimed, grid, curve.station)
        deviation = float(np.hypot(*(curve.at(progress)[:, :2] - position).T).max())
        curvature = np.abs(np.diff(curve.points[:, 2])) / np.diff(curve.station)
        lateral = curvature * np.square(
            np.interp((grid[1:] + grid[:-1]) / 2.0, *_increasing(claimed, speed))
        )
        excess = (
            float(lateral.max()) / max_lateral,
            deviation / _MAX_DEVIATION,
        )  # what is too sharp is eased below
        badness = math.fsum(max(e - 1.0, 0.0) for e in excess)
        if best is None or badness < best[0]:
            best = (badness, curve, progress, deviation)
        if badness == 0.0:
            break
    assert best is not None
    _, curve, progress, deviation = best
    if (np.abs(np.diff(curve.points[:, 2])) / np.diff(curve.station)).max() > max_curvature:
        share = progress / curve.length
        curve = _eased(curve, max_curvature)
        progress = share * curve.length
        deviation = float(np.hypot(*(curve.at(progress)[:, :2] - position).T).max())
    return _aligned(curve, heading, speed, progress), progress, deviation


def _eased(curve: Curve, max_curvature: float) -> Curve:
    """The curve with its sharpest bends spread out until no curvature is above the limit.

    What a bend has too much is handed on to its neighbours, so it turns as far as before, over a longer way; the path is
    then integrated anew and put where it is nearest to the old one on average.
    """
    count = max(round(curve.length / 0.5), 1)
    step = curve.length / count
    even = curve.at(np.linspace(0.0, curve.length, count + 1))
    bend = np.diff(even[:, 2])
    most = 0.95 * max_curvature * step
    for _ in range(2000):
        excess = np.sign(bend) * np.maximum(np.abs(bend) - most, 0.0)
        if not excess.any():
            break
        bend = bend - excess
        bend[1:] += excess[:-1] / 2.0
        bend[:-1] += excess[1:] / 2.0
    yaw = even[0, 2] + np.concatenate(([0.0], np.cumsum(bend)))
    xy = polyline_of(yaw, step)
    xy += (even[:, :2] - xy).mean(axis=0)
    return Curve(np.column_stack((xy, yaw)))


def _aligned(curve: Curve, heading: Floats, speed: Floats, progress: Floats) -> Curve:
    """Shift the yaw by whole turns so that it is near the recorded heading where the vehicle is fastest."""
    fastest = int(np.argmax(speed))
    off = float(heading[fastest] - curve.at(progress[fastest])[2])
    turns = np.round((off - float(wrap_angle(np.array(off)))) / (2.0 * np.pi))
    return Curve(curve.points + np.array([0.0, 0.0, 2.0 * np.pi * turns]))


def _increasing(u: Floats, values: Floats) -> tuple[Floats, Floats]:
    keep = np.concatenate(([True], np.diff(u) > 1e-9))
    return u[keep], values[keep]


def smoothing_spline(u: Floats, values: Floats, wavelength: float) -> tuple[Floats, Floats]:
    """The penalised spline f at equal steps of u.

    Args:
        u: (T,) metres, non-decreasing from 0.
        values: (T, D).
        wavelength: metres of an oscillation that is halved.

    Returns:
        The grid (G,) and f on it (G, D).
    """
    count = max(int(np.ceil(u[-1] / 0.5)), 6) + 1
    grid = np.linspace(0.0, u[-1], count)
    step = grid[1]
    weight = np.gradient(u) + 1e-3 * step
    cell = np.minimum((u / step).astype(np.int64), count - 2)
    right = u / step - cell
    left = 1.0 - right
    bands = np.zeros((3, count))  # diagonals 0, 1, 2 below and on the normal matrix's
    rhs = np.zeros((count, values.shape[1]))
    np.add.at(bands[0], cell, weight * np.square(left))
    np.add.at(bands[0], cell + 1, weight * np.square(right))
    np.add.at(bands[1], cell, weight * left * right)
    np.add.at(rhs, cell, (weight * left)[:, None] * values)
    np.add.at(rhs, cell + 1, (weight * right)[:, None] * values)
    penalty = (wavelength / (2.0 * np.pi)) ** 4 / step**3
    for k, (a, b) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))):
        factor = penalty * (1.0, 4.0, 1.0, -2.0, -2.0, 1.0)[k]
        columns = np.arange(count - 2) + a
        bands[b - a, columns] += factor
    return grid, linalg.solveh_banded(bands, rhs, lower=True)
