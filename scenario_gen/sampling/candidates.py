# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Candidate scenarios, many at a time, from standard normal numbers.

A candidate varies the planned encounter in three ways: across the routes (a Gaussian process per vehicle), along them
(where a changepoint's anchor lies), and in time (the clock that all vehicles share). The time law is solved on the
displaced paths' own lengths, so the published speed is the rate of arc length and the acceleration is the law's.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from scenario_gen import exact
from scenario_gen.arrays import Bools, Floats
from scenario_gen.encounter import Vehicle
from scenario_gen.sampling.along import displaced_anchors
from scenario_gen.sampling.clock import Clock, DT
from scenario_gen.sampling.lateral import kept_within
from scenario_gen.sampling.path import arc_lengths, BasePath, states
from scenario_gen.sampling.time_law import SpeedProfile, TimeLaw
from scenario_gen.sampling.time_layout import TimeLayout
from scenario_gen.scenario import Scenario

DAMPING = (1.0, 0.8, 0.6, 0.4, 0.2, 0.0)  # of a candidate's clock, until a speed profile exists


@dataclass(frozen=True)
class Scale:
    """Factors on the standard deviations of a candidate: across the route, along it, and in time."""

    lateral: float = 1.0
    longitudinal: float = 1.0
    time: float = 1.0


@dataclass(frozen=True, eq=False)
class VehicleModel:
    """All that is the same for every candidate of one vehicle.

    Attributes:
        vehicle: identity and footprint.
        path: the route.
        anchor: (K + 2,) arc length [m] of each anchor on it.
        factor: (G, r) square root of the covariance of the lateral deviation.
        along: (D, r) the same of its distinct inner anchors' displacements along the route.
        room: (G,) metres that the road leaves to either side.
        law: the time law on the vehicle's knots.
    """

    vehicle: Vehicle
    path: BasePath
    anchor: Floats
    factor: Floats
    along: Floats
    room: Floats
    law: TimeLaw

    @property
    def size(self) -> int:
        """Standard normal numbers needed per candidate."""
        return int(self.factor.shape[1] + self.along.shape[1])

    def deviations(self, z: Floats) -> Floats:
        """Return how far each sample is to the side (S, G) [m]."""
        return kept_within(exact.matmul(z, self.factor.T), self.room)


@dataclass(frozen=True, eq=False)
class VehicleMotion:
    """One vehicle's motion in one candidate: where it is at any time, in closed form.

    Attributes:
        curve: (G, 4) cubic spline x, y, dx/du, dy/du at its nodes.
        arc: (G,) arc length [m] of the nodes.
        spacing: step of u [m].
        profile: speed over time.
    """

    curve: Floats
    arc: Floats
    spacing: float
    profile: SpeedProfile

    def state(self, time: Floats) -> Floats:
        """States (T, 5) x, y [m], yaw [rad, unwrapped], speed [m/s], acceleration [m/s²] at ascending times (T,) [s]."""
        out = np.empty((1, len(time), 5))
        knot, speed = self.profile.time[None], self.profile.speed[None]
        count = np.array([len(time)])
        states(self.curve[None], self.arc[None], self.spacing, knot, speed, np.ascontiguousarray(time[None]), count, out)
        out[0, :, 2] = np.unwrap(out[0, :, 2])
        return np.asarray(out[0])


@dataclass(frozen=True, eq=False)
class Batch:
    """S candidates of N vehicles.

    Attributes:
        vehicles: identities and footprints.
        clock: (S, K + 2) seconds of start, changepoints and end.
        curve, arc, knot, speed: per vehicle, (S, ...) arrays as in `VehicleMotion`.
        spacing: per vehicle, metres.
        feasible: (S,) False where no speed profile exists.
        damping: (S,) factor that the clock's deviations were multiplied by to get one.
    """

    vehicles: tuple[Vehicle, ...]
    clock: Floats
    curve: tuple[Floats, ...]
    arc: tuple[Floats, ...]
    knot: tuple[Floats, ...]
    speed: tuple[Floats, ...]
    spacing: tuple[float, ...]
    feasible: Bools
    damping: Floats

    def motion(self, sample: int, vehicle: int) -> VehicleMotion:
        """The motion of one vehicle in one candidate."""
        profile = SpeedProfile(self.knot[vehicle][sample], self.speed[vehicle][sample])
        return VehicleMotion(self.curve[vehicle][sample], self.arc[vehicle][sample], self.spacing[vehicle], profile)

    def scenarios(self, seed: int, index: Sequence[int], frame_id: str) -> list[Scenario | None]:
        """The candidates on the published grid; None where infeasible."""
        samples, n = self.feasible.shape[0], len(self.vehicles)
        count = np.round(self.clock[:, -1] / DT).astype(np.int64) + 1
        time = np.round(np.arange(count.max()) * DT, 9)
        out = np.empty((n, samples, len(time), 5))
        times = np.broadcast_to(time, (samples, len(time))).copy()
        for v in range(n):
            states(self.curve[v], self.arc[v], self.spacing[v], self.knot[v], self.speed[v], times, count, out[v])
        return [
            _scenario(self.vehicles, time[: count[s]], out[:, s, : count[s]], seed, index[s], frame_id) if ok else None
            for s, ok in enumerate(self.feasible)
        ]


def _scenario(vehicles: tuple[Vehicle, ...], time: Floats, state: Floats, seed: int, index: int, frame_id: str) -> Scenario:
    """A scenario from states (N, T, 5)."""
    return Scenario(vehicles, time, state[..., :2], state[..., 2], state[..., 3], state[..., 4], seed, index, frame_id)


class CandidateModel:
    """Draws candidates of one encounter on its routes."""

    def __init__(self, vehicles: tuple[VehicleModel, ...], clock: Clock, most_slide: float) -> None:
        self.vehicles, self.clock, self.most_slide = vehicles, clock, most_slide

    @property
    def size(self) -> int:
        """Standard normal numbers needed per candidate."""
        return self.clock.size + sum(int(v.size) for v in self.vehicles)

    def _speeds(self, v: VehicleModel, knot: Floats, lengths: Floats) -> tuple[Floats, Bools]:
        """Speeds (S, M) and feasible (S,); where the drawn anchors cannot be reached in time, they slide a little."""
        speed, ok = v.law.solve(knot, lengths)
        if not ok.all():
            bad = np.flatnonzero(~ok)
            speed[bad], ok[bad], slid = v.law.slide(knot[bad], lengths[bad])
            ok[bad] &= np.abs(slid).max(axis=1) <= self.most_slide
        return speed, ok

    def draw(self, z: Floats, scale: Scale) -> Batch:
        """Candidates from numbers z (S, size), their standard deviations multiplied by `scale`."""
        samples = len(z)
        parts = np.cumsum([self.clock.size] + [v.size for v in self.vehicles])
        own = [z[:, a:b] for a, b in pairwise(parts)]
        paths = []
        for v, x in zip(self.vehicles, own, strict=True):
            paths.append(v.path.displaced(v.deviations(scale.lateral * x[:, : v.factor.shape[1]])))
        clock = np.zeros((samples, len(self.clock.times)))
        knot = [np.zeros((samples, len(v.law.layout.knot))) for v in self.vehicles]
        speed = [np.zeros_like(k) for k in knot]
        damping = np.zeros(samples)
        open_ = np.arange(samples)
        for damp in DAMPING:
            clock[open_] = self.clock.sample(z[open_, : self.clock.size], np.full(len(open_), damp * scale.time))
            feasible = np.ones(len(open_), dtype=np.bool_)
            for n, v in enumerate(self.vehicles):
                u = displaced_anchors(v.anchor, v.along, scale.longitudinal * own[n][open_, v.factor.shape[1] :])
                knot[n][open_] = knots_on(clock[open_], self.clock.times, v.law.layout)
                curve, arc = paths[n] if len(open_) == samples else (paths[n][0][open_], paths[n][1][open_])
                lengths = piece_lengths(v.law.layout, curve, arc, v.path.spacing, u)
                speed[n][open_], ok = self._speeds(v, knot[n][open_], lengths)
                feasible &= ok
            damping[open_] = damp
            open_ = open_[~feasible]
            if len(open_) == 0:
                break
        feasible = np.ones(samples, dtype=np.bool_)
        feasible[open_] = False
        return Batch(
            tuple(v.vehicle for v in self.vehicles),
            clock,
            tuple(curve for curve, _ in paths),
            tuple(arc for _, arc in paths),
            tuple(knot),
            tuple(speed),
            tuple(v.path.spacing for v in self.vehicles),
            feasible,
            damping,
        )


def knots_on(clock: Floats, times: Floats, lay: TimeLayout) -> Floats:
    """Knots (S, M) of a vehicle on the clocks (S, K + 2), linear within each primitive."""
    piece = np.append(lay.piece, lay.piece[-1])
    share = (lay.knot - times[piece]) / (times[piece + 1] - times[piece])
    return np.asarray(clock[:, piece] + share * (clock[:, piece + 1] - clock[:, piece]))


def piece_lengths(lay: TimeLayout, curve: Floats, arc: Floats, spacing: float, anchor: Floats) -> Floats:
    """Lengths (S, G) [m] of the time law's constraints on each sample's own path, for anchors (S, K + 2) on the route."""
    if arc.shape[1] == 1:
        return np.zeros((len(anchor), len(lay.bounds)))
    at = np.empty(anchor.shape)
    arc_lengths(np.ascontiguousarray(curve), np.ascontiguousarray(arc), spacing, np.ascontiguousarray(anchor), at)
    return np.ascontiguousarray(at[:, lay.bounds[:, 1]] - at[:, lay.bounds[:, 0]])
