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

A candidate varies the planned encounter in three ways: across the routes, along them (a Gaussian process each, per vehicle),
and in time (the clock that all vehicles share). The speed is a spline on the template's clock that drives the displaced
path's own length, so the published speed is the rate of arc length, and acceleration is continuous.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from scenario_gen import exact
from scenario_gen.arrays import Bools, Floats, Ints
from scenario_gen.sampling.deviations import soft_clipped
from scenario_gen.sampling.path import BasePath, states
from scenario_gen.sampling.speed_profile.model import SpeedModel
from scenario_gen.sampling.time_warp import Clock, DT, template_times, TimeWarp
from scenario_gen.types.encounter import Vehicle
from scenario_gen.types.scenario import Scenario


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
        lateral_root: (G, r) square root of the covariance of the lateral deviation.
        room: (G,) metres that the road leaves to either side.
        speed: draws its speeds.
    """

    vehicle: Vehicle
    path: BasePath
    lateral_root: Floats
    room: Floats
    speed: SpeedModel

    @property
    def size(self) -> int:
        """Standard normal numbers needed per candidate."""
        return int(self.lateral_root.shape[1]) + self.speed.size

    def deviations(self, z: Floats) -> Floats:
        """Return how far each sample is to the side (S, G) [m]."""
        return soft_clipped(exact.matmul(z, self.lateral_root.T), self.room)


@dataclass(frozen=True, eq=False)
class Batch:
    """S candidates of N vehicles.

    Attributes:
        vehicles: the models of the vehicles.
        clock: (S, G) clocks.
        curve, arc: per vehicle, the paths: (S, G, 4) x, y, dx/du, dy/du at the nodes of a cubic spline, (S, G) arc lengths [m].
        speed: per vehicle, (S, n) coefficients [m/s].
        feasible: (S,) False where no speed keeps what must hold.
    """

    vehicles: tuple[VehicleModel, ...]
    clock: Clock
    curve: tuple[Floats, ...]
    arc: tuple[Floats, ...]
    speed: tuple[Floats, ...]
    feasible: Bools

    def present(self) -> Ints:
        """(S, N, 2) first and last instant of the published grid at which each vehicle is there."""
        ends = np.stack([v.speed.spline.breaks[[0, -1]] for v in self.vehicles])
        grid = self.clock.grid
        cell = np.clip(np.round(ends / (grid[1] - grid[0])).astype(np.int64), 0, len(grid) - 1)
        at = self.clock.time[:, cell] / DT
        return np.stack([np.ceil(at[..., 0] - 1e-6), np.floor(at[..., 1] + 1e-6)], axis=-1).astype(np.int64)

    def states(self, time: Floats, count: Sequence[int] | None = None) -> Floats:
        """States (N, S, T, 5) x, y [m], yaw [rad, not unwrapped], speed [m/s], acceleration [m/s²] at ascending times (T,) [s].

        Of a candidate only the first `count` are filled.
        """
        samples = len(self.feasible)
        counts = np.full(samples, len(time)) if count is None else np.asarray(count, dtype=np.int64)
        at = np.broadcast_to(time, (samples, len(time))).copy()
        tau, pace, slope = np.zeros_like(at), np.ones_like(at), np.zeros_like(at)
        template_times(self.clock.grid, self.clock.time, self.clock.rate, at, counts, tau, pace, slope)
        out = np.empty((len(self.vehicles), samples, len(time), 5))
        for n, v in enumerate(self.vehicles):
            spline = v.speed.spline
            states(
                self.curve[n], self.arc[n], v.path.spacing, spline.breaks, spline.first, spline.pieces, self.speed[n],
                tau, pace, slope, counts, out[n],
            )  # fmt: skip
        return out

    def scenarios(self, seed: int, index: Sequence[int], frame_id: str) -> list[Scenario | None]:
        """The candidates on the published grid; None where infeasible."""
        count = np.round(self.clock.time[:, -1] / DT).astype(np.int64) + 1
        time = np.round(np.arange(count.max()) * DT, 9)
        out = self.states(time, count.tolist())
        vehicles, present = tuple(v.vehicle for v in self.vehicles), self.present()
        made: list[Scenario | None] = []
        for s, ok in enumerate(self.feasible):
            t, (x, y, yaw, speed, acceleration) = time[: count[s]], np.moveaxis(out[:, s, : count[s]], -1, 0)
            position = np.stack([x, y], axis=-1)
            made.append(
                Scenario(vehicles, t, position, yaw, speed, acceleration, seed, index[s], frame_id, present[s]) if ok else None
            )
        return made


class CandidateModel:
    """Draws candidates of one encounter on its routes.

    Source: paper III-C.
    """

    def __init__(self, vehicles: tuple[VehicleModel, ...], warp: TimeWarp) -> None:
        self.vehicles, self.warp = vehicles, warp

    @property
    def size(self) -> int:
        """Standard normal numbers needed per candidate."""
        return self.warp.size + sum(int(v.size) for v in self.vehicles)

    def draw(self, z: Floats, scale: Scale) -> Batch:
        """Candidates from numbers z (S, size), their standard deviations multiplied by `scale`."""
        parts = np.cumsum([self.warp.size] + [v.size for v in self.vehicles])
        clock = self.warp.sample(z[:, : self.warp.size], scale.time)
        pace = clock.rate / self.warp.nominal.rate
        feasible = np.ones(len(z), dtype=np.bool_)
        curves, arcs, speeds = [], [], []
        for v, (a, b) in zip(self.vehicles, pairwise(parts.tolist()), strict=True):
            across = v.lateral_root.shape[1]
            curve, arc = v.path.displaced(v.deviations(scale.lateral * z[:, a : a + across]))
            longer = arc[:, -1] - v.path.length
            cell = np.clip(np.round(v.speed.time / clock.grid[1]).astype(np.int64), 0, len(clock.grid) - 1)
            ends = np.clip(np.round(v.speed.spline.breaks[[0, -1]] / clock.grid[1]).astype(np.int64), 0, len(clock.grid) - 1)
            speed, ok = v.speed.draw(scale.longitudinal * z[:, a + across : b], longer, pace[:, cell], pace[:, ends])
            feasible &= ok
            curves.append(curve)
            arcs.append(arc)
            speeds.append(np.ascontiguousarray(speed))
        return Batch(self.vehicles, clock, tuple(curves), tuple(arcs), tuple(speeds), feasible)
