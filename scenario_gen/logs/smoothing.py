# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Reconciling positions with measured speeds: a vehicle moves forwards along a smooth path.

A track becomes a path (a curve by arc length, `Path`) and a motion along it (distance and speed
over time, `Motion`), fitted in turn. The path is smooth in *distance*, so GPS noise does not
become heading noise however slowly the vehicle moves. The motion is smooth in *time*, never runs
backwards, respects the limits of a car, and is zero while the car stands. So position, speed and
heading agree by construction: the distance between samples is the mean of their speeds times dt,
and the heading is the direction of the path, constant while standing.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.ndimage import median_filter

from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.raw import Observations
from scenario_gen.numerics import Bools, Floats, Ints, running_sum, runs, wrap_angle
from scenario_gen.smoothing.motion import Motion, UnreconciledError
from scenario_gen.smoothing.path import (
    estimated_noise,
    fit_path,
    HEADINGS,
    Headings,
    headings_of,
    Path,
    residual_noise,
    straight_path,
    white_equivalent,
)


@dataclass(frozen=True)
class SmoothingModel:
    """Tuning of smoothing.

    Attributes:
        standing_mps: a vehicle stands if it is slower for a second and its fixes stay in place.
        still_mps: slower than on the way to or from standing.
        max_shift_m: if fixes move farther while the speed is zero, the speed is wrong.
        settling_s: at either end of a stand, free for the motion: a car stops without a step.
        min_travel_m: a vehicle that moves less has no direction of travel.
        straight_m: a shorter path has no shape.
        max_path_m: a longer one, by its speeds, contradicts the fixes, which are cut before.
        round_count: fits of path and motion in turn.
        speed_noise_mps: bounds of the estimated noise of speeds.
        min_doubted_s: a stretch of speeds that contradict the fixes for longer is not used.
    """

    standing_mps: float = 0.3
    still_mps: float = 0.1
    max_shift_m: float = 1.0
    settling_s: float = 0.3
    min_travel_m: float = 0.5
    straight_m: float = 3.0
    max_path_m: float = 200_000.0
    round_count: int = 3
    speed_noise_mps: tuple[float, float] = (0.3, 3.0)
    min_doubted_s: float = 0.5


SMOOTHING = SmoothingModel()


def speed_of_fixes(seconds: Floats, fix: Floats, window: float = 0.5) -> Floats:
    """Return the speeds (F,) [m/s] of raw fixes (F, 2) [m], over `window` seconds around each."""
    first = np.searchsorted(seconds, seconds - window / 2.0 - 1e-9)
    last = np.searchsorted(seconds, seconds + window / 2.0 + 1e-9) - 1
    is_alone = last <= first
    first = np.where(is_alone, np.maximum(first - 1, 0), first)
    last = np.where(is_alone, np.minimum(last + 1, len(fix) - 1), last)
    rate: Floats = np.hypot(*(fix[last] - fix[first]).T) / (seconds[last] - seconds[first])
    return rate


DOUBTED_MPS = 3.0
"""A speed that differs more from that of the fixes is not used in the first estimate; if most
speeds do, none is used."""


@dataclass(frozen=True, eq=False)
class Smooth:
    """A piece of a track on the common clock: T samples from tick `first` on.

    Attributes:
        first: index of the first sample on the common clock.
        position: (T, 2) metres.
        heading: (T,) rad, unwrapped; NaN if the vehicle never moved and none is recorded.
        speed: (T,) m/s.
        before: (S,) measured speed minus the speed of the raw fixes [m/s], or 0.
        moved: (F,) distance between the raw fixes and the smooth positions [m]; empty if the
            piece is not smoothed.
        noise: standard deviation of the fixes [m], estimated or given.
        turned: (H,) recorded minus smooth headings [rad] while the vehicle moves.
        believed: (S,) whether each measured speed was used.

    Before it is smoothed, its headings and its noise are NaN, and all speeds are believed.
    """

    first: int
    position: Floats
    heading: Floats
    speed: Floats
    before: Floats
    moved: Floats
    noise: float
    turned: Floats
    believed: Bools


class _Fit(NamedTuple):
    """Path and motion fitted to a piece.

    Attributes:
        path: the path.
        distance: (F,) distances driven at the fixes [m].
        coefficients: (T+1,) of the motion.
        noise: standard deviation of the fixes [m].
    """

    path: Path
    distance: Floats
    coefficients: Floats
    noise: float


def interpolated_piece(piece: Observations, origin_ns: int, config: LogConfig) -> Smooth | None:
    """Return a piece on the clock as it was recorded; None if it has fewer than three ticks.

    Arguments as in `smooth_piece`.
    """
    dt = config.period
    fix_t = _seconds(piece.fix_ns, origin_ns)
    first = int(np.ceil(fix_t[0] / dt - 1e-6))
    last = int(np.floor(fix_t[-1] / dt + 1e-6))
    if last - first < 2:
        return None
    ticks = dt * np.arange(last - first + 1, dtype=np.float64)
    fix_t = fix_t - first * dt
    speed_t = _seconds(piece.speed_ns, origin_ns) - first * dt
    speed = piece.speed
    if not len(speed):
        speed_t = fix_t
        speed = speed_of_fixes(fix_t, piece.fix)
    return Smooth(
        first=first,
        position=np.column_stack([np.interp(ticks, fix_t, axis) for axis in piece.fix.T]),
        heading=np.full(len(ticks), np.nan),
        speed=np.interp(ticks, speed_t, speed),
        before=np.zeros(len(piece.speed)),
        moved=np.zeros(0),
        noise=np.nan,
        turned=np.zeros(0),
        believed=np.ones(len(piece.speed), dtype=bool),
    )


def _seconds(stamps: Ints, origin_ns: int) -> Floats:
    return (stamps - origin_ns).astype(np.float64) * 1e-9


def smooth_piece(piece: Observations, raw: Smooth, origin_ns: int, config: LogConfig) -> Smooth:
    """Fit path and motion to a piece of a track.

    Args:
        piece: its fixes and speeds.
        raw: the piece on the clock, as recorded.
        origin_ns: stamp of tick 0 of the common clock.
        config: names period, noise and limits.

    Raises:
        UnreconciledError: no motion of a car fits.
    """
    dt = config.period
    ticks = dt * np.arange(len(raw.speed), dtype=np.float64)
    fix_t = _seconds(piece.fix_ns, origin_ns) - raw.first * dt
    speed_t = _seconds(piece.speed_ns, origin_ns) - raw.first * dt
    stands = standing(ticks, fix_t, piece.fix, ticks, raw.speed)
    held = _without_ends(stands, round(SMOOTHING.settling_s / dt))
    limits = (-config.braking_limit, config.acceleration_limit)
    motion = Motion(held, dt, config.jerk, *limits)
    fix_speed = speed_of_fixes(fix_t, piece.fix)
    noise = config.position_noise or estimated_noise(piece.fix)
    difference = piece.speed - np.interp(speed_t, fix_t, fix_speed)
    believed = _agreeing(speed_t, difference, max(DOUBTED_MPS, 5.0 * noise))
    if believed.sum() <= len(believed) / 2.0:
        believed = np.zeros_like(believed)
    measured = []
    if believed.any():
        usual = np.clip(white_equivalent(difference), *SMOOTHING.speed_noise_mps)
        deviations = np.full(int(believed.sum()), config.speed_noise or float(usual))
        measured = [(speed_t[believed], piece.speed[believed], deviations, True)]
    guess = _first_distances(ticks, stands, raw.speed, np.interp(ticks, fix_t, fix_speed), fix_t)
    is_moving = np.interp(fix_t, ticks, stands) < 0.5

    fit = _fit_in_turn(piece, fix_t, motion, measured, guess, is_moving, noise, config)
    distance, smooth_speed = motion.at_ticks(fit.coefficients)
    position, heading = fit.path.pose(distance)
    is_known = np.isfinite(piece.heading)
    if np.ptp(distance) < SMOOTHING.min_travel_m and not is_known.any():
        heading = np.full(len(distance), np.nan)
    rolling = is_known & (np.gradient(fit.distance, fix_t) > HEADINGS.moving_mps)
    return replace(
        raw,
        position=position,
        heading=heading,
        speed=smooth_speed,
        before=difference,
        believed=believed,
        moved=np.hypot(*(piece.fix - fit.path.pose(fit.distance)[0]).T),
        noise=fit.noise,
        turned=wrap_angle(piece.heading[rolling] - np.interp(fix_t[rolling], ticks, heading)),
    )


def _agreeing(seconds: Floats, difference: Floats, limit: float) -> Bools:
    """Return which speeds (S,) agree with the fixes: those of a stretch in which most do.

    Args:
        seconds: (S,) stamps [s].
        difference: (S,) measured speed minus that of the fixes [m/s].
        limit: largest difference of agreeing speeds [m/s].
    """
    agrees = np.abs(difference) <= limit
    result = np.ones(len(agrees), dtype=bool)
    for begin, end in runs(~agrees):
        result[begin:end] = seconds[end - 1] - seconds[begin] < SMOOTHING.min_doubted_s
    return result


def _fit_in_turn(
    piece: Observations,
    fix_t: Floats,
    motion: Motion,
    measured: Sequence[tuple[Floats, Floats, Floats, bool]],
    distance: Floats,
    is_moving: Bools,
    first_noise: float,
    config: LogConfig,
) -> _Fit:
    """Fit path and motion in turn; the weights of fixes and headings follow from the residuals.

    Args:
        piece: fixes and recorded headings.
        fix_t: (F,) times of the fixes [s].
        motion: the program.
        measured: measured speeds, as in `Motion.solve`.
        distance: (F,) first estimate of the distances driven [m].
        is_moving: (F,) whether the vehicle moves.
        first_noise: standard deviation of the fixes [m].
        config: names the noise, if it is given.

    Raises:
        UnreconciledError: no motion fits.
    """
    weight = np.ones(len(fix_t))
    noise = first_noise
    headings = None
    for _ in range(SMOOTHING.round_count):
        path = _path_through(
            piece, distance, weight, noise, np.gradient(distance, fix_t), headings
        )
        arc, lateral = path.project(distance, piece.fix)
        along = (fix_t, arc, noise / np.sqrt(weight), False)
        coefficients = motion.solve([*measured, along])
        distance = motion.place(coefficients, fix_t)
        longitudinal = arc - distance
        if not config.position_noise:
            noise = residual_noise(first_noise, is_moving, lateral, longitudinal)
        residual = np.maximum(np.hypot(lateral, longitudinal), 1e-9)
        weight = np.minimum(1.0, 2.0 * noise / residual)  # Huber's
        course = path.pose(distance)[1]
        headings = headings_of(piece.heading, course, np.gradient(distance, fix_t))
    return _Fit(path, distance, coefficients, noise)


def _without_ends(stands: Bools, ends: int) -> Bools:
    """Return stands (T,) shorter by `ends` ticks at which the vehicle stops or starts."""
    shortened = np.zeros(len(stands), dtype=bool)
    for begin, end in runs(stands):
        first = begin + ends if begin > 0 else begin
        last = end - ends if end < len(stands) else end
        shortened[first:last] = True
    return shortened


def _first_distances(
    ticks: Floats, stands: Bools, speed: Floats, fix_speed: Floats, fix_t: Floats
) -> Floats:
    """Return a first estimate of the distances driven (F,) [m]: the integral of the speed.

    Args:
        ticks: (T,) [s].
        stands: (T,) whether the vehicle stands.
        speed: (T,) measured [m/s].
        fix_speed: (T,) of the fixes [m/s], used instead if the measured one is far off.
        fix_t: (F,) times of the fixes [s].
    """
    is_doubted = np.abs(speed - fix_speed) > DOUBTED_MPS
    rate = np.where(stands, 0.0, np.where(is_doubted, fix_speed, speed))
    steps = (rate[1:] + rate[:-1]) / 2.0 * np.diff(ticks)
    distance: Floats = np.interp(fix_t, ticks, running_sum(steps))
    return distance


def _path_through(
    piece: Observations,
    distance: Floats,
    weight: Floats,
    noise: float,
    speed: Floats,
    headings: Headings | None,
) -> Path:
    """Fit the path; one that is too short to have a shape is straight, in the recorded heading.

    Args:
        piece: the fixes.
        distance: (F,) distances driven at the fixes [m].
        weight: (F,) in (0, 1].
        noise: standard deviation of the fixes [m].
        speed: (F,) at the fixes [m/s].
        headings: recorded headings, or None.

    Raises:
        UnreconciledError: no path fits.
    """
    low = float(distance.min())
    high = float(distance.max())
    if high - low > SMOOTHING.max_path_m:
        raise UnreconciledError("speeds and positions contradict each other; check their units")
    if high - low >= SMOOTHING.straight_m:
        try:
            return fit_path(distance, piece.fix, weight, noise, speed, headings)
        except np.linalg.LinAlgError as error:
            raise UnreconciledError(f"no smooth path leads through the fixes: {error}") from error
    known = piece.heading[np.isfinite(piece.heading)]
    if len(known):
        heading = float(np.arctan2(np.median(np.sin(known)), np.median(np.cos(known))))
    else:  # direction of the regression of the fixes on the distance
        x, y = (distance - distance.mean()) @ (piece.fix - piece.fix.mean(axis=0))
        heading = float(np.arctan2(y, x))
    point = np.median(piece.fix, axis=0)
    return straight_path(point, heading, 2.0 * float(np.median(distance)) - high, high)


def standing(ticks: Floats, fix_t: Floats, fix: Floats, speed_t: Floats, speed: Floats) -> Bools:
    """Return at which ticks (T,) a vehicle stands: slow for a second, with fixes in place.

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
    for slow_begin, slow_end in runs(smooth < SMOOTHING.standing_mps):
        slow = smooth[slow_begin:slow_end]
        still_mps = max(SMOOTHING.still_mps, 1.5 * float(np.median(slow)))
        still = slow_begin + np.flatnonzero(slow <= still_mps)  # not rolling before and after
        begin = int(still[0])
        end = int(still[-1]) + 1
        first = np.searchsorted(fix_t, ticks[begin])
        inside = fix[first : np.searchsorted(fix_t, ticks[end - 1], side="right")]
        if (end - begin) * dt >= 1.0 and len(inside):
            n_ends = max(len(inside) // 5, 1)
            shift = np.median(inside[-n_ends:], axis=0) - np.median(inside[:n_ends], axis=0)
            stands[begin:end] = np.hypot(*shift) <= SMOOTHING.max_shift_m
    return stands
