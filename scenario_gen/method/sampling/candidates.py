# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Candidate scenarios, many at a time, from standard normal numbers.

A candidate varies the planned encounter in three ways: across the routes, along them (a Gaussian process each, per vehicle),
and in time (the clock that all vehicles share). The speed is a spline on the template's clock that drives the displaced
path's own length, so the published speed is the rate of arc length, and acceleration is continuous.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenario_gen.method.sampling.deviations import soft_clipped
from scenario_gen.method.sampling.freedom import Freedom, onward, seconds_onward
from scenario_gen.method.sampling.path import BasePath, ClockRead, Displaced, SpeedDrawn, states
from scenario_gen.method.sampling.speed_profile.model import SpeedModel
from scenario_gen.method.sampling.time_warp import Clock, DT, template_times
from scenario_gen.method.sampling.window import Window
from scenario_gen.numerics import Bools, Floats, Ints, wrap_angle
from scenario_gen.types import Scenario, Vehicle

_APART = 0.05  # m, from which on two poses tell a curvature


@dataclass(frozen=True)
class Scale:
    """Factors on the standard deviations of a candidate: across the route, along it, in time, and of each vehicle's own clock."""

    lateral: float = 1.0
    longitudinal: float = 1.0
    time: float = 1.0
    own: float = 1.0


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
        return (
            int(self.lateral_root.shape[1])
            + self.speed.size
            + (self.freedom.size if self.freedom else 0)
        )

    def draw(self, z: Floats, scale: Scale, shared: Clock, nominal: Clock) -> "_Drawn":
        """Draw S candidates of this vehicle from numbers z (S, size), on the clocks that all share."""
        across, along = self.lateral_root.shape[1], self.lateral_root.shape[1] + self.speed.size
        deviation = (scale.lateral * z[:, :across]) @ self.lateral_root.T
        clock, vehicles, faster = shared, [self.vehicle] * len(z), np.zeros((len(z), 2))
        if self.freedom is not None:
            free = z[:, along:]
            own = self.freedom.clock.size
            clock = self.freedom.clock.sample(free[:, :own], scale.own, shared, nominal)
            deviation = deviation + scale.lateral * self.freedom.across(free[:, own])
            faster = scale.longitudinal * self.freedom.faster(
                free[:, own + 1 : own + 3], -0.8 * self.speed.mean[[0, -1]]
            )
            if scale.lateral == 1.0:
                vehicles = self.freedom.vehicles(free[:, own + 3], self.vehicle)
        curve, arc = self.path.displaced(soft_clipped(deviation, self.room))
        pace = clock.rate / nominal.rate
        cell = nearest_cell(clock, self.speed.time)
        ends = pace[:, nearest_cell(clock, self.speed.spline.breaks[[0, -1]])]
        if self.freedom is not None:
            ends = np.where(self.freedom.end_speed > 0.0, 1.0, ends)
        speed, ok = self.speed.draw(
            scale.longitudinal * z[:, across:along],
            arc[:, -1] - self.path.length,
            pace[:, cell],
            ends,
            faster,
        )
        return _Drawn(vehicles, clock, curve, arc, np.ascontiguousarray(speed), ok)


def curvature(two: Floats) -> Floats:
    """Curvature (S,) [1/m] between two states (S, 2, 5) that follow each other."""
    apart = np.hypot(*(two[:, 1, :2] - two[:, 0, :2]).T)
    return np.asarray(
        np.where(
            apart > _APART,
            wrap_angle(two[:, 1, 2] - two[:, 0, 2]) / np.maximum(apart, _APART),
            0.0,
        )
    )


def nearest_cell(clock: Clock, at: Floats) -> Ints:
    """Indices (k,) of the clock's grid that are nearest to template times (k,) [s]."""
    step = clock.grid[1] - clock.grid[0]
    return np.asarray(np.clip(np.round(at / step).astype(np.int64), 0, len(clock.grid) - 1))


_Read = tuple[Clock, ClockRead]  # a clock, and what it says at some times


@dataclass(frozen=True, eq=False)
class _Drawn:
    """What is drawn of one vehicle, see `Batch`; ok: (S,) whether a speed keeps what must hold."""

    vehicles: list[Vehicle]
    clock: Clock
    curve: Floats
    arc: Floats
    speed: Floats
    ok: Bools

    def states(
        self, model: VehicleModel, at: Floats, counts: Ints, read: _Read | None = None
    ) -> tuple[Floats, _Read]:
        """States (S, T, 5) at times (S, T) [s] on the clock, the first `counts` (S,) of them; and what was read of the clock."""
        if read is None or read[0] is not self.clock:  # a shared one is read once
            now = ClockRead(np.zeros(at.shape), np.ones(at.shape), np.zeros(at.shape), counts)
            template_times(self.clock.grid, self.clock.time, self.clock.rate, at, counts, *now[:3])
            read = self.clock, now
        out, spline = np.empty((*at.shape, 5)), model.speed.spline
        speed = SpeedDrawn(spline.breaks, spline.first, spline.pieces, self.speed)
        states(Displaced(self.curve, self.arc, model.path.spacing), speed, read[1], out)
        return out, read


@dataclass(frozen=True, eq=False)
class Batch:
    """S candidates of N vehicles.

    Attributes:
        models: the models of the vehicles.
        drawn: what is drawn of each.
        ends: (S, N, 2) when each comes to the start and to the end of its route [s], on its clock.
        at_ends: (N, S, 4, 5) its states there and 0.1 s behind and before, see `states`; None where nothing is free.
        begin: (S,) when a scenario begins [s], on the clocks.
        count: (S,) instants of the published grid.
        present: (S, N, 2) first and last of them at which each vehicle is there.
        feasible: (S,) False where no speed keeps what must hold.
    """

    models: tuple[VehicleModel, ...]
    drawn: tuple[_Drawn, ...]
    ends: Floats
    at_ends: Floats | None
    begin: Floats
    count: Ints
    present: Ints
    feasible: Bools

    @classmethod
    def of(
        cls,
        models: tuple[VehicleModel, ...],
        drawn: Sequence[_Drawn],
        window: tuple[Window, Floats] | None = None,
    ) -> "Batch":
        """Join what is drawn: a scenario is the stretch in which all are there who are there throughout the template.

        Who stands at an end of the template goes on standing; who is free there and drives goes straight on, while there is road.
        With a window, and its numbers (S, 2), a part of that stretch is left out.
        """
        ends = np.stack([
            one.clock.time[:, nearest_cell(one.clock, model.speed.spline.breaks[[0, -1]])]
            for model, one in zip(models, drawn, strict=True)
        ], axis=1)  # fmt: skip
        grid = drawn[0].clock.grid
        times = np.stack([model.speed.spline.breaks[[0, -1]] for model in models])
        there = np.column_stack([times[:, 0] <= grid[0] + 1e-9, times[:, 1] >= grid[-1] - 1e-9])
        reach, at_ends = ends.copy(), None
        if any(model.freedom is not None for model in models):
            four, near = np.full(len(ends), 4), np.array([0.0, DT, -DT, 0.0])
            numbered = enumerate(zip(models, drawn, strict=True))
            at_ends = np.stack(
                [
                    one.states(m, ends[:, n, [0, 0, 1, 1]] + near, four)[0]
                    for n, (m, one) in numbered
                ]
            )
            for n, model in enumerate(models):
                for end, sign in ((0, -1.0), (1, 1.0)):
                    if there[n, end] and model.speed.spline.still[-end]:
                        reach[:, n, end] = sign * np.inf
                    elif there[n, end] and model.freedom is not None:
                        reach[:, n, end] += sign * seconds_onward(
                            at_ends[n, :, -end], float(model.freedom.ahead[end]), sign
                        )
        begin = np.maximum(
            reach[:, there[:, 0], 0].max(axis=1, initial=-np.inf), ends[..., 0].min(axis=1)
        )
        end = np.minimum(
            reach[:, there[:, 1], 1].min(axis=1, initial=np.inf), ends[..., 1].max(axis=1)
        )
        if window is not None:
            kept = np.stack(
                [one.clock.time[:, nearest_cell(one.clock, window[0].between)] for one in drawn]
            )
            span = np.column_stack([begin, end])
            begin, end = (
                window[0]
                .cut(
                    window[1],
                    np.column_stack([kept[..., 0].min(axis=0), kept[..., 1].max(axis=0)]),
                    span,
                )
                .T
            )
        ends_shown = ends.copy()
        ends_shown[:, there[:, 0], 0], ends_shown[:, there[:, 1], 1] = begin[:, None], end[:, None]
        count = np.floor((end - begin) / DT + 1e-6).astype(np.int64) + 1
        at = (ends_shown - begin[:, None, None]) / DT
        present = np.stack(
            [np.ceil(at[..., 0] - 1e-6), np.floor(at[..., 1] + 1e-6)], axis=-1
        ).astype(np.int64)
        present = np.clip(present, 0, np.maximum(count - 1, 0)[:, None, None])
        feasible = np.logical_and.reduce([one.ok for one in drawn])
        feasible &= (count >= 2) & (present[..., 1] > present[..., 0]).all(axis=1)
        return cls(models, tuple(drawn), ends, at_ends, begin, count, present, feasible)

    def states(self, time: Floats, count: Sequence[int] | None = None) -> Floats:
        """States (N, S, T, 5) x, y [m], yaw [rad, not unwrapped], speed [m/s], acceleration [m/s²] at ascending times (T,) [s].

        Times count from the scenario's begin. Of a candidate only the first `count` are filled.
        """
        samples = len(self.feasible)
        counts = (
            np.full(samples, len(time)) if count is None else np.asarray(count, dtype=np.int64)
        )
        at = time + self.begin[:, None]
        out = np.empty((len(self.models), samples, len(time), 5))
        read: _Read | None = None
        for n, (model, one) in enumerate(zip(self.models, self.drawn, strict=True)):
            out[n], read = one.states(model, at, counts, read)
            if self.at_ends is None:
                continue
            for end, sign in ((0, -1.0), (1, 1.0)):
                since = np.maximum(sign * (at - self.ends[:, n, end : end + 1]), 0.0)
                beyond = np.flatnonzero((since > 0.0).any(axis=0))
                if len(beyond) and not model.speed.spline.still[-end]:
                    since, state = since[:, beyond], self.at_ends[n][:, -end]
                    further = onward(
                        state, curvature(self.at_ends[n][:, 2 * end : 2 * end + 2]), since, sign
                    )
                    out[n][:, beyond] = np.where(
                        (since > 0.0)[..., None], further, out[n][:, beyond]
                    )
        return out

    def scenarios(self, seed: int, index: Sequence[int], frame_id: str) -> list[Scenario | None]:
        """The candidates on the published grid; None where infeasible."""
        time = np.round(np.arange(max(int(self.count.max()), 2)) * DT, 9)
        out = self.states(time, np.maximum(self.count, 0).tolist())
        results: list[Scenario | None] = []
        for s, (ok, count) in enumerate(
            zip(self.feasible.tolist(), self.count.tolist(), strict=True)
        ):
            if not ok:
                results.append(None)
                continue
            t, (x, y, yaw, speed, acceleration) = (
                time[:count],
                np.moveaxis(out[:, s, :count], -1, 0),
            )
            position, vehicles = (
                np.stack([x, y], axis=-1),
                tuple(one.vehicles[s] for one in self.drawn),
            )
            results.append(
                Scenario(
                    vehicles,
                    t,
                    position,
                    yaw,
                    speed,
                    acceleration,
                    seed,
                    index[s],
                    frame_id,
                    present=self.present[s],
                )
            )
        return results
