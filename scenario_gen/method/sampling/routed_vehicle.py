# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One vehicle on its route: what its speed must keep to, and the mean speed on a clock."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy import ndimage

from scenario_gen.method.sampling.config import SamplingConfig
from scenario_gen.method.sampling.deviations import Steering
from scenario_gen.method.sampling.path import BasePath, MIN_NODES, NODE_SPACING
from scenario_gen.method.sampling.plan import Plan
from scenario_gen.method.sampling.speed_profile.knots import speed_knots, SpeedKnots, STAND
from scenario_gen.method.sampling.speed_profile.mean import (
    Bounds,
    mean_speed,
    Motion,
    rounded_lines,
    Target,
)
from scenario_gen.method.sampling.speed_profile.spline import SpeedSpline
from scenario_gen.method.sampling.speed_profile.stops import (
    lengthened,
    SHORTEST_WAIT,
    standing_within,
)
from scenario_gen.method.sampling.time_warp import Clock
from scenario_gen.numerics import Floats
from scenario_gen.situation import Situation, Track, Wait
from scenario_gen.types import Dynamics, Vehicle

_MOST_SCALE = (
    4.0  # largest factor on the template's speeds; a longer route only has the mean speed raised
)
_SLOW_WAIT = (
    0.9  # of the speed below which its type waits: fastest while a wait is kept by moving slowly
)
_RAMP = 1.5  # m/s², acceleration from the template's speed to a requested end speed
_CURVE_REACH = 2.0  # m, to either side of a position, over which the sharpest curvature counts
_CURVE_MARGIN = (
    0.85  # share of the lateral limit that the mean may use; the rest is for deviations
)
_OWN_MARGIN = 0.95  # the same where the template itself takes bends that fast
_BOUND_ROUNDS = 4  # times that speeds are bounded by the bends where the mean then is
_JERK_SHARE, _LEAST_JERK = 1.2, 1.0  # of the template's largest jerk; at least, m/s³
_BEND_SHARE, _LEAST_BEND = (
    1.2,
    2.0,
)  # of the template's largest lateral acceleration; at least, m/s²
_SMOOTH = 0.5  # s, over which that acceleration is averaged
_EARLY = 0.3  # s, by which a vehicle moves before its speed lines do: these are rounded
_LEAST_REST = (
    SHORTEST_WAIT - 0.2
)  # s; the checker still counts the slow start after it as standing

MeanSpeed = tuple[
    Floats, Motion, Bounds
]  # coefficients of a mean speed, with its motion and bounds


@dataclass(frozen=True, eq=False)
class RoutedVehicle:
    """One vehicle on its route, before its speed is known.

    Attributes:
        vehicle: identity and footprint.
        path: the route.
        knots: the template's speed as lines between changepoints, scaled to the route.
        spline: the basis of its speed.
        times: (K + 2,) its arrival, the changepoints while it is there, and when it leaves [s].
        anchor: (K + 2,) arc lengths [m] of their anchors.
        time: (T,) the template's samples while it is there [s].
        speed: (T,) its speeds [m/s] there, scaled to the route.
        ends: requested speeds [m/s] at start and end.
        recorded: the template's speeds there, scaled to the route.
        jerk: largest jerk [m/s³].
        bend: lateral acceleration [m/s²] above which the pace is lowered.
        sideways: (T,) lateral acceleration [m/s²] of the template at `time`, which is allowed again.
        steering: the small corrections of its driver.
        rests: begin and end [s] of the stands in which its speed is zero.
    """

    vehicle: Vehicle
    path: BasePath
    knots: SpeedKnots
    spline: SpeedSpline
    times: Floats
    anchor: Floats
    time: Floats
    speed: Floats
    ends: tuple[float, float]
    recorded: tuple[float, float]
    jerk: float
    bend: float
    sideways: Floats
    steering: Steering
    rests: list[tuple[float, float]]
    limits: Dynamics

    def target(self, clock: Clock) -> Target:
        """The speeds and places that its mean should be near, on this clock."""
        grid = clock.grid[
            (clock.grid >= self.times[0] - 1e-9) & (clock.grid <= self.times[-1] + 1e-9)
        ]
        line = np.interp(grid, self.knots.knot, self.knots.lines)
        rates = clock.at(self.times[[0, -1]])[1]
        ends = (self.ends[0] * float(rates[0]), self.ends[1] * float(rates[1]))
        for end, since in ((0, grid - grid[0]), (-1, grid[-1] - grid)):
            off = ends[end] - self.recorded[end]
            line = line + off * np.square(
                np.maximum(1.0 - since / max(2.0 * abs(off) / _RAMP, 1.0), 0.0)
            )
        inner = 1 + np.flatnonzero(np.diff(self.anchor[:-1]) != 0.0)
        return Target(
            grid,
            np.maximum(line, 0.0),
            self.times[inner],
            self.anchor[inner],
            ends,
            self.path.length,
        )

    @property
    def without_bends(self) -> "RoutedVehicle":
        """The vehicle as one that takes bends at any speed, which is enough to know where it is when."""
        return replace(self, limits=replace(self.limits, max_lateral_acceleration=1e6))

    def mean(self, clock: Clock) -> MeanSpeed | str:
        """The mean's coefficients on this clock, with motion and bounds; or why there are none."""
        spline, rate = self.spline, clock.at(self.spline.stations)[1:]
        motion, target = Motion.of(spline, *rate), self.target(clock)
        at, pace = spline.middle, clock.at(spline.middle)[1]
        top, slow = self.limits.max_speed * pace, _SLOW_WAIT * self.vehicle.kind.waits_below
        for a, b in self.knots.stretches(self.knots.creeping):
            margin = float(spline.breaks[1] - spline.breaks[0])
            top = np.where(
                (at > a - margin) & (at < b + margin), np.minimum(top, slow * pace), top
            )
        most, limit = top, ""
        for _ in range(_BOUND_ROUNDS):
            bounds = Bounds(
                most, self.limits.max_acceleration, self.limits.max_deceleration, self.jerk
            )
            mean = mean_speed(spline, target, motion, bounds)
            if mean is None:
                longest = f"{clock.time[-1]:.1f} s"
                return (
                    f"cannot drive {self.path.length:.1f} m{limit} in {longest} within the limits"
                )
            sideways = np.clip(
                self._own_sideways(at) / self.limits.max_lateral_acceleration,
                _CURVE_MARGIN,
                _OWN_MARGIN,
            )
            allowed = self._bend_speed(
                spline.driven(at) @ mean, sideways * self.limits.max_lateral_acceleration
            )
            if (mean <= allowed * pace * 1.01 + 1e-6)[1:-1].all():
                return mean, motion, bounds
            most, limit = np.minimum(most, allowed * pace), " through its curves"
        most_aside = self.limits.max_lateral_acceleration
        return f"cannot drive its curves within {most_aside:g} m/s² sideways in {clock.time[-1]:.1f} s"

    def blamed(self, clock: Clock) -> str:
        """Return which of its limits, were it alone not there, would leave it a mean speed on this clock; "" if none would."""
        names = (entry.name for entry in fields(self.limits))
        freed = (
            (name, replace(self, limits=replace(self.limits, **{name: 1e6}))) for name in names
        )
        found = [
            f"limits.{self.vehicle.type}.{name}"
            for name, routed in freed
            if not isinstance(routed.mean(clock), str)
        ]
        return f" (more of {' or of '.join(found)} would do)" if found else ""

    def largest_shift(self, mean: Floats) -> float:
        """Return the largest distance [m] of the mean (d,) from a changepoint's place when it is due."""
        if len(self.path.node) == 1:
            return 0.0
        return float(np.abs(self.spline.driven(self.times) @ mean - self.anchor).max())

    def slowdown(self, mean: Floats, grid: Floats) -> Floats:
        """By how much the clock must be slowed at template times (G,) [s], so that bends are driven comfortably."""
        if len(self.path.node) == 1:
            return np.ones(len(grid))
        there = (grid >= self.times[0]) & (grid <= self.times[-1])
        s, v = (
            (rows @ mean)
            for rows in (self.spline.driven(grid[there]), self.spline.design(grid[there]))
        )
        slowdown = np.ones(len(grid))
        slowdown[there] = v / self._bend_speed(
            s, np.maximum(self._own_sideways(grid[there]), self.bend)
        )
        return slowdown

    def _own_sideways(self, at: Floats) -> Floats:
        """Lateral acceleration [m/s²] that the template drives at template times (q,) [s], and a little more."""
        return np.asarray(_BEND_SHARE * np.interp(at, self.time, self.sideways))

    def _bend_speed(self, s: Floats, limit: Floats) -> Floats:
        """Speed [m/s] that the route's bends allow at arc lengths (q,) [m], by limits (q,) [m/s²]."""
        if len(self.path.node) == 1:
            return np.full(len(s), np.inf)
        return np.asarray(
            np.sqrt(limit / np.maximum(np.interp(s, self.path.arc, _bends(self.path)), 1e-6))
        )


def routed_vehicle(
    n: int, plan: Plan, times: Floats, waits: Sequence[Wait], config: SamplingConfig
) -> RoutedVehicle:
    """Return vehicle n on its route, with changepoints at times (K,) [s]; one without length stands, whatever is requested."""
    encounter, route, requested = plan.encounter, plan.routes[n], plan.requested
    vehicle = encounter.vehicles[n]
    limits = plan.limits.of(vehicle.type).planned
    first, last = encounter.present[n].tolist()
    here = slice(first, last + 1)
    time, speed = encounter.time[here], encounter.speed[n, here]
    own = np.concatenate(
        [
            [0],
            1 + np.flatnonzero((times[1:-1] > time[0]) & (times[1:-1] < time[-1])),
            [len(times) - 1],
        ]
    )
    anchor, times = route.anchor[own], np.concatenate([time[:1], times[own[1:-1]], time[-1:]])
    dwells = anchor[:-1] == anchor[1:]
    path = BasePath.of(route)
    stands, moves_slowly = (
        lengthened(n, waits, creeping=False),
        lengthened(n, waits, creeping=True),
    )
    ends = (float(requested.start[n, 3]), float(requested.end[n, 3]))
    if dwells.all():
        ends = (0.0, 0.0)
    driven = float(0.5 * encounter.dt * (speed[1:] + speed[:-1]).sum())
    scale = min(path.length / driven, _MOST_SCALE) if driven > 1e-3 else 1.0
    if not dwells.all():
        stands, dwells = standing_within(times, dwells, stands, time, speed)
    knots = speed_knots(times, dwells, stands, time, speed, ends, 0.0, moves_slowly)
    standing = [
        v if v > STAND or not still else 0.0
        for v, still in zip(ends, knots.still[[0, -1]], strict=True)
    ]
    rests = _at_rest(knots, times)
    spline = SpeedSpline.over(float(times[0]), float(times[-1]), rests)
    recorded = [
        0.0 if still else scale * float(speed[k])
        for k, still in zip((0, -1), knots.still[[0, -1]], strict=True)
    ]
    lines = rounded_lines(spline, knots, time, scale * speed, (recorded[0], recorded[1]))
    jerk, sideways = (
        _largest_jerk(scale * speed, encounter.dt),
        _largest_sideways(plan.situation, n),
    )
    track = plan.situation.tracks[n]
    return RoutedVehicle(
        vehicle,
        path,
        replace(knots, lines=lines),
        spline,
        times,
        path.anchor[own],
        time,
        scale * speed,
        (standing[0], standing[1]),
        (recorded[0], recorded[1]),
        config.max_jerk or max(_JERK_SHARE * jerk, _LEAST_JERK),
        min(
            config.bend_acceleration or max(_BEND_SHARE * sideways, _LEAST_BEND),
            _CURVE_MARGIN * limits.max_lateral_acceleration,
        ),
        _sideways(track, encounter.speed[n])[here],
        Steering.of(
            time, np.unwrap(encounter.heading[n, here]), encounter.speed[n, here], path.length
        ),
        rests,
        limits,
    )


def _at_rest(knots: SpeedKnots, times: Floats) -> list[tuple[float, float]]:
    """The parts of stands in which the speed is zero: the rounded lines begin to rise a little earlier."""
    rest = []
    for a, b in knots.stretches(knots.still):
        moves = (a > times[0], b < times[-1])
        room = max(min(_EARLY, (b - a - _LEAST_REST) / max(int(moves[0]) + int(moves[1]), 1)), 0.0)
        rest.append((a + room if moves[0] else a, b - room if moves[1] else b))
    return rest


def _bends(path: BasePath) -> Floats:
    """(G,) the sharpest curvature [1/m] near each node."""
    reach = 2 * int(np.ceil(_CURVE_REACH / path.spacing)) + 1
    return np.asarray(
        ndimage.maximum_filter1d(
            ndimage.uniform_filter1d(np.abs(path.curvature), 3, mode="nearest"),
            reach,
            mode="nearest",
        )
    )


def _largest_jerk(speed: Floats, dt: float) -> float:
    """Largest second difference of speeds (T,) [m/s] over time, m/s³."""
    return float(np.abs(np.diff(speed, 2)).max(initial=0.0)) / (dt * dt)


def _largest_sideways(situation: Situation, n: int) -> float:
    """Largest lateral acceleration [m/s²] of the template's vehicle n, over half a second."""
    encounter = situation.encounter
    first, last = encounter.present[n].tolist()
    yaw = situation.tracks[n].poses[first : last + 1, 2]
    width = 2 * round(0.5 * _SMOOTH / encounter.dt) + 1
    sideways = np.gradient(yaw, encounter.dt) * encounter.speed[n, first : last + 1]
    return float(np.abs(ndimage.uniform_filter1d(sideways, width, mode="nearest")).max())


def _sideways(track: Track, speed: Floats) -> Floats:
    """Lateral acceleration (T,) [m/s²] of a template's vehicle with speeds (T,) [m/s]; curvature as on a route."""
    if track.still:
        return np.zeros(len(speed))
    driven = np.arange(track.progress[0], track.progress[-1], NODE_SPACING)
    if len(driven) < MIN_NODES:
        return np.zeros(len(speed))
    path = BasePath(track.curve.at(driven), NODE_SPACING, driven[:0])
    return np.asarray(np.interp(track.progress, driven, _bends(path)) * np.square(speed))
