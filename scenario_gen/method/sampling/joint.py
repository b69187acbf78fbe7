# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One joint model: what a vehicle does differently comes back in those that react to it.

Every candidate is computed from standard normal numbers z. They move each vehicle linearly: how late it is at a time of the
template (`lateness`), and how far ahead of its place (`advance`). A reaction is a set of linear equations between the numbers of
two vehicles, each with a residual: a follower is as late, and as far ahead, as its leader was a lag ago; a yielder leaves as late
as the other vehicle clears the conflict.

At template time τ vehicle n is late by ℓ_n(τ)ᵀz_n (shift, pace, waits) and ahead by d_n(τ)ᵀz_n (displacement, end speeds). With
lag and gain g of the edge:

- follower f, leader l, every 0.8 s: ℓ_f(τ)ᵀz_f − ℓ_l(τ − lag)ᵀz_l = ε₁(τ) and
  d_f(τ)ᵀz_f − [g d_l(τ − lag) + (1 − g) mean of d_l over ± 3 s]ᵀz_l = ε₂(τ). ε₂ has the edge's residual over 8 s and 8 cm over
  1.2 s, and is as much smaller as the gap at a lower speed; ε₁ is ε₂ divided by the follower's speed.
- yielder y, first o, with the late arrival at a place a_n(τ) = ℓ_n(τ) − d_n(τ) / v_n(τ):
  a_y(enters)ᵀz_y − a_o(clears)ᵀz_o = ε, 0.3 s and a fifth of the template's gap; and where it stands, and drives off:
  ℓ_y(leaves)ᵀz_y − a_o(clears)ᵀz_o = ε, 0.6 s. One that gives way without coming behind: ℓ_y(slows) − ℓ_o(slows) = ε.

Given the numbers of the vehicles it reacts to, those of a vehicle are again Gaussian. With the whitened equations
A z + B z_others = η and A = U S Vᵀ they are z = ε + V ((I + S²)^−½ − I) Vᵀ ε − V S (I + S²)⁻¹ Uᵀ B z_others. So all numbers
follow from independent ones, ε, vehicle by vehicle in the order of the graph. A vehicle that reacts to nobody keeps its own ε.
What its clock cuts off (a wait cannot be much shorter), nobody reacts to.
"""

from collections.abc import Sequence
from dataclasses import dataclass
import math

import numpy as np
from scipy import linalg

from scenario_gen.method.sampling.candidates import Scale, VehicleModel
from scenario_gen.method.sampling.freedom import OwnClock
from scenario_gen.method.sampling.time_warp import Clock
from scenario_gen.numerics import Floats
from scenario_gen.types import FOLLOW, Reaction, ReactionGraph

_STEP, _MOST = 0.8, 60  # [s] between the equations of a follower; largest number of them
_BLUR = 3.0  # [s] to either side over which a leader's motion is averaged, in the part that its follower answers late
_SLOWLY, _QUICKLY = (
    8.0,
    1.2,
)  # [s] correlation lengths of the slow and the quick part of a follower's residual
_QUICK = 0.08  # [m] standard deviation of the quick part
_ROUGH = 0.05  # share of a residual that is independent in each equation
_ENTERS, _OF_GAP = (
    0.3,
    0.2,
)  # [s] and share of the gap, standard deviation of when a yielder enters
_STANDSTILL = 2.0  # [m] of a follower's gap that does not depend on its speed
_SLOWEST, _STANDS = (
    1.0,
    0.5,
)  # [m/s] least speeds, of a crossing vehicle and of a follower, that turn metres into seconds
_EVENT = 0.05  # [s] standard deviation of when a vehicle clears or leaves, beside the residual

Rows = dict[int, Floats]
"""By vehicle: (m, d) what each of its standard normal numbers adds to m equations."""


@dataclass(frozen=True, eq=False)
class Step:
    """How the numbers of one vehicle follow from all: z[own] += (z into) out, of rank k; 0 for one that reacts to nobody.

    Attributes:
        own: the place of its d numbers among all of them.
        into: (size, k) from all numbers.
        out: (k, d) to its own.
        clock: its own clock, None if it has none; `free`: the place of that one's numbers among all.
    """

    own: slice
    into: Floats
    out: Floats
    clock: OwnClock | None
    free: slice


@dataclass(frozen=True, eq=False)
class Mixing:
    """The numbers of all vehicles from independent ones: a step for each vehicle, in the order of the graph."""

    steps: tuple[Step, ...]
    scale: Scale

    @classmethod
    def of(
        cls,
        models: Sequence[VehicleModel],
        first: Sequence[int],
        nominal: Clock,
        graph: ReactionGraph,
        scale: Scale,
    ) -> "Mixing":
        """Prepare the steps of all vehicles.

        Args:
            models: of all vehicles.
            first: (N + 1,) where the numbers of each begin among all, and where the last one's end.
            nominal: the clock without deviation.
            graph: who reacts to whom.
            scale: factors on the standard deviations of a candidate.
        """
        steps = []
        for n in graph.order if graph.edges else ():
            edges = [edge for edge in graph.edges if edge.who == n]
            equations = [
                equation
                for edge in edges
                for equation in _equations(edge, models, nominal, scale)
                if equation[0][n].any()
            ]
            freedom = models[n].freedom
            clock = freedom.clock if freedom else None
            begin = first[n] + models[n].lateral_root.shape[1] + models[n].speed.size
            free = slice(begin, begin + (clock.size if clock else 0))
            into, out = _solved(n, equations, first)
            steps.append(Step(slice(first[n], first[n + 1]), into, out, clock, free))
        return cls(tuple(steps), scale)

    def mixed(self, eps: Floats) -> Floats:
        """Numbers (S, size) of candidates from independent ones (S, size)."""
        z, seen = eps.copy(), eps.copy()
        for step in self.steps:
            z[:, step.own] += seen @ step.into @ step.out
            seen[:, step.own] = z[:, step.own]
            if step.clock is not None:
                seen[:, step.free] = step.clock.effective(z[:, step.free], self.scale.own)
        return z


def _solved(
    n: int, equations: Sequence[tuple[Rows, Floats]], first: Sequence[int]
) -> tuple[Floats, Floats]:
    """`into` and `out` of vehicle n given equations (rows, covariance of residuals): rows times numbers, plus residual, are 0."""
    if not equations:
        return np.zeros((first[-1], 0)), np.zeros((0, first[n + 1] - first[n]))
    own, others, k = [], [], 0
    for rows, covariance in equations:
        whole = np.zeros((len(covariance), first[-1]))
        for m, row in rows.items():
            whole[:, first[m] : first[m + 1]] += row
        white = linalg.solve_triangular(np.linalg.cholesky(covariance), whole, lower=True)
        own.append(white[:, first[n] : first[n + 1]].copy())
        white[:, first[n] : first[n + 1]] = 0.0
        others.append(white)
        k += len(white)
    u, s, v = np.linalg.svd(np.vstack(own), full_matrices=False)
    into = -np.vstack(others).T @ (u * (s / (1.0 + np.square(s))))
    into[first[n] : first[n + 1]] = v.T * (1.0 / np.sqrt(1.0 + np.square(s)) - 1.0)
    return into, v


def _equations(
    edge: Reaction, models: Sequence[VehicleModel], nominal: Clock, scale: Scale
) -> list[tuple[Rows, Floats]]:
    """The equations of a reaction, with the covariance of their residuals."""
    who, whom = models[edge.who], models[edge.whom]
    if edge.kind == FOLLOW:
        count = min(max(int((edge.until - edge.since) / _STEP), 1) + 1, _MOST)
        at = np.linspace(edge.since, edge.until, count)
        before = at - edge.lag
        speed = _speeds(who, at)
        gap = _STANDSTILL + edge.headway[1] * speed
        residual = edge.residual * np.minimum(gap / np.median(gap), 1.0)
        spread = residual / np.maximum(
            speed, _STANDS
        )  # [s] the slower it drives, the less its lateness shows
        slow, quick = _alike(at, _SLOWLY), _alike(at, _QUICKLY)
        rough = np.square(_ROUGH) * np.eye(count)
        late = {
            edge.who: lateness(who, at, nominal, scale),
            edge.whom: -lateness(whom, before, nominal, scale),
        }
        ahead = {
            edge.who: advance(who, at, scale),
            edge.whom: -_answered(edge, whom, before, scale),
        }
        return [
            (late, spread[:, None] * spread * (slow + rough)),
            (ahead, residual[:, None] * residual * (slow + rough) + np.square(_QUICK) * quick),
        ]
    if edge.gap == math.inf:
        slows = np.array([edge.since if edge.stands else edge.until])
        rows = {
            edge.who: lateness(who, slows, nominal, scale),
            edge.whom: -lateness(whom, slows, nominal, scale),
        }
        return [(rows, np.array([[np.square(edge.residual)]]))]
    first = -_arrival(whom, edge.clears, nominal, scale)
    entry = _ENTERS + _OF_GAP * abs(edge.gap)
    equations = [
        (
            {edge.who: _arrival(who, edge.enters, nominal, scale), edge.whom: first},
            np.array([[np.square(entry)]]),
        )
    ]
    if edge.stands:
        leaves = lateness(who, np.array([edge.until]), nominal, scale)
        equations.append(
            (
                {edge.who: leaves, edge.whom: first},
                np.array([[np.square(edge.residual) + np.square(_EVENT)]]),
            )
        )
    return equations


def _arrival(model: VehicleModel, at: float, nominal: Clock, scale: Scale) -> Floats:
    """(1, d) seconds by which each number makes a vehicle late at the place where it is at a template time [s]."""
    times = np.array([at])
    return lateness(model, times, nominal, scale) - advance(model, times, scale) / np.maximum(
        _speeds(model, times), _SLOWEST
    )


def _answered(edge: Reaction, leader: VehicleModel, at: Floats, scale: Scale) -> Floats:
    """(q, d) metres of the leader's motion that a follower answers: the share `gain` at once, the rest over some seconds."""
    averaged = np.mean(
        [advance(leader, at + off, scale) for off in np.linspace(-_BLUR, _BLUR, 7)], axis=0
    )
    return np.asarray(edge.gain * advance(leader, at, scale) + (1.0 - edge.gain) * averaged)


def _alike(at: Floats, length: float) -> Floats:
    """(q, q) correlation, with a length [s], of values at times (q,) [s]."""
    return np.exp(-0.5 * np.square((at[:, None] - at) / length))


def _speeds(model: VehicleModel, at: Floats) -> Floats:
    """The speeds (q,) [m/s] of a vehicle without deviations at template times (q,) [s]."""
    spline = model.speed.spline
    return spline.design(np.clip(at, spline.breaks[0], spline.breaks[-1])) @ model.speed.mean


def lateness(model: VehicleModel, at: Floats, nominal: Clock, scale: Scale) -> Floats:
    """(q, d) seconds by which each standard normal number makes a vehicle late at template times (q,) [s]."""
    rows = np.zeros((len(at), model.size))
    if model.freedom is None:
        return rows
    clock = model.freedom.clock
    begin = model.lateral_root.shape[1] + model.speed.size
    basis = np.vstack([clock.shift, clock.pace, clock.waits])
    for k, values in enumerate(basis):
        rows[:, begin + k] = scale.own * clock.sigma[k] * np.interp(at, nominal.grid, values)
    return rows


def advance(model: VehicleModel, at: Floats, scale: Scale) -> Floats:
    """(q, d) metres by which each standard normal number sets a vehicle forward at template times (q,) [s], beside its clock."""
    rows = np.zeros((len(at), model.size))
    spline = model.speed.spline
    driven = spline.driven(np.clip(at, spline.breaks[0], spline.breaks[-1]))
    begin = model.lateral_root.shape[1]
    rows[:, begin : begin + model.speed.size] = scale.longitudinal * (driven @ model.speed.factor)
    if model.freedom is not None:
        end = begin + model.speed.size + model.freedom.clock.size + 1
        rows[:, end : end + 2] = (
            scale.longitudinal * (driven @ model.speed.faster) * model.freedom.end_speed
        )
    return rows
