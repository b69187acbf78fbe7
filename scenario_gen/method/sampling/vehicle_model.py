# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One vehicle of a candidate: its path, clock and speed from standard normal numbers.

A vehicle deviates from its plan across the route and along it (a Gaussian process each), and in
time. The speed is a spline on the template's clock that drives the length of the displaced path,
so the published speed is the rate of arc length, and acceleration is continuous.
"""

from dataclasses import dataclass, field

import numpy as np

from scenario_gen.method.sampling.deviations import soft_clipped
from scenario_gen.method.sampling.numbers import VehicleNumbers
from scenario_gen.method.sampling.path import BasePath, DisplacedPaths, fill_states, SpeedSamples
from scenario_gen.method.sampling.speed_profile.model import SpeedModel
from scenario_gen.method.sampling.time_warp import Clock, ClockSamples
from scenario_gen.method.sampling.variation import Variation
from scenario_gen.numerics import Bools, Floats, freeze, Ints
from scenario_gen.types import Vehicle


@dataclass(frozen=True)
class NoiseScale:
    """Factors on the standard deviations of a candidate.

    Attributes:
        lateral: across the route.
        longitudinal: along it.
        time: of the clock that all vehicles share.
        vehicle_clock: of each vehicle's clock.
    """

    lateral: float = 1.0
    longitudinal: float = 1.0
    time: float = 1.0
    vehicle_clock: float = 1.0


@dataclass(frozen=True, eq=False)
class VehicleModel:
    """All that is the same for every candidate of one vehicle.

    Attributes:
        vehicle: identity and footprint.
        path: the route.
        lateral_root: (G, r) square root of the covariance of the lateral deviation.
        room: (G,) metres that the road leaves to either side.
        speed: draws its speeds.
        variation: what else varies; None with `sampling.drivers=0`.
        numbers: the layout of its standard normal numbers.
    """

    vehicle: Vehicle
    path: BasePath
    lateral_root: Floats
    room: Floats
    speed: SpeedModel
    variation: Variation | None = None
    numbers: VehicleNumbers = field(init=False)

    def __post_init__(self) -> None:
        clock, strength = None, 0
        if self.variation is not None:
            clock = self.variation.clock.count
            strength = 2 if self.variation.strength > 0.0 else 0
        numbers = VehicleNumbers.of(self.lateral_root.shape[1], self.speed.count, clock, strength)
        freeze(self, numbers=numbers)

    @property
    def driver_gaps(self) -> slice:
        """The numbers of its driver's gaps, which are not explained by those it reacts to."""
        clock = self.numbers.clock
        count = 0 if self.variation is None else len(self.variation.clock.gaps)
        return slice(clock.stop - count, clock.stop)

    @property
    def span(self) -> Floats:
        """(2,) template times [s] at which it enters and leaves."""
        return np.asarray(self.speed.spline.breaks[[0, -1]])

    def stands_at(self, end: int) -> bool:
        """Return whether it stands at the start (0) or the end (1) of its route."""
        return bool(self.speed.spline.still[-end])

    def sample(
        self, z: Floats, scale: NoiseScale, shared: Clock, nominal: Clock
    ) -> "VehicleSamples":
        """Return S samples.

        Args:
            z: (S, numbers.total) standard normal numbers.
            scale: factors on the standard deviations.
            shared: S clocks that all vehicles share.
            nominal: the clock without deviation.
        """
        numbers, variation = self.numbers, self.variation
        deviation = (scale.lateral * z[:, numbers.lateral]) @ self.lateral_root.T
        clock, vehicles, faster = shared, [self.vehicle] * len(z), np.zeros((len(z), 2))
        log_strength = None
        if variation is not None:
            clock = variation.clock.sample(
                z[:, numbers.clock], scale.vehicle_clock, shared, nominal
            )
            place = variation.lateral_offset(z[:, numbers.place])
            deviation = deviation + scale.lateral * place
            change = variation.end_speed_change(z[:, numbers.end_speeds], self.speed.mean[[0, -1]])
            faster = scale.longitudinal * change
            if variation.strength > 0.0:
                log_strength = variation.log_strength(z[:, numbers.strength])
            if scale.lateral == 1.0:
                vehicles = variation.resized(z[:, numbers.size], self.vehicle)
        paths = self.path.displaced(soft_clipped(deviation, self.room))

        pace = clock.rate / nominal.rate
        end_pace = pace[:, clock.nearest(self.span)]
        if variation is not None:
            end_pace = np.where(variation.end_speed > 0.0, 1.0, end_pace)
        speed, feasible = self.speed.draw(
            scale.longitudinal * z[:, numbers.speed],
            paths.arc[:, -1] - self.path.length,
            pace[:, clock.nearest(self.speed.time)],
            end_pace,
            faster,
            log_strength,
        )
        spline = self.speed.spline
        speeds = SpeedSamples(
            spline.breaks, spline.first, spline.pieces, np.ascontiguousarray(speed)
        )
        return VehicleSamples(vehicles, clock, paths, speeds, feasible)


@dataclass(frozen=True, eq=False)
class VehicleSamples:
    """S sampled motions of one vehicle.

    Attributes:
        vehicles: identity and footprint in each.
        clock: S clocks.
        paths: S paths.
        speeds: S speeds on the template's clock.
        feasible: (S,) whether a speed meets all its conditions.
    """

    vehicles: list[Vehicle]
    clock: Clock
    paths: DisplacedPaths
    speeds: SpeedSamples
    feasible: Bools

    def states(self, at: Floats, counts: Ints) -> Floats:
        """Return states (S, T, 5) at ascending times (S, T) [s] on the samples' clocks.

        Args:
            at: scenario times [s].
            counts: (S,) number of instants of each sample that are filled.
        """
        out = np.empty((*at.shape, 5))
        fill_states(self.paths, self.speeds, ClockSamples.of(self.clock, at, counts), out)
        return out
