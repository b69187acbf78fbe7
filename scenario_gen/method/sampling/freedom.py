# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What preset `wide` frees: the clock of each vehicle, its place in the lane, its end speeds and its size.

Every vehicle has a clock of its own: the shared one, shifted by a_n, faster or slower by a share p_n, and standing longer or
shorter by q_n in each wait. A scenario is the stretch of time in which all clocks run, so one mechanism frees where and how fast
a vehicle starts, who arrives when, how long it waits, and where and when the scenario ends. What was asked for stays: where a
start or an end state is asked of any vehicle, shift and pace of all own clocks die away there. A wait of another length still
moves its vehicle's end; where ends are requested, the checker refuses what that moves too far.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from scenario_gen.method.sampling.config import SamplingConfig
from scenario_gen.method.sampling.time_warp import Clock, LONGEST_SHARE, SHORTEST_SHARE
from scenario_gen.method.sampling.window import seconds_left_out
from scenario_gen.numerics import Bools, Floats
from scenario_gen.situation import Situation
from scenario_gen.types import BoundaryStates, CAR, Request, Vehicle

CATALOGUE = (
    (3.60, 1.62),
    (4.05, 1.75),
    (4.25, 1.79),
    (4.46, 1.83),
    (4.63, 1.83),
    (4.69, 1.85),
    (4.77, 1.88),
    (4.96, 1.93),
)
"""Length and width [m] of cars, each as likely: our choice of typical ones, from a city car to a large saloon."""
_CARS = 3.2, 5.4  # m: a vehicle of such a length gets the size of another car
_GROWS = 0.15  # of its least gap in the template, by which a vehicle is longer at most: cars stand close in a queue
_RAMP = 6.0  # s, over which an own clock leaves the shared one where states are asked
_RAMP_SHARE = 1.0 / 3.0  # of the duration, or of a way, that this takes at most
_TAPER = 30.0  # m, over which a vehicle goes to its place in the lane
_MADE_UP = (
    0.5 * (1.0 - SHORTEST_SHARE) / 1.875
)  # s of a wait for each second left, made up for at half the pace that is free
_LEAST_STAND, _SHORTER = (
    1.5,
    0.3,
)  # s that are left of a wait, and share by which it is shorter at most: clocks run forward
_LEAST_SHARE = 0.5  # of a speed, that is left while acceleration dies away
FADES, _LEAST_FADES = 0.5, 0.2  # s, in which it does, without a jolt: its jerk begins at 0
EASES = 4.0  # m, in which curvature does
_GAUSS_NODES, _GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(6)
MOST_ONWARD = 4.0  # s, for which a vehicle drives straight on before or behind its route
_FASTEST = 0.5  # m/s by which a speed may leave what the template has near its ends, besides its stated bounds


def cut(z: Floats, bound: float) -> Floats:
    """Standard normal numbers (any shape) cut at +-bound: truncated normal ones with the same probability."""
    low = special.ndtr(np.array(-bound))
    return np.asarray(special.ndtri(low + (1.0 - 2.0 * low) * special.ndtr(z)))


def relaxed_states(
    requested: BoundaryStates, situation: Situation, config: SamplingConfig, request: Request
) -> BoundaryStates:
    """Return the states with how far each may be left: 0 where it was asked for, or nothing is freed.

    A vehicle that starts a seconds later or earlier, starts as far along its lane as it drives in that time.
    """
    encounter = situation.encounter
    config = config.drawn
    if config.variety != "wide":
        return (
            replace(requested, relaxed=np.zeros_like(requested.relaxed))
            if requested.relaxed.any()
            else requested
        )
    ego = request.ego_of(encounter)
    relaxed = np.zeros((len(encounter.vehicles), 2, 2))
    own = [
        np.asarray(np.isfinite(request.rows(end, encounter)).any(axis=1))
        for end in ("starts", "goals")
    ]
    if ego is not None and config.ego == "keep":
        for rows in own:
            rows[ego] = True
    tied = [rows.any() for rows in own]
    length = encounter.duration
    bound = config.freedom
    seconds = (
        2.0 * bound * (config.arrival_sigma + 0.5 * length * config.pace_sigma)
        + bound * config.wait_sigma
    )
    seconds += config.duration_tolerance * length
    free = (seconds + seconds_left_out(situation, config.leave_out)).tolist()
    slowest = 1.0 / SHORTEST_SHARE
    steps = [max(int(np.ceil(slowest * each / encounter.dt)), 1) for each in free]
    across = config.freedom * config.place_sigma
    for n, (first, last) in enumerate(encounter.present.tolist()):
        speed = encounter.speed[n, first : last + 1]
        for end, (near, state) in enumerate(
            (
                (speed[: steps[0] + 1], requested.start[n]),
                (speed[-steps[1] - 1 :], requested.end[n]),
            )
        ):
            if own[end][n]:
                continue
            top, there = max(float(near.max()), float(state[3])), float(state[3])
            faster = config.freedom * config.of(encounter.vehicles[n].kind).end_speed_sigma
            along = 0.0 if tied[end] else slowest * free[end] * (top + faster)
            off = 0.0 if tied[end] else max(slowest * top - there, there - float(near.min()))
            relaxed[n, end] = along + across, off + faster + _FASTEST
    return replace(requested, relaxed=np.ceil(1000.0 * relaxed) / 1000.0)


@dataclass(frozen=True, eq=False)
class OwnClock:
    """How the clock of one vehicle leaves the shared one.

    Attributes:
        shift: (G,) seconds at template times, of one second's shift: 1, but 0 where states are asked.
        pace: (G,) the same of a pace slower by 1.
        waits: (W, G) the same of one second more in each wait; where an end state is asked it is made up for until the end.
        shift_rate, pace_rate, wait_rates: their derivatives.
        made_up: (W, G) the part of `wait_rates` that makes up for a wait.
        sigma: (2 + W,) standard deviations of shift [s], pace and waits [s].
        low, high: (W,) bounds [s] of a wait's.
        bound: standard deviations at which all are cut.
    """

    shift: Floats
    pace: Floats
    waits: Floats
    shift_rate: Floats
    pace_rate: Floats
    wait_rates: Floats
    made_up: Floats
    sigma: Floats
    low: Floats
    high: Floats
    bound: float

    @classmethod
    def of(
        cls,
        nominal: Clock,
        rests: Sequence[tuple[float, float]],
        requested: tuple[bool, bool],
        config: SamplingConfig,
    ) -> "OwnClock":
        """Prepare.

        Args:
            nominal: the clock without deviation.
            rests: when the vehicle stands [s], on the template's clock.
            requested: whether start and end states are asked of any vehicle.
            config: the standard deviations.
        """
        grid, ramp = nominal.grid, min(_RAMP, _RAMP_SHARE * float(nominal.grid[-1]))
        shift, shift_rate = np.ones(len(grid)), np.zeros(len(grid))
        for tied, since, sign in (
            (requested[0], grid - grid[0], 1.0),
            (requested[1], grid[-1] - grid, -1.0),
        ):
            if tied:
                value, rate = _smooth_step(since / ramp)
                shift, shift_rate = shift * value, shift_rate * value + shift * sign * rate / ramp
        about = nominal.time - 0.5 * nominal.time[-1]
        length = np.array([b - a for a, b in rests])
        left = np.array(
            [grid[-1] - b if requested[1] else np.inf for _, b in rests]
        )  # s, to make up for a wait
        waits, rates, made_up = (np.zeros((len(rests), len(grid))) for _ in range(3))
        for k, (a, b) in enumerate(rests):
            waits[k], rates[k] = _smooth_step((grid - a) / (b - a))
            rates[k] /= b - a
            if np.isfinite(left[k]):
                value, rate = _smooth_step((grid[-1] - grid) / max(left[k], 1e-9))
                waits[k], rates[k], made_up[k] = (
                    waits[k] * value,
                    rates[k] * value,
                    -waits[k] * rate / max(left[k], 1e-9),
                )
                rates[k] += made_up[k]
        most = np.minimum(config.freedom * config.wait_sigma, _MADE_UP * left)
        shortest = np.minimum(
            np.maximum(np.minimum(_SHORTER * length, length - _LEAST_STAND), 0.0), _MADE_UP * left
        )
        return cls(
            shift,
            about * shift,
            waits,
            shift_rate,
            about * shift_rate + nominal.rate * shift,
            rates,
            made_up,
            np.array(
                [config.arrival_sigma, config.pace_sigma, *(config.wait_sigma for _ in rests)]
            ),
            -np.minimum(shortest, most),
            most,
            config.freedom,
        )

    @property
    def size(self) -> int:
        """Standard normal numbers needed per sample."""
        return len(self.sigma)

    def effective(self, z: Floats, scale: float) -> Floats:
        """Numbers (S, size) that do the same as numbers z (S, size) do after what is cut off."""
        off = cut(z, self.bound)
        unit = np.maximum(scale * self.sigma[2:], 1e-9)
        off[:, 2:] = np.clip(off[:, 2:], self.low / unit, self.high / unit)
        return off

    def sample(self, z: Floats, scale: float, shared: Clock, nominal: Clock) -> Clock:
        """Clocks (S, G) of the vehicle from numbers z (S, size), deviations multiplied by `scale`."""
        off = scale * self.sigma * self.effective(z, scale)
        waits = off[:, 2:]
        rate = off[:, :1] * self.shift_rate + off[:, 1:2] * self.pace_rate
        runs = shared.rate + waits @ self.made_up
        room = np.where(
            rate < 0.0, runs - SHORTEST_SHARE * nominal.rate, LONGEST_SHARE * nominal.rate - runs
        )
        damped = np.clip(
            (np.maximum(room, 0.0) / np.maximum(np.abs(rate), 1e-9)).min(axis=1), 0.0, 1.0
        )[:, None]
        time = (
            shared.time
            + damped * (off[:, :1] * self.shift + off[:, 1:2] * self.pace)
            + waits @ self.waits
        )
        return Clock(shared.grid, time, shared.rate + damped * rate + waits @ self.wait_rates)


@dataclass(frozen=True, eq=False)
class Freedom:
    """What else is free of one vehicle.

    Attributes:
        clock: its own clock.
        place: (G,) share of its place in the lane at the nodes of its route: 1, but 0 where its state is requested.
        place_sigma: m; end_speed: (2,) m/s, standard deviations.
        bound: standard deviations at which all are cut.
        sizes: (C, 2) length and width [m] to choose from; empty to keep its own.
        ahead: (2,) metres of free road straight on before its route and behind it; 0 where its state is requested.
    """

    clock: OwnClock
    place: Floats
    place_sigma: float
    end_speed: Floats
    bound: float
    sizes: Floats
    ahead: Floats

    @property
    def size(self) -> int:
        """Standard normal numbers needed per sample."""
        return self.clock.size + 4

    def across(self, z: Floats) -> Floats:
        """Metres (S, G) to the left, of numbers z (S,)."""
        return np.asarray(self.place_sigma * cut(z, self.bound)[:, None] * self.place)

    def faster(self, z: Floats, least: Floats) -> Floats:
        """By how much (S, 2) [m/s] start and end are faster, not by less than `least` (2,), of numbers z (S, 2)."""
        return np.maximum(self.end_speed * cut(z, self.bound), least)

    def vehicles(self, z: Floats, own: Vehicle) -> list[Vehicle]:
        """The vehicle in the size that each of the numbers z (S,) chooses."""
        if len(self.sizes) == 0:
            return [own] * len(z)
        chosen = np.minimum(
            (special.ndtr(z) * len(self.sizes)).astype(np.int64), len(self.sizes) - 1
        )
        return [
            replace(own, length=float(length), width=float(width))
            for length, width in self.sizes[chosen].tolist()
        ]


def onward(state: Floats, bend: Floats, since: Floats, sign: float) -> Floats:
    """States (S, T, 5) of vehicles that drive on from theirs (S, 5): acceleration and curvature die away, the speed is kept.

    Args:
        state: x, y [m], yaw [rad], speed [m/s], acceleration [m/s²].
        bend: (S,) curvature [1/m] there.
        since: (S, T) seconds after it, or before it.
        sign: 1 after it, -1 before it.
    """
    x, y, yaw, speed, acceleration = (column[:, None] for column in state.T)
    gains, fades = sign * acceleration, _fades(state, sign)[:, None]
    left = np.exp(-since / fades)
    driven = speed * since + gains * fades * (
        2.0 * since - 3.0 * fades + (3.0 * fades + since) * left
    )
    out = np.empty((*since.shape, 5))
    turned, along, aside = _eased(sign * bend[:, None], driven)
    cos, sin = np.cos(yaw), np.sin(yaw)
    out[..., 0], out[..., 1] = (
        x + sign * (along * cos - aside * sin),
        y + sign * (along * sin + aside * cos),
    )
    out[..., 2], out[..., 3] = (
        yaw + turned,
        speed + gains * (2.0 * fades - (2.0 * fades + since) * left),
    )
    out[..., 4] = acceleration * (1.0 + since / fades) * left
    return out


def _eased(bend: Floats, driven: Floats) -> tuple[Floats, Floats, Floats]:
    """Heading [rad] and place ahead and aside [m] after `driven` metres (S, T), of a curvature `bend` (S, 1) that dies away."""
    curved = np.minimum(driven, 4.0 * EASES)
    along, aside = np.zeros_like(driven), np.zeros_like(driven)
    for node, weight in zip(_GAUSS_NODES.tolist(), _GAUSS_WEIGHTS.tolist(), strict=True):
        part = curved * (0.5 + 0.5 * node)
        turned = bend * EASES * (1.0 - np.exp(-part / EASES))
        along, aside = (
            along + 0.5 * weight * curved * np.cos(turned),
            aside + 0.5 * weight * curved * np.sin(turned),
        )
    turned = bend * EASES * (1.0 - np.exp(-curved / EASES))
    rest = driven - curved
    return turned, along + rest * np.cos(turned), aside + rest * np.sin(turned)


def _fades(state: Floats, sign: float) -> Floats:
    """Seconds (S,) in which the acceleration of vehicles in states (S, 5) dies away: before they stand."""
    loses = np.maximum(-sign * state[:, 4], 1e-9)
    return np.minimum(FADES, np.maximum(0.5 * _LEAST_SHARE * state[:, 3] / loses, 1e-6))


def seconds_onward(state: Floats, ahead: float, sign: float) -> Floats:
    """Return for how long (S,) [s] vehicles in states (S, 5) can drive on within `ahead` metres; 0 if only with a jerk."""
    fastest = state[:, 3] + 2.0 * np.maximum(sign * state[:, 4], 0.0) * FADES
    seconds = np.minimum(ahead / np.maximum(fastest, 1e-3), MOST_ONWARD)
    return np.where(_fades(state, sign) < _LEAST_FADES, 0.0, seconds)


def freedom_of(
    vehicle: Vehicle,
    arc: Floats,
    clock: OwnClock,
    relaxed: Floats,
    requested: Bools,
    ahead: Floats,
    gap: float,
    config: SamplingConfig,
) -> Freedom:
    """Return what is free of a vehicle.

    Args:
        vehicle: itself.
        arc: (G,) arc lengths [m] of its route's nodes.
        clock: how its clock leaves the shared one.
        relaxed: (2, 2) metres and m/s by which its start and end may differ from what is given.
        requested: (2,) whether start and end states are asked of any vehicle.
        ahead: (2,) metres of free road straight on before its route and behind it.
        gap: metres of its least gap to any other vehicle in the template.
        config: the standard deviations.
    """
    place = np.ones(len(arc))
    for end, since in ((0, arc - arc[0]), (1, arc[-1] - arc)):
        if relaxed[end, 0] == 0.0:
            place = (
                place
                * _smooth_step(since / max(min(_TAPER, _RAMP_SHARE * float(arc[-1])), 1e-9))[0]
            )
    still = len(arc) == 1 or relaxed[:, 0].min() == 0.0
    sizes = np.array(
        [size for size in CATALOGUE if size[0] - vehicle.length <= max(_GROWS * gap, 0.0)]
    ).reshape(-1, 2)
    is_car = vehicle.type == CAR
    other_size = (
        config.sizes == "catalogue"
        and is_car
        and _CARS[0] <= vehicle.length <= _CARS[1]
        and not still
    )
    return Freedom(
        clock,
        place if len(arc) > 1 else np.zeros(1),
        config.place_sigma,
        np.where(relaxed[:, 1] > 0.0, config.end_speed_sigma, 0.0),
        config.freedom,
        sizes if other_size else np.zeros((0, 2)),
        np.where(requested, 0.0, ahead),
    )


def _smooth_step(x: Floats) -> tuple[Floats, Floats]:
    """The step from 0 at x <= 0 to 1 at x >= 1 whose first and second derivatives vanish at both, and its derivative."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * x * (10.0 + x * (6.0 * x - 15.0)), 30.0 * x * x * (1.0 - x) * (1.0 - x)
