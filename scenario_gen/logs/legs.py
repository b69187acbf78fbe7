# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Legs of raw tracks: displacement, recorded speed and recorded heading over about a second.

They show whether the quantities of a log agree before it is cleaned, in whatever units it is.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenario_gen.logs.geodesy import EARTH_RADIUS_M
from scenario_gen.logs.raw import Observations, Rows
from scenario_gen.numerics import Bools, Floats, Ints, running_sum

_LEG_S = 1.0
_MAX_LEG_STEPS_COUNT = 10
_PERIODS_S = (0.005, 5.0)  # usual periods; others have another unit
_MAX_STRETCH_RATIO = 2.5  # duration of a leg over that of its steps
_MAX_LEGS_COUNT = 2_000  # of a vehicle
_MOVING_SHARE = 0.2  # of the longest displacement of a vehicle; shorter legs do not count
_USUAL_AND_LONG_PERCENT = (75.0, 95.0)


@dataclass(frozen=True, eq=False)
class Legs:
    """L legs of all vehicles of a log that move.

    Attributes:
        vehicle: (L,) index of the vehicle.
        seconds: (L,) duration by the stamps.
        step: (L, 2) displacement [m], or in the unit of x and y.
        speed: (L,) mean recorded speed; NaN if unknown.
        heading: (L,) recorded heading in the middle; NaN if unknown.
        velocity: (L,) direction of the recorded velocity in the middle; NaN if unknown.
    """

    vehicle: Ints
    seconds: Floats
    step: Floats
    speed: Floats
    heading: Floats
    velocity: Floats

    @property
    def rate(self) -> Floats:
        """Displacement over duration (L,)."""
        rate: Floats = np.hypot(*self.step.T) / self.seconds
        return rate

    @property
    def course(self) -> Floats:
        """Direction of the displacement (L,) [rad]."""
        course: Floats = np.arctan2(self.step[:, 1], self.step[:, 0])
        return course


def median_period(vehicles: Sequence[Observations]) -> float:
    """Return the median time between consecutive fixes of a vehicle [s]; NaN without any."""
    steps = [np.diff(vehicle.fix_ns) for vehicle in vehicles if len(vehicle.fix_ns) > 1]
    joined = np.concatenate(steps) if steps else np.zeros(0)
    joined = joined[joined > 0]
    return float(np.median(joined)) * 1e-9 if len(joined) else np.nan


def legs_of(vehicles: Sequence[Observations], *, geographic: bool, least_steps: int = 1) -> Legs:
    """Return the legs of all vehicles, whose rows are in the order of the log.

    Args:
        vehicles: the raw tracks.
        geographic: whether positions are degrees.
        least_steps: number of steps of a leg, if the period does not tell it.
    """
    parts = [
        _legs_of_vehicle(k, vehicle, geographic=geographic, least_steps=least_steps)
        for k, vehicle in enumerate(vehicles)
    ]
    if not parts:
        nothing = Rows().observations("")
        return _legs_of_vehicle(0, nothing, geographic=geographic, least_steps=least_steps)
    names = Legs.__dataclass_fields__
    return Legs(**{name: np.concatenate([getattr(p, name) for p in parts]) for name in names})


def _legs_of_vehicle(
    number: int, vehicle: Observations, *, geographic: bool, least_steps: int
) -> Legs:
    """Return the legs of a vehicle while it moves."""
    fix = vehicle.fix
    usable: Bools = np.isfinite(fix[:, 0]) & np.isfinite(fix[:, 1])
    if geographic:
        usable &= (np.abs(fix) <= (90.0, 180.0)).all(axis=1)
    usable[1:] &= (fix[1:] != fix[:-1]).any(axis=1)  # held fixes are no measurements
    rows = np.flatnonzero(usable)
    stamps = vehicle.fix_ns[rows]
    period = median_period([vehicle])
    n_steps = _MAX_LEG_STEPS_COUNT
    if _PERIODS_S[0] <= period <= _PERIODS_S[1]:
        n_steps = int(np.clip(round(_LEG_S / period), 1, _MAX_LEG_STEPS_COUNT))
    n_steps = max(n_steps, least_steps)
    n_steps = max(min(n_steps, len(rows) - 1), 1)
    first = np.arange(max(len(rows) - n_steps, 0))
    first = first[:: max(len(first) // _MAX_LEGS_COUNT, 1)]
    last = first + n_steps
    n_backward = np.concatenate([[0], np.cumsum(np.diff(stamps) <= 0)]) if len(rows) else first
    seconds = (stamps[last] - stamps[first]) * 1e-9
    usual_s = float(np.median(seconds)) if len(seconds) else 0.0
    is_forward = (n_backward[last] == n_backward[first]) & (seconds > 0.0)
    is_forward &= seconds < _MAX_STRETCH_RATIO * usual_s
    first, last, seconds = first[is_forward], last[is_forward], seconds[is_forward]
    begin, end, middle = rows[first], rows[last], rows[(first + last) // 2]
    step = _displacements(fix[begin], fix[end], geographic=geographic)
    length = np.hypot(*step.T)
    usual, long = np.percentile(length, _USUAL_AND_LONG_PERCENT) if len(length) else (0.0, 0.0)
    reach = min(long, 3.0 * usual) if usual else long  # jumps of places are longer
    moving = (length > _MOVING_SHARE * reach) & (length > 0.0)
    return Legs(
        vehicle=np.full(moving.sum(), number),
        seconds=seconds[moving],
        step=step[moving],
        speed=_mean_speeds(vehicle, begin[moving], end[moving]),
        heading=vehicle.heading[middle[moving]],
        velocity=_velocities(vehicle, middle[moving]),
    )


def _displacements(first: Floats, last: Floats, *, geographic: bool) -> Floats:
    """Return displacements (L, 2) [m] between positions (L, 2)."""
    offset = last - first
    if not geographic:
        return offset
    offset[:, 1] = (offset[:, 1] + 180.0) % 360.0 - 180.0
    degree_m = np.radians(1.0) * EARTH_RADIUS_M
    parallel = np.cos(np.radians(first[:, 0]))
    step: Floats = degree_m * np.column_stack([parallel * offset[:, 1], offset[:, 0]])
    return step


def _velocities(vehicle: Observations, rows: Ints) -> Floats:
    """Return the directions (L,) of the recorded velocities at rows of the fixes."""
    if vehicle.course is None or not len(vehicle.speed_ns):
        return np.full(len(rows), np.nan)
    if len(vehicle.course) == len(vehicle.fix):
        return vehicle.course[rows]
    nearest = np.searchsorted(vehicle.speed_ns, vehicle.fix_ns[rows])
    return vehicle.course[np.clip(nearest, 0, len(vehicle.course) - 1)]


def _mean_speeds(vehicle: Observations, begin: Ints, end: Ints) -> Floats:
    """Return the mean recorded speeds (L,) between rows of the fixes; NaN if unknown."""
    if len(vehicle.speed_ns) < 2:
        return np.full(len(begin), np.nan)
    if len(vehicle.speed) == len(vehicle.fix):
        speed = vehicle.speed
    else:
        order = np.argsort(vehicle.speed_ns, kind="stable")
        speed = np.interp(vehicle.fix_ns, vehicle.speed_ns[order], vehicle.speed[order])
    total = running_sum(np.nan_to_num(speed))
    unknown = running_sum(~np.isfinite(speed))
    # The ends count half, as in the trapezoidal rule.
    inner = total[end] - total[begin + 1]
    mean = (inner + 0.5 * (np.nan_to_num(speed[begin]) + np.nan_to_num(speed[end]))) / (
        end - begin
    )
    is_known = (unknown[end + 1] == unknown[begin]) & (mean > 0.0)
    return np.where(is_known, mean, np.nan)
