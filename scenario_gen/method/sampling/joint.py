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
  1.2 s; ε₁ is the residual divided by the follower's speed.
- yielder y, first o: ℓ_y(leaves)ᵀz_y − [ℓ_o(clears) − d_o(clears) / v_o]ᵀz_o = ε, 0.6 s.

Given the numbers of the vehicles it reacts to, those of a vehicle are again Gaussian. With the whitened equations
A z + B z_others = η and A = U S Vᵀ they are z = ε + V ((I + S²)^−½ − I) Vᵀ ε − V S (I + S²)⁻¹ Uᵀ B z_others. So all numbers
follow from independent ones, ε, vehicle by vehicle in the order of the graph. A vehicle that reacts to nobody keeps its own ε.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from scenario_gen.method.sampling.candidates import Scale, VehicleModel
from scenario_gen.method.sampling.time_warp import Clock
from scenario_gen.numerics import Floats
from scenario_gen.types import FOLLOW, Reaction, ReactionGraph

_STEP, _MOST = 0.8, 60  # [s] between the equations of a follower; largest number of them
_BLUR = 3.0  # [s] to either side over which a leader's motion is averaged, in the part that its follower answers late
_SLOWLY, _QUICKLY = 8.0, 1.2  # [s] correlation lengths of the slow and the quick part of a follower's residual
_QUICK = 0.08  # [m] standard deviation of the quick part
_ROUGH = 0.05  # share of a residual that is independent in each equation
_SLOWEST, _STANDS = 1.0, 0.5  # [m/s] least speeds, of a crossing vehicle and of a follower, that turn metres into seconds
_EVENT = 0.05  # [s] standard deviation of when a vehicle clears or leaves, beside the residual

Rows = dict[int, Floats]
"""By vehicle: (m, d) what each of its standard normal numbers adds to m equations."""


@dataclass(frozen=True, eq=False)
class Step:
    """How the numbers of one vehicle follow from all: z[own] += (z into) out, of rank k.

    Attributes:
        own: the place of its d numbers among all of them.
        into: (size, k) from all numbers.
        out: (k, d) to its own.
    """

    own: slice
    into: Floats
    out: Floats


@dataclass(frozen=True, eq=False)
class Mixing:
    """The numbers of all vehicles from independent ones: a step for each vehicle that reacts, in the order of the graph."""

    steps: tuple[Step, ...]

    @classmethod
    def of(
        cls, models: Sequence[VehicleModel], first: Sequence[int], nominal: Clock, graph: ReactionGraph, scale: Scale
    ) -> "Mixing":
        """Prepare the steps of all vehicles that react.

        Args:
            models: of all vehicles.
            first: (N + 1,) where the numbers of each begin among all, and where the last one's end.
            nominal: the clock without deviation.
            graph: who reacts to whom.
            scale: factors on the standard deviations of a candidate.
        """
        steps = []
        for n in graph.order:
            edges = [edge for edge in graph.edges if edge.who == n]
            equations = [
                equation for edge in edges for equation in _equations(edge, models, nominal, scale) if equation[0][n].any()
            ]
            if equations:
                steps.append(_step(n, equations, first))
        return cls(tuple(steps))

    def mixed(self, eps: Floats) -> Floats:
        """Numbers (S, size) of candidates from independent ones (S, size)."""
        z = eps.copy()
        for step in self.steps:
            z[:, step.own] += z @ step.into @ step.out
        return z


def _step(n: int, equations: Sequence[tuple[Rows, Floats]], first: Sequence[int]) -> Step:
    """The numbers of vehicle n given equations (rows, covariance of residuals): rows times numbers, plus residual, are 0."""
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
    return Step(slice(first[n], first[n + 1]), into, v)


def _equations(edge: Reaction, models: Sequence[VehicleModel], nominal: Clock, scale: Scale) -> list[tuple[Rows, Floats]]:
    """The equations of a reaction, with the covariance of their residuals."""
    who, whom = models[edge.who], models[edge.whom]
    if edge.kind == FOLLOW:
        count = min(max(int((edge.until - edge.since) / _STEP), 1) + 1, _MOST)
        at = np.linspace(edge.since, edge.until, count)
        before = at - edge.lag
        spread = edge.residual / np.maximum(_speeds(who, at), _STANDS)  # [s] the slower it drives, the less its lateness shows
        slow, quick = _alike(at, _SLOWLY), _alike(at, _QUICKLY)
        rough = np.square(_ROUGH) * np.eye(count)
        late = {edge.who: lateness(who, at, nominal, scale), edge.whom: -lateness(whom, before, nominal, scale)}
        ahead = {edge.who: advance(who, at, scale), edge.whom: -_answered(edge, whom, before, scale)}
        return [
            (late, spread[:, None] * spread * (slow + rough)),
            (ahead, np.square(edge.residual) * (slow + rough) + np.square(_QUICK) * quick),
        ]
    leaves, clears = np.array([edge.until]), np.array([edge.clears])
    speed = np.maximum(_speeds(whom, clears), _SLOWEST)
    other = lateness(whom, clears, nominal, scale) - advance(whom, clears, scale) / speed
    return [
        (
            {edge.who: lateness(who, leaves, nominal, scale), edge.whom: -other},
            np.array([[np.square(edge.residual) + np.square(_EVENT)]]),
        )
    ]


def _answered(edge: Reaction, leader: VehicleModel, at: Floats, scale: Scale) -> Floats:
    """(q, d) metres of the leader's motion that a follower answers: the share `gain` at once, the rest over some seconds."""
    averaged = np.mean([advance(leader, at + off, scale) for off in np.linspace(-_BLUR, _BLUR, 7)], axis=0)
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
        rows[:, end : end + 2] = scale.longitudinal * (driven @ model.speed.faster) * model.freedom.end_speed
    return rows
