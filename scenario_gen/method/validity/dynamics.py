# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Speed, acceleration and curvature of the motion between two samples, in closed form."""

from collections.abc import Iterator
from enum import IntEnum
from itertools import groupby
from typing import NamedTuple

import numpy as np

from scenario_gen.method.validity.limits import Limits
from scenario_gen.numerics import Floats
from scenario_gen.numerics.kernels import F, F1, F2, F3, kernel, named, OUT3
from scenario_gen.types import Cause, Scenario, Violation

LARGEST_VALUE_RATIO = 1e8  # in m, s, rad or m/s: a double is rounded by about 10 nm here
_STANDING_TURN_RAD = 1e-4  # change of heading per step that needs no motion: headings are rounded
_STANDING_TURN_RADPS = 1e-3  # the same as a rate, so that many short steps make no turn
_HEADING_ROUNDING_RAD = 1e-8
_ROUNDING_RATIO = 1e-6  # of a value exactly at its limit, in SI units


class Check(IntEnum):
    """The checks of one vehicle's motion; the rows that `worst_excess` fills."""

    NEGATIVE_SPEED = 0
    MAX_SPEED = 1
    ACCELERATION = 2
    DECELERATION = 3
    SPEED_CHANGE = 4
    LATERAL = 5
    CURVATURE = 6
    DISPLACEMENT = 7
    SLIP = 8
    PATH_LONGITUDINAL = 9
    PATH_LATERAL = 10


class MotionLimits(NamedTuple):
    """The limits of one type's motion.

    Attributes:
        speed: m/s.
        acceleration, deceleration, lateral: m/s².
        curvature: 1/m.
        slip: m/s by which displacement over time may differ from the published velocity.
        slip_share: the same as a share of the speed, in addition.
        tolerance: m/s² by which accelerations from speeds or positions may exceed the limits.
    """

    speed: float
    acceleration: float
    deceleration: float
    lateral: float
    curvature: float
    slip: float
    slip_share: float
    tolerance: float

    @classmethod
    def of(cls, limits: Limits, road_user: str) -> "MotionLimits":
        """Return the limits of a road-user type."""
        dynamics = limits.of(road_user)
        return cls(
            dynamics.max_speed,
            dynamics.max_acceleration,
            dynamics.max_deceleration,
            dynamics.max_lateral_acceleration,
            dynamics.sharpest,
            limits.slip,
            limits.slip_share,
            limits.acceleration_tolerance,
        )


class Step(NamedTuple):
    """The motion of one vehicle from a sample to the next one.

    Attributes:
        time: seconds, of the first sample.
        duration: seconds.
        speed, next_speed: m/s.
        acceleration, next_acceleration: m/s².
        heading, next_heading: rad.
        dx, dy: displacement [m].
    """

    time: float
    duration: float
    speed: float
    next_speed: float
    acceleration: float
    next_acceleration: float
    heading: float
    next_heading: float
    dx: float
    dy: float


@kernel(F1, F3, F2, F2, F2)
def is_motion(
    time: Floats, position: Floats, heading: Floats, speed: Floats, acceleration: Floats
) -> bool:
    """Return whether all values are finite and not too large, and time increases.

    Args:
        time: (T,) seconds.
        position: (N, T, 2) metres.
        heading: (N, T) rad.
        speed: (N, T) m/s.
        acceleration: (N, T) m/s².
    """
    for k in range(1, len(time)):
        if time[k] <= time[k - 1]:
            return False
    return (
        _is_usable(time)
        and _is_usable(position.ravel())
        and _is_usable(heading.ravel())
        and _is_usable(speed.ravel())
        and _is_usable(acceleration.ravel())
    )


@kernel(inline=True)
def _is_usable(values: Floats) -> bool:
    """Whether all values (n,) are finite and not too large."""
    for value in values:  # noqa: SIM110 - numba has no generators in `all`
        if not abs(value) <= LARGEST_VALUE_RATIO:  # NaN fails
            return False
    return True


@kernel(inline=True)
def _note(
    out: Floats, check: Check, excess: float, value: float, limit: float, time: float
) -> None:
    """Record an excess over a limit if it is the worst one of this check."""
    if excess > out[check, 0]:
        out[check, 0] = excess
        out[check, 1] = value
        out[check, 2] = limit
        out[check, 3] = time


@kernel(inline=True)
def _to_body(yaw: float, x: float, y: float) -> tuple[float, float]:
    """Components ahead and to the left of a vector (x, y), for a heading [rad]."""
    c, s = np.cos(yaw), np.sin(yaw)
    return c * x + s * y, c * y - s * x


@kernel(inline=True)
def _check_sample(out: Floats, limits: MotionLimits, time: float, v: float, a: float) -> None:
    """Compare the published speed v [m/s] and acceleration a [m/s²] of one sample."""
    _note(out, Check.NEGATIVE_SPEED, -v, v, 0.0, time)
    _note(out, Check.MAX_SPEED, v - limits.speed - _ROUNDING_RATIO, v, limits.speed, time)
    _check_acceleration(out, limits, time, a)


@kernel(inline=True)
def _check_acceleration(out: Floats, limits: MotionLimits, time: float, a: float) -> None:
    """Compare a longitudinal acceleration [m/s²]."""
    above = a - limits.acceleration - _ROUNDING_RATIO
    below = -a - limits.deceleration - _ROUNDING_RATIO
    _note(out, Check.ACCELERATION, above, a, limits.acceleration, time)
    _note(out, Check.DECELERATION, below, -a, limits.deceleration, time)


@kernel(inline=True)
def _check_speed_change(out: Floats, limits: MotionLimits, step: Step) -> None:
    """Compare the change of speed with the limits and with the published accelerations."""
    rate = (step.next_speed - step.speed) / step.duration
    _check_acceleration(out, limits, step.time, rate)
    highest = max(step.acceleration, step.next_acceleration)
    lowest = min(step.acceleration, step.next_acceleration)
    off = max(rate - highest, lowest - rate)
    excess = off - limits.tolerance - _ROUNDING_RATIO
    _note(out, Check.SPEED_CHANGE, excess, off, limits.tolerance, step.time)


@kernel(inline=True)
def _check_turn(out: Floats, limits: MotionLimits, step: Step) -> None:
    """Compare lateral acceleration and curvature of the linear change of heading."""
    turn = abs(step.next_heading - step.heading)
    lateral = max(step.speed, step.next_speed) * turn / step.duration
    excess = lateral - limits.lateral - _ROUNDING_RATIO
    _note(out, Check.LATERAL, excess, lateral, limits.lateral, step.time)

    moved = np.sqrt(step.dx * step.dx + step.dy * step.dy)
    drift = _STANDING_TURN_RADPS * step.duration + _HEADING_ROUNDING_RAD
    if turn > min(_STANDING_TURN_RAD, drift) + limits.curvature * moved:
        curvature = turn / moved
        excess = curvature - limits.curvature
        _note(out, Check.CURVATURE, excess, curvature, limits.curvature, step.time)


@kernel(inline=True)
def _check_displacement(out: Floats, limits: MotionLimits, step: Step) -> None:
    """Compare the displacement with the published velocities, and the cubic's speed."""
    h = step.duration
    vx, vy = step.speed * np.cos(step.heading), step.speed * np.sin(step.heading)
    wx = step.next_speed * np.cos(step.next_heading)
    wy = step.next_speed * np.sin(step.next_heading)
    fastest = max(step.speed, step.next_speed)

    middle = 0.5 * (step.heading + step.next_heading)
    ahead, left = _to_body(middle, step.dx / h - 0.5 * (vx + wx), step.dy / h - 0.5 * (vy + wy))
    allowed = limits.slip + limits.slip_share * fastest
    _note(out, Check.DISPLACEMENT, abs(ahead) - allowed, abs(ahead), allowed, step.time)
    _note(out, Check.SLIP, abs(left) - allowed, abs(left), allowed, step.time)

    # the middle control point of the cubic's derivative is 3 displacement / h - v - w
    qx, qy = 3.0 * step.dx / h - vx - wx, 3.0 * step.dy / h - vy - wy
    between = fastest + 0.5 * max(0.0, np.sqrt(qx * qx + qy * qy) - fastest)
    excess = between - limits.speed - _ROUNDING_RATIO
    _note(out, Check.MAX_SPEED, excess, between, limits.speed, step.time)


@kernel(inline=True)
def _check_path(
    out: Floats, limits: MotionLimits, time: Floats, position: Floats, k: int, yaw: float
) -> None:
    """Compare the acceleration at sample k that the positions (T, 2) [m] alone imply.

    Their second difference is a mean of the acceleration over the two steps around k.
    """
    before, after = time[k] - time[k - 1], time[k + 1] - time[k]
    half = 0.5 * (time[k + 1] - time[k - 1])
    x = (position[k + 1, 0] - position[k, 0]) / after - (
        position[k, 0] - position[k - 1, 0]
    ) / before
    y = (position[k + 1, 1] - position[k, 1]) / after - (
        position[k, 1] - position[k - 1, 1]
    ) / before
    ahead, left = _to_body(yaw, x / half, y / half)
    high = limits.acceleration + limits.tolerance
    low = limits.deceleration + limits.tolerance
    lateral = limits.lateral + limits.tolerance
    _note(out, Check.PATH_LONGITUDINAL, ahead - high, ahead, high, time[k])
    _note(out, Check.PATH_LONGITUDINAL, -ahead - low, -ahead, low, time[k])
    _note(out, Check.PATH_LATERAL, abs(left) - lateral, abs(left), lateral, time[k])


@kernel(F1, F3, F2, F2, F2, named(MotionLimits, F, F, F, F, F, F, F, F), OUT3)
def worst_excess(
    time: Floats,
    position: Floats,
    heading: Floats,
    speed: Floats,
    acceleration: Floats,
    limits: MotionLimits,
    out: Floats,
) -> None:
    """Find by how much the worst instant of each vehicle exceeds each limit.

    Args:
        time: (T,) seconds.
        position: (N, T, 2) metres.
        heading: (N, T) rad.
        speed: (N, T) m/s.
        acceleration: (N, T) m/s².
        limits: of all these vehicles.
        out: (N, len(Check), 4) filled with excess (<= 0: the limit is kept), value, limit and
            time [s].
    """
    n, t = speed.shape
    for i in range(n):
        out[i, :, 0] = 0.0
        for k in range(t):
            _check_sample(out[i], limits, time[k], speed[i, k], acceleration[i, k])
            if k == t - 1:
                break
            if k > 0:
                _check_path(out[i], limits, time, position[i], k, heading[i, k])
            step = Step(
                time[k],
                time[k + 1] - time[k],
                speed[i, k],
                speed[i, k + 1],
                acceleration[i, k],
                acceleration[i, k + 1],
                heading[i, k],
                heading[i, k + 1],
                position[i, k + 1, 0] - position[i, k, 0],
                position[i, k + 1, 1] - position[i, k, 1],
            )
            _check_speed_change(out[i], limits, step)
            _check_turn(out[i], limits, step)
            _check_displacement(out[i], limits, step)


class Report(NamedTuple):
    """How an excess is reported: its cause, a message, and the parameter that limits it."""

    cause: Cause
    message: str
    parameter: str = ""


REPORTS = {
    Check.NEGATIVE_SPEED: Report(Cause.SPEED, "speed falls to {value:.3f} m/s, below zero"),
    Check.MAX_SPEED: Report(
        Cause.SPEED,
        "speed reaches {value:.3f} m/s, above the limit of {limit:.3f} m/s",
        "max_speed",
    ),
    Check.ACCELERATION: Report(
        Cause.LONGITUDINAL_ACCELERATION,
        "acceleration reaches {value:.3f} m/s², above the limit of {limit:.3f} m/s²",
        "max_acceleration",
    ),
    Check.DECELERATION: Report(
        Cause.LONGITUDINAL_ACCELERATION,
        "braking reaches {value:.3f} m/s², above the limit of {limit:.3f} m/s²",
        "max_deceleration",
    ),
    Check.SPEED_CHANGE: Report(
        Cause.LONGITUDINAL_ACCELERATION,
        "the speed changes at a rate {value:.3f} m/s² outside the published accelerations; "
        "the tolerance is {limit:.3f} m/s²",
    ),
    Check.LATERAL: Report(
        Cause.LATERAL_ACCELERATION,
        "lateral acceleration reaches {value:.3f} m/s², above the limit of {limit:.3f} m/s²",
        "max_lateral_acceleration",
    ),
    Check.CURVATURE: Report(
        Cause.CURVATURE,
        "curvature reaches {value:.3f} 1/m, above the limit of {limit:.3f} 1/m",
        "max_curvature",
    ),
    Check.DISPLACEMENT: Report(
        Cause.SPEED,
        "the position advances {value:.3f} m/s off the published speed; "
        "the tolerance is {limit:.3f} m/s",
    ),
    Check.SLIP: Report(
        Cause.CURVATURE,
        "slides sideways at {value:.3f} m/s relative to its heading; "
        "the tolerance is {limit:.3f} m/s",
    ),
    Check.PATH_LONGITUDINAL: Report(
        Cause.LONGITUDINAL_ACCELERATION,
        "its positions accelerate or brake at {value:.3f} m/s²; the limit is {limit:.3f} m/s²",
    ),
    Check.PATH_LATERAL: Report(
        Cause.LATERAL_ACCELERATION,
        "its positions accelerate sideways at {value:.3f} m/s²; the limit is {limit:.3f} m/s²",
    ),
}


def motion_violations(scenario: Scenario, limits: Limits) -> Iterator[Violation]:
    """Yield where a vehicle's motion exceeds a limit or contradicts itself."""
    # NaN is no proof: a vehicle that the kernel does not fill in is refused
    out = np.full((len(scenario.vehicles), len(Check), 4), np.nan)
    for rows, span in vehicle_groups(scenario):
        worst_excess(
            scenario.time[span],
            scenario.position[rows, span],
            scenario.heading[rows, span],
            scenario.speed[rows, span],
            scenario.acceleration[rows, span],
            MotionLimits.of(limits, scenario.vehicles[rows.start].type),
            out[rows],
        )
    for i, row in np.argwhere(~(out[..., 0] <= 0.0)).tolist():
        _, value, limit, time = out[i, row].tolist()
        report = REPORTS[Check(row)]
        message = f"vehicle {i}: {report.message.format(value=value, limit=limit)}"
        if report.parameter:
            message += f" (limits.{scenario.vehicles[i].type}.{report.parameter})"
        yield Violation(report.cause, time, (i,), message)


def vehicle_groups(scenario: Scenario) -> Iterator[tuple[slice, slice]]:
    """Yield rows of neighbouring vehicles with the same type and presence, and that presence."""
    types = (vehicle.type for vehicle in scenario.vehicles)
    row = 0
    for ((first, last), _), group in groupby(zip(scenario.present.tolist(), types, strict=True)):
        count = len(list(group))
        yield slice(row, row + count), slice(first, last + 1)
        row += count
