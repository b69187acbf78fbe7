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
from scenario_gen.sampling.freedom import Freedom
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
        freedom: what else is free; None with preset `narrow`.
    """

    vehicle: Vehicle
    path: BasePath
    lateral_root: Floats
    room: Floats
    speed: SpeedModel
    freedom: Freedom | None = None

    @property
    def size(self) -> int:
        """Standard normal numbers needed per candidate."""
        return int(self.lateral_root.shape[1]) + self.speed.size + (self.freedom.size if self.freedom else 0)

    def draw(self, z: Floats, scale: Scale, shared: Clock, nominal: Clock) -> "_Drawn":
        """Draw S candidates of this vehicle from numbers z (S, size), on the clocks that all share."""
        across, along = self.lateral_root.shape[1], self.lateral_root.shape[1] + self.speed.size
        deviation = exact.matmul(scale.lateral * z[:, :across], self.lateral_root.T)
        clock, vehicles, faster = shared, [self.vehicle] * len(z), np.zeros((len(z), 2))
        if self.freedom is not None:
            free = z[:, along:]
            own = self.freedom.clock.size
            clock = self.freedom.clock.sample(free[:, :own], scale.time, shared, nominal)
            deviation = deviation + scale.lateral * self.freedom.across(free[:, own])
            faster = scale.longitudinal * self.freedom.faster(free[:, own + 1 : own + 3], -0.8 * self.speed.mean[[0, -1]])
            if scale.lateral == 1.0:
                vehicles = self.freedom.vehicles(free[:, own + 3], self.vehicle)
        curve, arc = self.path.displaced(soft_clipped(deviation, self.room))
        pace = clock.rate / nominal.rate
        cell = nearest_cell(clock, self.speed.time)
        ends = pace[:, nearest_cell(clock, self.speed.spline.breaks[[0, -1]])]
        if self.freedom is not None:
            ends = np.where(self.freedom.end_speed > 0.0, 1.0, ends)
        speed, ok = self.speed.draw(
            scale.longitudinal * z[:, across:along], arc[:, -1] - self.path.length, pace[:, cell], ends, faster
        )
        return _Drawn(vehicles, clock, curve, arc, np.ascontiguousarray(speed), ok)


def nearest_cell(clock: Clock, at: Floats) -> Ints:
    """Indices of the clock's grid that are nearest to template times [s]."""
    step = clock.grid[1] - clock.grid[0]
    return np.asarray(np.clip(np.round(at / step).astype(np.int64), 0, len(clock.grid) - 1))


@dataclass(frozen=True, eq=False)
class _Drawn:
    """What is drawn of one vehicle, see `Batch`; ok: (S,) whether a speed keeps what must hold."""

    vehicles: list[Vehicle]
    clock: Clock
    curve: Floats
    arc: Floats
    speed: Floats
    ok: Bools


@dataclass(frozen=True, eq=False)
class Batch:
    """S candidates of N vehicles.

    Attributes:
        models: the models of the vehicles.
        vehicles: (N, S) the vehicles themselves.
        clock: per vehicle, (S, G) clocks; the same one where they share it.
        begin: (S,) when a scenario begins [s], on the clocks.
        count: (S,) instants of the published grid.
        present: (S, N, 2) first and last of them at which each vehicle is there.
        curve, arc: per vehicle, the paths: (S, G, 4) x, y, dx/du, dy/du at the nodes of a cubic spline, (S, G) arc lengths [m].
        speed: per vehicle, (S, n) coefficients [m/s].
        feasible: (S,) False where no speed keeps what must hold.
    """

    models: tuple[VehicleModel, ...]
    vehicles: tuple[list[Vehicle], ...]
    clock: tuple[Clock, ...]
    begin: Floats
    count: Ints
    present: Ints
    curve: tuple[Floats, ...]
    arc: tuple[Floats, ...]
    speed: tuple[Floats, ...]
    feasible: Bools

    @classmethod
    def of(cls, models: tuple[VehicleModel, ...], drawn: Sequence[_Drawn]) -> "Batch":
        """Join what is drawn: a scenario is the stretch in which all are there who are there throughout the template.

        Who stands at an end of the template goes on standing.
        """
        ends = np.stack([
            one.clock.time[:, nearest_cell(one.clock, model.speed.spline.breaks[[0, -1]])]
            for model, one in zip(models, drawn, strict=True)
        ], axis=1)  # fmt: skip
        grid = drawn[0].clock.grid
        times = np.stack([model.speed.spline.breaks[[0, -1]] for model in models])
        still = np.stack([model.speed.spline.still[[0, -1]] for model in models])
        there = np.column_stack([times[:, 0] <= grid[0] + 1e-9, times[:, 1] >= grid[-1] - 1e-9])
        first, last = (there & ~still).T
        begin = ends[:, first, 0].max(axis=1) if first.any() else ends[:, there[:, 0], 0].min(axis=1, initial=0.0)
        end = ends[:, last, 1].min(axis=1) if last.any() else ends[:, :, 1].max(axis=1)
        ends[:, there[:, 0] & still[:, 0], 0] = begin[:, None]
        ends[:, there[:, 1] & still[:, 1], 1] = end[:, None]
        count = np.floor((end - begin) / DT + 1e-6).astype(np.int64) + 1
        at = (ends - begin[:, None, None]) / DT
        present = np.stack([np.ceil(at[..., 0] - 1e-6), np.floor(at[..., 1] + 1e-6)], axis=-1).astype(np.int64)
        present = np.clip(present, 0, np.maximum(count - 1, 0)[:, None, None])
        feasible = np.logical_and.reduce([one.ok for one in drawn])
        feasible &= (count >= 2) & (present[..., 1] > present[..., 0]).all(axis=1)
        return cls(
            models, tuple(one.vehicles for one in drawn), tuple(one.clock for one in drawn), begin, count, present,
            tuple(one.curve for one in drawn), tuple(one.arc for one in drawn), tuple(one.speed for one in drawn), feasible,
        )  # fmt: skip

    def states(self, time: Floats, count: Sequence[int] | None = None) -> Floats:
        """States (N, S, T, 5) x, y [m], yaw [rad, not unwrapped], speed [m/s], acceleration [m/s²] at ascending times (T,) [s].

        Times count from the scenario's begin. Of a candidate only the first `count` are filled.
        """
        samples = len(self.feasible)
        counts = np.full(samples, len(time)) if count is None else np.asarray(count, dtype=np.int64)
        at = time + self.begin[:, None]
        out = np.empty((len(self.models), samples, len(time), 5))
        before: Clock | None = None
        for n, (v, clock) in enumerate(zip(self.models, self.clock, strict=True)):
            if clock is not before:  # a shared one is read once
                tau, pace, slope = np.zeros_like(at), np.ones_like(at), np.zeros_like(at)
                template_times(clock.grid, clock.time, clock.rate, at, counts, tau, pace, slope)
                before = clock
            spline = v.speed.spline
            states(
                self.curve[n], self.arc[n], v.path.spacing, spline.breaks, spline.first, spline.pieces, self.speed[n],
                tau, pace, slope, counts, out[n],
            )  # fmt: skip
        return out

    def scenarios(self, seed: int, index: Sequence[int], frame_id: str) -> list[Scenario | None]:
        """The candidates on the published grid; None where infeasible."""
        time = np.round(np.arange(max(int(self.count.max()), 2)) * DT, 9)
        out = self.states(time, np.maximum(self.count, 0).tolist())
        made: list[Scenario | None] = []
        for s, (ok, count) in enumerate(zip(self.feasible.tolist(), self.count.tolist(), strict=True)):
            if not ok:
                made.append(None)
                continue
            t, (x, y, yaw, speed, acceleration) = time[:count], np.moveaxis(out[:, s, :count], -1, 0)
            position, vehicles = np.stack([x, y], axis=-1), tuple(own[s] for own in self.vehicles)
            made.append(Scenario(vehicles, t, position, yaw, speed, acceleration, seed, index[s], frame_id, self.present[s]))
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
        drawn = [
            v.draw(z[:, a:b], scale, clock, self.warp.nominal)
            for v, (a, b) in zip(self.vehicles, pairwise(parts.tolist()), strict=True)
        ]
        return Batch.of(self.vehicles, drawn)
