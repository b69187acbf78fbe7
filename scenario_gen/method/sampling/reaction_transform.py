# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The joint model of all vehicles: a deviation of one vehicle returns in those that react to it.

Every candidate is computed from standard normal numbers z, which move each vehicle linearly: how
late it is at a time of the template (`lateness`), and how far ahead of its place (`advance`). A
reaction is a set of linear equations between the numbers of two vehicles, each with a residual: a
follower is as late, and as far ahead, as its leader was a lag ago; a yielder leaves as late as the
other vehicle clears the conflict.

At template time τ vehicle n is late by ℓ_n(τ)ᵀz_n (shift, pace, waits) and ahead by d_n(τ)ᵀz_n
(displacement, end speeds). With lag and gain g of the edge:

- follower f, leader l, every 0.8 s: ℓ_f(τ)ᵀz_f - ℓ_l(τ - lag)ᵀz_l = ε₁(τ) and
  d_f(τ)ᵀz_f - [g d_l(τ - lag) + (1 - g) mean of d_l over ± 3 s]ᵀz_l = ε₂(τ). ε₂ has the edge's
  residual over 8 s and 8 cm over 1.2 s, and is smaller in proportion to the gap at a lower speed;
  ε₁ is ε₂ divided by the follower's speed.
- yielder y, first vehicle o, with the late arrival at a place a_n(τ) = ℓ_n(τ) - d_n(τ) / v_n(τ):
  a_y(enters)ᵀz_y - a_o(clears)ᵀz_o = ε, 0.3 s and a fifth of the template's gap; and where it
  stands and drives off: ℓ_y(leaves)ᵀz_y - a_o(clears)ᵀz_o = ε, 0.6 s. If it gives way without
  passing behind: ℓ_y(slows) - ℓ_o(slows) = ε.

Given the numbers of the vehicles to which it reacts, those of a vehicle are again Gaussian. With
the whitened equations A z + B z_others = η and A = U S Vᵀ they are
z = ε + V ((I + S²)^-½ - I) Vᵀ ε - V S (I + S²)⁻¹ Uᵀ B z_others. So all numbers follow from
independent ones, ε, vehicle by vehicle in the order of the graph. A vehicle without reactions
keeps its ε. The others react to the truncated lateness: a wait cannot be much shorter.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
import math
from typing import NamedTuple

import numpy as np
from scipy import linalg

from scenario_gen.method.sampling.gp import squared_exponential
from scenario_gen.method.sampling.numbers import ModelNumbers
from scenario_gen.method.sampling.time_warp import Clock
from scenario_gen.method.sampling.variation import VehicleClock
from scenario_gen.method.sampling.vehicle_model import NoiseScale, VehicleModel
from scenario_gen.numerics import Floats
from scenario_gen.types import FOLLOW, Reaction, ReactionGraph


@dataclass(frozen=True)
class _Residuals:
    """How closely drivers react, measured on recorded encounters (docs/interaction.md).

    Attributes:
        step: s between the equations of a follower.
        max_equations: of a follower.
        averaging: s to either side over which a follower averages its leader's motion.
        slow_length, quick_length: s, correlation lengths of a follower's residual.
        quick_sigma: m, standard deviation of its quick part.
        rough_share: of a residual that is independent in each equation.
        entry, entry_share: s and share of the gap, standard deviation of a yielder's entry.
        slack_share: of the time until red, by which a vehicle crosses a stop line earlier or
            later.
        event: s, standard deviation of a clearing or departure, besides the residual.
        standstill_gap: m of a follower's gap that do not depend on its speed.
        min_crossing_speed, min_following_speed: m/s that convert metres to seconds.
    """

    step: float = 0.8
    max_equations: int = 60
    averaging: float = 3.0
    slow_length: float = 8.0
    quick_length: float = 1.2
    quick_sigma: float = 0.08
    rough_share: float = 0.05
    entry: float = 0.3
    entry_share: float = 0.2
    event: float = 0.05
    slack_share: float = 0.5
    standstill_gap: float = 2.0
    min_crossing_speed: float = 1.0
    min_following_speed: float = 0.5


_RESIDUALS = _Residuals()


class _Equations(NamedTuple):
    """Equations with Gaussian residuals: the sum of rows times numbers, plus a residual, is 0.

    Attributes:
        rows: by vehicle, (m, d) the coefficients of its numbers.
        covariance: (m, m) of the residuals.
    """

    rows: dict[int, Floats]
    covariance: Floats


class _Condition(NamedTuple):
    """How the numbers of one vehicle follow from all: z_n += (z gather) scatter, of rank k.

    Attributes:
        part: its numbers among all.
        gather: (size, k) from all numbers.
        scatter: (k, d) to its numbers.
        clock: its clock, None if it has none.
        clock_part: the numbers of its clock among all.
    """

    part: slice
    gather: Floats
    scatter: Floats
    clock: VehicleClock | None
    clock_part: slice


@dataclass(frozen=True, eq=False)
class ReactionTransform:
    """Numbers of all vehicles from independent ones, vehicle by vehicle in the graph's order."""

    conditions: tuple[_Condition, ...]
    scale: NoiseScale

    @classmethod
    def of(
        cls,
        models: Sequence[VehicleModel],
        numbers: ModelNumbers,
        nominal: Clock,
        graph: ReactionGraph,
        scale: NoiseScale,
    ) -> "ReactionTransform":
        """Prepare the conditions of all vehicles.

        Args:
            models: of all vehicles.
            numbers: the layout of their numbers.
            nominal: the clock without deviation.
            graph: the reactions.
            scale: factors on the standard deviations of a candidate.
        """
        context = MotionContext(models, nominal, scale)
        conditions = []
        for n in graph.order:
            equations = [each for edge in graph.of(n) for each in context.equations(edge)]
            equations += context.at_light(n, graph)
            for each in equations:
                each.rows[n][:, models[n].driver_gaps] = 0.0
            effective = [each for each in equations if each.rows[n].any()]
            gather, scatter = _solve(n, effective, numbers)
            part, layout = numbers.vehicles[n], models[n].numbers
            clock_part = slice(part.start + layout.clock.start, part.start + layout.clock.stop)
            variation = models[n].variation
            clock = None if variation is None else variation.clock
            conditions.append(_Condition(part, gather, scatter, clock, clock_part))
        return cls(tuple(conditions), scale)

    def apply(self, eps: Floats) -> Floats:
        """Return numbers (S, size) of candidates from independent ones (S, size)."""
        z, effective = eps.copy(), eps.copy()
        for condition in self.conditions:
            part, clock_part = condition.part, condition.clock_part
            z[:, part] += effective @ condition.gather @ condition.scatter
            effective[:, part] = z[:, part]
            if condition.clock is not None:
                effective[:, clock_part] = condition.clock.effective(
                    z[:, clock_part], self.scale.vehicle_clock
                )
        return z


def _solve(
    n: int, equations: Sequence[_Equations], numbers: ModelNumbers
) -> tuple[Floats, Floats]:
    """Return `gather` and `scatter` of vehicle n."""
    part, count = numbers.vehicles[n], numbers.total
    if not equations:
        return np.zeros((count, 0)), np.zeros((0, part.stop - part.start))
    whitened = []
    for rows, covariance in equations:
        whole = np.zeros((len(covariance), count))
        for m, row in rows.items():
            whole[:, numbers.vehicles[m]] += row
        root = np.linalg.cholesky(covariance)
        whitened.append(linalg.solve_triangular(root, whole, lower=True))
    system = np.vstack(whitened)
    u, s, v = np.linalg.svd(system[:, part], full_matrices=False)
    gather = -system.T @ (u * (s / (1.0 + np.square(s))))
    gather[part] = v.T * (1.0 / np.sqrt(1.0 + np.square(s)) - 1.0)
    return gather, v


@dataclass(frozen=True, eq=False)
class MotionContext:
    """What the equations of a reaction depend on: models, nominal clock, and scale."""

    models: Sequence[VehicleModel]
    nominal: Clock
    scale: NoiseScale

    def equations(self, edge: Reaction) -> Iterator[_Equations]:
        """Yield the equations of a reaction."""
        if edge.kind == FOLLOW:
            yield from self._following(edge)
        elif edge.gap == math.inf:
            slows = np.array([edge.since if edge.stands else edge.until])
            rows = {
                edge.who: self.lateness(edge.who, slows),
                edge.whom: -self.lateness(edge.whom, slows),
            }
            yield _Equations(rows, _variance(edge.residual))
        else:
            yield from self._yielding(edge)

    def at_light(self, n: int, graph: ReactionGraph) -> Iterator[_Equations]:
        """Yield that a vehicle departs as late as its light turns green, and crosses in time.

        Lights are as late as the clock that all vehicles share. A vehicle in a queue departs as
        its leader does.
        """
        for stop in graph.stops:
            if stop.who == n and stop.stands and not stop.queue:
                leaves = self.lateness(n, np.array([stop.until]))
                yield _Equations({n: leaves}, _variance(_RESIDUALS.entry))
        for who, time, slack in graph.crossings:
            if who == n:
                sigma = min(max(_RESIDUALS.slack_share * slack, _RESIDUALS.entry), 3.0)
                yield _Equations({n: self._arrival(n, time)}, _variance(sigma))

    def lateness(self, n: int, at: Floats) -> Floats:
        """Return the seconds (q, d) by which each number of vehicle n makes it late.

        `at` (q,) are template times [s].
        """
        model = self.models[n]
        rows = np.zeros((len(at), model.numbers.total))
        if model.variation is not None:
            grid, clock = self.nominal.grid, model.variation.clock
            basis = np.stack([np.interp(at, grid, values) for values in clock.basis], axis=1)
            rows[:, model.numbers.clock] = self.scale.vehicle_clock * clock.sigma * basis
        return rows

    def advance(self, n: int, at: Floats) -> Floats:
        """Return the metres (q, d) by which each number moves vehicle n ahead, besides its clock.

        `at` (q,) are template times [s].
        """
        model, scale = self.models[n], self.scale.longitudinal
        rows = np.zeros((len(at), model.numbers.total))
        driven = model.speed.spline.driven(_within(model, at))
        rows[:, model.numbers.speed] = scale * (driven @ model.speed.factor)
        if model.variation is not None:
            metres = driven @ model.speed.faster
            rows[:, model.numbers.end_speeds] = scale * metres * model.variation.end_speed
            if model.variation.strength > 0.0:
                metres = driven @ model.speed.strength.effect
                rows[:, model.numbers.strength] = metres * model.variation.strength
        return rows

    def _following(self, edge: Reaction) -> Iterator[_Equations]:
        """Yield the equations of lateness and advance of a follower."""
        who, whom = edge.who, edge.whom
        steps = max(int((edge.until - edge.since) / _RESIDUALS.step), 1)
        count = min(steps + 1, _RESIDUALS.max_equations)
        at = np.linspace(edge.since, edge.until, count)
        before = at - edge.lag

        speed = _mean_speed(self.models[who], at)
        gap = _RESIDUALS.standstill_gap + edge.headway[1] * speed
        metres = edge.residual * np.minimum(gap / np.median(gap), 1.0)
        seconds = metres / np.maximum(speed, _RESIDUALS.min_following_speed)
        slow = squared_exponential(at, at, 1.0, _RESIDUALS.slow_length)
        slow += np.square(_RESIDUALS.rough_share) * np.eye(count)
        quick = squared_exponential(at, at, _RESIDUALS.quick_sigma, _RESIDUALS.quick_length)

        seconds_rows = {who: self.lateness(who, at), whom: -self.lateness(whom, before)}
        yield _Equations(seconds_rows, seconds[:, None] * seconds * slow)
        metres_rows = {who: self.advance(who, at), whom: -self._response(edge, before)}
        yield _Equations(metres_rows, metres[:, None] * metres * slow + quick)

    def _response(self, edge: Reaction, at: Floats) -> Floats:
        """Return the metres (q, d) of a leader's motion to which its follower responds.

        The share `gain` counts at once, the rest averaged over some seconds.
        """
        offsets = np.linspace(-_RESIDUALS.averaging, _RESIDUALS.averaging, 7)
        averaged = np.mean([self.advance(edge.whom, at + offset) for offset in offsets], axis=0)
        return np.asarray(edge.gain * self.advance(edge.whom, at) + (1.0 - edge.gain) * averaged)

    def _yielding(self, edge: Reaction) -> Iterator[_Equations]:
        """Yield the equations of a yielder's entry and departure."""
        clears = -self._arrival(edge.whom, edge.clears)
        sigma = _RESIDUALS.entry + _RESIDUALS.entry_share * abs(edge.gap)
        enters = self._arrival(edge.who, edge.enters)
        yield _Equations({edge.who: enters, edge.whom: clears}, _variance(sigma))
        if edge.stands:
            leaves = self.lateness(edge.who, np.array([edge.until]))
            covariance = _variance(edge.residual) + _variance(_RESIDUALS.event)
            yield _Equations({edge.who: leaves, edge.whom: clears}, covariance)

    def _arrival(self, n: int, time: float) -> Floats:
        """Return the seconds (1, d) by which vehicle n is late where it is at a template time."""
        at = np.array([time])
        speed = np.maximum(_mean_speed(self.models[n], at), _RESIDUALS.min_crossing_speed)
        return self.lateness(n, at) - self.advance(n, at) / speed


def _variance(sigma: float) -> Floats:
    """Return the (1, 1) covariance of one residual with this standard deviation."""
    return np.array([[np.square(sigma)]])


def _within(model: VehicleModel, at: Floats) -> Floats:
    """Return template times (q,) [s], limited to the vehicle's presence."""
    return np.clip(at, *model.span)


def _mean_speed(model: VehicleModel, at: Floats) -> Floats:
    """Return the speeds (q,) [m/s] without deviations at template times (q,) [s]."""
    return model.speed.spline.design(_within(model, at)) @ model.speed.mean
