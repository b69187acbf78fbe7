# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Reconciling positions with measured speeds: a vehicle moves forward along a smooth path.

A track becomes a path (a curve by arc length, `Path`) and a motion along it (place and speed over time, `Motion`), fitted in
turn. The path is smooth in *distance*, so GPS noise does not become heading noise however slowly the vehicle moves; the motion
is smooth in *time*, never runs backwards, keeps to the limits of a car and is still where the car stands. So position, speed and
heading agree by construction: the distance between samples is the mean of their speeds times dt, and the heading is the path's
direction, held while standing.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import clarabel  # type: ignore[import-untyped,unused-ignore]
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy import sparse
from scipy.ndimage import median_filter

from scenario_gen.base.errors import InputError
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.path import (
    differences,
    fit_path,
    Headings,
    headings_of,
    MOVES_MPS,
    observe,
    Path,
    straight_path,
)
from scenario_gen.logs.raw import Observations
from scenario_gen.numerics import Bools, Floats, Ints, runs, wrap_angle

STANDS_MPS = (
    0.3  # m/s: below this a vehicle stands, if it does so for a second and its fixes stay in place
)
STILL_MPS = 0.1  # m/s: below this it is not on its way to or from standing
SHIFTED_M = 1.0  # m: if fixes move further while the speed is zero, the speed is wrong
DOUBTED_MPS = 3.0  # a speed that differs more from that of the fixes is not used in the first layout; if most do, none is used
MOVED_M = 0.5  # m: a vehicle that moves less has no direction of travel
ROUNDS = 3  # of path and motion in turn
LEAST_NOISE, MOST_NOISE = 0.1, 1.5  # m: of fixes, as estimated
MIN_FIXES = 30  # moving fixes from which their noise can be estimated
SETTLES_S = 0.3  # s at either end of a stand that are left to the motion: a car comes to rest, and starts, without a step
STRAIGHT_M = 3.0  # m: a shorter path has no shape of its own


class UnreconciledError(InputError):
    """No motion of a car fits speeds and positions."""


class Motion:
    """How far along its path a vehicle is: a quadratic B-spline on the common clock, fitted by a quadratic program.

    With coefficients c_0 … c_T and ticks i = 0 … T-1: place s_i = (c_i + c_{i+1})/2, speed v_i = (c_{i+1} - c_i)/dt, and the
    acceleration between two ticks is constant. Second and third differences of c are acceleration and jerk, so limits on speed
    and acceleration are sparse linear inequalities, and where a vehicle stands its coefficients are one variable: v = 0 exactly.
    """

    def __init__(self, stands: Bools, config: LogConfig) -> None:
        """Set the program up; the speed is zero at the ticks of which `stands` (T,) is true."""
        dt = config.period
        self.dt, self.ticks = dt, len(stands)
        self.variable = np.concatenate(
            [[0], np.cumsum(~stands)]
        )  # v_i = 0 makes c_{i+1} the variable of c_i
        self.size = int(self.variable[-1]) + 1
        first, second, third = (self._differences(order) for order in (1, 2, 3))
        speed, change = (
            (first[0], first[1] * (1.0 / dt)),
            (second[0], second[1] * (1.0 / np.square(dt))),
        )
        self.prior = np.zeros((4, self.size + 3))
        weight = np.full(len(third[0]), dt / (config.jerk * dt**3) ** 2)
        observe(self.prior, np.zeros(self.size + 3), *third, 1, weight, np.zeros(len(weight)))
        blocks = (speed[0], -speed[1]), change, (change[0], -change[1])
        self.bounds = np.repeat(
            [0.0, config.acceleration_limit, config.braking_limit],
            [len(block[0]) for block in blocks],
        )
        above = np.cumsum([0, *(len(block[0]) for block in blocks)])
        rows = [
            np.repeat(top + np.arange(len(at)), values.shape[1])
            for top, (at, values) in zip(above, blocks, strict=False)
        ]
        columns = [(at[:, None] + np.arange(values.shape[1])).ravel() for at, values in blocks]
        entries = np.concatenate([values.ravel() for _, values in blocks])
        some = entries != 0.0  # merged variables leave the last places of a row empty
        places = np.concatenate(rows)[some], np.concatenate(columns)[some]
        self.constraints = sparse.csc_array((entries[some], places), (above[-1], self.size))

    def _merged(self, tick: Ints, weights: Floats) -> tuple[Ints, Floats]:
        """Rows (F, E) over the coefficients from `tick` (F,) on, as the first variable (F,) and rows (F, E) from there."""
        out = np.zeros(weights.shape)
        column = (
            self.variable[tick[:, None] + np.arange(weights.shape[1])]
            - self.variable[tick][:, None]
        )
        np.add.at(out, (np.arange(len(tick))[:, None], column), weights)
        return self.variable[tick], out

    def _differences(self, order: int) -> tuple[Ints, Floats]:
        """Return differences of the coefficients over the merged variables, as rows like those of `_merged`."""
        tick = np.arange(len(self.variable) - order)
        return self._merged(tick, differences(len(self.variable), order))

    def _weights(
        self, seconds: Floats, *, speed: bool = False
    ) -> tuple[Ints, tuple[Floats, Floats, Floats]]:
        """The first of the three coefficients that count at any times (F,), and the weights (F,) of each: place or speed."""
        tick = np.clip(np.floor(seconds / self.dt).astype(np.int64), 0, max(self.ticks - 2, 0))
        u = seconds / self.dt - tick
        if speed:
            return tick, ((u - 1.0) / self.dt, (1.0 - 2.0 * u) / self.dt, u / self.dt)
        return tick, (np.square(1.0 - u) / 2.0, 0.5 + u - np.square(u), np.square(u) / 2.0)

    def solve(self, observed: Sequence[tuple[Floats, Floats, Floats, bool]]) -> Floats:
        """Return the coefficients (T+1,) that fit best.

        Args:
            observed: (seconds, values, standard deviations, whether the values are speeds rather than places).

        Raises:
            UnreconciledError: the solver finds no solution.
        """
        quadratic, linear = self.prior.copy(), np.zeros(self.size + 3)
        for seconds, values, deviation, speed in observed:
            tick, weights = self._weights(seconds, speed=speed)
            observe(
                quadratic,
                linear,
                *self._merged(tick, np.column_stack(weights)),
                1,
                1.0 / np.square(deviation),
                values,
            )
        upper = sparse.dia_array(
            (quadratic[:, : self.size], -np.arange(4)), (self.size, self.size)
        ).T.tocsc()
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.direct_solve_method = "qdldl"  # one thread: the same bits everywhere
        cones = [clarabel.NonnegativeConeT(len(self.bounds))]
        for scaled in (
            True,
            False,
        ):  # fixes seconds apart leave the matrix such that its scaling makes it worse
            settings.equilibrate_enable = scaled
            solver = clarabel.DefaultSolver(
                upper, -linear[: self.size], self.constraints, self.bounds, cones, settings
            )
            solution = solver.solve()
            if solution.status in (
                clarabel.SolverStatus.Solved,
                clarabel.SolverStatus.AlmostSolved,
            ):
                break
        else:
            raise UnreconciledError("speeds and positions cannot be reconciled; check their units")
        merged = np.maximum.accumulate(
            np.asarray(solution.x)
        )  # within the solver's tolerance it may run backwards
        return np.asarray(merged[self.variable])

    def place(self, coefficients: Floats, seconds: Floats) -> Floats:
        """Return the distances driven (F,) [m] at any times (F,) [s], of coefficients (T+1,)."""
        tick, (w0, w1, w2) = self._weights(seconds)
        place: Floats = (
            w0 * coefficients[tick] + w1 * coefficients[tick + 1] + w2 * coefficients[tick + 2]
        )
        return place

    def at_ticks(self, coefficients: Floats) -> tuple[Floats, Floats]:
        """Return distances driven (T,) [m] and speeds (T,) [m/s] at the ticks, of coefficients (T+1,)."""
        return (coefficients[1:] + coefficients[:-1]) / 2.0, np.diff(coefficients) / self.dt


@dataclass(frozen=True, eq=False)
class Smooth:
    """A piece of a track on the common clock: T samples from tick `first` on.

    Attributes:
        first: index of the first sample on the common clock.
        position: (T, 2) metres.
        heading: (T,) rad, unwrapped; NaN if the vehicle never moved and none is recorded.
        speed: (T,) m/s.
        before: (S,) measured speed less the speed of the raw fixes [m/s].
        after: (T,) published speed less the speed of the published positions [m/s].
        changed: (S,) measured speed less the published speed [m/s].
        moved: (F,) distance of the raw fixes from the published positions at their stamps [m].
        noise: standard deviation of the fixes [m], as estimated or as given.
        turned: (H,) recorded headings less the published ones [rad] where the vehicle moves.
        headings: (H',) for each recorded heading whether it was used.
    """

    first: int
    position: Floats
    heading: Floats
    speed: Floats
    before: Floats
    after: Floats
    changed: Floats
    moved: Floats
    noise: float
    turned: Floats
    headings: Bools


def smooth_piece(piece: Observations, origin_ns: int, config: LogConfig) -> Smooth | None:
    """Fit path and motion to a piece of a track; `origin_ns` is the stamp of tick 0 of the common clock.

    Returns:
        The piece on the clock, or None if fewer than three ticks lie in it.
    """
    dt = config.period
    fix_t = (piece.fix_ns - origin_ns).astype(np.float64) * 1e-9
    speed_t = (piece.speed_ns - origin_ns).astype(np.float64) * 1e-9
    first, last = int(np.ceil(fix_t[0] / dt - 1e-6)), int(np.floor(fix_t[-1] / dt + 1e-6))
    if last - first < 2:
        return None
    fix_t, speed_t = fix_t - first * dt, speed_t - first * dt
    raw = speed_of_fixes(fix_t, piece.fix)
    speed = piece.speed
    if not len(speed):
        speed_t, speed = fix_t, raw
    noise = first_noise = config.position_noise or estimated_noise(piece.fix)
    ticks = dt * np.arange(last - first + 1, dtype=np.float64)
    stands = standing(ticks, fix_t, piece.fix, speed_t, speed)
    motion = Motion(without_ends(stands, round(SETTLES_S / dt)), config)
    differs = speed - np.interp(speed_t, fix_t, raw)
    deviation = config.speed_noise or float(np.clip(white_equivalent(differs), 0.3, 3.0))
    trusted = len(piece.speed) > 0 and np.median(np.abs(differs)) <= max(DOUBTED_MPS, 5.0 * noise)
    measured = [(speed_t, speed, deviation * np.ones(len(speed)), True)] if trusted else []
    guess = layout(
        ticks, stands, np.interp(ticks, speed_t, speed), np.interp(ticks, fix_t, raw), fix_t
    )
    weight = np.ones(len(fix_t))
    headings = None
    for _ in range(ROUNDS):
        path = path_of(guess, piece, weight, noise, np.gradient(guess, fix_t), headings)
        place, aside = path.project(guess, piece.fix)
        coefficients = motion.solve([*measured, (fix_t, place, noise / np.sqrt(weight), False)])
        guess = motion.place(coefficients, fix_t)
        if not config.position_noise:
            noise = noise_about(
                first_noise, np.interp(fix_t, ticks, stands) < 0.5, aside, place - guess
            )
        weight = np.minimum(
            1.0, 2.0 * noise / np.maximum(np.hypot(aside, place - guess), 1e-9)
        )  # Huber's
        headings = headings_of(piece.heading, path.pose(guess)[1], np.gradient(guess, fix_t))
    place, published = motion.at_ticks(coefficients)
    position, heading = path.pose(place)
    if np.ptp(place) < MOVED_M and not np.isfinite(piece.heading).any():
        heading = np.full(len(place), np.nan)
    known = np.isfinite(piece.heading)
    rolls = known & (np.gradient(guess, fix_t) > MOVES_MPS)
    return Smooth(
        first=first,
        position=position,
        heading=heading,
        speed=published,
        before=differs,
        after=published - speed_of_fixes(ticks, position),
        changed=piece.speed - np.interp(speed_t, ticks, published)[: len(piece.speed)],
        moved=np.hypot(*(piece.fix - path.pose(guess)[0]).T),
        noise=noise,
        turned=wrap_angle(piece.heading[rolls] - np.interp(fix_t[rolls], ticks, heading)),
        headings=known[known]
        if np.ptp(place) < STRAIGHT_M
        else (headings.weight > 0.0)[known]
        if headings
        else ~known[known],
    )


def without_ends(stands: Bools, ends: int) -> Bools:
    """Return the stands (T,) shorter by `ends` ticks where the vehicle comes to rest or starts."""
    kept = np.zeros(len(stands), dtype=bool)
    for begin, end in runs(stands):
        kept[begin + ends * (begin > 0) : end - ends * (end < len(stands))] = True
    return kept


def layout(ticks: Floats, stands: Bools, speed: Floats, raw: Floats, seconds: Floats) -> Floats:
    """Return a first guess of the distances driven (F,) [m]: the speed integrated, or that of the fixes where it is far off.

    Args:
        ticks: (T,) seconds.
        stands: (T,) whether it stands there.
        speed: (T,) measured [m/s].
        raw: (T,) of the fixes [m/s].
        seconds: (F,) stamps of the fixes.
    """
    rate = np.where(stands, 0.0, np.where(np.abs(speed - raw) > DOUBTED_MPS, raw, speed))
    driven = np.concatenate([[0.0], np.cumsum((rate[1:] + rate[:-1]) / 2.0 * np.diff(ticks))])
    guess: Floats = np.interp(seconds, ticks, driven)
    return guess


def path_of(
    guess: Floats,
    piece: Observations,
    weight: Floats,
    noise: float,
    speed: Floats,
    headings: Headings | None,
) -> Path:
    """Fit the path; one too short to have a shape is straight, in the recorded heading where there is one.

    Args:
        guess: (F,) distances driven at the fixes [m].
        piece: the fixes.
        weight: (F,) in (0, 1].
        noise: standard deviation of the fixes [m].
        speed: (F,) at the fixes [m/s].
        headings: recorded ones, if there are any.
    """
    low, high = float(guess.min()), float(guess.max())
    if high - low >= STRAIGHT_M:
        return fit_path(guess, piece.fix, weight, noise, speed, headings)
    known = piece.heading[np.isfinite(piece.heading)]
    if len(known):
        heading = float(np.arctan2(np.median(np.sin(known)), np.median(np.cos(known))))
    else:  # the direction of the fixes' regression on the distance driven
        lever = guess - guess.mean()
        heading = float(np.arctan2(*(lever @ (piece.fix - piece.fix.mean(axis=0)))[::-1]))
    point = np.median(piece.fix, axis=0)
    return straight_path(point, heading, 2.0 * float(np.median(guess)) - high, high)


def speed_of_fixes(seconds: Floats, fix: Floats, window: float = 0.5) -> Floats:
    """Return the speeds (F,) of the raw fixes over `window` seconds around each [m/s]."""
    early = np.searchsorted(seconds, seconds - window / 2.0 - 1e-9)
    late = np.searchsorted(seconds, seconds + window / 2.0 + 1e-9) - 1
    early, late = (
        np.where(late > early, early, np.maximum(early - 1, 0)),
        np.where(late > early, late, np.minimum(late + 1, len(fix) - 1)),
    )
    rate: Floats = np.hypot(*(fix[late] - fix[early]).T) / (seconds[late] - seconds[early])
    return rate


def estimated_noise(fix: Floats) -> float:
    """Return the standard deviation [m] of fixes (F, 2) [m]: from their residuals about local parabolas."""
    half = min(15, (len(fix) - 1) // 2)
    if half < 3:
        return 0.5
    lag = np.arange(-half, half + 1)
    square = np.square(lag) - np.square(lag).mean()
    parabola = (
        1.0 / len(lag) - np.square(lag).mean() * square / np.square(square).sum()
    )  # the fitted parabola's value at lag 0
    residual = fix[half : len(fix) - half] - sliding_window_view(fix, len(lag), axis=0) @ parabola
    return float(
        np.clip(
            max(white_equivalent(residual[:, 0]), white_equivalent(residual[:, 1])),
            LEAST_NOISE,
            MOST_NOISE,
        )
    )


def noise_about(guess: float, moves: Bools, aside: Floats, ahead: Floats) -> float:
    """Return the standard deviation [m] of fixes about the path and motion fitted to them, at most twice the first estimate.

    Without that bound noise and smoothness would increase each other: smoothing leaves noise of long memory.

    Args:
        guess: the first estimate; it is kept if few fixes are of a moving vehicle: those of a standing one are often repeated.
        moves: (F,) whether it moves there.
        aside: (F,) of the fixes from the path [m].
        ahead: (F,) of the fixes from the motion along it [m].
    """
    if moves.sum() < MIN_FIXES:
        return guess
    seen = max(white_equivalent(aside[moves]), white_equivalent(ahead[moves]))
    return float(np.clip(seen, LEAST_NOISE, min(2.0 * guess, MOST_NOISE)))


def white_equivalent(noise: Floats) -> float:
    """Return the deviation of the white noise whose mean is as uncertain as that of this coloured noise (T,) [m, m/s].

    Values beyond three robust deviations are pulled in; the deviation is then scaled by the root of the autocorrelation
    time, 1 + 2 Σ ρ_l over the lags before the first ρ_l below 0.1.
    """
    noise = noise - np.median(noise)
    limit = 3.0 * 1.4826 * float(np.median(np.abs(noise))) + 1e-3
    noise = np.clip(noise, -limit, limit)
    power, time = float(np.square(noise).sum()), 1.0
    for lag in range(1, min(20, len(noise) // 3)):
        correlation = float((noise[:-lag] * noise[lag:]).sum()) / max(power, 1e-12)
        if correlation < 0.1:
            break
        time += 2.0 * correlation
    return float(np.sqrt(power / len(noise) * time))


def standing(ticks: Floats, fix_t: Floats, fix: Floats, speed_t: Floats, speed: Floats) -> Bools:
    """Return at which ticks the vehicle stands: slow for at least a second, with fixes that stay in place.

    Args:
        ticks: (T,) seconds.
        fix_t: (F,) seconds.
        fix: (F, 2) metres.
        speed_t: (S,) seconds.
        speed: (S,) m/s.
    """
    dt = ticks[1] - ticks[0]
    half = round(0.2 / dt)
    smooth = median_filter(np.interp(ticks, speed_t, speed), 2 * half + 1, mode="nearest")
    stands = np.zeros(len(ticks), dtype=bool)
    for begin, end in runs(smooth < STANDS_MPS):
        still = begin + np.flatnonzero(
            smooth[begin:end] <= max(STILL_MPS, 1.5 * float(np.median(smooth[begin:end])))
        )
        begin, end = int(still[0]), int(still[-1]) + 1  # noqa: PLW2901 - rolling before and after the stop is not standing
        inside = fix[(fix_t >= ticks[begin]) & (fix_t <= ticks[end - 1])]
        k = max(len(inside) // 5, 1)
        if (end - begin) * dt >= 1.0 and len(inside):
            shift = np.median(inside[-k:], axis=0) - np.median(inside[:k], axis=0)
            stands[begin:end] = np.hypot(*shift) <= SHIFTED_M
    return stands
