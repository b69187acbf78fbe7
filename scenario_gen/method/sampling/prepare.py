# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""From an encounter and its routes to a model that draws candidates: the nominal clock, and every vehicle's mean speed on it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.method.sampling.candidates import VehicleModel
from scenario_gen.method.sampling.config import SamplingConfig
from scenario_gen.method.sampling.deviations import (
    lateral_covariance_root,
    lateral_room,
    MAX_ROOM_SIGMAS,
    road_ahead,
    ROOM_SIGMAS,
    Steering,
)
from scenario_gen.method.sampling.freedom import FADES, Freedom, freedom_of, MOST_ONWARD, OwnClock
from scenario_gen.method.sampling.model import CandidateModel
from scenario_gen.method.sampling.pace import clock_of, slowed_clock, template_grid
from scenario_gen.method.sampling.path import BasePath, MIN_NODES, NODE_SPACING
from scenario_gen.method.sampling.plan import Plan
from scenario_gen.method.sampling.speed_profile.knots import speed_knots, SpeedKnots, STAND
from scenario_gen.method.sampling.speed_profile.mean import Bounds, mean_speed, Motion, rounded_lines, Target
from scenario_gen.method.sampling.speed_profile.model import speed_model
from scenario_gen.method.sampling.speed_profile.spline import SpeedSpline
from scenario_gen.method.sampling.speed_profile.stops import (
    least_shares,
    lengthened,
    SHORTEST_WAIT,
    standing_part,
    standing_within,
)
from scenario_gen.method.sampling.time_warp import Clock, TimeWarp
from scenario_gen.numerics import Bools, exact, Floats
from scenario_gen.template import clean_tracks, least_gaps, reactions_of, Track, Wait, WAIT_SPEED
from scenario_gen.types import BoundaryStates, Encounter, FOLLOW, ReactionGraph, Road, Route, Vehicle

_STRETCHES = 9
_MOST_SCALE = 4.0  # a template speed is scaled at most so much; beyond it, lengths alone decide
_CREEPS = 0.9 * WAIT_SPEED  # m/s, fastest in a creeping wait
_RAMP = 1.5  # m/s², by which an asked end speed is reached from the template's
_CURVE_REACH = 2.0  # m, around a position, in which the route's curvature is looked at
_CURVE_MARGIN = 0.85  # share of the lateral limit that the mean may use; the rest is the samples'
_OWN_MARGIN = 0.95  # the same where the template itself drives bends that fast
_BOUND_ROUNDS = 4
_JERK_SHARE, _LEAST_JERK = 1.2, 1.0  # of the template's largest jerk; m/s³
_BEND_SHARE, _LEAST_BEND = 1.2, 2.0  # of the template's largest lateral acceleration; m/s²
_SMOOTH = 0.5  # s, over which that is taken
_TIME_SHARE = 1.0 / 3.0  # of the duration, at most: what varies more slowly between given ends hardly varies
_EARLY = 0.3  # s, by which a vehicle leaves a stand before its lines do, for they are rounded
_LEAST_REST = SHORTEST_WAIT - 0.2  # s: behind it a vehicle is still too slow to be seen moving for a while
_FREE_SLIDE = 1.5  # m, by which changepoints may be passed from their place before the clock is stretched
_REPORTED_PACE, _REPORTED_SHIFT, _REPORTED_JERK = 0.02, 0.3, 0.2  # slowing, m and m/s³ from which on they are reported


_Mean = tuple[Floats, Motion, Bounds]  # coefficients of a mean speed, and what it keeps to


@dataclass(frozen=True, eq=False)
class Prepared:
    """A model of candidates, or why there is none.

    Attributes:
        model: draws candidates; None if no speed exists even for the undisturbed routes.
        adaptations: what was changed to get there, in sentences.
        refusal: why there is no model, "" if there is one.
    """

    model: CandidateModel | None
    adaptations: tuple[str, ...]
    refusal: str = ""


@dataclass(frozen=True, eq=False)
class _Drive:
    """One vehicle on its route, before its speed is known.

    Attributes:
        vehicle: identity and footprint.
        path: the route.
        knots: what the primitives tell of the template's speed, scaled to the route.
        spline: the basis of its speed.
        times: (K + 2,) its arrival, the changepoints while it is there, and when it leaves [s].
        anchor: (K + 2,) arc lengths [m] of their anchors.
        time: (T,) the template's samples while it is there [s].
        speed: (T,) its speeds [m/s] there, scaled to the route.
        ends: asked speeds [m/s] at start and end; recorded: the template's there, scaled to the route.
        jerk: m/s³ that it keeps to; bend: m/s² sideways above which the pace is lowered.
        sideways: (T,) m/s² that the template drives at `time`: it is at ease with that, too.
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

    def target(self, clock: Clock) -> Target:
        """What its mean speed should be near to, on this clock."""
        grid = clock.grid[(clock.grid >= self.times[0] - 1e-9) & (clock.grid <= self.times[-1] + 1e-9)]
        line = np.interp(grid, self.knots.knot, self.knots.lines)
        rates = clock.at(self.times[[0, -1]])[1]
        ends = (self.ends[0] * float(rates[0]), self.ends[1] * float(rates[1]))
        for end, since in ((0, grid - grid[0]), (-1, grid[-1] - grid)):
            off = ends[end] - self.recorded[end]
            line = line + off * np.square(np.maximum(1.0 - since / max(2.0 * abs(off) / _RAMP, 1.0), 0.0))
        inner = 1 + np.flatnonzero(np.diff(self.anchor[:-1]) != 0.0)
        return Target(grid, np.maximum(line, 0.0), self.times[inner], self.anchor[inner], ends, self.path.length)

    def mean(self, clock: Clock, config: SamplingConfig) -> _Mean | str:
        """The mean's coefficients on this clock, with what they keep to; or why there are none."""
        spline, rate = self.spline, clock.at(self.spline.stations)[1:]
        motion, target = Motion.of(spline, *rate), self.target(clock)
        at, pace = spline.middle, clock.at(spline.middle)[1]
        top = config.max_speed * pace
        for a, b in self.knots.stretches(self.knots.creeping):
            margin = float(spline.breaks[1] - spline.breaks[0])
            top = np.where((at > a - margin) & (at < b + margin), np.minimum(top, _CREEPS * pace), top)
        most, limit = top, ""
        for _ in range(_BOUND_ROUNDS):
            bounds = Bounds(most, config.max_acceleration, config.max_deceleration, self.jerk)
            mean = mean_speed(spline, target, motion, bounds)
            if mean is None:
                longest = f"{clock.time[-1]:.1f} s"
                return f"cannot drive {self.path.length:.1f} m{limit} in {longest} within the limits"
            sideways = np.clip(self._own_sideways(at) / config.max_lateral_acceleration, _CURVE_MARGIN, _OWN_MARGIN)
            allowed = self._bend_speed(exact.matmul(spline.driven(at), mean), sideways * config.max_lateral_acceleration)
            if (mean <= allowed * pace * 1.01 + 1e-6)[1:-1].all():
                return mean, motion, bounds
            most, limit = np.minimum(most, allowed * pace), " through its curves"
        return f"cannot drive its curves within {config.max_lateral_acceleration:g} m/s² sideways in {clock.time[-1]:.1f} s"

    def slid(self, mean: Floats) -> float:
        """How far [m] from their place the mean passes changepoints, at most."""
        if len(self.path.node) == 1:
            return 0.0
        return float(np.abs(exact.matmul(self.spline.driven(self.times), mean) - self.anchor).max())

    def slowdown(self, mean: Floats, grid: Floats) -> Floats:
        """By how much the clock must be slowed at template times (G,) [s], so that bends are driven at ease."""
        if len(self.path.node) == 1:
            return np.ones(len(grid))
        there = (grid >= self.times[0]) & (grid <= self.times[-1])
        s, v = (exact.matmul(rows, mean) for rows in (self.spline.driven(grid[there]), self.spline.design(grid[there])))
        slowdown = np.ones(len(grid))
        slowdown[there] = v / self._bend_speed(s, np.maximum(self._own_sideways(grid[there]), self.bend))
        return slowdown

    def _own_sideways(self, at: Floats) -> Floats:
        """Lateral acceleration [m/s²] that the template drives at template times (q,) [s], and a little more."""
        return np.asarray(_BEND_SHARE * np.interp(at, self.time, self.sideways))

    def _bend_speed(self, s: Floats, limit: Floats) -> Floats:
        """Speed [m/s] that the route's bends allow at arc lengths (q,) [m], by limits (q,) [m/s²]."""
        if len(self.path.node) == 1:
            return np.full(len(s), np.inf)
        return np.asarray(np.sqrt(limit / np.maximum(np.interp(s, self.path.arc, _bends(self.path)), 1e-6)))


def _bends(path: BasePath) -> Floats:
    """(G,) the sharpest curvature [1/m] near each node."""
    reach = 2 * int(np.ceil(_CURVE_REACH / path.spacing)) + 1
    return np.asarray(exact.moving_max(exact.moving_mean(np.abs(path.curvature), 3), reach))


def prepare(plan: Plan, config: SamplingConfig, order: str = "keep") -> Prepared:
    """Build the model: on the template's clock, slowed ahead of bends, and stretched only where no speed exists otherwise.

    Raises:
        InputError: routes, segmentation and encounter disagree in their numbers.
    """
    encounter, road, routes, requested = plan.encounter, plan.road, plan.routes, plan.requested
    times = encounter.time[np.concatenate([[0], plan.segmentation.changepoints, [encounter.speed.shape[1] - 1]]).astype(np.int64)]
    if len(routes) != len(encounter.vehicles) or any(len(route.anchor) != len(times) for route in routes):
        raise InputError(f"{len(routes)} routes do not suit {len(encounter.vehicles)} vehicles with {len(times)} anchors each")
    waits = [standing_part(encounter, wait) for wait in plan.waits]
    drives = [_drive(n, encounter, times, routes[n], requested, waits, config) for n in range(len(encounter.vehicles))]
    clock, sentences = _slowed(drives, template_grid(encounter), config)
    left = (1.0 + config.max_stretch) * float(times[-1]) / float(clock.time[-1])
    best: tuple[float, float, list[_Mean]] | None = None
    reasons = ""
    for stretch in np.linspace(1.0, max(left, 1.0), _STRETCHES if left > 1.0 else 1).tolist():
        means = [drive.mean(clock_of(clock.grid, stretch * clock.rate), config) for drive in drives]
        found = [mean for mean in means if not isinstance(mean, str)]
        if len(found) < len(means):
            reasons = "; ".join(f"vehicle {d.vehicle.id} {m}" for d, m in zip(drives, means, strict=True) if isinstance(m, str))
            continue
        slid = max(drive.slid(mean[0]) for drive, mean in zip(drives, found, strict=True))
        if best is None or slid < best[0] - _FREE_SLIDE:
            best = slid, stretch, found
        if slid <= _FREE_SLIDE:
            break
    if best is None:
        return Prepared(None, (), reasons)
    _, stretch, found = best
    if stretch > 1.0:
        share = 100.0 * (stretch - 1.0)
        sentences.append(f"clock stretched by {share:.1f} % so that every vehicle can keep to its limits and its changepoints")
    warp = TimeWarp(clock_of(clock.grid, stretch * clock.rate), config, least_shares(clock.grid, waits))
    vehicles = [_model(d, road, *mean, config, sentences) for d, mean in zip(drives, found, strict=True)]
    if config.variety == "wide":
        tied, gaps = (requested.relaxed[..., 0] == 0.0).any(axis=0), least_gaps(encounter).tolist()
        vehicles = [
            replace(v, freedom=_freedom(drive, v, warp.nominal, requested.relaxed[n], tied, road, gaps[n], config))
            for n, (v, drive) in enumerate(zip(vehicles, drives, strict=True))
        ]
    reactions = kept_reactions(encounter, config, order)
    return Prepared(CandidateModel(tuple(vehicles), warp, reactions), tuple(sentences))


def kept_reactions(encounter: Encounter, config: SamplingConfig, order: str = "keep") -> ReactionGraph:
    """Return the reactions of the template that scenarios keep, without edges where none is to be kept.

    Where an `order` other than the template's is requested, nobody is made to wait for anybody.
    """
    graph = reactions_of(encounter)
    if config.reactions != "keep":
        return replace(graph, edges=())
    return replace(graph, edges=tuple(edge for edge in graph.edges if order == "keep" or edge.kind == FOLLOW))


def _freedom(
    drive: _Drive,
    model: VehicleModel,
    nominal: Clock,
    relaxed: Floats,
    tied: Bools,
    road: Road,
    gap: float,
    config: SamplingConfig,
) -> Freedom:
    """What preset `wide` relaxes for a vehicle that came so near [m] to others in the template."""
    fastest = drive.speed[[0, -1]] + config.freedom * config.end_speed_sigma + 2.0 * config.max_acceleration * FADES
    ahead = road_ahead(drive.path, drive.vehicle, road, MOST_ONWARD * fastest)
    clock = OwnClock.of(nominal, drive.rests, (bool(tied[0]), bool(tied[1])), config)
    return freedom_of(drive.vehicle, drive.path.arc, clock, relaxed, tied, ahead, gap, config)


def _slowed(drives: Sequence[_Drive], grid: Floats, config: SamplingConfig) -> tuple[Clock, list[str]]:
    """The nominal clock on template times (G,) [s], and the notes on it."""
    plain = clock_of(grid, np.ones(len(grid)))
    slowdowns = []
    for drive in drives:
        mean = drive.mean(plain, _without_bends(config))
        slowdowns.append(np.ones(len(grid)) if isinstance(mean, str) else drive.slowdown(mean[0], grid))
    clock = slowed_clock(grid, slowdowns, 1.0 + config.max_stretch)
    if clock.rate.max() < 1.0 + _REPORTED_PACE:
        return plain, []
    worst, k = divmod(int(np.argmax(slowdowns)), len(grid))
    return clock, [
        f"the pace is lowered by up to {100.0 * (1.0 - 1.0 / clock.rate.max()):.0f} % ahead of bends, most for vehicle "
        f"{drives[worst].vehicle.id} at {grid[k]:.1f} s; in all the clock is {clock.time[-1] - grid[-1]:.1f} s longer"
    ]


def _without_bends(config: SamplingConfig) -> SamplingConfig:
    """The parameters of a drive that takes bends at any speed, which is enough to know where the vehicle is when."""
    return replace(config, max_lateral_acceleration=1e6)


def _drive(
    n: int,
    encounter: Encounter,
    times: Floats,
    route: Route,
    requested: BoundaryStates,
    waits: Sequence[Wait],
    config: SamplingConfig,
) -> _Drive:
    """Vehicle n on its route; one without length stands throughout, whatever speed is requested."""
    first, last = encounter.present[n].tolist()
    here = slice(first, last + 1)
    time, speed = encounter.time[here], encounter.speed[n, here]
    own = np.concatenate([[0], 1 + np.flatnonzero((times[1:-1] > time[0]) & (times[1:-1] < time[-1])), [len(times) - 1]])
    anchor, times = route.anchor[own], np.concatenate([time[:1], times[own[1:-1]], time[-1:]])
    dwells = anchor[:-1] == anchor[1:]
    path = BasePath.of(route)
    stands, moves_slowly = lengthened(n, waits, creeping=False), lengthened(n, waits, creeping=True)
    ends = (float(requested.start[n, 3]), float(requested.end[n, 3]))
    if dwells.all():
        ends = (0.0, 0.0)
    driven = float(0.5 * encounter.dt * (speed[1:] + speed[:-1]).sum())
    scale = min(path.length / driven, _MOST_SCALE) if driven > 1e-3 else 1.0
    if not dwells.all():
        stands, dwells = standing_within(times, dwells, stands, time, speed)
    knots = speed_knots(times, dwells, stands, time, speed, ends, 0.0, moves_slowly)
    standing = [v if v > STAND or not still else 0.0 for v, still in zip(ends, knots.still[[0, -1]], strict=True)]
    rests = _at_rest(knots, times)
    spline = SpeedSpline.over(float(times[0]), float(times[-1]), rests)
    recorded = [0.0 if still else scale * float(speed[k]) for k, still in zip((0, -1), knots.still[[0, -1]], strict=True)]
    lines = rounded_lines(spline, knots, time, scale * speed, (recorded[0], recorded[1]))
    jerk, sideways = _largest_jerk(scale * speed, encounter.dt), _largest_sideways(encounter, n)
    track = clean_tracks(encounter)[n]
    return _Drive(
        encounter.vehicles[n],
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
            config.bend_acceleration or max(_BEND_SHARE * sideways, _LEAST_BEND), _CURVE_MARGIN * config.max_lateral_acceleration
        ),
        _sideways(track, encounter.speed[n])[here],
        Steering.of(time, np.unwrap(encounter.heading[n, here]), encounter.speed[n, here], path.length),
        rests,
    )


def _at_rest(knots: SpeedKnots, times: Floats) -> list[tuple[float, float]]:
    """The parts of stands in which the speed is zero: lines are rounded, so a vehicle leaves a little before theirs do."""
    rest = []
    for a, b in knots.stretches(knots.still):
        moves = (a > times[0], b < times[-1])
        room = max(min(_EARLY, (b - a - _LEAST_REST) / max(int(moves[0]) + int(moves[1]), 1)), 0.0)
        rest.append((a + room if moves[0] else a, b - room if moves[1] else b))
    return rest


def _largest_jerk(speed: Floats, dt: float) -> float:
    """Largest second difference of speeds (T,) [m/s] over time, m/s³."""
    return float(np.abs(np.diff(speed, 2)).max(initial=0.0)) / (dt * dt)


def _largest_sideways(encounter: Encounter, n: int) -> float:
    """Largest lateral acceleration [m/s²] of the template's vehicle n, over half a second."""
    first, last = encounter.present[n].tolist()
    yaw = clean_tracks(encounter)[n].poses[first : last + 1, 2]
    width = 2 * round(0.5 * _SMOOTH / encounter.dt) + 1
    sideways = np.gradient(yaw, encounter.dt) * encounter.speed[n, first : last + 1]
    return float(np.abs(exact.moving_mean(sideways, width)).max())


def _sideways(track: Track, speed: Floats) -> Floats:
    """Lateral acceleration (T,) [m/s²] of a template's vehicle with speeds (T,) [m/s]; its bends are taken as a route's."""
    if track.still:
        return np.zeros(len(speed))
    driven = np.arange(track.progress[0], track.progress[-1], NODE_SPACING)
    if len(driven) < MIN_NODES:
        return np.zeros(len(speed))
    path = BasePath(track.curve.at(driven), NODE_SPACING, driven[:0])
    return np.asarray(np.interp(track.progress, driven, _bends(path)) * np.square(speed))


def _model(
    drive: _Drive,
    road: Road,
    mean: Floats,
    motion: Motion,
    bounds: Bounds,
    config: SamplingConfig,
    sentences: list[str],
) -> VehicleModel:
    """The vehicle's model; what was changed for it is added to the sentences."""
    name, path, spline = f"vehicle {drive.vehicle.id}", drive.path, drive.spline
    slid = drive.slid(mean)
    if slid > _REPORTED_SHIFT:
        sentences.append(f"{name} passes changepoints up to {slid:.2f} m from their place")
    jerk = float(np.abs(exact.matmul(motion.jerk, mean)).max())
    if jerk > bounds.jerk + _REPORTED_JERK:
        sentences.append(f"{name} needs a jerk of {jerk:.1f} m/s³; {bounds.jerk:.1f} m/s³ would be smooth")
    room = lateral_room(path, drive.vehicle, road, MAX_ROOM_SIGMAS * config.lateral_sigma)
    narrow = room < ROOM_SIGMAS * config.lateral_sigma
    if narrow.any() and config.lateral_sigma > 0.0 and path.length > 0.0:
        sentences.append(f"{name} varies less across {100.0 * narrow.mean():.0f} % of its route, where the road is narrow")
    length = min(config.longitudinal_time, _TIME_SHARE * float(drive.times[-1] - drive.times[0]))
    speed = speed_model(spline, mean, motion, bounds, drive.time, drive.speed, config.longitudinal_sigma, length)
    return VehicleModel(drive.vehicle, path, lateral_covariance_root(path, room, config, drive.steering), room, speed)
