# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The variation between drivers: each vehicle's clock, place in the lane, end speeds and size.

Every vehicle has a clock: the shared one, shifted by a_n, faster or slower by a share p_n, and
standing longer or shorter by q_n in each wait. A scenario lasts while all clocks run, so one
mechanism varies where and how fast a vehicle starts, the order of arrival, the duration of waits,
and the begin and end of the scenario. Requested states are kept: where a start or an end state is
requested of any vehicle, shift and pace of all clocks fade out. A wait of another length still
moves the end of its vehicle; where ends are requested, the checker refuses too large a change.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from scenario_gen.method.sampling.config import SamplingConfig
from scenario_gen.method.sampling.driver_gaps import driver_gaps, DriverGap, Ramp
from scenario_gen.method.sampling.time_warp import (
    Clock,
    MAX_RATE_RATIO,
    MIN_RATE_RATIO,
    smooth_step,
)
from scenario_gen.method.sampling.trimming import max_trimmed_time
from scenario_gen.method.validity import Limits
from scenario_gen.numerics import Bools, Floats
from scenario_gen.situation import Situation
from scenario_gen.types import BoundaryStates, CAR, Reaction, Request, Vehicle

CAR_SIZES = np.array([
    (3.60, 1.62), (4.05, 1.75), (4.25, 1.79), (4.46, 1.83),
    (4.63, 1.83), (4.69, 1.85), (4.77, 1.88), (4.96, 1.93),
])  # fmt: skip
"""Lengths and widths [m] of cars, equally likely: typical ones, from a city car to a saloon."""


@dataclass(frozen=True)
class _Tuning:
    """Choices without a source in the paper.

    Attributes:
        car_length: m; vehicles with a length in between get the size of another car.
        lengthening: largest lengthening over the smallest recorded gap: cars queue closely.
        clock_fade: s over which a vehicle's clock joins the shared one at requested states.
        fade_share: the same over the duration, or over the route for the place, at most.
        place_fade: m over which a vehicle leaves its planned place in the lane.
        min_stand: s that remain of a wait.
        wait_shortening: largest shortening over the wait's duration: clocks run forward.
        wait_recovery: longest extra wait per remaining second: half the allowed speed-up over the
            peak slope 1.875 of the smooth step.
        end_speed_slack: m/s by which an end speed may exceed its stated bounds.
        slower_end: m/s by which a vehicle is slower at its end, at most: nothing explains more.
        min_end_speed_share: of the mean speed, left at an end however slow it is drawn.
    """

    car_length: tuple[float, float] = (3.2, 5.4)
    lengthening: float = 0.15
    clock_fade: float = 6.0
    fade_share: float = 1.0 / 3.0
    place_fade: float = 30.0
    min_stand: float = 1.5
    wait_shortening: float = 0.3
    wait_recovery: float = 0.5 * (1.0 - MIN_RATE_RATIO) / 1.875
    end_speed_slack: float = 0.5
    slower_end: float = 1.0
    min_end_speed_share: float = 0.2


_TUNING = _Tuning()


def truncate(z: Floats, bound: float) -> Floats:
    """Return truncated normal numbers of the same shape and probability, within +-bound."""
    low = special.ndtr(np.array(-bound))
    return np.asarray(special.ndtri(low + (1.0 - 2.0 * low) * special.ndtr(z)))


def relaxed_states(
    requested: BoundaryStates, situation: Situation, config: SamplingConfig, request: Request
) -> BoundaryStates:
    """Return the states with their tolerances: 0 where a state was requested, or nothing varies.

    A vehicle that starts later or earlier starts as far along its lane as it drives in that time.
    """
    encounter = situation.encounter
    relaxed = np.zeros((len(encounter.vehicles), 2, 2))
    if config.drivers == 0.0:
        return replace(requested, relaxed=relaxed) if requested.relaxed.any() else requested
    config = config.scaled
    fixed = _requested_ends(request, situation, config)
    slowest = 1.0 / MIN_RATE_RATIO
    seconds = slowest * _max_time_shift(situation, config)
    steps = np.maximum(np.ceil(seconds / encounter.dt).astype(np.int64), 1).tolist()
    across = config.freedom * config.place_sigma
    for n, vehicle in enumerate(encounter.vehicles):
        recorded = encounter.speed[n, encounter.present_slice(n)]
        sigma = config.of(vehicle.kind).end_speed_sigma
        faster = config.freedom * sigma
        near = (recorded[: steps[0] + 1], recorded[-steps[1] - 1 :])
        for end, states in enumerate((requested.start, requested.end)):
            if fixed[end, n]:
                continue
            speed = float(states[n, 3])
            top, least = max(float(near[end].max()), speed), float(near[end].min())
            metres, change = across, faster + _TUNING.end_speed_slack
            if not fixed[end].any():
                metres += seconds[end] * (top + faster)
                change += max(slowest * top - speed, speed - least)
            relaxed[n, end] = metres, change
    return replace(requested, relaxed=np.ceil(1000.0 * relaxed) / 1000.0)


def _requested_ends(request: Request, situation: Situation, config: SamplingConfig) -> Bools:
    """Return whether the start and the end state of each vehicle are requested (2, N)."""
    encounter = situation.encounter
    rows = [np.isfinite(request.rows(end, encounter)).any(axis=1) for end in ("starts", "goals")]
    fixed = np.array(rows)
    ego = request.ego_of(encounter)
    if ego is not None and config.ego == "keep":
        fixed[:, ego] = True
    return fixed


def _max_time_shift(situation: Situation, config: SamplingConfig) -> Floats:
    """Return by how many seconds (2,) start and end of a vehicle may shift on its route."""
    duration = situation.encounter.duration
    spread = 2.0 * (config.arrival_sigma + 0.5 * duration * config.pace_sigma) + config.wait_sigma
    spread += config.gap_sigma
    trimmed = max_trimmed_time(situation, config.leave_out)
    return np.asarray(config.freedom * spread + config.duration_tolerance * duration + trimmed)


@dataclass(frozen=True, eq=False)
class VehicleClock:
    """How the clock of one vehicle differs from the shared one.

    Attributes:
        basis: (2 + W + E, G) seconds at template times: of a shift by one second (1, but 0 at
            requested states), of a pace slower by 1, of one second more in each wait, and of one
            second of each driver gap.
        rates: (2 + W + E, G) their derivatives.
        recovery: (W, G) the part of `rates` by which a wait is made up for, at a requested end.
        sigma: (2 + W + E,) standard deviations of shift [s], pace and waits [s]; 1 of driver gaps.
        low, high: (W,) bounds of the waits' changes [s].
        bound: standard deviations at which all are truncated.
        gaps: how its driver differs from the recorded one, in E reactions.
    """

    basis: Floats
    rates: Floats
    recovery: Floats
    sigma: Floats
    low: Floats
    high: Floats
    bound: float
    gaps: tuple[DriverGap, ...]

    @classmethod
    def of(
        cls,
        nominal: Clock,
        rests: Sequence[tuple[float, float]],
        fixed: Sequence[bool],
        config: SamplingConfig,
        edges: Sequence[Reaction],
        limits: Limits,
    ) -> "VehicleClock":
        """Prepare the clock of a vehicle.

        Args:
            nominal: the clock without deviation.
            rests: begin and end [s] of its stands, on the template's clock.
            fixed: whether start and end states are requested of any vehicle.
            config: the standard deviations.
            edges: the reactions of the vehicle.
            limits: of the certificate.
        """
        grid = nominal.grid
        ramp = min(_TUNING.clock_fade, _TUNING.fade_share * float(grid[-1]))
        shift, shift_rate = np.ones(len(grid)), np.zeros(len(grid))
        distances = ((grid - grid[0], 1.0), (grid[-1] - grid, -1.0))
        for is_fixed, (since, sign) in zip(fixed, distances, strict=True):
            if is_fixed:
                value, rate = smooth_step(since / ramp)
                shift_rate = shift_rate * value + shift * sign * rate / ramp
                shift = shift * value
        centred = nominal.time - 0.5 * nominal.time[-1]
        pace, pace_rate = centred * shift, centred * shift_rate + nominal.rate * shift

        waits, wait_rates, recovery = np.zeros((3, len(rests), len(grid)))
        for k, (begin, end) in enumerate(rests):
            value, rate = smooth_step((grid - begin) / (end - begin))
            waits[k], wait_rates[k] = value, rate / (end - begin)
            if fixed[1]:
                left = max(grid[-1] - end, 1e-9)
                value, rate = smooth_step((grid[-1] - grid) / left)
                recovery[k] = -waits[k] * rate / left
                waits[k] *= value
                wait_rates[k] = wait_rates[k] * value + recovery[k]

        length = np.array([end - begin for begin, end in rests])
        left = np.array([grid[-1] - end if fixed[1] else np.inf for _, end in rests])
        recoverable = _TUNING.wait_recovery * left
        longest = np.minimum(config.freedom * config.wait_sigma, recoverable)
        spare = np.minimum(_TUNING.wait_shortening * length, length - _TUNING.min_stand)
        shortest = np.minimum(np.maximum(spare, 0.0), np.minimum(recoverable, longest))
        sigmas = [config.arrival_sigma, config.pace_sigma] + [config.wait_sigma] * len(rests)
        gaps = tuple(driver_gaps(edges, Ramp(grid, shift, shift_rate), rests, config, limits))
        return cls(
            np.vstack([shift, pace, waits, *(gap.basis for gap in gaps)]),
            np.vstack([shift_rate, pace_rate, wait_rates, *(gap.rate for gap in gaps)]),
            recovery,
            np.array(sigmas + [1.0] * len(gaps)),
            -shortest,
            longest,
            config.freedom,
            gaps,
        )

    @property
    def count(self) -> int:
        """Standard normal numbers per sample."""
        return len(self.sigma)

    def effective(self, z: Floats, scale: float) -> Floats:
        """Return numbers (S, count) with the effect of z (S, count) after truncation."""
        truncated, gaps = truncate(z, self.bound), len(self.recovery) + 2
        waits = slice(2, gaps)
        unit = np.maximum(scale * self.sigma[waits], 1e-9)
        truncated[:, waits] = np.clip(truncated[:, waits], self.low / unit, self.high / unit)
        for k, gap in enumerate(self.gaps, gaps):
            truncated[:, k] = gap.delay(z[:, k])
        return truncated

    def sample(self, z: Floats, scale: float, shared: Clock, nominal: Clock) -> Clock:
        """Return S clocks of the vehicle.

        Args:
            z: (S, count) standard normal numbers.
            scale: factor on the deviations.
            shared: S clocks that all vehicles share.
            nominal: the clock without deviation.
        """
        offsets = scale * self.sigma * self.effective(z, scale)
        drift, waits = offsets[:, :2], offsets[:, 2:]  # with the gaps
        rate = drift @ self.rates[:2]
        running = shared.rate + waits[:, : len(self.recovery)] @ self.recovery
        slowing = running - MIN_RATE_RATIO * nominal.rate
        room = np.where(rate < 0.0, slowing, MAX_RATE_RATIO * nominal.rate - running)
        share = np.maximum(room, 0.0) / np.maximum(np.abs(rate), 1e-9)
        damping = np.clip(share.min(axis=1), 0.0, 1.0)[:, None]
        return Clock(
            shared.grid,
            shared.time + damping * (drift @ self.basis[:2]) + waits @ self.basis[2:],
            shared.rate + damping * rate + waits @ self.rates[2:],
        )


@dataclass(frozen=True, eq=False)
class Variation:
    """The variation of one vehicle, in addition to the deviations from its route.

    Attributes:
        clock: its clock.
        place: (G,) share of its place in the lane at the nodes of its route: 1, but 0 where its
            state is requested.
        place_sigma: standard deviation of the place [m].
        end_speed: (2,) standard deviations of start and end speed [m/s].
        strength: standard deviation of the logarithm of braking and of acceleration.
        bound: standard deviations at which all are truncated.
        sizes: (C, 2) lengths and widths [m] to choose from; empty to keep the recorded size.
        ahead: (2,) metres of free road straight on before its route and behind it; 0 where a state
            is requested.
    """

    clock: VehicleClock
    place: Floats
    place_sigma: float
    end_speed: Floats
    strength: float
    bound: float
    sizes: Floats
    ahead: Floats

    @classmethod
    def of(
        cls,
        vehicle: Vehicle,
        arc: Floats,
        clock: VehicleClock,
        relaxed: Floats,
        ahead: Floats,
        gap: float,
        config: SamplingConfig,
    ) -> "Variation":
        """Prepare the variation of a vehicle.

        Args:
            vehicle: identity and footprint.
            arc: (G,) arc lengths [m] of its route's nodes.
            clock: its clock.
            relaxed: (2, 2) metres and m/s by which its start and end may vary.
            ahead: (2,) metres of free road straight on, 0 at requested states.
            gap: metres to the nearest vehicle in the template.
            config: the standard deviations.
        """
        ramp = max(min(_TUNING.place_fade, _TUNING.fade_share * float(arc[-1])), 1e-9)
        place = np.ones(len(arc)) if len(arc) > 1 else np.zeros(1)
        for free, since in zip(relaxed[:, 0] > 0.0, (arc - arc[0], arc[-1] - arc), strict=True):
            if not free:
                place = place * smooth_step(since / ramp)[0]
        low, high = _TUNING.car_length
        resizes = (
            config.sizes == "catalogue"
            and vehicle.type == CAR
            and low <= vehicle.length <= high
            and len(arc) > 1
            and relaxed[:, 0].min() > 0.0
        )
        longest = vehicle.length + max(_TUNING.lengthening * gap, 0.0) if resizes else 0.0
        return cls(
            clock,
            place,
            config.place_sigma,
            np.where(relaxed[:, 1] > 0.0, config.end_speed_sigma, 0.0),
            config.strength_sigma,
            config.freedom,
            CAR_SIZES[CAR_SIZES[:, 0] <= longest],
            ahead,
        )

    def lateral_offset(self, z: Floats) -> Floats:
        """Return metres (S, G) to the left from numbers z (S, 1)."""
        return np.asarray(self.place_sigma * truncate(z, self.bound) * self.place)

    def end_speed_change(self, z: Floats, mean: Floats) -> Floats:
        """Return by how much (S, 2) [m/s] start and end are faster than `mean` (2,) [m/s]."""
        slowest = -(1.0 - _TUNING.min_end_speed_share) * mean
        slowest[1] = max(slowest[1], -_TUNING.slower_end)
        return np.maximum(self.end_speed * truncate(z, self.bound), slowest)

    def log_strength(self, z: Floats) -> Floats:
        """Return the logarithms (S, 2) of the strength of braking and of acceleration."""
        return np.asarray(self.strength * truncate(z, self.bound))

    def resized(self, z: Floats, vehicle: Vehicle) -> list[Vehicle]:
        """Return the vehicle in the size that each number z (S, 1) selects."""
        if len(self.sizes) == 0:
            return [vehicle] * len(z)
        selected = (special.ndtr(z[:, 0]) * len(self.sizes)).astype(np.int64)
        sizes = self.sizes[np.minimum(selected, len(self.sizes) - 1)].tolist()
        return [replace(vehicle, length=length, width=width) for length, width in sizes]
