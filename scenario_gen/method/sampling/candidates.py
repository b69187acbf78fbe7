# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Candidate scenarios of all vehicles, many at a time, from standard normal numbers.

Straight on before and behind a route, acceleration and curvature decay, and the speed is kept.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from scenario_gen.method.sampling.lights import PlacedLights
from scenario_gen.method.sampling.numbers import ModelNumbers
from scenario_gen.method.sampling.reaction_transform import ReactionTransform
from scenario_gen.method.sampling.time_warp import Clock, SAMPLE_PERIOD_S, TimeWarp
from scenario_gen.method.sampling.trimming import Trimming
from scenario_gen.method.sampling.vehicle_model import NoiseScale, VehicleModel, VehicleSamples
from scenario_gen.numerics import Bools, Floats, freeze, Ints, wrap_angle
from scenario_gen.types import Facts, ReactionGraph, Scenario

MAX_EXTRAPOLATION_S = 4.0  # roads are seldom known much farther
ACCELERATION_DECAY_S = 0.5  # critically damped, so that the jerk begins at 0
_MIN_DECAY_S = 0.2  # a quicker decay would be a jolt
_MIN_SPEED_SHARE = 0.5  # of the speed, left when the acceleration has decayed
_CURVATURE_DECAY_M = 4.0  # as quickly as a driver straightens the wheel
_MAX_BEND_LENGTHS = 4.0  # decay lengths after which the curvature is negligible
_GAUSS_POINTS, _GAUSS_WEIGHT = np.polynomial.legendre.leggauss(6)


def extrapolate(state: Floats, curvature: Floats, since: Floats, sign: float) -> Floats:
    """Return states (S, T, 5) of vehicles that drive on from their states.

    With a time constant f the acceleration is a(t) = a₀ (1 + t / f) exp(-t / f).

    Args:
        state: (S, 5) x, y [m], yaw [rad], speed [m/s], acceleration [m/s²].
        curvature: (S,) 1/m, in these states.
        since: (S, T) seconds after the state, or before it.
        sign: 1 after it, -1 before it.
    """
    x, y, yaw, speed, acceleration = (column[:, None] for column in state.T)
    gain, decay = sign * acceleration, _decay_time(state, sign)[:, None]
    left = np.exp(-since / decay)
    driven = speed * since + gain * decay * (
        2.0 * since - 3.0 * decay + (3.0 * decay + since) * left
    )
    turned, ahead, left_by = _decaying_bend(sign * curvature[:, None], driven)
    cos, sin = np.cos(yaw), np.sin(yaw)
    columns = (
        x + sign * (ahead * cos - left_by * sin),
        y + sign * (ahead * sin + left_by * cos),
        yaw + turned,
        speed + gain * (2.0 * decay - (2.0 * decay + since) * left),
        acceleration * (1.0 + since / decay) * left,
    )
    return np.stack(columns, axis=-1)


def extrapolation_time(state: Floats, ahead: float, sign: float) -> Floats:
    """Return for how long (S,) [s] vehicles can drive on; 0 if only with a jolt.

    Args:
        state: (S, 5) as for `extrapolate`.
        ahead: metres of free road.
        sign: 1 after the state, -1 before it.
    """
    gain = np.maximum(sign * state[:, 4], 0.0)
    fastest = state[:, 3] + 2.0 * gain * ACCELERATION_DECAY_S
    seconds = np.minimum(ahead / np.maximum(fastest, 1e-3), MAX_EXTRAPOLATION_S)
    return np.where(_decay_time(state, sign) < _MIN_DECAY_S, 0.0, seconds)


def _decay_time(state: Floats, sign: float) -> Floats:
    """Return the time constants (S,) [s] with which accelerations decay before a standstill."""
    loss = np.maximum(-sign * state[:, 4], 1e-9)
    until_slow = np.maximum(0.5 * _MIN_SPEED_SHARE * state[:, 3] / loss, 1e-6)
    return np.minimum(ACCELERATION_DECAY_S, until_slow)


def _decaying_bend(curvature: Floats, driven: Floats) -> tuple[Floats, Floats, Floats]:
    """Return heading [rad], and place ahead and to the left [m], on a path that straightens.

    Args:
        curvature: (S, 1) 1/m at its start; it decays exponentially with the distance.
        driven: (S, T) metres along it.
    """
    length = _CURVATURE_DECAY_M

    def heading(distance: Floats) -> Floats:
        return np.asarray(curvature * length * (1.0 - np.exp(-distance / length)))

    curved = np.minimum(driven, _MAX_BEND_LENGTHS * length)
    rest = driven - curved
    turned = heading(curved)
    ahead, left = rest * np.cos(turned), rest * np.sin(turned)
    for point, weight in zip(_GAUSS_POINTS.tolist(), _GAUSS_WEIGHT.tolist(), strict=True):
        between = heading(curved * (0.5 + 0.5 * point))
        ahead = ahead + 0.5 * weight * curved * np.cos(between)
        left = left + 0.5 * weight * curved * np.sin(between)
    return turned, ahead, left


_MIN_DISTANCE_M = 0.05  # of two poses that imply a curvature
_ROUNDING_STEPS = 1e-6
_ROUNDING_S = 1e-9
_DIRECTION_FACTOR = (-1.0, 1.0)  # before a start, after an end


@dataclass(frozen=True, eq=False)
class CandidateModel:
    """Draws candidates of one encounter on its routes.

    Source: paper III-C.

    Attributes:
        vehicles: the models of the vehicles.
        warp: the clock that all share.
        reactions: how their numbers depend on each other.
        trimming: how begin and end are trimmed; None if they are not.
        lights: of the road; None: their states are not known.
        numbers: the layout of the standard normal numbers.
    """

    vehicles: tuple[VehicleModel, ...]
    warp: TimeWarp
    reactions: ReactionGraph = ReactionGraph((), ())
    trimming: Trimming | None = None
    lights: PlacedLights | None = None
    numbers: ModelNumbers = field(init=False)
    _transforms: dict[NoiseScale, ReactionTransform] = field(init=False)

    def __post_init__(self) -> None:
        trimming = 0 if self.trimming is None else self.trimming.count
        layouts = [vehicle.numbers for vehicle in self.vehicles]
        numbers = ModelNumbers.of(self.warp.count, layouts, trimming)
        freeze(self, numbers=numbers, _transforms={})

    @property
    def size(self) -> int:
        """Standard normal numbers per candidate."""
        return self.numbers.total

    def draw(self, eps: Floats, scale: NoiseScale) -> "Batch":
        """Return S candidates.

        Args:
            eps: (S, size) independent standard normal numbers.
            scale: factors on the standard deviations.
        """
        z = eps
        if self.reactions.edges or self.reactions.stops or self.reactions.crossings:
            z = self._transform(scale).apply(eps)
        shared = self.warp.sample(z[:, self.numbers.clock], scale.time)
        samples = [
            vehicle.sample(z[:, part], scale, shared, self.warp.nominal)
            for vehicle, part in zip(self.vehicles, self.numbers.vehicles, strict=True)
        ]
        extension = Extension.of(self.vehicles, samples)
        span = extension.common_span()
        if self.trimming is not None:
            times = np.stack([each.clock.times_at(self.trimming.core) for each in samples])
            core = np.column_stack([times[..., 0].min(axis=0), times[..., 1].max(axis=0)])
            span = self.trimming.apply(eps[:, self.numbers.trimming], core, span)
        presence = Presence.of(span, extension)
        feasible = np.logical_and.reduce([each.feasible for each in samples])
        feasible &= presence.is_usable()
        parts = self.vehicles, tuple(samples), extension, presence, feasible
        return Batch(*parts, shared, self.lights)

    def _transform(self, scale: NoiseScale) -> ReactionTransform:
        """Return the transform at a scale; there are few scales, so each is computed once."""
        if scale not in self._transforms:
            self._transforms[scale] = ReactionTransform.of(
                self.vehicles, self.numbers, self.warp.nominal, self.reactions, scale
            )
        return self._transforms[scale]


@dataclass(frozen=True, eq=False)
class Extension:
    """How long each vehicle is known: on its route, and straight on before and behind it.

    A vehicle that stands at an end of the template goes on standing there. A vehicle that drives
    there, and whose state is free, goes straight on while there is road.

    Attributes:
        ends: (S, N, 2) when each vehicle is at the start and at the end of its route [s].
        reach: (S, N, 2) since when, and until when, it is known [s].
        throughout: (N, 2) whether it is present at the template's start and end.
        states: (N, S, 4, 5) its states at the start, a sample later, a sample before the end, and
            at the end; None if nothing varies.
    """

    ends: Floats
    reach: Floats
    throughout: Bools
    states: Floats | None

    @classmethod
    def of(cls, models: Sequence[VehicleModel], samples: Sequence[VehicleSamples]) -> "Extension":
        """Extend S samples of N vehicles."""
        pairs = list(zip(models, samples, strict=True))
        ends = np.stack([each.clock.times_at(model.span) for model, each in pairs], axis=1)
        grid = samples[0].clock.grid
        spans = np.stack([model.span for model in models])
        enters, leaves = grid[0] + _ROUNDING_S, grid[-1] - _ROUNDING_S
        throughout = np.column_stack([spans[:, 0] <= enters, spans[:, 1] >= leaves])
        if all(model.variation is None for model in models):
            return cls(ends, ends, throughout, None)

        offsets = np.array([0.0, SAMPLE_PERIOD_S, -SAMPLE_PERIOD_S, 0.0])
        at = ends[..., [0, 0, 1, 1]] + offsets
        four = np.full(len(ends), 4)
        states = np.stack([each.states(at[:, n], four) for n, (_, each) in enumerate(pairs)])
        reach = ends.copy()
        for n, end in np.argwhere(throughout).tolist():
            variation, sign = models[n].variation, _DIRECTION_FACTOR[end]
            if models[n].stands_at(end):
                reach[:, n, end] = sign * np.inf
            elif variation is not None:
                ahead = float(variation.ahead[end])
                reach[:, n, end] += sign * extrapolation_time(states[n, :, -end], ahead, sign)
        return cls(ends, reach, throughout, states)

    def common_span(self) -> Floats:
        """Return when scenarios begin and end (S, 2) [s].

        All vehicles are present then that are present throughout the template.
        """
        starts = self.reach[:, self.throughout[:, 0], 0].max(axis=1, initial=-np.inf)
        ends = self.reach[:, self.throughout[:, 1], 1].min(axis=1, initial=np.inf)
        first, last = self.ends[..., 0].min(axis=1), self.ends[..., 1].max(axis=1)
        return np.column_stack([np.maximum(starts, first), np.minimum(ends, last)])

    def extend(self, n: int, end: int, at: Floats, out: Floats) -> None:
        """Overwrite states (S, T, 5) of vehicle n where times (S, T) [s] lie beyond its route."""
        assert self.states is not None
        sign = _DIRECTION_FACTOR[end]
        since = np.maximum(sign * (at - self.ends[:, n, end : end + 1]), 0.0)
        beyond = np.flatnonzero((since > 0.0).any(axis=0))
        if len(beyond):
            since, states = since[:, beyond], self.states[n]
            bend = curvature(states[:, 2 * end : 2 * end + 2])
            extended = extrapolate(states[:, -end], bend, since, sign)
            out[:, beyond] = np.where((since > 0.0)[..., None], extended, out[:, beyond])


def curvature(states: Floats) -> Floats:
    """Return the curvature (S,) [1/m] between two successive states (S, 2, 5)."""
    distance = np.hypot(*(states[:, 1, :2] - states[:, 0, :2]).T)
    turn = wrap_angle(states[:, 1, 2] - states[:, 0, 2])
    known = distance > _MIN_DISTANCE_M
    return np.asarray(np.where(known, turn / np.maximum(distance, _MIN_DISTANCE_M), 0.0))


@dataclass(frozen=True, eq=False)
class Presence:
    """When S scenarios begin, and which vehicles are present at which of their samples.

    Attributes:
        begin: (S,) seconds, on the scenarios' clocks.
        count: (S,) number of samples.
        present: (S, N, 2) first and last sample of each vehicle.
    """

    begin: Floats
    count: Ints
    present: Ints

    @classmethod
    def of(cls, span: Floats, extension: Extension) -> "Presence":
        """Return the presence in scenarios that begin and end at `span` (S, 2) [s]."""
        shown = np.where(extension.throughout, span[:, None, :], extension.ends)
        at = (shown - span[:, :1, None]) / SAMPLE_PERIOD_S
        steps = (span[:, 1] - span[:, 0]) / SAMPLE_PERIOD_S
        count = np.floor(steps + _ROUNDING_STEPS).astype(np.int64) + 1
        first = np.ceil(at[..., 0] - _ROUNDING_STEPS)
        last = np.floor(at[..., 1] + _ROUNDING_STEPS)
        present = np.stack([first, last], axis=-1).astype(np.int64)
        latest = np.maximum(count - 1, 0)[:, None, None]
        return cls(span[:, 0], count, np.clip(present, 0, latest))

    def is_usable(self) -> Bools:
        """Return whether each scenario, and each vehicle in it, has two samples (S,)."""
        long_enough = (self.present[..., 1] > self.present[..., 0]).all(axis=1)
        return np.asarray((self.count >= 2) & long_enough)


@dataclass(frozen=True, eq=False)
class Batch:
    """S candidates of N vehicles.

    Attributes:
        models: the models of the vehicles.
        samples: the sampled motions of each.
        extension: how they go on beyond their routes.
        presence: when they are present.
        feasible: (S,) False where a speed does not meet its conditions.
        clock: the clocks that all vehicles share.
        lights: of the road, on the template's clock.
    """

    models: tuple[VehicleModel, ...]
    samples: tuple[VehicleSamples, ...]
    extension: Extension
    presence: Presence
    feasible: Bools
    clock: Clock
    lights: PlacedLights | None

    def states(self, time: Floats, counts: Ints) -> Floats:
        """Return states (N, S, T, 5) at ascending times (T,) [s] since the scenarios' begin.

        A state is x, y [m], yaw [rad, not unwrapped], speed [m/s], acceleration [m/s²].

        Args:
            time: seconds.
            counts: (S,) number of times of each candidate that are filled.
        """
        at = time + self.presence.begin[:, None]
        out = np.empty((len(self.models), *at.shape, 5))
        for n, (model, samples) in enumerate(zip(self.models, self.samples, strict=True)):
            out[n] = samples.states(at, counts)
            for end in range(2):
                if self.extension.states is not None and not model.stands_at(end):
                    self.extension.extend(n, end, at, out[n])
        return out

    def scenarios(self, seed: int, index: Sequence[int], frame_id: str) -> list[Scenario | None]:
        """Return the candidates at the published samples; None where infeasible."""
        count = self.presence.count
        time = np.round(np.arange(max(int(count.max()), 2)) * SAMPLE_PERIOD_S, 9)
        states = self.states(time, np.maximum(count, 0))
        scenarios: list[Scenario | None] = [None] * len(count)
        facts = Facts()
        for s in np.flatnonzero(self.feasible).tolist():
            if self.lights is not None:
                lights = self.lights.on_clock(self.clock, s, float(self.presence.begin[s]))
                facts = Facts(lights=lights)
            x, y, yaw, speed, acceleration = np.moveaxis(states[:, s, : count[s]], -1, 0)
            scenario = Scenario(
                tuple(samples.vehicles[s] for samples in self.samples),
                time[: count[s]],
                np.stack([x, y], axis=-1),
                yaw,
                speed,
                acceleration,
                seed,
                index[s],
                frame_id,
                facts=facts,
                present=self.presence.present[s],
            )
            scenarios[s] = self.lights.with_departures(scenario) if self.lights else scenario
        return scenarios
