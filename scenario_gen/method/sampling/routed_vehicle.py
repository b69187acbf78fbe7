# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One vehicle on its route: the conditions of its speed, and the mean speed on a clock."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy import ndimage

from scenario_gen.method.sampling.config import SamplingConfig
from scenario_gen.method.sampling.deviations import Steering
from scenario_gen.method.sampling.path import BasePath, MIN_NODES_COUNT, NODE_SPACING_M
from scenario_gen.method.sampling.plan import Plan
from scenario_gen.method.sampling.speed_profile.mean import (
    Bounds,
    mean_speed,
    MeanSpeed,
    Motion,
    rounded_lines,
    Target,
)
from scenario_gen.method.sampling.speed_profile.spline import (
    lengthened_waits,
    MIN_WAIT_S,
    speed_knots,
    SpeedKnots,
    SpeedSpline,
    STANDING_MPS,
    standing_within,
)
from scenario_gen.method.sampling.time_warp import Clock
from scenario_gen.numerics import Bools, Floats
from scenario_gen.situation import Track, Wait
from scenario_gen.types import Dynamics, Encounter, Vehicle

_NO_LIMIT_RATIO = 1e6  # of a limit in SI units that is lifted


@dataclass(frozen=True)
class _Tuning:
    """Choices without a source in the paper.

    Attributes:
        max_scale: largest factor on the template's speeds; on a longer route only the mean is
            raised.
        creeping_share: of the speed below which a type waits: fastest in a slow wait.
        end_ramp: m/s² from the template's speed to a requested end speed.
        curve_reach: m to either side of a position, over which the sharpest curvature counts.
        curve_share: of the lateral limit that the mean may use; the rest is for deviations.
        recorded_curve_share: the same where the template takes bends that fast.
        bend_rounds: times that speeds are bounded by the bends where the mean then is.
        jerk_factor, min_jerk: bound of the jerk over the template's largest one; at least, m/s³.
        bend_factor, min_bend: the same of the lateral acceleration; at least, m/s².
        averaging: s over which the template's lateral acceleration is averaged.
        early_start: s by which a vehicle moves before its speed lines do, which are rounded.
        min_rest: s of zero speed in a wait; the checker counts the slow start as standing, too.
    """

    max_scale: float = 4.0
    creeping_share: float = 0.9
    end_ramp: float = 1.5
    curve_reach: float = 2.0
    curve_share: float = 0.85
    recorded_curve_share: float = 0.95
    bend_rounds: int = 4
    jerk_factor: float = 1.2
    min_jerk: float = 1.0
    bend_factor: float = 1.2
    min_bend: float = 2.0
    averaging: float = 0.5
    early_start: float = 0.3
    min_rest: float = MIN_WAIT_S - 0.2


_TUNING = _Tuning()


@dataclass(frozen=True, eq=False)
class RoutedVehicle:
    """One vehicle on its route, before its speed is known.

    Attributes:
        vehicle: identity and footprint.
        path: the route.
        knots: of the straight lines that fit the template's speed, with its waits.
        lines: (M,) m/s at the knots, scaled to the route.
        spline: the basis of its speed.
        times: (K + 2,) its arrival, the changepoints while it is present, and its departure [s].
        anchor: (K + 2,) arc lengths [m] of their anchors.
        recorded_time: (T,) the template's samples while it is present [s].
        recorded_speed: (T,) its speeds [m/s] there, scaled to the route.
        ends: requested speeds [m/s] at start and end.
        recorded_ends: the template's speeds there, scaled to the route.
        jerk: largest jerk [m/s³].
        bend: lateral acceleration [m/s²] above which the clock is slowed.
        lateral: (T,) lateral acceleration [m/s²] of the template, which is allowed again.
        steering: the small corrections of its driver.
        rests: begin and end [s] of the stands in which its speed is zero.
        limits: of its motion.
    """

    vehicle: Vehicle
    path: BasePath
    knots: SpeedKnots
    lines: Floats
    spline: SpeedSpline
    times: Floats
    anchor: Floats
    recorded_time: Floats
    recorded_speed: Floats
    ends: tuple[float, float]
    recorded_ends: tuple[float, float]
    jerk: float
    bend: float
    lateral: Floats
    steering: Steering
    rests: list[tuple[float, float]]
    limits: Dynamics

    def without_limit(self, name: str) -> "RoutedVehicle":
        """Return the vehicle without a limit."""
        return replace(self, limits=replace(self.limits, **{name: _NO_LIMIT_RATIO}))

    def target(self, clock: Clock) -> Target:
        """Return the speeds and places that the mean should be near, on this clock."""
        grid = clock.grid
        grid = grid[(grid >= self.times[0] - 1e-9) & (grid <= self.times[-1] + 1e-9)]
        line = np.interp(grid, self.knots.knot, self.lines)
        rates = clock.at(self.times[[0, -1]])[1]
        ends = (self.ends[0] * float(rates[0]), self.ends[1] * float(rates[1]))
        for end, since in ((0, grid - grid[0]), (-1, grid[-1] - grid)):
            change = ends[end] - self.recorded_ends[end]
            ramp = max(2.0 * abs(change) / _TUNING.end_ramp, 1.0)
            line = line + change * np.square(np.maximum(1.0 - since / ramp, 0.0))
        inner = 1 + np.flatnonzero(np.diff(self.anchor[:-1]) != 0.0)
        places = (self.times[inner], self.anchor[inner])
        return Target(grid, np.maximum(line, 0.0), *places, ends, self.path.length)

    def mean(self, clock: Clock) -> MeanSpeed | str:
        """Return the mean speed on this clock, or the reason for its absence."""
        spline, limits = self.spline, self.limits
        motion, target = Motion.of(spline, *clock.at(spline.stations)[1:]), self.target(clock)
        at, pace = spline.middle, clock.at(spline.middle)[1]
        top = limits.max_speed * pace
        creeping = _TUNING.creeping_share * self.vehicle.kind.waits_below * pace
        margin = float(spline.breaks[1] - spline.breaks[0])
        for begin, end in self.knots.spans(self.knots.creeping):
            inside = (at > begin - margin) & (at < end + margin)
            top = np.where(inside, np.minimum(top, creeping), top)

        recorded = self._recorded_lateral(at) / limits.max_lateral_acceleration
        share = np.clip(recorded, _TUNING.curve_share, _TUNING.recorded_curve_share)
        lateral = share * limits.max_lateral_acceleration
        through_curves = ""
        for _ in range(_TUNING.bend_rounds):
            bounds = Bounds(top, limits.max_acceleration, limits.max_deceleration, self.jerk)
            mean = mean_speed(spline, target, motion, bounds)
            if mean is None:
                return (
                    f"cannot drive {self.path.length:.1f} m{through_curves} "
                    f"in {clock.time[-1]:.1f} s within the limits"
                )
            allowed = self._bend_speed(spline.driven(at) @ mean, lateral)
            if (mean <= allowed * pace * 1.01 + 1e-6)[1:-1].all():
                return MeanSpeed(mean, motion, bounds)
            top, through_curves = np.minimum(top, allowed * pace), " through its curves"
        return (
            f"cannot drive its curves within {limits.max_lateral_acceleration:g} m/s² sideways "
            f"in {clock.time[-1]:.1f} s"
        )

    def limiting_parameters(self, clock: Clock) -> str:
        """Return the limits that, lifted alone, would allow a mean speed; "" if none would."""
        limiting = [
            f"limits.{self.vehicle.type}.{entry.name}"
            for entry in fields(self.limits)
            if not isinstance(self.without_limit(entry.name).mean(clock), str)
        ]
        return f" (more of {' or of '.join(limiting)} would do)" if limiting else ""

    def largest_shift(self, mean: Floats) -> float:
        """Return the largest distance [m] of the mean (n,) from a changepoint when it is due."""
        if self.path.stands:
            return 0.0
        return float(np.abs(self.spline.driven(self.times) @ mean - self.anchor).max())

    def slowdown(self, mean: Floats, grid: Floats) -> Floats:
        """Return the factors (G,) by which the clock must be slowed for comfort in bends.

        Args:
            mean: (n,) coefficients of the mean speed [m/s].
            grid: (G,) template times [s].
        """
        slowdown = np.ones(len(grid))
        if not self.path.stands:
            present = (grid >= self.times[0]) & (grid <= self.times[-1])
            at = grid[present]
            limit = np.maximum(self._recorded_lateral(at), self.bend)
            allowed = self._bend_speed(self.spline.driven(at) @ mean, limit)
            slowdown[present] = self.spline.design(at) @ mean / allowed
        return slowdown

    def _recorded_lateral(self, at: Floats) -> Floats:
        """Return a little more than the recorded lateral acceleration [m/s²] at times (q,) [s]."""
        lateral = np.interp(at, self.recorded_time, self.lateral)
        return np.asarray(_TUNING.bend_factor * lateral)

    def _bend_speed(self, arc: Floats, limit: Floats) -> Floats:
        """Return speeds (q,) [m/s] that the bends allow.

        Args:
            arc: (q,) arc lengths [m].
            limit: (q,) lateral accelerations [m/s²].
        """
        if self.path.stands:
            return np.full(len(arc), np.inf)
        bends = np.interp(arc, self.path.arc, sharpest_curvature(self.path))
        return np.asarray(np.sqrt(limit / np.maximum(bends, 1e-6)))


def route_vehicle(
    n: int, plan: Plan, times: Floats, waits: Sequence[Wait], config: SamplingConfig
) -> RoutedVehicle:
    """Return vehicle n on its route; one without length stands, whatever is requested.

    Args:
        n: its index.
        plan: the template on its road.
        times: (K + 2,) start, changepoints and end [s].
        waits: that are kept, standing parts only.
        config: the bounds of jerk and lateral acceleration.
    """
    encounter, route = plan.encounter, plan.routes[n]
    vehicle, path = encounter.vehicles[n], BasePath.of(route)
    limits = plan.limits.of(vehicle.type).planned
    span = encounter.present_slice(n)
    time, speed = encounter.time[span], encounter.speed[n, span]
    driven = float(0.5 * encounter.dt * (speed[1:] + speed[:-1]).sum())
    scale = min(path.length / driven, _TUNING.max_scale) if driven > 1e-3 else 1.0

    inner = 1 + np.flatnonzero((times[1:-1] > time[0]) & (times[1:-1] < time[-1]))
    known = np.concatenate([[0], inner, [len(times) - 1]])
    times = np.concatenate([time[:1], times[inner], time[-1:]])
    dwells = np.diff(route.anchor[known]) == 0
    requested = (float(plan.requested.start[n, 3]), float(plan.requested.end[n, 3]))
    ends = (0.0, 0.0) if dwells.all() else requested
    stands = lengthened_waits(n, waits, creeping=False)
    if not dwells.all():
        stands, dwells = standing_within(times, dwells, stands, time, speed)
    creeping = lengthened_waits(n, waits, creeping=True)
    knots = speed_knots(times, dwells, stands, ends, creeping)
    still = knots.still[[0, -1]]
    ends = _unless(still & (np.array(ends) <= STANDING_MPS), ends)
    recorded = _unless(still, scale * speed[[0, -1]])

    rests = _rests(knots, times)
    spline = SpeedSpline.over(float(times[0]), float(times[-1]), rests)
    lines = rounded_lines(spline, knots, time, scale * speed, recorded)
    track = plan.situation.tracks[n]
    jerk = float(np.abs(np.diff(scale * speed, 2)).max(initial=0.0)) / (
        encounter.dt * encounter.dt
    )
    lateral = _largest_lateral(encounter, track, n)
    bend = config.bend_acceleration or max(_TUNING.bend_factor * lateral, _TUNING.min_bend)
    steering = Steering.of(time, np.unwrap(encounter.heading[n, span]), speed, path.length)
    return RoutedVehicle(
        vehicle,
        path,
        knots,
        lines,
        spline,
        times,
        path.anchor[known],
        time,
        scale * speed,
        ends,
        recorded,
        config.max_jerk or max(_TUNING.jerk_factor * jerk, _TUNING.min_jerk),
        min(bend, _TUNING.curve_share * limits.max_lateral_acceleration),
        _lateral(track, encounter.speed[n])[span],
        steering,
        rests,
        limits,
    )


def _unless(zero: Bools, speeds: Sequence[float] | Floats) -> tuple[float, float]:
    """Return two end speeds [m/s], 0 where `zero` (2,) is true."""
    start, end = np.where(zero, 0.0, speeds).tolist()
    return start, end


def _rests(knots: SpeedKnots, times: Floats) -> list[tuple[float, float]]:
    """Return the parts of stands with zero speed; rounded lines rise a little earlier."""
    rests = []
    for begin, end in knots.spans(knots.still):
        arrives, departs = bool(begin > times[0]), bool(end < times[-1])
        spare = (end - begin - _TUNING.min_rest) / max(arrives + departs, 1)
        room = max(min(_TUNING.early_start, spare), 0.0)
        rests.append((begin + room * arrives, end - room * departs))
    return rests


def sharpest_curvature(path: BasePath) -> Floats:
    """Return the sharpest curvature (G,) [1/m] near each node."""
    reach = 2 * int(np.ceil(_TUNING.curve_reach / path.spacing)) + 1
    smooth = ndimage.uniform_filter1d(np.abs(path.curvature), 3, mode="nearest")
    return np.asarray(ndimage.maximum_filter1d(smooth, reach, mode="nearest"))


def _largest_lateral(encounter: Encounter, track: Track, n: int) -> float:
    """Return the largest lateral acceleration [m/s²] of vehicle n, averaged over half a second."""
    span = encounter.present_slice(n)
    width = 2 * round(0.5 * _TUNING.averaging / encounter.dt) + 1
    lateral = np.gradient(track.poses[span, 2], encounter.dt) * encounter.speed[n, span]
    return float(np.abs(ndimage.uniform_filter1d(lateral, width, mode="nearest")).max())


def _lateral(track: Track, speed: Floats) -> Floats:
    """Return lateral accelerations (T,) [m/s²] at speeds (T,) [m/s] on a track."""
    driven = np.zeros(0)
    if not track.still:
        driven = np.arange(track.progress[0], track.progress[-1], NODE_SPACING_M)
    if len(driven) < MIN_NODES_COUNT:
        return np.zeros(len(speed))
    path = BasePath(track.curve.at(driven), NODE_SPACING_M, driven[:0])
    bends = np.interp(track.progress, driven, sharpest_curvature(path))
    return np.asarray(bends * np.square(speed))
