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
(where a changepoint's anchor lies), and in time (the time warp that all vehicles share). The speed profile is solved on the
displaced paths' own lengths, so the published speed is the rate of arc length and the acceleration is the profile's.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from scenario_gen import exact
from scenario_gen.arrays import Bools, Floats
from scenario_gen.sampling.deviations import displaced_anchors, soft_clipped
from scenario_gen.sampling.path import arc_lengths, BasePath, states
from scenario_gen.sampling.speed_profile.knots import SpeedKnots
from scenario_gen.sampling.speed_profile.qp import SpeedProfile, SpeedProfileQP
from scenario_gen.sampling.time_warp import DT, TimeWarp
from scenario_gen.types.encounter import Vehicle
from scenario_gen.types.scenario import Scenario

DAMPING = (1.0, 0.8, 0.6, 0.4, 0.2, 0.0)  # of a candidate's time warp, until a speed profile exists


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
        lateral_root: (G, r) square root of the covariance of the lateral deviation.
        longitudinal_root: (D, r) the same of its distinct inner anchors' displacements along the route.
        room: (G,) metres that the road leaves to either side.
        qp: the speed profile QP on the vehicle's knots.
    """

    vehicle: Vehicle
    path: BasePath
    anchor: Floats
    lateral_root: Floats
    longitudinal_root: Floats
    room: Floats
    qp: SpeedProfileQP

    @property
    def size(self) -> int:
        """Standard normal numbers needed per candidate."""
        return int(self.lateral_root.shape[1] + self.longitudinal_root.shape[1])

    def deviations(self, z: Floats) -> Floats:
        """Return how far each sample is to the side (S, G) [m]."""
        return soft_clipped(exact.matmul(z, self.lateral_root.T), self.room)


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
        warped: (S, K + 2) seconds of start, changepoints and end.
        curve, arc, knot, speed: per vehicle, (S, ...) arrays as in `VehicleMotion`.
        spacing: per vehicle, metres.
        feasible: (S,) False where no speed profile exists.
        damping: (S,) factor that the warp's deviations were multiplied by to get one.
    """

    vehicles: tuple[Vehicle, ...]
    warped: Floats
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
        count = np.round(self.warped[:, -1] / DT).astype(np.int64) + 1
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
    """Draws candidates of one encounter on its routes.

    Source: paper III-C.
    """

    def __init__(self, vehicles: tuple[VehicleModel, ...], warp: TimeWarp, max_slide: float) -> None:
        self.vehicles, self.warp, self.max_slide = vehicles, warp, max_slide

    @property
    def size(self) -> int:
        """Standard normal numbers needed per candidate."""
        return self.warp.size + sum(int(v.size) for v in self.vehicles)

    def _speeds(self, v: VehicleModel, knot: Floats, lengths: Floats) -> tuple[Floats, Bools]:
        """Speeds (S, M) and feasible (S,); where the drawn anchors cannot be reached in time, they slide a little."""
        speed, ok = v.qp.solve(knot, lengths)
        if not ok.all():
            bad = np.flatnonzero(~ok)
            speed[bad], ok[bad], slid = v.qp.slide(knot[bad], lengths[bad])
            ok[bad] &= np.abs(slid).max(axis=1) <= self.max_slide
        return speed, ok

    def draw(self, z: Floats, scale: Scale) -> Batch:
        """Candidates from numbers z (S, size), their standard deviations multiplied by `scale`."""
        samples = len(z)
        parts = np.cumsum([self.warp.size] + [v.size for v in self.vehicles])
        own = [z[:, a:b] for a, b in pairwise(parts)]
        paths = []
        for v, x in zip(self.vehicles, own, strict=True):
            paths.append(v.path.displaced(v.deviations(scale.lateral * x[:, : v.lateral_root.shape[1]])))
        warped = np.zeros((samples, len(self.warp.times)))
        knot = [np.zeros((samples, len(v.qp.knots.knot))) for v in self.vehicles]
        speed = [np.zeros_like(k) for k in knot]
        damping = np.zeros(samples)
        open_ = np.arange(samples)
        for damping_factor in DAMPING:
            warped[open_] = self.warp.sample(z[open_, : self.warp.size], np.full(len(open_), damping_factor * scale.time))
            feasible = np.ones(len(open_), dtype=np.bool_)
            for n, v in enumerate(self.vehicles):
                longitudinal = scale.longitudinal * own[n][open_, v.lateral_root.shape[1] :]
                u = displaced_anchors(v.anchor, v.longitudinal_root, longitudinal)
                knot[n][open_] = knots_on(warped[open_], self.warp.times, v.qp.knots)
                curve, arc = paths[n] if len(open_) == samples else (paths[n][0][open_], paths[n][1][open_])
                lengths = piece_lengths(v.qp.knots, curve, arc, v.path.spacing, u)
                speed[n][open_], ok = self._speeds(v, knot[n][open_], lengths)
                feasible &= ok
            damping[open_] = damping_factor
            open_ = open_[~feasible]
            if len(open_) == 0:
                break
        feasible = np.ones(samples, dtype=np.bool_)
        feasible[open_] = False
        return Batch(
            tuple(v.vehicle for v in self.vehicles),
            warped,
            tuple(curve for curve, _ in paths),
            tuple(arc for _, arc in paths),
            tuple(knot),
            tuple(speed),
            tuple(v.path.spacing for v in self.vehicles),
            feasible,
            damping,
        )


def knots_on(warped: Floats, times: Floats, knots: SpeedKnots) -> Floats:
    """Knots (S, M) [s] of a vehicle at the warped times (S, K + 2) of `times` (K + 2,), linear within each primitive."""
    piece = np.append(knots.piece, knots.piece[-1])
    share = (knots.knot - times[piece]) / (times[piece + 1] - times[piece])
    return np.asarray(warped[:, piece] + share * (warped[:, piece + 1] - warped[:, piece]))


def piece_lengths(knots: SpeedKnots, curve: Floats, arc: Floats, spacing: float, anchor: Floats) -> Floats:
    """Lengths (S, G) [m] of the speed profile's constraints on each sample's own path, for anchors (S, K + 2) on the route."""
    if arc.shape[1] == 1:
        return np.zeros((len(anchor), len(knots.bounds)))
    at = np.empty(anchor.shape)
    arc_lengths(np.ascontiguousarray(curve), np.ascontiguousarray(arc), spacing, np.ascontiguousarray(anchor), at)
    return np.ascontiguousarray(at[:, knots.bounds[:, 1]] - at[:, knots.bounds[:, 0]])
